//! Emitters, and sampling of light that reaches a point.
//!
//! Sampling chooses an emitter, then a point on it or a direction towards it. The choice depends on geometry alone,
//! never on radiance: among area emitters on estimated solid angles, with a share of 0.2 spread evenly, and between
//! these and emitters at infinity on the share of rays that leave the scene. So pictures of each light group alone, and
//! of any weighting of the groups, can come from the same paths. A caller that knows which groups matter in its
//! pictures can change how often each is chosen (`group_shares`).

mod area;
mod environment;
pub mod group_shares;

use std::sync::Arc;

use glam::Vec3;
use mateval_dataset::TriangleMesh;
use mateval_dataset::reference::{Emission, LightIndex, ReferenceScene, SurfaceIndex};
use mateval_image::Texture;

use crate::accel::Accel;
use crate::error::{ElementFault, LightFault, RequestFault, TracerError};
use crate::ray::{Ray, SurfaceHit};
use crate::sampling::{self, Frame, Sampler};
use area::{AreaEmitter, LANES, Outlines, RadianceMap, SurfaceEmission};
use environment::EnvironmentMap;

/// The emitters of all light groups of a scene.
#[derive(Clone, Debug)]
pub struct Emitters {
    areas: Vec<Arc<AreaEmitter>>,
    /// Of `areas`.
    outlines: Outlines,
    /// For each surface its index in `areas`, if it emits.
    area_of: Vec<Option<usize>>,
    /// The stage lights as surfaces, in the order of `areas`.
    stage: Option<Arc<Accel>>,
    /// The place of the first stage light in `areas`.
    first_on_stage: usize,
    distant: Vec<DistantEmitter>,
    /// The probability of sampling an emitter at infinity.
    distant_share: f32,
    /// For each light group, whether the camera sees its emitters.
    camera_visible: Vec<bool>,
    scene_size: f32,
}

#[derive(Clone, Debug)]
struct DistantEmitter {
    light: LightIndex,
    kind: DistantKind,
    /// The probability of sampling it, above 0.
    probability: f32,
}

#[derive(Clone, Debug)]
enum DistantKind {
    Map(Arc<EnvironmentMap>),
    Constant(Vec3),
}

/// Light that arrives along a sampled direction unless something blocks it.
#[derive(Clone, Copy, Debug)]
pub struct EmitterSample {
    pub light: LightIndex,
    /// Towards the emitter, unit length.
    pub direction: Vec3,
    /// Linear Rec. 709.
    pub radiance: Vec3,
    /// Per solid angle, including the choice of the emitter.
    pub density: f32,
    /// The point on the emitter; `None` for an emitter at infinity.
    pub place: Option<SurfaceHit>,
    /// Whether surfaces reflect it diffusely alone: a stage light other than a flash.
    pub is_matt: bool,
}

/// A light added to a scene so that it is lit as in a photo. It blocks no light, it is invisible to the camera, and,
/// except for a flash, it makes no highlights: surfaces reflect it diffusely.
#[derive(Clone, Debug, PartialEq)]
pub struct StageLight {
    /// World space, in metres. The front emits.
    pub mesh: TriangleMesh,
    /// Linear Rec. 709.
    pub radiance: [f32; 3],
    /// Whether it is a lamp of known place, as a flash at the camera is. Such a light makes highlights, and is sampled
    /// as often as a lamp of 4 m² in its place would be: it is small, but brings much of the light.
    pub is_flash: bool,
}

/// Radiance that a ray has met by chance.
#[derive(Clone, Copy, Debug)]
pub struct Emitted {
    pub light: LightIndex,
    /// Linear Rec. 709.
    pub radiance: Vec3,
    /// The density with which [`Emitters::sample`] would have sampled it, per solid angle.
    pub density: f32,
}

/// The probability mass that is spread evenly over all area emitters.
pub const UNIFORM_SHARE: f32 = 0.2;
/// The share of escaping rays at which an emitter at infinity counts half as much as where all escape.
const FEW_ESCAPE: f32 = 0.005;
/// The least weight of an emitter at infinity, so that it is sampled even where no probe reaches it.
const LEAST_SKY: f32 = 0.01;
/// The area, in square metres, by which the solid angle of a flash is estimated when emitters are chosen.
const FLASH_AREA_M2: f32 = 4.0;
/// Above this number of emitting surfaces, the surfaces of a light group are sampled as one emitter.
const SEPARATE_SURFACES: usize = 64;

