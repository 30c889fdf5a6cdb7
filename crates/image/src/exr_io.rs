//! Reads and writes float pictures as OpenEXR: one part, scan lines, ZIP, no dates and no names of software or machine.
//!
//! Colours are channels `R`, `G`, `B` (linear Rec. 709), vectors `X`, `Y`, `Z`, scalars `V`. [`ExrHeader`] states what
//! a file holds, without decoding pixels.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use exr::prelude as ex;
use exr::prelude::traits::*;
use half::f16;
use mateval_files::whole::write_whole;

use crate::limits::{Malformed, check_size, read_file};
use crate::{ImageError, LinearRgb, Normal, Picture, Texels, Texture, Wrap};

/// Most samples of a layer in all channels together: one gibibyte as floats.
const MAX_SAMPLES: usize = 1 << 28;
/// Most blocks of a layer.
const MAX_BLOCKS: usize = 1 << 20;

/// How a float is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 16 bits: 11 bits of mantissa, up to 65504.
    Half,
    Float,
}

/// Writes channels `R`, `G`, `B`.
pub fn write_linear(path: &Path, picture: &Picture<LinearRgb>, precision: Precision) -> Result<(), ImageError> {
    write_triples(path, ["R", "G", "B"], &picture.map(|p| p.0), precision)
}

/// Writes channels `X`, `Y`, `Z`.
pub fn write_normal(path: &Path, picture: &Picture<Normal>, precision: Precision) -> Result<(), ImageError> {
    write_triples(path, ["X", "Y", "Z"], &picture.map(|p| p.0), precision)
}

/// Writes channel `V`.
pub fn write_scalar(path: &Path, picture: &Picture<f32>, precision: Precision) -> Result<(), ImageError> {
    write_channels(path, picture.width(), picture.height(), vec![("V", picture.pixels().to_vec())], precision)
}

/// Writes channel `Y`, which other programs read as a grey picture.
pub fn write_grey(path: &Path, picture: &Picture<f32>, precision: Precision) -> Result<(), ImageError> {
    write_channels(path, picture.width(), picture.height(), vec![("Y", picture.pixels().to_vec())], precision)
}

/// Reads channels `R`, `G`, `B` of the first layer. Every value must be finite.
pub fn read_linear(path: &Path) -> Result<Picture<LinearRgb>, ImageError> {
    Ok(read_triples(path, ["R", "G", "B"])?.map(LinearRgb))
}

/// Channels `R`, `G`, `B` of the first layer of an EXR's bytes, or channel `V` or `Y` three times where there is no
/// `R`. Every value must be finite, and the colours those of Rec. 709. `path` serves for errors only.
pub(crate) fn linear_or_grey_of_bytes(path: &Path, bytes: &[u8]) -> Result<Picture<LinearRgb>, ImageError> {
    let layer = first_layer(path, bytes)?;
    if ExrHeader::of(bytes).is_ok_and(|header| header.other_primaries) {
        let what = "its attribute chromaticities states other primaries than those of Rec. 709; convert its colours"
            .to_owned();
        return Err(ImageError::Unsupported { path: path.to_owned(), what });
    }
    let has = |name: &str| layer.channel_data.list.iter().any(|channel| channel.name.eq(name));
    let names = match ["V", "Y"].into_iter().find(|name| has(name)) {
        Some(grey) if !has("R") => [grey; 3],
        _ => ["R", "G", "B"],
    };
    Ok(triples(path, &layer, names)?.map(LinearRgb))
}

/// Reads channels `X`, `Y`, `Z` of the first layer. Every value must be finite.
pub fn read_normal(path: &Path) -> Result<Picture<Normal>, ImageError> {
    Ok(read_triples(path, ["X", "Y", "Z"])?.map(Normal))
}

/// Reads channel `V` of the first layer, or channel `Y` as other programs write it. Every value must be finite.
pub fn read_scalar(path: &Path) -> Result<Picture<f32>, ImageError> {
    let picture = scalar_of_bytes(path, &read_file(path)?)?;
    check_finite(path, picture.width(), picture.pixels().iter().map(|v| v.is_finite()))?;
    Ok(picture)
}

