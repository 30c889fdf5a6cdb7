//! The wide views of a recipe: novel views from other places than the input view's.

use std::ops::RangeInclusive;

use mateval_scene::ViewId;
use serde::Deserialize;

use super::fault::RecipeFault;

/// Number of wide views of a scene that may be drawn.
const COUNTS: RangeInclusive<u32> = 1..=16;
/// Distances from the input camera that may be asked for, in metres: less is no other place, more is another room.
const DISTANCES_M: RangeInclusive<f64> = 0.05..=10.0;

/// The wide views of every scene of a recipe.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "WideWords")]
pub enum WideViews {
    /// Drawn in each scene.
    Drawn(DrawnViews),
    /// At the same offsets in each scene.
    Given(Vec<WideOffset>),
}

/// Wide views that are drawn until they stand in free space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnViews {
    /// Their number.
    pub count: u32,
    /// The distances of the first and the last from the input camera, in metres; those of the others lie evenly in between.
    pub distance_m: [f64; 2],
    /// The seed of the draw.
    pub seed: u64,
}

/// A wide view at a given place. It looks at the same point as all wide views.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WideOffset {
    /// The view's id, which begins with `wide_`.
    pub id: ViewId,
    /// Metres along the input camera's own axes: right, up, and away from what it looks at.
    pub offset_m: [f64; 3],
}

/// The keys as they are in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WideWords {
    count: Option<u32>,
    distance_m: Option<[f64; 2]>,
    seed: Option<u64>,
    views: Option<Vec<WideOffset>>,
}

/// The keys fit together in neither of the two ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("wide: expected {{ count, distance_m }} (with or without seed), or {{ views }}")]
struct UnfitKeys;

impl TryFrom<WideWords> for WideViews {
    type Error = UnfitKeys;

    fn try_from(words: WideWords) -> Result<Self, UnfitKeys> {
        match words {
            WideWords { count: Some(count), distance_m: Some(distance_m), seed, views: None } => {
                Ok(Self::Drawn(DrawnViews { count, distance_m, seed: seed.unwrap_or(0) }))
            }
            WideWords { count: None, distance_m: None, seed: None, views: Some(views) } => Ok(Self::Given(views)),
            _ => Err(UnfitKeys),
        }
    }
}

impl WideViews {
    /// Adds a fault for every number that is out of range.
    pub(super) fn check(&self, faults: &mut Vec<RecipeFault>) {
        match self {
            Self::Drawn(DrawnViews { count, distance_m: [near, far], .. }) => {
                if !COUNTS.contains(count) {
                    faults.push(RecipeFault::WideCount { found: *count, least: *COUNTS.start(), most: *COUNTS.end() });
                }
                if !(DISTANCES_M.contains(near) && DISTANCES_M.contains(far) && near <= far) {
                    let (least, most) = DISTANCES_M.into_inner();
                    faults.push(RecipeFault::WideDistance { found: [*near, *far], least, most });
                }
            }
            Self::Given(views) => {
                for WideOffset { id, offset_m } in views {
                    let distance = glam::DVec3::from_array(*offset_m).length();
                    if !DISTANCES_M.contains(&distance) {
                        let (least, most) = DISTANCES_M.into_inner();
                        faults.push(RecipeFault::WideOffset { id: id.clone(), found: *offset_m, least, most });
                    }
                    if !id.is_wide() {
                        faults.push(RecipeFault::WideId { id: id.clone() });
                    }
                }
            }
        }
    }

    /// The ids of views whose places are given.
    pub(super) fn given_ids(&self) -> impl Iterator<Item = &ViewId> {
        let given = match self {
            Self::Drawn(_) => &[],
            Self::Given(views) => views.as_slice(),
        };
        given.iter().map(|view| &view.id)
    }
}
