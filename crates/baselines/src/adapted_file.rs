//! The files of one map of a method, as its adapter describes them.

use std::path::{Path, PathBuf};

use mateval_image::texture_io::{self, read_texture};
use mateval_image::{LinearRgb, Picture, Texture, Wrap};
use mateval_scene::stored_encoding::StoredEncoding;
use serde::Deserialize;

use crate::error::{AdapterError, BaselineError};
use crate::scale::Scale;

/// The placeholder for the scene's id in a path.
const SCENE: &str = "{scene}";

/// The largest linear value of an estimate. Materials end at 1 or little above; far larger numbers, such as those from 0 to
/// 255, have another range than the adapter states.
const LARGEST: f32 = 16.0;
/// Larger linear values are more than highlights and the noise of a network.
const BRIGHT: f32 = 1.5;
/// A larger share of pixels above [`BRIGHT`] has another range than the adapter states, unless its scale is free.
const MOST_BRIGHT: f64 = 0.01;

/// The largest 16-bit integer.
const LARGEST_WORD: f32 = 65535.0;
/// 16-bit integers that end between these numbers are bytes that were saved as words.
const LARGEST_BYTE: std::ops::RangeInclusive<f32> = 128.0..=255.0;

/// Numbers below this, in the adapter's range, are more than the noise of a network.
const LEAST: f32 = -0.1;
/// A larger share of pixels below [`LEAST`] has another range than the adapter states.
const MOST_BELOW: f64 = 0.01;

/// The files of one map.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdaptedFile {
    /// Candidate paths below the folder of estimates; the first that exists is read. `{scene}` stands for the scene's
    /// id.
    pub files: Vec<String>,
    /// Transfer function of the stored numbers.
    pub encoding: StoredEncoding,
    /// Whether the method's authors state the encoding, in words or by code. Where they do not, submissions name it in
    /// `assumed_encodings`.
    #[serde(default = "stated")]
    pub encoding_stated: bool,
    /// The stored numbers that stand for 0 and 1, after integers are divided by the largest value of their type.
    #[serde(default = "unit_range")]
    pub range: [f32; 2],
    /// Whether the values are known only up to a factor.
    #[serde(default)]
    pub scale: Scale,
    /// The channel that holds roughness or metallic; the first if absent. `base_color` must have none.
    #[serde(default)]
    pub channel: Option<Channel>,
    /// Whether a scene may lack the file; it then has no such map.
    #[serde(default)]
    pub optional: bool,
}

fn stated() -> bool {
    true
}

fn unit_range() -> [f32; 2] {
    [0.0, 1.0]
}

/// A channel of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Red.
    R,
    /// Green.
    G,
    /// Blue.
    B,
}

/// The numbers of a file before decoding.
pub(crate) struct Stored {
    /// The file.
    path: PathBuf,
    /// Its numbers, with those of `range` mapped to 0 and 1.
    pub(crate) numbers: Picture<[f32; 3]>,
}

impl AdaptedFile {
    /// Fails where no path is given, or where the range is empty or not finite.
    pub(crate) fn check(&self) -> Result<(), AdapterError> {
        if self.files.is_empty() {
            return Err(AdapterError::NoFiles);
        }
        if !(self.range[1] > self.range[0] && self.range.iter().all(|v| v.is_finite())) {
            return Err(AdapterError::Range(self.range));
        }
        Ok(())
    }

    /// The linear picture; `channel` selects a scalar, which is repeated in all three channels. None where an optional
    /// file is missing.
    pub(crate) fn read(
        &self,
        folder: &Path,
        scene: &str,
        channel: Option<Channel>,
    ) -> Result<Option<Picture<LinearRgb>>, BaselineError> {
        let Some(Stored { path, numbers }) = self.stored(folder, scene, channel)? else { return Ok(None) };
        let below = numbers.pixels().iter().filter(|rgb| rgb.iter().any(|value| *value < LEAST)).count();
        if below as f64 > MOST_BELOW * numbers.pixels().len() as f64 {
            let value = numbers.pixels().iter().flatten().copied().filter(|v| v.is_finite()).fold(0.0, f32::min);
            return Err(BaselineError::TooSmall { path, value, share: below as f64 / numbers.pixels().len() as f64 });
        }
        let picture = numbers.map(|rgb| LinearRgb(rgb.map(|value| self.encoding.decode(value))));
        let picture = self.scale.apply(picture);
        let too_large = |rgb: &LinearRgb| rgb.0.into_iter().find(|value| value.is_finite() && value.abs() > LARGEST);
        if let Some(value) = picture.pixels().iter().find_map(too_large) {
            return Err(BaselineError::TooLarge { path, value, largest: LARGEST });
        }
        if let Some(at) = picture.pixels().iter().position(|LinearRgb(rgb)| !rgb.iter().all(|v| v.is_finite())) {
            let pixel = (at % picture.width(), at / picture.width());
            return Err(BaselineError::NotFinite { path, pixel });
        }
        let bright = picture.pixels().iter().filter(|LinearRgb(rgb)| rgb.iter().any(|v| *v > BRIGHT)).count();
        let share = bright as f64 / picture.pixels().len() as f64;
        if self.scale == Scale::Absolute && share > MOST_BRIGHT {
            let value = picture.pixels().iter().flat_map(|LinearRgb(rgb)| *rgb).fold(0.0, f32::max);
            return Err(BaselineError::ManyTooLarge { path, value, bright: BRIGHT, share });
        }
        Ok(Some(picture))
    }

