//! The built-in house with a third room, a library, and with every kind of fault found in 3D-FRONT and 3D-FUTURE.
//! The reader of 3D-FRONT is tested on it without a download.
//!
//! The input is a folder. Written into it is `house/`, as by `mateval_sample` except for the faults: the layout's JSON
//! is changed before it is written, models and textures are damaged afterwards. The bytes are the same on every
//! machine.
//!
//! This file builds the third room; `faults` lists the faults and plants them. The third room lies south of the living
//! room behind the door, and its window is an open hole. It has one fault before any is planted: no ceiling. The first
//! two rooms stay sound except for the normals of two walls and, in `/material/7`, the outer walls' "local"; all other
//! faults are in the third room.

pub mod faults;

use std::path::Path;

use glam::{DVec2, DVec3};
use mateval_sample::house::files::{HOUSE_ID, house_json, text};
use mateval_sample::house::layout::{
    ArchitectureMesh, DOOR, Furniture, House, NORTH, Opening, Outline, Room, SOUTH, Snapshot, WEST, door_trim, outside,
    shell,
};
use mateval_sample::house::materials::Swatch::{Fabric, Plain};
use mateval_sample::house::materials::{ArchitectureMaterial, ArchitectureTexture, Lettering, Stored};
use mateval_sample::house::models::{
    BLACK, GREEN, Model, OAK, OCHRE, Parts, WALNUT, WHITE_WOOD, boxed, cushion, label, legs, letters, turned,
};
use mateval_sample::house::{built_in, write_pictures, write_shapes};
use mateval_sample::pattern::{self, Color, noise, paint, ramp};
use mateval_sample::solid::{self, Solid};
use serde_json::Value;

/// Writes the house into the folder `out`; files of the same name are replaced.
pub fn write(out: &Path) {
    write_with(out, true);
}

/// As [`write()`], but without textures, which take most of the time: every piece and wall exists, in plain colours.
pub fn write_without_pictures(out: &Path) {
    write_with(out, false);
}

fn write_with(out: &Path, pictures: bool) {
    let house = house();
    write_shapes(&house, out).unwrap();
    if pictures {
        write_pictures(&house, out).unwrap();
    }
    let root = out.join("house");
    std::fs::write(root.join(format!("3D-FRONT/{HOUSE_ID}.json")), text(faulty_json(&house))).unwrap();
    faults::damage_files(&house, &root);
}

/// The layout's JSON with its faults, as [`write()`] writes it.
pub fn json() -> Value {
    faulty_json(&house())
}

fn faulty_json(house: &House) -> Value {
    let mut json = house_json(house);
    withhold_models(&mut json);
    faults::plant(&mut json);
    json
}

/// The layout's JSON of the three rooms before faults are planted.
pub fn sound_json() -> Value {
    let mut json = house_json(&house());
    withhold_models(&mut json);
    json
}

/// The three rooms and their models, without faults.
fn house() -> House {
    let mut house = built_in();
    // The library's own walls close the house in the south.
    let south = house.rooms[0].meshes.pop().unwrap();
    assert!(south.kind == "WallOuter" && south.positions.iter().all(|p| p.z == 4.6));
    add_library(&mut house);
    house
}

const OUTLINE: Outline = Outline {
    low: DVec2::new(0.0, 4.6),
    high: DVec2::new(5.6, 8.2),
    floor: "library_floor",
    walls: "library_wall",
    trim: "library_trim",
};
const WINDOW: Opening = [v(-0.2, 1.2, 5.8), v(0.0, 2.2, 6.8)];

const fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Adds the room and its materials, texture and models to the ends of the house's lists.
fn add_library(house: &mut House) {
    let (pictured, plain) = (ArchitectureMaterial::pictured, ArchitectureMaterial::plain);
    house.materials.extend([
        pictured("library_floor", "tiles", ["material", "tiles"]),
        ArchitectureMaterial { color: [188, 202, 208], ..pictured("library_wall", "wallpaper", ["material", "paint"]) },
        ArchitectureMaterial { color: [150, 118, 92], ..pictured("cabinet", "door_wood", ["material", "wood"]) },
        plain("library_trim", [222, 216, 204], ["material", "paint"]),
    ]);
    house.textures.push(ArchitectureTexture {
        name: "tiles",
        number: 5,
        tile: 0.6,
        stored: Stored::Upright,
        seen: paint(256, 256, tiles),
    });
    let first = house.models.len() as u32 + 1;
    house.models.extend(library_models().into_iter().zip(first..).map(|(model, number)| Model { number, ..model }));
    house.rooms.push(Room {
        kind: "OtherRoom",
        name: "OtherRoom-103",
        low: OUTLINE.low,
        high: OUTLINE.high,
        meshes: meshes(),
        furniture: furniture(),
        cameras: vec![
            Snapshot::new([5.2, 1.6, 5.0], [1.9, 0.7, 7.6], 60.0),
            Snapshot::new([0.5, 1.55, 7.3], [5.0, 1.0, 5.7], 60.0),
        ],
    });
}

