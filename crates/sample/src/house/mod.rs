//! The built-in house, under CC0, in the layout of 3D-FRONT and 3D-FUTURE: a living room and a bedroom.
//!
//! The input is a folder. Written into it is `house/` with `3D-FRONT/UID.json`, `3D-FRONT-texture/JID/texture.png`,
//! `3D-FUTURE-model/JID/` (`raw_model.obj`, `model.mtl`, `texture.png`), `model_info.json` and `LICENSE.txt`. The bytes
//! are the same on every machine.
//!
//! `layout` describes a house as data, and builds and furnishes its rooms. `materials` holds the textures of rooms and
//! furniture, with their letters, and `models` the library of furniture. `files` makes the JSON of a house and writes
//! its models. This file also makes other houses of the built-in one, for rehearsals of a release at full size: of
//! another extent, in other colours and wall coverings, and with some of the furniture left out. All houses share the
//! library of models and textures.
//!
//! The house is sound. The test kit's faulty house is made of the same blocks, which are public for its sake.

pub mod files;
pub mod layout;
pub mod materials;
pub mod models;

use std::path::Path;

use files::{HOUSE_ID, LICENSE, SampleError, create_folder, number, write_text};
use layout::House;
use mateval_dataset::splitmix64;
use mateval_image::png_io::write_rgb_bytes;
use serde_json::{Value, json};

pub fn built_in() -> House {
    House {
        rooms: vec![layout::living_room(), layout::bedroom()],
        materials: materials::materials(),
        textures: materials::textures(),
        models: models::all(),
    }
}

/// Writes the built-in house into the folder `out`; files of the same name are replaced.
pub fn write(out: &Path) -> Result<(), SampleError> {
    let house = built_in();
    write_shapes(&house, out)?;
    write_pictures(&house, out)
}

/// Writes the houses with the numbers `0..count` into the folder `out`, with the library and the textures of the
/// built-in house. Returns their files, relative to `out`.
pub fn write_variants(out: &Path, count: u32, seed: u64) -> Result<Vec<String>, SampleError> {
    write(out)?;
    let built_in = files::house_json(&built_in());
    (0..count)
        .map(|number| {
            let mut house = built_in.clone();
            vary(&mut house, number, seed);
            let file = format!("house/3D-FRONT/{}.json", varied_uid(number));
            write_text(&out.join(&file), &files::text(house))?;
            Ok(file)
        })
        .collect()
}

/// Writes everything but the textures, which take most of the time.
pub fn write_shapes(house: &House, out: &Path) -> Result<(), SampleError> {
    let root = out.join("house");
    let (layouts, library) = (root.join("3D-FRONT"), root.join("3D-FUTURE-model"));
    for folder in [&layouts, &library, &root.join("3D-FRONT-texture")] {
        create_folder(folder)?;
    }
    house.models.iter().try_for_each(|model| files::write_shape(&library, model))?;
    write_text(&library.join("model_info.json"), &files::model_info(&house.models))?;
    let json = files::text(files::house_json(house));
    write_text(&layouts.join(format!("{HOUSE_ID}.json")), &json)?;
    let what = "This is 'The Sample House' by the MatEval authors, made by `mateval sample`: made up, in the layout\n\
                of 3D-FRONT and 3D-FUTURE, and without anything of theirs.";
    write_text(&root.join("LICENSE.txt"), &format!("{what}\n{LICENSE}"))
}

/// Writes the textures of the architecture and of the models, whose folders exist.
pub fn write_pictures(house: &House, out: &Path) -> Result<(), SampleError> {
    for texture in &house.textures {
        let folder = out.join("house/3D-FRONT-texture").join(texture.jid());
        create_folder(&folder)?;
        write_rgb_bytes(&folder.join("texture.png"), &texture.file())?;
    }
    house.models.iter().try_for_each(|model| files::write_picture(&out.join("house/3D-FUTURE-model"), model))
}

/// The most that a house is longer than the built-in one, in either direction.
const STRETCH: f64 = 0.25;

/// The share of the furniture that is left out, after the pieces that a room keeps in any case.
const LEFT_OUT: f64 = 0.2;

/// The first pieces of a room, which are its largest, stay.
const KEPT: usize = 2;

