//! JPEG bytes, for pictures that only people look at: they are small, and not exact.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use crate::Picture;

/// Most pixels in a row and most rows.
pub const MAX_JPEG_SIDE: usize = u16::MAX as usize;

/// The picture as a JPEG file of a quality of 1 to 100; none if it has no pixels or more than [`MAX_JPEG_SIDE`] a side.
pub fn jpeg_bytes(picture: &Picture<[u8; 3]>, quality: u8) -> Option<Vec<u8>> {
    let [width, height] = [picture.width(), picture.height()].map(|side| u16::try_from(side).ok().filter(|s| *s > 0));
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality.clamp(1, 100))
        .encode(picture.pixels().as_flattened(), width?.into(), height?.into(), ExtendedColorType::Rgb8)
        .ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture_io::{Encoding, texture_of_bytes};
    use crate::{Texels, Wrap};

    #[test]
    fn colours_survive_roughly_and_bytes_are_the_same() {
        let picture = Picture::from_fn(40, 24, |x, y| [(6 * x) as u8, (10 * y) as u8, 128]);
        let bytes = jpeg_bytes(&picture, 90).unwrap();
        assert_eq!(bytes, jpeg_bytes(&picture, 90).unwrap());
        let read = texture_of_bytes("a.jpg".as_ref(), bytes, Encoding::Srgb, Wrap::Clamp).unwrap();
        let Texels::Srgb8(texels) = read.into_texels() else { panic!("a JPEG of colours has bytes") };
        let worst = texels.iter().zip(picture.pixels()).flat_map(|(a, b)| (0..3).map(|c| a[c].abs_diff(b[c]))).max();
        assert!((1..12).contains(&worst.unwrap()), "{worst:?}");
        assert_eq!(jpeg_bytes(&Picture::filled(1 << 16, 1, [0; 3]), 90), None);
    }
}
