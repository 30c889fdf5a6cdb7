//! Squared errors of instances pooled by category, over all scenes.

use std::collections::BTreeMap;

use mateval_metrics::Psnr;

use super::Grouping;
use super::rows::Value;
use mateval_eval::result::InstancePixelErrors;

/// The group of instances without a category.
pub(super) const OTHER: &str = "other";

/// By category, then by `<picture>.<views>.<metric>`: `pixels`, the mean squared error over all of them, and its PSNR.
///
/// Every pixel weighs the same, whatever scene, view and instance it is of: unlike the other tables' this PSNR is that of a
/// mean. It is missing where the error, freed of noise, is not above 0.
pub(crate) fn pooled(instances: &[InstancePixelErrors], by: Grouping) -> BTreeMap<String, BTreeMap<String, Value>> {
    let mut sums: BTreeMap<(String, String), (f64, usize)> = BTreeMap::new();
    for errors in instances.iter().filter(|errors| errors.pixels > 0) {
        let category = if by == Grouping::SuperCategory { &errors.super_category } else { &errors.category };
        let category = category.clone().unwrap_or_else(|| OTHER.to_owned());
        let sum = sums.entry((category, format!("{}.{}", errors.picture, errors.views))).or_default();
        sum.0 += errors.mse * errors.pixels as f64;
        sum.1 += errors.pixels;
    }
    let mut pooled: BTreeMap<String, BTreeMap<String, Value>> = BTreeMap::new();
    for ((category, key), (sum, pixels)) in sums {
        let values = pooled.entry(category).or_default();
        let mut add = |metric: &str, value: f64| {
            values.insert(format!("{key}.{metric}"), Value { value, standard_error: None });
        };
        let mse = sum / pixels as f64;
        add("pixels", pixels as f64);
        add("mse", mse);
        let is_light = key.starts_with("rgb_");
        if let Some(psnr) = Psnr::from_mse(mse).ok().filter(|psnr| !(is_light && psnr.exact)) {
            add("psnr", psnr.db);
        }
    }
    pooled
}
