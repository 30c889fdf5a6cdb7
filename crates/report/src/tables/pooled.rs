//! Squared errors of instances pooled by category, over all scenes.

use std::collections::BTreeMap;

use mateval_eval::metric::Metric;
use mateval_eval::result::InstancePixelErrors;
use mateval_eval::result_key::{PictureKind, PictureName, Views};
use mateval_metrics::Psnr;

use super::grouping::Grouping;
use super::value::{CellKey, Quantity, Value};

/// The group of instances without a category.
pub(super) const OTHER: &str = "other";

/// By category: the number of pixels, the mean squared error over all of them, and its PSNR.
///
/// Every pixel has the same weight, regardless of scene, view and instance. Unlike in the other tables, PSNR is that of
/// a mean. It is missing if the error is not above 0 after noise removal.
pub(crate) fn pooled(instances: &[InstancePixelErrors], by: Grouping) -> BTreeMap<String, BTreeMap<CellKey, Value>> {
    let mut sums: BTreeMap<(String, PictureKind, Views), (f64, usize)> = BTreeMap::new();
    for errors in instances.iter().filter(|errors| errors.pixels > 0) {
        let category = if by == Grouping::SuperCategory { &errors.super_category } else { &errors.category };
        let category = category.clone().unwrap_or_else(|| OTHER.to_owned());
        let sum = sums.entry((category, errors.picture, errors.views)).or_default();
        sum.0 += errors.mse * errors.pixels as f64;
        sum.1 += errors.pixels;
    }
    let mut pooled: BTreeMap<String, BTreeMap<CellKey, Value>> = BTreeMap::new();
    for ((category, kind, views), (sum, pixels)) in sums {
        let values = pooled.entry(category).or_default();
        let mut add = |quantity: Quantity, value: f64| {
            let key = CellKey { picture: PictureName::whole(kind), views, quantity };
            values.insert(key, Value { value, standard_error: None });
        };
        let mse = sum / pixels as f64;
        add(Quantity::Pixels, pixels as f64);
        add(Quantity::Score(Metric::Mse), mse);
        if let Some(psnr) = Psnr::from_mse(mse).ok().filter(|psnr| !(kind.is_light() && psnr.exact)) {
            add(Quantity::Score(Metric::Psnr), psnr.db);
        }
    }
    pooled
}
