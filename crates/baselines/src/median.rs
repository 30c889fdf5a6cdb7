//! Medians of an estimate over the pixels that show an instance or a category.

use std::collections::BTreeMap;

use mateval_scene::submission::GREY;

use crate::estimate::{Estimate, Values};
use crate::geometry::SceneGeometry;
use crate::seen::SeenPixels;

/// The values of an instance without any estimate: linear grey, and the format's default roughness and metallic.
pub const DEFAULT: Values = [GREY, GREY, GREY, 0.5, 0.0];

/// The median of each seen instance, and of each category.
pub struct Medians {
    of_instance: BTreeMap<usize, Values>,
    of_category: BTreeMap<String, Values>,
}

impl Medians {
    /// Collects the medians over the pixels that show an instance.
    pub fn new(geometry: &SceneGeometry<'_>, seen: &SeenPixels, estimate: &Estimate) -> Self {
        let mut of_instance: BTreeMap<usize, Vec<Values>> = BTreeMap::new();
        let mut of_category: BTreeMap<String, Vec<Values>> = BTreeMap::new();
        for (x, y, instance) in seen.shown_pixels() {
            let values = estimate.at(x, y);
            of_instance.entry(instance).or_default().push(values);
            if let Some(category) = &geometry.scene.instances[instance].category {
                of_category.entry(category.to_lowercase()).or_default().push(values);
            }
        }
        Self {
            of_instance: of_instance.into_iter().map(|(instance, mut all)| (instance, median(&mut all))).collect(),
            of_category: of_category.into_iter().map(|(category, mut all)| (category, median(&mut all))).collect(),
        }
    }

    /// The median of the instance if it is seen, else that of its category, else grey.
    pub fn of(&self, geometry: &SceneGeometry<'_>, instance: usize) -> Values {
        let category = || {
            let category = geometry.scene.instances[instance].category.as_ref()?;
            self.of_category.get(&category.to_lowercase())
        };
        self.of_instance.get(&instance).or_else(category).copied().unwrap_or(DEFAULT)
    }
}

/// The median of each value; of an even number of entries the lower of the middle two.
pub fn median(all: &mut [Values]) -> Values {
    if all.is_empty() {
        return DEFAULT;
    }
    let middle = (all.len() - 1) / 2;
    std::array::from_fn(|channel| {
        let (_, value, _) = all.select_nth_unstable_by(middle, |a, b| a[channel].total_cmp(&b[channel]));
        value[channel]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_has_its_own_median() {
        let mut all = [[3.0, 0.0, 9.0, 0.1, 1.0], [1.0, 5.0, 7.0, 0.2, 0.0], [2.0, 4.0, 8.0, 0.3, 0.0]];
        assert_eq!(median(&mut all), [2.0, 4.0, 8.0, 0.2, 0.0]);
        assert_eq!(median(&mut all[..2])[0], median(&mut [all[0], all[1]])[0]);
        assert_eq!(median(&mut []), DEFAULT);
    }
}
