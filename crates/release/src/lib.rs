//! Describes the release of a dataset on a page that can be cited.
//!
//! In: a dataset with its `.build`, and optionally verdicts of `prep compare`, results of the truth and of a constant
//! estimate, and facts about the publication. Out: a folder with `index.html`, `release.json` ([`ReleaseFile`]) and
//! small pictures.
//!
//! [`CheckedRelease::new`] reads and checks everything that is given ([`given`]) before [`CheckedRelease::write`]
//! verifies the dataset and gathers the rest ([`gathered`]): counts beside the paper's, the noise of the photo's
//! renderer, licences and hashes of the inputs, commands, and pictures. [`mod@file`] holds what is written, with the
//! citation; if the ground truth is withheld, it removes what was measured on it. `page` and `page_scene` fill the
//! template.
//!
//! Nothing depends on a clock: the same inputs give the same bytes.

pub mod file;
pub mod gathered;
pub mod given;
mod page;
mod page_scene;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_audit::publish::commitment;
use mateval_audit::{stats, verify};
use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::work_folder::{WorkFolder, check_free, check_holds_none, is_inside};
use mateval_dataset::{Finding, Progress, Report, SceneId, Severity, json, scene_cost};
use mateval_image::store::write_whole;

pub use file::{Publication, ReleaseFile};
use file::{RELEASE, RELEASE_FORMAT, ReleasedDataset, ReleasedScene, Verification, bibtex, withhold};
use gathered::{Evaluated, Remake, SceneInputs, licences, noise, rendered_with, without_licence, write_thumbnail};
pub use given::ReleaseError;
use given::{Bounds, SceneVerdict, read_bounds, read_comparisons};
use page::page;

/// What to describe, and where to write the report.
#[derive(Clone, Debug, Default)]
pub struct ReleaseOptions {
    pub dataset: PathBuf,
    pub out: PathBuf,
    /// Replace a report that already exists.
    pub force: bool,
    /// Whether the ground truth is withheld. It is in any case if the dataset's folder does not hold it.
    pub withhold: bool,
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
    pub fn new(options: &'a ReleaseOptions) -> Result<Self, ReleaseError> {
        let dataset = Dataset::open(&options.dataset)?;
        dataset.check_whole()?;
        check_place(options)?;
        let [ceiling, floor] = [&options.ceiling, &options.floor].map(|path| path.as_deref());
        // A user with several foreign files sees all of them at once.
        let comparisons = read_comparisons(&options.verdicts, &dataset);
        let bounds = read_bounds(ceiling, floor, &options.protocol, &dataset);
        match (comparisons, bounds) {
            (Err(ReleaseError::UnfitFiles(mut all)), Err(ReleaseError::UnfitFiles(others))) => {
                all.extend(others);
                Err(ReleaseError::UnfitFiles(all))
            }
            (comparisons, bounds) => Ok(Self { options, dataset, comparisons: comparisons?, bounds: bounds? }),
        }
    }

    /// Verifies the dataset and writes the report, completely or not at all. `tool` is the name and version that it
    /// records.
    pub fn write(&self, tool: &str, progress: Progress<'_>) -> Result<ReleaseFile, ReleaseError> {
        let findings = verify::verify(&self.options.dataset, progress)?;
        // The caller may have written folders since.
        check_place(self.options)?;
        let work = WorkFolder::start(&self.options.out)?;
        let file = self.gather(tool, findings, work.path(), progress)?;
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
    ) -> Result<ReleaseFile, ReleaseError> {
        let dataset = &self.dataset;
        let rendered = rendered_with(dataset)?;
        let sound = findings.iter().all(|finding| finding.severity != Severity::Error);
        let mut scenes = Vec::new();
        for (at, scene) in dataset.scenes.iter().enumerate() {
            progress(Report::step("pictures", at, dataset.scenes.len()));
            scenes.push(self.scene(scene, out)?);
        }
        let mut file = ReleaseFile {
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
            remake: Remake::of(dataset, &rendered)?,
            rendered,
            licences: licences(&dataset.file),
            without_licence: without_licence(&dataset.file),
            scenes,
        };
        if self.options.withhold || self.lacks_truth() {
            withhold(&mut file, commitment(&dataset.root)?);
        }
        Ok(file)
    }

    fn scene(&self, scene: &SceneFile, out: &Path) -> Result<ReleasedScene, ReleaseError> {
        Ok(ReleasedScene {
            scene: scene.id.clone(),
            photo: scene.photo.is_some(),
            picture: write_thumbnail(&self.dataset, scene, out)?,
            comparison: self.comparisons.get(&scene.id).cloned(),
            noise: noise(&self.dataset, scene)?,
            costs: scene_cost::read(&self.dataset.root, &scene.id)?,
            findings: scene.findings.clone(),
            inputs: SceneInputs::of(scene),
        })
    }

    /// Whether the ground truth of any scene is withheld from this copy of the dataset.
    fn lacks_truth(&self) -> bool {
        self.dataset.scenes.iter().any(|scene| !self.dataset.folder(&scene.id).truth().is_dir())
    }
}

/// Fails where the report would lie in the dataset, replace an input, or replace anything but a report.
fn check_place(options: &ReleaseOptions) -> Result<(), ReleaseError> {
    let out = &options.out;
    if is_inside(out, &options.dataset) {
        return Err(ReleaseError::OutputInDataset { path: out.clone() });
    }
    let files = options.verdicts.iter().chain(&options.ceiling).chain(&options.floor);
    let inputs: Vec<&Path> = std::iter::once(&options.dataset).chain(files).map(PathBuf::as_path).collect();
    check_holds_none(out, &inputs)?;
    if !out.exists() || out.read_dir().is_ok_and(|mut files| files.next().is_none()) {
        return Ok(());
    }
    if !out.join(RELEASE).is_file() {
        return Err(ReleaseError::NotAReport { path: out.clone() });
    }
    Ok(check_free(out, options.force, "--report")?)
}
