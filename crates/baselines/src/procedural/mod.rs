//! Procedural materials (after PSDR-Room, Yan et al. 2023): a graph for each part, fitted to an estimate.
//!
//! In: the public geometry of a scene and an estimate of its input view. Out: a submission, and a report beside it with
//! the graphs as MaterialX.
//!
//! Each part's surface is laid out flat in metres, as the unfolded sides of a box ([`mateval_procedural::unfolding`]).
//! The pixels that show its most visible side become points of that layout (`part_samples`), to which the graphs of
//! [`mateval_procedural`] are fitted (`materials`). Where a graph predicts held-out pixels better than a single colour
//! does, it is baked to the atlas (`bake`); all other parts have the median of their pixels. `report` writes what was
//! found for each part.

mod bake;
mod materials;
mod part_samples;
mod report;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::open::Dataset;
use mateval_dataset::{Progress, json};
use mateval_files::FileError;
use mateval_files::work_folder::{WorkFolder, check_free, make_folder};
use mateval_image::png_io;
use mateval_procedural::Graph;
use mateval_procedural::fit::choose::Fitter;
use mateval_procedural::library::entry;
use mateval_procedural::mtlx::read_file;

use crate::error::BaselineError;
use crate::estimate::Estimate;
use crate::estimate_source::EstimateSource;
use crate::geometry::SceneGeometry;
use crate::nn::seen_pixels;
use crate::submission::{self, Method};
pub use bake::Baked;
use bake::bake_all;
use materials::SceneMaterials;
pub use materials::{FitMode, ProceduralOptions};
use report::{REPORT, REPORT_FORMAT, ReportFile, SceneReport, html, library_sha256, write_graphs, write_pictures};

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
        let why = "exists and holds no report.json, so it is not replaced; remove it, or choose another --out";
        return Err(BaselineError::unusable(&report, why));
    }
    let fitter = fitter(options)?;
    let work = WorkFolder::start(&report)?;
    let mut scenes = Vec::new();
    let method = method(dataset, source, options);
    let instances = submission::write_scenes(dataset, out, force, &method, progress, |scene, folder| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let estimate = source.read(dataset, scene, progress)?;
        let seen = seen_pixels(&geometry, &estimate)?;
        let materials = SceneMaterials::fitted(&geometry, &estimate, &seen, &fitter, options, progress)?;
        // The maps of the instances.
        let mut count = 0;
        bake_all(&materials, &geometry, &estimate, &seen, options.keep_seen, |at, baked| {
            count += 1;
            baked.maps.write(&folder.join(scene.instances[at].id.as_str()))
        })?;
        // The scene's folder of the report.
        let place = work.path().join(scene.id.as_str());
        make_folder(&place)?;
        write_graphs(&place.join("materials.mtlx"), &materials)?;
        let photo = geometry.folder.view(&geometry.view.id).join("rgb.png");
        let photo = photo.exists().then(|| png_io::read_srgb(&photo)).transpose()?;
        let has_photo = write_pictures(&place, photo.as_ref(), &estimate, &materials)?;
        scenes.push((SceneReport::new(scene, &materials), has_photo));
        Ok(count)
    })?;
    let index = work.path().join("index.html");
    std::fs::write(&index, html(&method, &scenes)).map_err(FileError::io("write", &index))?;
    let file = ReportFile {
        format: REPORT_FORMAT.to_owned(),
        method: method.name,
        description: method.description,
        library_sha256: library_sha256(),
        scenes: scenes.into_iter().map(|(report, _)| report).collect(),
    };
    json::write(&work.path().join(REPORT), &file)?;
    work.finish()?;
    Ok(instances)
}

/// The maps of every instance of a scene that has an atlas, by its place in the scene: what [`write()`] writes, without
/// files.
pub fn scene_maps(
    geometry: &SceneGeometry<'_>,
    estimate: &Estimate,
    options: &ProceduralOptions,
    progress: Progress<'_>,
) -> Result<BTreeMap<usize, Baked>, BaselineError> {
    let seen = seen_pixels(geometry, estimate)?;
    let materials = SceneMaterials::fitted(geometry, estimate, &seen, &fitter(options)?, options, progress)?;
    let mut all = BTreeMap::new();
    bake_all(&materials, geometry, estimate, &seen, options.keep_seen, |at, baked| {
        all.insert(at, baked);
        Ok(())
    })?;
    Ok(all)
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
    Method { name, description, assumed_encodings: source.assumed_encodings(), is_oracle: source.is_truth() }
}

/// The most files that are read.
const MOST_FILES: usize = 256;

/// The built-in graphs and those of the options' folder, ready to be fitted.
fn fitter(options: &ProceduralOptions) -> Result<Fitter, BaselineError> {
    let own = options.graphs.as_deref().map(read).transpose()?.unwrap_or_default();
    Ok(Fitter::new()?.with_graphs(own))
}

/// Reads every `.mtlx` file of a folder, in the order of their names. Fails with everything that is wrong with any of
/// them, and where there is none.
fn read(folder: &Path) -> Result<Vec<Graph>, BaselineError> {
    let entries = std::fs::read_dir(folder).map_err(FileError::io("read", folder))?;
    let paths: Result<Vec<PathBuf>, _> = entries.map(|entry| entry.map(|entry| entry.path())).collect();
    let mut paths = paths.map_err(FileError::io("read", folder))?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "mtlx"));
    paths.sort();
    if paths.is_empty() || paths.len() > MOST_FILES {
        let why = format!("holds {} .mtlx files; expected 1 to {MOST_FILES}", paths.len());
        return Err(BaselineError::unusable(folder, why));
    }
    let (mut graphs, mut faults): (Vec<Graph>, Vec<String>) = (Vec::new(), Vec::new());
    for path in &paths {
        match read_file(path) {
            Ok(graph) if entry(&graph.name).is_some() || graphs.iter().any(|other| other.name == graph.name) => {
                let why = "which is built in or in another file of its folder; give it another name";
                return Err(BaselineError::unusable(path, format!("has the graph '{}', {why}", graph.name)));
            }
            Ok(graph) => graphs.push(graph),
            Err(fault) => faults.push(fault.to_string()),
        }
    }
    if faults.is_empty() { Ok(graphs) } else { Err(BaselineError::Unusable(faults.join("\n"))) }
}
