//! Adapters: TOML files that state which pictures a method writes and how their numbers are encoded.
//!
//! `adapters/` holds those of known methods. Support for another method needs another file, and no code.

use std::path::{Path, PathBuf};

use mateval_image::texture_io::{self, read_texture};
use mateval_image::transfer::linear_from_srgb;
use mateval_image::{LinearRgb, Picture, Wrap};
use serde::Deserialize;

use crate::error::{AdapterError, BaselineError};
use crate::estimate::Estimate;

/// The placeholder for the scene's id in a path.
const SCENE: &str = "{scene}";
/// After a picture of free scale is scaled, this share of its pixels has its largest channel at or below 1.
const FREE_SCALE_SHARE: f64 = 0.99;

/// The built-in adapters, by name.
const BUILT_IN: [(&str, &str); 5] = [
    ("colorful-shading", include_str!("../adapters/colorful-shading.toml")),
    ("intrinsic", include_str!("../adapters/intrinsic.toml")),
    ("marigold", include_str!("../adapters/marigold.toml")),
    ("plain", include_str!("../adapters/plain.toml")),
    ("rgbx", include_str!("../adapters/rgbx.toml")),
];

/// The pictures of a method.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adapter {
    /// The method's name.
    pub name: String,
    /// A description for people.
    #[serde(default)]
    pub about: String,
    /// Base colour.
    pub base_color: Option<AdaptedFile>,
    /// Perceptual roughness.
    pub roughness: Option<AdaptedFile>,
    /// Metallic.
    pub metallic: Option<AdaptedFile>,
}

/// The files of one map.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdaptedFile {
    /// Candidate paths below the folder of estimates; the first that exists is read. `{scene}` stands for the scene's id.
    pub files: Vec<String>,
    /// Transfer function of the stored numbers.
    pub encoding: Encoding,
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

fn unit_range() -> [f32; 2] {
    [0.0, 1.0]
}

/// Transfer function of stored numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// Linear.
    Linear,
    /// IEC 61966-2-1.
    Srgb,
    /// A power of 2.2.
    Gamma22,
}

impl Encoding {
    /// The linear value of a stored number; negative numbers count as 0.
    pub fn decode(self, stored: f32) -> f32 {
        let stored = stored.max(0.0);
        match self {
            Self::Linear => stored,
            Self::Srgb => linear_from_srgb(stored),
            Self::Gamma22 => libm::powf(stored, 2.2),
        }
    }
}

/// Whether values are known absolutely.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// The values are used as they are.
    #[default]
    Absolute,
    /// The values are known up to one factor: they are scaled so that the 99th percentile of the pixels' largest channel
    /// is 1.
    Free,
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

