//! The JSON of the house before faults are planted, with the keys of 3D-FRONT's third release.

use glam::{DVec2, DVec3};
use serde_json::{Map, Value, json};

use super::json_number::{number, numbers};
use super::layout::{self, ROOMS};
use super::models::Model;
use super::pieces::{PIECES, RECORDS, Record, Validity, record_of};
use super::surfaces::ArchitectureMesh;
use super::textures::ArchitectureTexture;
use super::{materials, uids};

/// The coordinates of all points in one list.
fn flat(points: &[DVec3]) -> Value {
    numbers(points.iter().flat_map(|p| p.to_array()))
}

/// The whole house.
pub(super) fn house(models: &[Model], textures: &[ArchitectureTexture]) -> Value {
    // The meshes of all rooms are in one list, to which the rooms' children refer.
    let mut meshes: Vec<Value> = Vec::new();
    let mut rooms: Vec<Value> = Vec::new();
    for (place, room) in ROOMS.iter().enumerate() {
        let first = meshes.len();
        meshes.extend(layout::meshes(place).iter().zip(first..).map(|(mesh, place)| mesh_entry(mesh, place)));
        let size = room.high - room.low;
        rooms.push(json!({
            "type": room.kind, "instanceid": room.name, "size": number(size.x * size.y), "pos": [0, 0, 0],
            "rot": [0, 0, 0, 1], "scale": [1, 1, 1], "children": children(place, &meshes[first..], first), "empty": 0,
        }));
    }
    // The lists around them.
    let jids: Vec<String> = textures.iter().map(|texture| uids::texture(texture.number)).collect();
    json!({
        "uid": uids::HOUSE, "jobid": "cc000000-5a3b-4e00-8000-000000000002", "version": "2.0", "design_version": "0.1",
        "code_version": "0.11", "north_vector": [0, 1, 0],
        "furniture": RECORDS.iter().zip(1..).map(|(record, place)| furniture_entry(record, place, models)).collect::<Value>(),
        "mesh": meshes,
        "material": materials::ALL.iter().map(|material| materials::json(material, textures)).collect::<Value>(),
        "lights": lights(), "extension": extension(),
        "scene": {
            "ref": "-1", "pos": [0, 0, 0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1], "room": rooms,
            "boundingBox": { "min": [-0.2, 0, 8.4], "max": [10.2, layout::HEIGHT, -0.2] },
        },
        "groups": [], "materialList": jids,
    })
}

fn mesh_entry(mesh: &ArchitectureMesh, place: usize) -> Value {
    let uvs = mesh.uvs.iter().flat_map(|uv: &DVec2| uv.to_array());
    json!({
        "uid": format!("101000000002/{place}"), "jid": "", "aid": [], "xyz": flat(&mesh.positions),
        "normal": flat(&mesh.normals), "uv": numbers(uvs),
        "faces": mesh.faces.as_flattened(), "material": materials::uid(mesh.material), "type": mesh.kind,
        "constructid": format!("{place}"), "instanceid": "",
    })
}

/// The children of a room: its meshes, then its furniture.
fn children(room: usize, meshes: &[Value], first: usize) -> Value {
    let pieces = PIECES.iter().enumerate().filter(|(_, piece)| piece.room == room);
    let meshes = meshes.iter().zip(first..).map(|(mesh, place)| {
        json!({
            "ref": mesh["uid"], "instanceid": format!("mesh/{}", 1000 + place), "pos": [0, 0, 0], "rot": [0, 0, 0, 1],
            "scale": [1, 1, 1],
        })
    });
    let pieces = pieces.map(|(place, piece)| {
        json!({
            "ref": piece.uid, "instanceid": format!("furniture/{}", 100 + place), "pos": numbers(piece.at),
            "rot": numbers(piece.turn), "scale": [1, 1, 1],
        })
    });
    meshes.chain(pieces).collect()
}

