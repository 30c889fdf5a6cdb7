//! Meshes of surfaces: brings them to world space, repairs positions, normals and front sides, and splits them into
//! parts, which are connected components, or those of each group.

use std::collections::HashMap;

use glam::{DMat3, DMat4, DVec3, Vec3};
use mateval_dataset::TriangleMesh;

use crate::log::Log;

/// Coordinates beyond this many metres are faults.
const FARTHEST: f32 = 1e9;

/// Counts of the repairs to a mesh.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Repairs {
    /// Triangles left out because a corner is not finite or too far away.
    pub(crate) not_finite: usize,
    /// Triangles without area, which are kept.
    pub(crate) degenerate: usize,
    /// Normals that were recomputed because they were zero or not finite.
    pub(crate) normals: usize,
}

impl Repairs {
    /// Reports the repairs to `mesh`, which has been repaired.
    pub(crate) fn report(&self, place: &str, mesh: &TriangleMesh, log: &mut Log) {
        let of = mesh.triangles.len() + self.not_finite;
        if self.not_finite > 0 {
            let message =
                format!("{} of {of} triangles have corners that are not finite or too far away", self.not_finite);
            log.warn("not_finite", place, message, "left them out");
        }
        if self.degenerate > 0 {
            let message = format!("{} of {of} triangles have no area", self.degenerate);
            log.note("degenerate_triangles", place, message, "kept them");
        }
        if self.normals > 0 {
            let message = format!("{} normals are zero or not finite", self.normals);
            log.note("bad_normals", place, message, "computed them from the adjacent faces");
        }
    }
}

/// The mesh in world space. A mirroring transform keeps the front: the winding is reversed where the determinant is
/// negative, and normals are transformed by the inverse transpose. `flip` swaps front and back.
pub(crate) fn to_world(mut mesh: TriangleMesh, world_from_object: DMat4, flip: bool) -> (TriangleMesh, Repairs) {
    // Positions and normals.
    let mut repairs = Repairs::default();
    let linear = DMat3::from_mat4(world_from_object);
    let mirrored = linear.determinant() < 0.0;
    if world_from_object != DMat4::IDENTITY {
        for position in &mut mesh.positions {
            *position = world_from_object.transform_point3(position.as_dvec3()).as_vec3();
        }
        // The cofactor matrix is the inverse transpose times the determinant, and exists for singular transforms too.
        let normal_matrix = cofactors(linear) * if mirrored { -1.0 } else { 1.0 };
        for normal in mesh.normals.iter_mut().flatten() {
            *normal = (normal_matrix * normal.as_dvec3()).as_vec3();
        }
    }
    // The front side.
    repairs.not_finite = drop_far_triangles(&mut mesh);
    if mirrored != flip {
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    if flip {
        mesh.normals.iter_mut().flatten().for_each(|normal| *normal = -*normal);
    }
    // The other repairs.
    repairs.normals = repair_normals(&mut mesh);
    repairs.degenerate = (0..mesh.triangles.len()).filter(|&index| is_degenerate(mesh.corners(index))).count();
    (mesh, repairs)
}

fn cofactors(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

/// Twice the area of a triangle, and the square of its longest side.
fn extent(corners: [Vec3; 3]) -> (f64, f64) {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    ((b - a).cross(c - a).length(), longest)
}

fn is_degenerate(corners: [Vec3; 3]) -> bool {
    let (area, longest) = extent(corners);
    area <= 1e-12 * longest
}

/// Whether a triangle has an area worth keeping; false where a corner is not finite.
pub(crate) fn has_area(corners: [Vec3; 3]) -> bool {
    let (area, longest) = extent(corners);
    longest < 1e12 && area > 1e-9 * longest
}

/// Drops vertices that are not finite or too far away and the triangles that use them. Returns the number of triangles.
fn drop_far_triangles(mesh: &mut TriangleMesh) -> usize {
    let sound: Vec<bool> = mesh.positions.iter().map(|p| p.is_finite() && p.abs().max_element() <= FARTHEST).collect();
    if sound.iter().all(|s| *s) {
        return 0;
    }
    // Triangles, with the vertices renumbered.
    let before = mesh.triangles.len();
    mesh.triangles.retain(|triangle| triangle.iter().all(|&v| sound[v as usize]));
    let mut next = 0;
    let new_index: Vec<u32> = sound.iter().map(|&s| (next, next += u32::from(s)).0).collect();
    mesh.triangles.iter_mut().flatten().for_each(|vertex| *vertex = new_index[*vertex as usize]);
    // Vertices.
    let keep = |index: &mut usize| (sound[*index], *index += 1).0;
    let mut index = 0;
    mesh.positions.retain(|_| keep(&mut index));
    if let Some(normals) = &mut mesh.normals {
        let mut index = 0;
        normals.retain(|_| keep(&mut index));
    }
    if let Some(uvs) = &mut mesh.uvs {
        let mut index = 0;
        uvs.retain(|_| keep(&mut index));
    }
    before - mesh.triangles.len()
}

/// Normalises normals. One that cannot be normalised is computed from the adjacent faces. Returns the number of those.
fn repair_normals(mesh: &mut TriangleMesh) -> usize {
    let Some(normals) = &mesh.normals else { return 0 };
    let unit: Vec<Option<Vec3>> = normals.iter().map(|n| n.as_dvec3().try_normalize().map(|n| n.as_vec3())).collect();
    let faulty = unit.iter().filter(|n| n.is_none()).count();
    let smooth = if faulty > 0 { smooth_normals(mesh) } else { Vec::new() };
    mesh.normals = Some(unit.into_iter().enumerate().map(|(i, n)| n.unwrap_or_else(|| smooth[i])).collect());
    faulty
}

/// Vertex normals of a smooth surface: the mean of the adjacent faces' normals, weighted by their angles at the vertex
/// (Thürmer and Wüthrich, "Computing vertex normals from polygonal facets", JGT 1998), as Mitsuba computes them for an
/// OBJ without normals.
pub(crate) fn smooth_normals(mesh: &TriangleMesh) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let corners = mesh.corners(index).map(|p| p.as_dvec3());
        let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        for (k, &vertex) in triangle.iter().enumerate() {
            let to = |other: usize| (corners[(k + other) % 3] - corners[k]).normalize_or_zero();
            let angle = libm::acos(to(1).dot(to(2)).clamp(-1.0, 1.0));
            sums[vertex as usize] += face * angle;
        }
    }
    sums.into_iter().map(|sum| sum.try_normalize().unwrap_or(DVec3::Z).as_vec3()).collect()
}

