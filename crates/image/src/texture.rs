//! A texture, whose texels are kept as they were stored and decoded at each lookup.
//!
//! uv (0, 0) is the lower left corner of the picture and v grows upwards, as in OBJ; glTF's v is one minus this v.
//! Lookups are bilinear between texel centres, which lie at half-integers: [`TexelGrid`] is the grid of texels behind
//! them.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::transfer::{linear_from_srgb_byte, linear_from_srgb_bytes, linear_from_srgb_words};

/// How the integers of a file encode colours. Floats (EXR, HDR, NumPy) are always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// With the sRGB curve.
    Srgb,
    Linear,
}

/// Texels, row by row from the top left. Bytes keep large atlases small.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// sRGB-encoded bytes.
    Srgb8(Vec<[u8; 3]>),
    /// sRGB-encoded 16-bit words, value = word / 65535.
    Srgb16(Vec<[u16; 3]>),
    /// Linear bytes, value = byte / 255.
    Linear8(Vec<[u8; 3]>),
    /// Linear scalars as bytes, value = byte / 255; all three channels the same.
    Grey8(Vec<u8>),
    Linear(Vec<[f32; 3]>),
    /// Linear float scalars; all three channels the same.
    Grey(Vec<f32>),
}

impl Texels {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Srgb8(v) | Self::Linear8(v) => v.as_flattened(),
            Self::Srgb16(v) => bytemuck::cast_slice(v),
            Self::Grey8(v) => v,
            Self::Linear(v) => bytemuck::cast_slice(v),
            Self::Grey(v) => bytemuck::cast_slice(v),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Srgb8(v) | Self::Linear8(v) => v.len(),
            Self::Srgb16(v) => v.len(),
            Self::Grey8(v) => v.len(),
            Self::Linear(v) => v.len(),
            Self::Grey(v) => v.len(),
        }
    }
}

/// A picture for lookups by uv.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    width: usize,
    height: usize,
    // Shared, so that clones are cheap.
    texels: Arc<Texels>,
    wrap: Wrap,
}

impl Texture {
    /// A texture of these texels, row by row from the top left. Fails if there are none or not `width * height`.
    pub fn new(width: usize, height: usize, texels: Texels, wrap: Wrap) -> Result<Self, crate::ImageError> {
        let expected = width.saturating_mul(height);
        if expected == 0 || texels.len() != expected {
            return Err(crate::ImageError::PixelCount { width, height, expected, found: texels.len() });
        }
        Ok(Self { width, height, texels: Arc::new(texels), wrap })
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn height(&self) -> usize {
        self.height
    }

    pub fn texels(&self) -> &Texels {
        &self.texels
    }

    /// The stored texels, to change them; copied if a clone of this texture still holds them.
    pub fn into_texels(self) -> Texels {
        Arc::unwrap_or_clone(self.texels)
    }

    pub fn wrap(&self) -> Wrap {
        self.wrap
    }

    /// The same texture, reduced to one texel where all texels are equal.
    pub fn collapsed(self) -> Self {
        fn first<T: PartialEq + Copy>(all: &[T]) -> Option<Vec<T>> {
            all.iter().all(|texel| *texel == all[0]).then(|| vec![all[0]])
        }
        let one = match self.texels.as_ref() {
            Texels::Srgb8(v) => first(v).map(Texels::Srgb8),
            Texels::Srgb16(v) => first(v).map(Texels::Srgb16),
            Texels::Linear8(v) => first(v).map(Texels::Linear8),
            Texels::Grey8(v) => first(v).map(Texels::Grey8),
            Texels::Linear(v) => first(v).map(Texels::Linear),
            Texels::Grey(v) => first(v).map(Texels::Grey),
        };
        match one {
            Some(texels) => Self { width: 1, height: 1, texels: Arc::new(texels), wrap: self.wrap },
            None => self,
        }
    }

    /// The linear value of the texel at column `x`, row `y` from the top.
    pub fn texel(&self, x: usize, y: usize) -> [f32; 3] {
        let at = y * self.width + x;
        match self.texels.as_ref() {
            Texels::Srgb8(v) => v[at].map(linear_from_srgb_byte),
            Texels::Srgb16(v) => v[at].map(|word| linear_from_srgb_words()[usize::from(word)]),
            Texels::Linear8(v) => v[at].map(|byte| f32::from(byte) / 255.0),
            Texels::Grey8(v) => [f32::from(v[at]) / 255.0; 3],
            Texels::Linear(v) => v[at],
            Texels::Grey(v) => [v[at]; 3],
        }
    }

    /// The linear values of all texels, row by row from the top left.
    pub fn linear_texels(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        (0..self.height).flat_map(move |y| (0..self.width).map(move |x| self.texel(x, y)))
    }

    /// The mean of the linear values of all texels.
    pub fn mean(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for texel in self.linear_texels() {
            sum.iter_mut().zip(texel).for_each(|(sum, value)| *sum += f64::from(value));
        }
        sum.map(|sum| sum / (self.width * self.height) as f64)
    }

    /// The linear value at `uv`, bilinear. A coordinate that is not finite or beyond 1e9 reads as 0.
    #[inline]
    pub fn sample(&self, uv: [f32; 2]) -> [f32; 3] {
        // Most maps of roughness and metallic are collapsed to a texel.
        if self.width == 1 && self.height == 1 {
            return self.texel(0, 0);
        }
        // The kind of texels is matched, and the table of the sRGB curve is found, once a lookup, not once a texel.
        match self.texels.as_ref() {
            Texels::Srgb8(v) => {
                let linear = linear_from_srgb_bytes();
                self.bilinear(uv, |at| v[at].map(|byte| linear[usize::from(byte)]))
            }
            Texels::Srgb16(v) => {
                let linear = linear_from_srgb_words();
                self.bilinear(uv, |at| v[at].map(|word| linear[usize::from(word)]))
            }
            Texels::Linear8(v) => self.bilinear(uv, |at| v[at].map(|byte| f32::from(byte) / 255.0)),
            Texels::Grey8(v) => self.bilinear(uv, |at| [f32::from(v[at]) / 255.0; 3]),
            Texels::Linear(v) => self.bilinear(uv, |at| v[at]),
            Texels::Grey(v) => self.bilinear(uv, |at| [v[at]; 3]),
        }
    }

    /// The addresses of the two rows of texels that [`Self::sample`] reads at `uv`, for prefetching.
    #[inline]
    pub fn addresses(&self, uv: [f32; 2]) -> [*const u8; 2] {
        let [(x, ..), (upper, lower, _)] = self.grid().footprint(uv);
        // Computing this from the number of bytes would take a division, longer than everything else here.
        let size = match self.texels.as_ref() {
            Texels::Grey8(_) => 1,
            Texels::Srgb8(_) | Texels::Linear8(_) => 3,
            Texels::Grey(_) => 4,
            Texels::Srgb16(_) => 6,
            Texels::Linear(_) => 12,
        };
        [upper, lower].map(|row| self.bytes().as_ptr().wrapping_add((row * self.width + x) * size))
    }

    /// All texels as bytes in memory.
    pub fn bytes(&self) -> &[u8] {
        self.texels.bytes()
    }

    #[inline(always)]
    fn bilinear(&self, uv: [f32; 2], texel: impl Fn(usize) -> [f32; 3]) -> [f32; 3] {
        let [(x0, x1, fx), (y0, y1, fy)] = self.grid().footprint(uv);
        let (upper, lower) = (y0 * self.width, y1 * self.width);
        let (a, b) = (texel(upper + x0), texel(upper + x1));
        let (c, d) = (texel(lower + x0), texel(lower + x1));
        std::array::from_fn(|k| {
            let top = a[k] + fx * (b[k] - a[k]);
            let bottom = c[k] + fx * (d[k] - c[k]);
            top + fy * (bottom - top)
        })
    }

    #[inline(always)]
    pub fn grid(&self) -> TexelGrid {
        TexelGrid { width: self.width, height: self.height, wrap: self.wrap }
    }
}

/// How a texture continues outside 0..1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "WrapWord")]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// The border texel.
    Clamp,
    /// Mirrored every other time.
    Mirror,
}

