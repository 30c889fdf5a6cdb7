//! Emitting surfaces.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use mateval_dataset::TriangleMesh;
use mateval_dataset::material::UvTransform;
use mateval_dataset::mesh::bounds;
use mateval_dataset::reference::{EmissionMap, LightIndex, SurfaceIndex};
use mateval_image::{Texels, Texture};

use crate::error::LightFault;
use crate::ray::{SurfaceHit, TriangleIndex, TriangleRecord};
use crate::sampling::{self, Distribution};

/// What surfaces emit.
#[derive(Clone, Debug)]
pub(crate) struct SurfaceEmission {
    /// Linear Rec. 709.
    pub(crate) radiance: Vec3,
    /// Multiplies the radiance.
    pub(crate) map: Option<RadianceMap>,
    /// Whether backs emit too.
    pub(crate) two_sided: bool,
}

/// One or several surfaces of one light group, sampled together.
#[derive(Debug)]
pub(crate) struct AreaEmitter {
    pub(crate) light: LightIndex,
    /// Whether it is a flash among the lights of a stage.
    pub(crate) is_flash: bool,
    emission: SurfaceEmission,
    /// Empty for a stage light.
    surfaces: Vec<SurfaceIndex>,
    /// For each of `surfaces`, the number of triangles before it.
    starts: Vec<usize>,
    triangles: Distribution,
    /// The records of all triangles, surface by surface.
    records: Vec<TriangleRecord>,
    outline: Outline,
}

/// The surface index of points on stage lights; no surface of the scene has it.
const STAGE: SurfaceIndex = SurfaceIndex(usize::MAX);

/// Bounds of an emitter, to estimate its solid angle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outline {
    /// The centre of a bounding sphere.
    centre: Vec3,
    /// The radius of that sphere, and its square, which is above 0.
    radius: f32,
    radius2: f32,
    /// In square metres.
    area: f32,
    /// The normal that all triangles share, if they have one and only the front emits; else zero.
    facing: Vec3,
}

/// The outlines of all emitters as arrays of components, so that eight are evaluated at once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outlines(Vec<EightOutlines>);

/// The number of emitters evaluated at once.
pub(crate) const LANES: usize = 8;

#[derive(Clone, Copy, Debug)]
struct EightOutlines {
    centre: [[f32; LANES]; 3],
    facing: [[f32; LANES]; 3],
    radius: [f32; LANES],
    radius2: [f32; LANES],
    area: [f32; LANES],
}

