//! Submissions scored on a dataset.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use mateval_image::{LinearRgb, Picture};
use mateval_metrics::Lpips;
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::SceneFolder;
use mateval_scene::manifest::{sha256_of_bytes, sha256_of_file};
use mateval_scene::open::Dataset;
use mateval_scene::submission::{SUBMISSION, SUBMISSION_FORMAT, SubmissionFile};
use mateval_scene::{
    Finding, Progress, RendererId, SceneError, SceneId, Severity, TriangleMesh, glb, json, reference_io,
};
use mateval_tracer::World;

use crate::error::EvalError;
use crate::light_rules::Track;
use crate::material_pictures::material_pictures;
use crate::prediction::{PredictedScene, read_scene};
use crate::protocol::Protocol;
use crate::result::{
    DatasetId, MissingMetric, ProtocolResult, RESULT_FORMAT, ResultFile, SubmissionId, means, summary_noise,
};
use crate::scene_score::{SceneOrder, SceneScore, score_scene};
use crate::truth::ViewTruth;

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
    /// Scenes that are scored at once; each is worked on by all threads anyway.
    pub jobs: usize,
    /// A folder that scores of scenes are kept in by what they depend on, so that a killed run goes on.
    pub cache: Option<&'a Path>,
}

/// One submission on its way to a result.
struct Entry {
    file: SubmissionFile,
    findings: Vec<Finding>,
    files: Vec<(String, String)>,
    /// By protocol, scene by scene.
    scores: Vec<Vec<(SceneId, SceneScore)>>,
}

/// What one submission got in one scene.
struct Outcome {
    findings: Vec<Finding>,
    files: Vec<(String, String)>,
    /// By protocol.
    scores: Vec<SceneScore>,
}

/// Scores every submission; gives their results in the same order. A scene's rays are traced once for all of them, and so
/// are paths of light for those that agree in roughness and metallic.
pub fn score(plan: &ScorePlan<'_>, progress: Progress<'_>) -> Result<Vec<ResultFile>, EvalError> {
    let scenes = chosen_scenes(plan.dataset, &plan.scenes)?;
    let mut entries =
        plan.submissions.iter().map(|path| open_submission(path, plan)).collect::<Result<Vec<_>, EvalError>>()?;
    for (scene, outcomes) in scenes.iter().zip(score_scenes(plan, &scenes, progress)?) {
        for (entry, outcome) in entries.iter_mut().zip(outcomes) {
            entry.findings.extend(outcome.findings);
            entry.files.extend(outcome.files);
            for (scores, score) in entry.scores.iter_mut().zip(outcome.scores) {
                scores.push((scene.id.clone(), score));
            }
        }
    }
    Ok(entries.into_iter().map(|entry| finish(plan, &scenes, entry)).collect())
}

/// By scene, then by submission; some scenes at a time. The first failure ends it.
fn score_scenes(
    plan: &ScorePlan<'_>,
    scenes: &[&SceneFile],
    progress: Progress<'_>,
) -> Result<Vec<Vec<Outcome>>, EvalError> {
    let next = AtomicUsize::new(0);
    let done: Vec<OnceLock<Result<Vec<Outcome>, EvalError>>> = scenes.iter().map(|_| OnceLock::new()).collect();
    let work = || {
        while let Some((at, scene)) = { scenes.iter().enumerate().nth(next.fetch_add(1, Ordering::Relaxed)) } {
            let outcome = score_one(plan, scene, progress);
            if outcome.is_err() {
                next.store(scenes.len(), Ordering::Relaxed);
            }
            // Each place is filled by the one worker that drew its number.
            let _ = done[at].set(outcome);
        }
    };
    std::thread::scope(|scope| {
        (1..plan.jobs.max(1)).for_each(|_| drop(scope.spawn(work)));
        work();
    });
    // Scenes that a failure left out come after it or are as yet empty.
    done.into_iter().filter_map(OnceLock::into_inner).collect()
}

