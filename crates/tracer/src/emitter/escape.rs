//! The share of rays that leave the scene, where its lamps shine.
//!
//! Probe walks start on the area emitters, reflect diffusely where they hit and go straight through glass. They follow from
//! geometry and opacity alone, and always use the same random numbers.

use glam::Vec3;

use crate::emitter::Emitters;
use crate::ray::SurfaceHit;
use crate::sampling;
use crate::sampling::Frame;
use crate::sampling::Sampler;

/// The number of walks, in turn from all area emitters.
const WALKS: u32 = 1024;
/// The largest number of rays of a walk. The first one leaves the lamp and does not count.
const RAYS: u32 = 5;
/// Seed of the walks.
const SEED: u64 = 0xe5_ca9e;

/// The share of rays that leave the scene, among those from surfaces on which the area emitters shine, or on which light
/// from there arrives; 1 if there are no area emitters. `first_opaque` finds the first surface in a direction that light
/// does not pass.
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
