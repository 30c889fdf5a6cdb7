//! Path tracing from the camera.
//!
//! At every surface the tracer samples one emitter (next-event estimation) and one direction of the BSDF, and combines
//! both by multiple importance sampling with the power heuristic (Veach 1997, section 9.2). Nothing is clamped.

use glam::{Vec2, Vec3};
use mateval_dataset::reference::LightIndex;

use crate::bsdf::{Bsdf, BsdfPart};
use crate::emitter::Emitted;
use crate::error::RequestFault;
use crate::ray::{Hit, Ray, SurfaceHit};
use crate::sampling::Sampler;
use crate::world::World;

/// How paths find light. All strategies have the same mean and differ in noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSampling {
    /// Samples emitters and the BSDF, weighted by the power heuristic.
    #[default]
    Both,
    /// Samples emitters. Light that a scattered ray meets counts only after a mirror or clear glass.
    Emitters,
    /// Samples the BSDF alone.
    Bsdf,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Paths per pixel.
    pub samples: u32,
    /// Different seeds give independent pictures.
    pub seed: u64,
    /// The largest number of scatterings after that at the first hit; light is still sampled at the last. Blender's
    /// "max bounces"; Mitsuba's `max_depth` is larger by 2.
    pub max_bounces: u32,
    /// The first bounce at which Russian roulette may end a path.
    pub roulette_start: u32,
    /// The probability that a path survives Russian roulette, above 0 and at most 1.
    pub roulette_survival: f32,
    pub light_sampling: LightSampling,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            samples: 64,
            seed: 0,
            max_bounces: 16,
            roulette_start: 4,
            roulette_survival: 0.8,
            light_sampling: LightSampling::Both,
        }
    }
}

impl RenderSettings {
    /// Fails if a setting is out of range.
    pub(crate) fn check(&self) -> Result<(), RequestFault> {
        let Self { samples, roulette_survival, .. } = *self;
        if samples == 0 {
            return Err(RequestFault::Samples(samples));
        }
        if !(roulette_survival > 0.0 && roulette_survival <= 1.0) {
            return Err(RequestFault::RouletteSurvival(roulette_survival));
        }
        Ok(())
    }
}

/// Supplies BSDFs for `K` material variants, which one path serves: they differ in base colour, and at most two pairs
/// of roughness and metallic share their densities.
pub(crate) trait MaterialSource<'w, const K: usize>: Copy {
    /// Prefetches the memory that [`Self::prefetch_texels`] reads for `hit`.
    fn prefetch(self, hit: &Hit);

    /// Prefetches the texels at `place` and returns the uv to pass to [`Self::bsdf`].
    fn prefetch_texels(self, hit: &Hit, place: &SurfaceHit) -> Vec2;

    /// The BSDF at `place`, seen from `wo`, after `scatterings` earlier scatterings of the path.
    fn bsdf(self, place: &SurfaceHit, uv: Vec2, wo: Vec3, scatterings: u32) -> Bsdf<'w, K>;

    /// Whether a lamp that is hidden from the camera reflects light as well as emitting it. Blender's lamps do not.
    const LAMPS_REFLECT: bool = false;

    /// The radiance that leaves `place` towards `wo`, where it is known without tracing further. Never called
    /// for the first surface of a path.
    fn known_radiance(self, _place: &SurfaceHit, _wo: Vec3) -> Option<Vec3> {
        None
    }
}

/// The scene's own materials, the same for all variants.
#[derive(Clone, Copy)]
pub(crate) struct OwnMaterials<'w>(pub(crate) &'w World);

impl<'w, const K: usize> MaterialSource<'w, K> for OwnMaterials<'w> {
    fn prefetch(self, _: &Hit) {}

    /// Returns zero: a `SurfaceHit` holds the uv of the surface itself.
    fn prefetch_texels(self, _: &Hit, place: &SurfaceHit) -> Vec2 {
        self.0.prefetch_texels(place);
        Vec2::ZERO
    }

    fn bsdf(self, place: &SurfaceHit, _: Vec2, wo: Vec3, _: u32) -> Bsdf<'w, K> {
        self.0.bsdf(place, wo)
    }
}

