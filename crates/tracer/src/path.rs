//! Paths of light, followed backwards from the camera.
//!
//! At every surface one emitter is sampled (next-event estimation) and one direction of the surface's own; the two ways of
//! finding light are weighed against each other by the power heuristic (Veach 1997, section 9.2). Nothing is clamped.

use glam::Vec3;
use mateval_scene::reference::LightIndex;

use crate::accel::Hit;
use crate::bsdf::Bsdf;
use crate::emitter::Emitted;
use crate::ray::Ray;
use crate::render::{LightSampling, RenderSettings};
use crate::sampler::Sampler;
use crate::surface_hit::SurfaceHit;
use crate::world::World;

/// What paths had to leave out or would have to explain.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PathCounts {
    pub(crate) rays: u64,
    pub(crate) shadow_rays: u64,
    pub(crate) capped: u64,
    pub(crate) capped_throughput: f64,
    pub(crate) not_finite: u64,
}

/// The last scattering: where the ray started and how likely its direction was.
#[derive(Clone, Copy)]
struct Scattered {
    from: Vec3,
    density: f32,
    delta: bool,
}

/// A path under way.
#[derive(Clone, Copy)]
struct Path {
    /// Its place among the starts.
    which: usize,
    sampler: Sampler,
    throughput: Vec3,
    /// None on the camera's ray.
    scattered: Option<Scattered>,
}

/// A path that has met a surface, which is not a lamp alone, and may scatter there.
struct Arrival {
    path: Path,
    place: SurfaceHit,
    /// Towards where the path came from.
    wo: Vec3,
}

/// Light of a path that counts unless its shadow ray is stopped.
struct Offer {
    which: usize,
    sampler: Sampler,
    light: LightIndex,
    value: Vec3,
}

/// Follows paths, all those of a batch by one scattering at a time: each step asks early for the memory of the next, which
/// a path alone would have to wait for. Keeps its room from one batch to the next.
pub(crate) struct PathTracer<'w> {
    world: &'w World,
    settings: &'w RenderSettings,
    pub(crate) counts: PathCounts,
    paths: Vec<Path>,
    /// Of `paths`, one each.
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    arrivals: Vec<Arrival>,
    offers: Vec<Offer>,
    /// Of `offers`, one each.
    shadow_rays: Vec<Ray>,
    stopped: Vec<bool>,
}

