//! Plants faults in a dataset and renews its hashes, so that only the content can reveal a fault.

use std::path::{Path, PathBuf};

use mateval_dataset::{json, manifest};
use mateval_image::Picture;
use serde_json::Value;

/// The scene of a damaged dataset.
pub struct Room(PathBuf);

impl Room {
    /// The scene `room` of the dataset.
    pub fn of(dataset: &Path) -> Self {
        Self(dataset.join("scenes/room"))
    }

    /// A file of the scene.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Changes `scene.json`.
    pub fn edit_scene(&self, change: impl FnOnce(&mut Value)) {
        edit_json(&self.file("scene.json"), change);
    }

    /// Changes a picture of ids.
    pub fn edit_ids(&self, name: &str, change: impl FnMut(u16) -> u16) {
        let path = self.file(name);
        let picture = mateval_image::png_io::read_ids(&path).unwrap().map(change);
        mateval_image::png_io::write_ids(&path, &picture).unwrap();
    }

    /// Changes a mask; the arguments of `change` are column, row and whether the pixel counts.
    pub fn edit_mask(&self, name: &str, change: impl Fn(usize, usize, bool) -> bool) {
        let path = self.file(name);
        let mask = mateval_image::png_io::read_mask(&path).unwrap();
        let changed = Picture::from_fn(mask.width(), mask.height(), |x, y| change(x, y, mask.get(x, y)));
        assert_ne!(changed, mask, "nothing was planted in {name}");
        mateval_image::png_io::write_mask(&path, &changed).unwrap();
    }

    /// Changes the floats of an attribute of the node `node` in a GLB's binary chunk, one after the other.
    pub fn edit_glb(&self, name: &str, node: &str, attribute: &str, change: impl FnMut(usize, f32) -> f32) {
        let path = self.file(name);
        let mut bytes = std::fs::read(&path).unwrap();
        edit_glb_floats(&mut bytes, node, attribute, change);
        std::fs::write(path, bytes).unwrap();
    }
}

/// Changes a JSON file.
pub fn edit_json(path: &Path, change: impl FnOnce(&mut Value)) {
    let mut value = super::sample::json(path);
    change(&mut value);
    json::write(path, &value).unwrap();
}

/// Renews MANIFEST.sha256, and its hash in dataset.json.
pub fn rehash(dataset: &Path) {
    let hash = manifest::write(dataset).unwrap();
    edit_json(&dataset.join("dataset.json"), |file| file["manifest_sha256"] = Value::from(hash));
}

/// glTF 2.0, "Binary glTF layout": a header of 12 bytes; chunks of length, type, data: JSON first, then the binary one.
fn edit_glb_floats(bytes: &mut [u8], node: &str, attribute: &str, mut change: impl FnMut(usize, f32) -> f32) {
    let number = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
    let json_length = number(12);
    let file: Value = serde_json::from_slice(&bytes[20..20 + json_length]).unwrap();
    let binary = 20 + json_length + 8;
    let named = |list: &str| file[list].as_array().unwrap().iter().find(|entry| entry["name"] == node).unwrap().clone();
    let accessor = named("meshes")["primitives"][0]["attributes"][attribute].as_u64().unwrap() as usize;
    let accessor = &file["accessors"][accessor];
    let view = &file["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let start = binary + view["byteOffset"].as_u64().unwrap() as usize;
    let length = view["byteLength"].as_u64().unwrap() as usize;
    for (at, value) in bytes[start..start + length].as_chunks_mut::<4>().0.iter_mut().enumerate() {
        *value = change(at, f32::from_le_bytes(*value)).to_le_bytes();
    }
}

/// `world_from_camera` of a view of `scene.json` rolled about the camera's own axis.
pub fn roll(view: &mut Value, degrees: f64) {
    let matrix = &mut view["camera"]["world_from_camera"];
    let (sin, cos) = degrees.to_radians().sin_cos();
    for row in 0..3 {
        let [x, y] = [0, 1].map(|column| matrix[row][column].as_f64().unwrap());
        matrix[row][0] = Value::from(x * cos + y * sin);
        matrix[row][1] = Value::from(y * cos - x * sin);
    }
}