/// The id of the house with this number.
fn varied_uid(number: u32) -> String {
    format!("cc000000-5a3b-4e00-8000-{:012}", u64::from(number) + 1_000_000)
}

/// A sequence of random numbers.
struct Draws {
    seed: u64,
    next: u64,
}

impl Draws {
    fn integer(&mut self, below: u64) -> u64 {
        self.next += 1;
        splitmix64::number(self.seed, self.next) % below
    }

    /// From 0 to 1.
    fn share(&mut self) -> f64 {
        self.integer(1 << 53) as f64 / (1_u64 << 53) as f64
    }
}

/// Changes the built-in house into the one with this number. Houses of the same seed and number are equal.
fn vary(house: &mut Value, house_number: u32, seed: u64) {
    let mut draws = Draws { seed: splitmix64::number(seed, u64::from(house_number)), next: 0 };
    house["uid"] = varied_uid(house_number).into();
    stretch(house, [1.0 + STRETCH * draws.share(), 1.0 + STRETCH * draws.share()]);
    recolour(house, &mut draws);
    leave_out(house, &mut draws);
}

/// Stretches rooms along x and z. Furniture keeps its size and moves with the floor.
fn stretch(house: &mut Value, [x, z]: [f64; 2]) {
    let scale = |point: &mut [Value]| {
        for (at, factor) in [(0, x), (2, z)] {
            point[at] = number(point[at].as_f64().expect("coordinates are numbers") * factor);
        }
    };
    let each = |points: &mut Value| items(points).chunks_exact_mut(3).for_each(scale);
    items(&mut house["mesh"]).iter_mut().for_each(|mesh| each(&mut mesh["xyz"]));
    items(&mut house["lights"]).iter_mut().for_each(|light| each(&mut light["src_position"]));
    for snapshot in items(&mut house["extension"]["snapshots"]) {
        each(&mut snapshot["pos"]);
        each(&mut snapshot["target"]);
    }
    let scene = &mut house["scene"];
    each(&mut scene["boundingBox"]["min"]);
    each(&mut scene["boundingBox"]["max"]);
    for room in items(&mut scene["room"]) {
        room["size"] = number(room["size"].as_f64().expect("a room's size is a number") * x * z);
        items(&mut room["children"]).iter_mut().for_each(|child| each(&mut child["pos"]));
    }
}

/// Draws the colours of painted surfaces; pictures of the others change places, each with its scale.
fn recolour(house: &mut Value, draws: &mut Draws) {
    let materials = items(&mut house["material"]);
    let mut pictured = Vec::new();
    for (at, material) in materials.iter_mut().enumerate() {
        if material["useColor"] == json!(true) {
            let bytes = [0; 3].map(|_| 150 + draws.integer(106));
            material["color"] = json!([bytes[0], bytes[1], bytes[2], 255]);
        } else {
            pictured.push(at);
        }
    }
    for (place, &at) in pictured.iter().enumerate().skip(1) {
        let other = pictured[draws.integer(place as u64 + 1) as usize];
        for key in ["jid", "UVTransform", "normalUVTransform"] {
            let [a, b] = [&materials[at][key], &materials[other][key]].map(Value::clone);
            materials[at][key] = b;
            materials[other][key] = a;
        }
    }
}

fn leave_out(house: &mut Value, draws: &mut Draws) {
    for room in items(&mut house["scene"]["room"]) {
        let children = room["children"].as_array_mut().expect("a room's children are a list");
        let is_furniture = |child: &Value| child["instanceid"].as_str().is_some_and(|id| id.starts_with("furniture/"));
        let mut pieces = 0;
        children.retain(|child| {
            pieces += usize::from(is_furniture(child));
            !is_furniture(child) || pieces <= KEPT || draws.share() >= LEFT_OUT
        });
    }
}

