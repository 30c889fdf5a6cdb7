//! Reads and writes pictures as PNG: previews, ids and masks, without text, time or gamma chunks; writes JPEG for
//! pages.
//!
//! [`PngHeader`] states what a file holds, without decoding pixels.

use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::Path;

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use mateval_files::whole::write_whole;

use crate::limits::{Malformed, check_size, read_file};
use crate::transfer::byte_from_unit;
use crate::{ImageError, Mask, Picture, SrgbRgb, Texels, Texture, Wrap};

/// Writes 8-bit RGB, clipped to 0..1.
pub fn write_srgb(path: &Path, picture: &Picture<SrgbRgb>) -> Result<(), ImageError> {
    write_rgb_bytes(path, &picture.map(|p| p.0.map(byte_from_unit)))
}

/// Writes 8-bit RGB from bytes.
pub fn write_rgb_bytes(path: &Path, picture: &Picture<[u8; 3]>) -> Result<(), ImageError> {
    write(path, picture, (png::ColorType::Rgb, png::BitDepth::Eight), picture.pixels().as_flattened())
}

/// Writes 8-bit RGB with opacity from bytes.
pub fn write_rgba_bytes(path: &Path, picture: &Picture<[u8; 4]>) -> Result<(), ImageError> {
    write(path, picture, (png::ColorType::Rgba, png::BitDepth::Eight), picture.pixels().as_flattened())
}

/// Writes 8-bit grey with opacity from bytes.
pub fn write_grey_alpha_bytes(path: &Path, picture: &Picture<[u8; 2]>) -> Result<(), ImageError> {
    write(path, picture, (png::ColorType::GrayscaleAlpha, png::BitDepth::Eight), picture.pixels().as_flattened())
}

/// Writes 16-bit RGB from words.
pub fn write_rgb_words(path: &Path, picture: &Picture<[u16; 3]>) -> Result<(), ImageError> {
    let data: Vec<u8> = picture.pixels().as_flattened().iter().flat_map(|word| word.to_be_bytes()).collect();
    write(path, picture, (png::ColorType::Rgb, png::BitDepth::Sixteen), &data)
}

/// Writes 8-bit grey from bytes.
pub fn write_grey_bytes(path: &Path, picture: &Picture<u8>) -> Result<(), ImageError> {
    write(path, picture, (png::ColorType::Grayscale, png::BitDepth::Eight), picture.pixels())
}

/// Writes 16-bit grey from integers: ids, or values times 65535.
pub fn write_ids(path: &Path, picture: &Picture<u16>) -> Result<(), ImageError> {
    let data: Vec<u8> = picture.pixels().iter().flat_map(|id| id.to_be_bytes()).collect();
    write(path, picture, (png::ColorType::Grayscale, png::BitDepth::Sixteen), &data)
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
    Picture::new(raw.width, raw.height, triples(&raw.data, raw.color.samples()))
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
        return Err(ImageError::invalid(path, what));
    }
    Picture::new(raw.width, raw.height, raw.data.iter().map(|byte| *byte == 255).collect())
}

/// Reads 8- or 16-bit grey as whole numbers from the bytes of an untrusted file; `path` serves for errors only. A
/// palette would hide which number is meant, so that such a file is refused like any other kind.
pub fn numbers_of_bytes(path: &Path, bytes: Vec<u8>) -> Result<Picture<u16>, ImageError> {
    let raw = decode_bytes(path, bytes)?;
    let numbers = match (raw.color, raw.depth) {
        (png::ColorType::Grayscale, png::BitDepth::Eight) => raw.data.iter().map(|byte| u16::from(*byte)).collect(),
        (png::ColorType::Grayscale, png::BitDepth::Sixteen) => raw.words(),
        _ => return Err(raw.unexpected(path, "8- or 16-bit grey, whose numbers are regions")),
    };
    Picture::new(raw.width, raw.height, numbers)
}

type PixelFormat = (png::ColorType, png::BitDepth);

fn write<T: Copy>(path: &Path, picture: &Picture<T>, format: PixelFormat, data: &[u8]) -> Result<(), ImageError> {
    let bytes = file_bytes(picture, format, data).map_err(|what| ImageError::unsupported(path, what))?;
    Ok(write_whole(path, &bytes)?)
}

