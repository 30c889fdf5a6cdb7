//! The values of a submission's maps at each pixel of the input picture, also after the turns of common mistakes.

use mateval_image::Texture;

use super::sight::SeenPixel;

/// How an atlas may have been turned when it was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// As it should be.
    None,
    /// Top and bottom exchanged: v counted from the other end.
    Vertical,
    /// Left and right exchanged.
    Horizontal,
    /// Both: half a turn.
    Half,
    /// Rows and columns exchanged.
    Transposed,
}

impl Turn {
    /// All of them, [`Turn::None`] first.
    pub(super) const ALL: [Self; 5] = [Self::None, Self::Vertical, Self::Horizontal, Self::Half, Self::Transposed];

    /// Where in the file the value lies that belongs at `uv`; v runs upwards.
    fn place(self, [u, v]: [f32; 2]) -> [f32; 2] {
        match self {
            Self::None => [u, v],
            Self::Vertical => [u, 1.0 - v],
            Self::Horizontal => [1.0 - u, v],
            Self::Half => [1.0 - u, 1.0 - v],
            Self::Transposed => [1.0 - v, 1.0 - u],
        }
    }
}

/// A pixel of the picture with the base colour that the submission has there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    /// Its instance.
    pub(super) instance: usize,
    /// Its neighbourhood in the picture.
    pub(super) tile: usize,
    /// The picture's colour, linear.
    pub(super) photo: Option<[f32; 3]>,
    /// The base colour, linear, under each of [`Turn::ALL`].
    pub(super) base_color: [[f32; 3]; 5],
}

impl Look {
    /// The base colour as scoring reads it.
    pub(super) fn own(&self) -> [f32; 3] {
        self.base_color[0]
    }
}

/// The base colour at each pixel that shows the instance.
pub(super) fn looks(instance: usize, pixels: &[SeenPixel], base_color: &Texture) -> Vec<Look> {
    let look = |pixel: &SeenPixel| Look {
        instance,
        tile: pixel.tile,
        photo: pixel.photo,
        base_color: Turn::ALL.map(|turn| mean(base_color, pixel, turn)),
    };
    pixels.iter().map(look).collect()
}

/// Roughness and metallic at a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScalarLook {
    pub(super) roughness: f32,
    pub(super) metallic: f32,
}

/// Both maps at each pixel that shows the instance; none where a map is missing.
pub(super) fn scalar_looks(
    pixels: &[SeenPixel],
    roughness: Option<Texture>,
    metallic: Option<Texture>,
) -> Vec<ScalarLook> {
    let (Some(roughness), Some(metallic)) = (roughness, metallic) else { return Vec::new() };
    let look = |pixel: &SeenPixel| {
        let [roughness, metallic] = [&roughness, &metallic].map(|map| mean(map, pixel, Turn::None)[0]);
        ScalarLook { roughness, metallic }
    };
    pixels.iter().map(look).collect()
}

/// The mean of a map over a pixel.
fn mean(texture: &Texture, pixel: &SeenPixel, turn: Turn) -> [f32; 3] {
    let sum = pixel.uvs.iter().fold([0.0; 3], |sum: [f32; 3], uv| {
        let value = texture.sample(turn.place(*uv));
        std::array::from_fn(|c| sum[c] + value[c])
    });
    sum.map(|sum| sum / pixel.uvs.len() as f32)
}

#[cfg(test)]
mod tests {
    use mateval_image::{Texels, Wrap};

    use super::*;

    /// Four different texels, turned when they were written: each turn finds the one that belongs at the upper left.
    #[test]
    fn turns_find_the_texel_that_was_moved() {
        let written = |texels: [f32; 4]| Texture::new(2, 2, Texels::Grey(texels.into()), Wrap::Clamp).unwrap();
        let upper_left = SeenPixel { uvs: [[0.25, 0.75]; 4], photo: None, tile: 0 };
        let files = [[1.0, 2.0, 3.0, 4.0], [3.0, 4.0, 1.0, 2.0], [2.0, 1.0, 4.0, 3.0], [4.0, 3.0, 2.0, 1.0]];
        for (turn, file) in Turn::ALL.into_iter().zip(files) {
            assert_eq!(mean(&written(file), &upper_left, turn)[0], 1.0, "{turn:?}");
        }
        let upper_right = SeenPixel { uvs: [[0.75, 0.75]; 4], ..upper_left };
        assert_eq!(mean(&written([1.0, 3.0, 2.0, 4.0]), &upper_right, Turn::Transposed)[0], 2.0);
    }
}