fn items(list: &mut Value) -> &mut Vec<Value> {
    list.as_array_mut().expect("the built-in house has lists there")
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};
    use std::path::PathBuf;

    use glam::{DMat3, DQuat, DVec3};
    use mateval_dataset::Severity;
    use mateval_sources::front3d::{AppearanceRule, HouseFiles, Limits, furnish};

    use super::layout::HEIGHT;
    use super::*;

    fn varied(number: u32, seed: u64) -> Value {
        let mut house = files::house_json(&built_in());
        vary(&mut house, number, seed);
        house
    }

    #[test]
    fn houses_differ_by_number_and_seed_and_are_repeated() {
        let texts: BTreeSet<String> = (0..20).map(|at| varied(at, 1)["scene"].to_string()).collect();
        assert_eq!(texts.len(), 20);
        assert_eq!(varied(3, 1), varied(3, 1));
        assert_ne!(varied(3, 1), varied(3, 2));
    }

    /// Both rooms are furnished, and the furniture lies within the walls.
    #[test]
    fn every_house_has_furnished_rooms_within_its_walls() {
        for at in 0..20 {
            let mut house = varied(at, 1);
            let high = house["scene"]["boundingBox"]["max"][0].as_f64().unwrap();
            assert!((10.2..=10.2 * 1.25).contains(&high), "{high}");
            for room in items(&mut house["scene"]["room"]) {
                let pieces = items(&mut room["children"]);
                let pieces: Vec<&Value> =
                    pieces.iter().filter(|c| c["instanceid"].as_str().unwrap().starts_with("furniture")).collect();
                assert!(pieces.len() >= 2, "house {at}: {} pieces", pieces.len());
                assert!(pieces.iter().all(|piece| (0.0..high).contains(&piece["pos"][0].as_f64().unwrap())));
            }
        }
    }

    /// Every file of the written house with its bytes.
    fn files() -> BTreeMap<PathBuf, Vec<u8>> {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path()).unwrap();
        let root = folder.path().join("house");
        let (mut files, mut folders) = (BTreeMap::new(), vec![root.clone()]);
        while let Some(folder) = folders.pop() {
            for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
                if path.is_dir() {
                    folders.push(path);
                } else {
                    files.insert(path.strip_prefix(&root).unwrap().to_owned(), std::fs::read(&path).unwrap());
                }
            }
        }
        files
    }

    /// One hash over all names and bytes, so that a change of any platform's arithmetic shows.
    #[test]
    fn the_bytes_are_these_in_every_run() {
        use sha2::{Digest as _, Sha256};
        let first = files();
        assert_eq!(first, files());
        // Five textures of the architecture; three files for each of 13 models; the house, the list of models, the
        // licence.
        assert_eq!(first.len(), 5 + 13 * 3 + 3);
        let total: usize = first.values().map(Vec::len).sum();
        assert!(total < 3_000_000, "{total}");
        let mut hash = Sha256::new();
        for (path, bytes) in &first {
            let path: Vec<_> = path.iter().map(|part| part.to_str().unwrap()).collect();
            hash.update(path.join("/"));
            hash.update(bytes);
        }
        let hex: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, "45b6c607d960484c976ee5df66cb8dad2fbf49dcddce2e5bb08253d0ac5415cd");
    }

    /// Its only findings are those of every real house: sheets in one plane, such as walls and what hangs on them, and
    /// furniture that touches the floor. The test kit's faulty house has dozens of others.
    #[test]
    fn it_reads_back_without_a_warning() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path()).unwrap();
        let files = HouseFiles {
            root: folder.path().to_owned(),
            house: format!("house/3D-FRONT/{HOUSE_ID}.json").into(),
            models: "house/3D-FUTURE-model".into(),
            textures: Some("house/3D-FRONT-texture".into()),
            cameras: None,
            blenderproc_compat: false,
            appearance: AppearanceRule::Constant,
        };
        let house = furnish(&files, &Limits::default()).unwrap();
        assert!(house.findings.iter().all(|finding| finding.severity == Severity::Note), "{:?}", house.findings);
        let codes: Vec<&str> = house.findings.iter().map(|finding| finding.code.as_str()).collect();
        assert_eq!(codes, ["coincident_sheets", "furniture_in_architecture"]);
        assert_eq!(house.wanted_pieces, [11, 6]);
        let placed = house.placed.iter().filter(|placed| placed.origin.role.is_furniture());
        assert_eq!(placed.count(), 17);
    }

    /// The room and the box in the world of every piece.
    fn boxes(house: &House) -> Vec<(usize, [DVec3; 2])> {
        let mut boxes = Vec::new();
        for (room, record) in
            house.rooms.iter().enumerate().flat_map(|(at, room)| room.furniture.iter().map(move |r| (at, r)))
        {
            let points = || house.model(record.model).parts.iter().flat_map(|(_, solid)| &solid.positions);
            for (at, turn) in &record.pieces {
                let matrix = DMat3::from_quat(DQuat::from_array(*turn).normalize());
                let placed = points().map(|p| matrix * *p + DVec3::from(*at));
                let [low, high] = placed.fold([DVec3::MAX, DVec3::MIN], |[low, high], p| [low.min(p), high.max(p)]);
                boxes.push((room, [low, high]));
            }
        }
        boxes
    }

    /// Pieces stand on the floor, hang from the ceiling or on a wall, within their room, and apart from each other.
    #[test]
    fn pieces_stand_where_pieces_can() {
        let house = built_in();
        let boxes = boxes(&house);
        assert_eq!(boxes.len(), 17);
        // Baseboards are 12 mm thick, the panel behind the bed 30 mm.
        for &(room, [low, high]) in &boxes {
            let (from, to) = (house.rooms[room].low, house.rooms[room].high);
            let gap =
                [low.x - from.x, to.x - high.x, low.z - from.y, to.y - high.z].into_iter().fold(f64::MAX, f64::min);
            let stands = low.y.abs() < 1e-9 && gap > 0.03;
            let hangs = (high.y - HEIGHT).abs() < 1e-9 && gap > 0.5;
            let is_on_wall = low.y > 0.5 && (0.0..0.01).contains(&gap);
            assert!(stands || hangs || is_on_wall, "room {room}: {low} {high}");
        }
        for (i, (_, [low, high])) in boxes.iter().enumerate() {
            for (_, [other_low, other_high]) in &boxes[i + 1..] {
                assert!(!(low.cmplt(*other_high).all() && other_low.cmplt(*high).all()), "{low} {other_low}");
            }
        }
    }

    /// Cameras are at eye height in their room, apart from all pieces, and look into it; every room has one.
    #[test]
    fn cameras_look_into_their_room() {
        let house = built_in();
        let boxes = boxes(&house);
        let mut seen = BTreeSet::new();
        for (room, camera) in house.rooms.iter().flat_map(|room| room.cameras.iter().map(move |camera| (room, camera)))
        {
            let (at, target) = (DVec3::from(camera.at), DVec3::from(camera.target));
            let (low, high) = (room.low, room.high);
            let within =
                |p: DVec3, gap: f64| p.x > low.x + gap && p.x < high.x - gap && p.z > low.y + gap && p.z < high.y - gap;
            assert!(within(at, 0.25) && (1.4..1.8).contains(&at.y), "{at}");
            let ahead = at + (target - at).normalize();
            assert!(within(ahead, 0.25) && (target - at).y < 0.0, "{at}");
            let apart = |[low, high]: &[DVec3; 2]| (at.clamp(*low, *high) - at).length() > 0.3;
            assert!(boxes.iter().all(|(_, piece)| apart(piece)), "{at}");
            assert!((40.0..75.0).contains(&camera.fov_y_deg));
            seen.insert(room.name);
        }
        assert_eq!(seen.len(), house.rooms.len());
    }

    /// Models are OBJ that a strict reader takes, within one picture, of a few thousand triangles.
    #[test]
    fn models_can_be_read() {
        let (house, folder) = (built_in(), tempfile::tempdir().unwrap());
        write_shapes(&house, folder.path()).unwrap();
        let mut triangles: usize = house.rooms.iter().flat_map(|room| &room.meshes).map(|mesh| mesh.faces.len()).sum();
        for model in &house.models {
            let path = folder.path().join("house/3D-FUTURE-model").join(model.jid()).join("raw_model.obj");
            let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
            let (shapes, materials) = tobj::load_obj(path, &options).unwrap();
            assert_eq!(shapes.len(), model.parts.len(), "{}", model.name);
            assert_eq!(materials.unwrap().len(), model.parts.len(), "{}", model.name);
            for (shape, (_, solid)) in shapes.iter().zip(&model.parts) {
                assert_eq!(shape.mesh.indices.len() / 3, solid.triangle_count());
                assert!(shape.mesh.texcoords.iter().all(|uv| (0.0..=1.0).contains(uv)), "{}", model.name);
                triangles += solid.triangle_count();
            }
            assert!((128..=512).contains(&model.side));
        }
        assert!((5_000..40_000).contains(&triangles), "{triangles}");
    }
}
