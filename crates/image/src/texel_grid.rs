//! The grid of texels behind a lookup by uv: which texels a place lies between, and how it weighs them.
//!
//! uv (0, 0) is the lower left corner of the picture and v grows upwards, as in OBJ; glTF's v is one minus this v.
//! Lookups are bilinear between texel centres, which lie at half-integers.

/// How lookups continue outside 0..1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The picture is repeated.
    #[default]
    Repeat,
    /// The nearest border texel is used.
    Clamp,
    /// The picture is repeated, mirrored every other time.
    Mirror,
}

/// A grid of texels, row by row from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TexelGrid {
    /// Texels in a row, at least 1.
    pub width: usize,
    /// Rows, at least 1.
    pub height: usize,
    /// How lookups continue outside 0..1.
    pub wrap: Wrap,
}

impl TexelGrid {
    /// The four texels that a bilinear lookup at `uv` reads, by their place in the list of texels, with their weights,
    /// whose sum is 1. A texel may occur more than once. A coordinate that is not finite or beyond 1e9 counts as 0.
    pub fn taps(&self, uv: [f32; 2]) -> [(usize, f32); 4] {
        let [(x0, x1, fx), (y0, y1, fy)] = self.footprint(uv);
        let (upper, lower) = (y0 * self.width, y1 * self.width);
        [
            (upper + x0, (1.0 - fx) * (1.0 - fy)),
            (upper + x1, fx * (1.0 - fy)),
            (lower + x0, (1.0 - fx) * fy),
            (lower + x1, fx * fy),
        ]
    }

    /// The two columns and the two rows around `uv`, with the weight of the second of each.
    #[inline(always)]
    pub(crate) fn footprint(&self, uv: [f32; 2]) -> [(usize, usize, f32); 2] {
        // Beyond 1e9 neighbouring texels have the same f32 coordinate.
        let sane = |v: f32| if v.abs() < 1e9 { v } else { 0.0 };
        let x = sane(uv[0]) * self.width as f32 - 0.5;
        let y = (1.0 - sane(uv[1])) * self.height as f32 - 0.5;
        [self.neighbours(x, self.width), self.neighbours(y, self.height)]
    }

    #[inline(always)]
    fn neighbours(&self, position: f32, size: usize) -> (usize, usize, f32) {
        // Rounds down without `floor`, which is a function call on the baseline x86-64 processor. i64 holds every f32
        // that a uv can give here; the cast saturates beyond.
        let towards_zero = position as i64;
        let index = towards_zero.saturating_sub(i64::from((towards_zero as f32) > position));
        (self.wrapped(index, size), self.wrapped(index.saturating_add(1), size), position - index as f32)
    }

    #[inline(always)]
    fn wrapped(&self, index: i64, size: usize) -> usize {
        let size = size as i64;
        if (0..size).contains(&index) {
            return index as usize;
        }
        self.wrapped_from_outside(index, size)
    }

    fn wrapped_from_outside(&self, index: i64, size: i64) -> usize {
        let inside = match self.wrap {
            // Powers of two are the common case, and a division takes ten times as long.
            Wrap::Repeat if size & (size - 1) == 0 => index & (size - 1),
            Wrap::Repeat => index.rem_euclid(size),
            Wrap::Clamp => index.clamp(0, size - 1),
            Wrap::Mirror => {
                let turn = index.rem_euclid(2 * size);
                if turn < size { turn } else { 2 * size - 1 - turn }
            }
        };
        inside as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::{Texels, Texture};

    /// The weighted sum of the taps is the lookup, inside and outside 0..1.
    #[test]
    fn taps_are_what_a_lookup_reads() {
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            let grid = TexelGrid { width: 5, height: 3, wrap };
            let values: Vec<f32> = (0..15_u16).map(|k| f32::from(k * k % 11)).collect();
            let texture = Texture::new(5, 3, Texels::Grey(values.clone()), wrap).unwrap();
            for uv in [[0.33, 0.71], [0.02, 0.98], [1.3, -0.4], [0.5, 0.5]] {
                let sum: f32 = grid.taps(uv).iter().map(|(texel, weight)| values[*texel] * weight).sum();
                assert!((sum - texture.sample(uv)[0]).abs() < 1e-5, "{wrap:?} {uv:?}");
                assert!((grid.taps(uv).iter().map(|(_, weight)| weight).sum::<f32>() - 1.0).abs() < 1e-6);
            }
            // The twin: v that grows downwards reads other texels.
            assert_ne!(grid.taps([0.33, 0.71]), grid.taps([0.33, 0.29]));
        }
    }
}
