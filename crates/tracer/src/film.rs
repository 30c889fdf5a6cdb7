//! Collects samples into a picture: box filter of one pixel, tile by tile.

use mateval_image::{LinearRgb, Picture};
use rayon::prelude::*;

/// Pixels along a tile's side.
const TILE: usize = 16;

/// A part of the picture.
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

/// A picture whose pixel (x, y) is `pixel_at(&mut extra, x, y)`, and every tile's `extra` in the order of the tiles.
///
/// Tiles are spread over the threads of the current pool; each pixel is made by one of them, so the result does not depend
/// on their number. `done` is called after each tile with its place in no particular order.
pub(crate) fn develop<E: Default + Send>(
    width: usize,
    height: usize,
    pixel_at: impl Fn(&mut E, usize, usize) -> [f64; 3] + Sync,
    done: impl Fn() + Sync,
) -> (Picture<LinearRgb>, Vec<E>) {
    let tiles = tiles(width, height);
    let developed: Vec<(Vec<LinearRgb>, E)> = tiles
        .par_iter()
        .map(|tile| {
            let mut extra = E::default();
            let mut pixels = Vec::with_capacity(tile.width * tile.height);
            for y in tile.y..tile.y + tile.height {
                for x in tile.x..tile.x + tile.width {
                    pixels.push(LinearRgb(pixel_at(&mut extra, x, y).map(|v| v as f32)));
                }
            }
            done();
            (pixels, extra)
        })
        .collect();
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
        let (picture, counts) = develop(
            37,
            18,
            |count: &mut usize, x, y| {
                *count += 1;
                [x as f64, y as f64, 0.0]
            },
            || (),
        );
        assert_eq!(counts.iter().sum::<usize>(), 37 * 18);
        assert_eq!(counts.len(), 6);
        for y in 0..18 {
            for x in 0..37 {
                assert_eq!(picture.get(x, y), LinearRgb([x as f32, y as f32, 0.0]));
            }
        }
    }
}
