//! Adapters: TOML files that state which pictures a method writes and how their numbers are encoded.
//!
//! `adapters/` holds those of known methods. Support for another method needs another file, and no code.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use mateval_image::LinearRgb;
use mateval_scene::stored_encoding::StoredEncoding;
use mateval_scene::submission::Map;
use serde::Deserialize;

use crate::adapted_file::{AdaptedFile, Channel};
use crate::error::{AdapterError, BaselineError};
use crate::estimate::Estimate;
use crate::placement::Placement;

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

/// The endings of files that may hold a map.
const PICTURES: [&str; 9] = ["png", "jpg", "jpeg", "webp", "exr", "hdr", "npy", "tif", "tiff"];

/// The pictures of a method.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adapter {
    /// The method's name.
    pub name: String,
    /// A description for people.
    #[serde(default)]
    pub about: String,
    /// How the pictures lie on the input view.
    #[serde(default)]
    pub placement: Placement,
    /// Base colour.
    pub base_color: Option<AdaptedFile>,
    /// Perceptual roughness.
    pub roughness: Option<AdaptedFile>,
    /// Metallic.
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
            map.check().map_err(invalid)?;
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

    /// Pictures and arrays that the adapter does not read: those in `folder`, in the folders of the scenes, and in the
    /// folders directly below these; sorted.
    pub fn unread(&self, folder: &Path, scenes: &[&str]) -> Vec<String> {
        let read: BTreeSet<PathBuf> = self
            .maps()
            .flat_map(|(_, file, _)| {
                scenes.iter().filter_map(|scene| file.path(folder, scene).ok()).collect::<Vec<_>>()
            })
            .collect();
        let beside = scenes.iter().map(|scene| folder.join(scene)).chain([folder.to_owned()]);
        let is_hidden = |path: &Path| path.file_name().is_some_and(|name| name.as_encoded_bytes()[0] == b'.');
        let entries = |folder: &Path| {
            let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
            entries.map(|entry| entry.path()).filter(|path| !is_hidden(path)).collect::<Vec<_>>()
        };
        let mut folders = BTreeSet::new();
        for beside in beside {
            folders.extend(entries(&beside).into_iter().filter(|path| path.is_dir()));
            folders.insert(beside);
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
        let mut estimate = Estimate { placement: Some(self.placement), ..Estimate::default() };
        for (map, file, channel) in self.maps() {
            let Some(picture) = file.read(folder, scene, channel)? else { continue };
            let scalar = || picture.map(|LinearRgb(rgb)| rgb[0]);
            match map {
                Map::BaseColor => estimate.base_color = Some(picture),
                Map::Roughness => estimate.roughness = Some(scalar()),
                Map::Metallic => estimate.metallic = Some(scalar()),
            }
        }
        estimate.of_one_size(folder, scene)
    }
}

#[cfg(test)]
mod tests {
    use mateval_image::Picture;

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
        let unread = ["other/albedo.tiff", "s/rgb_normals.png", "s/run/albedo.tif"];
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
}
