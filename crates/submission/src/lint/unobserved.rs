//! Texels that the input picture does not show, and that the submission leaves empty. They are scored like all others.

use std::collections::BTreeMap;

use mateval_image::Texture;
use mateval_scene::Finding;

use super::finding::warning;
use super::sight::CoarseTexel;

/// A single value on this share of the unobserved area counts as empty, unless the observed area has it too.
const MOST_EMPTY: f64 = 0.5;
/// The largest share of the observed area that may have that value.
const MOST_FILLED: f64 = 0.02;

/// The bits of a colour.
type Bits = [u32; 3];

/// The area of an instance by base colour.
#[derive(Clone, Debug, Default)]
pub(super) struct Fill {
    /// Unobserved, then observed, in square metres.
    by_value: BTreeMap<Bits, [f64; 2]>,
}

/// The base colour of observed and of unobserved texels.
pub(super) fn fill(texels: &[CoarseTexel], base_color: &Texture) -> Fill {
    let mut fill = Fill::default();
    for texel in texels {
        let value = base_color.sample(texel.uv).map(f32::to_bits);
        fill.by_value.entry(value).or_default()[usize::from(texel.observed)] += texel.area_m2;
    }
    fill
}

/// A finding where one colour fills the unobserved area, and only that. Instances that are observed nowhere or
/// everywhere do not count: for the former, a single colour is a legitimate answer.
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
        "the area that the input picture does not show seems left empty: {:.0} % of it has exactly the base colour ({r:.3}, \
         {g:.3}, {b:.3}), and {:.0} % of the area that it shows",
        100.0 * unobserved,
        100.0 * observed
    );
    Some(warning("unobserved_empty", place, message, "fill every texel; unobserved ones are scored too"))
}
