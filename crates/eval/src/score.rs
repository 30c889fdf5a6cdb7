//! Submissions scored on a dataset.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use mateval_image::{LinearRgb, Mask, Picture, exr_io, png_io};
use mateval_metrics::Lpips;
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::manifest::{sha256_of_bytes, sha256_of_file};
use mateval_scene::open::Dataset;
use mateval_scene::submission::{SUBMISSION, SUBMISSION_FORMAT, SubmissionFile};
use mateval_scene::{Finding, Progress, SceneError, SceneId, Severity, TriangleMesh, glb, json, reference_io};
use mateval_tracer::World;

use crate::albedo::albedo_pictures;
use crate::alignment::{channel_scales, scaled};
use crate::error::EvalError;
use crate::measure::albedo_metrics;
use crate::prediction::{PredictedScene, read_scene};
use crate::protocol::Protocol;
use crate::result::{
    DatasetId, MissingMetric, PictureValue, ProtocolResult, RESULT_FORMAT, Region, ResultFile, SubmissionId, means,
};

/// The network that scores use, or why it is not there.
pub enum LpipsWeights {
    /// Loaded.
    Loaded(Box<Lpips>),
    /// Not to be had.
    Missing {
        /// Why.
        reason: String,
        /// The command that mends it.
        mend: String,
    },
}

impl LpipsWeights {
    fn network(&self) -> Option<&Lpips> {
        match self {
            Self::Loaded(lpips) => Some(lpips),
            Self::Missing { .. } => None,
        }
    }
}

/// What to score.
pub struct ScorePlan<'a> {
    /// On what.
    pub dataset: &'a Dataset,
    /// Submission folders.
    pub submissions: Vec<&'a Path>,
    /// Under which rules.
    pub protocols: Vec<Protocol>,
    /// Only these scenes; all where empty.
    pub scenes: Vec<SceneId>,
    /// The network of LPIPS.
    pub lpips: LpipsWeights,
    /// Name and version of the tool, for the result.
    pub tool: String,
}

/// One submission on its way to a result.
struct Entry {
    file: SubmissionFile,
    findings: Vec<Finding>,
    files: Vec<(String, String)>,
    /// By protocol.
    pictures: Vec<Vec<PictureValue>>,
}

/// Scores every submission; gives their results in the same order. A scene's rays are traced once for all of them.
pub fn score(plan: &ScorePlan<'_>, progress: Progress<'_>) -> Result<Vec<ResultFile>, EvalError> {
    let scenes = chosen_scenes(plan.dataset, &plan.scenes)?;
    let mut entries =
        plan.submissions.iter().map(|path| open_submission(path, plan)).collect::<Result<Vec<_>, EvalError>>()?;
    for scene in &scenes {
        score_scene(plan, scene, &mut entries, progress)?;
    }
    Ok(entries.into_iter().map(|entry| finish(plan, &scenes, entry)).collect())
}

/// The scenes of these ids, all where there are none; in the dataset's order.
pub(crate) fn chosen_scenes<'a>(dataset: &'a Dataset, scenes: &[SceneId]) -> Result<Vec<&'a SceneFile>, EvalError> {
    let all = &dataset.scenes;
    let unknown: Vec<String> = scenes
        .iter()
        .filter(|id| !all.iter().any(|scene| scene.id == **id))
        .map(|id| format!("the dataset has no scene '{id}'"))
        .collect();
    if !unknown.is_empty() {
        let known: Vec<&str> = all.iter().map(|scene| scene.id.as_str()).collect();
        return Err(EvalError::Invalid(format!("{}; it has: {}", unknown.join("; "), known.join(", "))));
    }
    Ok(all.iter().filter(|scene| scenes.is_empty() || scenes.contains(&scene.id)).collect())
}

fn open_submission(path: &Path, plan: &ScorePlan<'_>) -> Result<Entry, EvalError> {
    let file: SubmissionFile = json::read(&path.join(SUBMISSION))?;
    if file.format != SUBMISSION_FORMAT {
        let what = format!("format '{}'; this version reads '{SUBMISSION_FORMAT}'", file.format);
        return Err(SceneError::Unsupported { path: path.join(SUBMISSION), what }.into());
    }
    let mut findings = Vec::new();
    let expected = &plan.dataset.file.manifest_sha256;
    if file.dataset_manifest_sha256 != *expected {
        findings.push(Finding {
            severity: Severity::Warning,
            code: "other_dataset".to_owned(),
            file: SUBMISSION.to_owned(),
            place: "/dataset_manifest_sha256".to_owned(),
            message: format!("made for the dataset {}, scored on {expected}", file.dataset_manifest_sha256),
            action: "scored all the same; make it anew for this dataset".to_owned(),
        });
    }
    let files = vec![(SUBMISSION.to_owned(), sha256_of_file(&path.join(SUBMISSION))?)];
    Ok(Entry { file, findings, files, pictures: vec![Vec::new(); plan.protocols.len()] })
}

