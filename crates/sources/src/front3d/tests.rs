//! Tests the reader on the built-in house with faults, on generated houses, on hostile files, and on real data if it
//! exists.

mod hostile;
mod houses;
mod models;
mod pieces;
mod real;
mod rooms;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use glam::{DVec3, Vec3};
use mateval_dataset::reference::Surface;
use mateval_dataset::{Role, Severity, TriangleMesh, mesh};
use serde_json::{Value, json};

use super::house::{Child, ChildKind, Placement};
use super::*;
use crate::SourceError;
use crate::open::Invalid;
use mateval_testkit::faulty_house;

/// The house, below the folder that [`faulty_house::write`] fills.
const HOUSE: &str = "house/3D-FRONT/cc000000-5a3b-4e00-8000-000000000001.json";
const LIVING: usize = 0;
const LIBRARY: usize = 2;

/// The faulty house on disk, and its JSON.
struct Disk {
    folder: tempfile::TempDir,
    json: Value,
}

impl Disk {
    fn new() -> Self {
        Self::written(true)
    }

    /// Without pictures, which take the most time: every piece and wall exists, in plain colours.
    fn bare() -> Self {
        Self::written(false)
    }

    fn written(pictures: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let write = if pictures { faulty_house::write } else { faulty_house::write_without_pictures };
        write(folder.path());
        let json = serde_json::from_slice(&std::fs::read(folder.path().join(HOUSE)).unwrap()).unwrap();
        Self { folder, json }
    }

    fn files(&self) -> HouseFiles {
        HouseFiles {
            root: self.folder.path().to_owned(),
            house: HOUSE.into(),
            models: "house/3D-FUTURE-model".into(),
            textures: Some("house/3D-FRONT-texture".into()),
            cameras: None,
            blenderproc_compat: false,
            appearance: AppearanceRule::Constant,
        }
    }

    fn model(&self, number: u32) -> PathBuf {
        self.folder.path().join("house/3D-FUTURE-model").join(jid(number))
    }

    fn furnish(&self) -> FurnishedHouse {
        furnish(&self.files(), &Limits::default()).unwrap()
    }

    /// The house with another JSON.
    fn furnish_json(&self, json: &Value) -> Result<FurnishedHouse, SourceError> {
        std::fs::write(self.folder.path().join(HOUSE), json.to_string()).unwrap();
        furnish(&self.files(), &Limits::default())
    }
}

/// The house with all its faults, made once for each process.
fn furnished() -> &'static FurnishedHouse {
    static HOUSE: OnceLock<FurnishedHouse> = OnceLock::new();
    HOUSE.get_or_init(|| Disk::new().furnish())
}

/// The same without pictures, for tests of shapes.
fn bare() -> &'static FurnishedHouse {
    static HOUSE: OnceLock<FurnishedHouse> = OnceLock::new();
    HOUSE.get_or_init(|| Disk::bare().furnish())
}

/// The bare house as BlenderProc places it.
fn compat() -> &'static FurnishedHouse {
    static HOUSE: OnceLock<FurnishedHouse> = OnceLock::new();
    HOUSE.get_or_init(|| {
        let disk = Disk::bare();
        furnish(&HouseFiles { blenderproc_compat: true, ..disk.files() }, &Limits::default()).unwrap()
    })
}

/// A model's id by the last digits.
fn jid(number: u32) -> String {
    format!("cc0f0000-5a3b-4e00-8000-{number:012}")
}

/// A house read from JSON alone, and the findings.
fn read_house(json: &Value) -> (Result<House, Invalid>, Vec<mateval_dataset::Finding>) {
    let mut log = crate::log::Log::new("house.json".into(), 5_000);
    let house = house::read(json, "stem", &Limits::default(), &mut log);
    (house, log.into_findings())
}

/// Findings above notes, as code, file and place.
fn warnings(house: &FurnishedHouse) -> Vec<String> {
    let above_note = house.findings.iter().filter(|finding| finding.severity != Severity::Note);
    above_note.map(|f| format!("{} {} {}", f.code, f.file, f.place).trim().to_owned()).collect()
}

/// The surfaces of a model in a room, in the order of its children.
fn pieces_of(house: &FurnishedHouse, room: usize, number: u32) -> Vec<&Surface> {
    let wanted = jid(number);
    let is_it =
        |placed: &PlacedSurface| placed.room == room && placed.model.as_ref().is_some_and(|model| model.jid == wanted);
    house.placed.iter().zip(&house.scene.surfaces).filter(|(placed, _)| is_it(placed)).map(|(_, s)| s).collect()
}

fn is_kind(placed: &PlacedSurface, kind: &str) -> bool {
    placed.origin.role.architecture_kind() == Some(kind)
}

/// The box around a mesh's triangles.
fn bounds(mesh: &TriangleMesh) -> [Vec3; 2] {
    mesh::bounds(mesh.triangles.iter().flatten().map(|v| mesh.positions[*v as usize])).unwrap()
}

fn size(mesh: &TriangleMesh) -> Vec3 {
    let [low, high] = bounds(mesh);
    high - low
}

/// Positive if triangles face outwards. It is measured from the middle, so that it also exists for a mesh that is not
/// quite closed.
fn signed_volume(mesh: &TriangleMesh) -> f64 {
    let [low, high] = bounds(mesh);
    let middle = (low + high).as_dvec3() / 2.0;
    let of = |triangle| {
        let [a, b, c]: [DVec3; 3] = mesh.corners(triangle).map(|p| p.as_dvec3() - middle);
        a.dot(b.cross(c)) / 6.0
    };
    (0..mesh.triangles.len()).map(of).sum()
}

