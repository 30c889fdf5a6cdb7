//! The built-in sample: a small room and a house under CC0, on which every command can be tried without a download.
//!
//! The input is a folder. Written into it are `recipe.toml`, which lists both scenes, and two sources:
//! - `room/`, a Mitsuba scene laid out as Bitterli's are: `scene.xml`, OBJ files, textures, `LICENSE.txt`;
//! - `house/`, two rooms in the layout of 3D-FRONT and 3D-FUTURE.
//!
//! The bytes are the same on every machine.
//!
//! `solid` builds meshes and combines them into furniture, `pattern` paints the textures, and `room` places the
//! furniture and writes the XML. `house` also uses the first two.

pub mod house;
pub mod pattern;
mod room;
pub mod solid;

use std::path::Path;

use mateval_image::png_io::write_rgb_bytes;

pub use house::files::SampleError;
use house::files::{LICENSE, create_folder, write_text};

/// Width and height of the recipe's views, in pixels.
const RESOLUTION: [u32; 2] = [320, 240];

/// A recipe with one scene from each source, after its head.
const SCENES: &str = r#"
[[scene]]
id = "living"
camera = { designer = 0 }

[scene.front3d]
house = "house/3D-FRONT/cc000000-5a3b-4e00-8000-000000000001.json"
room = "LivingDiningRoom-101"
models = "house/3D-FUTURE-model"
textures = "house/3D-FRONT-texture"

[[scene]]
id = "room"
bitterli = "room/scene.xml"
"#;

/// The licence of the house; the room's lies beside it.
const LICENCE: &str = "licences = { front3d = \"CC0-1.0\" }\n";

/// Writes the sample into the folder `out`, which is created if it is missing. Files of the same name are replaced.
pub fn write(out: &Path) -> Result<(), SampleError> {
    write_at(out, RESOLUTION)
}

/// [`write()`] with a recipe whose views have `width` times `height` pixels.
pub fn write_at(out: &Path, [width, height]: [u32; 2]) -> Result<(), SampleError> {
    write_room(out)?;
    house::write(out)?;
    // The recipe is written last, so that a folder with a recipe holds a complete sample.
    let recipe = format!("name = \"sample\"\nresolution = [{width}, {height}]\n{LICENCE}{SCENES}");
    write_text(&out.join("recipe.toml"), &recipe)
}

/// The start of the ids of varied houses' scenes, and their room.
const VARIED_ROOMS: [(&str, &str); 2] = [("living", "LivingDiningRoom-101"), ("bedroom", "MasterBedroom-102")];

/// Writes `count` houses made of the built-in one into the folder `out`, with a recipe of one scene a house. The same
/// `seed` gives the same houses.
pub fn write_houses(out: &Path, count: u32, seed: u64) -> Result<(), SampleError> {
    let [width, height] = RESOLUTION;
    let mut recipe = format!("name = \"houses\"\nresolution = [{width}, {height}]\n{LICENCE}");
    for (at, file) in house::write_variants(out, count, seed)?.into_iter().enumerate() {
        let (kind, room) = VARIED_ROOMS[at % VARIED_ROOMS.len()];
        recipe += &format!(
            "\n[[scene]]\nid = \"{kind}{at:03}\"\ncamera = {{ designer = 0 }}\n\n[scene.front3d]\nhouse = \"{file}\"\n\
             room = \"{room}\"\nmodels = \"house/3D-FUTURE-model\"\ntextures = \"house/3D-FRONT-texture\"\n"
        );
    }
    write_text(&out.join("recipe.toml"), &recipe)
}

fn write_room(out: &Path) -> Result<(), SampleError> {
    let room = out.join("room");
    for folder in ["models", "textures"] {
        create_folder(&room.join(folder))?;
    }
    for (name, picture) in pattern::all() {
        write_rgb_bytes(&room.join("textures").join(format!("{name}.png")), &picture)?;
    }
    for item in room::items() {
        write_text(&room.join("models").join(format!("{}.obj", item.name)), &item.solid.to_obj())?;
    }
    let what = "This is the Mitsuba version of 'The Sample Room' by the MatEval authors, made by `mateval sample`";
    write_text(&room.join("LICENSE.txt"), &format!("{what}\n{LICENSE}"))?;
    write_text(&room.join("scene.xml"), &room::xml())
}