/// Channel `V` (or `Y`) from a file's bytes, without a check of its values.
fn scalar_of_bytes(path: &Path, bytes: &[u8]) -> Result<Picture<f32>, ImageError> {
    let layer = first_layer(path, bytes)?;
    let values = channel(path, &layer, "V").or_else(|error| channel(path, &layer, "Y").map_err(|_| error))?;
    Picture::new(layer.size.width(), layer.size.height(), values)
}

/// Channels `R`, `G`, `B` of an OpenEXR file, linear. Values may be NaN or infinite.
pub fn exr_color(path: &Path, bytes: &[u8]) -> Result<Texture, ImageError> {
    let (width, height, [r, g, b]) = planes(path, &first_layer(path, bytes)?, ["R", "G", "B"])?;
    let texels = r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect();
    Texture::new(width, height, Texels::Linear(texels), Wrap::Clamp)
}

/// Channel `V` (or `Y`) of an OpenEXR file. Values may be NaN or infinite.
pub fn exr_scalar(path: &Path, bytes: &[u8]) -> Result<Texture, ImageError> {
    let picture = scalar_of_bytes(path, bytes)?;
    Texture::new(picture.width(), picture.height(), Texels::Grey(picture.into_pixels()), Wrap::Clamp)
}

fn planes(path: &Path, layer: &FlatLayer, names: [&str; 3]) -> Result<(usize, usize, [Vec<f32>; 3]), ImageError> {
    let [a, b, c] = names.map(|name| channel(path, layer, name));
    Ok((layer.size.width(), layer.size.height(), [a?, b?, c?]))
}

/// Reads every channel of the first layer, by its full name, as in `ViewLayer.Combined.R`. Values may
/// be NaN or infinite.
pub fn read_channels(path: &Path) -> Result<BTreeMap<String, Picture<f32>>, ImageError> {
    let layer = first_layer(path, &read_file(path)?)?;
    let (width, height) = (layer.size.width(), layer.size.height());
    let names = layer.channel_data.list.iter().map(|channel| channel.name.to_string());
    names
        .map(|name| {
            let values = channel(path, &layer, &name)?;
            Ok((name, Picture::new(width, height, values)?))
        })
        .collect()
}

fn write_triples(
    path: &Path,
    names: [&'static str; 3],
    picture: &Picture<[f32; 3]>,
    precision: Precision,
) -> Result<(), ImageError> {
    let plane = |c: usize| picture.pixels().iter().map(|p| p[c]).collect();
    let channels = names.into_iter().enumerate().map(|(c, name)| (name, plane(c))).collect();
    write_channels(path, picture.width(), picture.height(), channels, precision)
}

/// Writes channels of any names, each with a value for every pixel, row by row.
pub fn write_channels(
    path: &Path,
    width: usize,
    height: usize,
    channels: Vec<(&str, Vec<f32>)>,
    precision: Precision,
) -> Result<(), ImageError> {
    let stored = |values: Vec<f32>| match precision {
        Precision::Float => ex::FlatSamples::F32(values),
        Precision::Half => ex::FlatSamples::F16(values.into_iter().map(f16::from_f32).collect()),
    };
    let channels = channels.into_iter().map(|(name, values)| ex::AnyChannel::new(name, stored(values))).collect();
    let encoding = ex::Encoding {
        compression: ex::Compression::ZIP16,
        blocks: ex::Blocks::ScanLines,
        line_order: ex::LineOrder::Increasing,
    };
    let attributes = ex::LayerAttributes::default();
    let image =
        ex::Image::from_layer(ex::Layer::new((width, height), attributes, encoding, ex::AnyChannels::sort(channels)));
    let mut bytes = Cursor::new(Vec::new());
    // One thread: the order of the blocks, and so the bytes, must not depend on the number of threads.
    image
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|error| ImageError::unsupported(path, error.to_string()))?;
    Ok(write_whole(path, bytes.get_ref())?)
}

type FlatLayer = ex::Layer<ex::AnyChannels<ex::FlatSamples>>;

