//! Surfaces that glow.

use glam::Vec3;
use mateval_scene::TriangleMesh;
use mateval_scene::reference::{LightIndex, ReferenceScene, SurfaceIndex};

use super::distribution::Distribution;
use super::radiance_map::RadianceMap;
use crate::accel::TriangleIndex;
use crate::surface_hit::SurfaceHit;
use crate::triangle_record::TriangleRecord;
use crate::warp;

/// What surfaces glow with.
#[derive(Clone, Debug)]
pub(crate) struct Glow {
    /// Linear Rec. 709.
    pub(crate) radiance: Vec3,
    /// Multiplies it.
    pub(crate) map: Option<RadianceMap>,
    /// Whether backs glow too.
    pub(crate) two_sided: bool,
}

/// One or more surfaces of one light group, sampled together.
#[derive(Debug)]
pub(crate) struct AreaEmitter {
    pub(crate) light: LightIndex,
    glow: Glow,
    /// None for a light of a stage.
    surfaces: Vec<SurfaceIndex>,
    /// For each of `surfaces` the number of triangles before it.
    starts: Vec<usize>,
    triangles: Distribution,
    /// Of all triangles, surface by surface.
    records: Vec<TriangleRecord>,
    outline: Outline,
}

/// The surface that places on lights of a stage name: none of the scene's.
const STAGE: SurfaceIndex = SurfaceIndex(usize::MAX);

/// Enough of an emitter to say roughly how much of the view it takes up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outline {
    /// Of a sphere around it.
    centre: Vec3,
    /// Of that sphere, and squared; above 0.
    radius: f32,
    radius2: f32,
    /// Square metres.
    area: f32,
    /// The common front normal of all triangles, if they have one and only the front glows; else zero.
    facing: Vec3,
}

/// The outlines of all emitters, number by number, so that eight are looked at in one go.
#[derive(Debug, Default)]
pub(crate) struct Outlines(Vec<EightOutlines>);

/// Emitters looked at together.
pub(crate) const TOGETHER: usize = 8;

#[derive(Clone, Copy, Debug)]
struct EightOutlines {
    centre: [[f32; TOGETHER]; 3],
    facing: [[f32; TOGETHER]; 3],
    radius: [f32; TOGETHER],
    radius2: [f32; TOGETHER],
    area: [f32; TOGETHER],
}

impl EightOutlines {
    /// Takes up nothing of any view.
    const NONE: Self = Self {
        centre: [[0.0; TOGETHER]; 3],
        facing: [[0.0; TOGETHER]; 3],
        radius: [0.0; TOGETHER],
        radius2: [1.0; TOGETHER],
        area: [0.0; TOGETHER],
    };

    fn put(&mut self, lane: usize, outline: &Outline) {
        for axis in 0..3 {
            self.centre[axis][lane] = outline.centre[axis];
            self.facing[axis][lane] = outline.facing[axis];
        }
        self.radius[lane] = outline.radius;
        self.radius2[lane] = outline.radius2;
        self.area[lane] = outline.area;
    }

    #[inline(always)]
    fn solid_angles(&self, from: Vec3) -> [f32; TOGETHER] {
        std::array::from_fn(|lane| {
            let away = [0, 1, 2].map(|axis| from[axis] - self.centre[axis][lane]);
            let dot = |other: [f32; 3]| away[0] * other[0] + away[1] * other[1] + away[2] * other[2];
            let height = dot([0, 1, 2].map(|axis| self.facing[axis][lane]));
            let seen = if height + self.radius[lane] < 0.0 { 0.0 } else { self.area[lane] };
            seen / dot(away).max(self.radius2[lane])
        })
    }
}

impl Outlines {
    pub(crate) fn new(areas: &[AreaEmitter]) -> Self {
        let eight = |chunk: &[AreaEmitter]| {
            let mut eight = EightOutlines::NONE;
            chunk.iter().enumerate().for_each(|(lane, area)| eight.put(lane, &area.outline));
            eight
        };
        Self(areas.chunks(TOGETHER).map(eight).collect())
    }

