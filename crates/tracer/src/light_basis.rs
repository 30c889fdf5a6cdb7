//! The light of a view, split by its source: one picture of radiance per group of lights.
//!
//! Light is linear in emission, so any other lighting by the same emitters is a weighted sum of these pictures. All of
//! them come from the same paths, since no decision along a path depends on radiance ([`crate::emitter`]).

use mateval_image::{LinearRgb, Picture};

use crate::error::{RequestFault, TracerError};

/// The pictures of one view, all of the same size: one per group of lights, or per mix of lights.
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
    use super::*;

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
