//! What is assumed of surfaces while light is split.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Picture};
use mateval_tracer::{AssumedSurfaces, RenderSettings};

use super::part_room::PartRoom;
use super::part_surfaces::NO_PART;

/// The colour of parts before anything is known of them, linear.
const USUAL_COLOR: f32 = 0.45;

/// The perceptual roughness of surfaces of which nothing is known: the format's default.
pub(super) const USUAL_ROUGHNESS: f32 = 0.5;
/// Scatterings after which a path ends: the light of longer ones depends on assumed colours most.
const MOST_BOUNCES: u32 = 8;

/// What is known of the surfaces of the room.
pub(super) struct Surfaces {
    /// The linear base colour of each.
    pub(super) colors: Vec<[f32; 3]>,
    /// The perceptual roughness of each.
    pub(super) roughnesses: Vec<f32>,
    /// Whether each is a metal.
    pub(super) metals: Vec<bool>,
}

impl Surfaces {
    /// `count` surfaces of which nothing is known.
    pub(super) fn unknown(count: usize) -> Self {
        Self {
            colors: vec![[USUAL_COLOR; 3]; count],
            roughnesses: vec![USUAL_ROUGHNESS; count],
            metals: vec![false; count],
        }
    }

    pub(super) fn assumed(&self) -> AssumedSurfaces<'_> {
        AssumedSurfaces { colors: &self.colors, roughnesses: &self.roughnesses, metals: &self.metals }
    }
}

/// The settings of a pass.
pub(super) fn settings(samples: u32, seed: u64) -> RenderSettings {
    RenderSettings { samples, seed, max_bounces: MOST_BOUNCES, ..RenderSettings::default() }
}

/// The colour of each surface: the median of its pixels. One that is not seen takes the median of those of its
/// instance, else the mean grey of all that are seen.
pub(super) fn part_colors(room: &PartRoom, base_color: &Picture<LinearRgb>) -> Vec<[f32; 3]> {
    let mut of_part: BTreeMap<usize, Vec<[f32; 3]>> = BTreeMap::new();
    let mut of_owner: BTreeMap<usize, Vec<[f32; 3]>> = BTreeMap::new();
    for ((part, color), _) in
        { room.parts.pixels().iter().zip(base_color.pixels()) }.zip(room.valid.pixels()).filter(|(_, valid)| **valid)
    {
        debug_assert!(*part != NO_PART, "valid pixels have a part");
        of_part.entry(usize::from(*part)).or_default().push(color.0);
        of_owner.entry(room.owners[usize::from(*part)]).or_default().push(color.0);
    }
    let medians = |all: BTreeMap<usize, Vec<[f32; 3]>>| -> BTreeMap<usize, [f32; 3]> {
        all.into_iter().map(|(at, mut colors)| (at, median(&mut colors))).collect()
    };
    let (of_part, of_owner) = (medians(of_part), medians(of_owner));
    let grey = match of_part.len() {
        0 => USUAL_COLOR,
        seen => of_part.values().flatten().sum::<f32>() / (3 * seen) as f32,
    };
    let color = |(surface, owner)| of_part.get(&surface).or(of_owner.get(owner)).copied().unwrap_or([grey; 3]);
    room.owners.iter().enumerate().map(color).collect()
}

fn median(colors: &mut [[f32; 3]]) -> [f32; 3] {
    let middle = colors.len() / 2;
    [0, 1, 2].map(|channel| {
        let (_, value, _) = colors.select_nth_unstable_by(middle, |a, b| a[channel].total_cmp(&b[channel]));
        value[channel]
    })
}
