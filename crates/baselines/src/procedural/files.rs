//! The files of `mateval baseline procedural`: a submission, and a report beside it.

use std::path::{Path, PathBuf};

use mateval_image::png_io;
use mateval_procedural::fit::choose::Fitter;
use mateval_scene::dataset::SceneFile;
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::{WorkFolder, check_free};
use mateval_scene::{Progress, SceneError, json};

use super::bake::bake_all;
use super::fitted_graphs;
use super::materials_file;
use super::options::{FitMode, ProceduralOptions};
use super::page::{self, ShownScene};
use super::pictures;
use super::report_file::{REPORT, REPORT_FORMAT, ReportFile, SceneReport, library_sha256};
use super::scene_materials::SceneMaterials;
use crate::error::BaselineError;
use crate::estimate_source::EstimateSource;
use crate::geometry::SceneGeometry;
use crate::nn::seen_pixels;
use crate::submission::{self, Method};

/// The folder of a submission's report: beside it, with `.report` at the end of its name.
pub fn report_folder(submission: &Path) -> PathBuf {
    let mut name = submission.file_name().unwrap_or_default().to_owned();
    name.push(".report");
    submission.with_file_name(name)
}

/// Writes a submission to `out` and returns the number of instances. Beside it, [`report_folder`] receives `index.html`
/// with its pictures, `report.json`, and for each scene `materials.mtlx`.
pub fn write(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    source: &EstimateSource,
    options: &ProceduralOptions,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    options.check()?;
    let report = report_folder(out);
    submission::check_out(dataset, out, force)?;
    check_free(&report, force, "--out")?;
    if report.exists() && !report.join(REPORT).exists() {
        return Err(BaselineError::NotAReport(report));
    }
    let fitter = fitted_graphs::fitter(options)?;
    let work = WorkFolder::start(&report)?;
    let mut scenes = Vec::new();
    let method = method(dataset, source, options);
    let instances = submission::write_scenes(dataset, out, force, &method, progress, |scene, folder| {
        let maker = SceneMaker { dataset, scene, source, options, progress };
        let (instances, report) = maker.make(&fitter, folder, work.path())?;
        scenes.push(report);
        Ok(instances)
    })?;
    let index = work.path().join("index.html");
    std::fs::write(&index, page::html(&method, &scenes)).map_err(SceneError::io("write", &index))?;
    let file = ReportFile {
        format: REPORT_FORMAT.to_owned(),
        method: method.name,
        description: method.description,
        library_sha256: library_sha256(),
        scenes: scenes.into_iter().map(|scene| scene.report).collect(),
    };
    json::write(&work.path().join(REPORT), &file)?;
    work.finish()?;
    Ok(instances)
}

/// The method's name, and all choices that were made.
fn method(dataset: &Dataset, source: &EstimateSource, options: &ProceduralOptions) -> Method {
    let mut name = "procedural".to_owned();
    name.extend(options.part_set.iter().map(|set| format!("-{set}")));
    name.push_str(if options.mode == FitMode::Paper { "-paper" } else { "" });
    name.push_str(if options.keep_seen { "-keep-seen" } else { "" });
    name.push_str(&format!("-{}", source.name()));
    let parts =
        options.part_set.as_ref().map_or("the source's own parts".to_owned(), |set| format!("the parts '{set}'"));
    let estimate = source.description(dataset);
    let seen = if options.keep_seen { "; seen texels hold the estimate" } else { "" };
    let own = options.graphs.as_ref().map_or(String::new(), |_| " and graphs of a folder".to_owned());
    let fitted = match options.mode {
        FitMode::Best => "fitted",
        FitMode::Paper => "fitted in the way of PSDR-Room",
    };
    let description = format!(
        "a procedural graph for each of {parts}, {fitted} to {estimate}, where one shows held-out pixels better than one \
         colour, else the part's median{seen}; randomness times {}; built-in graphs {}{own}",
        options.detail,
        &library_sha256()[..12]
    );
    Method { name, description, assumed_encodings: source.assumed_encodings() }
}

/// Makes one scene's maps and report.
struct SceneMaker<'a> {
    dataset: &'a Dataset,
    scene: &'a SceneFile,
    source: &'a EstimateSource,
    options: &'a ProceduralOptions,
    progress: Progress<'a>,
}

impl SceneMaker<'_> {
    /// `folder` receives the instances' folders, `report` the scene's folder of the report. Returns the number of
    /// instances.
    fn make(&self, fitter: &Fitter, folder: &Path, report: &Path) -> Result<(usize, ShownScene), BaselineError> {
        let scene = self.scene;
        let geometry = SceneGeometry::read(self.dataset.folder(&scene.id), scene)?;
        let estimate = self.source.read(self.dataset, scene, self.progress)?;
        let seen = seen_pixels(&geometry, &estimate)?;
        let materials = SceneMaterials::fitted(&geometry, &estimate, &seen, fitter, self.options, self.progress)?;
        let mut count = 0;
        bake_all(&materials, &geometry, &estimate, &seen, self.options.keep_seen, |at, baked| {
            count += 1;
            baked.maps.write(&folder.join(scene.instances[at].id.as_str()))
        })?;
        let place = report.join(scene.id.as_str());
        std::fs::create_dir_all(&place).map_err(SceneError::io("make", &place))?;
        materials_file::write(&place.join("materials.mtlx"), &materials)?;
        let photo = geometry.folder.view(&geometry.view.id).join("rgb.png");
        let photo = photo.exists().then(|| png_io::read_srgb(&photo)).transpose()?;
        let has_photo = pictures::write(&place, photo.as_ref(), &estimate, &materials)?;
        let shown = ShownScene { report: SceneReport::new(scene, &materials), has_photo };
        Ok((count, shown))
    }
}
