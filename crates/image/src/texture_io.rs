//! Reads textures from untrusted PNG, JPEG, WebP, BMP, Radiance HDR, OpenEXR and NumPy files, and from the bytes of a
//! submission's maps.

use std::io::Cursor;
use std::ops::RangeInclusive;
use std::path::Path;

use image::codecs::tiff::TiffDecoder;
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ExtendedColorType, ImageDecoder, ImageFormat, ImageReader};
use mateval_files::FileError;
use mateval_files::untrusted::hint;
use tiff::decoder::Decoder;
use tiff::tags::Tag;
use tiff::{TiffError, TiffUnsupportedError};

use crate::color_profile::UNREADABLE;
use crate::exr_io::{self, EXR_SIGNATURE};
use crate::limits::{check_size, read_file};
use crate::npy_io::{self, NPY_SIGNATURE};
pub use crate::texture::Encoding;
use crate::{ImageError, Texels, Texture, Wrap};

/// Reads a texture; alpha is dropped. Every value must be finite. The first bytes decide the format, not the name.
pub fn read_texture(path: &Path, encoding: Encoding, wrap: Wrap) -> Result<Texture, ImageError> {
    let (picture, _) = read_with_alpha(path, encoding, wrap)?;
    Ok(picture)
}

/// Reads a texture from a file's bytes, of any format but OpenEXR and NumPy. `path` serves for errors only.
pub fn texture_of_bytes(path: &Path, bytes: Vec<u8>, encoding: Encoding, wrap: Wrap) -> Result<Texture, ImageError> {
    let decoded = decode(path, bytes)?;
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    Texture::new(width, height, color_texels(path, decoded, encoding)?, wrap)
}

/// Reads a texture and its alpha channel, if it has one, from a file's bytes. `path` serves for errors only.
pub fn texture_and_alpha_of_bytes(
    path: &Path,
    bytes: Vec<u8>,
    encoding: Encoding,
    wrap: Wrap,
) -> Result<(Texture, Option<Texture>), ImageError> {
    if bytes.starts_with(EXR_SIGNATURE) {
        let picture = exr_io::linear_or_grey_of_bytes(path, &bytes)?;
        let texels = Texels::Linear(picture.pixels().iter().map(|p| p.0).collect());
        return Ok((Texture::new(picture.width(), picture.height(), texels, wrap)?, None));
    }
    if bytes.starts_with(NPY_SIGNATURE) {
        return Ok((npy_io::texture_of_npy(path, &bytes, encoding, wrap)?, None));
    }
    with_alpha(path, decode(path, bytes)?, encoding, wrap)
}

/// Reads a photo in sRGB, or in linear floating-point numbers, and its alpha channel from the bytes of a TIFF. Cameras'
/// raw files are TIFF as well, whose first picture is a thumbnail: they are refused, as is every file of several pictures.
pub(crate) fn photo_of_tiff(path: &Path, bytes: &[u8]) -> Result<(Texture, Option<Texture>), ImageError> {
    const DNG_VERSION: Tag = Tag::Unknown(50706);
    const MOSAIC_SIZE: Tag = Tag::Unknown(33421);
    let invalid = |error: &dyn std::fmt::Display| ImageError::invalid(path, format!("not a valid TIFF: {error}"));
    // The decoder knows no mosaic of colour filters (photometric interpretation 32803) and no linear raw (34892).
    let mut tags = Decoder::new(Cursor::new(bytes)).map_err(|error| match error {
        TiffError::UnsupportedError(TiffUnsupportedError::UnknownInterpretation) => {
            let what = "its pixels are neither grey nor RGB, as in a camera's raw file behind colour filters; develop \
                        it, and save it as PNG or as a TIFF in RGB";
            ImageError::unsupported(path, what.to_owned())
        }
        other => invalid(&other),
    })?;
    let subfile = tags.find_tag_unsigned::<u32>(Tag::NewSubfileType).map_err(|error| invalid(&error))?;
    let is_reduced = subfile.is_some_and(|of| of & 1 == 1);
    // A tag that cannot be read is stated, too.
    let states = |tags: &mut Decoder<_>, tag| !matches!(tags.find_tag(tag), Ok(None));
    let is_raw = [DNG_VERSION, MOSAIC_SIZE, Tag::SubIfd].into_iter().any(|tag| states(&mut tags, tag));
    if is_reduced || tags.more_images() || is_raw {
        let what = "a camera's raw file, or a TIFF of several pictures; develop it, and save it as PNG or as a TIFF of \
                    one picture";
        return Err(ImageError::unsupported(path, what.to_owned()));
    }
    let profile =
        tags.find_tag(Tag::IccProfile).and_then(|value| value.map(tiff::decoder::ifd::Value::into_u8_vec).transpose());
    if profile.is_err() {
        return Err(ImageError::unsupported(path, format!("its colour profile {UNREADABLE}")));
    }
    let kind = "save it as a PNG or TIFF in grey or RGB, with 8 or 16 bits a channel";
    let mut decoder = TiffDecoder::new(Cursor::new(bytes)).map_err(|error| match error {
        image::ImageError::Unsupported(error) => ImageError::unsupported(path, format!("{error}; {kind}")),
        other => invalid(&other),
    })?;
    // Those that `ImageReader` sets for other formats.
    decoder.set_limits(image::Limits::default()).map_err(|error| invalid(&error))?;
    if matches!(decoder.original_color_type(), ExtendedColorType::Cmyk8 | ExtendedColorType::Cmyk16) {
        return Err(ImageError::unsupported(path, CMYK.to_owned()));
    }
    if decoder.original_color_type() == ExtendedColorType::L1 {
        return Err(ImageError::unsupported(path, format!("its pixels have one bit; {kind}")));
    }
    with_alpha(path, decoded(path, decoder)?, Encoding::Srgb, Wrap::Clamp)
}

