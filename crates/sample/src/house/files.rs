//! The files of a house: its JSON, with the keys of 3D-FRONT's third release, and its models: for each a folder with
//! `raw_model.obj`, `model.mtl` and `texture.png`, and `model_info.json`, which lists them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use glam::{DVec2, DVec3};
use mateval_files::FileError;
use mateval_image::png_io::write_rgba_bytes;
use serde_json::{Map, Value, json};

use super::layout::{ArchitectureMesh, Furniture, HEIGHT, House, Room, THICKNESS};
use super::materials::{self, ArchitectureMaterial, Swatch};
use super::models::Model;
use crate::solid::Solid;

/// The id of the house: made up, shaped as the data's.
pub const HOUSE_ID: &str = "cc000000-5a3b-4e00-8000-000000000001";

/// A number with at most five decimals. Whole numbers are written without a point, as in the data.
pub fn number(value: f64) -> Value {
    let rounded = (value * 1e5).round() / 1e5;
    if rounded.fract() == 0.0 { json!(rounded as i64) } else { json!(rounded) }
}

/// A list of [`number`]s.
fn numbers(values: impl IntoIterator<Item = f64>) -> Value {
    values.into_iter().map(number).collect()
}

/// The coordinates of all points in one list.
fn flat(points: &[DVec3]) -> Value {
    numbers(points.iter().flat_map(|p| p.to_array()))
}

/// The whole house. Its first room is the living room, which has the lights.
pub fn house_json(house: &House) -> Value {
    // Meshes and furniture of all rooms are in one list each, to which the rooms' children refer.
    let (mut meshes, mut rooms, mut pieces): (Vec<Value>, Vec<Value>, usize) = Default::default();
    for room in &house.rooms {
        let size = room.high - room.low;
        let first = meshes.len();
        meshes.extend(room.meshes.iter().zip(first..).map(|(mesh, place)| mesh_entry(house, mesh, place)));
        let mut children: Vec<Value> = meshes[first..].iter().zip(first..).map(mesh_child).collect();
        for record in &room.furniture {
            children.extend(record.pieces.iter().zip(100 + pieces..).map(|((at, turn), number)| {
                json!({
                    "ref": record.uid, "instanceid": format!("furniture/{number}"), "pos": numbers(*at),
                    "rot": numbers(*turn), "scale": [1, 1, 1],
                })
            }));
            pieces += record.pieces.len();
        }
        rooms.push(json!({
            "type": room.kind, "instanceid": room.name, "size": number(size.x * size.y), "pos": [0, 0, 0],
            "rot": [0, 0, 0, 1], "scale": [1, 1, 1], "children": children, "empty": 0,
        }));
    }
    // The lists around them. In the data the box's `min` has the greatest z.
    let records = house.rooms.iter().flat_map(|room| &room.furniture);
    let [low, high] = house.outline();
    let (low, high) = (low - THICKNESS, high + THICKNESS);
    json!({
        "uid": HOUSE_ID, "jobid": "cc000000-5a3b-4e00-8000-000000000002", "version": "2.0", "design_version": "0.1",
        "code_version": "0.11", "north_vector": [0, 1, 0],
        "furniture": records.map(|record| furniture_entry(house, record)).collect::<Value>(),
        "mesh": meshes,
        "material": house.materials.iter().map(|material| material_entry(house, material)).collect::<Value>(),
        "lights": lights(&house.rooms[0]), "extension": extension(house),
        "scene": {
            "ref": "-1", "pos": [0, 0, 0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1], "room": rooms,
            "boundingBox": { "min": numbers([low.x, 0.0, high.y]), "max": numbers([high.x, HEIGHT, low.y]) },
        },
        "groups": [], "materialList": house.textures.iter().map(|texture| texture.jid()).collect::<Value>(),
    })
}

/// The id of a material, made of its position in the list and shaped as the data's.
pub fn material_uid(house: &House, name: &str) -> String {
    let place = house.materials.iter().position(|material| material.name == name);
    format!("101000000003/{:05}", place.expect("meshes name materials of the list"))
}