fn read_triples(path: &Path, names: [&'static str; 3]) -> Result<Picture<[f32; 3]>, ImageError> {
    triples(path, &first_layer(path, &read_file(path)?)?, names)
}

fn triples(path: &Path, layer: &FlatLayer, names: [&str; 3]) -> Result<Picture<[f32; 3]>, ImageError> {
    let (width, height, [a, b, c]) = planes(path, layer, names)?;
    let pixels: Vec<[f32; 3]> = a.into_iter().zip(b).zip(c).map(|((a, b), c)| [a, b, c]).collect();
    check_finite(path, width, pixels.iter().map(|p| p.iter().all(|v| v.is_finite())))?;
    Picture::new(width, height, pixels)
}

fn first_layer(path: &Path, bytes: &[u8]) -> Result<FlatLayer, ImageError> {
    check_headers(path, bytes)?;
    let image = ex::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| invalid(path, &error))?;
    Ok(image.layer_data)
}

fn channel(path: &Path, layer: &FlatLayer, name: &str) -> Result<Vec<f32>, ImageError> {
    let channels = &layer.channel_data.list;
    let Some(found) = channels.iter().find(|channel| channel.name.eq(name)) else {
        let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
        let what = format!("expected a channel {name}, found {}", names.join(", "));
        return Err(ImageError::invalid(path, what));
    };
    if found.sampling != ex::Vec2(1, 1) {
        let what = format!("channel {name} is subsampled; expected one value a pixel");
        return Err(ImageError::unsupported(path, what));
    }
    Ok(found.sample_data.values_as_f32().collect())
}

/// Fails where a header describes a layer that is too large: decoding takes memory in proportion to samples and blocks.
fn check_headers(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|error| invalid(path, &error))?;
    for header in &meta.headers {
        check_size(path, header.layer_size.width() as u64, header.layer_size.height() as u64)?;
        let (samples, blocks) = (header.layer_size.area() * header.channels.list.len(), header.chunk_count);
        if samples > MAX_SAMPLES || blocks > MAX_BLOCKS {
            let what = format!("{samples} samples in {blocks} blocks; expected at most {MAX_SAMPLES} in {MAX_BLOCKS}");
            return Err(ImageError::invalid(path, what));
        }
    }
    Ok(())
}

fn check_finite(path: &Path, width: usize, mut finite: impl Iterator<Item = bool>) -> Result<(), ImageError> {
    match finite.position(|finite| !finite) {
        None => Ok(()),
        Some(at) => {
            let what = format!("pixel ({}, {}) is NaN or infinite; expected finite numbers", at % width, at / width);
            Err(ImageError::invalid(path, what))
        }
    }
}

fn invalid(path: &Path, error: &ex::Error) -> ImageError {
    ImageError::invalid(path, format!("not a valid OpenEXR file: {error}"))
}

