//! Meshes of the architecture: turns flat lists of numbers into triangles and reports what had to be repaired.

use glam::{DVec3, Vec2, Vec3};
use mateval_dataset::TriangleMesh;
use mateval_files::untrusted::shortened;
use serde_json::Value;

use super::document::{kind, list, number};
use crate::log::Log;
use crate::source_scene::shift_of;
use crate::surface_mesh::has_area;

/// Coordinates beyond this many metres are faults.
const FARTHEST: f64 = 1e9;
/// The largest deviation of a normal's length from 1 that is not reported.
const UNIT_TOLERANCE: f64 = 0.01;

/// Reads `xyz`, `uv` and `faces` of the mesh at `place`, and what has been subtracted from its positions. None, with a
/// finding, where no triangle is usable.
pub(super) fn read(from: &Value, place: &str, log: &mut Log) -> Option<(TriangleMesh, DVec3)> {
    let [xyz, uv] = ["xyz", "uv"].map(|key| numbers(from, key, place, log));
    let base = base(&xyz);
    let positions = positions(&xyz, base);
    let mut mesh = TriangleMesh { positions, normals: None, uvs: None, triangles: faces(from, place, log) };
    drop_impossible(&mut mesh, place, log);
    drop_without_area(&mut mesh, place, log);
    mesh.uvs = uvs(&uv, &mesh, place, log);
    note_bad_normals(from, mesh.positions.len(), place, log);
    if mesh.triangles.is_empty() {
        log.note("empty_mesh", place, "expected a triangle with an area, found none", "left it out");
        return None;
    }
    // Unused vertices may have positions that are not finite, so they are dropped.
    Some((mesh.picked(|_| true), base))
}

/// The numbers at `key`. Anything else is read as NaN, which is handled with the numbers that are not finite; the first
/// such entry is reported. A null is what JSON has for NaN.
fn numbers(from: &Value, key: &str, place: &str, log: &mut Log) -> Vec<f64> {
    if let Some(found) = from.get(key).filter(|found| !found.is_array() && !found.is_null()) {
        let message = format!("expected a list of numbers, found {}", kind(found));
        log.warn("bad_number", &format!("{place}/{key}"), message, "treated it as absent");
    }
    let all = list(from, key);
    let is_other = |value: &&Value| !value.is_null() && number(value).is_none();
    if let Some(at) = all.iter().position(|value| is_other(&value)) {
        let count = all.iter().filter(is_other).count();
        let found = match &all[at] {
            Value::String(text) => format!("'{}'", shortened(text)),
            other => kind(other).to_owned(),
        };
        let message = format!("expected a number, found {found}; {count} of {} entries are none", all.len());
        log.warn("bad_number", &format!("{place}/{key}/{at}"), message, "read them as not finite");
    }
    all.iter().map(|value| number(value).unwrap_or(f64::NAN)).collect()
}

/// The first sound position in whole metres, where it lies far from the origin, else zero.
fn base(xyz: &[f64]) -> DVec3 {
    let is_sound = |p: &&[f64; 3]| p.iter().all(|v| v.abs() <= FARTHEST);
    let first = xyz.as_chunks::<3>().0.iter().find(is_sound);
    first.map_or(DVec3::ZERO, |first| shift_of(DVec3::from_array(*first)))
}

/// One position for every three numbers, relative to `base`. A coordinate beyond [`FARTHEST`] becomes NaN.
fn positions(xyz: &[f64], base: DVec3) -> Vec<Vec3> {
    let is_sound = |p: &[f64; 3]| p.iter().all(|v| v.abs() <= FARTHEST);
    let position = |p: &[f64; 3]| if is_sound(p) { (DVec3::from_array(*p) - base).as_vec3() } else { Vec3::NAN };
    xyz.as_chunks::<3>().0.iter().map(position).collect()
}

fn faces(from: &Value, place: &str, log: &mut Log) -> Vec<[u32; 3]> {
    let all = numbers(from, "faces", place, log);
    if !all.len().is_multiple_of(3) {
        let message = format!("expected a multiple of 3 vertex indices, found {}", all.len());
        log.warn("bad_faces", &format!("{place}/faces"), message, "left the last ones out");
    }
    // Anything that is not an index becomes an index that no mesh has.
    let whole =
        |value: f64| (value >= 0.0 && value.fract() == 0.0 && value < f64::from(u32::MAX)).then_some(value as u32);
    let index = |value: f64| whole(value).unwrap_or(u32::MAX);
    all.as_chunks::<3>().0.iter().map(|face| face.map(index)).collect()
}

