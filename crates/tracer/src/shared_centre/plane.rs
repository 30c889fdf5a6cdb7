//! The image plane over which the paths for several views with a common centre are distributed, the points of its cells
//! where they start, and the random numbers of each path.

use std::ops::Range;

use glam::{DMat3, DVec2, DVec3};
use mateval_dataset::{Camera, Intrinsics};

use crate::sampling::Sampler;

/// The part of the first camera's image plane that any view sees, divided into cells of that camera's pixels.
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    pub(super) camera: Camera,
    pub(super) views: Vec<PlaneView>,
    samples: u32,
    /// Columns of cells, in pixels of the camera; negative to the left of its picture.
    columns: Range<i32>,
    rows: Range<i32>,
}

/// A view, relative to the plane.
#[derive(Clone, Debug)]
pub(super) struct PlaneView {
    pub(super) intrinsics: Intrinsics,
    /// `None` for the plane's own camera, whose pixels are the cells.
    turn: Option<DMat3>,
    /// Pixels of the view per pixel of the plane's camera, where both look in the same direction.
    scale: f64,
}

/// The position of a point of the plane in a view's picture, and the number of that view's pixels that one cell covers
/// there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    pub(super) place: DVec2,
    pub(super) pixels: f64,
}

/// A rectangle of cells or pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) columns: Range<i32>,
    pub(super) rows: Range<i32>,
}

/// Cells along each side of a tile.
const TILE: usize = 16;
/// The cosine of 75 degrees, beyond which a plane stretches a picture too far.
const WIDEST: f64 = 0.258_819_045_102_520_74;
/// Half the spacing of f32 at 1, the relative rounding of a ray's origin.
const ORIGIN_ROUNDING: f64 = 1.0 / (1 << 24) as f64;

impl Plane {
    /// The plane of a single view.
    pub(super) fn alone(camera: &Camera, samples: u32) -> Self {
        let intrinsics = camera.intrinsics;
        let (columns, rows) = (0..intrinsics.width as i32, 0..intrinsics.height as i32);
        let view = PlaneView { intrinsics, turn: None, scale: 1.0 };
        Self { camera: *camera, views: vec![view], samples, columns, rows }
    }

    /// The same plane for one more view. `None` if its camera has another centre, or looks too far away from where the
    /// first looks.
    pub(super) fn with(&self, camera: &Camera) -> Option<Self> {
        let centre = self.camera.position();
        if centre.distance(camera.position()) > ORIGIN_ROUNDING * centre.abs().max_element().max(1.0) {
            return None;
        }
        let mut plane = self.clone();
        let plane_from_view = self.camera.rotation().transpose() * camera.rotation();
        let Intrinsics { width, height, fx, fy, .. } = camera.intrinsics;
        let own = self.camera.intrinsics;
        for corner in [[0, 0], [width, 0], [0, height], [width, height]] {
            let corner = DVec2::new(f64::from(corner[0]), f64::from(corner[1]));
            plane.grow(plane_from_view * camera.camera_direction(corner).normalize())?;
        }
        let scale = fx * fy / (own.fx * own.fy);
        let turn = Some(plane_from_view.transpose());
        plane.views.push(PlaneView { intrinsics: camera.intrinsics, turn, scale });
        Some(plane)
    }

    /// Extends the plane to contain `direction`, given in the space of the plane's camera.
    fn grow(&mut self, direction: DVec3) -> Option<()> {
        if -direction.z < WIDEST {
            return None;
        }
        let place = place(&self.camera.intrinsics, direction);
        let widen = |range: &mut Range<i32>, at: f64| {
            *range = range.start.min(at.floor() as i32)..range.end.max(at.ceil() as i32);
        };
        widen(&mut self.columns, place.x);
        widen(&mut self.rows, place.y);
        Some(())
    }

    /// The tiles of the plane, row by row.
    pub(super) fn tiles(&self) -> Vec<Window> {
        let parts = |range: &Range<i32>| {
            let end = range.end;
            range.clone().step_by(TILE).map(move |start| start..end.min(start + TILE as i32))
        };
        parts(&self.rows)
            .flat_map(|rows| parts(&self.columns).map(move |columns| Window { columns, rows: rows.clone() }))
            .collect()
    }