    /// The stored numbers; absent if an optional file is missing. Fails where 16-bit integers are those of bytes and the
    /// adapter does not say so, since all values would be near 0.
    pub(crate) fn stored(
        &self,
        folder: &Path,
        scene: &str,
        channel: Option<Channel>,
    ) -> Result<Option<Stored>, BaselineError> {
        let path = match self.path(folder, scene) {
            Err(BaselineError::NoEstimate { .. }) if self.optional => return Ok(None),
            path => path?,
        };
        // Read without decoding: the adapter states the encoding, of float files too.
        let stored = read_texture(&path, texture_io::Encoding::Linear, Wrap::Clamp)?;
        if self.range == unit_range()
            && self.scale == Scale::Absolute
            && let Some(largest) = largest_byte_of_words(&stored)
        {
            return Err(BaselineError::BytesInWords { path, largest, high: largest_byte_share() });
        }
        let [low, high] = self.range;
        let numbers = Picture::from_fn(stored.width(), stored.height(), |x, y| {
            selected(channel, stored.texel(x, y)).map(|value| (value - low) / (high - low))
        });
        Ok(Some(Stored { path, numbers }))
    }

    /// The first path that exists.
    pub(crate) fn path(&self, folder: &Path, scene: &str) -> Result<PathBuf, BaselineError> {
        let paths: Vec<PathBuf> = self.files.iter().map(|file| folder.join(file.replace(SCENE, scene))).collect();
        let found = paths.iter().find(|path| path.is_file()).cloned();
        found.ok_or(BaselineError::NoEstimate { paths })
    }
}

/// What a byte's largest number is as a share of a 16-bit integer's.
fn largest_byte_share() -> f32 {
    LARGEST_BYTE.end() / LARGEST_WORD
}

/// The largest number of 16-bit integers that are those of bytes; `None` for all other numbers.
fn largest_byte_of_words(stored: &Texture) -> Option<u8> {
    let mut largest: f32 = 0.0;
    for (x, y) in (0..stored.height()).flat_map(|y| (0..stored.width()).map(move |x| (x, y))) {
        for value in stored.texel(x, y).map(|value| value * LARGEST_WORD) {
            let is_byte = (value - value.round()).abs() < 1e-3 && (0.0..=LARGEST_BYTE.end() + 1e-3).contains(&value);
            if !is_byte {
                return None;
            }
            largest = largest.max(value.round());
        }
    }
    LARGEST_BYTE.contains(&largest).then_some(largest as u8)
}

/// The channel's value three times, or all three channels where none is selected.
fn selected(channel: Option<Channel>, rgb: [f32; 3]) -> [f32; 3] {
    match channel {
        None => rgb,
        Some(Channel::R) => [rgb[0]; 3],
        Some(Channel::G) => [rgb[1]; 3],
        Some(Channel::B) => [rgb[2]; 3],
    }
}

#[cfg(test)]
mod tests {
    use mateval_image::exr_io::{Precision, write_linear};

    use super::*;

    /// The picture in the folder's file of this name, whose adapter has these further lines.
    fn read(folder: &Path, file: &str, lines: &str) -> Result<Option<Picture<LinearRgb>>, BaselineError> {
        let text = format!("files = [\"{file}\"]\nencoding = \"linear\"\n{lines}");
        toml::from_str::<AdaptedFile>(&text).unwrap().read(folder, "s", None)
    }

    #[test]
    fn many_values_far_above_1_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let write = |bright: usize| {
            let value = |at: usize| LinearRgb([if at < bright { 6.0 } else { 0.5 }; 3]);
            let picture = Picture::from_fn(20, 20, |x, y| value(20 * y + x));
            write_linear(&folder.path().join("a.exr"), &picture, Precision::Float).unwrap();
        };
        write(40);
        let refused = read(folder.path(), "a.exr", "").unwrap_err().to_string();
        assert!(
            refused.contains("10 %") && refused.contains("up to 6") && refused.contains("range = [0, MAX]"),
            "{refused}"
        );
        // Twins: with its range, with a free scale, and with a few highlights.
        assert!(read(folder.path(), "a.exr", "range = [0, 6]").is_ok());
        assert!(read(folder.path(), "a.exr", "scale = \"free\"").is_ok());
        write(4);
        assert!(read(folder.path(), "a.exr", "").is_ok());
    }

    #[test]
    fn bytes_that_are_saved_as_words_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let write = |factor: u16| {
            let words = image::ImageBuffer::from_fn(16, 16, |x, y| image::Luma([factor * (16 * y + x) as u16]));
            words.save(folder.path().join("a.png")).unwrap();
        };
        write(1);
        let refused = read(folder.path(), "a.png", "").unwrap_err().to_string();
        assert!(refused.contains("255") && refused.contains("range = [0.0, 0.00389"), "{refused}");
        let bright = read(folder.path(), "a.png", "range = [0.0, 0.003891051]").unwrap().unwrap().get(15, 15).0[0];
        assert!((bright - 1.0).abs() < 1e-4, "{bright}");
        // Twin: integers of the whole range.
        write(257);
        assert!(read(folder.path(), "a.png", "").is_ok());
    }
}
