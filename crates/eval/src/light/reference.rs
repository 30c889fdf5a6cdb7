//! R, the reference under light: the scorer's own render of the true maps.
//!
//! It is made once a scene, from the bytes of `ground_truth/materials`, with the material and the rules of every
//! prediction: for each view one picture a light group, linear, before exposure, in half floats, the mean of two
//! independent halves. Any lighting of the scene is a weighted sum of them. It belongs to the dataset: the manifest
//! lists its files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::changes::change_scene;
use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::SCORER_JSON;
use mateval_dataset::open::Dataset;
use mateval_dataset::render_file::{SCORER_FORMAT, ScorerFile, light_inputs_sha256};
use mateval_dataset::scene_cost::{Step, TimedStep};
use mateval_dataset::{Camera, Progress, Report, SceneId, json, scene_cost};
use mateval_files::FileError;
use mateval_files::untrusted::sha256_of_file;
use mateval_files::work_folder::WorkFolder;
use mateval_image::exr_io::Precision;
use mateval_image::{LinearRgb, Mask, Picture, exr_io, png_io};
use mateval_tracer::Lighting;

use crate::error::EvalError;
use crate::light::difference::{encoded, mean_of};
use crate::light::shared_paths::SharedPaths;
use crate::protocol::Protocol;
use crate::truth::{OpenScene, ViewSet, sized, true_maps};

/// Rises whenever the pictures could change for the same inputs.
pub const REFERENCE_VERSION: u32 = 1;

/// The samples of a release, per pixel of each half. Scoring accepts any number; the manifest's hashes pin the pictures.
pub const RELEASE_SAMPLES: u32 = 256;

#[derive(Clone, Debug)]
pub struct ReferenceOptions {
    /// Samples per pixel of each half.
    pub samples: u32,
    pub scenes: Vec<SceneId>,
    /// Make those again that are sound.
    pub force: bool,
}

/// What [`make_references`] did, in scenes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReferenceReport {
    pub rendered: usize,
    /// Found sound, and of as many samples.
    pub kept: usize,
}

/// Renders the references of a dataset's scenes into it. Scenes with a photo from elsewhere have none, since their
/// light is not known. The manifest lists the pictures once the dataset is finished again (`prep finish`).
///
/// References of the same files and samples are kept, so that a killed run resumes; all others are replaced. Several
/// processes may work on different scenes at once.
pub fn make_references(
    root: &Path,
    options: &ReferenceOptions,
    progress: Progress<'_>,
) -> Result<ReferenceReport, EvalError> {
    let dataset = Dataset::open(root)?;
    // The new manifest lists the files that exist.
    dataset.check_whole()?;
    let mut chosen = dataset.chosen_scenes(&options.scenes)?;
    chosen.retain(|scene| scene.photo.is_none());
    let mut report = ReferenceReport::default();
    for (at, scene) in chosen.iter().enumerate() {
        progress(Report::part(&format!("reference of scene {}", scene.id), at, chosen.len()));
        let stored = StoredReference::check(&dataset, scene);
        // A reference that is damaged or of another build is made again; one that is sound is not replaced unasked.
        if let (false, Ok(Some(stored))) = (options.force, &stored) {
            let (found, wanted) = (stored.file.samples_each_half, options.samples);
            if found != wanted {
                return Err(EvalError::ReferenceSamples { scene: scene.id.clone(), found, wanted });
            }
            report.kept += 1;
            continue;
        }
        let step = TimedStep { step: Step::Scorer, renderer: None, is_alone: true };
        let work = || scene_cost::timed(root, &scene.id, &step, || make(&dataset, scene, options.samples, progress));
        change_scene(root, &scene.id, |path| path.contains("/renders/scorer/"), work)?;
        report.rendered += 1;
    }
    Ok(report)
}

