//! By how much the estimate differs from a part's material near a place that the input view does not show.
//!
//! A material continues a pattern. What remains of the estimate, such as a stain, wear or light that was not taken out,
//! changes slowly. This residual at a place is estimated by the mean of the residuals of the nearest seen points,
//! weighted by their distance (Nadaraya 1964, Watson 1964) and drawn to 0 where none is near.

use glam::DVec3;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::part_material::PartMaterial;
use super::part_samples::{PartSamples, Sample};
use crate::estimate::{GivenMaps, Values};

/// The number of points that are averaged.
const NEIGHBOURS: usize = 32;

/// The distance, in metres, at which a point has a quarter of its weight.
const REACH_METRES: f64 = 0.15;

/// The weight of a residual of 0, in points of full weight.
const PRIOR: f64 = 0.1;

/// A point with the difference of base colours, estimate less material, linear.
type Point = GeomWithData<[f32; 3], [f32; 3]>;

/// The residuals at the points of a part.
pub(super) struct Residuals(RTree<Point>);

impl Residuals {
    /// The residuals at all samples of a part.
    pub(super) fn new(part: &PartSamples, material: &PartMaterial, given: GivenMaps) -> Self {
        let shown = material.at(&part.places(), given);
        let point = |(sample, shown): (&Sample, Values)| {
            let difference = std::array::from_fn(|channel| sample.values[channel] - shown[channel]);
            GeomWithData::new(sample.position.as_vec3().to_array(), difference)
        };
        Self(RTree::bulk_load(part.samples.iter().zip(shown).map(point).collect()))
    }

    /// The residual to be expected at a place in world space.
    pub(super) fn at(&self, place: DVec3) -> [f32; 3] {
        let (mut sum, mut total) = ([0.0_f64; 3], PRIOR);
        let nearest = self.0.nearest_neighbor_iter_with_distance_2(&place.as_vec3().to_array());
        for (point, distance_2) in nearest.take(NEIGHBOURS) {
            let weight = (1.0 + f64::from(distance_2) / REACH_METRES.powi(2)).powi(-2);
            sum.iter_mut().zip(point.data).for_each(|(sum, value)| *sum += weight * f64::from(value));
            total += weight;
        }
        sum.map(|sum| (sum / total) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Near seen points the residual is theirs, far away it is 0.
    #[test]
    fn residuals_fade() {
        let point =
            |at: u16| GeomWithData::new([f32::from(at % 16) * 0.01, f32::from(at / 16) * 0.01, 0.0], [0.1, -0.2, 0.0]);
        let residuals = Residuals(RTree::bulk_load((0..256).map(point).collect()));
        let near = residuals.at(DVec3::new(0.08, 0.08, 0.0));
        assert!((near[0] - 0.1).abs() < 0.002 && (near[1] + 0.2).abs() < 0.003 && near[2] == 0.0, "{near:?}");
        let [closer, farther] = [0.5, 5.0].map(|x| residuals.at(DVec3::new(x, 0.0, 0.0))[0]);
        assert!(near[0] > closer && closer > 0.05 && farther < 0.005, "{closer} {farther}");
        assert_eq!(Residuals(RTree::new()).at(DVec3::ZERO), [0.0; 3]);
    }
}