impl Emitters {
    /// No emitters, for a scene of this many surfaces.
    fn dark(surfaces: usize, scene_size: f32) -> Self {
        Self {
            areas: Vec::new(),
            outlines: Outlines::default(),
            area_of: vec![None; surfaces],
            stage: None,
            first_on_stage: 0,
            distant: Vec::new(),
            distant_share: 0.0,
            camera_visible: Vec::new(),
            scene_size,
        }
    }

    /// `scene_size` is the largest absolute coordinate of the scene.
    pub(crate) fn new(scene: &ReferenceScene, textures: &[Texture], scene_size: f32) -> Result<Self, TracerError> {
        let mut emitters = Self::dark(scene.surfaces.len(), scene_size);
        emitters.camera_visible = scene.lights.iter().map(|group| group.camera_visible).collect();
        let emitting_surfaces = |emission: &Emission| match emission {
            Emission::Area { surfaces, .. } => surfaces.len(),
            _ => 0,
        };
        let count: usize = scene.lights.iter().map(|group| emitting_surfaces(&group.emission)).sum();
        for (index, group) in scene.lights.iter().enumerate() {
            emitters
                .add(scene, textures, LightIndex(index), &group.emission, count <= SEPARATE_SURFACES)
                .map_err(|fault| ElementFault::Light { light: LightIndex(index), name: group.name.clone(), fault })?;
        }
        emitters.outlines = Outlines::new(&emitters.areas);
        emitters.share_between(1.0);
        Ok(emitters)
    }

    /// Whether both area emitters and emitters at infinity exist, so that samples are divided between them.
    pub(crate) fn are_near_and_distant(&self) -> bool {
        !self.areas.is_empty() && !self.distant.is_empty()
    }

    /// Divides samples between area emitters and emitters at infinity, if the share `escaping` of rays leaves the
    /// scene.
    ///
    /// All lamps together count as 1. Where rays leave the scene, a map's light may be far brighter than theirs, so it
    /// counts nearly as much; where almost none do, almost nothing. Radiances must not count. Constant radiance counts
    /// least everywhere: samples of the BSDF find it as well as samples of the sphere do.
    pub(crate) fn share_between(&mut self, escaping: f32) {
        let weight = |kind: &DistantKind| match kind {
            DistantKind::Map(_) => (escaping / (escaping + FEW_ESCAPE)).max(LEAST_SKY),
            DistantKind::Constant(_) => LEAST_SKY,
        };
        let near = if self.areas.is_empty() { 0.0 } else { 1.0 };
        let total = near + self.distant.iter().map(|emitter| weight(&emitter.kind)).sum::<f32>();
        self.distant.iter_mut().for_each(|emitter| emitter.probability = weight(&emitter.kind) / total);
        self.distant_share = if self.areas.is_empty() && !self.distant.is_empty() {
            1.0
        } else {
            self.distant.iter().map(|emitter| emitter.probability).sum()
        };
    }

    /// Stage lights only, one group each, for a scene of `surfaces` surfaces.
    pub(crate) fn on_stage(stage: &[StageLight], surfaces: usize, scene_size: f32) -> Result<Self, TracerError> {
        Self::dark(surfaces, scene_size).with_stage(stage)
    }

