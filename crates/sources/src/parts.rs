//! Splits a mesh into parts: its connected components, or those of each of its groups.

use std::collections::HashMap;

use mateval_scene::TriangleMesh;

/// The most parts of one instance. The largest by area are parts of their own, and all others share the last part.
pub const MAX_PARTS: usize = 64;

/// The part of each triangle. Parts are numbered from 0 by area, largest first.
///
/// Triangles are connected if they share a vertex position to the last bit.
pub fn connected_parts(mesh: &TriangleMesh) -> Vec<usize> {
    labelled_parts(mesh, &vec![0; mesh.triangles.len()])
}

/// As [`connected_parts`], but only triangles of the same label are connected. `labels` holds one for each triangle.
pub fn labelled_parts(mesh: &TriangleMesh, labels: &[usize]) -> Vec<usize> {
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
        *areas.entry(*root).or_default() += area(mesh, triangle);
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
    let mut places: HashMap<(usize, [u32; 3]), u32> = HashMap::new();
    let corners: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .zip(labels)
        .map(|(triangle, label)| {
            triangle.map(|vertex| {
                // Adding zero turns -0 into +0, which is the same position.
                let bits = mesh.positions[vertex as usize].to_array().map(|v| (v + 0.0).to_bits());
                let next = places.len() as u32;
                *places.entry((*label, bits)).or_insert(next)
            })
        })
        .collect();
    // Triangles join their vertices into components (union-find).
    let mut parent: Vec<u32> = (0..places.len() as u32).collect();
    for triangle in &corners {
        let [a, b, c] = triangle.map(|place| find(&mut parent, place));
        let least = a.min(b).min(c);
        for root in [a, b, c] {
            parent[root as usize] = least;
        }
    }
    // A component is identified by its first triangle.
    let mut first_triangle: HashMap<u32, usize> = HashMap::new();
    corners
        .iter()
        .enumerate()
        .map(|(index, triangle)| *first_triangle.entry(find(&mut parent, triangle[0])).or_insert(index))
        .collect()
}

/// The root of a vertex's component. Shortens the path to it.
fn find(parent: &mut [u32], mut vertex: u32) -> u32 {
    while parent[vertex as usize] != vertex {
        parent[vertex as usize] = parent[parent[vertex as usize] as usize];
        vertex = parent[vertex as usize];
    }
    vertex
}

fn area(mesh: &TriangleMesh, triangle: usize) -> f64 {
    let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
    (b - a).cross(c - a).length() / 2.0
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

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
