//! Tests whether two renderers' pictures agree, tile by tile.
//!
//! Every picture is rendered with several seeds, from which its noise is estimated.

use mateval_image::{LinearRgb, Picture};

/// Pixels a side of a tile.
const TILE: usize = 8;

/// The tiles' means over pixels and channels, render by render.
pub struct Tiles(Vec<Vec<f64>>);

/// How two renderers agree; all numbers are relative.
#[derive(Debug)]
pub struct Agreement {
    /// The difference of the means of whole pictures, and its standard error.
    pub whole: f64,
    pub whole_error: f64,
    /// Root of the mean square of the tiles' standard errors.
    pub noise: f64,
    /// The second largest difference of a tile, which all but one do not exceed.
    pub most: f64,
    /// The largest.
    pub worst: f64,
}

impl Tiles {
    /// Of renders of one view with different seeds.
    pub fn of(pictures: &[Picture<LinearRgb>]) -> Self {
        let tiles = |picture: &Picture<LinearRgb>| {
            let (columns, rows) = (picture.width() / TILE, picture.height() / TILE);
            let corner = |tile: usize| (tile % columns * TILE, tile / columns * TILE);
            (0..columns * rows).map(|tile| tile_mean(picture, corner(tile))).collect()
        };
        Self(pictures.iter().map(tiles).collect())
    }

    /// The mean over renders of each tile, and the square of its standard error.
    fn estimates(&self) -> Vec<(f64, f64)> {
        let n = self.0.len() as f64;
        let estimate = |tile: usize| {
            let mean = self.0.iter().map(|render| render[tile]).sum::<f64>() / n;
            let spread = self.0.iter().map(|render| (render[tile] - mean).powi(2)).sum::<f64>();
            (mean, spread / (n - 1.0) / n)
        };
        (0..self.0[0].len()).map(estimate).collect()
    }
}

fn tile_mean(picture: &Picture<LinearRgb>, (left, top): (usize, usize)) -> f64 {
    let pixels = (0..TILE * TILE).map(|k| picture.get(left + k % TILE, top + k / TILE).0);
    pixels.flatten().map(f64::from).sum::<f64>() / (3 * TILE * TILE) as f64
}

/// Compares `ours` with `theirs`.
pub fn agreement(ours: &Tiles, theirs: &Tiles) -> Agreement {
    let (ours, theirs) = (ours.estimates(), theirs.estimates());
    let count = ours.len() as f64;
    let sum = |tiles: &[(f64, f64)], pick: fn(&(f64, f64)) -> f64| tiles.iter().map(pick).sum::<f64>();
    let (our_sum, their_sum) = (sum(&ours, |t| t.0), sum(&theirs, |t| t.0));
    let variance = sum(&ours, |t| t.1) + sum(&theirs, |t| t.1);
    let pairs = || ours.iter().zip(&theirs);
    let mut off: Vec<f64> = pairs().map(|(a, b)| (a.0 / b.0 - 1.0).abs()).collect();
    off.sort_by(f64::total_cmp);
    Agreement {
        whole: our_sum / their_sum - 1.0,
        whole_error: variance.sqrt() / their_sum,
        noise: (pairs().map(|(a, b)| (a.1 + b.1) / (b.0 * b.0)).sum::<f64>() / count).sqrt(),
        most: off[off.len() - 2],
        worst: off[off.len() - 1],
    }
}