    /// The same and stage lights, one group each, after the other groups. There are no stage lights yet.
    pub(crate) fn with_stage(mut self, stage: &[StageLight]) -> Result<Self, TracerError> {
        let meshes: Vec<&TriangleMesh> = stage.iter().map(|light| &light.mesh).collect();
        let accel = Accel::build(&meshes).map_err(|error| match error {
            TracerError::InvalidScene(ElementFault::Surface { surface, fault, .. }) => {
                RequestFault::StageMesh { light: LightIndex(surface.0), fault }.into()
            }
            other => other,
        })?;
        self.first_on_stage = self.areas.len();
        let groups = self.groups();
        for (index, light) in stage.iter().enumerate() {
            let located = |fault| RequestFault::StageLight { light: LightIndex(index), fault };
            check_radiance(&light.radiance).map_err(located)?;
            if light.mesh.triangles.is_empty() {
                return Err(located(LightFault::NoTriangles).into());
            }
            let emission = SurfaceEmission { radiance: Vec3::from_array(light.radiance), map: None, two_sided: false };
            let group = LightIndex(groups + index);
            let mut area = AreaEmitter::new(&[&light.mesh], group, emission, Vec::new(), self.scene_size);
            area.is_flash = light.is_flash;
            self.areas.push(Arc::new(area));
        }
        let flash_factor = |area: &Arc<AreaEmitter>| FLASH_AREA_M2 / area.area().max(f32::MIN_POSITIVE);
        let factors: Vec<f32> =
            self.areas.iter().map(|area| if area.is_flash { flash_factor(area) } else { 1.0 }).collect();
        self.outlines = Outlines::new(&self.areas).scaled(&factors);
        self.camera_visible.extend(stage.iter().map(|_| false));
        self.stage = Some(Arc::new(accel));
        Ok(self)
    }

    /// The number of light groups.
    pub fn groups(&self) -> usize {
        self.camera_visible.len()
    }

    fn add(
        &mut self,
        scene: &ReferenceScene,
        textures: &[Texture],
        light: LightIndex,
        emission: &Emission,
        separate: bool,
    ) -> Result<(), LightFault> {
        match emission {
            Emission::Area { surfaces, radiance, map, two_sided } => {
                check_radiance(radiance)?;
                let map = map.as_ref().map(|map| RadianceMap::new(map, textures)).transpose()?;
                let emission = SurfaceEmission { radiance: Vec3::from_array(*radiance), map, two_sided: *two_sided };
                let parts: Vec<&[SurfaceIndex]> =
                    if separate { surfaces.chunks(1).collect() } else { vec![surfaces.as_slice()] };
                for part in parts {
                    self.claim(part)?;
                    let meshes: Vec<_> = part.iter().map(|surface| &scene.surfaces[surface.0].mesh).collect();
                    // A surface without triangles is never hit, and no point on it can be sampled.
                    if meshes.iter().all(|mesh| mesh.triangles.is_empty()) {
                        part.iter().for_each(|surface| self.area_of[surface.0] = None);
                        continue;
                    }
                    let area = AreaEmitter::new(&meshes, light, emission.clone(), part.to_vec(), self.scene_size);
                    self.areas.push(Arc::new(area));
                }
            }
            Emission::Environment { texture, scale, world_from_environment } => {
                let missing = LightFault::MissingTexture { texture: texture.0, count: textures.len() };
                let map = textures.get(texture.0).ok_or(missing)?;
                if !scale.is_finite() || *scale < 0.0 {
                    return Err(LightFault::EnvironmentScale(*scale));
                }
                if !world_from_environment.as_flattened().iter().all(|v| v.is_finite()) {
                    return Err(LightFault::EnvironmentRotation(*world_from_environment));
                }
                let map = Arc::new(EnvironmentMap::new(map, *scale, *world_from_environment));
                self.distant.push(DistantEmitter { light, kind: DistantKind::Map(map), probability: 0.0 });
            }
            Emission::Constant { radiance } => {
                check_radiance(radiance)?;
                let kind = DistantKind::Constant(Vec3::from_array(*radiance));
                self.distant.push(DistantEmitter { light, kind, probability: 0.0 });
            }
        }
        Ok(())
    }

    /// Records that `surfaces` belong to the next area emitter.
    fn claim(&mut self, surfaces: &[SurfaceIndex]) -> Result<(), LightFault> {
        let count = self.area_of.len();
        for &SurfaceIndex(surface) in surfaces {
            let slot = self.area_of.get_mut(surface).ok_or(LightFault::MissingSurface { surface, count })?;
            if slot.replace(self.areas.len()).is_some() {
                return Err(LightFault::SharedSurface(surface));
            }
        }
        Ok(())
    }

    /// Whether the camera sees the emitters of the group.
    pub(crate) fn is_camera_visible(&self, light: LightIndex) -> bool {
        self.camera_visible[light.0]
    }

    /// The light group that a surface emits for, whichever side is seen.
    pub(crate) fn light_of(&self, surface: SurfaceIndex) -> Option<LightIndex> {
        self.area_of[surface.0].map(|area| self.areas[area].light)
    }

