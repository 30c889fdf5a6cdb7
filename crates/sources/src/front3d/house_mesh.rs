//! Meshes of the architecture: turns flat lists of numbers into triangles and reports what had to be repaired.

use glam::{Vec2, Vec3};
use mateval_scene::TriangleMesh;
use serde_json::Value;

use super::document::{kind, list};
use crate::log::Log;
use crate::surface_mesh::has_area;

/// Coordinates beyond this many metres are faults.
const FARTHEST: f64 = 1e5;
/// The largest deviation of a normal's length from 1 that is not reported.
const UNIT_TOLERANCE: f64 = 0.01;

/// Reads `xyz`, `uv` and `faces` of the mesh at `place`. None, with a finding, where no triangle is usable.
pub(super) fn read(from: &Value, place: &str, log: &mut Log) -> Option<TriangleMesh> {
    // Anything that is not a number is read as NaN and then handled with the numbers that are not finite.
    let floats = |key: &str| list(from, key).iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect::<Vec<f64>>();
    let (xyz, uv) = (floats("xyz"), floats("uv"));
    let positions = positions(&xyz);
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
    Some(mesh.picked(|_| true))
}

/// One position for every three numbers. A coordinate beyond [`FARTHEST`] becomes NaN.
fn positions(xyz: &[f64]) -> Vec<Vec3> {
    let sound = |v: f64| if v.abs() <= FARTHEST { v as f32 } else { f32::NAN };
    xyz.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(p.map(sound))).collect()
}

fn faces(from: &Value, place: &str, log: &mut Log) -> Vec<[u32; 3]> {
    let all = list(from, "faces");
    if !all.len().is_multiple_of(3) {
        let message = format!("expected a multiple of 3 vertex indices, found {}", all.len());
        log.warn("bad_faces", &format!("{place}/faces"), message, "left the last ones out");
    }
    // Anything that is not an index becomes an index that no mesh has.
    let index = |value: &Value| value.as_u64().and_then(|v| u32::try_from(v).ok()).unwrap_or(u32::MAX);
    all.as_chunks::<3>().0.iter().map(|face| [0, 1, 2].map(|corner| index(&face[corner]))).collect()
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

/// One pair of numbers for each vertex, or none where the list is empty. Missing and impossible numbers become 0.
fn uvs(uv: &[f64], mesh: &TriangleMesh, place: &str, log: &mut Log) -> Option<Vec<Vec2>> {
    let (pairs, count) = (uv.as_chunks::<2>().0, mesh.positions.len());
    let place = format!("{place}/uv");
    if pairs.len() < count {
        let message = format!("expected {count} texture coordinates, one for each vertex, found {}", pairs.len());
        log.warn("bad_uv", &place, message, "used (0, 0) for the others");
    }
    let bad = pairs.iter().flatten().filter(|v| v.is_nan() || v.abs() > FARTHEST).count();
    if bad > 0 {
        let message = format!("{bad} of {} values are not finite numbers", uv.len());
        log.warn("bad_uv", &place, message, "used 0 for them");
    }
    let sound = |v: f64| if v.abs() <= FARTHEST { v as f32 } else { 0.0 };
    let pair = |at: usize| pairs.get(at).map_or(Vec2::ZERO, |pair| Vec2::from_array(pair.map(sound)));
    (!pairs.is_empty()).then(|| (0..count).map(pair).collect())
}

fn note_bad_normals(from: &Value, vertices: usize, place: &str, log: &mut Log) {
    let place = format!("{place}/normal");
    let Some(normals) = from.get("normal") else { return };
    let Some(all) = normals.as_array() else {
        let message = format!("expected a list of numbers, found {}", kind(normals));
        return log.note("bad_normals", &place, message, "used the triangles' geometric normals");
    };
    let floats: Vec<f64> = all.iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect();
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
        let mesh = read(&mesh, "/mesh/0", &mut log);
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
    fn each_fault_is_repaired_and_reported() {
        for (key, value, triangles, finding) in [
            ("faces", json!([0, 1, 2, 0, 2, 9]), 1, "bad_faces /mesh/0/faces"),
            ("faces", json!([0, 1, 2, 0, 2, -3]), 1, "bad_faces /mesh/0/faces"),
            ("faces", json!([0, 1, 2, 0, 2, 2.5]), 1, "bad_faces /mesh/0/faces"),
            ("faces", json!([0, 1, 2, 0]), 1, "bad_faces /mesh/0/faces"),
            ("faces", json!([0, 1, 2, 3, 3, 2]), 1, "zero_area /mesh/0/faces"),
            ("xyz", json!([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, null, 0]), 1, "bad_faces /mesh/0/faces"),
            ("xyz", json!([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1e30, 0]), 1, "bad_faces /mesh/0/faces"),
            ("uv", json!([0, 0, 1, null, 1, 1, 0, 1]), 2, "bad_uv /mesh/0/uv"),
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
    fn a_mesh_without_triangles_is_none() {
        for (key, value) in [("faces", json!([])), ("faces", json!(null)), ("xyz", json!("x")), ("faces", json!({}))] {
            let (mesh, findings) = read_one(with(key, value));
            assert!(mesh.is_none());
            assert!(findings.contains(&"empty_mesh /mesh/0".to_owned()), "{findings:?}");
        }
    }
}