pub(crate) const CMYK: &str = "its colours are CMYK, amounts of ink; convert the photo to sRGB";

fn with_alpha(
    path: &Path,
    decoded: DynamicImage,
    encoding: Encoding,
    wrap: Wrap,
) -> Result<(Texture, Option<Texture>), ImageError> {
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let alpha = decoded.color().has_alpha().then(|| alpha_texels(&decoded));
    let texels = color_texels(path, decoded, encoding)?;
    let alpha = alpha.map(|texels| Texture::new(width, height, texels, wrap)).transpose()?;
    Ok((Texture::new(width, height, texels, wrap)?, alpha))
}

/// Reads a picture's alpha channel as a texture of scalars; none for a picture without alpha.
pub fn read_alpha(path: &Path, wrap: Wrap) -> Result<Option<Texture>, ImageError> {
    let (_, alpha) = read_with_alpha(path, Encoding::Linear, wrap)?;
    Ok(alpha)
}

/// Reads a texture and its alpha channel, if it has one.
pub fn read_with_alpha(path: &Path, encoding: Encoding, wrap: Wrap) -> Result<(Texture, Option<Texture>), ImageError> {
    texture_and_alpha_of_bytes(path, read_file(path)?, encoding, wrap)
}

/// Whether the file states that viewers should turn or mirror it. False for a file without such data.
pub fn is_turned(bytes: &[u8]) -> bool {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let decoder = reader.ok().and_then(|reader| reader.into_decoder().ok());
    let orientation = decoder.and_then(|mut decoder| decoder.orientation().ok());
    orientation.is_some_and(|orientation| orientation != Orientation::NoTransforms)
}

/// The share of texels of an alpha channel that are below 1.
pub fn transparent_share(alpha: &Texture) -> f64 {
    let below = alpha.linear_texels().filter(|value| value[0] < 1.0).count();
    below as f64 / (alpha.width() * alpha.height()) as f64
}

/// What the largest of 16-bit integers of 8, 10 and 12 bits is; of 14 bits only the last is certain enough, since
/// smaller ones are those of a dark picture.
const LARGEST_OF_BITS: [(u32, RangeInclusive<u16>); 4] =
    [(8, 128..=255), (10, 512..=1023), (12, 2048..=4095), (14, 16383..=16383)];

/// 16-bit integers that reach only the largest number of fewer bits, such as 4095 of 12: they were not scaled up when
/// they were saved, and are read as nearly black.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FewerBits {
    pub bits: u32,
    pub largest: u16,
}

impl FewerBits {
    /// The bits of a picture's 16-bit integers, where they are fewer than 16. None for other numbers.
    pub fn of(picture: &Texture) -> Option<Self> {
        let largest = match picture.texels() {
            Texels::Srgb16(words) => words.iter().flatten().copied().max()?,
            Texels::Linear(values) => largest_word(values.as_flattened())?,
            Texels::Grey(values) => largest_word(values)?,
            Texels::Srgb8(_) | Texels::Linear8(_) | Texels::Grey8(_) => return None,
        };
        Self::of_largest(largest)
    }