    /// Samples light for the point `from`, from three numbers in [0, 1). `None` if the sample brings no light.
    /// `opacity` returns the coverage of an emitting surface.
    pub fn sample(&self, from: Vec3, u: [f32; 3], opacity: impl Fn(&SurfaceHit) -> f32) -> Option<EmitterSample> {
        let distant_share = self.distant_share;
        if u[0] < distant_share {
            return self.sample_distant(u[0], [u[1], u[2]]);
        }
        let choice = ((u[0] - distant_share) / (1.0 - distant_share)).clamp(0.0, 1.0 - f32::EPSILON);
        self.sample_area(from, choice, [u[1], u[2]], opacity)
    }

    fn sample_area(
        &self,
        from: Vec3,
        choice: f32,
        u: [f32; 2],
        opacity: impl Fn(&SurfaceHit) -> f32,
    ) -> Option<EmitterSample> {
        let (which, rest, probability) = self.choose_area(from, choice)?;
        let area = &self.areas[which];
        let place = area.sample(rest, u);
        let towards = place.position - from;
        let direction = towards.try_normalize()?;
        let cos = place.geometric_normal.dot(direction).abs();
        let probability = (1.0 - self.distant_share) * probability;
        let density = probability * towards.length_squared() / (cos * area.area());
        if !area.emits(&place, -direction) || !density.is_finite() || density <= 0.0 {
            return None;
        }
        let cover = if area.is_on_stage() { 1.0 } else { opacity(&place).clamp(0.0, 1.0) };
        let radiance = area.radiance(&place) * cover;
        let is_matt = area.is_on_stage() && !area.is_flash;
        Some(EmitterSample { light: area.light, direction, radiance, density, place: Some(place), is_matt })
    }

    /// `choice` is below the probability of all emitters at infinity.
    fn sample_distant(&self, choice: f32, u: [f32; 2]) -> Option<EmitterSample> {
        let mut end = 0.0;
        let chosen = self.distant.iter().find(|emitter| {
            end += emitter.probability;
            choice < end
        });
        let emitter = chosen.or(self.distant.last())?;
        let (direction, density) = match &emitter.kind {
            DistantKind::Map(map) => map.sample(u),
            DistantKind::Constant(_) => environment::sample_constant(u),
        };
        let density = density * emitter.probability;
        (density > 0.0 && density.is_finite()).then(|| EmitterSample {
            light: emitter.light,
            direction,
            radiance: emitter.radiance(direction),
            density,
            place: None,
            is_matt: false,
        })
    }

    /// The radiance that the surface at `place` emits towards `from`, if it emits there.
    pub fn emitted(&self, place: &SurfaceHit, from: Vec3) -> Option<Emitted> {
        self.emitted_by(self.area_of[place.surface.0]?, place, from)
    }

    /// Whether these are stage lights.
    pub(crate) fn are_on_stage(&self) -> bool {
        self.stage.is_some()
    }

