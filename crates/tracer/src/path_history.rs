//! The history of a batch of paths: where each one scattered, and the light that it gathered there and later.
//!
//! A contribution C of a path is a product that contains the value f of the BSDF at each vertex before it. Nothing that
//! a path decides depends on base colours, so its derivative by the base colour at one vertex is C f' / f. The sum over
//! all contributions needs one walk along the path from its end: the idea of Vicini et al., "Path Replay
//! Backpropagation" (SIGGRAPH 2021), with the vertices kept instead of replayed.

use glam::{Vec2, Vec3};
use mateval_scene::reference::SurfaceIndex;

use crate::surface_hit::SurfaceHit;

/// Receives the events of the paths of a batch, in order along each path.
pub(crate) trait PathRecorder {
    /// Whether paths compute relative slopes for it.
    const WANTS_SLOPES: bool;

    /// A batch of `paths` paths starts.
    fn begin(&mut self, paths: usize);

    /// Path `which` scatters at `place`.
    fn scatter(&mut self, which: usize, place: &SurfaceHit, slopes: VertexSlopes);

    /// Path `which` meets light.
    fn meet(&mut self, which: usize, value: Vec3);

    /// The light that path `which` has sampled at its last vertex arrives.
    fn receive(&mut self, which: usize, value: Vec3);
}

/// The relative slopes of a BSDF (its derivative by the base colour over its value) towards the two directions of a
/// vertex.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct VertexSlopes {
    pub(crate) to_light: Vec3,
    pub(crate) onwards: Vec3,
}

/// Records nothing.
impl PathRecorder for () {
    const WANTS_SLOPES: bool = false;

    fn begin(&mut self, _: usize) {}
    fn scatter(&mut self, _: usize, _: &SurfaceHit, _: VertexSlopes) {}
    fn meet(&mut self, _: usize, _: Vec3) {}
    fn receive(&mut self, _: usize, _: Vec3) {}
}

/// The vertices of a batch of paths.
#[derive(Debug, Default)]
pub(crate) struct PathHistory {
    /// Those of all paths, in order along each path.
    vertices: Vec<Vertex>,
    paths: Vec<PathLight>,
}

/// A place where a path scattered.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    path: u32,
    surface: SurfaceIndex,
    uv: Vec2,
    slopes: VertexSlopes,
    /// The light sampled here.
    received: Vec3,
    /// The light met by the ray that leaves here.
    met: Vec3,
}

/// What is known of a path beside its vertices.
#[derive(Clone, Copy, Debug, Default)]
struct PathLight {
    /// The last vertex.
    last: Option<u32>,
    /// The light met by the camera ray.
    seen: Vec3,
    /// While walking back: the light gathered after the vertex.
    later: Vec3,
}

/// The derivative of a path's light by the base colour at one of its vertices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VertexDerivative {
    pub(crate) path: usize,
    pub(crate) surface: SurfaceIndex,
    /// The uv of the surface.
    pub(crate) uv: Vec2,
    /// Per channel.
    pub(crate) value: Vec3,
}

impl PathRecorder for PathHistory {
    const WANTS_SLOPES: bool = true;

    fn begin(&mut self, paths: usize) {
        self.vertices.clear();
        self.paths.clear();
        self.paths.resize(paths, PathLight::default());
    }

    fn scatter(&mut self, which: usize, place: &SurfaceHit, slopes: VertexSlopes) {
        self.paths[which].last = Some(self.vertices.len() as u32);
        let (received, met) = (Vec3::ZERO, Vec3::ZERO);
        self.vertices.push(Vertex { path: which as u32, surface: place.surface, uv: place.uv, slopes, received, met });
    }

    fn meet(&mut self, which: usize, value: Vec3) {
        let path = &mut self.paths[which];
        match path.last {
            Some(last) => self.vertices[last as usize].met += value,
            None => path.seen += value,
        }
    }

    fn receive(&mut self, which: usize, value: Vec3) {
        if let Some(last) = self.paths[which].last {
            self.vertices[last as usize].received += value;
        }
    }
}

impl PathHistory {
    /// Calls `each` for every vertex, in a fixed order, and then returns the light of each path.
    pub(crate) fn walk_back(&mut self, mut each: impl FnMut(VertexDerivative)) -> impl Iterator<Item = Vec3> {
        for vertex in self.vertices.iter().rev() {
            let Vertex { path, surface, uv, slopes, received, met } = *vertex;
            let later = &mut self.paths[path as usize].later;
            // Light met later passes on from here, light received here does not.
            *later += met;
            let value = *later * slopes.onwards + received * slopes.to_light;
            *later += received;
            each(VertexDerivative { path: path as usize, surface, uv, value });
        }
        self.paths.iter().map(|path| path.seen + path.later)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle_record::TriangleRecord;
    use mateval_scene::TriangleMesh;

    fn place() -> SurfaceHit {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            ..Default::default()
        };
        let triangle = crate::accel::TriangleIndex(0);
        let record = TriangleRecord::new(&mesh, triangle, 1.0);
        SurfaceHit::new(SurfaceIndex(3), triangle, &record, Vec3::splat(1.0 / 3.0))
    }

    /// Two vertices with the values a and b on the way and a to the light at the first: the light is 2a + 5ab, so the
    /// derivatives are 2 + 5b and 5a.
    #[test]
    fn a_path_of_two_vertices_has_the_derivatives_of_its_product() {
        let (a, b) = (0.5, 0.25);
        let slopes =
            |color: f32| VertexSlopes { to_light: Vec3::splat(1.0 / color), onwards: Vec3::splat(1.0 / color) };
        let mut history = PathHistory::default();
        history.begin(1);
        history.meet(0, Vec3::splat(7.0));
        history.scatter(0, &place(), slopes(a));
        history.receive(0, Vec3::splat(2.0 * a));
        history.scatter(0, &place(), slopes(b));
        history.meet(0, Vec3::splat(5.0 * a * b));
        let mut found = Vec::new();
        let light: Vec<Vec3> = history.walk_back(|vertex| found.push(vertex.value.x)).collect();
        assert_eq!(found, [5.0 * a, 2.0 + 5.0 * b]);
        assert_eq!(light, [Vec3::splat(7.0 + 2.0 * a + 5.0 * a * b)]);
    }
}
