//! How the true albedo of a dataset looks in its input views: colours, contrast and fineness of texture, so that
//! redressed rooms can be laid beside the original ones.

use mateval_dataset::open::Dataset;
use mateval_dataset::progress::{Table, row};
use mateval_image::{LinearRgb, Mask, Picture, exr_io, png_io};
use palette::convert::FromColorUnclamped;
use palette::{LinSrgb, Oklch};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::PrepError;

/// The look of the true albedo of all input views, at the pixels that are valid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LookStats {
    /// Number of input views.
    pub views: usize,
    /// Linear luminance, over pixels.
    pub luminance: Moments,
    /// Oklab lightness, over pixels.
    pub lightness: Moments,
    /// Oklab chroma, over pixels.
    pub chroma: Moments,
    /// The standard deviation of the lightness around a pixel, among the pixels of its instance within 4 pixels; over
    /// pixels.
    pub local_contrast: Moments,
    /// The share of that variance which is between neighbours, within 1 pixel; over views.
    pub fine_share: Moments,
}

/// A mean and a standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Moments {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub deviation: f64,
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

    fn moments(&self) -> Moments {
        let mean = self.sum / self.count.max(1.0);
        Moments { mean, deviation: (self.squares / self.count.max(1.0) - mean * mean).max(0.0).sqrt() }
    }
}

/// The look of a dataset; none if a scene's ground truth is withheld.
pub fn look(dataset: &Dataset) -> Result<Option<LookStats>, PrepError> {
    let mut sums = [(); 5].map(|()| Sums::default());
    let mut views = 0;
    for scene in dataset.scenes.iter().filter(|scene| scene.source.kind.states_materials()) {
        let (folder, Some(view)) = (dataset.folder(&scene.id), scene.views.first()) else { continue };
        let albedo = folder.truth_view(&view.id).join("albedo.exr");
        if !albedo.exists() {
            return Ok(None);
        }
        let shown = folder.view(&view.id);
        let valid = png_io::read_mask(&shown.join("valid.png"))?;
        let instances = png_io::read_ids(&shown.join("instance.png"))?;
        add_view(&exr_io::read_linear(&albedo)?, &valid, &instances, &mut sums);
        views += 1;
    }
    let [luminance, lightness, chroma, local_contrast, fine_share] = sums.map(|sums| sums.moments());
    Ok(Some(LookStats { views, luminance, lightness, chroma, local_contrast, fine_share }))
}

fn add_view(albedo: &Picture<LinearRgb>, valid: &Mask, instances: &Picture<u16>, sums: &mut [Sums; 5]) {
    let [luminance, lightness, chroma, contrast, fine_share] = sums;
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
        Some(near.moments().deviation.powi(2)).filter(|variance| *variance > 1e-12).unwrap_or(0.0)
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

/// The look as a table.
pub(super) fn table(look: &LookStats) -> Table {
    let line = |name: &str, Moments { mean, deviation }: Moments| {
        row([name, &format!("{mean:.3}"), &format!("{deviation:.3}")])
    };
    let rows = vec![
        row(["", "mean", "deviation"]),
        line("luminance", look.luminance),
        line("lightness (Oklab)", look.lightness),
        line("chroma (Oklab)", look.chroma),
        line("local contrast", look.local_contrast),
        line("fine share", look.fine_share),
    ];
    let plural = if look.views == 1 { "" } else { "s" };
    Table { title: format!("True albedo of {} input view{plural}", look.views), words: 1, rows }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The look of a picture of two instances, side by side.
    fn of(color: impl Fn(usize, usize) -> f32) -> [Moments; 5] {
        let albedo = Picture::from_fn(64, 32, |x, y| LinearRgb([color(x, y); 3]));
        let instances = Picture::from_fn(64, 32, |x, _| u16::from(x < 32));
        let mut sums = [(); 5].map(|()| Sums::default());
        add_view(&albedo, &Picture::filled(64, 32, true), &instances, &mut sums);
        sums.map(|sums| sums.moments())
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
}