impl<'w> PathTracer<'w> {
    pub(crate) fn new(world: &'w World, settings: &'w RenderSettings) -> Self {
        Self {
            world,
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
        mut add: impl FnMut(usize, LightIndex, Vec3),
    ) {
        self.paths.clear();
        self.rays.clear();
        for (which, (sampler, ray)) in starts.into_iter().enumerate() {
            self.paths.push(Path { which, sampler, throughput: Vec3::ONE, scattered: None });
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
    fn arrive(&mut self, scatterings: u32, add: &mut impl FnMut(usize, LightIndex, Vec3)) {
        self.counts.rays += self.rays.len() as u64;
        let paths = &self.paths;
        self.world.closest_many(&self.rays, |which| paths[which].sampler.salt(2 * scatterings), &mut self.hits);
        self.arrivals.clear();
        let mut found = Found { world: self.world, settings: self.settings, counts: &mut self.counts, add };
        for ((path, ray), hit) in self.paths.drain(..).zip(&self.rays).zip(&self.hits) {
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
                found.counts.capped_throughput += f64::from(path.throughput.element_sum() / 3.0);
                continue;
            }
            self.world.prefetch_texels(&place);
            self.arrivals.push(Arrival { path, place, wo: -ray.direction() });
        }
    }

    /// Looks for light from where paths have arrived, and sends them on.
    fn scatter(&mut self, scatterings: u32) {
        self.rays.clear();
        self.offers.clear();
        self.shadow_rays.clear();
        for Arrival { path, place, wo } in self.arrivals.drain(..) {
            let bsdf = Bsdf::new(self.world, &place, wo);
            if bsdf.is_black() {
                continue;
            }
            if self.settings.light_sampling != LightSampling::Bsdf
                && let Some((ray, offer)) = offered(self.world, self.settings, &path, &bsdf, &place, scatterings)
            {
                self.counts.shadow_rays += 1;
                self.offers.push(offer);
                self.shadow_rays.push(ray);
            }
            if let Some((path, ray)) = scattered(self.settings, path, &bsdf, &place, scatterings) {
                self.paths.push(path);
                self.rays.push(ray);
            }
        }
    }

    /// Adds the light on offer that nothing is in the way of.
    fn take_offers(&mut self, scatterings: u32, add: &mut impl FnMut(usize, LightIndex, Vec3)) {
        let offers = &self.offers;
        let salt = |which: usize| offers[which].sampler.salt(2 * scatterings + 1);
        self.world.occluded_many(&self.shadow_rays, salt, &mut self.stopped);
        let mut found = Found { world: self.world, settings: self.settings, counts: &mut self.counts, add };
        for (offer, _) in self.offers.iter().zip(&self.stopped).filter(|(_, stopped)| !**stopped) {
            found.contribute(offer.which, offer.light, offer.value);
        }
    }
}

/// Samples an emitter: the ray that asks whether anything is in between, and what its light would add.
fn offered(
    world: &World,
    settings: &RenderSettings,
    path: &Path,
    bsdf: &Bsdf,
    place: &SurfaceHit,
    scatterings: u32,
) -> Option<(Ray, Offer)> {
    if bsdf.is_delta() {
        return None;
    }
    let [a, b, c, _] = path.sampler.set(1 + 2 * scatterings);
    let light = world.emitters().sample(place.position, [a, b, c], |place| world.opacity_at(place))?;
    let (value, density) = bsdf.evaluate(light.direction);
    if value == Vec3::ZERO {
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
    let value = path.throughput * value * light.radiance * (weight / light.density);
    Some((shadow, Offer { which: path.which, sampler: path.sampler, light: light.light, value }))
}

/// The path and the ray that it goes on with. Roulette stops paths with a fixed probability, whatever they carry: so the
/// length of paths follows from geometry alone.
fn scattered(
    settings: &RenderSettings,
    mut path: Path,
    bsdf: &Bsdf,
    place: &SurfaceHit,
    scatterings: u32,
) -> Option<(Path, Ray)> {
    let [a, b, c, roulette] = path.sampler.set(2 + 2 * scatterings);
    if scatterings >= settings.roulette_start {
        if roulette >= settings.roulette_survival {
            return None;
        }
        path.throughput /= settings.roulette_survival;
    }
    let sample = bsdf.sample([a, b, c])?;
    path.throughput *= sample.weight;
    if path.throughput == Vec3::ZERO {
        return None;
    }
    path.scattered = Some(Scattered { from: place.position, density: sample.density, delta: sample.delta });
    Some((path, place.spawn(sample.wi)))
}

/// Where what paths find goes.
struct Found<'a, F: FnMut(usize, LightIndex, Vec3)> {
    world: &'a World,
    settings: &'a RenderSettings,
    counts: &'a mut PathCounts,
    add: &'a mut F,
}

impl<F: FnMut(usize, LightIndex, Vec3)> Found<'_, F> {
    /// Adds what the surface itself sends back along `ray`. True if the surface is nothing but a lamp to this ray: an
    /// emitter hidden from the camera shows the camera its material and every other ray its light alone.
    fn add_emitted(&mut self, path: &Path, place: &SurfaceHit, ray: &Ray) -> bool {
        let emitters = self.world.emitters();
        let Some(light) = emitters.light_of(place.surface) else { return false };
        let hidden = !emitters.is_camera_visible(light);
        if hidden && path.scattered.is_none() {
            return false;
        }
        let from = path.scattered.map_or(ray.origin(), |scattered| scattered.from);
        if let Some(emitted) = emitters.emitted(place, from) {
            self.add_met(path, &emitted);
        }
        hidden
    }

    fn add_outside(&mut self, path: &Path, direction: Vec3) {
        let emitters = self.world.emitters();
        for emitted in emitters.from_outside(direction) {
            if path.scattered.is_some() || emitters.is_camera_visible(emitted.light) {
                self.add_met(path, &emitted);
            }
        }
    }

    /// Adds light that the surface's own sampling found.
    fn add_met(&mut self, path: &Path, emitted: &Emitted) {
        let weight = match (path.scattered, self.settings.light_sampling) {
            (None | Some(Scattered { delta: true, .. }), _) | (_, LightSampling::Bsdf) => 1.0,
            (_, LightSampling::Emitters) => 0.0,
            (Some(Scattered { density, .. }), LightSampling::Both) => power_heuristic(density, emitted.density),
        };
        self.contribute(path.which, emitted.light, path.throughput * emitted.radiance * weight);
    }

    fn contribute(&mut self, which: usize, light: LightIndex, value: Vec3) {
        if value.is_finite() {
            (self.add)(which, light, value);
        } else {
            self.counts.not_finite += 1;
        }
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