fn mesh_entry(house: &House, mesh: &ArchitectureMesh, place: usize) -> Value {
    let uvs = mesh.uvs.iter().flat_map(|uv: &DVec2| uv.to_array());
    json!({
        "uid": format!("101000000002/{place}"), "jid": "", "aid": [], "xyz": flat(&mesh.positions),
        "normal": flat(&mesh.normals), "uv": numbers(uvs), "faces": mesh.faces.as_flattened(),
        "material": material_uid(house, mesh.material), "type": mesh.kind, "constructid": format!("{place}"),
        "instanceid": "",
    })
}

fn mesh_child((mesh, place): (&Value, usize)) -> Value {
    json!({
        "ref": mesh["uid"], "instanceid": format!("mesh/{}", 1000 + place), "pos": [0, 0, 0], "rot": [0, 0, 0, 1],
        "scale": [1, 1, 1],
    })
}

fn material_entry(house: &House, material: &ArchitectureMaterial) -> Value {
    let [r, g, b] = material.color;
    let mut entry = json!({
        "uid": material_uid(house, material.name), "aid": [], "jid": "local", "texture": "", "normaltexture": "",
        "color": [r, g, b, 255], "seamWidth": 0, "useColor": material.texture.is_none(), "contentType": material.content,
    });
    if let Some(name) = material.texture {
        let texture = house.textures.iter().find(|texture| texture.name == name);
        let texture = texture.expect("materials name textures of the list");
        entry["jid"] = texture.jid().into();
        let matrix = texture.stored.uv_transform(texture.tile).map(number);
        entry["UVTransform"] = matrix.to_vec().into();
        entry["normalUVTransform"] = matrix.to_vec().into();
    }
    entry
}

/// `size` and `bbox` are in the order x, z, y of the later releases.
fn furniture_entry(house: &House, record: &Furniture) -> Value {
    let model = house.model(record.model);
    let [low, high] = model.bounds();
    let size = numbers([high.x - low.x, high.z - low.z, high.y - low.y]);
    let category = if model.info[1].is_empty() { "Others" } else { model.info[1] };
    json!({
        "uid": record.uid, "aid": [], "title": record.title, "type": "standard", "jid": model.jid(), "valid": true,
        "category": category, "sourceCategoryId": "cc000000-5a3b-4e00-8000-000000000003", "size": size, "bbox": size,
    })
}

/// Skylight in the living room's window, the sun, and the floor lamp, in V-Ray's units.
fn lights(room: &Room) -> Value {
    let light = |place: u32, kind: &str, at: [f64; 3], direction: [f64; 3], multiplier: f64| {
        json!({
            "uid": format!("101000000004/{place}"), "nodeType": kind, "roomId": room.name,
            "src_position": numbers(at), "direction": numbers(direction), "up_vector": [0, 1, 0],
            "multiplier": number(multiplier), "color_temperature": 5200,
        })
    };
    let mut window = light(0, "VRayLight", [2.8, 1.6, -0.1], [0.0, 0.0, 1.0], 12.0);
    window["size0"] = number(1.4);
    window["size1"] = number(0.7);
    window["skylightPortal"] = true.into();
    json!([
        window,
        light(1, "VraySun", [-6.0, 9.0, -8.0], [0.5, -0.66, 0.56], 0.02),
        light(2, "FurnitureLight", [3.15, 1.5, 4.05], [0.0, -1.0, 0.0], 80_000.0),
    ])
}

fn extension(house: &House) -> Value {
    let snapshots = house.rooms.iter().flat_map(|room| room.cameras.iter().map(move |camera| (room, camera)));
    let snapshots = snapshots.map(|(room, camera)| {
        json!({
            "roomId": room.name, "pos": numbers(camera.at), "target": numbers(camera.target), "up": [0, 1, 0],
            "near": 0.1, "far": 1000, "fov": number(camera.fov_y_deg), "aspect": 1.5,
        })
    });
    let area = |room: &Room| json!({"roomId": room.name, "value": number((room.high - room.low).element_product())});
    json!({
        "door": [], "outdoor": "", "pano": Map::new(), "mini_map": "", "perspective_view": { "link": [] },
        "area": house.rooms.iter().map(area).collect::<Value>(), "snapshots": snapshots.collect::<Value>(),
        "temperature": 5200, "skybox": "",
    })
}

