//! Adapters: TOML files that state which pictures a method writes and how their numbers are encoded and scaled.
//!
//! `adapters/` holds those of known methods. Support for another method needs another file, and no code.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use mateval_dataset::submission::{Map, StoredEncoding};
use mateval_files::FileError;
use mateval_files::untrusted::{hint, in_words, read_at_most, without_mark};
use mateval_image::limits::read_file;
use mateval_image::texture_io::{Encoding, FewerBits, is_turned, texture_and_alpha_of_bytes, transparent_share};
use mateval_image::{LinearRgb, Picture, Wrap};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::BaselineError;
use crate::estimate::{Estimate, Placement};

/// The built-in adapters, by name.
const BUILT_IN: [(&str, &str); 13] = [
    ("colorful-shading", include_str!("../adapters/colorful-shading.toml")),
    ("crefnet", include_str!("../adapters/crefnet.toml")),
    ("delight", include_str!("../adapters/delight.toml")),
    ("diffusion-renderer", include_str!("../adapters/diffusion-renderer.toml")),
    ("dnf-intrinsic", include_str!("../adapters/dnf-intrinsic.toml")),
    ("iid", include_str!("../adapters/iid.toml")),
    ("intrinsic", include_str!("../adapters/intrinsic.toml")),
    ("marigold", include_str!("../adapters/marigold.toml")),
    ("materialist", include_str!("../adapters/materialist.toml")),
    ("mvinverse", include_str!("../adapters/mvinverse.toml")),
    ("ouroboros", include_str!("../adapters/ouroboros.toml")),
    ("plain", include_str!("../adapters/plain.toml")),
    ("rgbx", include_str!("../adapters/rgbx.toml")),
];

/// The largest file of an adapter, in bytes.
const MAX_ADAPTER_BYTES: u64 = 1 << 20;
/// The endings of files that may hold a map.
const PICTURES: [&str; 27] = [
    "png", "jpg", "jpeg", "webp", "exr", "hdr", "npy", "tif", "tiff", "bmp", "gif", "tga", "npz", "pfm", "mat", "pt",
    "pth", "pkl", "avif", "heic", "heif", "jxl", "jp2", "dds", "ktx", "ktx2", "psd",
];
/// The deepest folder, below that of the estimates, in which such files are looked for.
const DEEPEST: usize = 4;

/// An adapter, a TOML file: the pictures of a method. It has at least one of `base_color`, `roughness` and `metallic`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Adapter {
    /// The adapter's name, as reports state it.
    pub name: String,
    /// A description for people.
    #[serde(default)]
    pub about: String,
    /// How the pictures lie on the input view.
    #[serde(default)]
    pub placement: Placement,
    /// The pictures of base colour; if absent, the method gives none.
    pub base_color: Option<AdaptedFile>,
    /// The pictures of perceptual roughness; if absent, the method gives none.
    pub roughness: Option<AdaptedFile>,
    /// The pictures of metallic; if absent, the method gives none.
    pub metallic: Option<AdaptedFile>,
}

impl Adapter {
    /// The built-in adapter with this name, or else the adapter in the file at this path.
    pub fn find(name: &str) -> Result<Self, BaselineError> {
        if let Some((_, text)) = BUILT_IN.iter().find(|(known, _)| *known == name) {
            return Self::parse(text, Path::new(name));
        }
        let path = Path::new(name);
        if !path.is_file() {
            let known = Self::names().join(", ");
            let why = format!("is neither a built-in adapter nor a file; expected one of {known}, or a TOML file");
            return Err(BaselineError::unusable(path, why));
        }
        let bytes = read_at_most(path, MAX_ADAPTER_BYTES).map_err(FileError::io("read", path))?;
        let text = std::str::from_utf8(without_mark(&bytes));
        let text = text.map_err(|_| BaselineError::unusable(path, format!("is not UTF-8{}", hint(&bytes))))?;
        Self::parse(text, path)
    }

    /// The names of the built-in adapters.
    pub fn names() -> [&'static str; BUILT_IN.len()] {
        BUILT_IN.map(|(name, _)| name)
    }

