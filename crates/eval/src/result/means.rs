//! Means of a result: of pictures to scenes and of scenes to the dataset.

use std::collections::BTreeMap;

use mateval_dataset::SceneId;
use mateval_metrics::Psnr;

use crate::result::key::{Metric, PictureKind, ResultKey, Views};
use crate::result::{InstanceTexelErrors, PictureValues};

/// The means of each scene, over its pictures and over its texels weighted by area, and the means of the dataset over
/// its scenes. A mean skips missing values; the dataset's mean of a key skips scenes without a value of that key.
pub fn means(
    pictures: &[PictureValues],
    texels: &[InstanceTexelErrors],
) -> (BTreeMap<SceneId, BTreeMap<ResultKey, f64>>, BTreeMap<ResultKey, f64>) {
    let mut of_scene: BTreeMap<SceneId, BTreeMap<ResultKey, Mean>> = BTreeMap::new();
    for picture in pictures {
        for (metric, value) in &picture.values {
            of_scene.entry(picture.scene.clone()).or_default().entry(picture.key(*metric)).or_default().add(*value);
        }
    }
    let mut scenes: BTreeMap<SceneId, BTreeMap<ResultKey, f64>> = of_scene
        .into_iter()
        .map(|(scene, keys)| (scene, keys.into_iter().map(|(key, mean)| (key, mean.value())).collect()))
        .collect();
    for (scene, values) in texel_means(texels) {
        scenes.entry(scene).or_default().extend(values);
    }
    let mut of_dataset: BTreeMap<ResultKey, Mean> = BTreeMap::new();
    for (key, value) in scenes.values().flatten() {
        of_dataset.entry(*key).or_default().add(*value);
    }
    let summary = of_dataset.into_iter().map(|(key, mean)| (key, mean.value())).collect();
    (scenes, summary)
}

/// For each scene, of observed and of unobserved texels: the mean squared error weighted by area, and its PSNR.
fn texel_means(texels: &[InstanceTexelErrors]) -> BTreeMap<SceneId, BTreeMap<ResultKey, f64>> {
    let mut sums: BTreeMap<(SceneId, ResultKey), [f64; 2]> = BTreeMap::new();
    for instance in texels {
        for (views, errors) in [(Views::Observed, &instance.observed), (Views::Unobserved, &instance.unobserved)] {
            let Some(mse) = errors.base_color_mse else { continue };
            let key = ResultKey::whole(PictureKind::TextureBaseColor, views, Metric::Mse);
            let sums = sums.entry((instance.scene.clone(), key)).or_default();
            sums[0] += errors.area_m2 * mse;
            sums[1] += errors.area_m2;
        }
    }
    let mut means: BTreeMap<SceneId, BTreeMap<ResultKey, f64>> = BTreeMap::new();
    for ((scene, key), [sum, area]) in sums {
        let values = means.entry(scene).or_default();
        let mse = sum / area;
        if let Ok(psnr) = Psnr::from_mse(mse) {
            values.insert(key, mse);
            values.insert(key.with(Metric::Psnr), psnr.db);
        }
    }
    means
}

/// The standard error of the dataset's mean of each key, where every scene with a value has one. The noise of different
/// scenes is independent. `scenes` are the scenes' means.
pub fn summary_noise(
    noise: &BTreeMap<SceneId, BTreeMap<ResultKey, f64>>,
    scenes: &BTreeMap<SceneId, BTreeMap<ResultKey, f64>>,
) -> BTreeMap<ResultKey, f64> {
    let mut sums: BTreeMap<ResultKey, (usize, f64)> = BTreeMap::new();
    for (key, error) in noise.values().flatten() {
        let (count, squares) = sums.entry(*key).or_default();
        *count += 1;
        *squares += error * error;
    }
    let valued = |key: &ResultKey| scenes.values().filter(|values| values.contains_key(key)).count();
    let whole = sums.into_iter().filter(|(key, (count, _))| *count == valued(key));
    whole.map(|(key, (count, squares))| (key, squares.sqrt() / count as f64)).collect()
}

#[derive(Default)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    fn value(&self) -> f64 {
        self.sum / self.count as f64
    }
}

#[cfg(test)]
mod tests {
    use mateval_dataset::{InstanceId, ViewId};

    use crate::result::TexelErrors;
    use crate::result::key::{PictureName, Region};

    use super::*;

    fn key(text: &str) -> ResultKey {
        text.parse().unwrap()
    }

    fn value(scene: &str, view: &str, region: Region, value: Option<f64>) -> PictureValues {
        PictureValues {
            scene: SceneId::new(scene).unwrap(),
            view: ViewId::new(view).unwrap(),
            picture: PictureName::whole(PictureKind::Albedo),
            lighting: None,
            region,
            pixels: 1,
            values: value.map(|value| (Metric::Psnr, value)).into_iter().collect(),
            mse_error: None,
            exact: false,
            lower_bound: false,
        }
    }

    /// Two instances of 1 and 3 square metres.
    #[test]
    fn texels_count_by_area() {
        let texels = |name: &str, area_m2: f64, mse: f64| InstanceTexelErrors {
            scene: SceneId::new("a").unwrap(),
            instance: InstanceId::new(name).unwrap(),
            observed: TexelErrors { area_m2, base_color_mse: Some(mse) },
            unobserved: TexelErrors::default(),
        };
        let (scenes, summary) = means(&[], &[texels("x", 1.0, 0.04), texels("y", 3.0, 0.0)]);
        assert!((summary[&key("texture_base_color.observed.mse")] - 0.01).abs() < 1e-15);
        assert!((summary[&key("texture_base_color.observed.psnr")] - 20.0).abs() < 1e-12);
        assert_eq!(scenes.values().next().map(BTreeMap::len), Some(2));
    }

    /// Without the error of one scene, that of the mean is not known.
    #[test]
    fn noise_of_scenes_is_independent() {
        let key = key("rgb_true.input.psnr");
        let scene = |name: &str, error| (SceneId::new(name).unwrap(), BTreeMap::from([(key, error)]));
        let scenes = BTreeMap::from([scene("a", 20.0), scene("b", 25.0)]);
        let both = BTreeMap::from([scene("a", 0.03), scene("b", 0.04)]);
        assert!((summary_noise(&both, &scenes)[&key] - 0.025).abs() < 1e-15);
        assert!(summary_noise(&BTreeMap::from([scene("a", 0.1)]), &scenes).is_empty());
    }

    /// Scene a has two novel views, scene b one: each scene weighs the same.
    #[test]
    fn pictures_then_scenes() {
        let all = [
            value("a", "up_left", Region::Valid, Some(10.0)),
            value("a", "up_right", Region::Valid, Some(20.0)),
            value("b", "up_left", Region::Valid, Some(35.0)),
            value("a", "up_left", Region::Unobserved, None),
            value("a", "input", Region::Valid, Some(1.0)),
        ];
        let (scenes, summary) = means(&all, &[]);
        assert_eq!(summary[&key("albedo.novel.psnr")], 25.0);
        assert_eq!(summary[&key("albedo.input.psnr")], 1.0);
        assert!(!summary.contains_key(&key("albedo.unobserved.psnr")));
        assert_eq!(scenes[&SceneId::new("a").unwrap()][&key("albedo.novel.psnr")], 15.0);
    }
}