/// The text of the file: one line with sorted keys.
pub fn text(mut house: Value) -> String {
    house.sort_all_objects();
    let mut text = house.to_string();
    text.push('\n');
    text
}

/// Decimals of numbers in OBJ files, which are in metres.
const DECIMALS: usize = 5;

/// Writes a model's folder into `library`, without its texture.
pub(super) fn write_shape(library: &Path, model: &Model) -> Result<(), SampleError> {
    let folder = library.join(model.jid());
    create_folder(&folder)?;
    write_text(&folder.join("raw_model.obj"), &obj(model))?;
    write_text(&folder.join("model.mtl"), &mtl(model))
}

/// Writes a model's texture into its folder in `library`.
pub(super) fn write_picture(library: &Path, model: &Model) -> Result<(), SampleError> {
    let path = library.join(model.jid()).join("texture.png");
    Ok(write_rgba_bytes(&path, &materials::swatch_picture(&model.swatches, model.side))?)
}

/// The text of `model_info.json`.
pub(super) fn model_info(models: &[Model]) -> String {
    let word = |word: &str| if word.is_empty() { Value::Null } else { word.into() };
    let entry = |model: &Model| {
        let [sup, category, style, theme, material] = model.info.map(word);
        json!({
            "model_id": model.jid(), "super-category": sup, "category": category, "style": style, "theme": theme,
            "material": material,
        })
    };
    let mut list: Value = models.iter().map(entry).collect();
    list.sort_all_objects();
    mateval_dataset::json::to_text(&list)
}

/// The names of a model's OBJ groups, one for each part.
fn groups(model: &Model) -> Vec<String> {
    let (mut solids, mut glasses) = (0, 0);
    let name = |part: usize| {
        let (word, count) = if model.glass == Some(part) { ("glass", &mut glasses) } else { ("solid", &mut solids) };
        *count += 1;
        format!("{word}_{count:03}")
    };
    (0..model.parts.len()).map(name).collect()
}

/// Materials in 3ds Max's style, one for each group. As in the data, they do not describe the appearance; the texture
/// does.
fn mtl(model: &Model) -> String {
    let mut text = String::from("# made by MatEval, CC0 1.0\n");
    for group in groups(model) {
        // Writing to a String cannot fail.
        let _ = write!(
            text,
            "\nnewmtl {group}\n\tNs 10\n\tNi 1.5\n\td 1\n\tTr 0\n\tillum 2\n\tKa 0.588 0.588 0.588\n\
             \tKd 0.588 0.588 0.588\n\tKs 0 0 0\n\tTf 0 0 0\n\tKe 0 0 0\n\tmap_Kd ./texture.png\n"
        );
    }
    text
}

/// Rows of numbers, each stored once, and their line numbers.
#[derive(Default)]
struct Numbered<const N: usize> {
    seen: BTreeMap<[i64; N], usize>,
    rows: Vec<[i64; N]>,
}

impl<const N: usize> Numbered<N> {
    /// The line number, from 1, of the row with these values.
    fn number(&mut self, values: [f64; N]) -> usize {
        let whole = values.map(|value| (value * 1e5).round() as i64);
        *self.seen.entry(whole).or_insert_with(|| {
            self.rows.push(whole);
            self.rows.len()
        })
    }

    fn push(&self, text: &mut String, head: &str) {
        for row in &self.rows {
            text.push_str(head);
            for whole in row {
                let sign = if *whole < 0 { "-" } else { "" };
                let (units, rest) = (whole.abs() / 100_000, whole.abs() % 100_000);
                let _ = write!(text, " {sign}{units}.{rest:0DECIMALS$}");
            }
            text.push('\n');
        }
    }
}