fn file_bytes<T: Copy>(picture: &Picture<T>, (color, depth): PixelFormat, data: &[u8]) -> Result<Vec<u8>, String> {
    let side = |pixels: usize| {
        u32::try_from(pixels).map_err(|_| format!("a side of {pixels} pixels; PNG holds at most {}", u32::MAX))
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, side(picture.width())?, side(picture.height())?);
    encoder.set_color(color);
    encoder.set_depth(depth);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(data));
    written.map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// The bytes of a file of 8-bit RGB. Fails for sizes that PNG cannot hold.
pub fn rgb_file(picture: &Picture<[u8; 3]>) -> Result<Vec<u8>, String> {
    file_bytes(picture, (png::ColorType::Rgb, png::BitDepth::Eight), picture.pixels().as_flattened())
}

/// The bytes of a file of 8-bit grey. Fails for sizes that PNG cannot hold.
pub fn grey_file(picture: &Picture<u8>) -> Result<Vec<u8>, String> {
    file_bytes(picture, (png::ColorType::Grayscale, png::BitDepth::Eight), picture.pixels())
}

/// A decoded PNG, with palettes and samples of fewer than eight bits expanded.
struct Raw {
    width: usize,
    height: usize,
    color: png::ColorType,
    depth: png::BitDepth,
    data: Vec<u8>,
}

impl Raw {
    fn words(&self) -> Vec<u16> {
        self.data.as_chunks::<2>().0.iter().map(|pair| u16::from_be_bytes(*pair)).collect()
    }

    fn unexpected(&self, path: &Path, expected: &str) -> ImageError {
        let what = format!("expected {expected}, found {}-bit {:?}", self.depth as u8, self.color);
        ImageError::invalid(path, what)
    }
}

fn decode(path: &Path) -> Result<Raw, ImageError> {
    decode_bytes(path, read_file(path)?)
}

/// Decodes a file's bytes. Text and profiles are skipped, since they may unpack to a thousand times their size.
fn decode_bytes(path: &Path, bytes: Vec<u8>) -> Result<Raw, ImageError> {
    let invalid = |error: png::DecodingError| ImageError::invalid(path, format!("not a valid PNG: {error}"));
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    decoder.set_limits(png::Limits { bytes: 1 << 28 });
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let header = decoder.read_header_info().map_err(invalid)?;
    check_size(path, u64::from(header.width), u64::from(header.height))?;
    let mut reader = decoder.read_info().map_err(invalid)?;
    let size = reader
        .output_buffer_size()
        .ok_or_else(|| ImageError::unsupported(path, "more bytes than this machine can address".to_owned()))?;
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

/// The sRGB colours of a PNG. Grey fills all three channels, alpha is dropped. `path` serves for errors only.
pub fn png_color(path: &Path, bytes: Vec<u8>) -> Result<Texture, ImageError> {
    let raw = decode_bytes(path, bytes)?;
    let texels = if raw.depth == png::BitDepth::Sixteen {
        Texels::Srgb16(triples(&raw.words(), raw.color.samples()))
    } else {
        Texels::Srgb8(triples(&raw.data, raw.color.samples()))
    };
    clamped(&raw, texels)
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
    clamped(&raw, texels)
}

fn clamped(raw: &Raw, texels: Texels) -> Result<Texture, ImageError> {
    Texture::new(raw.width, raw.height, texels, Wrap::Clamp)
}

fn triples<T: Copy>(samples: &[T], a_pixel: usize) -> Vec<[T; 3]> {
    let triple = |pixel: &[T]| match *pixel {
        [r, g, b] | [r, g, b, _] => [r, g, b],
        _ => [pixel[0]; 3],
    };
    samples.chunks_exact(a_pixel).map(triple).collect()
}

/// The picture as a JPEG file of a quality of 1 to 100; none if it has no pixels or more than 65535 a side.
pub fn jpeg_bytes(picture: &Picture<[u8; 3]>, quality: u8) -> Option<Vec<u8>> {
    let [width, height] = [picture.width(), picture.height()].map(|side| u16::try_from(side).ok().filter(|s| *s > 0));
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality.clamp(1, 100))
        .encode(picture.pixels().as_flattened(), width?.into(), height?.into(), ExtendedColorType::Rgb8)
        .ok()?;
    Some(bytes)
}

/// The first bytes of a PNG.
pub const PNG_SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PngColor {
    Grey,
    Rgb,
    /// Indices into a palette.
    Palette,
    GreyAlpha,
    /// Red, green, blue with opacity.
    Rgba,
}

impl PngColor {
    /// The name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grey => "grey",
            Self::Rgb => "RGB",
            Self::Palette => "palette",
            Self::GreyAlpha => "grey with alpha",
            Self::Rgba => "RGB with alpha",
        }
    }
}

