//! Where an estimate comes from: the dataset's ground truth, the input picture, or a method's files.

use std::collections::BTreeMap;
use std::path::PathBuf;

use mateval_dataset::Progress;
use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::open::Dataset;
use mateval_dataset::submission::Map;
use mateval_dataset::submission::StoredEncoding;
use mateval_image::LinearRgb;
use mateval_image::exr_io::{read_linear, read_scalar};
use rayon::prelude::*;

use crate::adapter::{Adapter, RemarkKind};
use crate::delight::{CandidateLights, DelightOptions, delight};
use crate::error::BaselineError;
use crate::estimate::{Estimate, Placement};
use crate::geometry::{SceneGeometry, input_view, photo_file};

/// The most files that are named as not read.
const MOST_NAMED: usize = 5;

/// Where an estimate comes from.
#[derive(Clone, Debug)]
pub enum EstimateSource {
    /// The ground truth of the input view, as a perfect method would estimate it (the paper's upper bound).
    Truth,
    /// The input picture as base colour: the estimate of a method that does nothing.
    Input,
    /// The input picture without its light, as [`crate::delight`] finds it with these lights.
    Delight(CandidateLights),
    Files {
        /// The folder that the adapter's paths are relative to.
        folder: PathBuf,
        /// Names and encodings of the files.
        adapter: Box<Adapter>,
    },
}

impl EstimateSource {
    /// A phrase for submission.json, such as `the truth of the input view`; for a method's pictures with their number.
    pub fn description(&self, dataset: &Dataset) -> String {
        match self {
            Self::Truth => "the truth of the input view".to_owned(),
            Self::Input => "the input picture itself".to_owned(),
            Self::Delight(CandidateLights::Room) => {
                "the input picture without its light (`mateval baseline delight`)".to_owned()
            }
            Self::Delight(CandidateLights::Stage) => {
                "the input picture without its light (`mateval baseline delight --lights stage`)".to_owned()
            }
            Self::Files { folder, adapter } => {
                let scenes: Vec<&str> = dataset.scenes.iter().map(|scene| scene.id.as_str()).collect();
                let placement = match adapter.placement {
                    Placement::Whole => String::new(),
                    other => format!("; placed by the rule '{}'", other.word()),
                };
                let assumed = adapter.assumed_encodings();
                let assumed = match assumed.keys().map(|map| map.stem()).collect::<Vec<_>>() {
                    stems if stems.is_empty() => String::new(),
                    stems => format!("; its authors do not state the encoding of {}", stems.join(", ")),
                };
                let inventory = adapter.inventory(folder, &scenes);
                format!("the pictures of {} ({inventory}{placement}{assumed})", adapter.name)
            }
        }
    }

    /// Whether it is the ground truth, so that what is made from it is a bound and no method.
    pub const fn is_truth(&self) -> bool {
        matches!(self, Self::Truth)
    }

    /// Which of a method's pictures are read for the dataset's scenes, and which lie beside them and are not; `None`
    /// for other estimates.
    pub fn files_read(&self, dataset: &Dataset) -> Option<String> {
        let Self::Files { folder, adapter } = self else { return None };
        let scenes: Vec<&str> = dataset.scenes.iter().map(|scene| scene.id.as_str()).collect();
        let inventory = adapter.inventory(folder, &scenes);
        let unread = adapter.unread(folder, &scenes);
        let named = unread.iter().take(MOST_NAMED).cloned().collect::<Vec<_>>().join("', '");
        Some(match unread.len() {
            0 => format!("'{}': {inventory}", folder.display()),
            count => {
                let more = if count > MOST_NAMED { format!(" and {} more", count - MOST_NAMED) } else { String::new() };
                format!("'{}': {inventory}; not read: '{named}'{more}", folder.display())
            }
        })
    }