/// The largest number of material variants that one path can serve.
pub(crate) const MOST_VARIANTS: usize = 8;

/// The least cosine between two directions that count as one.
const STRAIGHT: f32 = 0.9999;

/// Events counted along paths.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PathCounts {
    pub(crate) paths: u64,
    pub(crate) rays: u64,
    pub(crate) shadow_rays: u64,
    pub(crate) capped: u64,
    /// Per variant, like `not_finite`.
    pub(crate) capped_throughput: [f64; MOST_VARIANTS],
    pub(crate) not_finite: [u64; MOST_VARIANTS],
}

/// The last scattering event: its position, and the density of the direction sampled there.
#[derive(Clone, Copy)]
struct Scattered {
    from: Vec3,
    density: f32,
    delta: bool,
}

/// A path in progress, for `K` material variants.
#[derive(Clone, Copy)]
struct Path<const K: usize> {
    /// The index of the path's start.
    start: usize,
    sampler: Sampler,
    throughputs: [Vec3; K],
    /// Like `throughputs`, for stage lights that the ray meets.
    stage_throughputs: [Vec3; K],
    /// `None` on the camera ray.
    scattered: Option<Scattered>,
}

/// A path that has met a surface at which it may scatter. A lamp hidden from the camera is no such surface.
struct Arrival<const K: usize> {
    path: Path<K>,
    place: SurfaceHit,
    /// The uv that the material source returned when it prefetched texels.
    uv: Vec2,
    /// Towards the previous vertex of the path.
    wo: Vec3,
}

/// Sampled light that counts unless its shadow ray is blocked.
struct LightSample<const K: usize> {
    /// The index of the path's start.
    start: usize,
    sampler: Sampler,
    light: LightIndex,
    values: [Vec3; K],
}

/// Traces batches of paths, one scattering of all paths at a time. Each step prefetches the memory of the next one, for
/// which a single path would have to wait. Buffers are reused between batches.
///
/// The same paths serve `K` variants of the `materials`, with the same random numbers for each variant as if it were
/// traced alone.
pub(crate) struct PathTracer<'w, M, const K: usize> {
    world: &'w World,
    materials: M,
    settings: RenderSettings,
    pub(crate) counts: PathCounts,
    paths: Vec<Path<K>>,
    /// One for each of `paths`.
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    arrivals: Vec<Arrival<K>>,
    light_samples: Vec<LightSample<K>>,
    /// One for each of `light_samples`.
    shadow_rays: Vec<Ray>,
    blocked: Vec<bool>,
}