/// The header of a PNG, and the names of its chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PngHeader {
    pub width: u32,
    pub height: u32,
    /// Bits a sample: 1, 2, 4, 8 or 16.
    pub bit_depth: u8,
    pub color: PngColor,
    /// Whether rows are interlaced (Adam7).
    pub interlaced: bool,
    pub chunks: BTreeSet<[u8; 4]>,
    /// Whether the closing chunk (IEND) exists.
    pub ended: bool,
    /// Bytes behind the closing chunk.
    pub trailing_bytes: usize,
}

impl PngHeader {
    /// Reads the header and walks over the other chunks. Fails where the first chunk is not a valid header.
    pub fn of(bytes: &[u8]) -> Result<Self, Malformed> {
        let Some(rest) = bytes.strip_prefix(PNG_SIGNATURE) else {
            return Err(Malformed("it does not begin with the signature of a PNG".to_owned()));
        };
        let mut chunks = Chunks { rest };
        let Some((b"IHDR", data)) = chunks.next() else {
            return Err(Malformed("its first chunk is not a whole header (IHDR)".to_owned()));
        };
        let mut header = Self::of_data(data)?;
        for (name, _) in chunks.by_ref() {
            header.chunks.insert(*name);
            if name == b"IEND" {
                header.ended = true;
                break;
            }
        }
        header.trailing_bytes = if header.ended { chunks.rest.len() } else { 0 };
        Ok(header)
    }

    fn of_data(data: &[u8]) -> Result<Self, Malformed> {
        let (size, &[bit_depth, color, _, _, interlace]) = data
            .split_first_chunk::<8>()
            .and_then(|(size, rest)| Some((size, <&[u8; 5]>::try_from(rest).ok()?)))
            .ok_or_else(|| Malformed(format!("its header has {} bytes; expected 13", data.len())))?;
        let side = |at: usize| u32::from_be_bytes([size[at], size[at + 1], size[at + 2], size[at + 3]]);
        let color = match color {
            0 => PngColor::Grey,
            2 => PngColor::Rgb,
            3 => PngColor::Palette,
            4 => PngColor::GreyAlpha,
            6 => PngColor::Rgba,
            found => return Err(Malformed(format!("its colour type is {found}; expected 0, 2, 3, 4 or 6"))),
        };
        Ok(Self {
            width: side(0),
            height: side(4),
            bit_depth,
            color,
            interlaced: interlace != 0,
            chunks: BTreeSet::new(),
            ended: false,
            trailing_bytes: 0,
        })
    }

    /// Whether the file has a chunk with this name, as in `iCCP`.
    pub fn has(&self, chunk: &[u8; 4]) -> bool {
        self.chunks.contains(chunk)
    }
}

/// Iterates over the names and data of chunks; ends at the first chunk that is cut off.
struct Chunks<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Chunks<'a> {
    type Item = (&'a [u8; 4], &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let (length, rest) = self.rest.split_first_chunk::<4>()?;
        let (name, rest) = rest.split_first_chunk::<4>()?;
        let (data, rest) = rest.split_at_checked(u32::from_be_bytes(*length) as usize)?;
        let (_, rest) = rest.split_first_chunk::<4>()?;
        self.rest = rest;
        Some((name, data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture_io::{Encoding, texture_of_bytes};
    use crate::{Texels, Wrap};

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

    fn written() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_rgba_bytes(&path, &Picture::filled(5, 3, [1; 4])).unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn the_header_of_a_written_picture() {
        let header = PngHeader::of(&written()).unwrap();
        assert_eq!((header.width, header.height, header.bit_depth, header.color), (5, 3, 8, PngColor::Rgba));
        assert!(header.ended && header.has(b"IDAT") && !header.has(b"gAMA") && !header.interlaced);
        assert_eq!(header.trailing_bytes, 0);
    }

    #[test]
    fn what_is_cut_has_no_end_and_what_follows_is_counted() {
        let mut bytes = written();
        for length in 33..bytes.len() - 1 {
            assert!(!PngHeader::of(&bytes[..length]).unwrap().ended, "{length}");
        }
        for length in 0..33 {
            assert!(PngHeader::of(&bytes[..length]).is_err(), "{length}");
        }
        bytes.extend(b"more");
        assert_eq!(PngHeader::of(&bytes).unwrap().trailing_bytes, 4);
    }
}