    /// Reads the pictures of a method for all scenes, so that one that cannot be used is reported before long work.
    /// Returns what may be wrong with pictures that can be read, one sentence for each kind; empty for other estimates.
    pub fn remarks(&self, dataset: &Dataset) -> Result<Vec<String>, BaselineError> {
        let Self::Files { folder, adapter } = self else { return Ok(Vec::new()) };
        let of_scene = |scene: &SceneFile| -> Result<Vec<(RemarkKind, String)>, BaselineError> {
            let (estimate, mut remarks) = adapter.read_and_remark(folder, scene.id.as_str())?;
            let intrinsics = input_view(&dataset.folder(&scene.id), scene)?.camera.intrinsics;
            let view = (intrinsics.width as usize, intrinsics.height as usize);
            estimate.region(scene.id.as_str(), view)?;
            let stretched = estimate.size().filter(|size| adapter.placement.stretches_silently(*size, view));
            remarks.extend(stretched.map(|(width, height)| {
                (RemarkKind::Stretched, format!("{width}x{height} to {}x{} pixels", view.0, view.1))
            }));
            Ok(remarks.into_iter().map(|(kind, what)| (kind, format!("scene '{}', {what}", scene.id))).collect())
        };
        let of_scenes: Vec<_> = dataset.scenes.par_iter().map(of_scene).collect::<Result<_, _>>()?;
        let mut by_kind: BTreeMap<RemarkKind, Vec<String>> = BTreeMap::new();
        for (kind, example) in of_scenes.into_iter().flatten() {
            by_kind.entry(kind).or_default().push(example);
        }
        let line = |(kind, examples): (RemarkKind, Vec<String>)| {
            let more = match examples.len() - 1 {
                0 => String::new(),
                more => format!(" (and {more} more)"),
            };
            format!("{}: {}{more}", kind.text(), examples[0])
        };
        Ok(by_kind.into_iter().map(line).collect())
    }

    /// The encodings that the adapter of a method's pictures assumes, because its authors do not state them.
    pub fn assumed_encodings(&self) -> BTreeMap<Map, StoredEncoding> {
        match self {
            Self::Truth | Self::Input | Self::Delight(_) => BTreeMap::new(),
            Self::Files { adapter, .. } => adapter.assumed_encodings(),
        }
    }

    /// A word for the method's name, such as `gt`.
    pub fn name(&self) -> &str {
        match self {
            Self::Truth => "gt",
            Self::Input => "input",
            Self::Delight(CandidateLights::Room) => "delight",
            Self::Delight(CandidateLights::Stage) => "delight-stage",
            Self::Files { adapter, .. } => &adapter.name,
        }
    }

    /// Reads the estimate of one scene. Its pictures have one size, which need not be the view's.
    pub fn read(
        &self,
        dataset: &Dataset,
        scene: &SceneFile,
        progress: Progress<'_>,
    ) -> Result<Estimate, BaselineError> {
        let folder = dataset.folder(&scene.id);
        match self {
            Self::Truth => {
                scene.check_materials_known()?;
                truth(&folder, input_view(&folder, scene)?)?.of_one_size(folder.path(), scene.id.as_str())
            }
            Self::Input => photo(&folder, input_view(&folder, scene)?, scene.exposure as f32),
            Self::Delight(lights) => {
                let geometry = SceneGeometry::read(folder, scene)?;
                let options = DelightOptions { lights: *lights, ..DelightOptions::default() };
                Ok(delight(&geometry, &options, progress)?.estimate())
            }
            Self::Files { folder, adapter } => adapter.read(folder, scene.id.as_str()),
        }
    }
}

fn truth(folder: &SceneFolder, view: &View) -> Result<Estimate, BaselineError> {
    let folder = folder.truth_view(&view.id);
    if !folder.is_dir() {
        let why = "does not exist: this copy of the dataset holds no ground truth, from which the estimate 'gt' (the \
                   default) is taken; give --estimate input, delight, or a folder of your method's pictures";
        return Err(BaselineError::unusable(&folder, why));
    }
    Ok(Estimate {
        base_color: Some(read_linear(&folder.join("albedo.exr"))?),
        roughness: Some(read_scalar(&folder.join("roughness.exr"))?),
        metallic: Some(read_scalar(&folder.join("metallic.exr"))?),
        ..Estimate::default()
    })
}

fn photo(folder: &SceneFolder, view: &View, exposure: f32) -> Result<Estimate, BaselineError> {
    let shown = read_linear(&photo_file(folder, view)?)?
        .map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (v * exposure).clamp(0.0, 1.0))));
    Ok(Estimate { base_color: Some(shown), ..Estimate::default() })
}
