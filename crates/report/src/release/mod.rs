//! Describes the release of a dataset on a page that can be cited.
//!
//! In: a dataset with its `.build`, and optionally verdicts of `prep compare`, results of the truth and of a constant
//! estimate, and facts about the publication. Out: a folder with `index.html`, `release.json` ([`ReleaseFile`]) and
//! small pictures.
//!
//! [`CheckedRelease::new`] reads and checks everything that is given ([`given`]) before [`CheckedRelease::write`]
//! verifies the dataset and gathers the rest: its counts beside the paper's, its pictures and their noise
//! ([`renders`]), and what it takes to make it again ([`remake`]). [`mod@file`] holds what is written, with the
//! citation; if the ground truth is withheld, it removes what was measured on it. `page` and `page_scene` fill the
//! template.
//!
//! Nothing depends on a clock: the same inputs give the same bytes.

pub mod file;
pub mod given;
mod page;
mod page_scene;
pub mod remake;
pub mod renders;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::{DatasetFile, SceneFile};
use mateval_dataset::manifest::Manifest;
use mateval_dataset::open::{Dataset, check_outside};
use mateval_dataset::{Finding, Progress, Report, SceneId, Severity, json, scene_cost};
use mateval_files::whole::write_whole;
use mateval_files::work_folder::{WorkFolder, check_free, check_holds_none};
use mateval_prep::recipe::RECIPE;
use mateval_prep::{stats, verify};

use file::{Evaluated, RELEASE, RELEASE_FORMAT, ReleasedDataset, ReleasedScene, Verification, bibtex, withhold};
pub use file::{Publication, ReleaseFile};
use given::{Bounds, SceneVerdict, read_bounds, read_comparisons};
use page::page;
use remake::{Remake, SceneInputs};
use renders::{noise, rendered_with, write_thumbnail};

use crate::error::ReportError;
use crate::publish::Published;

/// What to describe, and where to write the report.
#[derive(Clone, Debug, Default)]
pub struct ReleaseOptions {
    pub dataset: PathBuf,
    pub out: PathBuf,
    /// Replace a report that already exists.
    pub force: bool,
    /// Files of `prep compare`, or folders of them.
    pub verdicts: Vec<PathBuf>,
    /// The result of the truth itself.
    pub ceiling: Option<PathBuf>,
    /// The result of a constant estimate.
    pub floor: Option<PathBuf>,
    /// The protocol whose scores are shown.
    pub protocol: String,
    /// What is known of the publication.
    pub publication: Publication,
}

/// A release whose given files were all read and found to fit the dataset.
#[derive(Debug)]
pub struct CheckedRelease<'a> {
    options: &'a ReleaseOptions,
    dataset: Dataset,
    comparisons: BTreeMap<SceneId, SceneVerdict>,
    bounds: Bounds,
}

impl<'a> CheckedRelease<'a> {
    /// Checks everything that can fail early: the report's place, that the dataset is whole, and all files that are
    /// given.
    pub fn new(options: &'a ReleaseOptions) -> Result<Self, ReportError> {
        let dataset = Dataset::open(&options.dataset)?;
        dataset.check_whole()?;
        check_place(options)?;
        let [ceiling, floor] = [&options.ceiling, &options.floor].map(|path| path.as_deref());
        // A user with several foreign files sees all of them at once.
        let comparisons = read_comparisons(&options.verdicts, &dataset);
        let bounds = read_bounds(ceiling, floor, &options.protocol, &dataset);
        match (comparisons, bounds) {
            (Err(ReportError::UnfitForRelease(mut all)), Err(ReportError::UnfitForRelease(others))) => {
                all.extend(others);
                Err(ReportError::UnfitForRelease(all))
            }
            (comparisons, bounds) => Ok(Self { options, dataset, comparisons: comparisons?, bounds: bounds? }),
        }
    }