impl EightOutlines {
    /// Has a solid angle of 0 from everywhere.
    const NONE: Self = Self {
        centre: [[0.0; LANES]; 3],
        facing: [[0.0; LANES]; 3],
        radius: [0.0; LANES],
        radius2: [1.0; LANES],
        area: [0.0; LANES],
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
    fn solid_angles(&self, from: Vec3) -> [f32; LANES] {
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
    pub(crate) fn new(areas: &[Arc<AreaEmitter>]) -> Self {
        let eight = |chunk: &[Arc<AreaEmitter>]| {
            let mut eight = EightOutlines::NONE;
            chunk.iter().enumerate().for_each(|(lane, area)| eight.put(lane, &area.outline));
            eight
        };
        Self(areas.chunks(LANES).map(eight).collect())
    }

    /// The same, with the solid angle of emitter k multiplied by `factors[k]`.
    pub(crate) fn scaled(&self, factors: &[f32]) -> Self {
        let mut scaled = self.clone();
        for (eight, factors) in scaled.0.iter_mut().zip(factors.chunks(LANES)) {
            eight.area.iter_mut().zip(factors).for_each(|(area, factor)| *area *= factor);
        }
        scaled
    }

    /// An estimate of each emitter's solid angle seen from `from`; 0 from behind. Eight at a time; the last eight are
    /// filled up with zeros.
    #[inline]
    pub(crate) fn solid_angles(&self, from: Vec3) -> impl Iterator<Item = [f32; LANES]> + '_ {
        self.0.iter().map(move |eight| eight.solid_angles(from))
    }
}

impl AreaEmitter {
    /// An emitter of at least one mesh. `surfaces` holds the surface of each mesh; it is empty for a stage light, which
    /// is no surface of the scene.
    pub(crate) fn new(
        meshes: &[&TriangleMesh],
        light: LightIndex,
        emission: SurfaceEmission,
        surfaces: Vec<SurfaceIndex>,
        scene_size: f32,
    ) -> Self {
        // Number the triangles of all surfaces.
        let mut starts = vec![0];
        for mesh in meshes {
            starts.push(starts[starts.len() - 1] + mesh.triangles.len());
        }
        // Distribute samples by area.
        let areas = meshes.iter().flat_map(|mesh| (0..mesh.triangles.len()).map(|t| area(mesh, t)));
        let triangles = Distribution::new(areas);
        let records: Vec<TriangleRecord> = meshes
            .iter()
            .flat_map(|mesh| (0..mesh.triangles.len()).map(|t| TriangleRecord::new(mesh, TriangleIndex(t), scene_size)))
            .collect();
        // Bound the emitter.
        let (centre, radius2) = bounding_sphere(meshes);
        let (total, facing) = (triangles.total(), common_normal(&records).filter(|_| !emission.two_sided));
        Self {
            light,
            is_flash: false,
            emission,
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

    /// In square metres.
    pub(crate) fn area(&self) -> f32 {
        self.outline.area
    }

    /// A point on the emitter, uniform over its area.
    pub(crate) fn sample(&self, choice: f32, u: [f32; 2]) -> SurfaceHit {
        let (triangle, _) = self.triangles.sample(choice);
        let which = self.starts.partition_point(|&start| start <= triangle) - 1;
        let index = TriangleIndex(triangle - self.starts[which]);
        let surface = self.surfaces.get(which).copied().unwrap_or(STAGE);
        SurfaceHit::new(surface, index, &self.records[triangle], sampling::triangle(u))
    }

    /// The point on a stage light that a ray has hit.
    pub(crate) fn place_on_stage(&self, triangle: TriangleIndex, weights: Vec3) -> SurfaceHit {
        SurfaceHit::new(STAGE, triangle, &self.records[triangle.0], weights)
    }

    /// Whether this is a stage light, which is no surface of the scene.
    pub(crate) fn is_on_stage(&self) -> bool {
        self.surfaces.is_empty()
    }

    /// Whether backs emit too.
    pub(crate) fn is_two_sided(&self) -> bool {
        self.emission.two_sided
    }

    /// Whether the side of `hit` towards `direction` emits.
    pub(crate) fn emits(&self, hit: &SurfaceHit, direction: Vec3) -> bool {
        self.emission.two_sided || hit.is_front(direction)
    }

    /// The radiance emitted at `place`, on a side that emits. Sampling does not depend on it; see the module.
    #[inline]
    pub(crate) fn radiance(&self, place: &SurfaceHit) -> Vec3 {
        match &self.emission.map {
            None => self.emission.radiance,
            Some(map) => self.emission.radiance * map.at(place.uv),
        }
    }
}

fn area(mesh: &TriangleMesh, triangle: usize) -> f64 {
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

/// The centre of the bounding box of all meshes, and the squared distance of the farthest vertex.
fn bounding_sphere(meshes: &[&TriangleMesh]) -> (Vec3, f32) {
    let positions = || meshes.iter().flat_map(|mesh| mesh.positions.iter().copied());
    let [low, high] = bounds(positions()).unwrap_or_default();
    let centre = (low + high) * 0.5;
    (centre, positions().map(|p| p.distance_squared(centre)).fold(0.0, f32::max))
}

fn common_normal(records: &[TriangleRecord]) -> Option<Vec3> {
    let first = records.first()?.normal;
    records.iter().all(|record| record.normal.dot(first) > 0.9999).then_some(first)
}

/// A factor on the radiance of an emitting surface, looked up at the surface's uv.
#[derive(Clone, Debug)]
pub(crate) struct RadianceMap {
    texture: Texture,
    uv: UvTransform,
}

impl RadianceMap {
    /// Fails if the texture does not exist, if the uv transform is not finite, or if a texel is negative or not finite.
    pub(crate) fn new(map: &EmissionMap, textures: &[Texture]) -> Result<Self, LightFault> {
        let index = map.texture.0;
        let missing = LightFault::MissingTexture { texture: index, count: textures.len() };
        let texture = textures.get(index).ok_or(missing)?;
        if !map.uv.0.as_flattened().iter().all(|v| v.is_finite()) {
            return Err(LightFault::MapTransform(map.uv.0));
        }
        if let Some(value) = first_unsound(texture) {
            return Err(LightFault::MapValue { texture: index, value });
        }
        Ok(Self { texture: texture.clone(), uv: map.uv })
    }

    /// Not inlined, since most lamps have no map.
    #[inline(never)]
    pub(crate) fn at(&self, uv: Vec2) -> Vec3 {
        Vec3::from_array(self.texture.sample(self.uv.apply(uv).to_array()))
    }
}

/// The first value that is negative or not finite and so cannot scale light. Integer texels are always valid.
fn first_unsound(texture: &Texture) -> Option<f32> {
    let unsound = |values: &[f32]| values.iter().copied().find(|v| !(v.is_finite() && *v >= 0.0));
    match texture.texels() {
        Texels::Linear(v) => unsound(v.as_flattened()),
        Texels::Grey(v) => unsound(v),
        Texels::Srgb8(_) | Texels::Srgb16(_) | Texels::Linear8(_) | Texels::Grey8(_) => None,
    }
}
