//! Which triangle a ray meets: a bounding volume hierarchy over all triangles of all surfaces.
//!
//! The answer is that of testing every triangle ([`Accel::closest_by_testing_all`] is that test): boxes are padded, ties
//! go to the lowest triangle, so the shape of the tree never shows. Memory: at most 64 bytes of nodes and 48 bytes of
//! corners a triangle; half the nodes' share is usual, since leaves hold several triangles.

mod build;
mod traverse;
mod triangle;

use glam::Vec3;
use mateval_scene::TriangleMesh;
use mateval_scene::reference::SurfaceIndex;

use crate::error::TracerError;
use crate::ray::Ray;
use build::{Child, Node};
use triangle::ShearedRay;

/// A triangle's place in its own surface's mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TriangleIndex(pub usize);

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The surface.
    pub surface: SurfaceIndex,
    /// The triangle, within that surface's mesh.
    pub triangle: TriangleIndex,
    /// Weights of the triangle's corners, adding to one.
    pub barycentrics: Vec3,
    /// Along the ray, in metres.
    pub distance: f32,
    /// The triangle among all triangles, in the order of the surfaces.
    pub(crate) global: u32,
}

/// A triangle as the leaves hold it.
#[derive(Clone, Copy, Debug)]
struct LeafTriangle {
    corners: [Vec3; 3],
    global: u32,
    surface: u32,
}

/// The hierarchy. It holds its own copy of the corners, so worlds of the same triangles can share it.
#[derive(Debug)]
pub struct Accel {
    nodes: Vec<Node>,
    /// None when there are no triangles.
    root: Option<Child>,
    bounds: [[f32; 3]; 2],
    triangles: Vec<LeafTriangle>,
    /// For each surface the number of triangles before it; then their total.
    starts: Vec<u32>,
}

/// Coordinates beyond this are refused, in metres: f32 cannot tell one metre from the next there.
const LARGEST_COORDINATE: f32 = 1e7;

impl Accel {
    /// Builds over the meshes, one a surface, in this order.
    ///
    /// Fails where a triangle names a vertex that does not exist, where a coordinate is not finite or beyond 1e7 m, or
    /// beyond 2^31 triangles.
    pub fn build(meshes: &[&TriangleMesh]) -> Result<Self, TracerError> {
        let (corners, starts) = flatten(meshes)?;
        if corners.is_empty() {
            return Ok(Self { nodes: vec![], root: None, bounds: [[0.0; 3]; 2], triangles: vec![], starts });
        }
        let tree = build::build(&corners);
        let leaf = |&global: &u32| LeafTriangle {
            corners: corners[global as usize],
            global,
            surface: (starts.partition_point(|&start| start <= global) - 1) as u32,
        };
        let triangles = tree.order.iter().map(leaf).collect();
        Ok(Self { nodes: tree.nodes, root: Some(tree.root), bounds: tree.bounds, triangles, starts })
    }

    /// The nearest hit, at a distance above 0.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        traverse::traverse(self, ray, false, |_| true)
    }

    /// The nearest hit that `accept` takes. It may be asked about other hits too, in any order, and must always give the
    /// same answer for the same hit.
    pub fn closest_where(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        traverse::traverse(self, ray, false, accept)
    }

    /// Whether there is any hit.
    pub fn occluded(&self, ray: &Ray) -> bool {
        traverse::traverse(self, ray, true, |_| true).is_some()
    }

    /// Whether there is any hit that `accept` takes, asked as in [`Self::closest_where`].
    pub fn occluded_where(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        traverse::traverse(self, ray, true, accept).is_some()
    }

    /// What [`Self::closest`] answers, found without the hierarchy; for tests and doubts.
    pub fn closest_by_testing_all(&self, ray: &Ray) -> Option<Hit> {
        if !ray.is_usable() {
            return None;
        }
        let sheared = ShearedRay::new(ray);
        let hits = (0..self.triangles.len() as u32).filter_map(|s| self.intersect(s, &sheared, ray.max_distance()));
        hits.min_by(|a, b| a.distance.total_cmp(&b.distance).then(a.global.cmp(&b.global)))
    }

    /// The lower and the upper corner of the box around everything; zeros when there is nothing.
    pub fn bounds(&self) -> [Vec3; 2] {
        self.bounds.map(Vec3::from)
    }

    /// How many triangles there are.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// How many surfaces there are.
    pub fn surface_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.triangles.len() * size_of::<LeafTriangle>() + self.starts.len() * 4
    }

    /// Whether it was built from these very triangles.
    pub(crate) fn holds(&self, meshes: &[&TriangleMesh]) -> Result<bool, TracerError> {
        let (corners, starts) = flatten(meshes)?;
        Ok(starts == self.starts && self.triangles.iter().all(|t| t.corners == corners[t.global as usize]))
    }

    #[inline(always)]
    fn intersect(&self, slot: u32, ray: &ShearedRay, max_distance: f32) -> Option<Hit> {
        let triangle = &self.triangles[slot as usize];
        let found = ray.intersect(&triangle.corners, max_distance)?;
        let first = self.starts[triangle.surface as usize];
        Some(Hit {
            surface: SurfaceIndex(triangle.surface as usize),
            triangle: TriangleIndex((triangle.global - first) as usize),
            barycentrics: found.barycentrics,
            distance: found.distance,
            global: triangle.global,
        })
    }
}

/// All corners, surface by surface, and where each surface starts.
fn flatten(meshes: &[&TriangleMesh]) -> Result<(Vec<[Vec3; 3]>, Vec<u32>), TracerError> {
    let total: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    if total > 1 << 31 {
        return Err(TracerError::Unsupported(format!("{total} triangles, the limit is 2^31")));
    }
    let mut corners = Vec::with_capacity(total);
    let mut starts = vec![0];
    for (surface, mesh) in meshes.iter().enumerate() {
        check_positions(surface, mesh)?;
        corners.extend((0..mesh.triangles.len()).map(|index| mesh.corners(index)));
        starts.push(corners.len() as u32);
    }
    Ok((corners, starts))
}

/// Each coordinate by itself: a maximum would pass over NaN.
fn is_within_reach(position: Vec3) -> bool {
    position.to_array().iter().all(|v| v.abs() <= LARGEST_COORDINATE)
}

fn check_positions(surface: usize, mesh: &TriangleMesh) -> Result<(), TracerError> {
    let invalid = |what: String| Err(TracerError::Invalid(format!("surface {surface}: {what}")));
    if let Some(vertex) = mesh.positions.iter().position(|p| !is_within_reach(*p)) {
        return invalid(format!("vertex {vertex} is at {}, expected within 1e7 m", mesh.positions[vertex]));
    }
    let count = mesh.positions.len();
    match mesh.triangles.iter().position(|t| t.iter().any(|&vertex| vertex as usize >= count)) {
        Some(t) => invalid(format!("triangle {t} names vertices {:?} of {count}", mesh.triangles[t])),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