    fn parse(text: &str, path: &Path) -> Result<Self, BaselineError> {
        let invalid = |why: &str| BaselineError::Unusable(format!("adapter '{}': {why}", path.display()));
        let adapter: Self = toml::from_str(text).map_err(|error| invalid(&in_words(&error.to_string())))?;
        if adapter.maps().next().is_none() {
            return Err(invalid("it names no file; expected base_color, roughness or metallic"));
        }
        if adapter.base_color.as_ref().is_some_and(|file| file.channel.is_some()) {
            return Err(invalid("base_color has a `channel`; only roughness and metallic may have one"));
        }
        for (_, AdaptedFile { files, range, .. }, _) in adapter.maps() {
            if files.is_empty() {
                return Err(invalid("`files` is empty; expected at least one path"));
            }
            if !(range[1] > range[0] && range.iter().all(|v| v.is_finite())) {
                return Err(invalid(&format!("range {range:?}; expected a smaller number, then a larger one")));
            }
        }
        Ok(adapter)
    }

    /// The maps that the adapter describes, with their files and the channel that holds each; no channel for
    /// base_color.
    pub(crate) fn maps(&self) -> impl Iterator<Item = (Map, &AdaptedFile, Option<Channel>)> {
        let scalar = |file: &AdaptedFile| Some(file.channel.unwrap_or(Channel::R));
        let base_color = self.base_color.as_ref().map(|file| (Map::BaseColor, file, None));
        let roughness = self.roughness.as_ref().map(|file| (Map::Roughness, file, scalar(file)));
        let metallic = self.metallic.as_ref().map(|file| (Map::Metallic, file, scalar(file)));
        [base_color, roughness, metallic].into_iter().flatten()
    }

    /// The encodings that the method's authors do not state, by map.
    pub fn assumed_encodings(&self) -> BTreeMap<Map, StoredEncoding> {
        let assumed = self.maps().filter(|(_, file, _)| !file.encoding_stated);
        assumed.map(|(map, file, _)| (map, file.encoding)).collect()
    }

    /// The encoding by which each map is decoded, such as `base_color as srgb, roughness as linear`.
    pub fn encodings(&self) -> String {
        let words = self.maps().map(|(map, file, _)| format!("{} as {}", map.stem(), file.encoding));
        words.collect::<Vec<_>>().join(", ")
    }

    /// The number of scenes that have each map, such as `base_color of 2 scenes, roughness of none`.
    pub fn inventory(&self, folder: &Path, scenes: &[&str]) -> String {
        let count = |file: &AdaptedFile| scenes.iter().filter(|scene| file.path(folder, scene).is_ok()).count();
        let words = self.maps().map(|(map, file, _)| match count(file) {
            0 => format!("{} of none", map.stem()),
            1 => format!("{} of 1 scene", map.stem()),
            many => format!("{} of {many} scenes", map.stem()),
        });
        words.collect::<Vec<_>>().join(", ")
    }

    /// Pictures and arrays that the adapter does not read: those in `folder` and in the folders below it; sorted.
    pub fn unread(&self, folder: &Path, scenes: &[&str]) -> Vec<String> {
        let read: BTreeSet<PathBuf> = self
            .maps()
            .flat_map(|(_, file, _)| {
                scenes.iter().filter_map(|scene| file.path(folder, scene).ok()).collect::<Vec<_>>()
            })
            .collect();
        let is_hidden = |path: &Path| path.file_name().is_some_and(|name| name.as_encoded_bytes()[0] == b'.');
        let entries = |folder: &Path| {
            let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
            entries.map(|entry| entry.path()).filter(|path| !is_hidden(path)).collect::<Vec<_>>()
        };
        let (mut folders, mut at) = (vec![folder.to_owned()], 0);
        while at < folders.len() {
            if folders[at].strip_prefix(folder).is_ok_and(|below| below.components().count() < DEEPEST) {
                // Links are not followed, since they may lead back.
                let is_folder = |path: &PathBuf| path.is_dir() && !path.is_symlink();
                folders.extend(entries(&folders[at]).into_iter().filter(is_folder));
            }
            at += 1;
        }
        let is_picture = |path: &PathBuf| {
            let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or("").to_lowercase();
            PICTURES.contains(&ending.as_str())
        };
        let files = folders.iter().flat_map(|folder| entries(folder)).filter(is_picture);
        let unread = files.filter(|path| !read.contains(path));
        let mut names: Vec<String> =
            unread.map(|path| path.strip_prefix(folder).unwrap_or(&path).display().to_string()).collect();
        names.sort();
        names
    }

    /// Reads a scene's pictures below `folder`, which must all have one size.
    pub fn read(&self, folder: &Path, scene: &str) -> Result<Estimate, BaselineError> {
        Ok(self.read_and_remark(folder, scene)?.0)
    }

