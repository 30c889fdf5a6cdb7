//! The points of a cell where paths start, and the random numbers of each path.
//!
//! A view's pixel covers parts of several cells, so points must be spread evenly not only over whole cells but also
//! over parts of them. Within a cell, the points are those of a Sobol sequence, sorted in Morton order. Paths are
//! numbered in that order, cell after cell along a Morton curve over blocks of cells. A part of the plane then holds
//! runs of consecutive numbers, and runs of a Sobol sequence are well spread themselves: the idea of Ahmed and Wonka,
//! "Screen-space blue-noise diffusion of Monte Carlo sampling error via hierarchical ordering of pixels" (ACM TOG
//! 39(6), 2020).

use crate::sampling::Sampler;

/// The numbering of paths along one sequence: blocks of 2^`log_side` cells per side, `stride` numbers per cell.
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