impl<'w, M: MaterialSource<'w, K>, const K: usize> PathTracer<'w, M, K> {
    pub(crate) fn new(world: &'w World, materials: M, settings: RenderSettings) -> Self {
        Self {
            world,
            materials,
            settings,
            counts: PathCounts::default(),
            paths: Vec::new(),
            rays: Vec::new(),
            hits: Vec::new(),
            arrivals: Vec::new(),
            light_samples: Vec::new(),
            shadow_rays: Vec::new(),
            blocked: Vec::new(),
        }
    }

    /// Traces the paths that begin with `starts` and calls `add` for every contribution, with the index of the start,
    /// the light and its value for each variant. Calls for one path come in order along the path. Known radiance is
    /// booked as one more light after the last.
    pub(crate) fn trace(
        &mut self,
        starts: impl IntoIterator<Item = (Sampler, Ray)>,
        mut add: impl FnMut(usize, LightIndex, [Vec3; K]),
    ) {
        self.paths.clear();
        self.rays.clear();
        for (start, (sampler, ray)) in starts.into_iter().enumerate() {
            let throughputs = [Vec3::ONE; K];
            self.paths.push(Path { start, sampler, throughputs, stage_throughputs: throughputs, scattered: None });
            self.rays.push(ray);
        }
        self.counts.paths += self.paths.len() as u64;
        let mut scatterings = 0;
        while !self.paths.is_empty() {
            self.arrive(scatterings, &mut add);
            self.scatter(scatterings);
            self.add_unblocked(scatterings, &mut add);
            scatterings += 1;
        }
    }

    /// Traces all rays, adds the light that they meet and records where they arrive.
    fn arrive(&mut self, scatterings: u32, add: &mut impl FnMut(usize, LightIndex, [Vec3; K])) {
        self.counts.rays += self.rays.len() as u64;
        let paths = &self.paths;
        // Find the nearest hits, and prefetch what shading reads of their triangles.
        self.world.closest_many(&self.rays, |which| paths[which].sampler.salt(2 * scatterings), &mut self.hits);
        self.hits.iter().flatten().for_each(|hit| self.materials.prefetch(hit));
        self.arrivals.clear();
        let mut contributions =
            Contributions { world: self.world, settings: &self.settings, counts: &mut self.counts, add };
        let on_stage = self.world.emitters().are_on_stage();
        for ((path, ray), hit) in self.paths.drain(..).zip(&self.rays).zip(&self.hits) {
            // Add the light that the ray meets: of a stage, from outside the scene, or of the surface.
            if on_stage {
                contributions.add_stage(&path, ray, hit.map_or(f32::INFINITY, |hit| hit.distance));
            }
            let Some(hit) = hit else {
                contributions.add_outside(&path, ray.direction());
                continue;
            };
            let place = self.world.surface_hit(hit);
            let is_lamp_alone = contributions.add_emitted(&path, &place, ray);
            if is_lamp_alone && !M::LAMPS_REFLECT {
                continue;
            }
            // Stop where the rest of the path's light is known.
            if path.scattered.is_some()
                && let Some(radiance) = self.materials.known_radiance(&place, -ray.direction())
            {
                let known = LightIndex(self.world.emitters().groups());
                contributions.contribute(path.start, known, path.throughputs.map(|throughput| throughput * radiance));
                continue;
            }
            // Stop paths that have scattered often enough.
            if scatterings > self.settings.max_bounces {
                contributions.counts.capped += 1;
                for (sum, throughput) in contributions.counts.capped_throughput.iter_mut().zip(path.throughputs) {
                    *sum += f64::from(throughput.element_sum() / 3.0);
                }
                continue;
            }
            // Prefetch texels; they are read in `scatter`.
            let uv = self.materials.prefetch_texels(hit, &place);
            self.arrivals.push(Arrival { path, place, uv, wo: -ray.direction() });
        }
    }

    /// Samples an emitter and the next ray at every arrival.
    fn scatter(&mut self, scatterings: u32) {
        self.rays.clear();
        self.light_samples.clear();
        self.shadow_rays.clear();
        for Arrival { path, place, uv, wo } in self.arrivals.drain(..) {
            let bsdf = self.materials.bsdf(&place, uv, wo, scatterings);
            if bsdf.is_black() {
                continue;
            }
            // Sample an emitter; the shadow ray waits until all paths have got here.
            if self.settings.light_sampling != LightSampling::Bsdf
                && let Some((ray, light_sample)) =
                    sample_light(self.world, &self.settings, &path, &bsdf, &place, scatterings)
            {
                self.counts.shadow_rays += 1;
                self.light_samples.push(light_sample);
                self.shadow_rays.push(ray);
            }
            // Sample the direction in which the path continues.
            let sampled = sample_continuation(self.world, &self.settings, path, &bsdf, &place, wo, scatterings);
            if let Some((path, ray)) = sampled {
                self.paths.push(path);
                self.rays.push(ray);
            }
        }
    }

    /// Adds sampled light whose shadow ray is not blocked.
    fn add_unblocked(&mut self, scatterings: u32, add: &mut impl FnMut(usize, LightIndex, [Vec3; K])) {
        let light_samples = &self.light_samples;
        let salt = |which: usize| light_samples[which].sampler.salt(2 * scatterings + 1);
        self.world.occluded_many(&self.shadow_rays, salt, &mut self.blocked);
        let mut contributions =
            Contributions { world: self.world, settings: &self.settings, counts: &mut self.counts, add };
        for (light_sample, _) in self.light_samples.iter().zip(&self.blocked).filter(|(_, blocked)| !**blocked) {
            contributions.contribute(light_sample.start, light_sample.light, light_sample.values);
        }
    }
}

