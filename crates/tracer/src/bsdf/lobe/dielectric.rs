//! Boundaries between clear media: smooth, thin and rough.
//!
//! `eta` is the index inside over that outside; z points outside. Radiance scales with the square of the index it
//! enters. As in Mitsuba, transmitted light is therefore divided by the square of the index ratio on the way from light
//! to viewer (Veach 1997, section 5.2). A path into and out of a closed body cancels the factor.

use glam::Vec3;

use crate::bsdf::facets::{Facets, reflect};
use crate::bsdf::fresnel;
use crate::bsdf::sample::LocalSample;

/// A boundary, with tints of the light it reflects and transmits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dielectric {
    pub(crate) eta: f32,
    pub(crate) reflectance: Vec3,
    pub(crate) transmittance: Vec3,
}

impl Dielectric {
    /// The index beyond the boundary over that on the side of `wo`.
    fn relative(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// Samples a smooth boundary: the mirror direction or the refracted one, with probabilities by the Fresnel term.
    pub(crate) fn sample_smooth(&self, wo: Vec3, u: f32) -> LocalSample {
        let eta = self.relative(wo);
        let (reflected, beyond) = fresnel::dielectric(wo.z.abs(), eta);
        if u < reflected {
            return LocalSample::delta(Vec3::new(-wo.x, -wo.y, wo.z), self.reflectance, reflected);
        }
        let wi = Vec3::new(-wo.x / eta, -wo.y / eta, -beyond.copysign(wo.z)).normalize();
        LocalSample::delta(wi, self.transmittance / (eta * eta), 1.0 - reflected)
    }

    /// Samples a sheet with two boundaries: R + T^2 R / (1 - R^2) = 2 R / (1 + R) is reflected, the rest passes
    /// straight through.
    pub(crate) fn sample_thin(&self, wo: Vec3, u: f32) -> LocalSample {
        let once = fresnel::dielectric(wo.z.abs(), self.eta).0;
        let reflected = 2.0 * once / (1.0 + once);
        if u < reflected {
            return LocalSample::delta(Vec3::new(-wo.x, -wo.y, wo.z), self.reflectance, reflected);
        }
        LocalSample::delta(-wo, self.transmittance, 1.0 - reflected)
    }

    /// Walter et al. 2007, equations 20 and 21.
    pub(crate) fn eval_rough(&self, facets: &Facets, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(event) = Event::new(self.relative(wo), wo, wi) else { return Vec3::ZERO };
        let Event { wo, wi, m, eta, .. } = event;
        let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
        let reflected = fresnel::dielectric(cos_o, eta).0;
        let shape = facets.density(m) * facets.visible_from_both(wo, wi, m) / wo.z;
        if event.is_reflection() {
            return self.reflectance * (reflected * shape / 4.0);
        }
        let sum = cos_o + eta * cos_i;
        self.transmittance * ((1.0 - reflected) * shape * (cos_o * cos_i).abs() / (sum * sum))
    }

    /// The density of [`Self::sample_rough`].
    pub(crate) fn density_rough(&self, facets: &Facets, wo: Vec3, wi: Vec3) -> f32 {
        let Some(event) = Event::new(self.relative(wo), wo, wi) else { return 0.0 };
        let Event { wo, wi, m, eta, .. } = event;
        let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
        let reflected = fresnel::dielectric(cos_o, eta).0;
        let facet = facets.sample_density(wo, m);
        if event.is_reflection() {
            return reflected * facet / (4.0 * cos_o);
        }
        let sum = cos_o + eta * cos_i;
        (1.0 - reflected) * facet * eta * eta * cos_i.abs() / (sum * sum)
    }

    pub(crate) fn sample_rough(&self, facets: &Facets, wo: Vec3, u: [f32; 3]) -> Option<LocalSample> {
        let side = 1.0_f32.copysign(wo.z);
        let eta = self.relative(wo);
        let above = wo * side;
        let m = facets.sample(above, [u[1], u[2]]);
        let cos = above.dot(m);
        if cos <= 0.0 {
            return None;
        }
        let (reflected, beyond) = fresnel::dielectric(cos, eta);
        let wi = if u[0] < reflected { reflect(above, m) } else { m * (cos / eta - beyond) - above / eta };
        let goes_up = u[0] < reflected;
        let wi = wi.normalize() * side;
        let density = self.density_rough(facets, wo, wi);
        (goes_up == (wi.z * side > 0.0) && density > 0.0)
            .then(|| LocalSample::spread(wi, self.eval_rough(facets, wo, wi), density))
    }
}

/// Two directions and the facet between them, flipped so that `wo` lies above.
struct Event {
    wo: Vec3,
    wi: Vec3,
    m: Vec3,
    /// The index beyond over the index above.
    eta: f32,
}

impl Event {
    /// `None` if no facet sends one direction into the other.
    fn new(eta: f32, wo: Vec3, wi: Vec3) -> Option<Self> {
        let side = 1.0_f32.copysign(wo.z);
        let (wo, wi) = (wo * side, wi * side);
        if wo.z == 0.0 || wi.z == 0.0 {
            return None;
        }
        let m = if wi.z > 0.0 { wo + wi } else { wo + wi * eta }.try_normalize()?;
        let m = if m.z < 0.0 { -m } else { m };
        let possible = wo.dot(m) > 0.0 && wi.dot(m) * wi.z > 0.0;
        possible.then_some(Self { wo, wi, m, eta })
    }

    fn is_reflection(&self) -> bool {
        self.wi.z > 0.0
    }
}
