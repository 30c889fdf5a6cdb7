//! The converged pictures of a scene's companions: made once, kept in files, and read for every score.
//!
//! A folder of the dataset (`ground_truth/companions/<pass>`) or of a cache holds, for each view and half, one OpenEXR file
//! with the channels of all companions under all lightings, and `companions.json`, which names what they were made of and
//! the hash of every file. Pictures of anything else, or with another hash, are not used.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_image::exr_io::{self, Precision};
use mateval_image::{ImageError, LinearRgb, Picture};
use mateval_scene::companions_file::{COMPANIONS_FORMAT, COMPANIONS_JSON, CompanionsFile};
use mateval_scene::manifest::{sha256_of_bytes, sha256_of_file};
use mateval_scene::{ViewId, json};
use mateval_tracer::{LightMix, ViewsRender};

use crate::companions::{COMPANION_LETTERS, COMPANIONS};
use crate::error::EvalError;

/// Names of the halves, in files and seeds.
pub(crate) const HALVES: [&str; 2] = ["a", "b"];

/// The pictures of one pass in one folder, whose files have been checked.
#[derive(Clone, Debug)]
pub(crate) struct CompanionPictures {
    folder: PathBuf,
    /// SHA-256, hex, of `companions.json`, which holds the hashes of all pictures.
    pub(crate) sha256: String,
}

/// The companions' pictures under each lighting.
pub(crate) type Lightings<T> = Vec<[T; COMPANIONS]>;

impl CompanionPictures {
    /// The pictures in `folder` if they have this key and are whole; otherwise the reason why they cannot be used. None if
    /// the folder holds none.
    pub(crate) fn open(folder: &Path, key: &str) -> Option<Result<Self, String>> {
        let path = folder.join(COMPANIONS_JSON);
        path.exists().then(|| Self::check(folder, &path, key))
    }

    fn check(folder: &Path, path: &Path, key: &str) -> Result<Self, String> {
        let file: CompanionsFile = json::read_format(path, COMPANIONS_FORMAT).map_err(|error| error.to_string())?;
        if file.key != key {
            return Err(format!("'{}' was made from other inputs or rules", path.display()));
        }
        for (name, expected) in &file.files {
            let picture = folder.join(name);
            let found = sha256_of_file(&picture).map_err(|error| error.to_string())?;
            if found != *expected {
                return Err(format!("'{}' is not the file that '{}' lists", picture.display(), path.display()));
            }
        }
        let sha256 = sha256_of_file(path).map_err(|error| error.to_string())?;
        Ok(Self { folder: folder.to_owned(), sha256 })
    }

    /// Writes the render of the three companions of half `half`, one after the other, and returns the hashes of its files.
    pub(crate) fn write_half(
        folder: &Path,
        views: &[ViewId],
        half: usize,
        renders: &[ViewsRender],
        exposure: f64,
    ) -> Result<BTreeMap<String, String>, EvalError> {
        let mut hashes = BTreeMap::new();
        for (at, view) in views.iter().enumerate() {
            let pictures: Vec<&[Picture<LinearRgb>]> =
                renders.iter().map(|render| render.views[at].halves[0].basis.pictures()).collect();
            let lightings = pictures.first().map_or(0, |pictures| pictures.len());
            let mut channels: Vec<(String, Vec<f32>)> = Vec::new();
            for (lighting, companion, c) in places(lightings) {
                let exposed = |pixel: &LinearRgb| (f64::from(pixel.0[c]) * exposure).min(65504.0) as f32;
                let values = pictures[companion][lighting].pixels().iter().map(exposed).collect();
                channels.push((channel_name(lighting, companion, c), values));
            }
            let name = file_name(view, half);
            let path = folder.join(&name);
            let first = pictures.first().and_then(|pictures| pictures.first());
            let (width, height) = first.map_or((0, 0), |picture| (picture.width(), picture.height()));
            let channels = channels.iter().map(|(name, values)| (name.as_str(), values.clone())).collect();
            exr_io::write_channels(&path, width, height, channels, Precision::Half)?;
            hashes.insert(name, sha256_of_file(&path)?);
        }
        Ok(hashes)
    }

    /// Writes `companions.json`, with which the pictures count as whole.
    pub(crate) fn finish(
        folder: &Path,
        key: &str,
        inputs_sha256: &str,
        files: BTreeMap<String, String>,
    ) -> Result<Self, EvalError> {
        let (key, inputs_sha256) = (key.to_owned(), inputs_sha256.to_owned());
        let file = CompanionsFile { format: COMPANIONS_FORMAT.to_owned(), key, inputs_sha256, files };
        json::write(&folder.join(COMPANIONS_JSON), &file)?;
        let sha256 = sha256_of_bytes(json::to_text(&file).as_bytes());
        Ok(Self { folder: folder.to_owned(), sha256 })
    }

    /// The companions' pictures of one view and half under each lighting, exposed.
    pub(crate) fn read(
        &self,
        view: &ViewId,
        half: usize,
        lightings: usize,
    ) -> Result<Lightings<Picture<LinearRgb>>, EvalError> {
        let path = self.folder.join(file_name(view, half));
        let mut channels = exr_io::read_channels(&path)?;
        let mut plane = |lighting: usize, companion: usize, c: usize| -> Result<Picture<f32>, EvalError> {
            let name = channel_name(lighting, companion, c);
            let missing = || ImageError::Invalid { path: path.clone(), what: format!("channel {name} is missing") };
            Ok(channels.remove(&name).ok_or_else(missing)?)
        };
        let mut companion = |lighting: usize, companion: usize| -> Result<Picture<LinearRgb>, EvalError> {
            let [r, g, b] = [0, 1, 2].map(|c| plane(lighting, companion, c));
            let (r, g, b) = (r?, g?, b?);
            Ok(Picture::from_fn(r.width(), r.height(), |x, y| LinearRgb([r.get(x, y), g.get(x, y), b.get(x, y)])))
        };
        (0..lightings)
            .map(|lighting| Ok([companion(lighting, 0)?, companion(lighting, 1)?, companion(lighting, 2)?]))
            .collect()
    }
}

/// The companions' pictures under lights of these weights, from those under each light alone.
pub(crate) fn weighted(lights: &Lightings<Picture<LinearRgb>>, mix: &LightMix) -> [Picture<LinearRgb>; COMPANIONS] {
    std::array::from_fn(|j| {
        let (width, height) = lights.first().map_or((0, 0), |light| (light[j].width(), light[j].height()));
        let mut sums = vec![[0.0_f64; 3]; width * height];
        for (light, weights) in lights.iter().zip(mix) {
            for (sum, pixel) in sums.iter_mut().zip(light[j].pixels()) {
                (0..3).for_each(|c| sum[c] += weights[c] * f64::from(pixel.0[c]));
            }
        }
        Picture::from_fn(width, height, |x, y| LinearRgb(sums[y * width + x].map(|v| v as f32)))
    })
}

/// Lighting, companion and channel of every plane of a file.
fn places(lightings: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..lightings)
        .flat_map(|lighting| (0..COMPANIONS).flat_map(move |companion| (0..3).map(move |c| (lighting, companion, c))))
}

fn channel_name(lighting: usize, companion: usize, c: usize) -> String {
    format!("{lighting}.{}.{}", COMPANION_LETTERS[companion], ["R", "G", "B"][c])
}

fn file_name(view: &ViewId, half: usize) -> String {
    format!("{view}_{}.exr", HALVES[half])
}
