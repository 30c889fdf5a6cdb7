//! Textures from the bytes of PNG and OpenEXR files, the formats of a submission's maps. Text, profiles and gamma are
//! ignored.

use std::path::Path;

use crate::exr_io::{channels_of_bytes, scalar_of_bytes};
use crate::png_io::{Raw, decode_bytes};
use crate::{ImageError, Texels, Texture, Wrap};

/// The sRGB colours of a PNG. Grey fills all three channels, alpha is dropped. `path` serves for errors only.
pub fn png_color(path: &Path, bytes: Vec<u8>) -> Result<Texture, ImageError> {
    let raw = decode_bytes(path, bytes)?;
    let texels = if raw.depth == png::BitDepth::Sixteen {
        Texels::Srgb16(triples(&raw.words(), raw.color.samples()))
    } else {
        Texels::Srgb8(triples(&raw.data, raw.color.samples()))
    };
    texture(&raw, texels)
}

/// The first channel of a PNG, linear; kept as bytes if it has 8 bits, as floats if it has 16.
pub fn png_scalar(path: &Path, bytes: Vec<u8>) -> Result<Texture, ImageError> {
    let raw = decode_bytes(path, bytes)?;
    let samples = raw.color.samples();
    let texels = if raw.depth == png::BitDepth::Sixteen {
        Texels::Grey(raw.words().iter().step_by(samples).map(|word| f32::from(*word) / 65535.0).collect())
    } else {
        Texels::Grey8(raw.data.iter().step_by(samples).copied().collect())
    };
    texture(&raw, texels)
}

/// Channels `R`, `G`, `B` of an OpenEXR file, linear. Values may be NaN or infinite.
pub fn exr_color(path: &Path, bytes: &[u8]) -> Result<Texture, ImageError> {
    let (width, height, [r, g, b]) = channels_of_bytes(path, bytes, ["R", "G", "B"])?;
    let texels = r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect();
    Texture::new(width, height, Texels::Linear(texels), Wrap::Clamp)
}

/// Channel `V` (or `Y`) of an OpenEXR file. Values may be NaN or infinite.
pub fn exr_scalar(path: &Path, bytes: &[u8]) -> Result<Texture, ImageError> {
    let picture = scalar_of_bytes(path, bytes)?;
    Texture::new(picture.width(), picture.height(), Texels::Grey(picture.into_pixels()), Wrap::Clamp)
}

fn texture(raw: &Raw, texels: Texels) -> Result<Texture, ImageError> {
    Texture::new(raw.width, raw.height, texels, Wrap::Clamp)
}

fn triples<T: Copy>(samples: &[T], a_pixel: usize) -> Vec<[T; 3]> {
    let triple = |pixel: &[T]| match *pixel {
        [r, g, b] | [r, g, b, _] => [r, g, b],
        _ => [pixel[0]; 3],
    };
    samples.chunks_exact(a_pixel).map(triple).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture_io::{Encoding, read_texture};
    use crate::{Picture, png_io};

    /// The values equal those of `read_texture`, for every kind of PNG that this crate writes.
    #[test]
    fn it_reads_what_the_general_reader_reads() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let byte = |x: usize, y: usize, c: usize| (x * 31 + y * 57 + c * 91) as u8;
        let writers: [&dyn Fn(); 6] = [
            &|| {
                png_io::write_rgb_bytes(&path, &Picture::from_fn(5, 3, |x, y| [0, 1, 2].map(|c| byte(x, y, c))))
                    .unwrap()
            },
            &|| {
                png_io::write_rgba_bytes(&path, &Picture::from_fn(5, 3, |x, y| [0, 1, 2, 3].map(|c| byte(x, y, c))))
                    .unwrap();
            },
            &|| png_io::write_grey_bytes(&path, &Picture::from_fn(5, 3, |x, y| byte(x, y, 0))).unwrap(),
            &|| {
                png_io::write_grey_alpha_bytes(&path, &Picture::from_fn(5, 3, |x, y| [0, 1].map(|c| byte(x, y, c))))
                    .unwrap();
            },
            &|| {
                png_io::write_ids(&path, &Picture::from_fn(5, 3, |x, y| 999_u16.wrapping_mul(byte(x, y, 0).into())))
                    .unwrap()
            },
            &|| {
                let words =
                    Picture::from_fn(5, 3, |x, y| [0, 1, 2].map(|c| 999_u16.wrapping_mul(byte(x, y, c).into())));
                png_io::write_rgb_words(&path, &words).unwrap();
            },
        ];
        for (at, write) in writers.into_iter().enumerate() {
            write();
            let bytes = std::fs::read(&path).unwrap();
            let [srgb, linear] =
                [Encoding::Srgb, Encoding::Linear].map(|encoding| read_texture(&path, encoding, Wrap::Clamp).unwrap());
            assert_eq!(png_color(&path, bytes.clone()).unwrap(), srgb, "{at}");
            let scalar = png_scalar(&path, bytes).unwrap();
            for (x, y) in (0..3).flat_map(|y| (0..5).map(move |x| (x, y))) {
                assert_eq!(scalar.texel(x, y), [linear.texel(x, y)[0]; 3], "{at}");
            }
        }
    }
}