    /// Verifies the dataset and writes the report, completely or not at all. `tool` is the name and version that it
    /// records, and `published` the split that was made of the dataset. What would show withheld files is left out.
    pub fn write(
        &self,
        tool: &str,
        published: Option<&Published>,
        progress: Progress<'_>,
    ) -> Result<ReleaseFile, ReportError> {
        let findings = verify::verify(&self.options.dataset, progress)?;
        // The caller may have written folders since.
        check_place(self.options)?;
        let work = WorkFolder::start(&self.options.out)?;
        let mut file = self.gather(tool, findings, work.path(), progress)?;
        if let Some(published) = published {
            file.dataset.manifest_sha256.clone_from(&published.manifest_sha256);
            let split = DatasetFile { manifest_sha256: published.manifest_sha256.clone(), ..self.dataset.file.clone() };
            file.citation = bibtex(&split, &self.options.publication);
            withhold(&mut file, published.secrecy, &published.commitment);
        } else if let Some(secrecy) = self.dataset.file.withheld {
            let commitment = Manifest::read(&self.dataset.root)?.commitment.unwrap_or_default();
            withhold(&mut file, secrecy, &commitment);
        }
        json::write(&work.path().join(RELEASE), &file)?;
        write_whole(&work.path().join("index.html"), page(&file).as_bytes())?;
        work.finish()?;
        Ok(file)
    }

    fn gather(
        &self,
        tool: &str,
        findings: Vec<Finding>,
        out: &Path,
        progress: Progress<'_>,
    ) -> Result<ReleaseFile, ReportError> {
        let dataset = &self.dataset;
        let rendered = rendered_with(dataset)?;
        let sound = findings.iter().all(|finding| finding.severity != Severity::Error);
        let mut scenes = Vec::new();
        for (at, scene) in dataset.scenes.iter().enumerate() {
            progress(Report::step("pictures", at, dataset.scenes.len()));
            scenes.push(self.scene(scene, out)?);
        }
        Ok(ReleaseFile {
            format: RELEASE_FORMAT.to_owned(),
            tool: tool.to_owned(),
            dataset: ReleasedDataset {
                name: dataset.file.name.clone(),
                version: dataset.file.version.clone(),
                manifest_sha256: dataset.file.manifest_sha256.clone(),
                photo_renderer: dataset.file.photo_renderer.clone(),
            },
            publication: self.options.publication.clone(),
            citation: bibtex(&dataset.file, &self.options.publication),
            withheld: None,
            stats: stats::count(dataset, tool)?,
            evaluated: Evaluated::of(dataset)?,
            verification: Verification { sound, findings },
            ceiling: self.bounds.ceiling.clone(),
            floor: self.bounds.floor.clone(),
            remake: dataset.root.join(RECIPE).is_file().then(|| Remake::of(dataset, &rendered)).transpose()?,
            rendered,
            licences: dataset.file.shared_licences(),
            without_licence: dataset.file.without_licence(),
            scenes,
        })
    }

    fn scene(&self, scene: &SceneFile, out: &Path) -> Result<ReleasedScene, ReportError> {
        Ok(ReleasedScene {
            scene: scene.id.clone(),
            photo: scene.photo.is_some(),
            picture: write_thumbnail(&self.dataset, scene, out)?,
            comparison: self.comparisons.get(&scene.id).cloned(),
            noise: noise(&self.dataset, scene)?,
            costs: scene_cost::read(&self.dataset.root, &scene.id)?,
            findings: scene.findings.clone(),
            inputs: Some(SceneInputs::of(scene)).filter(|inputs| inputs.files > 0),
        })
    }
}

/// Fails where the report would lie in the dataset, replace an input, or replace anything but a report.
fn check_place(options: &ReleaseOptions) -> Result<(), ReportError> {
    let out = &options.out;
    check_outside(out, &options.dataset, "--report")?;
    let files = options.verdicts.iter().chain(&options.ceiling).chain(&options.floor);
    let inputs: Vec<&Path> = std::iter::once(&options.dataset).chain(files).map(PathBuf::as_path).collect();
    check_holds_none(out, &inputs)?;
    if !out.exists() || out.read_dir().is_ok_and(|mut files| files.next().is_none()) {
        return Ok(());
    }
    if !out.join(RELEASE).is_file() {
        return Err(ReportError::NotAReport { path: out.clone() });
    }
    Ok(check_free(out, options.force, "--report")?)
}
