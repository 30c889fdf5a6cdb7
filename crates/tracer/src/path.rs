//! Paths of light, followed backwards from the camera.
//!
//! At every surface one emitter is sampled (next-event estimation) and one direction of the surface's own; the two ways of
//! finding light are weighed against each other by the power heuristic (Veach 1997, section 9.2). Nothing is clamped.

use glam::{Vec2, Vec3};
use mateval_scene::reference::LightIndex;

use crate::accel::Hit;
use crate::bsdf::{Bsdf, Shown};
use crate::emitter::Emitted;
use crate::material_source::MaterialSource;
use crate::ray::Ray;
use crate::sampler::Sampler;
use crate::settings::{LightSampling, RenderSettings};
use crate::surface_hit::SurfaceHit;
use crate::world::World;

/// The most variants that the same paths are followed for.
pub(crate) const MOST_VARIANTS: usize = 8;

/// What paths had to leave out or would have to explain.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PathCounts {
    pub(crate) rays: u64,
    pub(crate) shadow_rays: u64,
    pub(crate) capped: u64,
    /// By variant, as `not_finite`.
    pub(crate) capped_throughput: [f64; MOST_VARIANTS],
    pub(crate) not_finite: [u64; MOST_VARIANTS],
}

/// The last scattering: where the ray started and how likely its direction was.
#[derive(Clone, Copy)]
struct Scattered {
    from: Vec3,
    density: f32,
    delta: bool,
}

/// A path under way, for `K` variants.
#[derive(Clone, Copy)]
struct Path<const K: usize> {
    /// Its place among the starts.
    which: usize,
    sampler: Sampler,
    throughputs: [Vec3; K],
    /// As `throughputs`, for the lights of a stage that the ray meets.
    stage_throughputs: [Vec3; K],
    /// None on the camera's ray.
    scattered: Option<Scattered>,
}

/// A path that has met a surface, which is not a lamp alone, and may scatter there.
struct Arrival<const K: usize> {
    path: Path<K>,
    place: SurfaceHit,
    /// What the source of materials asks for.
    uv: Vec2,
    /// Towards where the path came from.
    wo: Vec3,
}

/// Light of a path that counts unless its shadow ray is stopped.
struct Offer<const K: usize> {
    which: usize,
    sampler: Sampler,
    light: LightIndex,
    values: [Vec3; K],
}

