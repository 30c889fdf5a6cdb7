//! Squared errors of pixels, summed by instance.

use std::collections::BTreeMap;

use mateval_image::{Mask, Picture};
use mateval_scene::dataset::SceneFile;

use crate::result::InstancePixelErrors;
use crate::result_key::{PictureKind, Views};

/// Sums of squared errors of a scene's pixels by picture, views and instance.
#[derive(Clone, Debug, Default)]
pub struct InstanceErrors(BTreeMap<(PictureKind, Views, u16), (f64, usize)>);

impl InstanceErrors {
    /// Adds `error(k)`, a mean over channels, of every pixel k in the mask to the instance that it shows.
    pub fn add(
        &mut self,
        picture: PictureKind,
        views: Views,
        instances: &Picture<u16>,
        mask: &Mask,
        error: impl Fn(usize) -> f64,
    ) {
        let mut sums: BTreeMap<u16, (f64, usize)> = BTreeMap::new();
        for (pixel, instance) in instances.pixels().iter().enumerate().filter(|(pixel, _)| mask.pixels()[*pixel]) {
            let (sum, count) = sums.entry(*instance).or_default();
            *sum += error(pixel);
            *count += 1;
        }
        for (instance, (sum, count)) in sums {
            let all = self.0.entry((picture, views, instance)).or_default();
            all.0 += sum;
            all.1 += count;
        }
    }

    /// Adds the sums of other views.
    pub fn extend_where(&mut self, other: Self, is_wanted: impl Fn(Views) -> bool) {
        self.0.extend(other.0.into_iter().filter(|((_, views, _), _)| is_wanted(*views)));
    }

    /// The means, by picture, views and index. Pixels that show no instance are left out.
    pub fn finish(self, scene: &SceneFile) -> Vec<InstancePixelErrors> {
        let means = self.0.into_iter().filter_map(|((picture, views, index), (sum, pixels))| {
            let instance = scene.instances.iter().find(|instance| instance.index.0.get() == index)?;
            Some(InstancePixelErrors {
                scene: scene.id.clone(),
                instance: instance.id.clone(),
                category: instance.listed_category().map(str::to_owned),
                super_category: instance.listed_super_category().map(str::to_owned),
                picture,
                views,
                pixels,
                mse: sum / pixels as f64,
            })
        });
        means.collect()
    }
}