/// A scene, ready to be looked at with what submissions say of it.
struct OpenScene {
    folder: SceneFolder,
    world: World,
    atlases: Vec<TriangleMesh>,
    /// In the submissions' order.
    predictions: Vec<PredictedScene>,
}

impl OpenScene {
    fn read(dataset: &Dataset, scene: &SceneFile, submissions: &[&Path]) -> Result<Self, EvalError> {
        // Numbers carry the dataset's fingerprint: what they are made of must be what it says.
        dataset.check_files(&scene.id, |path| !path.contains("/renders/") && !path.contains("/materials/"))?;
        let folder = dataset.folder(&scene.id);
        let world = World::new(Arc::new(reference_io::read(&folder)?))?;
        let atlases = read_atlases(&folder, scene, &world)?;
        let predictions = submissions.iter().map(|path| read_scene(path, scene)).collect();
        Ok(Self { folder, world, atlases, predictions })
    }
}

/// The truth and every submission's albedo of one view, linear.
pub(crate) struct SceneAlbedo {
    pub(crate) truth: Picture<LinearRgb>,
    /// In the plan's order.
    pub(crate) predicted: Vec<Picture<LinearRgb>>,
    pub(crate) valid: Mask,
    /// None for the input view.
    pub(crate) unobserved: Option<Mask>,
}

/// The views of a scene that are scored, in the scene's order.
pub(crate) fn scene_albedo(
    dataset: &Dataset,
    scene: &SceneFile,
    submissions: &[&Path],
) -> Result<Vec<SceneAlbedo>, EvalError> {
    let OpenScene { folder, world, atlases, predictions } = OpenScene::read(dataset, scene, submissions)?;
    let view = |view: &View| {
        let predicted = albedo_pictures(&world, &atlases, &view.camera, &predictions);
        let Truth { albedo: truth, valid, unobserved } = Truth::read(&folder, view)?;
        Ok(SceneAlbedo { truth, predicted, valid, unobserved })
    };
    scored_views(dataset, scene)?.into_iter().map(view).collect()
}

fn score_scene(
    plan: &ScorePlan<'_>,
    scene: &SceneFile,
    entries: &mut [Entry],
    progress: Progress<'_>,
) -> Result<(), EvalError> {
    let OpenScene { folder, world, atlases, predictions } = OpenScene::read(plan.dataset, scene, &plan.submissions)?;
    let views = scored_views(plan.dataset, scene)?;
    for (at, view) in views.iter().enumerate() {
        progress(&format!("scene {}", scene.id), at, views.len());
        let pictures = albedo_pictures(&world, &atlases, &view.camera, &predictions);
        let truth = Truth::read(&folder, view)?;
        for (entry, picture) in entries.iter_mut().zip(&pictures) {
            for (protocol, values) in plan.protocols.iter().zip(&mut entry.pictures) {
                values.extend(picture_values(plan, protocol, scene, view, picture, &truth)?);
            }
        }
    }
    for (entry, prediction) in entries.iter_mut().zip(predictions) {
        entry.findings.extend(prediction.findings);
        entry.files.extend(prediction.files);
    }
    Ok(())
}

/// The views of the scene that `targets.json` names, in the scene's order; at least one.
fn scored_views<'a>(dataset: &Dataset, scene: &'a SceneFile) -> Result<Vec<&'a View>, EvalError> {
    let targets = &dataset.targets.targets;
    let is_target = |view: &&View| targets.iter().any(|t| t.scene == scene.id && t.view == view.id);
    let views: Vec<&View> = scene.views.iter().filter(is_target).collect();
    if views.is_empty() {
        let what = format!("scene '{}': targets.json names no view of it; run `mateval prep verify`", scene.id);
        return Err(EvalError::Invalid(what));
    }
    Ok(views)
}

/// The meshes of `instances.glb`; the instances of `scene.json` in its order, and the same triangles as the world's
/// surfaces, or the dataset is unsound.
fn read_atlases(folder: &SceneFolder, scene: &SceneFile, world: &World) -> Result<Vec<TriangleMesh>, EvalError> {
    let nodes = glb::read(&folder.instances())?;
    let ids = scene.instances.iter().map(|instance| instance.id.as_str());
    let named = nodes.len() == scene.instances.len() && nodes.iter().map(|node| node.name.as_str()).eq(ids);
    let meshes: Vec<TriangleMesh> = nodes.into_iter().map(|node| node.mesh).collect();
    let surfaces = &world.scene().surfaces;
    let fits = named
        && meshes.len() == surfaces.len()
        && meshes.iter().zip(surfaces).all(|(mesh, surface)| mesh.triangles.len() == surface.mesh.triangles.len());
    if fits {
        return Ok(meshes);
    }
    let path = folder.instances();
    let what = "it does not fit scene.json and ground_truth/reference/geometry.glb; run `mateval prep verify`";
    Err(SceneError::Unsupported { path, what: what.to_owned() }.into())
}