/// Drops triangles whose vertices are missing or have positions that are not finite.
fn drop_impossible(mesh: &mut TriangleMesh, place: &str, log: &mut Log) {
    let before = mesh.triangles.len();
    let positions = &mesh.positions;
    let sound = |vertex: &u32| positions.get(*vertex as usize).is_some_and(|position| position.is_finite());
    mesh.triangles.retain(|triangle| triangle.iter().all(sound));
    let dropped = before - mesh.triangles.len();
    if dropped > 0 {
        let message = format!("{dropped} of {before} triangles name vertices that are missing or not finite");
        log.warn("bad_faces", &format!("{place}/faces"), message, "left them out");
    }
}

fn drop_without_area(mesh: &mut TriangleMesh, place: &str, log: &mut Log) {
    let before = mesh.triangles.len();
    let positions = &mesh.positions;
    mesh.triangles.retain(|triangle| has_area(triangle.map(|vertex| positions[vertex as usize])));
    let dropped = before - mesh.triangles.len();
    if dropped > 0 {
        let message = format!("{dropped} of {before} triangles have no area");
        log.note("zero_area", &format!("{place}/faces"), message, "left them out");
    }
}

/// One pair of numbers for each vertex; absent if the list is empty. Missing and impossible pairs become NaN.
fn uvs(uv: &[f64], mesh: &TriangleMesh, place: &str, log: &mut Log) -> Option<Vec<Vec2>> {
    let (pairs, count) = (uv.as_chunks::<2>().0, mesh.positions.len());
    let place = format!("{place}/uv");
    if pairs.len() < count {
        let message = format!("expected {count} texture coordinates, one for each vertex, found {}", pairs.len());
        log.warn("bad_uv", &place, message, "treated the others as missing");
    }
    let is_sound = |pair: &[f64; 2]| pair.iter().all(|v| v.abs() <= FARTHEST);
    let bad = pairs.iter().filter(|pair| !is_sound(pair)).count();
    if bad > 0 {
        let message = format!("{bad} of {} texture coordinates are not finite numbers", pairs.len());
        log.warn("bad_uv", &place, message, "treated them as missing");
    }
    let sound = |pair: &[f64; 2]| if is_sound(pair) { Vec2::from_array(pair.map(|v| v as f32)) } else { Vec2::NAN };
    (!pairs.is_empty()).then(|| (0..count).map(|at| pairs.get(at).map_or(Vec2::NAN, sound)).collect())
}

