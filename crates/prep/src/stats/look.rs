//! The look of a dataset's true albedo in its input views: colours, contrast and fineness of texture. Its distance from
//! another dataset's look compares redressed rooms with the original ones.

use mateval_dataset::dataset::DatasetVersion;
use mateval_dataset::ids::counted;
use mateval_dataset::open::Dataset;
use mateval_dataset::progress::{Table, row};
use mateval_files::untrusted::shown;
use mateval_image::{LinearRgb, Mask, Picture, exr_io, png_io};
use palette::convert::FromColorUnclamped;
use palette::{LinSrgb, Oklch};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::PrepError;

/// Number of bins of a histogram.
const BINS: usize = 32;

/// Widths of the bins, in the order of [`LookStats::quantities`]. No colour of sRGB has a chroma above 0.323, and texture
/// hardly ever a contrast above 0.32.
const BIN_WIDTHS: [f64; 5] = [1.0 / 32.0, 1.0 / 32.0, 0.01, 0.01, 1.0 / 32.0];

/// The look of the true albedo of all input views, at the pixels that are valid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LookStats {
    /// Number of input views.
    pub views: usize,
    /// Linear luminance, over pixels.
    pub luminance: LookDistribution,
    /// Oklab lightness, over pixels.
    pub lightness: LookDistribution,
    /// Oklab chroma, over pixels.
    pub chroma: LookDistribution,
    /// The standard deviation of the lightness around a pixel, among the pixels of its instance within 4 pixels; over
    /// pixels.
    pub local_contrast: LookDistribution,
    /// The share of that variance which is between neighbours, within 1 pixel; over views.
    pub fine_share: LookDistribution,
    /// The mean of `redressed.weak_area_share` over scenes that are redressed; absent if none is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weak_area_share: Option<f64>,
}

/// How the values of a quantity are distributed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LookDistribution {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub deviation: f64,
    /// The width of a bin of the histogram: 0.01 for chroma and local contrast, 1/32 for the others.
    pub bin: f64,
    /// The share of the values in each of 32 bins. The first bin begins at 0, and the last one also holds larger values.
    /// All shares are 0 if there are no values.
    pub histogram: [f64; BINS],
}

/// The look of another dataset, and how far it is from that of the dataset that was counted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Beside {
    /// The other dataset.
    pub dataset: DatasetVersion,
    /// Its look.
    pub look: LookStats,
    /// The distance of the two looks.
    pub distance: LookDistance,
}

/// The Wasserstein-1 distance of two looks in each quantity, in its unit; null where one of them has no values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LookDistance {
    /// Of the luminance.
    pub luminance: Option<f64>,
    /// Of the lightness.
    pub lightness: Option<f64>,
    /// Of the chroma.
    pub chroma: Option<f64>,
    /// Of the local contrast.
    pub local_contrast: Option<f64>,
    /// Of the fine share.
    pub fine_share: Option<f64>,
}

/// One quantity of two looks.
pub(super) struct Pair<'a> {
    pub(super) name: &'static str,
    pub(super) own: &'a LookDistribution,
    pub(super) other: &'a LookDistribution,
    /// Absent if one of the two has no values.
    pub(super) distance: Option<f64>,
}

impl LookStats {
    /// The look of another dataset beside this one; none if the ground truth of one of its scenes is withheld.
    pub fn beside(&self, original: &Dataset) -> Result<Option<Beside>, PrepError> {
        let Some(other) = look(original)? else { return Ok(None) };
        let [luminance, lightness, chroma, local_contrast, fine_share] = self.pairs(&other).map(|pair| pair.distance);
        let distance = LookDistance { luminance, lightness, chroma, local_contrast, fine_share };
        Ok(Some(Beside { dataset: original.file.named(), look: other, distance }))
    }

    pub(super) fn pairs<'a>(&'a self, other: &'a Self) -> [Pair<'a>; 5] {
        let (all, others) = (self.quantities(), other.quantities());
        std::array::from_fn(|at| {
            let ((name, own), (_, other)) = (all[at], others[at]);
            Pair { name, own, other, distance: own.distance(other) }
        })
    }

    fn quantities(&self) -> [(&'static str, &LookDistribution); 5] {
        [
            ("luminance", &self.luminance),
            ("lightness (Oklab)", &self.lightness),
            ("chroma (Oklab)", &self.chroma),
            ("local contrast", &self.local_contrast),
            ("fine share", &self.fine_share),
        ]
    }
}