/// Follows paths, all those of a batch by one scattering at a time: each step asks early for the memory of the next, which
/// a path alone would have to wait for. Keeps its room from one batch to the next.
///
/// The same paths serve `K` variants of the `materials`, each with the numbers that it would have alone.
pub(crate) struct PathTracer<'w, M, const K: usize> {
    world: &'w World,
    materials: M,
    settings: RenderSettings,
    pub(crate) counts: PathCounts,
    paths: Vec<Path<K>>,
    /// Of `paths`, one each.
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    arrivals: Vec<Arrival<K>>,
    offers: Vec<Offer<K>>,
    /// Of `offers`, one each.
    shadow_rays: Vec<Ray>,
    stopped: Vec<bool>,
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
            offers: Vec::new(),
            shadow_rays: Vec::new(),
            stopped: Vec::new(),
        }
    }

    /// Follows the paths that begin with `starts` and calls `add` for every light that one of them finds: with its place
    /// among the starts, the light, and what that contributes. For each path the order of calls is that along the path.
    pub(crate) fn trace(
        &mut self,
        starts: impl IntoIterator<Item = (Sampler, Ray)>,
        mut add: impl FnMut(usize, LightIndex, [Vec3; K]),
    ) {
        self.paths.clear();
        self.rays.clear();
        for (which, (sampler, ray)) in starts.into_iter().enumerate() {
            let throughputs = [Vec3::ONE; K];
            self.paths.push(Path { which, sampler, throughputs, stage_throughputs: throughputs, scattered: None });
            self.rays.push(ray);
        }
        let mut scatterings = 0;
        while !self.paths.is_empty() {
            self.arrive(scatterings, &mut add);
            self.scatter(scatterings);
            self.take_offers(scatterings, &mut add);
            scatterings += 1;
        }
    }

    /// Follows all rays to their ends and adds what they find there.
    fn arrive(&mut self, scatterings: u32, add: &mut impl FnMut(usize, LightIndex, [Vec3; K])) {
        self.counts.rays += self.rays.len() as u64;
        let paths = &self.paths;
        self.world.closest_many(&self.rays, |which| paths[which].sampler.salt(2 * scatterings), &mut self.hits);
        self.hits.iter().flatten().for_each(|hit| self.materials.prefetch(hit));
        self.arrivals.clear();
        let mut found = Found { world: self.world, settings: &self.settings, counts: &mut self.counts, add };
        let on_stage = self.world.emitters().are_on_stage();
        for ((path, ray), hit) in self.paths.drain(..).zip(&self.rays).zip(&self.hits) {
            if on_stage {
                found.add_stage(&path, ray, hit.map_or(f32::INFINITY, |hit| hit.distance));
            }
            let Some(hit) = hit else {
                found.add_outside(&path, ray.direction());
                continue;
            };
            let place = self.world.surface_hit(hit);
            let is_lamp_alone = found.add_emitted(&path, &place, ray);
            if is_lamp_alone {
                continue;
            }
            if scatterings > self.settings.max_bounces {
                found.counts.capped += 1;
                for (sum, throughput) in found.counts.capped_throughput.iter_mut().zip(path.throughputs) {
                    *sum += f64::from(throughput.element_sum() / 3.0);
                }
                continue;
            }
            let uv = self.materials.prefetch_texels(hit, &place);
            self.arrivals.push(Arrival { path, place, uv, wo: -ray.direction() });
        }
    }

    /// Looks for light from where paths have arrived, and sends them on.
    fn scatter(&mut self, scatterings: u32) {
        self.rays.clear();
        self.offers.clear();
        self.shadow_rays.clear();
        for Arrival { path, place, uv, wo } in self.arrivals.drain(..) {
            let bsdf = self.materials.bsdf(&place, uv, wo);
            if bsdf.is_black() {
                continue;
            }
            if self.settings.light_sampling != LightSampling::Bsdf
                && let Some((ray, offer)) = offered(self.world, &self.settings, &path, &bsdf, &place, scatterings)
            {
                self.counts.shadow_rays += 1;
                self.offers.push(offer);
                self.shadow_rays.push(ray);
            }
            if let Some((path, ray)) = scattered(self.world, &self.settings, path, &bsdf, &place, scatterings) {
                self.paths.push(path);
                self.rays.push(ray);
            }
        }
    }

    /// Adds the light on offer that nothing is in the way of.
    fn take_offers(&mut self, scatterings: u32, add: &mut impl FnMut(usize, LightIndex, [Vec3; K])) {
        let offers = &self.offers;
        let salt = |which: usize| offers[which].sampler.salt(2 * scatterings + 1);
        self.world.occluded_many(&self.shadow_rays, salt, &mut self.stopped);
        let mut found = Found { world: self.world, settings: &self.settings, counts: &mut self.counts, add };
        for (offer, _) in self.offers.iter().zip(&self.stopped).filter(|(_, stopped)| !**stopped) {
            found.contribute(offer.which, offer.light, offer.values);
        }
    }
}

/// Samples an emitter: the ray that asks whether anything is in between, and what its light would add.
fn offered<const K: usize>(
    world: &World,
    settings: &RenderSettings,
    path: &Path<K>,
    bsdf: &Bsdf<'_, K>,
    place: &SurfaceHit,
    scatterings: u32,
) -> Option<(Ray, Offer<K>)> {
    if bsdf.is_delta() {
        return None;
    }
    let [a, b, c, _] = path.sampler.set(1 + 2 * scatterings);
    let light = world.emitters().sample(place.position, [a, b, c], |place| world.opacity_at(place))?;
    let shown = if light.on_stage { Shown::Stage } else { Shown::All };
    let (values, density) = bsdf.evaluate_all(light.direction, shown);
    if values == [Vec3::ZERO; K] {
        return None;
    }
    let shadow = match &light.place {
        Some(there) => place.spawn_to(there)?,
        None => place.spawn(light.direction),
    };
    let weight = match settings.light_sampling {
        LightSampling::Emitters => 1.0,
        _ => power_heuristic(light.density, density),
    };
    let brought = |k: usize| path.throughputs[k] * values[k] * light.radiance * (weight / light.density);
    let values = std::array::from_fn(brought);
    Some((shadow, Offer { which: path.which, sampler: path.sampler, light: light.light, values }))
}