fn make(dataset: &Dataset, scene: &SceneFile, samples: u32, progress: Progress<'_>) -> Result<(), EvalError> {
    let OpenScene { folder, world, atlases } = OpenScene::read(dataset, scene)?;
    // A run that fails or is killed leaves the earlier reference as it is.
    let work = WorkFolder::start(&dataset.folder(&scene.id).scorer())?;
    let mut file = ScorerFile {
        format: SCORER_FORMAT.to_owned(),
        version: REFERENCE_VERSION,
        inputs_sha256: light_inputs_sha256(&dataset.root, &scene.id)?,
        samples_each_half: samples,
        seeds: Default::default(),
        lights: world.scene().lights.iter().map(|light| light.name.clone()).collect(),
        variance: BTreeMap::new(),
        files: BTreeMap::new(),
    };
    // `mateval-3` is the only protocol that compares with R.
    let rules = &Protocol::named("mateval-3")?.light;
    let truth = true_maps(&folder, scene)?;
    // The views of a set share paths.
    for set in [ViewSet::Turned, ViewSet::Wide] {
        let views = set.of(&scene.views.iter().collect::<Vec<_>>());
        if views.is_empty() {
            continue;
        }
        let pass = set.pass("reference");
        let paths = SharedPaths { scene: &scene.id, world: &world, atlases: &atlases, rules, pass, progress };
        let repaint = paths.repaint(&[&truth], None)?;
        let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
        let half = |stream| paths.trace(&repaint, Lighting::Apart, &cameras, samples, stream);
        let [a, b] = [half("a")?.remove(0), half("b")?.remove(0)];
        if set == ViewSet::Turned {
            file.seeds = ["a", "b"].map(|stream| format!("{:016x}", paths.seed(stream)));
        }
        for ((view, a), b) in views.iter().zip(a.views).zip(b.views) {
            let [a, b] = [&a.by_seed[0], &b.by_seed[0]];
            let valid = png_io::read_mask(&folder.view(&view.id).join("valid.png"))?;
            file.variance.insert(view.id.clone(), variance([&a.sum(), &b.sum()], &valid, scene.exposure));
            let of_view = work.path().join(view.id.as_str());
            std::fs::create_dir_all(&of_view).map_err(FileError::io("create", &of_view))?;
            for (group, (a, b)) in a.pictures().iter().zip(b.pictures()).enumerate() {
                let name = listed_name(view, group);
                let path = work.path().join(&name);
                // Within the range of half floats.
                let mean = mean_of(a, b).map(|LinearRgb(rgb)| LinearRgb(rgb.map(|value| value.min(65504.0))));
                exr_io::write_linear(&path, &mean, Precision::Half)?;
                file.files.insert(name, sha256_of_file(&path)?);
            }
        }
    }
    json::write(&work.path().join(SCORER_JSON), &file)?;
    Ok(work.finish()?)
}

/// The path of a picture in `renders/scorer`.
fn listed_name(view: &View, group: usize) -> String {
    format!("{}/group_{group:02}.exr", view.id)
}

/// The variance that noise causes in the encoded mean: mean over the valid pixels and their channels; 0 without any.
fn variance(halves: [&Picture<LinearRgb>; 2], valid: &Mask, exposure: f64) -> f64 {
    let (mut sum, mut values) = (0.0, 0_usize);
    for at in (0..valid.pixels().len()).filter(|&at| valid.pixels()[at]) {
        let [a, b] = halves.map(|half| half.pixels()[at].0.map(|v| encoded(f64::from(v) * exposure)));
        sum += (0..3).map(|c| ((a[c] - b[c]) / 2.0).powi(2)).sum::<f64>();
        values += 3;
    }
    sum / values.max(1) as f64
}

#[derive(Clone, Debug)]
pub(crate) struct StoredReference {
    folder: PathBuf,
    pub(crate) file: ScorerFile,
}

impl StoredReference {
    /// Like [`Self::check`], for numbers that carry the dataset's fingerprint: fails also where the manifest lists
    /// another.
    pub(crate) fn listed(dataset: &Dataset, scene: &SceneFile) -> Result<Option<Self>, EvalError> {
        dataset.check_files(&scene.id, |file| file.ends_with(SCORER_JSON))?;
        Self::check(dataset, scene)
    }

    /// The scene's reference; absent if it has none. Fails where it cannot be used: it was made by another version or
    /// from other files, or a picture is missing or changed.
    pub(crate) fn check(dataset: &Dataset, scene: &SceneFile) -> Result<Option<Self>, EvalError> {
        let folder = dataset.folder(&scene.id).scorer();
        if !folder.exists() {
            return Ok(None);
        }
        let unusable = |what: String| EvalError::reference(dataset, scene, what);
        let path = folder.join(SCORER_JSON);
        if !path.exists() {
            return Err(unusable(format!("{SCORER_JSON} is missing: the render was cut off")));
        }
        let file: ScorerFile = json::read_format(&path, SCORER_FORMAT).map_err(|error| unusable(error.to_string()))?;
        if file.version != REFERENCE_VERSION {
            return Err(unusable(format!("it has version {}, this scorer makes {REFERENCE_VERSION}", file.version)));
        }
        if file.inputs_sha256 != light_inputs_sha256(&dataset.root, &scene.id)? {
            return Err(unusable("it was made from other files of the scene than the manifest lists".to_owned()));
        }
        for (name, expected) in &file.files {
            match sha256_of_file(&folder.join(name)) {
                Ok(found) if found == *expected => {}
                Ok(_) => return Err(unusable(format!("'{name}' is not the picture that {SCORER_JSON} lists"))),
                Err(error) => return Err(unusable(error.to_string())),
            }
        }
        for view in &scene.views {
            if let Some(group) =
                (0..file.lights.len()).find(|&group| !file.files.contains_key(&listed_name(view, group)))
            {
                return Err(unusable(format!("{SCORER_JSON} does not list '{}'", listed_name(view, group))));
            }
        }
        Ok(Some(Self { folder, file }))
    }