impl LookDistribution {
    /// The Wasserstein-1 distance: the area between the cumulative distributions (S. S. Vallender, Theory of Probability
    /// and Its Applications 18, 1974), here of histograms whose values lie in the middle of their bins.
    fn distance(&self, other: &Self) -> Option<f64> {
        if [self, other].iter().any(|of| of.histogram.iter().all(|share| *share == 0.0)) {
            return None;
        }
        let (mut ahead, mut area) = (0.0_f64, 0.0);
        for (share, other) in self.histogram.iter().zip(&other.histogram) {
            ahead += share - other;
            area += self.bin * ahead.abs();
        }
        Some(area)
    }
}

#[derive(Default)]
struct Sums {
    count: f64,
    sum: f64,
    squares: f64,
}

impl Sums {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        self.sum += value;
        self.squares += value * value;
    }

    fn mean(&self) -> f64 {
        self.sum / self.count.max(1.0)
    }

    fn variance(&self) -> f64 {
        (self.squares / self.count.max(1.0) - self.mean().powi(2)).max(0.0)
    }
}

/// The sums of a quantity, and its values in each bin.
struct Tally {
    sums: Sums,
    bin: f64,
    counts: [f64; BINS],
}

impl Tally {
    /// An empty tally of each quantity.
    fn all() -> [Self; 5] {
        BIN_WIDTHS.map(|bin| Self { sums: Sums::default(), bin, counts: [0.0; BINS] })
    }

    fn add(&mut self, value: f64) {
        self.sums.add(value);
        // The cast saturates.
        self.counts[((value / self.bin) as usize).min(BINS - 1)] += 1.0;
    }

    fn distribution(&self) -> LookDistribution {
        let histogram = self.counts.map(|count| count / self.sums.count.max(1.0));
        LookDistribution { mean: self.sums.mean(), deviation: self.sums.variance().sqrt(), bin: self.bin, histogram }
    }
}

/// The look of a dataset; none if a scene's ground truth is withheld.
pub fn look(dataset: &Dataset) -> Result<Option<LookStats>, PrepError> {
    let mut tallies = Tally::all();
    let (mut views, mut weak) = (0, Sums::default());
    for scene in dataset.scenes.iter().filter(|scene| scene.source.kind.states_materials()) {
        let (folder, Some(view)) = (dataset.folder(&scene.id), scene.views.first()) else { continue };
        let albedo = folder.truth_view(&view.id).join("albedo.exr");
        if !albedo.exists() {
            return Ok(None);
        }
        let shown = folder.view(&view.id);
        let valid = png_io::read_mask(&shown.join("valid.png"))?;
        let instances = png_io::read_ids(&shown.join("instance.png"))?;
        add_view(&exr_io::read_linear(&albedo)?, &valid, &instances, &mut tallies);
        views += 1;
        if let Some(redressed) = &scene.redressed {
            weak.add(redressed.weak_area_share);
        }
    }
    let weak_area_share = (weak.count > 0.0).then(|| weak.mean());
    let [luminance, lightness, chroma, local_contrast, fine_share] = tallies.map(|tally| tally.distribution());
    Ok(Some(LookStats { views, luminance, lightness, chroma, local_contrast, fine_share, weak_area_share }))
}

fn add_view(albedo: &Picture<LinearRgb>, valid: &Mask, instances: &Picture<u16>, tallies: &mut [Tally; 5]) {
    let [luminance, lightness, chroma, contrast, fine_share] = tallies;
    let (width, height) = (albedo.width(), albedo.height());
    let oklch = albedo.map(|LinearRgb(rgb)| {
        let [red, green, blue] = rgb.map(f64::from);
        Oklch::from_color_unclamped(LinSrgb::new(red, green, blue))
    });
    // The variance of the lightness within a radius, among pixels of the same instance.
    let variance = |x: usize, y: usize, radius: usize| {
        let mut near = Sums::default();
        for row in y.saturating_sub(radius)..(y + radius + 1).min(height) {
            for column in x.saturating_sub(radius)..(x + radius + 1).min(width) {
                if valid.get(column, row) && instances.get(column, row) == instances.get(x, y) {
                    near.add(oklch.get(column, row).l);
                }
            }
        }
        // What rounding leaves of one colour is no contrast.
        Some(near.variance()).filter(|variance| *variance > 1e-12).unwrap_or(0.0)
    };
    let [mut fine, mut all] = [0.0; 2];
    for y in 0..height {
        for x in (0..width).filter(|x| valid.get(*x, y)) {
            let LinearRgb([red, green, blue]) = albedo.get(x, y);
            luminance.add(f64::from(0.2126 * red + 0.7152 * green + 0.0722 * blue));
            lightness.add(oklch.get(x, y).l);
            chroma.add(oklch.get(x, y).chroma);
            let [near, wide] = [1, 4].map(|radius| variance(x, y, radius));
            contrast.add(wide.sqrt());
            (fine, all) = (fine + near.min(wide), all + wide);
        }
    }
    if all > 0.0 {
        fine_share.add(fine / all);
    }
}