/// A record of the `furniture` list. `size` and `bbox` are in the order x, z, y of the later releases. A model that is
/// missing from the library gets an id made of `place`, the record's number in the list.
fn furniture_entry(record: &Record, place: u32, models: &[Model]) -> Value {
    let mut entry = json!({
        "uid": record.uid, "aid": [], "title": record.title, "type": "standard", "jid": uids::model(900 + place),
        "category": "Others", "sourceCategoryId": "cc000000-5a3b-4e00-8000-000000000003",
    });
    match record.validity {
        Validity::Valid => entry["valid"] = true.into(),
        Validity::Invalid => entry["valid"] = false.into(),
        Validity::Absent => {}
    }
    // What follows from the model.
    let Some(model) = models.iter().find(|model| model.name == record.model) else { return entry };
    let points = || model.parts.iter().flat_map(|(_, solid)| &solid.positions);
    let size = points().fold(DVec3::MIN, |high, p| high.max(*p)) - points().fold(DVec3::MAX, |low, p| low.min(*p));
    entry["jid"] = model.jid().into();
    if !model.info[1].is_empty() {
        entry["category"] = model.info[1].into();
    }
    entry["size"] = numbers([size.x, size.z, size.y]);
    entry["bbox"] = entry["size"].clone();
    entry
}

/// Skylight in the living room's window, the sun, and the floor lamp, in V-Ray's units.
fn lights() -> Value {
    let light = |place: u32, kind: &str, room: usize, at: [f64; 3], direction: [f64; 3], multiplier: f64| {
        json!({
            "uid": format!("101000000004/{place}"), "nodeType": kind, "roomId": ROOMS[room].name,
            "src_position": numbers(at), "direction": numbers(direction), "up_vector": [0, 1, 0],
            "multiplier": number(multiplier), "color_temperature": 5200,
        })
    };
    let mut window = light(0, "VRayLight", 0, [2.8, 1.6, -0.1], [0.0, 0.0, 1.0], 12.0);
    window["size0"] = number(1.4);
    window["size1"] = number(0.7);
    window["skylightPortal"] = true.into();
    json!([
        window,
        light(1, "VraySun", 0, [-6.0, 9.0, -8.0], [0.5, -0.66, 0.56], 0.02),
        light(2, "FurnitureLight", 0, [3.15, 1.5, 4.05], [0.0, -1.0, 0.0], 80_000.0),
    ])
}

/// Designers' cameras: room, position, target and vertical field of view in degrees.
const SNAPSHOTS: [(usize, [f64; 3], [f64; 3], f64); 6] = [
    (0, [5.5, 1.5, 3.9], [1.8, 0.85, 1.7], 60.0),
    (0, [0.6, 1.5, 2.2], [6.1, 1.0, 2.0], 55.0),
    (0, [3.6, 1.45, 0.5], [1.2, 0.7, 3.6], 62.0),
    (1, [6.5, 1.55, 3.9], [8.5, 0.75, 0.9], 62.0),
    (2, [5.2, 1.6, 5.0], [1.9, 0.7, 7.6], 60.0),
    (2, [0.5, 1.55, 7.3], [5.0, 1.0, 5.7], 60.0),
];

fn extension() -> Value {
    let snapshots: Value = SNAPSHOTS
        .iter()
        .map(|&(room, at, target, fov)| {
            json!({
                "roomId": ROOMS[room].name, "pos": numbers(at), "target": numbers(target), "up": [0, 1, 0],
                "near": 0.1, "far": 1000, "fov": number(fov), "aspect": 1.5,
            })
        })
        .collect();
    let leaf = record_of("3014/model").uid;
    let area: Value = ROOMS
        .iter()
        .map(|room| json!({"roomId": room.name, "value": number((room.high - room.low).element_product())}))
        .collect();
    json!({
        "door": [{ "type": "interiorDoor", "roomId": ROOMS[0].name, "dir": "outerLeft", "ref": [leaf] }],
        "outdoor": "", "pano": Map::new(), "mini_map": "", "perspective_view": { "link": [] }, "area": area,
        "snapshots": snapshots, "temperature": 5200, "skybox": "",
    })
}

/// The text of the file: one line with sorted keys.
pub(super) fn text(mut house: Value) -> String {
    house.sort_all_objects();
    let mut text = house.to_string();
    text.push('\n');
    text
}