    /// The same of the largest of several pictures' 16-bit integers.
    pub fn of_largest(largest: u16) -> Option<Self> {
        let (bits, _) = LARGEST_OF_BITS.into_iter().find(|(_, range)| range.contains(&largest))?;
        Some(Self { bits, largest })
    }

    /// The largest number of these bits.
    pub fn full(self) -> u16 {
        ((1_u32 << self.bits) - 1) as u16
    }
}

/// The largest of 16-bit integers that were divided by 65535; absent if the numbers are no such integers, or are those
/// of bytes, which are multiples of 257.
fn largest_word(values: &[f32]) -> Option<u16> {
    let (mut largest, mut are_bytes) = (0, true);
    for value in values.iter().map(|value| value * 65535.0) {
        let whole = value.round();
        // The division and the product round to 32 bits.
        if !((value - whole).abs() <= 2.0 * f32::EPSILON * whole + 1e-4 && (0.0..=65535.0).contains(&whole)) {
            return None;
        }
        largest = largest.max(whole as u16);
        are_bytes &= (whole as u16).is_multiple_of(257);
    }
    (!are_bytes).then_some(largest)
}

fn decode(path: &Path, bytes: Vec<u8>) -> Result<DynamicImage, ImageError> {
    let hint = hint(&bytes);
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(FileError::io("read", path))?;
    if !reader.format().is_some_and(|format| format.reading_enabled() && format != ImageFormat::Tiff) {
        let what =
            format!("not a known picture format; expected PNG, JPEG, WebP, BMP, Radiance HDR, OpenEXR or NumPy{hint}");
        return Err(ImageError::unsupported(path, what));
    }
    decoded(path, reader.into_decoder().map_err(|error| invalid_picture(path, error))?)
}

fn decoded(path: &Path, decoder: impl ImageDecoder) -> Result<DynamicImage, ImageError> {
    let (width, height) = decoder.dimensions();
    check_size(path, u64::from(width), u64::from(height))?;
    DynamicImage::from_decoder(decoder).map_err(|error| invalid_picture(path, error))
}

fn invalid_picture(path: &Path, error: image::ImageError) -> ImageError {
    ImageError::invalid(path, format!("not a valid picture: {error}"))
}

fn alpha_texels(decoded: &DynamicImage) -> Texels {
    Texels::Grey8(decoded.to_rgba8().pixels().map(|p| p.0[3]).collect())
}