/// Turns the last three crates in the list of furniture into pieces that are not public, as half of the data's are:
/// they are not valid, and their models are not in the library.
fn withhold_models(json: &mut Value) {
    for place in 27..=29 {
        let record = json["furniture"][place].as_object_mut().unwrap();
        record.retain(|key, _| key != "size" && key != "bbox");
        record.insert("valid".into(), false.into());
        record.insert("jid".into(), format!("cc0f0000-5a3b-4e00-8000-{:012}", 901 + place).into());
    }
}

/// A wall cabinet of three meshes, a cornice, a pipe and the door's trim on this side follow the shell.
fn meshes() -> Vec<ArchitectureMesh> {
    let openings = [DOOR, WINDOW];
    let mut meshes = shell(&OUTLINE, &openings);
    meshes.retain(|mesh| mesh.kind != "Ceiling");
    meshes.extend(outside(
        &[
            (v(-0.2, 0.0, 4.6), v(0.0, 0.0, 3.8)),
            (v(-0.2, 0.0, 8.4), v(6.0, 0.0, 0.0)),
            (v(5.8, 0.0, 8.4), v(0.0, 0.0, -3.8)),
        ],
        &[[-0.2, 4.6, 0.0, 8.2], [5.6, 4.6, 5.8, 8.2], [-0.2, 8.2, 5.8, 8.4]],
        &openings,
    ));
    meshes.extend([
        ArchitectureMesh::new("Cabinet", "cabinet").boxed(v(2.0, 1.5, 7.86), v(4.6, 2.2, 8.19)),
        ArchitectureMesh::new("Front", "cabinet")
            .boxed(v(2.02, 1.52, 7.84), v(3.29, 2.18, 7.86))
            .boxed(v(3.31, 1.52, 7.84), v(4.58, 2.18, 7.86)),
        ArchitectureMesh::new("Back", "cabinet").boxed(v(2.0, 1.5, 8.19), v(4.6, 2.2, 8.2)),
        ArchitectureMesh::new("Cornice", "library_trim").boxed(v(5.54, 2.7, 4.6), v(5.6, 2.8, 8.2)),
        ArchitectureMesh::new("SewerPipe", "library_trim").boxed(v(5.44, 0.0, 8.04), v(5.6, 2.8, 8.2)),
        door_trim(4.6, 4.612),
    ]);
    meshes
}

/// A floor tile with joints, a compass and a word. North is up, which is -z on a floor.
fn tiles(u: f64, v: f64) -> Color {
    let lettering = [
        Lettering::fitted(&["N"], [0.44, 0.12], [0.56, 0.26], 1.0),
        Lettering::fitted(&["S"], [0.44, 0.74], [0.56, 0.88], 1.0),
        Lettering::fitted(&["W"], [0.12, 0.43], [0.24, 0.57], 1.0),
        Lettering::fitted(&["E"], [0.76, 0.43], [0.88, 0.57], 1.0),
        Lettering::fitted(&["LIB"], [0.36, 0.40], [0.64, 0.60], 1.0),
    ];
    let edge = u.min(1.0 - u).min(v.min(1.0 - v));
    let stone = pattern::mix([0.66, 0.64, 0.60], [0.78, 0.76, 0.72], noise(u, v, 9, 9, 33));
    let stone = pattern::mix([0.40, 0.39, 0.37], stone, ramp(0.008, 0.016, edge));
    if lettering.iter().any(|text| text.covers(u, v)) { [0.30, 0.34, 0.42] } else { stone }
}

