//! The placement of pieces: `T * R * S`, and BlenderProc's mirrored world.

use glam::{DMat3, DMat4, DQuat, DVec3};

use super::*;
use crate::source_scene::Log;
use mateval_scene::source_folder::SourceFolder;

/// The linear map that takes one list of points to another, by least squares about their middles.
fn linear_map(from: &[Vec3], to: &[Vec3]) -> DMat3 {
    assert_eq!(from.len(), to.len());
    let middle = |all: &[Vec3]| all.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / all.len() as f64;
    let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
    let (from_middle, to_middle) = (middle(from), middle(to));
    let (mut cross, mut own) = (DMat3::ZERO, DMat3::ZERO);
    for (p, q) in from.iter().zip(to) {
        let (p, q) = (p.as_dvec3() - from_middle, q.as_dvec3() - to_middle);
        cross += outer(q, p);
        own += outer(p, p);
    }
    cross * own.inverse()
}

fn assert_near(a: DMat3, b: DMat3) {
    assert!((a - b).to_cols_array().iter().all(|v| v.abs() < 1e-4), "{a} {b}");
}

/// Quaternions are x, y, z, w and the scale is applied first; computed by hand. The rotation takes x to y, y to z, z to
/// x.
#[test]
fn world_is_translation_rotation_scale() {
    let record =
        json!({"ref": "f", "instanceid": "mesh/1", "pos": [1, 2, 3], "rot": [0.5, 0.5, 0.5, 0.5], "scale": [2, 3, 4]});
    let mut json = small_house();
    json["scene"]["room"][0]["children"][0] = record;
    let house = read_house(&json).0.unwrap();
    let placement = house.rooms[0].children[0].placement;
    let place = placement.matrix().transform_point3(DVec3::ONE);
    assert!((place - DVec3::new(5.0, 4.0, 6.0)).length() < 1e-12, "{place}");
    let place = placement.mirrored_matrix().transform_point3(DVec3::ONE);
    assert!((place - DVec3::new(5.0, 0.0, 6.0)).length() < 1e-12, "{place}");
    // Twin: x, y, z, w read as w, x, y, z, for a rotation where this matters.
    let turn = DQuat::from_xyzw(0.0, 0.6, 0.0, 0.8);
    let misread = DQuat::from_xyzw(0.6, 0.0, 0.8, 0.0);
    assert!((turn * DVec3::X - misread * DVec3::X).length() > 0.1);
}

/// BlenderProc's `Front3DLoader`, step by step in Blender's axes: location `.xzy`, a quarter turn back about x, x, y,
/// z, w read as w, x, y, z, the scale as it is.
#[test]
fn compat_is_blenderprocs_matrix() {
    let ours_in_blender = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    for angle in [-2.8_f64, -1.0, 0.0, 0.4, 1.6, 3.1] {
        let [x, y, z, w] = [0.0, (angle / 2.0).sin(), 0.0, (angle / 2.0).cos()];
        let (position, scale) = (DVec3::new(1.5, 0.2, -4.0), DVec3::new(2.0, 1.0, 3.0));
        let own = Placement { position, rotation: DQuat::from_xyzw(x, y, z, w), scale };
        // Its first number is read as w, its last as z.
        let misread = DQuat::from_xyzw(y, z, w, x);
        let turn = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2) * misread;
        let theirs = DMat4::from_scale_rotation_translation(scale, turn, DVec3::new(1.5, -4.0, 0.2));
        let mirror = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
        let ours = ours_in_blender * mirror * own.mirrored_matrix();
        assert!(theirs.abs_diff_eq(ours, 1e-12), "{angle}: {theirs} {ours}");
        // Twin: without mirroring the piece, the matrix differs.
        assert!(!theirs.abs_diff_eq(ours_in_blender * mirror * own.matrix(), 0.1), "{angle}");
    }
}