/// The most parts of one instance. The largest by area are parts of their own, and all others share the last part.
pub const MAX_PARTS: usize = 64;

/// The part of each triangle. Parts are numbered from 0 by area, largest first.
///
/// Triangles are connected if they share a vertex position to the last bit.
pub fn connected_parts(mesh: &TriangleMesh) -> Vec<usize> {
    labelled_parts(mesh, &vec![0; mesh.triangles.len()])
}

/// As [`connected_parts`], but only triangles of the same label are connected. `labels` holds one for each triangle.
pub(crate) fn labelled_parts(mesh: &TriangleMesh, labels: &[usize]) -> Vec<usize> {
    by_area(mesh, &component_of_triangles(mesh, labels))
}

/// As [`connected_parts`], but the triangles of a label form one part, whether they are connected or not.
pub fn parts_of_labels(mesh: &TriangleMesh, labels: &[usize]) -> Vec<usize> {
    let mut first_triangle: HashMap<usize, usize> = HashMap::new();
    let first = labels.iter().enumerate().map(|(triangle, label)| *first_triangle.entry(*label).or_insert(triangle));
    by_area(mesh, &first.collect::<Vec<_>>())
}

/// The part of each triangle, where `roots` holds the first triangle of its group.
fn by_area(mesh: &TriangleMesh, roots: &[usize]) -> Vec<usize> {
    let mut areas: HashMap<usize, f64> = HashMap::new();
    for (triangle, root) in roots.iter().enumerate() {
        *areas.entry(*root).or_default() += mesh.triangle_area(triangle);
    }
    let mut by_area: Vec<(usize, f64)> = areas.into_iter().collect();
    // Equal areas are ordered by their first triangle, so that the order of the hash map has no effect.
    by_area.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let rank: HashMap<usize, usize> =
        by_area.iter().enumerate().map(|(rank, (root, _))| (*root, rank.min(MAX_PARTS - 1))).collect();
    roots.iter().map(|root| rank[root]).collect()
}

/// For each triangle the first triangle of its component.
fn component_of_triangles(mesh: &TriangleMesh, labels: &[usize]) -> Vec<usize> {
    // Vertices with the same label and position get the same number.
    let mut places: HashMap<(usize, [u32; 3]), usize> = HashMap::new();
    let corners: Vec<[usize; 3]> = mesh
        .triangles
        .iter()
        .zip(labels)
        .map(|(triangle, label)| {
            triangle.map(|vertex| {
                // Adding zero turns -0 into +0, which is the same position.
                let bits = mesh.positions[vertex as usize].to_array().map(|v| (v + 0.0).to_bits());
                let next = places.len();
                *places.entry((*label, bits)).or_insert(next)
            })
        })
        .collect();
    // Triangles join their vertices into components (union-find).
    let mut parent: Vec<usize> = (0..places.len()).collect();
    for triangle in &corners {
        let [a, b, c] = triangle.map(|place| find(&mut parent, place));
        let least = a.min(b).min(c);
        for root in [a, b, c] {
            parent[root] = least;
        }
    }
    // A component is identified by its first triangle.
    let mut first_triangle: HashMap<usize, usize> = HashMap::new();
    corners
        .iter()
        .enumerate()
        .map(|(index, triangle)| *first_triangle.entry(find(&mut parent, triangle[0])).or_insert(index))
        .collect()
}

