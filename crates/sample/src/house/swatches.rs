//! Textures of furniture: up to four fields, two by two, in the single texture of a model. An unused field has opacity 0,
//! as in the data.

use mateval_image::Picture;

use super::font::Lettering;
use crate::pattern::{self, Color, noise};

/// The content of one field of a model's texture.
#[derive(Clone, Copy, Debug)]
pub enum Swatch {
    /// Wood of this colour with its grain along u.
    Wood(Color),
    /// A weave of this colour.
    Fabric(Color),
    /// A smooth surface such as metal, paint or a lampshade.
    Plain(Color),
    /// Dark letters on this colour that fill the field, for a surface `aspect` times as wide as high.
    Text { lines: &'static [&'static str], ground: Color, ink: Color, aspect: f64 },
}

impl Swatch {
    /// The colour at a point of the field, v downwards.
    fn color(&self, u: f64, v: f64) -> Color {
        match *self {
            Self::Wood(tone) => {
                let light = pattern::wood(u, v)[1] / 0.33;
                tone.map(|c| c * (0.65 + 0.35 * light))
            }
            Self::Fabric(tone) => {
                let light = pattern::fabric(u, v)[1] / 0.40;
                tone.map(|c| c * (0.7 + 0.3 * light))
            }
            Self::Plain(tone) => tone.map(|c| c * (0.97 + 0.06 * noise(u, v, 16, 16, 41))),
            Self::Text { lines, ground, ink, aspect } => {
                let edge = u.min(1.0 - u).min(v.min(1.0 - v));
                if edge > 0.03 && edge < 0.05 || Lettering::fitted(lines, [0.1; 2], [0.9; 2], aspect).covers(u, v) {
                    ink
                } else {
                    ground.map(|c| c * (0.97 + 0.06 * noise(u, v, 24, 24, 42)))
                }
            }
        }
    }
}

/// The texture of a model, `side` texels wide and high.
pub fn picture(swatches: &[Swatch], side: usize) -> Picture<[u8; 4]> {
    let half = side / 2;
    Picture::from_fn(side, side, |x, y| {
        let Some(swatch) = swatches.get(x / half + 2 * (y / half)) else { return [128, 128, 128, 0] };
        let at = |texel: usize| (texel % half) as f64 / half as f64 + 0.5 / half as f64;
        let [r, g, b] = swatch.color(at(x), at(y)).map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
        [r, g, b, 255]
    })
}

/// The lower left corner and the width of a field in texture coordinates, v upwards, inset by two texels on every side.
pub fn field(number: usize, side: usize) -> ([f64; 2], f64) {
    let inset = 2.0 / side as f64;
    let (column, row) = ((number % 2) as f64, (number / 2) as f64);
    ([column / 2.0 + inset, 0.5 - row / 2.0 + inset], 0.5 - 2.0 * inset)
}