#[cfg(test)]
mod tests {
    use mateval_dataset::Severity;
    use mateval_dataset::material::{ConductorIor, MaterialModel};
    use mateval_dataset::reference::Emission;
    use mateval_sources::bitterli::{self, Limits};
    use mateval_sources::source_scene::FileScene;

    use super::*;

    fn sample() -> FileScene {
        let folder = tempfile::tempdir().unwrap();
        write_room(folder.path()).unwrap();
        bitterli::read(&folder.path().join("room/scene.xml"), None, &Limits::default()).unwrap()
    }

    #[test]
    fn it_reads_back_without_a_warning() {
        let room = sample();
        let warnings: Vec<_> = room.findings.iter().filter(|f| f.severity != Severity::Note).collect();
        assert!(warnings.is_empty(), "{warnings:?}");
        assert!(room.licence.is_some());
        assert_eq!(room.camera.map(|camera| (camera.intrinsics.width, camera.intrinsics.height)), Some((320, 240)));
    }

    #[test]
    fn it_covers_the_materials_and_lights_and_stays_small() {
        let FileScene { scene, .. } = sample();
        let triangles: usize = scene.surfaces.iter().map(|s| s.mesh.triangles.len()).sum();
        assert!((500..5000).contains(&triangles), "{triangles}");
        let models: Vec<_> = scene.materials.iter().map(|m| m.model).collect();
        let mirror = |m: &MaterialModel| matches!(m, MaterialModel::Conductor { ior: ConductorIor::PerfectMirror, .. });
        assert!(models.iter().any(mirror));
        assert!(models.iter().any(|m| matches!(m, MaterialModel::ThinDielectric { .. })));
        assert!(models.iter().any(|m| matches!(m, MaterialModel::Conductor { microfacets: Some(_), .. })));
        let kinds = |wanted: fn(&Emission) -> bool| scene.lights.iter().filter(|light| wanted(&light.emission)).count();
        assert_eq!(kinds(|e| matches!(e, Emission::Area { .. })), 2);
        assert_eq!(kinds(|e| matches!(e, Emission::Environment { .. })), 1);
    }

    /// The centre of each main object projects into the picture.
    #[test]
    fn the_main_objects_are_in_view() {
        let room = sample();
        let camera = room.camera.unwrap();
        for name in ["mirror", "window_glass", "table", "sofa", "shelf", "rug", "lamp_stand"] {
            let surface = room.scene.surfaces.iter().find(|s| s.name == name).unwrap();
            let sum: glam::Vec3 = surface.mesh.positions.iter().sum();
            let middle = (sum / surface.mesh.positions.len() as f32).as_dvec3();
            let (pixel, _) = camera.project(middle).unwrap();
            assert!(camera.holds(pixel), "{name} {pixel}");
        }
    }

    /// The floor faces up, the ceiling and its light face down.
    #[test]
    fn floor_and_ceiling_face_the_room() {
        let room = sample();
        for (name, up) in [("floor", 1.0), ("ceiling", -1.0), ("ceiling_light", -1.0)] {
            let mesh = &room.scene.surfaces.iter().find(|s| s.name == name).unwrap().mesh;
            let [a, b, c] = mesh.corners(0);
            assert_eq!((b - a).cross(c - a).normalize().y.round(), up, "{name}");
        }
    }

    /// One hash over all textures, meshes and the XML, so that a difference in any platform's arithmetic shows.
    #[test]
    fn the_bytes_have_the_pinned_hash() {
        use sha2::{Digest as _, Sha256};
        let mut hash = Sha256::new();
        for (_, picture) in pattern::all() {
            picture.pixels().iter().for_each(|pixel| hash.update(pixel));
        }
        for item in room::items() {
            hash.update(item.solid.to_obj());
        }
        hash.update(room::xml());
        let hex: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, "777a39359a062564d3e311817f14b1f2d3cefea7e69dd971ea1162ade6141195");
    }
}
