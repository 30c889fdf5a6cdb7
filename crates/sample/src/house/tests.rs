//! The house as data, as it lies on disk, and as the reader of 3D-FRONT sees it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use glam::{DMat3, DQuat, DVec3};
use mateval_scene::Severity;
use mateval_sources::front3d::{AppearanceRule, HouseFiles, Limits, furnish};

use super::layout::HEIGHT;
use super::*;

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
    // Five textures of the architecture; three files for each of 13 models; the house, the list of models, the licence.
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
        let gap = [low.x - from.x, to.x - high.x, low.z - from.y, to.y - high.z].into_iter().fold(f64::MAX, f64::min);
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
    for (room, camera) in house.rooms.iter().flat_map(|room| room.cameras.iter().map(move |camera| (room, camera))) {
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
