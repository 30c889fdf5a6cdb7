//! Reads and writes pictures as PNG: previews, ids and masks, without text, time or gamma chunks.

use std::io::Cursor;
use std::path::Path;

use crate::limits::{check_size, read_file};
use crate::store::write_whole;
use crate::transfer::byte_from_unit;
use crate::{ImageError, Mask, Picture, SrgbRgb};

/// Writes 8-bit RGB, clipped to 0..1.
pub fn write_srgb(path: &Path, picture: &Picture<SrgbRgb>) -> Result<(), ImageError> {
    write_rgb_bytes(path, &picture.map(|p| p.0.map(byte_from_unit)))
}

/// Writes 8-bit RGB from bytes.
pub fn write_rgb_bytes(path: &Path, picture: &Picture<[u8; 3]>) -> Result<(), ImageError> {
    let data = picture.pixels().as_flattened();
    write(path, picture.width(), picture.height(), png::ColorType::Rgb, png::BitDepth::Eight, data)
}

/// Writes 8-bit RGB with opacity from bytes.
pub fn write_rgba_bytes(path: &Path, picture: &Picture<[u8; 4]>) -> Result<(), ImageError> {
    let data = picture.pixels().as_flattened();
    write(path, picture.width(), picture.height(), png::ColorType::Rgba, png::BitDepth::Eight, data)
}

/// Writes 8-bit grey with opacity from bytes.
pub fn write_grey_alpha_bytes(path: &Path, picture: &Picture<[u8; 2]>) -> Result<(), ImageError> {
    let data = picture.pixels().as_flattened();
    write(path, picture.width(), picture.height(), png::ColorType::GrayscaleAlpha, png::BitDepth::Eight, data)
}

/// Writes 16-bit RGB from words.
pub fn write_rgb_words(path: &Path, picture: &Picture<[u16; 3]>) -> Result<(), ImageError> {
    let data: Vec<u8> = picture.pixels().as_flattened().iter().flat_map(|word| word.to_be_bytes()).collect();
    write(path, picture.width(), picture.height(), png::ColorType::Rgb, png::BitDepth::Sixteen, &data)
}

/// Writes 8-bit grey from bytes.
pub fn write_grey_bytes(path: &Path, picture: &Picture<u8>) -> Result<(), ImageError> {
    write(path, picture.width(), picture.height(), png::ColorType::Grayscale, png::BitDepth::Eight, picture.pixels())
}

/// Writes 16-bit grey from integers: ids, or values times 65535.
pub fn write_ids(path: &Path, picture: &Picture<u16>) -> Result<(), ImageError> {
    let data: Vec<u8> = picture.pixels().iter().flat_map(|id| id.to_be_bytes()).collect();
    write(path, picture.width(), picture.height(), png::ColorType::Grayscale, png::BitDepth::Sixteen, &data)
}

/// Writes 8-bit grey: 255 where the mask is true, else 0.
pub fn write_mask(path: &Path, mask: &Mask) -> Result<(), ImageError> {
    write_grey_bytes(path, &mask.map(|counts| if counts { 255 } else { 0 }))
}

/// Reads 8-bit RGB (or RGBA, or grey; alpha is dropped) as value / 255.
pub fn read_srgb(path: &Path) -> Result<Picture<SrgbRgb>, ImageError> {
    Ok(read_rgb_bytes(path)?.map(|rgb| SrgbRgb(rgb.map(|byte| f32::from(byte) / 255.0))))
}

/// Reads 8-bit RGB (or RGBA, or grey; alpha is dropped) as bytes.
pub fn read_rgb_bytes(path: &Path) -> Result<Picture<[u8; 3]>, ImageError> {
    let raw = decode(path)?;
    if raw.depth != png::BitDepth::Eight {
        return Err(raw.unexpected(path, "8-bit RGB"));
    }
    let triple = |samples: &[u8]| match samples {
        [r, g, b] | [r, g, b, _] => [*r, *g, *b],
        [grey, ..] => [*grey; 3],
        [] => [0; 3],
    };
    Picture::new(raw.width, raw.height, raw.data.chunks_exact(raw.color.samples()).map(triple).collect())
}

/// Reads 16-bit grey as integers. Fails for any other kind.
pub fn read_ids(path: &Path) -> Result<Picture<u16>, ImageError> {
    let raw = decode(path)?;
    if (raw.color, raw.depth) != (png::ColorType::Grayscale, png::BitDepth::Sixteen) {
        return Err(raw.unexpected(path, "16-bit grey"));
    }
    Picture::new(raw.width, raw.height, raw.words())
}

/// Reads an 8-bit grey picture of 0 (false) and 255 (true). Fails for any other kind or value.
pub fn read_mask(path: &Path) -> Result<Mask, ImageError> {
    let raw = decode(path)?;
    if (raw.color, raw.depth) != (png::ColorType::Grayscale, png::BitDepth::Eight) {
        return Err(raw.unexpected(path, "8-bit grey"));
    }
    if let Some(at) = raw.data.iter().position(|byte| !matches!(byte, 0 | 255)) {
        let (x, y) = (at % raw.width, at / raw.width);
        let what = format!("pixel ({x}, {y}) of a mask is {}; expected 0 or 255", raw.data[at]);
        return Err(ImageError::Invalid { path: path.to_owned(), what });
    }
    Picture::new(raw.width, raw.height, raw.data.iter().map(|byte| *byte == 255).collect())
}