    /// Reads a scene's pictures, and says what may be wrong with pictures that can be read.
    pub(crate) fn read_and_remark(
        &self,
        folder: &Path,
        scene: &str,
    ) -> Result<(Estimate, Vec<(RemarkKind, String)>), BaselineError> {
        let mut estimate = Estimate { placement: Some(self.placement), ..Estimate::default() };
        let mut all_remarks = Vec::new();
        for (map, file, channel) in self.maps() {
            let Some(AdaptedPicture { picture, remarks }) = file.read(folder, scene, map, channel)? else { continue };
            all_remarks.extend(remarks);
            let scalar = || picture.map(|LinearRgb(rgb)| rgb[0]);
            match map {
                Map::BaseColor => estimate.base_color = Some(picture),
                Map::Roughness => estimate.roughness = Some(scalar()),
                Map::Metallic => estimate.metallic = Some(scalar()),
            }
        }
        Ok((estimate.of_one_size(folder, scene)?, all_remarks))
    }
}

/// The largest linear value of an estimate. Materials end at 1 or little above; far larger numbers, such as those from
/// 0 to 255, have another range than the adapter states.
const LARGEST: f32 = 16.0;
/// Larger linear values are more than highlights and the noise of a network.
const BRIGHT: f32 = 1.5;
/// A larger share of pixels above [`BRIGHT`] has another range than the adapter states, unless its scale is free.
const MOST_BRIGHT: f64 = 0.01;

/// A map of base colour or roughness whose largest stored number is above 0 and below this has another range than the
/// adapter states: numbers of 0 to 255 that were divided twice, or 0 and 1 as bytes. Networks put noise of this size into
/// metallic maps, so that for these it is a remark.
const LEAST_LARGEST: f32 = 1.5 / 255.0;

/// Numbers below this, in the adapter's range, are more than the noise of a network.
const LEAST: f32 = -0.1;
/// A larger share of pixels below [`LEAST`] has another range than the adapter states.
const MOST_BELOW: f64 = 0.01;

/// The files of one map.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AdaptedFile {
    /// Candidate paths below the folder of estimates, at least one; the first that exists is read. `{scene}` stands for
    /// the scene's id.
    #[schemars(length(min = 1))]
    pub files: Vec<String>,
    /// Transfer function of the stored numbers, in files of every kind: PNG, JPEG, WebP, EXR and NumPy alike.
    pub encoding: StoredEncoding,
    /// Whether the method's authors state the encoding, in words or by code. Where they do not, submissions name it in
    /// `assumed_encodings`.
    #[serde(default = "stated")]
    pub encoding_stated: bool,
    /// The stored numbers that stand for 0 and 1, the smaller first, after integers are divided by the largest value of
    /// their type.
    #[serde(default = "unit_range")]
    pub range: [f32; 2],
    /// Whether the values are known only up to a factor.
    #[serde(default)]
    pub scale: Scale,
    /// The channel that holds roughness or metallic; the first if absent. `base_color` must have none.
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    R,
    G,
    B,
}

/// The numbers of a file before decoding.
pub(crate) struct Stored {
    path: PathBuf,
    /// Its numbers, with those of `range` mapped to 0 and 1.
    pub(crate) numbers: Picture<[f32; 3]>,
    /// The share of pixels whose alpha is below 1.
    transparent: f64,
}

/// A map of an estimate, and what may be wrong with it.
#[derive(Debug)]
pub(crate) struct AdaptedPicture {
    /// Linear; a scalar is repeated in all three channels.
    pub(crate) picture: Picture<LinearRgb>,
    pub(crate) remarks: Vec<(RemarkKind, String)>,
}

/// What is done with pictures that their author may not expect, or what may be wrong with them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum RemarkKind {
    Stretched,
    Transparent,
    Black,
    NearlyZero,
}

impl RemarkKind {
    /// The sentence before the example.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Stretched => "pictures are stretched to the proportions of the input view",
            Self::Transparent => "pictures have pixels with alpha below 1, whose colours are used as they are stored",
            Self::Black => {
                "pictures are 0 everywhere, as a method writes them that failed or whose filter refused the photo"
            }
            Self::NearlyZero => {
                "metallic is nearly 0 everywhere, which is noise, or another range than the adapter states"
            }
        }
    }
}

