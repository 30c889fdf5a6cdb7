//! Relative slopes: how fast the value of a BSDF changes with its base colour, over that value, per channel.
//!
//! Each channel of a value depends on the same channel of the base colour alone: the reflectance of diffuse surfaces,
//! the `diffuse_reflectance` of plastic, the `base_color` of principled materials. Conductors and dielectrics have no
//! base colour, and the delta lobe of plastic does not depend on it: their slopes are zero.

use glam::Vec3;

use super::lobe::Lobe;
use super::{Bsdf, BsdfSample};

impl<const K: usize> Bsdf<'_, K> {
    /// The relative slope of [`Self::evaluate_all`] towards `wi`, for the first base colour.
    pub(crate) fn relative_slope(&self, wi: Vec3) -> Vec3 {
        self.local_slope(self.frame.local_from_world(wi))
    }

    /// [`Self::sample`], with the relative slope of the weight for the first base colour.
    pub(crate) fn sample_with_slope(&self, u: [f32; 3]) -> Option<(BsdfSample<K>, Vec3)> {
        let (local, sample) = self.sample_locally(u)?;
        let slope = if sample.delta { Vec3::ZERO } else { self.local_slope(local) };
        Some((sample, slope))
    }

    /// The relative slope for a direction in the frame. The value is computed as for the path, so that a narrow
    /// highlight divides by itself.
    fn local_slope(&self, local: Vec3) -> Vec3 {
        let (slope, value) = match (&self.principled, &self.lobe) {
            (Some(variants), Lobe::Principled(principled)) => variants.first_slope(principled.base_color, local),
            (_, lobe) => (lobe.slope(self.wo, local), lobe.eval(self.wo, local)),
        };
        let quotient = |slope: f32, value: f32| if value == 0.0 { 0.0 } else { slope / value };
        Vec3::new(quotient(slope.x, value.x), quotient(slope.y, value.y), quotient(slope.z, value.z))
    }
}