/// What a view is compared with.
struct Truth {
    albedo: Picture<LinearRgb>,
    valid: Mask,
    /// None for the input view.
    unobserved: Option<Mask>,
}

impl Truth {
    fn read(folder: &SceneFolder, view: &View) -> Result<Self, EvalError> {
        let shown = folder.view(&view.id);
        let is_input = view.id.as_str() == INPUT;
        let unobserved = (!is_input).then(|| png_io::read_mask(&shown.join("unobserved.png"))).transpose()?;
        let truth = Self {
            albedo: exr_io::read_linear(&folder.truth_view(&view.id).join("albedo.exr"))?,
            valid: png_io::read_mask(&shown.join("valid.png"))?,
            unobserved,
        };
        let size = (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize);
        let masks = std::iter::once(&truth.valid).chain(&truth.unobserved);
        let sizes =
            masks.map(|mask| (mask.width(), mask.height())).chain([(truth.albedo.width(), truth.albedo.height())]);
        if { sizes }.all(|found| found == size) {
            return Ok(truth);
        }
        let what = format!("'{}': the truth's pictures are not of the camera's size", shown.display());
        Err(EvalError::Invalid(format!("{what}; run `mateval prep verify`")))
    }
}

/// Albedo raw and aligned, over all valid pixels and over the unobserved ones (which keep their picture's scale).
fn picture_values(
    plan: &ScorePlan<'_>,
    protocol: &Protocol,
    scene: &SceneFile,
    view: &View,
    predicted: &Picture<LinearRgb>,
    truth: &Truth,
) -> Result<Vec<PictureValue>, EvalError> {
    let failed = |source| EvalError::Metric { what: format!("scene '{}', view '{}'", scene.id, view.id), source };
    let aligned = scaled(predicted, channel_scales(predicted, &truth.albedo, &truth.valid));
    let regions = std::iter::once((Region::Valid, &truth.valid))
        .chain(truth.unobserved.iter().map(|mask| (Region::Unobserved, mask)));
    let mut values = Vec::new();
    for (region, mask) in regions {
        for (name, picture) in [("albedo", predicted), ("albedo_aligned", &aligned)] {
            let measured =
                albedo_metrics(protocol, plan.lpips.network(), picture, &truth.albedo, mask).map_err(failed)?;
            values.extend(measured.into_iter().map(|measured| PictureValue {
                scene: scene.id.clone(),
                view: view.id.clone(),
                picture: name.to_owned(),
                region,
                metric: measured.metric,
                value: measured.value,
                exact: measured.exact,
                count: measured.count,
            }));
        }
    }
    Ok(values)
}

fn finish(plan: &ScorePlan<'_>, scored: &[&SceneFile], mut entry: Entry) -> ResultFile {
    let manifest = &plan.dataset.file.manifest_sha256;
    let weights = plan.lpips.network().map(Lpips::sha256);
    let protocols = plan.protocols.iter().zip(entry.pictures).map(|(protocol, pictures)| {
        let (scenes, summary) = means(&pictures);
        let ids: Vec<&SceneId> = scored.iter().map(|scene| &scene.id).collect();
        let fingerprint = protocol.fingerprint(manifest, &ids, weights);
        (protocol.name.clone(), ProtocolResult { protocol: protocol.clone(), fingerprint, summary, scenes, pictures })
    });
    let protocols: BTreeMap<String, ProtocolResult> = protocols.collect();
    let missing = match &plan.lpips {
        LpipsWeights::Loaded(_) => Vec::new(),
        LpipsWeights::Missing { reason, mend } => {
            vec![MissingMetric { metric: "lpips_alex".to_owned(), reason: reason.clone(), mend: mend.clone() }]
        }
    };
    entry.findings.sort();
    let files: String = entry.files.iter().map(|(path, sha256)| format!("{sha256}  {path}\n")).collect();
    ResultFile {
        format: RESULT_FORMAT.to_owned(),
        tool: plan.tool.clone(),
        method: entry.file.method,
        submission: SubmissionId { sha256: sha256_of_bytes(files.as_bytes()), description: entry.file.description },
        dataset: DatasetId {
            name: plan.dataset.file.name.clone(),
            version: plan.dataset.file.version.clone(),
            manifest_sha256: manifest.clone(),
            scenes: scored.iter().map(|scene| scene.id.clone()).collect(),
            scenes_in_all: plan.dataset.scenes.len(),
        },
        lpips_weights: BTreeMap::from([("alex".to_owned(), weights.map(str::to_owned))]),
        protocols,
        missing,
        findings: entry.findings,
    }
}