/// The root of a member's component. Shortens the path to it.
pub(crate) fn find(parent: &mut [usize], mut member: usize) -> usize {
    while parent[member] != member {
        parent[member] = parent[parent[member]];
        member = parent[member];
    }
    member
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::primitives::{cube, rectangle};

    fn front(mesh: &TriangleMesh) -> Vec3 {
        let [a, b, c] = mesh.corners(0);
        (b - a).cross(c - a).normalize()
    }

    /// In Mitsuba 3.9.1 a rectangle scaled by (-1, 1, 1) keeps its shading normal, and so its emitting side, at +z.
    #[test]
    fn mirrors_keep_the_front() {
        for scale in [DVec3::new(-1.0, 1.0, 1.0), DVec3::new(2.0, -0.5, 1.0), DVec3::ONE] {
            let (mesh, repairs) = to_world(rectangle(), DMat4::from_scale(scale), false);
            assert_eq!(repairs, Repairs::default());
            assert!((front(&mesh) - Vec3::Z).length() < 1e-6);
            assert!(mesh.normals.unwrap().iter().all(|n| (*n - Vec3::Z).length() < 1e-6));
        }
        // Twin: turned upside down, it faces down.
        let (mesh, _) = to_world(rectangle(), DMat4::from_rotation_x(std::f64::consts::PI), false);
        assert!((front(&mesh) + Vec3::Z).length() < 1e-6);
        let (mesh, _) = to_world(rectangle(), DMat4::IDENTITY, true);
        assert!((front(&mesh) + Vec3::Z).length() < 1e-6);
    }

    #[test]
    fn normals_are_transformed_by_the_inverse_transpose() {
        let tilted = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_4);
        let (mesh, _) = to_world(rectangle(), DMat4::from_scale(DVec3::new(1.0, 1.0, 5.0)) * tilted, false);
        assert!(mesh.normals.as_ref().unwrap()[0].dot(front(&mesh)) > 0.999_99);
    }

    #[test]
    fn faults_are_repaired_and_counted() {
        let mut mesh = cube();
        mesh.positions[0].x = f32::NAN;
        mesh.positions[5] = mesh.positions[4];
        mesh.normals.as_mut().unwrap()[8] = Vec3::ZERO;
        let (mesh, repairs) = to_world(mesh, DMat4::IDENTITY, false);
        assert_eq!(repairs, Repairs { not_finite: 2, degenerate: 1, normals: 1 });
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (10, 23));
        assert!(mesh.positions.iter().all(|p| p.is_finite()));
        assert!(mesh.normals.unwrap().iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn smooth_normals_of_a_flat_mesh_are_flat() {
        assert!(smooth_normals(&rectangle()).iter().all(|n| (*n - Vec3::Z).length() < 1e-6));
    }

    /// `count` separate triangles of growing size.
    fn islands(count: usize) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for index in 0..count {
            let origin = Vec3::X * 100.0 * index as f32;
            let size = 1.0 + index as f32;
            let start = mesh.positions.len() as u32;
            mesh.positions.extend([origin, origin + Vec3::Y * size, origin + Vec3::Z]);
            mesh.triangles.push([start, start + 1, start + 2]);
        }
        mesh
    }

    #[test]
    fn largest_first() {
        assert_eq!(connected_parts(&islands(3)), [2, 1, 0]);
    }

    #[test]
    fn shared_positions_join_even_across_split_vertices() {
        let mut mesh = islands(2);
        mesh.positions.extend([Vec3::ZERO, Vec3::new(-0.0, 1.0, 0.0), Vec3::X * 100.0]);
        mesh.triangles.push([6, 7, 8]);
        assert_eq!(connected_parts(&mesh), [0, 0, 0]);
    }

    #[test]
    fn labels_split_connected_triangles() {
        let mut mesh = islands(2);
        mesh.triangles.push([0, 1, 2]);
        assert_eq!(connected_parts(&mesh), [0, 1, 0]);
        assert_eq!(labelled_parts(&mesh, &[0, 0, 1]), [1, 0, 2]);
        assert_eq!(parts_of_labels(&mesh, &[0, 0, 1]), [0, 0, 1]);
    }

    #[test]
    fn never_more_than_the_most() {
        let parts = connected_parts(&islands(MAX_PARTS + 10));
        assert_eq!(parts.iter().max(), Some(&(MAX_PARTS - 1)));
        assert_eq!(parts.iter().filter(|part| **part == MAX_PARTS - 1).count(), 11);
    }
}
