//! A texture, whose texels are kept as they were stored and decoded at each lookup. Lookups are bilinear, by the uv of
//! [`crate::texel_grid`].

use std::sync::Arc;

use crate::texel_grid::{TexelGrid, Wrap};
use crate::transfer::{linear_from_srgb_byte, linear_from_srgb_word};

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
    /// Linear floats.
    Linear(Vec<[f32; 3]>),
    /// Linear float scalars; all three channels the same.
    Grey(Vec<f32>),
}

impl Texels {
    /// The texels as bytes in memory.
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

    /// Texels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The stored texels.
    pub fn texels(&self) -> &Texels {
        &self.texels
    }

    /// The stored texels, to change them; copied if a clone of this texture still holds them.
    pub fn into_texels(self) -> Texels {
        Arc::unwrap_or_clone(self.texels)
    }

    /// How lookups continue outside 0..1.
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
            Texels::Srgb16(v) => v[at].map(linear_from_srgb_word),
            Texels::Linear8(v) => v[at].map(|byte| f32::from(byte) / 255.0),
            Texels::Grey8(v) => [f32::from(v[at]) / 255.0; 3],
            Texels::Linear(v) => v[at],
            Texels::Grey(v) => [v[at]; 3],
        }
    }

    /// The linear value at `uv`, bilinear. A coordinate that is not finite or beyond 1e9 reads as 0.
    #[inline]
    pub fn sample(&self, uv: [f32; 2]) -> [f32; 3] {
        // The kind of texels is matched once a lookup, not once a texel.
        match self.texels.as_ref() {
            Texels::Srgb8(v) => self.bilinear(uv, |at| v[at].map(linear_from_srgb_byte)),
            Texels::Srgb16(v) => self.bilinear(uv, |at| v[at].map(linear_from_srgb_word)),
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

    /// The grid of its texels.
    #[inline(always)]
    pub fn grid(&self) -> TexelGrid {
        TexelGrid { width: self.width, height: self.height, wrap: self.wrap }
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
}