fn score_one(plan: &ScorePlan<'_>, scene: &SceneFile, progress: Progress<'_>) -> Result<Vec<Outcome>, EvalError> {
    let predictions: Vec<PredictedScene> = plan.submissions.iter().map(|path| read_scene(path, scene)).collect();
    let mut scores: Vec<Option<Vec<SceneScore>>> =
        predictions.iter().map(|prediction| plan.kept(scene, prediction)).collect();
    let fresh: Vec<usize> = (0..scores.len()).filter(|&at| scores[at].is_none()).collect();
    if !fresh.is_empty() {
        let chosen: Vec<PredictedScene> = fresh.iter().map(|&at| predictions[at].clone()).collect();
        for (&at, found) in fresh.iter().zip(plan.score_fresh(scene, &chosen, progress)?) {
            plan.keep(scene, &predictions[at], &found)?;
            scores[at] = Some(found);
        }
    }
    let outcome = |(prediction, scores): (PredictedScene, Option<Vec<SceneScore>>)| Outcome {
        findings: prediction.findings,
        files: prediction.files,
        scores: scores.expect("what was not kept is fresh"),
    };
    Ok(predictions.into_iter().zip(scores).map(outcome).collect())
}

impl ScorePlan<'_> {
    fn score_fresh(
        &self,
        scene: &SceneFile,
        predictions: &[PredictedScene],
        progress: Progress<'_>,
    ) -> Result<Vec<Vec<SceneScore>>, EvalError> {
        let renderer = self.dataset.file.scored_renderer.as_ref();
        let OpenScene { folder, world, atlases } = OpenScene::read(self.dataset, scene, renderer)?;
        score_scene(&SceneOrder {
            scene,
            folder: &folder,
            world: &world,
            atlases: &atlases,
            views: scored_views(self.dataset, scene)?,
            predictions,
            protocols: &self.protocols,
            lpips: self.lpips.network(),
            renderer,
            progress,
        })
    }

    /// Where scores of a scene under a protocol are kept: everything that they depend on is in the name.
    fn place(&self, scene: &SceneFile, prediction: &PredictedScene, protocol: &Protocol) -> Option<PathBuf> {
        let weights = self.lpips.network().map(Lpips::sha256);
        let print = protocol.fingerprint(&self.dataset.file.manifest_sha256, &[&scene.id], weights);
        let key = sha256_of_bytes(json::to_text(&(&self.tool, print, &prediction.files)).as_bytes());
        Some(self.cache?.join(format!("{key}.json")))
    }

    /// The scores that an earlier run has kept, if it has all of them.
    fn kept(&self, scene: &SceneFile, prediction: &PredictedScene) -> Option<Vec<SceneScore>> {
        // A file that is half written or of another kind is none.
        self.protocols.iter().map(|protocol| json::read(&self.place(scene, prediction, protocol)?).ok()).collect()
    }

    fn keep(&self, scene: &SceneFile, prediction: &PredictedScene, scores: &[SceneScore]) -> Result<(), EvalError> {
        for (protocol, score) in self.protocols.iter().zip(scores) {
            if let Some(place) = self.place(scene, prediction, protocol) {
                json::write(&place, score)?;
            }
        }
        Ok(())
    }
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
    Ok(Entry { file, findings, files, scores: vec![Vec::new(); plan.protocols.len()] })
}

/// A scene, ready to be looked at.
struct OpenScene {
    folder: SceneFolder,
    world: World,
    atlases: Vec<TriangleMesh>,
}

impl OpenScene {
    /// `renderer` is the one whose pictures will be looked at.
    fn read(dataset: &Dataset, scene: &SceneFile, renderer: Option<&RendererId>) -> Result<Self, EvalError> {
        let render = renderer.map(|renderer| format!("ground_truth/renders/{renderer}/"));
        let is_light = |file: &str| {
            let name = file.rsplit('/').next().unwrap_or(file);
            render.as_ref().is_some_and(|render| file.starts_with(render.as_str()))
                && name.ends_with(".exr")
                && (name.starts_with("rgb") || name.starts_with("group_"))
        };
        // Numbers carry the dataset's fingerprint: what they are made of must be what it says.
        dataset.check_files(&scene.id, |file| !file.contains("/renders/") || is_light(file))?;
        let folder = dataset.folder(&scene.id);
        let world = World::new(Arc::new(reference_io::read(&folder)?))?;
        let atlases = read_atlases(&folder, scene, &world)?;
        Ok(Self { folder, world, atlases })
    }
}

/// The truth and every submission's albedo of one view, linear.
pub(crate) struct SceneAlbedo {
    pub(crate) truth: ViewTruth,
    /// In the plan's order.
    pub(crate) predicted: Vec<Picture<LinearRgb>>,
}