fn color_texels(path: &Path, decoded: DynamicImage, encoding: Encoding) -> Result<Texels, ImageError> {
    let texels = match decoded.color() {
        ColorType::Rgb32F | ColorType::Rgba32F => Texels::Linear(decoded.into_rgb32f().pixels().map(|p| p.0).collect()),
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
            let words = decoded.into_rgb16();
            match encoding {
                Encoding::Srgb => Texels::Srgb16(words.pixels().map(|p| p.0).collect()),
                Encoding::Linear => {
                    Texels::Linear(words.pixels().map(|p| p.0.map(|word| f32::from(word) / 65535.0)).collect())
                }
            }
        }
        ColorType::L8 | ColorType::La8 if encoding == Encoding::Linear => {
            Texels::Grey8(decoded.into_luma8().into_raw())
        }
        _ => {
            let bytes = decoded.into_rgb8().pixels().map(|p| p.0).collect();
            if encoding == Encoding::Srgb { Texels::Srgb8(bytes) } else { Texels::Linear8(bytes) }
        }
    };
    if let Texels::Linear(values) = &texels
        && !values.iter().flatten().all(|v| v.is_finite())
    {
        let what = "a texel is NaN or infinite; expected finite numbers".to_owned();
        return Err(ImageError::invalid(path, what));
    }
    Ok(texels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Picture, png_io};

    #[test]
    fn encodings_differ_and_grey_stays_small() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        png_io::write_rgb_bytes(&path, &Picture::filled(2, 2, [188; 3])).unwrap();
        let read = |encoding| read_texture(&path, encoding, Wrap::Repeat).unwrap().sample([0.5, 0.5])[0];
        assert!((read(Encoding::Srgb) - 0.5).abs() < 0.005);
        assert!((read(Encoding::Linear) - 188.0 / 255.0).abs() < 1e-6);
        png_io::write_grey_bytes(&path, &Picture::filled(2, 2, 51)).unwrap();
        let grey = read_texture(&path, Encoding::Linear, Wrap::Repeat).unwrap();
        assert_eq!(grey.texels(), &Texels::Grey8(vec![51; 4]));
        assert!(read_alpha(&path, Wrap::Repeat).unwrap().is_none());
    }

    #[test]
    fn rubbish_is_an_error_that_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rubbish.png");
        for bytes in [&b""[..], b"not a picture", b"\x89PNG\r\n\x1a\n", b"#?RADIANCE\n", b"\x76\x2f\x31\x01"] {
            std::fs::write(&path, bytes).unwrap();
            let error = read_texture(&path, Encoding::Srgb, Wrap::Repeat).unwrap_err();
            assert!(error.to_string().contains("rubbish.png"), "{error}");
        }
    }

    #[test]
    fn what_stands_in_place_of_a_picture_is_named() {
        let refused = |bytes: &[u8]| {
            let path = Path::new("a.png");
            texture_of_bytes(path, bytes.to_vec(), Encoding::Srgb, Wrap::Clamp).unwrap_err().to_string()
        };
        for (bytes, word) in [
            (b"version https://git-lfs.github.com/spec/v1\n".as_slice(), "git lfs pull"),
            (b"<!doctype html><html>", "web page"),
            (b"\0\0\0\x18ftypheic\0\0\0\0", "HEIC"),
            // Kinds that the decoder knows and does not read.
            (b"II*\0\x08\0\0\0\0\0", "a TIFF picture (or a camera's raw file); convert it to PNG"),
            (b"DDS |\0\0\0\x07\x10", "a DDS texture; convert it to PNG"),
            (b"GIF89a\x01\0\x01\0", "GIF"),
            (b"\0\0\0\x1cftypavif\0\0\0\0", "AVIF"),
            (b"\xff\x0a\x7a\x1f", "JPEG XL"),
            (b"\xabKTX 20\xbb\r\n\x1a\n", "KTX2"),
            (b"8BPS\0\x01\0\0", "Photoshop"),
        ] {
            let error = refused(bytes);
            assert!(error.contains("not a known picture format") && error.contains(word), "{error}");
        }
    }

    #[test]
    fn integers_of_fewer_bits_are_found() {
        let of = |texels: Texels| FewerBits::of(&Texture::new(2, 1, texels, Wrap::Clamp).unwrap());
        let linear = |words: [u16; 2]| of(Texels::Grey(words.map(|word| f32::from(word) / 65535.0).to_vec()));
        for (largest, bits) in [(200, 8), (1023, 10), (4095, 12), (3000, 12), (16383, 14)] {
            let found = Some(FewerBits { bits, largest });
            assert_eq!((linear([7, largest]), of(Texels::Srgb16(vec![[0; 3], [largest; 3]]))), (found, found));
        }
        // Twins: other integers, bytes of up to 15 of 255, which is 3855 of 65535, and floats.
        for words in [[7, 65535], [7, 5000], [0, 0], [257, 3855]] {
            assert_eq!(linear(words), None);
        }
        assert_eq!(of(Texels::Grey8(vec![1, 15])), None);
        assert_eq!(of(Texels::Grey(vec![0.01234, 0.06])), None);
    }

    /// Other programs write scalars as one channel.
    #[test]
    fn a_grey_exr_is_read_as_a_colour() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let read = || read_texture(&path, Encoding::Linear, Wrap::Clamp).map(|texture| texture.texel(1, 0));
        let picture = Picture::from_fn(2, 1, |x, _| x as f32 / 4.0);
        exr_io::write_grey(&path, &picture, exr_io::Precision::Float).unwrap();
        assert_eq!(read().unwrap(), [0.25; 3]);
        exr_io::write_scalar(&path, &picture, exr_io::Precision::Float).unwrap();
        assert_eq!(read().unwrap(), [0.25; 3]);
        // Twins: a vector, whose Y is no grey, beside R, and a channel of another name.
        let planes = |names: &[&'static str]| names.iter().map(|name| (*name, vec![0.0, 1.0])).collect();
        exr_io::write_channels(&path, 2, 1, planes(&["R", "Y"]), exr_io::Precision::Float).unwrap();
        assert!(read().unwrap_err().to_string().contains("expected a channel G"));
        exr_io::write_channels(&path, 2, 1, planes(&["roughness"]), exr_io::Precision::Float).unwrap();
        assert!(read().unwrap_err().to_string().contains("expected a channel R, found roughness"));
    }

    fn webp(width: u32, height: u32, bytes: &[u8], color: image::ExtendedColorType) -> Vec<u8> {
        let mut file = Vec::new();
        image::codecs::webp::WebPEncoder::new_lossless(&mut file).encode(bytes, width, height, color).unwrap();
        file
    }

    /// With and without alpha, from bytes and from a file whose name states another format.
    #[test]
    fn webp_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let pixels = [255, 0, 51, 0, 51, 255, 51, 255, 0, 0, 0, 102];
        let file = webp(2, 2, &pixels, image::ExtendedColorType::Rgb8);
        let read = texture_of_bytes(Path::new("a"), file.clone(), Encoding::Linear, Wrap::Clamp).unwrap();
        assert_eq!((read.texel(0, 0), read.texel(1, 1)), ([1.0, 0.0, 0.2], [0.0, 0.0, 0.4]));
        std::fs::write(&path, file).unwrap();
        assert_eq!(read_texture(&path, Encoding::Linear, Wrap::Clamp).unwrap().texel(0, 0), [1.0, 0.0, 0.2]);
        std::fs::write(&path, webp(1, 2, &[255, 0, 51, 0, 0, 0, 0, 102], image::ExtendedColorType::Rgba8)).unwrap();
        let alpha = read_alpha(&path, Wrap::Clamp).unwrap().unwrap();
        assert_eq!((alpha.texel(0, 0)[0], alpha.texel(0, 1)[0]), (0.0, 0.4));
    }

    /// Cut anywhere it is an error, and one that claims 16383 x 16383 pixels is refused by its header.
    #[test]
    fn unsound_webp_is_refused() {
        let sound = webp(40, 30, &[77; 40 * 30 * 3], image::ExtendedColorType::Rgb8);
        let read = |bytes: &[u8]| texture_of_bytes(Path::new("a.webp"), bytes.to_vec(), Encoding::Linear, Wrap::Clamp);
        assert!(read(&sound).is_ok());
        for length in (0..sound.len() - 4).step_by(3) {
            assert!(read(&sound[..length]).unwrap_err().to_string().contains("a.webp"), "{length}");
        }
        // Bytes 21 to 24 of a lossless file hold both sides, less one, in 14 bits each (RFC 9649, section 3.4).
        let mut huge = sound.clone();
        huge[21..25].copy_from_slice(&0x0fff_bffe_u32.to_le_bytes());
        let refused = read(&huge).unwrap_err().to_string();
        assert!(refused.contains("16383x16383 pixels; expected"), "{refused}");
    }

    /// The values equal those of `read_texture`, for every kind of PNG that this crate writes.
    #[test]
    fn it_reads_what_the_general_reader_reads() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let byte = |x: usize, y: usize, c: usize| (x * 31 + y * 57 + c * 91) as u8;
        let word = |x: usize, y: usize, c: usize| 999_u16.wrapping_mul(byte(x, y, c).into());
        let rgb = Picture::from_fn(5, 3, |x, y| [0, 1, 2].map(|c| byte(x, y, c)));
        let rgba = Picture::from_fn(5, 3, |x, y| [0, 1, 2, 3].map(|c| byte(x, y, c)));
        let grey_alpha = rgb.map(|[grey, alpha, _]| [grey, alpha]);
        let words = Picture::from_fn(5, 3, |x, y| [0, 1, 2].map(|c| word(x, y, c)));
        let writers: [&dyn Fn() -> Result<(), ImageError>; 6] = [
            &|| png_io::write_rgb_bytes(&path, &rgb),
            &|| png_io::write_rgba_bytes(&path, &rgba),
            &|| png_io::write_grey_bytes(&path, &rgb.map(|[grey, ..]| grey)),
            &|| png_io::write_grey_alpha_bytes(&path, &grey_alpha),
            &|| png_io::write_ids(&path, &words.map(|[id, ..]| id)),
            &|| png_io::write_rgb_words(&path, &words),
        ];
        for (at, write) in writers.into_iter().enumerate() {
            write().unwrap();
            let bytes = std::fs::read(&path).unwrap();
            let [srgb, linear] =
                [Encoding::Srgb, Encoding::Linear].map(|encoding| read_texture(&path, encoding, Wrap::Clamp).unwrap());
            assert_eq!(png_io::png_color(&path, bytes.clone()).unwrap(), srgb, "{at}");
            let scalar = png_io::png_scalar(&path, bytes).unwrap();
            for (x, y) in (0..3).flat_map(|y| (0..5).map(move |x| (x, y))) {
                assert_eq!(scalar.texel(x, y), [linear.texel(x, y)[0]; 3], "{at}");
            }
        }
    }
}