impl AdaptedFile {
    /// The picture of `map`; `channel` selects a scalar. Absent if an optional file is missing.
    pub(crate) fn read(
        &self,
        folder: &Path,
        scene: &str,
        map: Map,
        channel: Option<Channel>,
    ) -> Result<Option<AdaptedPicture>, BaselineError> {
        let Some(Stored { path, numbers, transparent }) = self.stored(folder, scene, map, channel)? else {
            return Ok(None);
        };
        let refused = |why: String| Err(BaselineError::unusable(&path, why));
        let largest = numbers.pixels().iter().flatten().copied().fold(f32::NEG_INFINITY, f32::max);
        let mut remarks = Vec::new();
        if transparent > 0.0 {
            let percent = 100.0 * transparent;
            let some = format!("{percent:.1} % of '{}'; save it without alpha if that is meant", path.display());
            remarks.push((RemarkKind::Transparent, some));
        }
        if map != Map::Metallic && largest <= 0.0 {
            remarks.push((RemarkKind::Black, format!("'{}'", path.display())));
        }
        if self.scale == Scale::Absolute && 0.0 < largest && largest < LEAST_LARGEST {
            let [low, high] = self.range;
            let high = low + largest * (high - low);
            let why = format!(
                "holds no number above {largest:?}, in the adapter's `range`; expected 0 to 1; if {high:?} stands for 1, \
                 write range = [{low:.1}, {high:?}] below the map in the adapter"
            );
            if map != Map::Metallic {
                return refused(why);
            }
            remarks.push((RemarkKind::NearlyZero, format!("'{}' {why}", path.display())));
        }
        let below = numbers.pixels().iter().filter(|rgb| rgb.iter().any(|value| *value < LEAST)).count();
        if below as f64 > MOST_BELOW * numbers.pixels().len() as f64 {
            let value = numbers.pixels().iter().flatten().copied().filter(|v| v.is_finite()).fold(0.0, f32::min);
            let percent = 100.0 * (below as f64 / numbers.pixels().len() as f64);
            return refused(format!(
                "holds {value}, and {percent:.0} % of its pixels are below 0, in the adapter's `range`; expected 0 to 1; \
                 if the numbers run from -1 to 1, write range = [-1.0, 1.0] below the map in the adapter"
            ));
        }
        let picture = numbers.map(|rgb| LinearRgb(rgb.map(|value| self.encoding.decode(value))));
        let picture = self.scale.apply(picture);
        let too_large = |rgb: &LinearRgb| rgb.0.into_iter().find(|value| value.is_finite() && value.abs() > LARGEST);
        if let Some(value) = picture.pixels().iter().find_map(too_large) {
            return refused(format!(
                "holds {value} after decoding; expected linear values up to {LARGEST}; if the numbers run from 0 to 255, \
                 write range = [0, 255] below the map in the adapter"
            ));
        }
        if let Some(at) = picture.pixels().iter().position(|LinearRgb(rgb)| !rgb.iter().all(|v| v.is_finite())) {
            return Err(BaselineError::Unusable(format!(
                "'{}': pixel {:?} is not finite after decoding; fix the adapter's `encoding` or `range`, or the picture",
                path.display(),
                (at % picture.width(), at / picture.width())
            )));
        }
        let bright = picture.pixels().iter().filter(|LinearRgb(rgb)| rgb.iter().any(|v| *v > BRIGHT)).count();
        let share = bright as f64 / picture.pixels().len() as f64;
        if self.scale == Scale::Absolute && share > MOST_BRIGHT {
            let value = picture.pixels().iter().flat_map(|LinearRgb(rgb)| *rgb).fold(0.0, f32::max);
            return refused(format!(
                "holds values up to {value} after decoding, and {:.0} % of its pixels are above {BRIGHT}; expected linear \
                 values from 0 to 1; write range = [0, MAX] below the map in the adapter, where MAX is the stored number \
                 that stands for 1, or scale = \"free\" if nobody knows it",
                100.0 * share
            ));
        }
        Ok(Some(AdaptedPicture { picture, remarks }))
    }

