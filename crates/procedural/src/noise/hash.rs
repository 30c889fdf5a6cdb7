//! Bob Jenkins' hash `lookup3` of whole numbers (burtleburtle.net/bob/c/lookup3.c, public domain), as Open Shading
//! Language seeds it.

/// The state that `lookup3` begins with: `0xdeadbeef`, four bytes a word, and OSL's 13.
fn seed(words: u32) -> u32 {
    0xdead_beef_u32.wrapping_add(4 * words).wrapping_add(13)
}

/// The last step of `lookup3`.
fn finish(mut a: u32, mut b: u32, mut c: u32) -> u32 {
    let step = |target: u32, by: u32, turn: u32| (target ^ by).wrapping_sub(by.rotate_left(turn));
    c = step(c, b, 14);
    a = step(a, c, 11);
    b = step(b, a, 25);
    c = step(c, b, 16);
    a = step(a, c, 4);
    b = step(b, a, 14);
    step(c, b, 24)
}

/// The hash of two whole numbers.
pub(super) fn hash2(x: i32, y: i32) -> u32 {
    let start = seed(2);
    finish(start.wrapping_add(x.cast_unsigned()), start.wrapping_add(y.cast_unsigned()), start)
}

/// The hash of three whole numbers.
pub(super) fn hash3(x: i32, y: i32, z: i32) -> u32 {
    let start = seed(3);
    let add = |word: i32| start.wrapping_add(word.cast_unsigned());
    finish(add(x), add(y), add(z))
}

/// A hash as a number from 0 to 1.
pub(super) fn to_unit(hash: u32) -> f64 {
    f64::from(hash) / f64::from(u32::MAX)
}

/// The lattice cell that holds a coordinate, and the place within it. Beyond the range of whole numbers cells repeat.
pub(super) fn cell_of(x: f64) -> (i32, f64) {
    let floor = x.floor();
    #[allow(clippy::cast_possible_truncation, reason = "cells repeat beyond the range")]
    let cell = floor as i64 as i32;
    (cell, x - floor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_cells_have_unrelated_hashes() {
        let mut bits = 0;
        for x in -20..20 {
            for y in -20..20 {
                bits += (hash2(x, y) ^ hash2(x + 1, y)).count_ones() + (hash3(x, y, 0) ^ hash3(x, y, 1)).count_ones();
            }
        }
        let mean = f64::from(bits) / 3200.0;
        assert!((mean - 16.0).abs() < 0.2, "{mean}");
        // The twin: a hash without its last step keeps its neighbours.
        assert!((seed(2) ^ (seed(2) + 1)).count_ones() < 4);
    }

    #[test]
    fn cells_hold_their_coordinates() {
        assert_eq!(cell_of(-0.25), (-1, 0.75));
        assert_eq!(cell_of(3.0), (3, 0.0));
    }
}