    /// The view under each light group alone, linear, before exposure.
    pub(crate) fn groups(&self, view: &View) -> Result<Vec<Picture<LinearRgb>>, EvalError> {
        let read = |group: usize| -> Result<Picture<LinearRgb>, EvalError> {
            let picture = sized(view, exr_io::read_linear(&self.folder.join(listed_name(view, group)))?)?;
            // A hash that fits says nothing about values: the dataset may come from anywhere.
            if picture.pixels().iter().flat_map(|rgb| rgb.0).all(|v| v.is_finite() && v >= 0.0) {
                return Ok(picture);
            }
            let place = format!("'{}', {}", self.folder.display(), listed_name(view, group));
            Err(EvalError::unsound(place, "light that is finite and not negative", "other values"))
        };
        (0..self.file.lights.len()).map(read).collect()
    }
}

#[cfg(test)]
mod tests {
    use mateval_dataset::layout::INPUT;
    use mateval_dataset::lighting::weighted;
    use mateval_testkit::sample_dataset::dataset;
    use mateval_testkit::{copy_folder, kept_folder};

    use super::*;

    fn room(dataset: &Dataset) -> &SceneFile {
        dataset.scenes.iter().find(|scene| scene.id.as_str() == "room").unwrap()
    }

    /// The reference under weighted lights is what fresh paths show of the true maps under those weights. The twin: the
    /// same lights, unweighted.
    #[test]
    fn a_weighted_sum_is_a_render_under_those_lights() {
        let (dataset, scene) = (dataset(), room(dataset()));
        let OpenScene { folder, world, atlases } = OpenScene::read(dataset, scene).unwrap();
        let rules = Protocol::named("mateval-3").unwrap().light;
        let paths = SharedPaths {
            scene: &scene.id,
            world: &world,
            atlases: &atlases,
            rules: &rules,
            pass: "fresh".to_owned(),
            progress: &|_| (),
        };
        let truth = true_maps(&folder, scene).unwrap();
        let repaint = paths.repaint(&[&truth], None).unwrap();
        let stored = StoredReference::check(dataset, scene).unwrap().unwrap();
        let view = scene.view(INPUT).unwrap();
        let groups = stored.groups(view).unwrap();
        let mix: Vec<[f64; 3]> = (0..groups.len()).map(|at| [1.0, 0.5, 2.0].map(|v| v * (1 + at) as f64)).collect();
        let mixes = [vec![mix.clone()]];
        let fresh = paths.trace(&repaint, Lighting::Mixed(&mixes), &[view.camera], 128, "a").unwrap().remove(0);
        let fresh = mean(&fresh.views[0].by_seed[0].pictures()[0]);
        let size = [groups[0].width(), groups[0].height()];
        let found = mean(&weighted(&groups, &mix, 1.0, size));
        let twin = mean(&weighted(&groups, &vec![[1.0; 3]; groups.len()], 1.0, size));
        for c in 0..3 {
            assert!((found[c] / fresh[c] - 1.0).abs() < 0.02, "{found:?} {fresh:?}");
            assert!((twin[c] / fresh[c] - 1.0).abs() > 0.1, "{twin:?} {fresh:?}");
        }
    }

    fn mean(picture: &Picture<LinearRgb>) -> [f64; 3] {
        let count = picture.pixels().len() as f64;
        let sum = |c: usize| picture.pixels().iter().map(|pixel| f64::from(pixel.0[c])).sum::<f64>();
        [0, 1, 2].map(|c| sum(c) / count)
    }

    /// A reference that is cut off, edited, of another version or of other files is never used, and the error says how
    /// to make it again.
    #[test]
    fn what_cannot_be_trusted_is_named() {
        let root = kept_folder("stale_reference").join("dataset");
        copy_folder(&dataset().root, &root);
        let copy = Dataset::open(&root).unwrap();
        let scene = room(&copy);
        let list = copy.folder(&scene.id).scorer().join(SCORER_JSON);
        let before = std::fs::read_to_string(&list).unwrap();
        let refused = |expected: &str| {
            let error = StoredReference::check(&copy, scene).unwrap_err().to_string();
            assert!(error.contains(expected) && error.contains("--only scorer --scene room"), "{error}");
        };
        StoredReference::check(&copy, scene).unwrap().unwrap();
        std::fs::write(&list, before.replace("\"version\": 1", "\"version\": 9")).unwrap();
        refused("version 9");
        let inputs = StoredReference::check(dataset(), scene).unwrap().unwrap().file.inputs_sha256;
        std::fs::write(&list, before.replace(&inputs, &"0".repeat(64))).unwrap();
        refused("other files");
        std::fs::write(&list, before.replace("input/group_00.exr", "input/group_77.exr")).unwrap();
        refused("group_77.exr");
        std::fs::write(&list, &before[..before.len() / 2]).unwrap();
        refused("scorer.json");
        std::fs::write(&list, &before).unwrap();
        let picture = list.with_file_name("input").join("group_00.exr");
        let mut bytes = std::fs::read(&picture).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        std::fs::write(&picture, bytes).unwrap();
        refused("input/group_00.exr");
        std::fs::remove_file(&list).unwrap();
        refused("cut off");
    }
}