    /// The number of paths in a cell. The view with the most pixels in the cell determines it, so that each of its
    /// pixels gets the requested samples. 0 if no view sees the cell.
    pub(super) fn paths(&self, [x, y]: [i32; 2]) -> u32 {
        let cell = Window { columns: x..x + 1, rows: y..y + 1 };
        let middle = self.ray_place([x, y], [0.5, 0.5]);
        let needs = self.views.iter().enumerate().filter(|(index, _)| self.window(*index, &cell).is_some());
        let most = needs.filter_map(|(_, view)| self.seen(view, middle)).map(|seen| seen.pixels).fold(0.0, f64::max);
        // Reduced by a millionth, so that rounding does not add a path.
        (most * f64::from(self.samples) * (1.0 - 1e-6)).ceil() as u32
    }

    /// The largest number of paths in any cell.
    pub(super) fn most_paths(&self) -> u32 {
        let cells = self.tiles().into_iter().flat_map(|tile| tile.cells().collect::<Vec<_>>());
        cells.map(|cell| self.paths(cell)).max().unwrap_or(0).max(1)
    }

    /// The point at `offset` within a cell, in pixels of the plane's camera.
    pub(super) fn ray_place(&self, cell: [i32; 2], offset: [f32; 2]) -> DVec2 {
        DVec2::new(f64::from(cell[0]) + f64::from(offset[0]), f64::from(cell[1]) + f64::from(offset[1]))
    }

    /// The position in `view` of the point `at` of the plane, or `None` if the point lies behind the view.
    ///
    /// Between image planes with a common centre, areas scale with the cube of the ratio of depths: dA/d(solid angle)
    /// is focal^2 / cos^3 of the angle to the plane's axis.
    pub(super) fn seen(&self, view: &PlaneView, at: DVec2) -> Option<Seen> {
        let Some(turn) = view.turn else { return Some(Seen { place: at, pixels: 1.0 }) };
        let direction = turn * self.camera.camera_direction(at);
        let depth = -direction.z;
        (depth > 0.0)
            .then(|| Seen { place: place(&view.intrinsics, direction), pixels: view.scale / (depth * depth * depth) })
    }

    /// The pixels of view `index` that may contain points of `part`, or `None`.
    pub(super) fn window(&self, index: usize, part: &Window) -> Option<Window> {
        let view = &self.views[index];
        let Window { columns, rows } = part;
        let corners =
            [columns.start, columns.end].map(|x| [rows.start, rows.end].map(|y| DVec2::new(x.into(), y.into())));
        let seen: Vec<DVec2> =
            corners.as_flattened().iter().filter_map(|&at| Some(self.seen(view, at)?.place)).collect();
        let (low, high) = match seen.as_slice() {
            [] => return None,
            [first, others @ ..] if others.len() == 3 => {
                others.iter().fold((*first, *first), |(low, high), corner| (low.min(*corner), high.max(*corner)))
            }
            // A part that lies partly behind the view may appear anywhere in its picture.
            _ => (DVec2::NEG_INFINITY, DVec2::INFINITY),
        };
        // One more pixel on each side, in case rounding moves a point at the edge; cells of the plane's own camera are
        // exact.
        let margin = if view.turn.is_some() { 1.0 } else { 0.0 };
        let span = |low: f64, high: f64, size: u32| {
            let start = (low - margin).floor().max(0.0);
            let end = (high + margin).ceil().min(f64::from(size));
            (start < end).then_some(start as i32..end as i32)
        };
        let columns = span(low.x, high.x, view.intrinsics.width)?;
        Some(Window { columns, rows: span(low.y, high.y, view.intrinsics.height)? })
    }
}

impl Window {
    /// All places in the window, row by row.
    pub(super) fn cells(&self) -> impl Iterator<Item = [i32; 2]> + use<> {
        let columns = self.columns.clone();
        self.rows.clone().flat_map(move |y| columns.clone().map(move |x| [x, y]))
    }

    /// The number of places in a row.
    pub(super) fn width(&self) -> usize {
        self.columns.len()
    }

    /// The number of places.
    pub(super) fn area(&self) -> usize {
        self.columns.len() * self.rows.len()
    }
}

/// The position in the picture of a direction in camera space, in front of the camera.
fn place(k: &Intrinsics, direction: DVec3) -> DVec2 {
    let depth = -direction.z;
    DVec2::new(k.cx + k.fx * direction.x / depth, k.cy - k.fy * direction.y / depth)
}