/// The views of a scene that are scored, in the scene's order.
pub(crate) fn scene_albedo(
    dataset: &Dataset,
    scene: &SceneFile,
    submissions: &[&Path],
) -> Result<Vec<SceneAlbedo>, EvalError> {
    let OpenScene { folder, world, atlases } = OpenScene::read(dataset, scene, None)?;
    let predictions: Vec<PredictedScene> = submissions.iter().map(|path| read_scene(path, scene)).collect();
    let view = |view: &View| {
        let pictures = material_pictures(&world, &atlases, &view.camera, &predictions);
        let predicted = pictures.into_iter().map(|pictures| pictures.base_color).collect();
        Ok(SceneAlbedo { truth: ViewTruth::read(&folder, view)?, predicted })
    };
    scored_views(dataset, scene)?.into_iter().map(view).collect()
}

/// The views of the scene that `targets.json` names, in the scene's order; at least one.
pub(crate) fn scored_views<'a>(dataset: &Dataset, scene: &'a SceneFile) -> Result<Vec<&'a View>, EvalError> {
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

/// The hash of a submission: of `submission.json` and of the maps of the scored scenes, path and SHA-256 each, in order.
pub(crate) fn submission_sha256(files: &[(String, String)]) -> String {
    let lines: String = files.iter().map(|(path, sha256)| format!("{sha256}  {path}\n")).collect();
    sha256_of_bytes(lines.as_bytes())
}

fn finish(plan: &ScorePlan<'_>, scored: &[&SceneFile], mut entry: Entry) -> ResultFile {
    let manifest = &plan.dataset.file.manifest_sha256;
    let weights = plan.lpips.network().map(Lpips::sha256);
    let ids: Vec<&SceneId> = scored.iter().map(|scene| &scene.id).collect();
    let protocols = plan.protocols.iter().zip(entry.scores).map(|(protocol, scores)| {
        let fingerprint = protocol.fingerprint(manifest, &ids, weights);
        (protocol.name.clone(), protocol_result(protocol, fingerprint, scores))
    });
    let protocols: BTreeMap<String, ProtocolResult> = protocols.collect();
    let missing = missing(plan);
    entry.findings.sort();
    ResultFile {
        format: RESULT_FORMAT.to_owned(),
        tool: plan.tool.clone(),
        method: entry.file.method,
        submission: SubmissionId { sha256: submission_sha256(&entry.files), description: entry.file.description },
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

/// All scenes' scores in one.
fn protocol_result(protocol: &Protocol, fingerprint: String, scores: Vec<(SceneId, SceneScore)>) -> ProtocolResult {
    let (mut pictures, mut texels, mut instances) = (Vec::new(), Vec::new(), Vec::new());
    let (mut noise, mut fits) = (BTreeMap::new(), BTreeMap::new());
    for (scene, score) in scores {
        pictures.extend(score.pictures);
        texels.extend(score.texels);
        instances.extend(score.instances);
        if !score.noise.is_empty() {
            noise.insert(scene.clone(), score.noise);
        }
        fits.extend(score.fit.map(|fit| (scene, fit)));
    }
    let (scenes, summary) = means(&pictures, &texels);
    ProtocolResult {
        protocol: protocol.clone(),
        fingerprint,
        summary,
        scenes,
        summary_noise: summary_noise(&noise),
        noise,
        fits,
        pictures,
        texels,
        instances,
    }
}

/// What could not be measured for want of weights or renders.
fn missing(plan: &ScorePlan<'_>) -> Vec<MissingMetric> {
    let mut missing = Vec::new();
    if let LpipsWeights::Missing { reason, mend } = &plan.lpips {
        missing.push(MissingMetric { metric: "lpips_alex".to_owned(), reason: reason.clone(), mend: mend.clone() });
    }
    if plan.dataset.file.scored_renderer.is_none() {
        let mut tracks: Vec<Track> = plan.protocols.iter().flat_map(|p| p.light.tracks.clone()).collect();
        tracks.sort_unstable();
        tracks.dedup();
        missing.extend(tracks.into_iter().map(|track| MissingMetric {
            metric: track.picture().to_owned(),
            reason: "the dataset has no renders to compare with".to_owned(),
            mend: "mateval prep render DATASET".to_owned(),
        }));
    }
    missing
}