/// The look as a table, beside another one if there is one.
pub(super) fn table(look: &LookStats, beside: Option<&Beside>) -> Table {
    let digits = |value: f64| format!("{value:.3}");
    let mut title = format!("True albedo of {}", counted(look.views, "input view"));
    let mut rows = Vec::new();
    if let Some(Beside { dataset, look: other, .. }) = beside {
        let [name, version] = [&dataset.name, &dataset.version].map(|word| shown(word, 60));
        title += &format!(", beside {} of {name} {version}", other.views);
        rows.push(row(["", "mean", "original", "deviation", "original", "distance"]));
        rows.extend(look.pairs(other).map(|Pair { name, own, other, distance }| {
            let [mean, original, deviation, originals] =
                [own.mean, other.mean, own.deviation, other.deviation].map(digits);
            let distance = distance.map_or_else(|| "no values".to_owned(), digits);
            row([name, &mean, &original, &deviation, &originals, &distance])
        }));
    } else {
        rows.push(row(["", "mean", "deviation"]));
        rows.extend(look.quantities().map(|(name, own)| row([name, &digits(own.mean), &digits(own.deviation)])));
    }
    rows.extend(look.weak_area_share.map(|share| row(["weak area share", &digits(share)])));
    Table { title, words: 1, rows }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The look of a picture of two instances, side by side.
    fn of(color: impl Fn(usize, usize) -> f32) -> [LookDistribution; 5] {
        let albedo = Picture::from_fn(64, 32, |x, y| LinearRgb([color(x, y); 3]));
        let instances = Picture::from_fn(64, 32, |x, _| u16::from(x < 32));
        let mut tallies = Tally::all();
        add_view(&albedo, &Picture::filled(64, 32, true), &instances, &mut tallies);
        tallies.map(|tally| tally.distribution())
    }

    #[test]
    fn texture_has_contrast_and_edges_of_objects_have_none() {
        let [luminance, _, chroma, contrast, fine] = of(|x, _| if x < 32 { 0.2 } else { 0.6 });
        assert!((luminance.mean - 0.4).abs() < 1e-6 && (luminance.deviation - 0.2).abs() < 1e-6);
        assert!(chroma.mean < 1e-3 && contrast.mean < 1e-6 && fine.mean == 0.0, "{chroma:?} {contrast:?}");
        let checks = |size: usize| of(move |x, y| if (x / size + y / size).is_multiple_of(2) { 0.2 } else { 0.6 });
        let [[.., sharp, finest], [.., coarser]] = [checks(1), checks(8)];
        assert!(sharp.mean > 0.1 && finest.mean > 0.9 && coarser.mean < 0.6, "{sharp:?} {finest:?} {coarser:?}");
    }

    #[test]
    fn histograms_hold_every_value() {
        for found in of(|x, y| (x * y) as f32 / 500.0) {
            let sum: f64 = found.histogram.iter().sum();
            assert!((sum - 1.0).abs() < 1e-9, "{found:?}");
        }
        let [luminance, ..] = of(|x, _| if x < 16 { 0.01 } else { 3.0 });
        assert_eq!([luminance.histogram[0], luminance.histogram[31]], [0.25, 0.75]);
        let none = Tally::all().map(|tally| tally.distribution());
        assert!(none.iter().all(|none| none.histogram == [0.0; BINS] && none.distance(&luminance).is_none()));
    }

    /// Two colours have the distance of their luminances, whichever is first; equal ones have none.
    #[test]
    fn distances_are_in_the_unit_of_the_quantity() {
        let [[dark, ..], [bright, ..], [half, ..]] =
            [of(|_, _| 0.25), of(|_, _| 0.625), of(|x, _| if x < 32 { 0.25 } else { 0.625 })];
        assert_eq!(dark.distance(&dark), Some(0.0));
        assert_eq!(half.distance(&half), Some(0.0));
        for (one, other, expected) in [(&dark, &bright, 0.375), (&bright, &dark, 0.375), (&half, &dark, 0.1875)] {
            let found = one.distance(other).unwrap();
            assert!((found - expected).abs() < 1.0 / 31.0, "{found} {expected}");
        }
    }
}
