//! Meshes as binary PLY, oriented so that Mitsuba takes the same side as the front as the built-in tracer does.

use glam::Vec3;
use mateval_dataset::TriangleMesh;

/// How a mesh is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sheet {
    /// The mesh as it is.
    Whole,
    /// Without vertex normals.
    Flat,
    /// Without vertex normals, front and back swapped and this far, in metres, behind the mesh.
    Behind(f32),
}

/// The mesh as a PLY file, and whether the file has vertex normals.
///
/// The built-in tracer takes the side of the vertex normals as the front, Mitsuba the side from which the corners run
/// counter-clockwise. Where the two disagree the order of the corners is reversed. uv are written as they are.
pub(super) fn ply_bytes(mesh: &TriangleMesh, sheet: Sheet) -> (Vec<u8>, bool) {
    let normals = mesh.normals.as_ref().filter(|_| sheet == Sheet::Whole);
    let mut vertices = Vec::new();
    let mut count = mesh.positions.len();
    let mut faces = Vec::with_capacity(mesh.triangles.len() * 13);
    let push = |vertices: &mut Vec<u8>, vertex: usize, position: Vec3, normal: Option<Vec3>| {
        put(vertices, &position.to_array());
        normal.iter().for_each(|normal| put(vertices, &normal.to_array()));
        mesh.uvs.iter().for_each(|uvs| put(vertices, &uvs[vertex].to_array()));
    };
    for (vertex, position) in mesh.positions.iter().enumerate() {
        push(&mut vertices, vertex, *position, normals.map(|normals| normals[vertex]));
    }
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let front = front(mesh, index);
        let mut corners = if front.turned { [triangle[0], triangle[2], triangle[1]] } else { *triangle };
        let needs_own = match sheet {
            Sheet::Behind(_) => true,
            // The vertex normals cancel out, and the built-in tracer takes the triangle's own normal.
            Sheet::Whole => normals.is_some() && front.sum == Vec3::ZERO,
            Sheet::Flat => false,
        };
        if needs_own {
            let shift = if let Sheet::Behind(distance) = sheet { -front.normal * distance } else { Vec3::ZERO };
            for (k, corner) in corners.into_iter().enumerate() {
                let vertex = corner as usize;
                push(&mut vertices, vertex, mesh.positions[vertex] + shift, normals.map(|_| front.normal));
                corners[k] = (count + k) as u32;
            }
            count += 3;
        }
        if matches!(sheet, Sheet::Behind(_)) {
            corners.swap(1, 2);
        }
        faces.push(3);
        corners.iter().for_each(|corner| faces.extend(corner.to_le_bytes()));
    }
    let mut bytes = ply_header(count, mesh.triangles.len(), normals.is_some(), mesh.uvs.is_some()).into_bytes();
    bytes.append(&mut vertices);
    bytes.append(&mut faces);
    (bytes, normals.is_some())
}

/// How many triangles have a vertex normal that points away from their front.
pub(super) fn bent_triangles(mesh: &TriangleMesh) -> usize {
    let Some(normals) = &mesh.normals else { return 0 };
    let bent = |index: &usize| {
        let front = front(mesh, *index);
        mesh.triangles[*index].iter().any(|&vertex| normals[vertex as usize].dot(front.normal) < 0.0)
    };
    (0..mesh.triangles.len()).filter(bent).count()
}

/// The side of a triangle that counts as its front.
struct Front {
    /// Normal of the triangle itself, on its front.
    normal: Vec3,
    /// Sum of the vertex normals.
    sum: Vec3,
    /// Whether the corners run clockwise, seen from the front.
    turned: bool,
}

fn front(mesh: &TriangleMesh, triangle: usize) -> Front {
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
    let of_vertices = |normals: &Vec<Vec3>| mesh.triangles[triangle].iter().map(|&v| normals[v as usize]).sum();
    let sum: Vec3 = mesh.normals.as_ref().map_or(Vec3::ZERO, of_vertices);
    let turned = sum.dot(normal) < 0.0;
    Front { normal: if turned { -normal } else { normal }, sum, turned }
}

fn put(bytes: &mut Vec<u8>, values: &[f32]) {
    values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
}

fn ply_header(vertices: usize, faces: usize, normals: bool, uvs: bool) -> String {
    let properties = |names: &str, present: bool| -> String {
        names.split(' ').filter(|_| present).map(|name| format!("property float {name}\n")).collect()
    };
    format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\n{}{}{}element face {faces}\n\
         property list uchar int vertex_indices\nend_header\n",
        properties("x y z", true),
        properties("nx ny nz", normals),
        properties("u v", uvs)
    )
}

#[cfg(test)]
mod tests {
    use mateval_testkit::scenes::quad;

    use super::*;

    fn square() -> TriangleMesh {
        TriangleMesh { normals: Some(vec![-Vec3::Z; 4]), ..quad(Vec3::ZERO, Vec3::X, Vec3::Y) }
    }

    /// The corners of each face, as positions.
    fn corners(bytes: &[u8]) -> Vec<[Vec3; 3]> {
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let header = std::str::from_utf8(&bytes[..end]).unwrap();
        let number = |word: &str| -> usize {
            header.lines().find_map(|line| line.strip_prefix(word)).unwrap().trim().parse().unwrap()
        };
        let stride = 4 * header.lines().filter(|line| line.starts_with("property float")).count();
        let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let vertex = |k: usize| Vec3::from_array([0, 4, 8].map(|o| float(end + k * stride + o)));
        let faces = end + number("element vertex") * stride;
        assert_eq!(bytes.len(), faces + 13 * number("element face"));
        let index = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        (0..number("element face")).map(|f| [1, 5, 9].map(|o| vertex(index(faces + 13 * f + o)))).collect()
    }

    fn normal([a, b, c]: [Vec3; 3]) -> Vec3 {
        (b - a).cross(c - a).normalize()
    }

    #[test]
    fn corners_run_counter_clockwise_seen_from_the_front() {
        let (bytes, normals) = ply_bytes(&square(), Sheet::Whole);
        assert!(normals && corners(&bytes).into_iter().all(|face| normal(face) == -Vec3::Z));
        assert_eq!(bent_triangles(&square()), 0);
    }

    #[test]
    fn the_sheet_behind_faces_the_other_way() {
        let (bytes, normals) = ply_bytes(&square(), Sheet::Behind(0.01));
        assert!(!normals);
        for face in corners(&bytes) {
            assert!(normal(face) == Vec3::Z && face.iter().all(|corner| (corner.z - 0.01).abs() < 1e-9));
        }
    }

    #[test]
    fn a_triangle_whose_vertex_normals_are_zero_gets_its_own() {
        let mut mesh = square();
        mesh.normals = Some(vec![Vec3::ZERO; 4]);
        let (bytes, _) = ply_bytes(&mesh, Sheet::Whole);
        assert!(String::from_utf8_lossy(&bytes).contains("element vertex 10\n"));
        mesh.normals = Some(vec![Vec3::Z, Vec3::Z, -Vec3::Z, Vec3::Z]);
        assert_eq!(bent_triangles(&mesh), 2);
    }
}