fn furniture() -> Vec<Furniture> {
    vec![
        Furniture::new("3001/model", "bookcase", "cabinet/bookcase", [1.0, 0.0, 8.0], NORTH),
        Furniture::new("3002/model", "chest", "cabinet/drawer chest", [2.45, 0.0, 7.94], NORTH),
        Furniture::new("3003/model", "shelf", "cabinet/shelf", [3.75, 0.0, 7.99], NORTH),
        Furniture::new("3004/model", "armchair", "sofa/armchair", [0.85, 0.0, 5.3], SOUTH),
        Furniture::new("3005/model", "side_table", "table/side table", [1.9, 0.0, 5.1], SOUTH),
        Furniture::new("3006/model", "lounge_chair", "chair/lounge chair", [2.9, 0.0, 5.1], SOUTH),
        Furniture::new("3007/model", "stool", "stool/stool", [4.0, 0.0, 5.1], SOUTH),
        Furniture::new("3008/model", "crate", "accessory/box", [4.7, 0.0, 7.3], SOUTH),
        Furniture::new("3009/model", "crate", "accessory/box", [5.25, 0.0, 7.5], SOUTH),
        Furniture::new("3010/model", "picture", "accessory/picture", [5.575, 1.3, 6.2], WEST),
        Furniture::new("3011/model", "nightstand", "cabinet/nightstand", [3.0, 0.0, 6.4], SOUTH),
        // The models of these three are withheld.
        Furniture::new("3012/model", "crate", "accessory/vase", [2.2, 0.0, 6.4], SOUTH),
        Furniture::new("3013/model", "crate", "plants/plant", [5.2, 0.0, 5.9], SOUTH),
        Furniture::new("3014/model", "crate", "door/door", [5.05, 0.0, 4.5], NORTH),
        Furniture::new("3015/model", "basket", "accessory/basket", [0.7, 0.0, 6.9], SOUTH),
        Furniture::new("3016/model", "mat", "accessory/mat", [1.9, 0.0, 6.2], SOUTH),
        Furniture::new("3017/model", "sculpture", "accessory/sculpture", [0.5, 0.0, 6.1], SOUTH),
    ]
}

fn library_models() -> Vec<Model> {
    const CABINET: &str = "Cabinet/Shelf/Desk";
    const OTHERS: [&str; 5] = ["Others", "", "", "", ""];
    let drawer = letters(&["TOP ^ DRAWER"], [0.90, 0.86, 0.74], 0.6 / 0.14);
    vec![
        Model::new(
            "bookcase",
            [CABINET, "Bookcase / jewelry Armoire", "Modern", "Lines", "Wood"],
            &[WALNUT, Plain([0.62, 0.24, 0.20]), Plain([0.20, 0.34, 0.44])],
            bookcase(),
        ),
        Model::new(
            "chest",
            [CABINET, "Drawer Chest / Corner cabinet", "Korean", "Lines", "Wood"],
            &[OAK, WHITE_WOOD, drawer],
            chest(),
        ),
        Model::new("shelf", [CABINET, "Shelf", "Modern", "", "Wood"], &[WALNUT, Plain([0.05; 3])], shelf()),
        Model::new(
            "armchair",
            ["Sofa", "armchair", "Vintage/Retro", "Smooth Net", "Leather"],
            &[Fabric([0.52, 0.22, 0.18]), BLACK],
            armchair(),
        ),
        Model::new(
            "side_table",
            ["Table", "Round End Table", "Modern", "Granite Texture", "Marble"],
            &[WHITE_WOOD, BLACK],
            side_table(),
        ),
        Model::new(
            "lounge_chair",
            ["Chair", "Lounge Chair / Cafe Chair / Office Chair", "Modern", "Smooth Net", "Suede"],
            &[Fabric([0.62; 3]), Plain([0.3; 3])],
            lounge_chair(),
        ),
        Model::new(
            "stool",
            ["Pier/Stool", "Footstool / Sofastool / Bed End Stool / Stool", "Modern", "", "Cloth"],
            &[GREEN, OAK],
            stool(),
        ),
        Model::new("crate", OTHERS, &[OAK], vec![(0, boxed(v(-0.25, 0.0, -0.25), v(0.25, 0.5, 0.25)))]),
        Model::new("basket", OTHERS, &[OCHRE, Plain([0.0; 3])], basket()),
        Model::new("mat", OTHERS, &[Plain([0.0; 3])], mat()),
        Model::new("sculpture", OTHERS, &[WHITE_WOOD, Plain([0.02; 3])], sculpture()),
    ]
}

/// An armchair, 0.8 m wide and deep.
fn armchair() -> Parts {
    vec![
        (1, legs(0.36, 0.36, 0.05, 0.12)),
        (0, boxed(v(-0.38, 0.12, -0.38), v(0.38, 0.26, 0.36))),
        (0, cushion(v(-0.4, 0.12, -0.4), v(-0.26, 0.58, 0.4), 0.05)),
        (0, cushion(v(0.26, 0.12, -0.4), v(0.4, 0.58, 0.4), 0.05)),
        (0, cushion(v(-0.26, 0.12, -0.4), v(0.26, 0.88, -0.22), 0.06)),
        (0, cushion(v(-0.255, 0.25, -0.22), v(0.255, 0.44, 0.38), 0.05)),
    ]
}

