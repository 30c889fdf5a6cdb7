//! By how much the estimate differs from a part's material near a place that the input view does not show.
//!
//! A material continues a pattern; what it lacks, such as a stain, wear or light that is left in the estimate, changes
//! slowly. Its value at a place is the mean of that of the nearest seen points, weighted by their distance (Nadaraya 1964,
//! Watson 1964) and drawn to 0 where none is near.

use glam::DVec3;
use rstar::RTree;
use rstar::primitives::GeomWithData;

use super::part_material::PartMaterial;
use super::part_samples::PartSamples;
use crate::estimate::GivenMaps;

/// The number of points that are averaged.
const NEIGHBOURS: usize = 32;

/// The distance, in metres, at which a point has a quarter of its weight.
const REACH_METRES: f64 = 0.15;

/// The weight of no difference, in points of full weight.
const PRIOR: f64 = 0.1;

/// A point with the difference of base colours, estimate less material, linear.
type Point = GeomWithData<[f32; 3], [f32; 3]>;

/// The differences at the points of a part.
pub(super) struct Residuals(RTree<Point>);

impl Residuals {
    /// The differences at all samples of a part.
    pub(super) fn new(part: &PartSamples, material: &PartMaterial, given: GivenMaps) -> Self {
        let places: Vec<[f64; 3]> =
            part.samples.iter().map(|sample| [sample.point.u, sample.point.v, sample.point.footprint]).collect();
        let shown = material.at(&places, given);
        let point = |(sample, shown): (&super::part_samples::Sample, [f32; 5])| {
            let difference = std::array::from_fn(|channel| sample.values[channel] - shown[channel]);
            GeomWithData::new(sample.position.as_vec3().to_array(), difference)
        };
        Self(RTree::bulk_load(part.samples.iter().zip(shown).map(point).collect()))
    }

    /// The difference to be expected at a place in world space.
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
