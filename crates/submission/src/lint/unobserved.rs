//! Texels that the input picture does not show, left empty: they are scored like all others.

use std::collections::BTreeMap;

use mateval_image::Texture;
use mateval_scene::Finding;

use super::finding::warning;
use super::sight::CoarseTexel;

/// From this share of the unobserved area on one value is an empty one, where hardly anything that is observed has it.
const MOST_EMPTY: f64 = 0.5;
/// The share of the observed area that may have it all the same.
const MOST_FILLED: f64 = 0.02;

/// A colour to the last bit.
type Bits = [u32; 3];

/// Areas of an instance by what its base colour has there.
#[derive(Clone, Debug, Default)]
pub(super) struct Fill {
    /// Unobserved, then observed, in square metres.
    by_value: BTreeMap<Bits, [f64; 2]>,
}

/// What the base colour has at texels that are seen and at those that are not.
pub(super) fn fill(texels: &[CoarseTexel], base_color: &Texture) -> Fill {
    let mut fill = Fill::default();
    for texel in texels {
        let value = base_color.sample(texel.uv).map(f32::to_bits);
        fill.by_value.entry(value).or_default()[usize::from(texel.observed)] += texel.area_m2;
    }
    fill
}

/// A finding where one colour fills what is not seen, and only that. Instances that are seen nowhere, or everywhere, tell
/// nothing: some one colour is all that can be said of them.
pub(super) fn check<'a>(place: &str, fills: impl Iterator<Item = &'a Fill>) -> Option<Finding> {
    let mut by_value: BTreeMap<Bits, [f64; 2]> = BTreeMap::new();
    let mut all = [0.0; 2];
    for fill in fills {
        let areas = fill.by_value.values().fold([0.0; 2], |sum: [f64; 2], area| [sum[0] + area[0], sum[1] + area[1]]);
        if areas[0] <= 0.0 || areas[1] <= 0.0 {
            continue;
        }
        for (value, area) in &fill.by_value {
            let sum = by_value.entry(*value).or_default();
            *sum = [sum[0] + area[0], sum[1] + area[1]];
        }
        all = [all[0] + areas[0], all[1] + areas[1]];
    }
    let (value, empty) = by_value.iter().max_by(|a, b| a.1[0].total_cmp(&b.1[0]))?;
    let [unobserved, observed] = [empty[0] / all[0], empty[1] / all[1]];
    if unobserved < MOST_EMPTY || observed > MOST_FILLED {
        return None;
    }
    let [r, g, b] = value.map(f32::from_bits);
    let message = format!(
        "what the input picture does not show seems left empty: {:.0} % of that area has base colour ({r:.3}, {g:.3}, \
         {b:.3}) to the last bit, of what it shows {:.0} %",
        100.0 * unobserved,
        100.0 * observed
    );
    Some(warning("unobserved_empty", place, message, "fill every texel; those that are not seen are scored too"))
}