/// The numbering of paths along one sequence: blocks of 2^`log_side` cells per side, `stride` numbers per cell.
///
/// A view's pixel covers parts of several cells, so points must be spread evenly not only over whole cells but also
/// over parts of them. Within a cell, the points are those of a Sobol sequence, sorted in Morton order. Paths are
/// numbered in that order, cell after cell along a Morton curve over blocks of cells. A part of the plane then holds
/// runs of consecutive numbers, and runs of a Sobol sequence are well spread themselves: the idea of Ahmed and Wonka,
/// "Screen-space blue-noise diffusion of Monte Carlo sampling error via hierarchical ordering of pixels" (ACM TOG
/// 39(6), 2020).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Numbering {
    log_side: u32,
    stride: u32,
}

/// The length of a sampler's sequence.
const SEQUENCE: u32 = 1 << 16;

impl Numbering {
    /// For at most `most` paths per cell.
    pub(super) fn new(most: u32) -> Self {
        let stride = most.next_power_of_two();
        let cells = (SEQUENCE / stride).max(1);
        Self { log_side: cells.ilog2() / 2, stride }
    }

    /// The sampler of path `rank` of a cell.
    pub(super) fn path_sampler(&self, seed: u64, [x, y]: [i32; 2], rank: u32) -> Sampler {
        let block = [x >> self.log_side, y >> self.log_side];
        let within = [x - (block[0] << self.log_side), y - (block[1] << self.log_side)];
        let first = morton(within.map(|v| v as u32)) * self.stride;
        Sampler::new(seed, block.map(|v| v as u32), first + rank)
    }
}

/// Replaces `points` by `count` well-spread points of the unit square in Morton order.
pub(super) fn cell_points(seed: u64, cell: [i32; 2], count: u32, points: &mut Vec<[f32; 2]>) {
    points.clear();
    points.extend((0..count).map(|index| {
        // Paths do not use set 0, so these numbers are independent of theirs.
        let [x, y, ..] = Sampler::new(seed, cell.map(|v| v as u32), index).set(0);
        [x, y]
    }));
    points.sort_by_cached_key(|point| morton(point.map(|v| (v * 65536.0) as u32)));
}

/// Interleaves the low 16 bits of x and y; x takes the even bits.
fn morton([x, y]: [u32; 2]) -> u32 {
    spread(x) | (spread(y) << 1)
}

fn spread(value: u32) -> u32 {
    let mut v = value & 0xffff;
    v = (v | (v << 8)) & 0x00ff_00ff;
    v = (v | (v << 4)) & 0x0f0f_0f0f;
    v = (v | (v << 2)) & 0x3333_3333;
    (v | (v << 1)) & 0x5555_5555
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn morton_order_is_that_of_nested_quarters() {
        let codes: Vec<u32> = [[0, 0], [1, 0], [0, 1], [1, 1], [2, 0], [0, 2]].map(morton).to_vec();
        assert_eq!(codes, [0, 1, 2, 3, 4, 8]);
        assert_eq!(morton([0xffff, 0xffff]), u32::MAX);
    }

    /// Sixteen points: one in each sixteenth of the cell, in the order of the curve, hence four in each quarter.
    #[test]
    fn points_fill_nested_quarters_in_turn() {
        let mut points = Vec::new();
        cell_points(7, [-3, 4], 16, &mut points);
        let quarters: Vec<u32> = points.iter().map(|p| morton(p.map(|v| (v * 2.0) as u32))).collect();
        assert_eq!(quarters, [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3]);
        let sixteenths: BTreeSet<u32> = points.iter().map(|p| morton(p.map(|v| (v * 4.0) as u32))).collect();
        assert_eq!(sixteenths.len(), 16);
    }

    /// No two paths of a seed share their random numbers, whatever the number of paths per cell.
    #[test]
    fn every_path_has_numbers_of_its_own() {
        for most in [1, 5, 64, 4096] {
            let numbering = Numbering::new(most);
            let mut seen = BTreeSet::new();
            for (x, y) in (-3..3).flat_map(|x| (-3..3).map(move |y| (x, y))) {
                for rank in [0, most - 1] {
                    seen.insert(numbering.path_sampler(1, [x, y], rank).set(1).map(f32::to_bits));
                }
            }
            assert_eq!(seen.len(), if most == 1 { 36 } else { 72 });
        }
    }
}
