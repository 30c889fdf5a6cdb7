//! Averages samples into a picture, tile by tile, with a box filter of one pixel.

use mateval_image::{LinearRgb, Picture};
use rayon::prelude::*;

/// Pixels along each side of a tile.
const TILE: usize = 16;

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tile {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

/// All tiles of a picture, row by row.
pub(crate) fn tiles(width: usize, height: usize) -> Vec<Tile> {
    let starts = |size: usize| (0..size).step_by(TILE);
    starts(height)
        .flat_map(|y| starts(width).map(move |x| (x, y)))
        .map(|(x, y)| Tile { x, y, width: TILE.min(width - x), height: TILE.min(height - y) })
        .collect()
}

impl Tile {
    /// The tile's pixels (x, y), row by row.
    pub(crate) fn pixels(&self) -> impl Iterator<Item = [usize; 2]> + Clone + use<> {
        let Self { x, y, width, height } = *self;
        (y..y + height).flat_map(move |row| (x..x + width).map(move |column| [column, row]))
    }
}

/// Renders a picture tile by tile. `develop_tile` returns a tile's pixels, row by row, and extra data, which is
/// returned in the order of the tiles.
///
/// Tiles are distributed over the threads of the current pool. Each pixel is rendered by one thread, so the result does
/// not depend on their number. `done` is called after each tile, in no particular order.
pub(crate) fn develop<E: Send>(
    width: usize,
    height: usize,
    develop_tile: impl Fn(&Tile) -> (Vec<[f64; 3]>, E) + Sync,
    done: impl Fn() + Sync,
) -> (Picture<LinearRgb>, Vec<E>) {
    let tiles = tiles(width, height);
    // Render all tiles in parallel.
    let developed: Vec<(Vec<LinearRgb>, E)> = tiles
        .par_iter()
        .map(|tile| {
            let (pixels, extra) = develop_tile(tile);
            let pixels = pixels.into_iter().map(|pixel| LinearRgb(pixel.map(|v| v as f32))).collect();
            done();
            (pixels, extra)
        })
        .collect();
    // Copy them into the picture, in order.
    let mut picture = Picture::filled(width, height, LinearRgb::default());
    let mut extras = Vec::with_capacity(tiles.len());
    for (tile, (pixels, extra)) in tiles.iter().zip(developed) {
        for (row, values) in pixels.chunks(tile.width).enumerate() {
            let start = (tile.y + row) * width + tile.x;
            picture.pixels_mut()[start..start + tile.width].copy_from_slice(values);
        }
        extras.push(extra);
    }
    (picture, extras)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_is_made_once_and_put_in_its_place() {
        let tile = |tile: &Tile| {
            let pixels: Vec<[f64; 3]> = tile.pixels().map(|[x, y]| [x as f64, y as f64, 0.0]).collect();
            let count = pixels.len();
            (pixels, count)
        };
        let (picture, counts) = develop(37, 18, tile, || ());
        assert_eq!(counts.iter().sum::<usize>(), 37 * 18);
        assert_eq!(counts.len(), 6);
        for y in 0..18 {
            for x in 0..37 {
                assert_eq!(picture.get(x, y), LinearRgb([x as f32, y as f32, 0.0]));
            }
        }
    }
}