    /// The stored numbers; absent if an optional file is missing. Fails where 16-bit integers are those of fewer bits and
    /// the adapter does not say so, since all values would be near 0, and where the picture asks to be turned.
    pub(crate) fn stored(
        &self,
        folder: &Path,
        scene: &str,
        map: Map,
        channel: Option<Channel>,
    ) -> Result<Option<Stored>, BaselineError> {
        let path = match self.path(folder, scene) {
            Ok(path) => path,
            Err(_) if self.optional => return Ok(None),
            Err(searched) => return Err(no_estimate(&searched)),
        };
        let bytes = read_file(&path)?;
        if is_turned(&bytes) {
            let why = "asks by its EXIF data to be turned or mirrored for display; save its pixels as the input view has \
                       them, without EXIF data";
            return Err(BaselineError::unusable(&path, why));
        }
        // Read without decoding: the adapter states the encoding, of float files too.
        let (stored, alpha) = texture_and_alpha_of_bytes(&path, bytes, Encoding::Linear, Wrap::Clamp)?;
        if self.range == unit_range()
            && self.scale == Scale::Absolute
            && let Some(words) = FewerBits::of(&stored)
            // A metallic of a network may be as small throughout as other numbers of 10 and 12 bits.
            && (map != Map::Metallic || words.bits == 8 || words.largest == words.full())
        {
            let FewerBits { bits, largest } = words;
            let (full, high) = (words.full(), f32::from(words.full()) / f32::from(u16::MAX));
            let why = format!(
                "holds 16-bit integers that reach only {largest} of 65535, as those of {bits} bits do; expected 65535 for \
                 1; scale them up, or write range = [0.0, {high}] ({full} of 65535) below the map in the adapter"
            );
            return Err(BaselineError::unusable(&path, why));
        }
        let [low, high] = self.range;
        let numbers = Picture::from_fn(stored.width(), stored.height(), |x, y| {
            let rgb = stored.texel(x, y);
            // A scalar is repeated.
            let rgb = channel.map_or(rgb, |channel| [rgb[channel as usize]; 3]);
            rgb.map(|value| (value - low) / (high - low))
        });
        let transparent = alpha.map_or(0.0, |alpha| transparent_share(&alpha));
        Ok(Some(Stored { path, numbers, transparent }))
    }

    /// The first path that exists, or else all that were searched.
    pub(crate) fn path(&self, folder: &Path, scene: &str) -> Result<PathBuf, Vec<PathBuf>> {
        let paths: Vec<PathBuf> = self.files.iter().map(|file| folder.join(file.replace("{scene}", scene))).collect();
        let found = paths.iter().find(|path| path.is_file()).cloned();
        found.ok_or(paths)
    }
}

/// None of the searched files exists.
pub(crate) fn no_estimate(searched: &[PathBuf]) -> BaselineError {
    let paths: Vec<String> = searched.iter().map(|path| format!("'{}'", path.display())).collect();
    let expected = paths.join(" or ");
    BaselineError::Unusable(format!("no estimate: expected {expected}; fix the adapter's `files`, or run the method"))
}

/// After a picture of free scale is scaled, this share of its pixels has its largest channel at or below 1.
const FREE_SCALE_SHARE: f64 = 0.99;

/// Whether values are known absolutely.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// The values are used as they are.
    #[default]
    Absolute,
    /// The values are known up to one factor: they are scaled so that the 99th percentile of the pixels' largest
    /// channel is 1.
    Free,
    /// The values of each channel are known up to a factor of its own: each is scaled so that its 99th percentile is 1.
    PerChannel,
}

impl Scale {
    /// The picture, scaled. A channel or picture whose percentile is 0 stays as it is.
    pub(crate) fn apply(self, picture: Picture<LinearRgb>) -> Picture<LinearRgb> {
        let pixels = picture.pixels();
        let whites = match self {
            Self::Absolute => return picture,
            Self::Free => [white(pixels.iter().map(|LinearRgb([r, g, b])| r.max(*g).max(*b))); 3],
            Self::PerChannel => [0, 1, 2].map(|channel: usize| white(pixels.iter().map(|pixel| pixel.0[channel]))),
        };
        let scaled = |value: f32, white: f32| if white > 0.0 { value / white } else { value };
        picture.map(|LinearRgb(rgb)| LinearRgb(std::array::from_fn(|channel| scaled(rgb[channel], whites[channel]))))
    }
}