/// The L-sofa stands with its back to the north in the living room. In the source's world its long seat is in the west;
/// under compat it is in the east of a room whose x is unchanged, which contradicts the architecture, as in
/// BlenderProc's pictures.
#[test]
fn compat_mirrors_the_architecture_and_not_the_sofa() {
    let disk = Disk::bare();
    let normal = disk.furnish();
    let compat = furnish(&HouseFiles { blenderproc_compat: true, ..disk.files() }, &Limits::default()).unwrap();
    assert_sound(&compat);
    let folder = SourceFolder::new(&disk.folder.path().join("house/3D-FUTURE-model"), 1 << 30).unwrap();
    let mut library = model::Library { folder, name: String::new() };
    let source = model::read(&jid(1), &mut library, &Limits::default(), &mut Log::new("h".into(), 10)).unwrap().mesh;
    let sofa = |house| &pieces_of(house, LIVING, 1)[0].mesh;
    let wall = |house: &FurnishedHouse| {
        let at = house
            .placed
            .iter()
            .position(|p| p.room == LIVING && p.origin.role.architecture_kind() == Some("WallInner"));
        house.scene.surfaces[at.unwrap()].mesh.clone()
    };

    // The sofa relative to its source: half a turn; with compat half a turn, M_z and the mirror of its own x.
    assert_near(
        linear_map(&source.positions, &sofa(&normal).positions),
        DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0)),
    );
    assert_near(linear_map(&source.positions, &sofa(&compat).positions), DMat3::IDENTITY);
    // The architecture: M_z.
    assert_near(
        linear_map(&wall(&normal).positions, &wall(&compat).positions),
        DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)),
    );
    // Both face outwards, and nothing else changed.
    let volumes = [sofa(&normal), sofa(&compat)].map(signed_volume);
    assert!((volumes[0] - volumes[1]).abs() < 1e-4 && volumes[0] > 0.0, "{volumes:?}");

    // The long seat is where the sofa extends far from the north wall; its x in the room is compared.
    let long_seat = |mesh: &TriangleMesh, south: f32| {
        let [low, high] = bounds(mesh);
        let front = if south > 0.0 { high.z } else { low.z };
        let at_front: Vec<f32> = mesh.positions.iter().filter(|p| (p.z - front).abs() < 0.3).map(|p| p.x).collect();
        at_front.iter().sum::<f32>() / at_front.len() as f32 - (low.x + high.x) / 2.0
    };
    // It faces north: its front is at the smallest z, and at the largest if mirrored.
    let (one, other) = (long_seat(sofa(&normal), -1.0), long_seat(sofa(&compat), 1.0));
    assert!(one < -0.5 && other > 0.5, "{one} {other}");
    assert!((one + other).abs() < 1e-3);
}

/// The designers' cameras are mirrored with the architecture, so that they see the same walls.
#[test]
fn compat_mirrors_cameras_too() {
    let disk = Disk::bare();
    let compat = furnish(&HouseFiles { blenderproc_compat: true, ..disk.files() }, &Limits::default()).unwrap();
    assert_eq!(compat.cameras.len(), 6);
    for (one, other) in bare().cameras.iter().zip(&compat.cameras) {
        assert_eq!(
            (one.position.x, one.position.y, one.position.z),
            (other.position.x, other.position.y, -other.position.z)
        );
        assert_eq!((one.target.z, one.fov_y_deg, one.number), (-other.target.z, other.fov_y_deg, other.number));
    }
}

/// Two negative factors are half a turn, three and one a mirror.
#[test]
fn only_mirrors_are_reported() {
    let disk = Disk::bare();
    for (scale, is_reported) in [(json!([-1, 1, -1]), false), (json!([-1, -1, -1]), true), (json!([1, 1, -1]), true)] {
        let mut json = disk.json.clone();
        json["scene"]["room"][2]["children"][33]["scale"] = scale.clone();
        let house = disk.furnish_json(&json).unwrap();
        assert_eq!(house.findings.iter().any(|f| f.code == "mirrored_piece"), is_reported, "{scale}");
        assert!(signed_volume(&pieces_of(&house, LIBRARY, 8)[0].mesh) > 0.0);
    }
}
