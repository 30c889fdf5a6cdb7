//! One path of light, followed backwards from the camera.
//!
//! At every surface one emitter is sampled (next-event estimation) and one direction of the surface's own; the two ways of
//! finding light are weighed against each other by the power heuristic (Veach 1997, section 9.2). Nothing is clamped.

use glam::Vec3;
use mateval_scene::reference::LightIndex;

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

struct Path<'a, F: FnMut(LightIndex, Vec3)> {
    world: &'a World,
    settings: &'a RenderSettings,
    sampler: &'a Sampler,
    counts: &'a mut PathCounts,
    add: F,
    throughput: Vec3,
    /// None on the camera's ray.
    scattered: Option<Scattered>,
}

/// Follows the path that starts with `ray` and calls `add` for every light it finds, with what that contributes.
pub(crate) fn trace(
    world: &World,
    settings: &RenderSettings,
    sampler: &Sampler,
    ray: Ray,
    counts: &mut PathCounts,
    add: impl FnMut(LightIndex, Vec3),
) {
    let mut path = Path { world, settings, sampler, counts, add, throughput: Vec3::ONE, scattered: None };
    let mut next = Some(ray);
    let mut scatterings = 0;
    while let Some(ray) = next {
        next = path.advance(&ray, scatterings);
        scatterings += 1;
    }
}

impl<F: FnMut(LightIndex, Vec3)> Path<'_, F> {
    /// Follows `ray` to its end, adds what it finds there, and scatters.
    fn advance(&mut self, ray: &Ray, scatterings: u32) -> Option<Ray> {
        self.counts.rays += 1;
        let Some(hit) = self.world.closest(ray, || self.sampler.salt(2 * scatterings)) else {
            self.add_outside(ray.direction());
            return None;
        };
        let place = self.world.surface_hit(&hit);
        let wo = -ray.direction();
        let is_lamp_alone = self.add_emitted(&place, ray);
        if is_lamp_alone {
            return None;
        }
        let bsdf = Bsdf::new(self.world, &place, wo);
        if bsdf.is_black() {
            return None;
        }
        if scatterings > self.settings.max_bounces {
            self.counts.capped += 1;
            self.counts.capped_throughput += f64::from(self.throughput.element_sum() / 3.0);
            return None;
        }
        self.add_sampled(&bsdf, &place, scatterings);
        self.scatter(&bsdf, &place, scatterings)
    }

    /// Adds what the surface itself sends back along `ray`. True if the surface is nothing but a lamp to this ray: an
    /// emitter hidden from the camera shows the camera its material and every other ray its light alone.
    fn add_emitted(&mut self, place: &SurfaceHit, ray: &Ray) -> bool {
        let emitters = self.world.emitters();
        let Some(light) = emitters.light_of(place.surface) else { return false };
        let hidden = !emitters.is_camera_visible(light);
        if hidden && self.scattered.is_none() {
            return false;
        }
        let from = self.scattered.map_or(ray.origin(), |scattered| scattered.from);
        if let Some(emitted) = emitters.emitted(place, from) {
            self.add_found(&emitted);
        }
        hidden
    }

    fn add_outside(&mut self, direction: Vec3) {
        let emitters = self.world.emitters();
        for emitted in emitters.from_outside(direction) {
            if self.scattered.is_some() || emitters.is_camera_visible(emitted.light) {
                self.add_found(&emitted);
            }
        }
    }

    /// Adds light that the surface's own sampling found.
    fn add_found(&mut self, emitted: &Emitted) {
        let weight = match (self.scattered, self.settings.light_sampling) {
            (None | Some(Scattered { delta: true, .. }), _) | (_, LightSampling::Bsdf) => 1.0,
            (_, LightSampling::Emitters) => 0.0,
            (Some(Scattered { density, .. }), LightSampling::Both) => power_heuristic(density, emitted.density),
        };
        self.contribute(emitted.light, self.throughput * emitted.radiance * weight);
    }

    /// Samples an emitter and adds its light if nothing is in between.
    fn add_sampled(&mut self, bsdf: &Bsdf, place: &SurfaceHit, scatterings: u32) {
        if bsdf.is_delta() || self.settings.light_sampling == LightSampling::Bsdf {
            return;
        }
        let [a, b, c, _] = self.sampler.set(1 + 2 * scatterings);
        let world = self.world;
        let opacity = |place: &SurfaceHit| world.opacity_at(place);
        let Some(light) = world.emitters().sample(place.position, [a, b, c], opacity) else { return };
        let (value, density) = bsdf.evaluate(light.direction);
        if value == Vec3::ZERO {
            return;
        }
        let shadow = match &light.place {
            Some(there) => place.spawn_to(there),
            None => Some(place.spawn(light.direction)),
        };
        self.counts.shadow_rays += 1;
        if shadow.is_none_or(|ray| world.occluded(&ray, || self.sampler.salt(2 * scatterings + 1))) {
            return;
        }
        let weight = match self.settings.light_sampling {
            LightSampling::Emitters => 1.0,
            _ => power_heuristic(light.density, density),
        };
        self.contribute(light.light, self.throughput * value * light.radiance * (weight / light.density));
    }

    /// The ray that the path goes on with. Roulette stops paths with a fixed probability, whatever they carry: so the
    /// length of paths follows from geometry alone.
    fn scatter(&mut self, bsdf: &Bsdf, place: &SurfaceHit, scatterings: u32) -> Option<Ray> {
        let [a, b, c, roulette] = self.sampler.set(2 + 2 * scatterings);
        if scatterings >= self.settings.roulette_start {
            if roulette >= self.settings.roulette_survival {
                return None;
            }
            self.throughput /= self.settings.roulette_survival;
        }
        let sample = bsdf.sample([a, b, c])?;
        self.throughput *= sample.weight;
        if self.throughput == Vec3::ZERO {
            return None;
        }
        self.scattered = Some(Scattered { from: place.position, density: sample.density, delta: sample.delta });
        Some(place.spawn(sample.wi))
    }

    fn contribute(&mut self, light: LightIndex, value: Vec3) {
        if value.is_finite() {
            (self.add)(light, value);
        } else {
            debug_assert!(false, "a path found {value} from light {}", light.0);
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
