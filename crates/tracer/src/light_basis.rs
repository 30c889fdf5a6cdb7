//! The light of a view, split by its source: one picture of radiance per group of lights.
//!
//! Light is linear in emission, so any other lighting by the same emitters is a weighted sum of these pictures. All of
//! them come from the same paths, since no decision along a path depends on radiance ([`crate::emitter`]).

use mateval_dataset::Camera;
use mateval_dataset::reference::LightIndex;
use mateval_image::{LinearRgb, Picture};

use crate::error::{ExceededLimit, RequestFault, TracerError};

/// An assignment of lights to pictures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LightGroups {
    groups: Vec<Vec<LightIndex>>,
    /// For each light, its index in `groups`.
    group_of: Vec<usize>,
}

/// The default limit on the memory of a light basis: 2 GiB, which holds two halves of five views of 480 x 270 pixels
/// with 138 lights.
pub const DEFAULT_BASIS_BYTES: u64 = 2 << 30;

/// Bytes of one pixel of one picture.
const PIXEL_BYTES: u64 = size_of::<LinearRgb>() as u64;

impl LightGroups {
    /// All of `lights` lights in one picture, as in a plain render.
    pub fn together(lights: usize) -> Self {
        Self::runs(lights, 1)
    }

    /// Each of `lights` lights in its own picture.
    pub fn apart(lights: usize) -> Self {
        Self::runs(lights, lights)
    }

    /// Each light in its own picture, if all pictures for `halves` halves of the cameras' views fit in `bytes`. If not,
    /// lights that are neighbours in the scene's list share pictures, in as many groups of nearly equal size as fit
    /// ([`Self::is_merged`]).
    ///
    /// The limit counts finished pictures, 12 bytes a pixel. Unfinished tiles add about 60 kB per view, group and
    /// thread, or more in views whose pixels are finer than those of the first view. Fails if a single group is too
    /// large.
    pub fn within(bytes: u64, lights: usize, cameras: &[Camera], halves: usize) -> Result<Self, TracerError> {
        let pixels = |camera: &Camera| u64::from(camera.intrinsics.width) * u64::from(camera.intrinsics.height);
        let group_bytes = PIXEL_BYTES * halves as u64 * cameras.iter().map(pixels).sum::<u64>();
        let room = bytes.checked_div(group_bytes).map_or(lights, |room| room.min(lights as u64) as usize);
        if room == 0 && lights > 0 {
            return Err(ExceededLimit::BasisBytes { halves, views: cameras.len(), group_bytes, allowed: bytes }.into());
        }
        Ok(Self::runs(lights, room))
    }

    /// `lights` in `count` runs whose lengths differ by at most one, the longer ones first.
    fn runs(lights: usize, count: usize) -> Self {
        let count = count.min(lights);
        let mut groups = vec![Vec::new(); count];
        let group_of: Vec<usize> = (0..lights).map(|light| run_of(light, lights, count)).collect();
        for (light, &group) in group_of.iter().enumerate() {
            groups[group].push(LightIndex(light));
        }
        Self { groups, group_of }
    }

    /// The lights of each group, in the order of the pictures.
    pub fn groups(&self) -> &[Vec<LightIndex>] {
        &self.groups
    }

    /// Whether any group holds more than one light, so that their radiances can only be scaled together.
    pub fn is_merged(&self) -> bool {
        self.groups.len() < self.group_of.len()
    }

    /// The number of lights in all groups.
    pub fn lights(&self) -> usize {
        self.group_of.len()
    }

    pub(crate) fn of(&self, light: LightIndex) -> usize {
        self.group_of[light.0]
    }
}

fn run_of(light: usize, lights: usize, count: usize) -> usize {
    let (short, longer) = (lights / count, lights % count);
    let in_longer = longer * (short + 1);
    if light < in_longer { light / (short + 1) } else { longer + (light - in_longer) / short }
}

/// The pictures of one view, one per group of lights, all of the same size.
#[derive(Clone, Debug, PartialEq)]
pub struct LightBasis {
    width: usize,
    height: usize,
    pictures: Vec<Picture<LinearRgb>>,
}

impl LightBasis {
    /// `count` black pictures.
    pub(crate) fn black(width: usize, height: usize, count: usize) -> Self {
        Self { width, height, pictures: vec![Picture::filled(width, height, LinearRgb::default()); count] }
    }

    /// Takes pictures of one size. Fails if the size of one differs.
    pub fn new(width: usize, height: usize, pictures: Vec<Picture<LinearRgb>>) -> Result<Self, TracerError> {
        if let Some(other) = pictures.iter().find(|picture| (picture.width(), picture.height()) != (width, height)) {
            let found = [other.width(), other.height()];
            return Err(RequestFault::PictureSize { found, expected: [width, height] }.into());
        }
        Ok(Self { width, height, pictures })
    }