    /// Roughly the solid angle of each emitter, seen from `from`; 0 from behind. Eight at a time; zeros follow the last.
    #[inline]
    pub(crate) fn solid_angles(&self, from: Vec3) -> impl Iterator<Item = [f32; TOGETHER]> + '_ {
        self.0.iter().map(move |eight| eight.solid_angles(from))
    }
}

impl AreaEmitter {
    pub(crate) fn new(
        scene: &ReferenceScene,
        light: LightIndex,
        glow: Glow,
        surfaces: Vec<SurfaceIndex>,
        scene_size: f32,
    ) -> Self {
        let meshes: Vec<&TriangleMesh> = surfaces.iter().map(|surface| &scene.surfaces[surface.0].mesh).collect();
        Self::of_meshes(&meshes, light, glow, surfaces, scene_size)
    }

    /// A light of a stage, which is no surface of the scene.
    pub(crate) fn on_stage(light: LightIndex, glow: Glow, mesh: &TriangleMesh, scene_size: f32) -> Self {
        Self::of_meshes(&[mesh], light, glow, Vec::new(), scene_size)
    }

    fn of_meshes(
        meshes: &[&TriangleMesh],
        light: LightIndex,
        glow: Glow,
        surfaces: Vec<SurfaceIndex>,
        scene_size: f32,
    ) -> Self {
        let mut starts = vec![0];
        for mesh in meshes {
            starts.push(starts[starts.len() - 1] + mesh.triangles.len());
        }
        let areas = meshes.iter().flat_map(|mesh| (0..mesh.triangles.len()).map(|t| area(mesh, t)));
        let records: Vec<TriangleRecord> = meshes
            .iter()
            .flat_map(|mesh| (0..mesh.triangles.len()).map(|t| TriangleRecord::new(mesh, TriangleIndex(t), scene_size)))
            .collect();
        let (centre, radius2) = bounding_sphere(meshes);
        let triangles = Distribution::new(areas);
        let (total, facing) = (triangles.total(), common_normal(&records).filter(|_| !glow.two_sided));
        Self {
            light,
            glow,
            triangles,
            records,
            surfaces,
            starts,
            outline: Outline {
                centre,
                radius2: radius2.max(f32::MIN_POSITIVE),
                area: total as f32,
                facing: facing.unwrap_or(Vec3::ZERO),
                radius: radius2.sqrt(),
            },
        }
    }

    /// Square metres.
    pub(crate) fn area(&self) -> f32 {
        self.outline.area
    }

    /// A place, uniform over the area.
    pub(crate) fn sample(&self, choice: f32, u: [f32; 2]) -> SurfaceHit {
        let (triangle, _) = self.triangles.sample(choice);
        let which = self.starts.partition_point(|&start| start <= triangle) - 1;
        let index = TriangleIndex(triangle - self.starts[which]);
        let surface = self.surfaces.get(which).copied().unwrap_or(STAGE);
        SurfaceHit::new(surface, index, &self.records[triangle], warp::triangle(u))
    }

    /// The place on the light of a stage that a ray has met.
    pub(crate) fn place_on_stage(&self, triangle: TriangleIndex, weights: Vec3) -> SurfaceHit {
        SurfaceHit::new(STAGE, triangle, &self.records[triangle.0], weights)
    }

    /// Whether it is a light of a stage, which is no surface of the scene.
    pub(crate) fn is_on_stage(&self) -> bool {
        self.surfaces.is_empty()
    }

    /// Whether the side of `hit` towards `direction` glows.
    pub(crate) fn glows(&self, hit: &SurfaceHit, direction: Vec3) -> bool {
        self.glow.two_sided || hit.is_front(direction)
    }

    /// What it sends from `place`, on a side that glows. How it is sampled does not follow from this: see the module.
    #[inline]
    pub(crate) fn radiance(&self, place: &SurfaceHit) -> Vec3 {
        match &self.glow.map {
            None => self.glow.radiance,
            Some(map) => self.glow.radiance * map.at(place.uv),
        }
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

fn common_normal(records: &[TriangleRecord]) -> Option<Vec3> {
    let first = records.first()?.normal;
    records.iter().all(|record| record.normal.dot(first) > 0.9999).then_some(first)
}