    /// The light that stage lights along `ray` emit back towards `from`, and whether each is a flash. They block
    /// nothing, not even each other, so all of them count, in the order of the lights.
    pub(crate) fn stage_along(&self, ray: &Ray, from: Vec3) -> impl Iterator<Item = (Emitted, bool)> + '_ {
        let met = std::cell::RefCell::new(Vec::new());
        if let Some(stage) = &self.stage {
            // Rejecting every hit makes the traversal visit all of them.
            stage.occluded_where(ray, |hit| {
                met.borrow_mut().push(*hit);
                false
            });
        }
        let mut met = met.into_inner();
        met.sort_by_key(|hit| hit.global);
        met.into_iter().filter_map(move |hit| {
            let area = self.first_on_stage + hit.surface.0;
            let place = self.areas[area].place_on_stage(hit.triangle, hit.barycentrics);
            Some((self.emitted_by(area, &place, from)?, self.areas[area].is_flash))
        })
    }

    fn emitted_by(&self, which: usize, place: &SurfaceHit, from: Vec3) -> Option<Emitted> {
        let area = &self.areas[which];
        let towards = place.position - from;
        if !area.emits(place, -towards) {
            return None;
        }
        let probability = (1.0 - self.distant_share) * self.area_probability(which, from);
        let distance2 = towards.length_squared();
        let cos = place.geometric_normal.dot(towards).abs() / distance2.sqrt();
        let density = probability * distance2 / (cos * area.area());
        Some(Emitted { light: area.light, radiance: area.radiance(place), density })
    }

    /// The radiance from emitters at infinity along a ray to `direction` that hit nothing, one entry per emitter.
    pub fn from_outside(&self, direction: Vec3) -> impl Iterator<Item = Emitted> + '_ {
        self.distant.iter().map(move |emitter| Emitted {
            light: emitter.light,
            radiance: emitter.radiance(direction),
            density: emitter.probability
                * match &emitter.kind {
                    DistantKind::Map(map) => map.density(direction),
                    DistantKind::Constant(_) => environment::CONSTANT_DENSITY,
                },
        })
    }

    /// The area emitter for `choice` in [0, 1), the position of `choice` within its interval, and its probability among
    /// area emitters.
    fn choose_area(&self, from: Vec3, choice: f32) -> Option<(usize, f32, f32)> {
        let last = self.areas.len().checked_sub(1)?;
        // Most scenes have few emitters, whose weights are kept for the second pass.
        let mut kept = [[0.0_f32; LANES]; SEPARATE_SURFACES / LANES];
        let mut total = 0.0_f32;
        for (place, weights) in self.outlines.solid_angles(from).enumerate() {
            if let Some(kept) = kept.get_mut(place) {
                *kept = weights;
            }
            total += weights.iter().sum::<f32>();
        }
        let again = self.outlines.solid_angles(from).skip(kept.len());
        let mut before = 0.0_f32;
        for (eight, weights) in kept.into_iter().chain(again).enumerate() {
            let probabilities = weights.map(|weight| self.mixed(weight, total));
            let mut end = before;
            let ends = probabilities.map(|probability| {
                end += probability;
                end
            });
            // Counting avoids a branch per emitter, which could not be predicted.
            let passed = ends.iter().map(|end| usize::from(choice >= *end)).sum::<usize>();
            let which = (eight * LANES + passed).min(last);
            let lane = which - eight * LANES;
            if lane < LANES {
                let start = if lane == 0 { before } else { ends[lane - 1] };
                let rest = ((choice - start) / probabilities[lane]).clamp(0.0, 1.0 - f32::EPSILON);
                return (probabilities[lane] > 0.0).then_some((which, rest, probabilities[lane]));
            }
            before = end;
        }
        None
    }

    fn area_probability(&self, which: usize, from: Vec3) -> f32 {
        let (mut total, mut own) = (0.0_f32, 0.0);
        for (place, weights) in self.outlines.solid_angles(from).enumerate() {
            if place == which / LANES {
                own = weights[which % LANES];
            }
            total += weights.iter().sum::<f32>();
        }
        self.mixed(own, total)
    }

    #[inline]
    fn mixed(&self, weight: f32, total: f32) -> f32 {
        let alike = 1.0 / self.areas.len() as f32;
        if total > 0.0 { UNIFORM_SHARE * alike + weight * ((1.0 - UNIFORM_SHARE) / total) } else { alike }
    }
}

impl DistantEmitter {
    fn radiance(&self, direction: Vec3) -> Vec3 {
        match &self.kind {
            DistantKind::Map(map) => map.radiance(direction),
            DistantKind::Constant(radiance) => *radiance,
        }
    }
}

fn check_radiance(radiance: &[f32; 3]) -> Result<(), LightFault> {
    let sound = radiance.iter().all(|&v| v.is_finite() && v >= 0.0);
    if sound { Ok(()) } else { Err(LightFault::Radiance(*radiance)) }
}

/// The number of walks, in turn from all area emitters.
const WALKS: u32 = 1024;
/// The largest number of rays of a walk. The first one leaves the lamp and does not count.
const RAYS: u32 = 5;
const SEED: u64 = 0xe5_ca9e;