/// The first bytes of an OpenEXR file.
pub const EXR_SIGNATURE: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// The chromaticities x and y of the red, green, blue and white of Rec. 709.
const REC_709: [f32; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExrNumber {
    Half,
    Float,
    Whole,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExrChannel {
    /// Its name, as in `R` or `ViewLayer.Combined.R`.
    pub name: String,
    pub number: ExrNumber,
    /// Whether it has a number only for some of the pixels.
    pub subsampled: bool,
}

/// The header of the first part, and the number of parts.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrHeader {
    /// Parts (layers) of the file.
    pub parts: usize,
    /// Pixels in a row of the data window.
    pub width: usize,
    /// Rows of the data window.
    pub height: usize,
    /// Width and height of the display window.
    pub display: (usize, usize),
    /// The channels, in the file's order.
    pub channels: Vec<ExrChannel>,
    /// Whether pixels hold lists of samples.
    pub deep: bool,
    /// Whether it is stored in tiles instead of rows.
    pub tiled: bool,
    /// Whether it states other primaries than those of Rec. 709.
    pub other_primaries: bool,
    /// The number of samples of all channels of all parts together.
    pub samples: usize,
}

impl ExrHeader {
    /// Reads the headers of a file from its bytes. Fails where they are not valid.
    pub fn of(bytes: &[u8]) -> Result<Self, Malformed> {
        let unsound = |error: ex::Error| Malformed(error.to_string());
        let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(unsound)?;
        let first = meta.headers.first().ok_or_else(|| Malformed("it has no parts".to_owned()))?;
        let display = first.shared_attributes.display_window.size;
        let samples = |header: &Header| {
            let pixels = header.layer_size.width().saturating_mul(header.layer_size.height());
            pixels.saturating_mul(header.channels.list.len())
        };
        Ok(Self {
            parts: meta.headers.len(),
            width: first.layer_size.width(),
            height: first.layer_size.height(),
            display: (display.width(), display.height()),
            channels: channels_of(first),
            deep: first.deep,
            tiled: matches!(first.blocks, BlockDescription::Tiles(_)),
            other_primaries: has_other_primaries(first),
            samples: meta.headers.iter().map(samples).fold(0, usize::saturating_add),
        })
    }

    pub fn channel(&self, name: &str) -> Option<&ExrChannel> {
        self.channels.iter().find(|channel| channel.name == name)
    }
}

fn channels_of(header: &Header) -> Vec<ExrChannel> {
    let channel = |channel: &exr::meta::attribute::ChannelDescription| ExrChannel {
        name: channel.name.to_string(),
        number: match channel.sample_type {
            SampleType::F16 => ExrNumber::Half,
            SampleType::F32 => ExrNumber::Float,
            SampleType::U32 => ExrNumber::Whole,
        },
        subsampled: channel.sampling != exr::math::Vec2(1, 1),
    };
    header.channels.list.iter().map(channel).collect()
}

fn has_other_primaries(header: &Header) -> bool {
    header.shared_attributes.chromaticities.is_some_and(|found| {
        let places = [found.red, found.green, found.blue, found.white].map(|place| [place.0, place.1]);
        places.as_flattened().iter().zip(REC_709).any(|(found, expected)| (found - expected).abs() > 1e-3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Picture<LinearRgb> {
        Picture::from_fn(33, 17, |x, y| LinearRgb([x as f32 * 0.1, y as f32, -1.5]))
    }

    #[test]
    fn float_round_trip_and_same_bytes_twice() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
        write_linear(&a, &ramp(), Precision::Float).unwrap();
        write_linear(&b, &ramp(), Precision::Float).unwrap();
        assert_eq!(read_linear(&a).unwrap(), ramp());
        assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
    }

    #[test]
    fn half_and_scalar_round_trips() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write_scalar(&path, &ramp().map(|p| p.0[0]), Precision::Half).unwrap();
        for (found, expected) in read_scalar(&path).unwrap().pixels().iter().zip(ramp().pixels()) {
            assert!((found - expected.0[0]).abs() <= expected.0[0] / 2048.0);
        }
        write_normal(&path, &ramp().map(|p| Normal(p.0)), Precision::Float).unwrap();
        assert_eq!(read_normal(&path).unwrap().get(3, 2).0, ramp().get(3, 2).0);
    }

    #[test]
    fn nan_truncated_and_wrong_channels_are_errors_that_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bad.exr");
        write_linear(&path, &Picture::filled(2, 2, LinearRgb([f32::NAN; 3])), Precision::Float).unwrap();
        assert!(read_linear(&path).unwrap_err().to_string().contains("pixel (0, 0)"));
        assert!(read_normal(&path).unwrap_err().to_string().contains("bad.exr"));
        write_linear(&path, &ramp(), Precision::Float).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for length in [0, 4, 60, bytes.len() / 2, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(read_linear(&path).is_err(), "{length} bytes");
        }
    }

    #[test]
    fn the_header_of_a_written_picture() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write_linear(&path, &Picture::filled(5, 3, LinearRgb([0.5; 3])), Precision::Half).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let header = ExrHeader::of(&bytes).unwrap();
        assert_eq!((header.parts, header.width, header.height, header.display), (1, 5, 3, (5, 3)));
        assert!(!header.deep && !header.tiled && !header.other_primaries);
        assert_eq!(header.samples, 45);
        assert_eq!(header.channel("G").map(|channel| channel.number), Some(ExrNumber::Half));
        assert_eq!(header.channel("V"), None);
        for length in [0, 4, 60] {
            assert!(ExrHeader::of(&bytes[..length]).is_err(), "{length}");
        }
    }
}