fn note_bad_normals(from: &Value, vertices: usize, place: &str, log: &mut Log) {
    let place = format!("{place}/normal");
    let Some(normals) = from.get("normal") else { return };
    let Some(all) = normals.as_array() else {
        let message = format!("expected a list of numbers, found {}", kind(normals));
        return log.note("bad_normals", &place, message, "used the triangles' geometric normals");
    };
    let floats: Vec<f64> = all.iter().map(|v| number(v).unwrap_or(f64::NAN)).collect();
    let is_unit = |n: &[f64; 3]| (n.iter().map(|v| v * v).sum::<f64>().sqrt() - 1.0).abs() <= UNIT_TOLERANCE;
    let bad = floats.as_chunks::<3>().0.iter().filter(|normal| !is_unit(normal)).count();
    if bad > 0 || floats.len() != 3 * vertices {
        let (expected, found) = (3 * vertices, floats.len());
        let message =
            format!("expected {expected} numbers, found {found}; {bad} of the normals are not of unit length");
        log.note("bad_normals", &place, message, "used the triangles' geometric normals");
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn read_one(mesh: Value) -> (Option<TriangleMesh>, Vec<String>) {
        let mut log = Log::new("house.json".into(), 100);
        let mesh = read(&mesh, "/mesh/0", &mut log).map(|(mesh, _)| mesh);
        (mesh, log.into_findings().into_iter().map(|f| format!("{} {}", f.code, f.place)).collect())
    }

    fn square() -> Value {
        json!({
            "xyz": [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0], "uv": [0, 0, 1, 0, 1, 1, 0, 1],
            "normal": [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1], "faces": [0, 1, 2, 0, 2, 3]
        })
    }

    fn with(key: &str, value: Value) -> Value {
        let mut mesh = square();
        mesh[key] = value;
        mesh
    }

    #[test]
    fn a_sound_mesh_has_no_findings() {
        let (mesh, findings) = read_one(square());
        let mesh = mesh.unwrap();
        assert_eq!((mesh.triangles.len(), mesh.area(), findings.len()), (2, 1.0, 0));
        assert_eq!(mesh.uvs.unwrap()[2], Vec2::ONE);
    }

    #[test]
    fn numbers_may_be_texts_and_far_meshes_keep_their_shape() {
        let texts = |key: &str| square()[key].as_array().unwrap().iter().map(Value::to_string).collect::<Vec<_>>();
        let as_texts =
            json!({ "xyz": texts("xyz"), "uv": texts("uv"), "normal": texts("normal"), "faces": texts("faces") });
        let (mesh, findings) = read_one(as_texts);
        assert_eq!((mesh, findings.len()), (read_one(square()).0, 0));
        let far =
            square()["xyz"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap() + 448_231.25).collect::<Vec<_>>();
        let mut log = Log::new("house.json".into(), 100);
        let (mesh, base) = read(&with("xyz", json!(far)), "/mesh/0", &mut log).unwrap();
        assert_eq!((base, mesh.positions[2]), (DVec3::splat(448_231.0), Vec3::new(1.25, 1.25, 0.25)));
    }

    #[test]
    fn each_fault_is_repaired_and_reported() {
        for (key, value, triangles, finding) in [
            ("faces", json!([0, 1, 2, 0, 2, 9]), 1, "bad_faces /mesh/0/faces"),
            ("faces", json!([0, 1, 2, 0, 2, -3]), 1, "bad_faces /mesh/0/faces"),
            ("faces", json!([0, 1, 2, 0, 2, 2.5]), 1, "bad_faces /mesh/0/faces"),
            ("faces", json!([0, 1, 2, 0]), 1, "bad_faces /mesh/0/faces"),
            ("faces", json!([0, 1, 2, 3, 3, 2]), 1, "zero_area /mesh/0/faces"),
            ("xyz", json!([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1e30, 0]), 1, "bad_faces /mesh/0/faces"),
            ("uv", json!([0, 0, 1, 0, 1, 1]), 2, "bad_uv /mesh/0/uv"),
            ("normal", json!([0, 0, 1, 3, 0, 1, 0, 0, 1, 0, 0, 1]), 2, "bad_normals /mesh/0/normal"),
            ("normal", json!([0, 0, 1]), 2, "bad_normals /mesh/0/normal"),
            ("normal", json!("x"), 2, "bad_normals /mesh/0/normal"),
        ] {
            let (mesh, findings) = read_one(with(key, value.clone()));
            let mesh = mesh.unwrap();
            assert_eq!((mesh.triangles.len(), findings), (triangles, vec![finding.to_owned()]), "{key} {value}");
            assert!(mesh.positions.iter().all(|p| p.is_finite()));
            assert_eq!(mesh.uvs.map(|uvs| uvs.len()), Some(mesh.positions.len()));
        }
    }

    #[test]
    fn what_is_not_a_number_is_named() {
        for (key, value, triangles, other) in [
            ("xyz", json!([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, "1,5"]), 1, "bad_faces /mesh/0/faces"),
            ("uv", json!([0, 0, 1, 0, 1, 1, 0, "nan"]), 2, "bad_uv /mesh/0/uv"),
            ("faces", json!([0, 1, 2, 0, 2, "three"]), 1, "bad_faces /mesh/0/faces"),
        ] {
            let (mesh, findings) = read_one(with(key, value.clone()));
            let at = value.as_array().unwrap().len() - 1;
            assert!(findings.contains(&format!("bad_number /mesh/0/{key}/{at}")), "{findings:?}");
            assert!(findings.contains(&other.to_owned()) && findings.len() == 2, "{findings:?}");
            assert_eq!(mesh.unwrap().triangles.len(), triangles);
        }
    }

    #[test]
    fn what_is_not_a_list_is_named() {
        for (key, value, place) in [
            ("xyz", json!("0 0 0 1 0 0"), "/mesh/0/xyz"),
            ("faces", json!({ "a": 1 }), "/mesh/0/faces"),
            ("faces", json!([[0, 1, 2], [0, 2, 3]]), "/mesh/0/faces/0"),
            ("xyz", json!([[0, 0, 0], [1, 0, 0]]), "/mesh/0/xyz/0"),
        ] {
            let (mesh, findings) = read_one(with(key, value));
            assert!(mesh.is_none() && findings.contains(&format!("bad_number {place}")), "{findings:?}");
        }
    }

    #[test]
    fn a_mesh_without_triangles_is_none() {
        for (key, value) in [("faces", json!([])), ("faces", json!(null)), ("xyz", json!("x")), ("faces", json!({}))] {
            let (mesh, findings) = read_one(with(key, value));
            assert!(mesh.is_none());
            assert!(findings.contains(&"empty_mesh /mesh/0".to_owned()), "{findings:?}");
        }
    }
}