/// Asserts everything that users of a furnished house rely on.
fn assert_sound(house: &FurnishedHouse) {
    let scene = &house.scene;
    assert_eq!(house.placed.len(), scene.surfaces.len());
    assert_eq!(house.wanted_pieces.len(), house.house.rooms.len());
    for (placed, surface) in house.placed.iter().zip(&scene.surfaces) {
        let mesh = &surface.mesh;
        assert!(!mesh.triangles.is_empty(), "'{}' has no triangle", surface.name);
        assert!(mesh.positions.iter().all(|p| p.is_finite() && p.abs().max_element() <= 1e9), "{}", surface.name);
        assert!(mesh.triangles.iter().flatten().all(|v| (*v as usize) < mesh.positions.len()));
        for all in [mesh.uvs.as_ref().map(Vec::len), mesh.normals.as_ref().map(Vec::len)].into_iter().flatten() {
            assert_eq!(all, mesh.positions.len());
        }
        assert!(mesh.uvs.iter().flatten().all(|uv| uv.is_finite()));
        assert!(surface.material.0 < scene.materials.len());
        assert!(placed.room < house.house.rooms.len());
        let parts = placed.origin.part_of_triangle.as_ref().unwrap();
        assert_eq!(parts.len(), mesh.triangles.len(), "parts of '{}'", surface.name);
    }
    let mut sorted = house.findings.clone();
    sorted.sort();
    assert_eq!(sorted, house.findings);
}

/// The smallest house: a square floor in one room.
fn small_house() -> Value {
    json!({
        "uid": "h", "furniture": [], "material": [{"uid": "m", "jid": "", "color": [255, 255, 255, 255]}],
        "mesh": [{"uid": "f", "xyz": [0, 0, 0, 0, 0, 4, 4, 0, 4, 4, 0, 0], "normal": [0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0],
            "uv": [0, 0, 0, 1, 1, 1, 1, 0], "faces": [0, 1, 2, 0, 2, 3], "material": "m", "type": "Floor"}],
        "scene": {"room": [{"type": "Bedroom", "instanceid": "Bedroom-1",
            "children": [{"ref": "f", "instanceid": "mesh/1"}]}]},
    })
}

/// A folder with one house and no models.
fn lone_house(folder: &Path, text: &[u8]) -> HouseFiles {
    std::fs::create_dir_all(folder.join("models")).unwrap();
    std::fs::write(folder.join("h.json"), text).unwrap();
    HouseFiles {
        root: folder.to_owned(),
        house: "h.json".into(),
        models: "models".into(),
        textures: None,
        cameras: None,
        blenderproc_compat: false,
        appearance: AppearanceRule::Constant,
    }
}

/// The codes of the findings of a small house, in which the value at a JSON pointer is replaced.
fn house_findings(pointer: &str, value: Value) -> Vec<String> {
    let mut house = json!({
        "uid": "small",
        "material": [{ "uid": "m", "color": [200, 100, 50], "UVTransform": [1, 0, 0, 0, 1, 0, 0, 0, 1] }],
        "mesh": [{
            "uid": "wall", "type": "WallInner", "material": "m", "xyz": [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0],
            "uv": [0, 0, 1, 0, 1, 1, 0, 1], "normal": [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1], "faces": [0, 1, 2, 0, 2, 3]
        }],
        "scene": { "room": [{
            "instanceid": "Room-1", "type": "Room",
            "children": [{ "ref": "wall", "instanceid": "mesh/1", "pos": [0, 0, 0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1] }]
        }] }
    });
    *house.pointer_mut(pointer).expect("the pointer exists") = value;
    let mut log = crate::log::Log::new("house.json".to_owned(), 100);
    house::read(&house, "small", &Limits::default(), &mut log).unwrap();
    log.into_findings().into_iter().map(|finding| finding.code).collect()
}

/// Every value that the reader uses in place of what it cannot read, a change of a small house that makes it do so, and
/// the code of the finding that says so.
#[test]
fn each_fallback_is_a_finding() {
    for (value, (pointer, changed), code) in [
        ("white", ("/material/0/color", json!("red")), "bad_color"),
        ("mid-grey", ("/mesh/0/material", json!("nobody")), "no_material"),
        ("white", ("/material/0/color", json!([1, 1, 1])), "bad_color"),
        ("no mesh", ("/scene/room/0/children/0/ref", json!("nobody")), "dangling_ref"),
        ("no numbers", ("/mesh/0/xyz", json!("0 0 0")), "bad_number"),
        ("no record", ("/mesh/0/uid", json!(null)), "no_uid"),
        ("no texture coordinates", ("/mesh/0/uv", json!(["a"])), "bad_uv"),
        ("geometric normals", ("/mesh/0/normal", json!("x")), "bad_normals"),
        ("the other triangles", ("/mesh/0/faces/0", json!(99)), "bad_faces"),
        ("no rotation", ("/scene/room/0/children/0/rot", json!("x")), "bad_placement"),
        ("the origin", ("/scene/room/0/children/0/pos", json!([1e30, 0, 0])), "bad_placement"),
        ("the identity", ("/material/0/UVTransform", json!([1])), "bad_uv_transform"),
    ] {
        let codes = house_findings(pointer, changed);
        assert!(codes.contains(&code.to_owned()), "{value}: {pointer}: {codes:?}");
    }
    assert_eq!(house_findings("/uid", json!("x")), [""; 0], "the house itself is sound");
}
