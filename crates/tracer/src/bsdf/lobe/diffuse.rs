//! Matt surfaces: the models of Lambert and of Oren and Nayar.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI};

use glam::Vec3;

use crate::bsdf::sample::LocalSample;
use crate::sampling;

/// Lambert's diffuse reflection.
pub(crate) fn lambert(reflectance: Vec3, wi: Vec3) -> Vec3 {
    reflectance * (FRAC_1_PI * wi.z)
}

/// Oren and Nayar, "Generalization of Lambert's Reflectance Model" (SIGGRAPH 1994), section 4.4, with interreflection.
/// As in Mitsuba 0.6's `roughdiffuse`, the standard deviation of the slope is `alpha` / sqrt(2).
pub(crate) fn oren_nayar(reflectance: Vec3, alpha: f32, wo: Vec3, wi: Vec3) -> Vec3 {
    let s2 = 0.5 * alpha * alpha;
    let (theta_o, theta_i) = (angle(wo), angle(wi));
    let (larger, smaller) = (theta_o.max(theta_i), theta_o.min(theta_i));
    let flat = (wo.truncate().length() * wi.truncate().length()).max(1e-12);
    let cos_phi = (wo.truncate().dot(wi.truncate()) / flat).clamp(-1.0, 1.0);
    let slope = 2.0 * smaller * FRAC_1_PI;
    // Direct illumination.
    let c1 = 1.0 - 0.5 * s2 / (s2 + 0.33);
    let behind = if cos_phi >= 0.0 { 0.0 } else { slope * slope * slope };
    let c2 = 0.45 * s2 / (s2 + 0.09) * (libm::sinf(larger) - behind);
    let product = 4.0 * larger * smaller * FRAC_1_PI * FRAC_1_PI;
    let c3 = 0.125 * s2 / (s2 + 0.09) * product * product;
    let tan = |angle: f32| libm::tanf(angle.min(FRAC_PI_2 - 1e-4));
    let direct = c1 + cos_phi * c2 * tan(smaller) + (1.0 - cos_phi.abs()) * c3 * tan(0.5 * (larger + smaller));
    // Interreflection between facets.
    let between = 0.17 * s2 / (s2 + 0.13) * (1.0 - cos_phi * slope * slope);
    (reflectance * direct + reflectance * reflectance * between) * (FRAC_1_PI * wi.z)
}

fn angle(w: Vec3) -> f32 {
    libm::acosf(w.z.clamp(0.0, 1.0))
}

/// Samples a direction with a density proportional to the cosine; `value_at` evaluates it.
pub(crate) fn sample(u: [f32; 2], value_at: impl Fn(Vec3) -> Vec3) -> Option<LocalSample> {
    let wi = sampling::cosine_hemisphere(u);
    (wi.z > 0.0).then(|| LocalSample::spread(wi, value_at(wi), wi.z / PI))
}