/// Samples an emitter: returns the shadow ray, and the light that arrives unless that ray is blocked.
fn sample_light<const K: usize>(
    world: &World,
    settings: &RenderSettings,
    path: &Path<K>,
    bsdf: &Bsdf<'_, K>,
    place: &SurfaceHit,
    scatterings: u32,
) -> Option<(Ray, LightSample<K>)> {
    if bsdf.is_delta() {
        return None;
    }
    // Sample a light and evaluate the BSDF towards it.
    let [a, b, c, _] = path.sampler.set(1 + 2 * scatterings);
    let light = world.emitters().sample(place.position, [a, b, c], |place| world.opacity_at(place))?;
    let part = if light.is_matt { BsdfPart::Stage } else { BsdfPart::All };
    let (values, density) = bsdf.evaluate(light.direction, part);
    if values == [Vec3::ZERO; K] {
        return None;
    }
    let shadow = match &light.place {
        Some(there) => place.spawn_to(there)?,
        None => place.spawn(light.direction),
    };
    // Weigh the sample against finding the same light by a BSDF sample.
    let weight = match settings.light_sampling {
        LightSampling::Emitters => 1.0,
        _ => power_heuristic(light.density, density),
    };
    let contribution = |k: usize| path.throughputs[k] * values[k] * light.radiance * (weight / light.density);
    let values = std::array::from_fn(contribution);
    let sample = LightSample { start: path.start, sampler: path.sampler, light: light.light, values };
    Some((shadow, sample))
}

/// Samples the ray on which the path continues. Russian roulette has a fixed survival probability that does not depend
/// on the throughput, so path lengths follow from geometry alone.
fn sample_continuation<const K: usize>(
    world: &World,
    settings: &RenderSettings,
    mut path: Path<K>,
    bsdf: &Bsdf<'_, K>,
    place: &SurfaceHit,
    wo: Vec3,
    scatterings: u32,
) -> Option<(Path<K>, Ray)> {
    // Play Russian roulette.
    let [a, b, c, roulette] = path.sampler.set(2 + 2 * scatterings);
    if scatterings >= settings.roulette_start {
        if roulette >= settings.roulette_survival {
            return None;
        }
        path.throughputs = path.throughputs.map(|throughput| throughput / settings.roulette_survival);
    }
    // Sample a direction; the weights of stage lights leave out highlights.
    let sample = bsdf.sample([a, b, c])?;
    if world.emitters().are_on_stage() {
        let weights = bsdf.stage_weights(&sample);
        path.stage_throughputs = std::array::from_fn(|k| path.throughputs[k] * weights[k]);
    }
    path.throughputs.iter_mut().zip(sample.weights).for_each(|(throughput, weight)| *throughput *= weight);
    if path.throughputs == [Vec3::ZERO; K] {
        return None;
    }
    // To the camera, what lies behind the clear front of a hidden lamp is what it would be without the lamp.
    let is_behind_lamp =
        path.scattered.is_none() && sample.delta && is_hidden_lamp(world, place) && -wo.dot(sample.wi) > STRAIGHT;
    if !is_behind_lamp {
        path.scattered = Some(Scattered { from: place.position, density: sample.density, delta: sample.delta });
    }
    Some((path, place.spawn(sample.wi)))
}

/// Whether the camera sees the material of an emitter instead of its light.
fn is_hidden_lamp(world: &World, place: &SurfaceHit) -> bool {
    let emitters = world.emitters();
    emitters.light_of(place.surface).is_some_and(|light| !emitters.is_camera_visible(light))
}

