//! Means of a result: of pictures to scenes and of scenes to the dataset.

use std::collections::BTreeMap;

use mateval_dataset::SceneId;
use mateval_metrics::Psnr;

use crate::metric::{Metric, PictureKind};
use crate::result::key::{ResultKey, Views};
use crate::result::{InstanceTexelErrors, PictureValues};

/// The means of each scene, over its pictures and over its texels weighted by area, and the means of the dataset over
/// its scenes. A mean skips missing values; the dataset's mean of a key skips scenes without a value of that key.
pub fn means(
    pictures: &[PictureValues],
    texels: &[InstanceTexelErrors],
) -> (BTreeMap<SceneId, BTreeMap<ResultKey, f64>>, BTreeMap<ResultKey, f64>) {
    let of_picture = |picture: &PictureValues| {
        let key = |metric: &Metric| (picture.scene.clone(), picture.key(*metric));
        picture.values.iter().map(|(metric, value)| (key(metric), *value)).collect::<Vec<_>>()
    };
    let mut scenes: BTreeMap<SceneId, BTreeMap<ResultKey, f64>> = BTreeMap::new();
    for ((scene, key), mean) in means_of(pictures.iter().flat_map(of_picture)).into_iter().chain(texel_means(texels)) {
        scenes.entry(scene).or_default().insert(key, mean);
    }
    let summary = means_of(scenes.values().flatten().map(|(key, value)| (*key, *value)));
    (scenes, summary)
}

/// The mean of each key's values, which are summed in their order.
fn means_of<K: Ord>(values: impl Iterator<Item = (K, f64)>) -> BTreeMap<K, f64> {
    let mut sums: BTreeMap<K, (f64, usize)> = BTreeMap::new();
    for (key, value) in values {
        let (sum, count) = sums.entry(key).or_default();
        *sum += value;
        *count += 1;
    }
    sums.into_iter().map(|(key, (sum, count))| (key, sum / count as f64)).collect()
}

/// For each scene, of observed and of unobserved texels: the mean squared error weighted by area, and its PSNR.
fn texel_means(texels: &[InstanceTexelErrors]) -> Vec<((SceneId, ResultKey), f64)> {
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
    let of = |((scene, key), [sum, area]): ((SceneId, ResultKey), [f64; 2])| {
        let psnr = Psnr::from_mse(sum / area).ok()?;
        Some([((scene.clone(), key), sum / area), ((scene, key.with(Metric::Psnr)), psnr.db)])
    };
    sums.into_iter().filter_map(of).flatten().collect()
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
        let (scene, view) = (SceneId::new(scene).unwrap(), ViewId::new(view).unwrap());
        let picture = PictureValues::new(scene, view, PictureName::whole(PictureKind::Albedo), region, 1);
        PictureValues { values: value.map(|value| (Metric::Psnr, value)).into_iter().collect(), ..picture }
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