/// The value that [`FREE_SCALE_SHARE`] of all values do not exceed; 0 without values.
fn white(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    let at = (FREE_SCALE_SHARE * (values.len().saturating_sub(1)) as f64).round() as usize;
    values.get(at).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use mateval_image::exr_io::{Precision, write_linear};
    use mateval_testkit::packed::{turned_jpeg, upright_jpeg};

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

    #[test]
    fn adapters_in_other_encodings_are_read_or_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let find = |bytes: Vec<u8>| {
            std::fs::write(&path, bytes).unwrap();
            Adapter::find(path.to_str().unwrap())
        };
        let text = "name = \"mine\"\n[base_color]\nfiles = [\"a.png\"]\nencoding = \"srgb\"\n";
        assert_eq!(find(format!("\u{feff}{text}").into_bytes()).unwrap().name, "mine");
        let utf16: Vec<u8> = "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
        assert!(find(utf16).unwrap_err().to_string().contains("UTF-16 text; save it as UTF-8"));
    }

    #[test]
    fn files_that_are_not_read_are_listed() {
        let folder = tempfile::tempdir().unwrap();
        for below in ["s/run/deep", "other"] {
            std::fs::create_dir_all(folder.path().join(below)).unwrap();
        }
        for name in ["rgb_albedo.png", "rgb_material.png", "rgb_normals.png", "notes.txt", "._rgb_albedo.png"] {
            std::fs::write(folder.path().join("s").join(name), "").unwrap();
        }
        for name in ["s/run/albedo.tif", "s/run/deep/albedo.png", "other/albedo.tiff", "other/notes.txt"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let adapter = Adapter::find("marigold").unwrap();
        let unread = ["other/albedo.tiff", "s/rgb_normals.png", "s/run/albedo.tif", "s/run/deep/albedo.png"];
        assert_eq!(adapter.unread(folder.path(), &["s"]), unread);
        assert_eq!(
            adapter.inventory(folder.path(), &["s"]),
            "base_color of 1 scene, roughness of 1 scene, metallic of 1 scene"
        );
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

    /// The picture in the folder's file of this name, whose adapter has these further lines.
    fn read(folder: &Path, file: &str, lines: &str) -> Result<Option<Picture<LinearRgb>>, BaselineError> {
        Ok(read_map(folder, file, lines, Map::BaseColor)?.map(|read| read.picture))
    }

    fn read_map(folder: &Path, file: &str, lines: &str, map: Map) -> Result<Option<AdaptedPicture>, BaselineError> {
        let text = format!("files = [\"{file}\"]\nencoding = \"linear\"\n{lines}");
        toml::from_str::<AdaptedFile>(&text).unwrap().read(folder, "s", map, None)
    }

    /// What is said of the picture in the folder's file `a.png`.
    fn remarks(folder: &Path, map: Map) -> Vec<RemarkKind> {
        let read = read_map(folder, "a.png", "", map).unwrap().unwrap();
        read.remarks.into_iter().map(|(kind, _)| kind).collect()
    }

    #[test]
    fn pictures_of_nearly_nothing_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let write = |largest: u8| {
            let bytes = image::ImageBuffer::from_fn(16, 16, |x, _| image::Luma([if x < 9 { largest } else { 0 }]));
            bytes.save(folder.path().join("a.png")).unwrap();
        };
        write(1);
        let refused = read(folder.path(), "a.png", "").unwrap_err().to_string();
        assert!(refused.contains("range = [0.0, 0.003921"), "{refused}");
        assert!(read(folder.path(), "a.png", "range = [0.0, 0.0039215689]").is_ok());
        let said = read_map(folder.path(), "a.png", "", Map::Metallic).unwrap().unwrap().remarks;
        assert!(
            matches!(&said[..], [(RemarkKind::NearlyZero, text)] if text.contains("range = [0.0, 0.003921")),
            "{said:?}"
        );
        // Twins: black, and a dark picture.
        for (largest, said) in [(0, vec![RemarkKind::Black]), (4, vec![])] {
            write(largest);
            assert_eq!(remarks(folder.path(), Map::BaseColor), said, "{largest}");
            assert_eq!(remarks(folder.path(), Map::Metallic), []);
        }
    }

    /// As NumPy writes 0 and 1, and as floats that a method divided once too often.
    #[test]
    fn zeros_and_ones_as_bytes_and_tiny_floats_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (4, 4), }";
        let length = u16::try_from(header.len()).unwrap().to_le_bytes();
        let bits = (0..16).map(|at| u8::from(at % 3 == 0));
        let file: Vec<u8> =
            b"\x93NUMPY\x01\x00".iter().chain(&length).chain(header.as_bytes()).copied().chain(bits).collect();
        std::fs::write(folder.path().join("a.npy"), file).unwrap();
        let read = |file: &str, map: Map| read_map(folder.path(), file, "", map);
        assert!(read("a.npy", Map::Roughness).unwrap_err().to_string().contains("range = [0.0, 0.003921"));
        assert_eq!(read("a.npy", Map::Metallic).unwrap().unwrap().remarks[0].0, RemarkKind::NearlyZero);
        for (largest, hint) in [(1e-30, "range = [0.0, 1e-30]"), (9e-5, "range = [0.0, 9e-5]")] {
            let picture = Picture::from_fn(4, 4, |x, _| LinearRgb([if x == 3 { largest } else { 0.0 }; 3]));
            write_linear(&folder.path().join("a.exr"), &picture, Precision::Float).unwrap();
            assert!(read("a.exr", Map::BaseColor).unwrap_err().to_string().contains(hint));
            assert!(read_map(folder.path(), "a.exr", "scale = \"free\"", Map::BaseColor).is_ok());
        }
    }

    #[test]
    fn transparent_pixels_are_said() {
        let folder = tempfile::tempdir().unwrap();
        let write = |alpha: u8| {
            let pixel = |x, _| image::Rgba([90, 120, 60, if x == 0 { alpha } else { 255 }]);
            image::ImageBuffer::from_fn(8, 4, pixel).save(folder.path().join("a.png")).unwrap();
        };
        write(0);
        assert_eq!(remarks(folder.path(), Map::BaseColor), [RemarkKind::Transparent]);
        write(255);
        assert_eq!(remarks(folder.path(), Map::BaseColor), []);
    }

    #[test]
    fn a_turned_picture_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.jpg"), upright_jpeg()).unwrap();
        assert!(read(folder.path(), "a.jpg", "").is_ok());
        std::fs::write(folder.path().join("a.jpg"), turned_jpeg()).unwrap();
        assert!(read(folder.path(), "a.jpg", "").unwrap_err().to_string().contains("EXIF"));
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
        // Of 10 and of 12 bits; a metallic of any size but the full one may be meant.
        for (factor, hint) in [
            (4, "10 bits do; expected 65535 for 1; scale them up, or write range = [0.0, 0.0156"),
            (16, "range = [0.0, 0.06248"),
        ] {
            write(factor);
            let refused = read(folder.path(), "a.png", "").unwrap_err().to_string();
            assert!(refused.contains(hint), "{refused}");
            assert!(read_map(folder.path(), "a.png", "", Map::Metallic).is_ok());
        }
        let full = image::ImageBuffer::from_fn(4, 1, |x, _| image::Luma([[0_u16, 70, 4095, 12][x as usize]]));
        full.save(folder.path().join("a.png")).unwrap();
        assert!(read_map(folder.path(), "a.png", "", Map::Metallic).is_err());
        // Twin: integers of the whole range.
        write(257);
        assert!(read(folder.path(), "a.png", "").is_ok());
    }

    #[test]
    fn a_free_scale_is_set_by_the_brightest() {
        let ramp = Picture::from_fn(101, 1, |x, _| LinearRgb([x as f32, x as f32 / 2.0, 0.0]));
        assert_eq!(Scale::Free.apply(ramp.clone()).get(99, 0).0, [1.0, 0.5, 0.0]);
        // Twin: with a factor for each channel the second becomes as bright as the first, and black stays black.
        assert_eq!(Scale::PerChannel.apply(ramp.clone()).get(99, 0).0, [1.0, 1.0, 0.0]);
        assert_eq!(Scale::Absolute.apply(ramp.clone()), ramp);
        let black = Picture::filled(3, 1, LinearRgb([0.0; 3]));
        assert_eq!(Scale::Free.apply(black.clone()), black);
    }

    /// A picture whose channels were multiplied by different factors is the same picture after scaling.
    #[test]
    fn factors_of_channels_cancel() {
        let picture =
            Picture::from_fn(50, 2, |x, y| LinearRgb([x as f32 + 1.0, 2.0 * y as f32 + 1.0, 50.0 - x as f32]));
        let tinted = picture.map(|LinearRgb([r, g, b])| LinearRgb([0.5 * r, 2.0 * g, 4.0 * b]));
        assert_eq!(Scale::PerChannel.apply(tinted.clone()), Scale::PerChannel.apply(picture.clone()));
        // Twin: one factor for all three does not undo it.
        assert_ne!(Scale::Free.apply(tinted), Scale::Free.apply(picture));
    }
}
