//! Surfaces that glow.

use glam::Vec3;
use mateval_scene::TriangleMesh;
use mateval_scene::reference::{LightIndex, ReferenceScene, SurfaceIndex};

use super::distribution::Distribution;
use crate::accel::TriangleIndex;
use crate::surface_hit::{Facing, SurfaceHit};
use crate::warp;

/// One or more surfaces of one light group, sampled together.
#[derive(Debug)]
pub(crate) struct AreaEmitter {
    pub(crate) light: LightIndex,
    pub(crate) radiance: Vec3,
    pub(crate) two_sided: bool,
    surfaces: Vec<SurfaceIndex>,
    /// For each of `surfaces` the number of triangles before it.
    starts: Vec<usize>,
    triangles: Distribution,
    /// Of all triangles, surface by surface.
    facings: Vec<Facing>,
    centre: Vec3,
    radius2: f32,
    /// The common front normal of all triangles, if they have one and only the front glows.
    facing: Option<Vec3>,
}

impl AreaEmitter {
    pub(crate) fn new(
        scene: &ReferenceScene,
        light: LightIndex,
        radiance: [f32; 3],
        two_sided: bool,
        surfaces: Vec<SurfaceIndex>,
        scene_size: f32,
    ) -> Self {
        let meshes: Vec<&TriangleMesh> = surfaces.iter().map(|surface| &scene.surfaces[surface.0].mesh).collect();
        let mut starts = vec![0];
        for mesh in &meshes {
            starts.push(starts[starts.len() - 1] + mesh.triangles.len());
        }
        let areas = meshes.iter().flat_map(|mesh| (0..mesh.triangles.len()).map(|t| area(mesh, t)));
        let facings: Vec<Facing> = meshes
            .iter()
            .flat_map(|mesh| (0..mesh.triangles.len()).map(|t| Facing::new(mesh, TriangleIndex(t), scene_size)))
            .collect();
        let (centre, radius2) = bounding_sphere(&meshes);
        Self {
            light,
            radiance: Vec3::from_array(radiance),
            two_sided,
            triangles: Distribution::new(areas),
            facing: common_normal(&facings).filter(|_| !two_sided),
            facings,
            surfaces,
            starts,
            centre,
            radius2,
        }
    }

    /// Square metres.
    pub(crate) fn area(&self) -> f32 {
        self.triangles.total() as f32
    }

    /// Roughly the solid angle it takes up, seen from `from`; the weight with which it is chosen.
    pub(crate) fn importance(&self, from: Vec3) -> f32 {
        let away = from - self.centre;
        if self.facing.is_some_and(|normal| normal.dot(away) + self.radius2.sqrt() < 0.0) {
            return 0.0;
        }
        self.area() / away.length_squared().max(self.radius2).max(f32::MIN_POSITIVE)
    }

    /// A place, uniform over the area.
    pub(crate) fn sample(&self, scene: &ReferenceScene, choice: f32, u: [f32; 2]) -> SurfaceHit {
        let (triangle, _) = self.triangles.sample(choice);
        let facing = &self.facings[triangle];
        let which = self.starts.partition_point(|&start| start <= triangle) - 1;
        let surface = self.surfaces[which];
        let triangle = TriangleIndex(triangle - self.starts[which]);
        SurfaceHit::new(surface, triangle, &scene.surfaces[surface.0].mesh, facing, warp::triangle(u))
    }

    /// Whether the side of `hit` towards `direction` glows.
    pub(crate) fn glows(&self, hit: &SurfaceHit, direction: Vec3) -> bool {
        self.two_sided || hit.is_front(direction)
    }
}

fn area(mesh: &TriangleMesh, triangle: usize) -> f64 {
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

/// The centre of the box around everything, and the square of the distance to the farthest vertex.
fn bounding_sphere(meshes: &[&TriangleMesh]) -> (Vec3, f32) {
    let positions = || meshes.iter().flat_map(|mesh| mesh.positions.iter().copied());
    let low = positions().reduce(Vec3::min).unwrap_or_default();
    let high = positions().reduce(Vec3::max).unwrap_or_default();
    let centre = (low + high) * 0.5;
    (centre, positions().map(|p| p.distance_squared(centre)).fold(0.0, f32::max))
}

fn common_normal(facings: &[Facing]) -> Option<Vec3> {
    let first = facings.first()?.normal;
    facings.iter().all(|facing| facing.normal.dot(first) > 0.9999).then_some(first)
}