/// The share of rays that leave the scene, among those from surfaces on which the area emitters shine, or on which
/// light from there arrives; 1 if there are no area emitters. `first_opaque` finds the first surface in a direction
/// that light does not pass.
///
/// Probe walks start on the area emitters, reflect diffusely where they hit and go straight through glass. They follow
/// from geometry and opacity alone, and always use the same random numbers.
pub(crate) fn escape_share(emitters: &Emitters, first_opaque: impl Fn(&SurfaceHit, Vec3) -> Option<SurfaceHit>) -> f32 {
    if emitters.areas.is_empty() {
        return 1.0;
    }
    let (mut escaped, mut counted) = (0_u32, 0_u32);
    for walk in 0..WALKS {
        let sampler = Sampler::new(SEED, [0, 0], walk);
        let [choice, u, v, side] = sampler.set(0);
        let lamp = &emitters.areas[walk as usize % emitters.areas.len()];
        let mut at = lamp.sample(choice, [u, v]);
        let mut up = side < 0.5 || !lamp.is_two_sided();
        for ray in 0..RAYS {
            let [u, v, ..] = sampler.set(1 + ray);
            let normal = if up { at.geometric_normal } else { -at.geometric_normal };
            let direction = Frame::around(normal).world_from_local(sampling::cosine_hemisphere([u, v]));
            let met = first_opaque(&at, direction);
            if ray > 0 {
                counted += 1;
                escaped += u32::from(met.is_none());
            }
            let Some(met) = met else { break };
            up = met.is_front(-direction);
            at = met;
        }
    }
    escaped as f32 / counted.max(1) as f32
}

#[cfg(test)]
mod tests {
    use mateval_testkit::scenes::{Builder, grey, quad};

    use super::*;

    fn emitters(surfaces: usize, distant: bool) -> (ReferenceScene, Emitters) {
        let mut builder = Builder::default();
        for k in 0..surfaces {
            let (at, size) = (Vec3::new(k as f32 - 2.0, 0.3 * k as f32, -3.0), 0.2 + 0.2 * k as f32);
            builder = builder.surface(quad(at, Vec3::X * size, Vec3::Y * size), grey(0.5)).glowing([1.0; 3]);
            builder = if k % 2 == 0 { builder.on_both_sides() } else { builder };
        }
        if distant {
            builder = builder.light(Emission::Constant { radiance: [1.0; 3] });
            builder = builder.light(Emission::Constant { radiance: [2.0; 3] });
        }
        let scene = builder.scene();
        let emitters = Emitters::new(&scene, &[], 5.0).unwrap();
        (scene, emitters)
    }

    /// The density of a sample equals the density reported when the same light is met by chance, for all mixes of
    /// emitters, whether surfaces are sampled one by one or by group.
    #[test]
    fn sampled_and_found_densities_agree() {
        for (surfaces, distant) in [(1, false), (5, false), (5, true), (70, true), (0, true)] {
            let (scene, emitters) = emitters(surfaces, distant);
            let from = Vec3::new(0.2, -0.1, 0.5);
            let shares: Vec<f64> = (0..scene.lights.len()).map(|light| 1.0 + light as f64).collect();
            for emitters in [emitters.with_group_shares(&[from, Vec3::ZERO], &shares), emitters] {
                let mut lights = std::collections::BTreeSet::new();
                for index in 0..2000 {
                    let [a, b, c, _] = sobol_burley::sample_4d(index, 0, 3);
                    let Some(sample) = emitters.sample(from, [a, b, c], |_| 1.0) else { continue };
                    let found = match &sample.place {
                        Some(place) => emitters.emitted(place, from).unwrap(),
                        None => emitters.from_outside(sample.direction).find(|f| f.light == sample.light).unwrap(),
                    };
                    assert!((found.density / sample.density - 1.0).abs() < 1e-3, "{surfaces} {sample:?} {found:?}");
                    assert_eq!((found.light, found.radiance), (sample.light, sample.radiance));
                    lights.insert(sample.light.0);
                }
                // Of many emitters, some are too small to be found.
                assert!(
                    lights.len() == scene.lights.len() || (surfaces == 70 && lights.len() > 60),
                    "{}",
                    lights.len()
                );
            }
        }
    }

    #[test]
    fn no_emitters_give_no_light() {
        let (_, emitters) = emitters(0, false);
        assert!(emitters.sample(Vec3::ZERO, [0.5; 3], |_| 1.0).is_none());
        assert_eq!(emitters.from_outside(Vec3::X).count(), 0);
    }
}