    /// Linear radiance, one picture per group.
    pub fn pictures(&self) -> &[Picture<LinearRgb>] {
        &self.pictures
    }

    pub(crate) fn pictures_mut(&mut self) -> &mut [Picture<LinearRgb>] {
        &mut self.pictures
    }

    /// The view under the scene's own radiances.
    pub fn sum(&self) -> Picture<LinearRgb> {
        self.mix(|_| [1.0; 3])
    }

    /// The view with each group's radiance scaled by its entry of `weights`, per channel. Fails unless `weights` holds
    /// one entry per group.
    pub fn weighted(&self, weights: &[[f64; 3]]) -> Result<Picture<LinearRgb>, TracerError> {
        if weights.len() != self.pictures.len() {
            let (found, expected) = (weights.len(), self.pictures.len());
            return Err(RequestFault::WeightCount { found, expected }.into());
        }
        Ok(self.mix(|group| weights[group]))
    }

    fn mix(&self, weight: impl Fn(usize) -> [f64; 3]) -> Picture<LinearRgb> {
        let mut sums = vec![[0.0_f64; 3]; self.width * self.height];
        for (group, picture) in self.pictures.iter().enumerate() {
            let weight = weight(group);
            for (sum, value) in sums.iter_mut().zip(picture.pixels()) {
                for channel in 0..3 {
                    sum[channel] += weight[channel] * f64::from(value.0[channel]);
                }
            }
        }
        Picture::from_fn(self.width, self.height, |x, y| LinearRgb(sums[y * self.width + x].map(|v| v as f32)))
    }
}

#[cfg(test)]
mod tests {
    use mateval_dataset::Intrinsics;

    use super::*;

    fn lengths(groups: &LightGroups) -> Vec<usize> {
        groups.groups().iter().map(Vec::len).collect()
    }

    fn cameras() -> Vec<Camera> {
        let intrinsics = Intrinsics::from_fov_x(100, 50, 1.0);
        vec![Camera::from_rotation(glam::DMat3::IDENTITY, glam::DVec3::ZERO, intrinsics); 5]
    }

    #[test]
    fn groups_are_runs_of_all_lights() {
        for (lights, count) in [(1, 1), (7, 3), (64, 64), (65, 64), (10, 4)] {
            let groups = LightGroups::runs(lights, count);
            assert_eq!(lengths(&groups).iter().sum::<usize>(), lights);
            assert_eq!(groups.groups().len(), count);
            let all: Vec<LightIndex> = groups.groups().concat();
            assert_eq!(all, (0..lights).map(LightIndex).collect::<Vec<_>>());
            assert!(lengths(&groups).iter().all(|&n| n == lights / count || n == lights / count + 1));
            assert!(all.iter().all(|&light| groups.groups()[groups.of(light)].contains(&light)));
        }
        assert_eq!(lengths(&LightGroups::together(0)), [0; 0]);
    }

    /// 5 views of 100 x 50 pixels in 2 halves take 600,000 bytes per group: 2.4 MB hold four groups, one byte less
    /// holds three.
    #[test]
    fn the_bound_merges_lights_and_says_so() {
        let within = |bytes| LightGroups::within(bytes, 10, &cameras(), 2);
        assert!(!within(6_000_000).unwrap().is_merged());
        assert_eq!(lengths(&within(5_999_999).unwrap()), [2, 1, 1, 1, 1, 1, 1, 1, 1]);
        assert_eq!(lengths(&within(2_400_000).unwrap()), [3, 3, 2, 2]);
        assert_eq!(lengths(&within(2_399_999).unwrap()), [4, 3, 3]);
        assert!(within(2_399_999).unwrap().is_merged());
        assert!(within(599_999).unwrap_err().to_string().contains("600000 bytes per group"));
    }

    #[test]
    fn the_default_holds_what_it_says() {
        let intrinsics = Intrinsics::from_fov_x(480, 270, 1.0);
        let cameras = vec![Camera { intrinsics, ..cameras()[0] }; 5];
        let merged = |lights| LightGroups::within(DEFAULT_BASIS_BYTES, lights, &cameras, 2).unwrap().is_merged();
        assert!(!merged(138) && merged(139));
    }

    #[test]
    fn weights_scale_groups_by_channel() {
        let flat = |value: f32| Picture::filled(2, 1, LinearRgb([value; 3]));
        let basis = LightBasis::new(2, 1, vec![flat(1.0), flat(2.0)]).unwrap();
        let mixed = basis.weighted(&[[1.0, 0.0, 0.5], [0.0, 2.0, 0.5]]).unwrap();
        assert_eq!(mixed.get(1, 0), LinearRgb([1.0, 4.0, 1.5]));
        assert_eq!(basis.sum(), basis.weighted(&[[1.0; 3]; 2]).unwrap());
        assert!(basis.weighted(&[[1.0; 3]]).is_err());
        assert!(LightBasis::new(1, 1, vec![flat(1.0)]).is_err());
    }
}