impl Adapter {
    /// The built-in adapter with this name, or else the adapter in the file at this path.
    pub fn find(name: &str) -> Result<Self, BaselineError> {
        if let Some((_, text)) = BUILT_IN.iter().find(|(known, _)| *known == name) {
            return Self::parse(text, Path::new(name));
        }
        let path = Path::new(name);
        if !path.is_file() {
            return Err(BaselineError::NoAdapter { name: name.to_owned(), known: Self::names().join(", ") });
        }
        let text = std::fs::read_to_string(path);
        let text = text.map_err(|source| BaselineError::Io { action: "read", path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// The names of the built-in adapters.
    pub fn names() -> [&'static str; BUILT_IN.len()] {
        BUILT_IN.map(|(name, _)| name)
    }

    fn parse(text: &str, path: &Path) -> Result<Self, BaselineError> {
        let invalid = |source: AdapterError| BaselineError::BadAdapter { path: path.to_owned(), source };
        let adapter: Self = toml::from_str(text).map_err(|error| invalid(error.into()))?;
        let maps = [&adapter.base_color, &adapter.roughness, &adapter.metallic];
        if maps.iter().all(|map| map.is_none()) {
            return Err(invalid(AdapterError::NoMap));
        }
        if adapter.base_color.as_ref().is_some_and(|file| file.channel.is_some()) {
            return Err(invalid(AdapterError::ColorChannel));
        }
        for map in maps.into_iter().flatten() {
            if map.files.is_empty() {
                return Err(invalid(AdapterError::NoFiles));
            }
            if !(map.range[1] > map.range[0] && map.range.iter().all(|v| v.is_finite())) {
                return Err(invalid(AdapterError::Range(map.range)));
            }
        }
        Ok(adapter)
    }

    /// The number of scenes that have each map, such as `base_color of 2 scenes, roughness of none`.
    pub fn inventory(&self, folder: &Path, scenes: &[&str]) -> String {
        let maps = [("base_color", &self.base_color), ("roughness", &self.roughness), ("metallic", &self.metallic)];
        let count = |file: &AdaptedFile| scenes.iter().filter(|scene| file.path(folder, scene).is_ok()).count();
        let words = maps.into_iter().filter_map(|(map, file)| match count(file.as_ref()?) {
            0 => Some(format!("{map} of none")),
            1 => Some(format!("{map} of 1 scene")),
            many => Some(format!("{map} of {many} scenes")),
        });
        words.collect::<Vec<_>>().join(", ")
    }

    /// Reads a scene's pictures below `folder`, which must all have one size.
    pub fn read(&self, folder: &Path, scene: &str) -> Result<Estimate, BaselineError> {
        let read = |file: &Option<AdaptedFile>| -> Result<_, BaselineError> {
            Ok(file.as_ref().map(|file| file.read(folder, scene, None)).transpose()?.flatten())
        };
        let scalar = |file: &Option<AdaptedFile>| -> Result<_, BaselineError> {
            let channel = |file: &AdaptedFile| Some(file.channel.unwrap_or(Channel::R));
            let picture = file.as_ref().map(|file| file.read(folder, scene, channel(file))).transpose()?.flatten();
            Ok(picture.map(|picture| picture.map(|LinearRgb(rgb)| rgb[0])))
        };
        let base_color = read(&self.base_color)?;
        Estimate { base_color, roughness: scalar(&self.roughness)?, metallic: scalar(&self.metallic)? }
            .of_one_size(folder, scene)
    }
}

impl AdaptedFile {
    /// The linear picture; `channel` selects a scalar, which is repeated in all three channels. None where an optional
    /// file is missing.
    fn read(
        &self,
        folder: &Path,
        scene: &str,
        channel: Option<Channel>,
    ) -> Result<Option<Picture<LinearRgb>>, BaselineError> {
        let path = match self.path(folder, scene) {
            Err(BaselineError::NoEstimate { .. }) if self.optional => return Ok(None),
            path => path?,
        };
        // Read without decoding: the adapter states the encoding, of float files too.
        let stored = read_texture(&path, texture_io::Encoding::Linear, Wrap::Clamp)?;
        let [low, high] = self.range;
        let decode = |v: f32| self.encoding.decode((v - low) / (high - low));
        let picture = Picture::from_fn(stored.width(), stored.height(), |x, y| {
            LinearRgb(selected(channel, stored.texel(x, y)).map(decode))
        });
        let picture = match self.scale {
            Scale::Absolute => picture,
            Scale::Free => scaled(&picture),
        };
        match picture.pixels().iter().position(|LinearRgb(rgb)| !rgb.iter().all(|v| v.is_finite())) {
            None => Ok(Some(picture)),
            Some(at) => {
                let pixel = (at % picture.width(), at / picture.width());
                Err(BaselineError::NotFinite { path, pixel })
            }
        }
    }

    fn path(&self, folder: &Path, scene: &str) -> Result<PathBuf, BaselineError> {
        let paths: Vec<PathBuf> = self.files.iter().map(|file| folder.join(file.replace(SCENE, scene))).collect();
        let found = paths.iter().find(|path| path.is_file()).cloned();
        found.ok_or(BaselineError::NoEstimate { paths })
    }
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

/// The picture scaled by one factor, so that all but a hundredth of the pixels fit in 0 to 1.
fn scaled(picture: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    let mut largest: Vec<f32> = picture.pixels().iter().map(|LinearRgb([r, g, b])| r.max(*g).max(*b)).collect();
    largest.sort_by(f32::total_cmp);
    let at = (FREE_SCALE_SHARE * (largest.len().saturating_sub(1)) as f64).round() as usize;
    match largest.get(at) {
        Some(&white) if white > 0.0 => picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v / white))),
        _ => picture.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_adapters_are_sound() {
        for name in Adapter::names() {
            let adapter = Adapter::find(name).unwrap();
            assert_eq!(adapter.name, name);
            assert!(!adapter.about.is_empty() && adapter.base_color.is_some());
        }
    }

    #[test]
    fn bad_adapters_are_refused_with_the_reason() {
        let refused = |text: &str| Adapter::parse(text, Path::new("a.toml")).unwrap_err().to_string();
        assert!(refused("name = \"x\"").contains("names no file"));
        assert!(refused("name = \"x\"\n[base_color]\nfiles = []\nencoding = \"srgb\"").contains("`files` is empty"));
        let range = "name = \"x\"\n[metallic]\nfiles = [\"a\"]\nencoding = \"linear\"\nrange = [1.0, 0.0]";
        assert!(refused(range).contains("range [1.0, 0.0]"));
        assert!(refused("name = \"x\"\n[base_color]\nfiles = [\"a\"]\nencoding = \"log\"").contains("gamma22"));
        let channel = "name = \"x\"\n[base_color]\nfiles = [\"a\"]\nencoding = \"srgb\"\nchannel = \"g\"";
        assert!(refused(channel).contains("a `channel`"));
        assert!(Adapter::find("no-such").unwrap_err().to_string().contains("marigold"));
    }

    /// Green must not affect the scale of roughness in red, and numbers that decoding makes infinite are refused.
    #[test]
    fn a_scalar_is_its_channel_and_everything_is_finite() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, value: [f32; 3]| {
            let picture = Picture::filled(4, 4, LinearRgb(value));
            let path = folder.path().join(name);
            mateval_image::exr_io::write_linear(&path, &picture, mateval_image::exr_io::Precision::Float).unwrap();
        };
        write("a.exr", [0.25, 1.0, 0.5]);
        write("b.exr", [1e30; 3]);
        let read = |file: &str, encoding: &str| {
            let text =
                format!("name = \"x\"\n[roughness]\nfiles = [\"{file}\"]\nencoding = \"{encoding}\"\nscale = \"free\"");
            Adapter::parse(&text, Path::new("x")).unwrap().read(folder.path(), "s")
        };
        assert_eq!(read("a.exr", "linear").unwrap().roughness.unwrap().get(0, 0), 1.0);
        assert!(read("b.exr", "linear").is_ok());
        assert!(read("b.exr", "gamma22").unwrap_err().to_string().contains("pixel (0, 0)"));
    }

    #[test]
    fn a_free_scale_is_set_by_the_brightest() {
        let ramp = Picture::from_fn(101, 1, |x, _| LinearRgb([x as f32, x as f32 / 2.0, 0.0]));
        let scaled = scaled(&ramp);
        assert_eq!(scaled.get(99, 0).0, [1.0, 0.5, 0.0]);
        let black = Picture::filled(3, 1, LinearRgb([0.0; 3]));
        assert_eq!(super::scaled(&black), black);
    }
}