/// The mesh as OBJ, in triangles.
fn obj(model: &Model) -> String {
    // Faces come first, since they collect the rows that they refer to.
    let (mut positions, mut uvs, mut normals) = Default::default();
    let mut faces = String::new();
    for ((part, group), field_uv) in model.parts.iter().zip(groups(model)).zip(field_uvs(model)) {
        let _ = write!(faces, "g {group}\nusemtl {group}\ns 1\n");
        push_faces(&mut faces, &part.1, field_uv, (&mut positions, &mut uvs, &mut normals));
    }
    // In the file the rows stand before the faces.
    let mut text = String::from("# made by MatEval, CC0 1.0\nmtllib ./model.mtl\n");
    positions.push(&mut text, "v");
    uvs.push(&mut text, "vt");
    normals.push(&mut text, "vn");
    text + &faces
}

/// Appends a solid's faces, each split into triangles.
fn push_faces(
    text: &mut String,
    solid: &Solid,
    field_uv: impl Fn(DVec2) -> DVec2,
    (positions, uvs, normals): (&mut Numbered<3>, &mut Numbered<2>, &mut Numbered<3>),
) {
    for face in &solid.faces {
        let corners: Vec<String> = face
            .iter()
            .map(|&i| {
                let p = positions.number(solid.positions[i].to_array());
                let uv = uvs.number(field_uv(solid.uvs[i]).to_array());
                format!("{p}/{uv}/{}", normals.number(solid.normals[i].to_array()))
            })
            .collect();
        for pair in corners[1..].windows(2) {
            let _ = writeln!(text, "f {} {} {}", corners[0], pair[0], pair[1]);
        }
    }
}

/// For each part the map from its own texture coordinates into its field of the texture. Letters fill their field. All
/// parts of any other field share one scale, so that grain is as wide on small parts as on large ones.
fn field_uvs(model: &Model) -> Vec<impl Fn(DVec2) -> DVec2 + use<>> {
    let bounds = |solid: &Solid| {
        let low = solid.uvs.iter().fold(DVec2::MAX, |low, uv| low.min(*uv));
        (low, solid.uvs.iter().fold(DVec2::MIN, |high, uv| high.max(*uv)) - low)
    };
    let largest = |field: usize| {
        let parts = model.parts.iter().filter(|(other, _)| *other == field);
        parts.fold(0.0_f64, |most, (_, solid)| most.max(bounds(solid).1.max_element()))
    };
    let into_field = |(field, solid): &(usize, Solid)| {
        let (low, size) = bounds(solid);
        let letters = matches!(model.swatches[*field], Swatch::Text { .. });
        let span = if letters { size } else { DVec2::splat(largest(*field)) };
        let (corner, width) = materials::swatch_field(*field, model.side);
        move |uv: DVec2| DVec2::from(corner) + (uv - low) / span * width
    };
    model.parts.iter().map(into_field).collect()
}

/// Why the built-in scenes could not be written.
#[derive(Debug, thiserror::Error)]
pub enum SampleError {
    #[error(transparent)]
    Files(#[from] FileError),
    /// A picture could not be written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

/// The text of a scene's licence file, CC0 1.0, after what it is.
pub(crate) const LICENSE: &str = "
This scene was released under a CC0 license and is in the public domain.
It may be copied, modified and used commercially, without permission or
attribution.

For more information about the license, please see
https://creativecommons.org/publicdomain/zero/1.0/\n";

pub(crate) fn create_folder(path: &Path) -> Result<(), SampleError> {
    std::fs::create_dir_all(path).map_err(FileError::io("create", path))?;
    Ok(())
}

/// Writes `text` to `path`, replacing a file of that name.
pub(crate) fn write_text(path: &Path, text: &str) -> Result<(), SampleError> {
    std::fs::write(path, text).map_err(FileError::io("write", path))?;
    Ok(())
}