/// A bookcase with books, 1 m wide and 2 m high.
fn bookcase() -> Parts {
    let mut case = boxed(v(-0.5, 0.0, -0.16), v(0.5, 2.0, -0.15))
        .boxed(v(-0.5, 0.0, -0.15), v(-0.475, 2.0, 0.16), 1.0)
        .boxed(v(0.475, 0.0, -0.15), v(0.5, 2.0, 0.16), 1.0);
    let mut books = [Solid::default(), Solid::default()];
    for level in 0..5 {
        let y = 0.05 + 0.39 * f64::from(level);
        case = case.boxed(v(-0.475, y, -0.15), v(0.475, y + 0.025, 0.155), 1.0);
        for book in 0..(4 + level) {
            let x = -0.46 + 0.06 * f64::from(book);
            let high = 0.22 + 0.02 * f64::from((book * 3 + level) % 5);
            let pile = &mut books[usize::from((book + level) % 2 == 0)];
            *pile = std::mem::take(pile).boxed(v(x, y + 0.025, -0.1), v(x + 0.05, y + 0.025 + high, 0.1), 1.0);
        }
    }
    let [first, second] = books;
    vec![(0, case.boxed(v(-0.475, 1.975, -0.15), v(0.475, 2.0, 0.155), 1.0)), (1, first), (2, second)]
}

/// A chest, 0.9 m wide, with three drawers and letters on the lowest.
fn chest() -> Parts {
    let drawer = |y: f64| boxed(v(-0.42, y, 0.2), v(0.42, y + 0.22, 0.22));
    vec![
        (0, boxed(v(-0.45, 0.0, -0.225), v(0.45, 0.8, 0.2))),
        (1, drawer(0.04)),
        (1, drawer(0.29)),
        (1, drawer(0.54)),
        (2, label(v(-0.3, 0.08, 0.225), v(0.6, 0.0, 0.0), v(0.0, 0.14, 0.0))),
    ]
}

/// An open shelf, 1.2 m wide and 0.8 m high, on a painted shadow 6 m wide.
fn shelf() -> Parts {
    vec![(0, solid::shelf()), (1, label(v(-3.0, 0.0, 3.0), v(6.0, 0.0, 0.0), v(0.0, 0.0, -6.0)))]
}

/// A basket, 0.5 m wide, and its painted shadow, which is a little wider.
fn basket() -> Parts {
    let wall = [(0.0, 0.02), (0.2, 0.02), (0.25, 0.4), (0.23, 0.4), (0.18, 0.04), (0.0, 0.04)];
    vec![
        (0, turned(&wall)),
        (0, turned(&[(0.0, 0.0), (0.15, 0.0), (0.15, 0.02), (0.0, 0.02)])),
        (1, label(v(-0.3, 0.0, 0.3), v(0.6, 0.0, 0.0), v(0.0, 0.0, -0.6))),
    ]
}

/// A black mat of no thickness, 1 m wide.
fn mat() -> Parts {
    vec![(0, label(v(-0.5, 0.0, 0.35), v(1.0, 0.0, 0.0), v(0.0, 0.0, -0.7)))]
}

/// A sculpture on a dark plate of no thickness, which is as wide as the sculpture.
fn sculpture() -> Parts {
    vec![
        (1, label(v(-0.2, 0.0, 0.2), v(0.4, 0.0, 0.0), v(0.0, 0.0, -0.4))),
        (0, cushion(v(-0.2, 0.0, -0.2), v(0.2, 0.7, 0.2), 0.15)),
    ]
}

/// A side table: a round top on one leg.
fn side_table() -> Parts {
    let foot = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.02), (0.03, 0.04), (0.025, 0.5), (0.0, 0.5)];
    vec![
        (1, turned(&foot)),
        (0, turned(&[(0.0, 0.5), (0.3, 0.5), (0.3, 0.525), (0.0, 0.525)])),
        (0, boxed(v(-0.12, 0.525, -0.08), v(0.12, 0.555, 0.08))),
    ]
}

/// A low lounge chair, 0.6 m wide.
fn lounge_chair() -> Parts {
    vec![
        (1, legs(0.28, 0.3, 0.04, 0.34)),
        (0, cushion(v(-0.3, 0.32, -0.3), v(0.3, 0.42, 0.325), 0.04)),
        (0, cushion(v(-0.28, 0.4, -0.325), v(0.28, 0.82, -0.22), 0.04)),
    ]
}

/// A stool, 0.4 m wide.
fn stool() -> Parts {
    vec![(1, legs(0.18, 0.18, 0.04, 0.4)), (0, cushion(v(-0.2, 0.38, -0.2), v(0.2, 0.45, 0.2), 0.03))]
}