/// The path and the ray that it goes on with. Roulette stops paths with a fixed probability, whatever they carry: so the
/// length of paths follows from geometry alone.
fn scattered<const K: usize>(
    world: &World,
    settings: &RenderSettings,
    mut path: Path<K>,
    bsdf: &Bsdf<'_, K>,
    place: &SurfaceHit,
    scatterings: u32,
) -> Option<(Path<K>, Ray)> {
    let [a, b, c, roulette] = path.sampler.set(2 + 2 * scatterings);
    if scatterings >= settings.roulette_start {
        if roulette >= settings.roulette_survival {
            return None;
        }
        path.throughputs = path.throughputs.map(|throughput| throughput / settings.roulette_survival);
    }
    let sample = bsdf.sample([a, b, c])?;
    if world.emitters().are_on_stage() {
        let weights = bsdf.stage_weights(&sample);
        path.stage_throughputs = std::array::from_fn(|k| path.throughputs[k] * weights[k]);
    }
    path.throughputs.iter_mut().zip(sample.weights).for_each(|(throughput, weight)| *throughput *= weight);
    if path.throughputs == [Vec3::ZERO; K] {
        return None;
    }
    path.scattered = Some(Scattered { from: place.position, density: sample.density, delta: sample.delta });
    Some((path, place.spawn(sample.wi)))
}

/// Where what paths find goes.
struct Found<'a, const K: usize, F: FnMut(usize, LightIndex, [Vec3; K])> {
    world: &'a World,
    settings: &'a RenderSettings,
    counts: &'a mut PathCounts,
    add: &'a mut F,
}

impl<const K: usize, F: FnMut(usize, LightIndex, [Vec3; K])> Found<'_, K, F> {
    /// Adds what the surface itself sends back along `ray`. True if the surface is nothing but a lamp to this ray: an
    /// emitter hidden from the camera shows the camera its material and every other ray its light alone.
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

    /// Adds the lights of a stage that the ray passes before it meets a surface, which is `end` metres away.
    fn add_stage(&mut self, path: &Path<K>, ray: &Ray, end: f32) {
        let Some(Scattered { from, .. }) = path.scattered else { return };
        for emitted in self.world.emitters().stage_along(&Ray::new(ray.origin(), ray.direction(), end), from) {
            self.add_met(path, path.stage_throughputs, &emitted);
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

    /// Adds light that the surface's own sampling found.
    fn add_met(&mut self, path: &Path<K>, throughputs: [Vec3; K], emitted: &Emitted) {
        let weight = match (path.scattered, self.settings.light_sampling) {
            (None | Some(Scattered { delta: true, .. }), _) | (_, LightSampling::Bsdf) => 1.0,
            (_, LightSampling::Emitters) => 0.0,
            (Some(Scattered { density, .. }), LightSampling::Both) => power_heuristic(density, emitted.density),
        };
        let values = throughputs.map(|throughput| throughput * emitted.radiance * weight);
        self.contribute(path.which, emitted.light, values);
    }

    fn contribute(&mut self, which: usize, light: LightIndex, values: [Vec3; K]) {
        // A value that is not finite in one variant does not spoil the others.
        let finite = values.map(|value| if value.is_finite() { value } else { Vec3::ZERO });
        let counts = self.counts.not_finite.iter_mut().zip(values);
        counts.for_each(|(count, value)| *count += u64::from(!value.is_finite()));
        (self.add)(which, light, finite);
    }
}

/// Veach's power heuristic with exponent 2, for one sample each; safe where a density is infinite.
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