fn write(
    path: &Path,
    width: usize,
    height: usize,
    color: png::ColorType,
    depth: png::BitDepth,
    data: &[u8],
) -> Result<(), ImageError> {
    let side = |pixels: usize| {
        u32::try_from(pixels).map_err(|_| ImageError::Unsupported {
            path: path.to_owned(),
            what: format!("a side of {pixels} pixels; PNG holds at most {}", u32::MAX),
        })
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side(width)?, side(height)?);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(data))
        .map_err(|error| ImageError::Unsupported { path: path.to_owned(), what: error.to_string() })?;
    write_whole(path, &bytes)
}

/// A decoded PNG, with palettes and samples of fewer than eight bits expanded.
pub(crate) struct Raw {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) color: png::ColorType,
    pub(crate) depth: png::BitDepth,
    pub(crate) data: Vec<u8>,
}

impl Raw {
    /// The 16-bit samples.
    pub(crate) fn words(&self) -> Vec<u16> {
        self.data.as_chunks::<2>().0.iter().map(|pair| u16::from_be_bytes(*pair)).collect()
    }

    fn unexpected(&self, path: &Path, expected: &str) -> ImageError {
        let what = format!("expected {expected}, found {}-bit {:?}", self.depth as u8, self.color);
        ImageError::Invalid { path: path.to_owned(), what }
    }
}

fn decode(path: &Path) -> Result<Raw, ImageError> {
    decode_bytes(path, read_file(path)?)
}

/// Decodes a file's bytes. Text and profiles are skipped, since they may unpack to a thousand times their size.
pub(crate) fn decode_bytes(path: &Path, bytes: Vec<u8>) -> Result<Raw, ImageError> {
    let invalid = |error: png::DecodingError| ImageError::Invalid {
        path: path.to_owned(),
        what: format!("not a valid PNG: {error}"),
    };
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    decoder.set_limits(png::Limits { bytes: 1 << 28 });
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let header = decoder.read_header_info().map_err(invalid)?;
    check_size(path, u64::from(header.width), u64::from(header.height))?;
    let mut reader = decoder.read_info().map_err(invalid)?;
    let size = reader.output_buffer_size().ok_or_else(|| ImageError::Unsupported {
        path: path.to_owned(),
        what: "more bytes than this machine can address".to_owned(),
    })?;
    let mut data = vec![0; size];
    let info = reader.next_frame(&mut data).map_err(invalid)?;
    data.truncate(info.buffer_size());
    Ok(Raw {
        width: info.width as usize,
        height: info.height as usize,
        color: info.color_type,
        depth: info.bit_depth,
        data,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trips() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let ids = Picture::from_fn(7, 5, |x, y| (x * 9000 + y) as u16);
        write_ids(&path, &ids).unwrap();
        assert_eq!(read_ids(&path).unwrap(), ids);
        let mask = Picture::from_fn(7, 5, |x, y| (x + y) % 2 == 0);
        write_mask(&path, &mask).unwrap();
        assert_eq!(read_mask(&path).unwrap(), mask);
        let colors = Picture::from_fn(7, 5, |x, y| [x as u8, y as u8, 200]);
        write_rgb_bytes(&path, &colors).unwrap();
        assert_eq!(read_rgb_bytes(&path).unwrap(), colors);
        write_rgba_bytes(&path, &colors.map(|[r, g, b]| [r, g, b, 9])).unwrap();
        assert_eq!(read_rgb_bytes(&path).unwrap(), colors);
        assert_eq!(decode(&path).unwrap().data[..4], [0, 0, 200, 9]);
        write_grey_alpha_bytes(&path, &colors.map(|[r, _, _]| [r, 9])).unwrap();
        assert_eq!(read_rgb_bytes(&path).unwrap(), colors.map(|[r, _, _]| [r; 3]));
    }

    #[test]
    fn kinds_are_not_mistaken() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_grey_bytes(&path, &Picture::filled(2, 2, 7)).unwrap();
        assert!(read_mask(&path).unwrap_err().to_string().contains("is 7; expected 0 or 255"));
        assert!(read_ids(&path).unwrap_err().to_string().contains("expected 16-bit grey"));
    }

    /// A tiny file whose header claims 100000 x 100000 pixels takes no memory.
    #[test]
    fn a_huge_header_is_refused_before_memory_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bomb.png");
        std::fs::write(&path, header_only(100_000, 100_000)).unwrap();
        assert!(read_srgb(&path).unwrap_err().to_string().contains("100000x100000"));
    }

    #[test]
    fn truncation_anywhere_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_ids(&path, &Picture::from_fn(40, 40, |x, y| (x * y) as u16)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for length in 0..bytes.len() - 12 {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(read_ids(&path).is_err(), "{length} of {} bytes", bytes.len());
        }
    }

    fn header_only(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        drop(encoder.write_header().unwrap());
        bytes
    }
}
