//! The JSON of a house, with the keys of 3D-FRONT's third release.

use glam::{DVec2, DVec3};
use serde_json::{Map, Value, json};

use super::architecture::ArchitectureMesh;
use super::layout::{HEIGHT, THICKNESS};
use super::materials::ArchitectureMaterial;
use super::plan::{Furniture, House, Room};

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