/// Collects the contributions of paths.
struct Contributions<'a, const K: usize, F: FnMut(usize, LightIndex, [Vec3; K])> {
    world: &'a World,
    settings: &'a RenderSettings,
    counts: &'a mut PathCounts,
    add: &'a mut F,
}

impl<const K: usize, F: FnMut(usize, LightIndex, [Vec3; K])> Contributions<'_, K, F> {
    /// Adds the light that the surface emits back along `ray`. Returns true if the surface is only a lamp to this ray:
    /// an emitter hidden from the camera shows the camera its material and every other ray its light alone.
    fn add_emitted(&mut self, path: &Path<K>, place: &SurfaceHit, ray: &Ray) -> bool {
        let emitters = self.world.emitters();
        let Some(light) = emitters.light_of(place.surface) else { return false };
        let hidden = !emitters.is_camera_visible(light);
        if hidden && path.scattered.is_none() {
            return false;
        }
        let from = path.scattered.map_or(ray.origin(), |scattered| scattered.from);
        if let Some(emitted) = emitters.emitted(place, from) {
            self.add_met(path, path.throughputs, &emitted);
        }
        hidden
    }

    /// Adds the stage lights that the ray passes before it meets a surface `end` metres away.
    fn add_stage(&mut self, path: &Path<K>, ray: &Ray, end: f32) {
        let Some(Scattered { from, .. }) = path.scattered else { return };
        let ray = Ray::new(ray.origin(), ray.direction(), end);
        for (emitted, is_flash) in self.world.emitters().stage_along(&ray, from) {
            let throughputs = if is_flash { path.throughputs } else { path.stage_throughputs };
            self.add_met(path, throughputs, &emitted);
        }
    }

    fn add_outside(&mut self, path: &Path<K>, direction: Vec3) {
        let emitters = self.world.emitters();
        for emitted in emitters.from_outside(direction) {
            if path.scattered.is_some() || emitters.is_camera_visible(emitted.light) {
                self.add_met(path, path.throughputs, &emitted);
            }
        }
    }

    /// Adds light that a BSDF sample (or the camera ray) has met.
    fn add_met(&mut self, path: &Path<K>, throughputs: [Vec3; K], emitted: &Emitted) {
        let weight = match (path.scattered, self.settings.light_sampling) {
            (None | Some(Scattered { delta: true, .. }), _) | (_, LightSampling::Bsdf) => 1.0,
            (_, LightSampling::Emitters) => 0.0,
            (Some(Scattered { density, .. }), LightSampling::Both) => power_heuristic(density, emitted.density),
        };
        let values = throughputs.map(|throughput| throughput * emitted.radiance * weight);
        self.contribute(path.start, emitted.light, values);
    }

    fn contribute(&mut self, start: usize, light: LightIndex, values: [Vec3; K]) {
        // A value that is not finite in one variant does not spoil the others.
        let finite = values.map(|value| if value.is_finite() { value } else { Vec3::ZERO });
        let counts = self.counts.not_finite.iter_mut().zip(values);
        counts.for_each(|(count, value)| *count += u64::from(!value.is_finite()));
        (self.add)(start, light, finite);
    }
}

/// Veach's power heuristic with exponent 2, for one sample of each strategy. An infinite density is allowed.
fn power_heuristic(own: f32, other: f32) -> f32 {
    if own == f32::INFINITY {
        return 1.0;
    }
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_weights_add_to_one() {
        for (a, b) in [(1.0, 3.0), (0.5, 0.0), (1e20, 1e-20), (1e30, 1e30)] {
            assert!((power_heuristic(a, b) + power_heuristic(b, a) - 1.0).abs() < 1e-6 || b == 0.0);
        }
        assert_eq!(power_heuristic(2.0, f32::INFINITY), 0.0);
        assert_eq!(power_heuristic(2.0, 0.0), 1.0);
    }
}
