//! The header of an OpenEXR file, read without decoding pixels: size, channels and storage.

use std::io::Cursor;

use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};

/// The first bytes of an OpenEXR file.
pub const EXR_SIGNATURE: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// The chromaticities x and y of the red, green, blue and white of Rec. 709.
const REC_709: [f32; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];

/// How a channel's numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExrNumber {
    /// 16-bit float.
    Half,
    /// 32-bit float.
    Float,
    /// 32-bit unsigned integer.
    Whole,
}

/// One channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExrChannel {
    /// Its name, as in `R` or `ViewLayer.Combined.R`.
    pub name: String,
    /// How its numbers are stored.
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

/// Why the headers of an OpenEXR file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ExrHeaderError {
    /// The `exr` crate cannot read it.
    #[error(transparent)]
    Unsound(#[from] exr::error::Error),
    /// Nothing follows the file's version.
    #[error("it has no parts")]
    NoPart,
}

impl ExrHeader {
    /// Reads the headers of a file from its bytes. Fails where they are not valid.
    pub fn of(bytes: &[u8]) -> Result<Self, ExrHeaderError> {
        let meta = MetaData::read_from_buffered(Cursor::new(bytes), false)?;
        let first = meta.headers.first().ok_or(ExrHeaderError::NoPart)?;
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
            channels: channels(first),
            deep: first.deep,
            tiled: matches!(first.blocks, BlockDescription::Tiles(_)),
            other_primaries: has_other_primaries(first),
            samples: meta.headers.iter().map(samples).fold(0, usize::saturating_add),
        })
    }

    /// The channel of this name.
    pub fn channel(&self, name: &str) -> Option<&ExrChannel> {
        self.channels.iter().find(|channel| channel.name == name)
    }
}

fn channels(header: &Header) -> Vec<ExrChannel> {
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
    use crate::exr_io::{self, Precision};
    use crate::{LinearRgb, Picture};

    #[test]
    fn the_header_of_a_written_picture() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        exr_io::write_linear(&path, &Picture::filled(5, 3, LinearRgb([0.5; 3])), Precision::Half).unwrap();
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