/// A grid of texels, row by row from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TexelGrid {
    /// Texels in a row, at least 1.
    pub width: usize,
    /// Rows, at least 1.
    pub height: usize,
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

    fn two_by_two(wrap: Wrap) -> Texture {
        Texture::new(2, 2, Texels::Grey(vec![0.0, 1.0, 2.0, 3.0]), wrap).unwrap()
    }

    #[test]
    fn v_grows_upwards() {
        let texture = two_by_two(Wrap::Clamp);
        assert_eq!(texture.sample([0.25, 0.25])[0], 2.0);
        assert_eq!(texture.sample([0.75, 0.75])[0], 1.0);
    }

    #[test]
    fn bilinear_in_the_middle_is_the_mean() {
        assert_eq!(two_by_two(Wrap::Clamp).sample([0.5, 0.5]), [1.5; 3]);
    }

    #[test]
    fn wrapping() {
        assert_eq!(two_by_two(Wrap::Repeat).sample([1.25, 0.75]), two_by_two(Wrap::Repeat).sample([0.25, 0.75]));
        assert_eq!(two_by_two(Wrap::Clamp).sample([7.0, 0.75])[0], 1.0);
        assert_eq!(two_by_two(Wrap::Mirror).sample([1.25, 0.75])[0], 1.0);
        assert_eq!(two_by_two(Wrap::Mirror).sample([1.75, 0.75])[0], 0.0);
    }

    #[test]
    fn equal_texels_collapse_and_look_the_same() {
        let plain = Texture::new(2, 2, Texels::Srgb16(vec![[30_000, 1, 65_535]; 4]), Wrap::Clamp).unwrap();
        let one = plain.clone().collapsed();
        assert_eq!((one.width(), one.sample([0.3, 0.9])), (1, plain.sample([0.3, 0.9])));
        assert_eq!(two_by_two(Wrap::Clamp).collapsed(), two_by_two(Wrap::Clamp));
    }

    #[test]
    fn addresses_are_those_of_the_texels_read() {
        let texels: Vec<[u16; 3]> = (0..20).map(|k| [k, 0, 0]).collect();
        let texture = Texture::new(5, 4, Texels::Srgb16(texels), Wrap::Clamp).unwrap();
        let Texels::Srgb16(texels) = texture.texels() else { unreachable!() };
        // Between columns 2 and 3, rows 1 and 2.
        let expected = [7, 12].map(|at: usize| std::ptr::from_ref(&texels[at]).cast::<u8>());
        assert_eq!(texture.addresses([0.6, 0.5]), expected);
    }

    #[test]
    fn strange_uv_is_not_a_panic() {
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Mirror] {
            for uv in [[f32::NAN, 0.0], [f32::INFINITY, -1e30], [1e38, -1e38]] {
                two_by_two(wrap).sample(uv);
            }
        }
    }

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
