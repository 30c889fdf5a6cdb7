//! Submissions scored on a dataset.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::layout::INPUT;
use mateval_dataset::open::{Dataset, DatasetId};
use mateval_dataset::submission::{Map, SUBMISSION, SubmissionFile};
use mateval_dataset::verdict::{CompareCounts, VerdictFile};
use mateval_dataset::{Finding, Progress, Report, SceneId, Severity, changes, json};
use mateval_files::cache::{Cache, Key};
use mateval_metrics::Lpips;
use mateval_submission::atlas::AtlasMeshes;
use mateval_submission::files::{HashedFile, SubmissionJson, submission_sha256};
use mateval_submission::prediction::{PredictedScene, read_scene};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::constancy::{Family, Twins};
use crate::error::EvalError;
use crate::light::reference::StoredReference;
use crate::light::score::{score_light, score_photos};
use crate::metric::{LPIPS_NET, Metric, PictureKind};
use crate::pictures_dir::PicturesDir;
use crate::protocol::{Protocol, Track};
use crate::result::{
    Constancy, MissingMetric, MissingNumbers, ProtocolResult, RESULT_FORMAT, ResultFile, SubmissionId, TracerCheck,
    means, summary_noise,
};
use crate::scene::{SceneScore, SceneTask, ScoreSheet, SeenSink};
use crate::truth::{OpenScene, ViewSet, scored_views};

/// The largest entry of the cache that is read, in bytes.
const MOST_CACHED_BYTES: u64 = 256 << 20;

/// The network of LPIPS, or why it is missing and the command that makes it available.
pub enum LpipsWeights {
    Loaded(Box<Lpips>),
    Missing { reason: String, fix: String },
}

impl LpipsWeights {
    fn network(&self) -> Option<&Lpips> {
        match self {
            Self::Loaded(lpips) => Some(lpips),
            Self::Missing { .. } => None,
        }
    }
}

pub struct ScorePlan<'a> {
    pub dataset: &'a Dataset,
    pub submissions: Vec<&'a Path>,
    pub protocols: Vec<Protocol>,
    /// The scenes to score; all if empty.
    pub scenes: Vec<SceneId>,
    pub lpips: LpipsWeights,
    /// Name and version of the tool, for the result.
    pub tool: String,
    /// Number of scenes that are scored at once; each of them uses all threads anyway.
    pub jobs: usize,
    /// A folder in which scores of scenes are kept by the hash of everything they depend on, so that a killed run
    /// resumes. It is made with the first score that is kept.
    pub cache: Option<&'a Path>,
    /// Take every score from the cache and compute none.
    pub only_cached: bool,
    /// A folder for the pictures behind the numbers, which nothing reads back; with several submissions a folder of it
    /// for each. No scores are then taken from the cache.
    pub pictures: Option<&'a Path>,
    /// Gets every view from the input view's place under the scene's own or fitted light, as pages show it; captured
    /// rooms pass none. No scores are then taken from the cache.
    pub seen: Option<&'a SeenSink<'a>>,
    /// Gets the time that each scene took for all submissions together, except scenes whose scores were all in the
    /// cache.
    pub timed: Option<&'a TimeSink<'a>>,
}

/// Gets a scene and its elapsed time; several threads may call it. Results do not depend on it.
pub type TimeSink<'a> = dyn Fn(&SceneId, Duration) + Sync + 'a;

/// One submission while it is being scored.
struct SubmissionScores {
    file: SubmissionFile,
    findings: Vec<Finding>,
    files: Vec<HashedFile>,
    /// By protocol, scene by scene.
    scores: Vec<Vec<(SceneId, SceneScore)>>,
    constancy: Vec<Constancy>,
}

/// The part of a submission's result that one scene gives.
struct SceneOutcome {
    findings: Vec<Finding>,
    files: Vec<HashedFile>,
    scores: Vec<SceneScore>,
    constancy: Option<Constancy>,
}

/// Scores every submission and returns their results in the same order. The camera rays of a scene are traced once for
/// all submissions, and paths of light once for those that agree in roughness and metallic.
///
/// # Examples
///
/// ```no_run
/// use std::path::Path;
///
/// use mateval_eval::protocol::Protocol;
/// use mateval_eval::score::{LpipsWeights, ScorePlan, score};
/// use mateval_metrics::{Lpips, Net};
/// use mateval_dataset::open::Dataset;
///
/// let dataset = Dataset::open(Path::new("dataset"))?;
/// let lpips = Lpips::load(Net::Alex, Path::new("lpips-alex-v0.1.safetensors"))?;
/// let (submissions, protocols) = (vec![Path::new("submission")], vec![Protocol::named("mateval-3")?]);
/// let plan = ScorePlan::new(&dataset, submissions, protocols, LpipsWeights::Loaded(Box::new(lpips)), "my tool 1.0");
/// for (key, value) in &score(&plan, &|_| ())?[0].protocols["mateval-3"].summary {
///     println!("{key} {value}");
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn score(plan: &ScorePlan<'_>, progress: Progress<'_>) -> Result<Vec<ResultFile>, EvalError> {
    plan.check()?;
    let scenes = plan.dataset.chosen_scenes(&plan.scenes)?;
    // The light of a scene that was rendered apart since the manifest was written would silently not be scored.
    let is_scored = |id: &SceneId| scenes.iter().any(|scene| scene.id == *id);
    if let Some(error) = changes::unfinished(&plan.dataset.root, is_scored) {
        return Err(error.into());
    }
    plan.check_cached(&scenes)?;
    if let Some(absence) = plan.dataset.absence().filter(|_| plan.scenes.is_empty()) {
        progress(Report::Message(&absence));
    }
    let mut submissions =
        plan.submissions.iter().map(|path| open_submission(path, plan)).collect::<Result<Vec<_>, EvalError>>()?;
    for (scene, outcomes) in scenes.iter().zip(score_scenes(plan, &scenes, progress)?) {
        for (submission, outcome) in submissions.iter_mut().zip(outcomes) {
            submission.findings.extend(outcome.findings);
            submission.files.extend(outcome.files);
            submission.constancy.extend(outcome.constancy);
            for (scores, score) in submission.scores.iter_mut().zip(outcome.scores) {
                scores.push((scene.id.clone(), score));
            }
        }
    }
    let check = tracer_check(plan.dataset)?;
    Ok(submissions.into_iter().map(|submission| finish(plan, &scenes, check.clone(), submission)).collect())
}

/// Outcomes by scene, then by submission. Scores several scenes at a time; the first failure ends the work.
fn score_scenes(
    plan: &ScorePlan<'_>,
    scenes: &[&SceneFile],
    progress: Progress<'_>,
) -> Result<Vec<Vec<SceneOutcome>>, EvalError> {
    let next = AtomicUsize::new(0);
    let done: Vec<OnceLock<Result<Vec<SceneOutcome>, EvalError>>> = scenes.iter().map(|_| OnceLock::new()).collect();
    let work = || {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(scene) = scenes.get(at) else { break };
            let finished = done.iter().filter(|outcome| outcome.get().is_some()).count();
            progress(Report::part(&format!("scene {}", scene.id), finished, scenes.len()));
            let outcome = score_or_recall(plan, scene, progress);
            if outcome.is_err() {
                next.store(scenes.len(), Ordering::Relaxed);
            }
            // Each index is taken by one worker only, so the cell is empty.
            let _ = done[at].set(outcome);
        }
    };
    std::thread::scope(|scope| {
        (1..plan.jobs.max(1)).for_each(|_| drop(scope.spawn(work)));
        work();
    });
    // After a failure, scenes that no worker had started have no outcome; the failure itself ends the collection.
    done.into_iter().filter_map(OnceLock::into_inner).collect()
}

fn score_or_recall(
    plan: &ScorePlan<'_>,
    scene: &SceneFile,
    progress: Progress<'_>,
) -> Result<Vec<SceneOutcome>, EvalError> {
    let start = Instant::now();
    let atlases = AtlasMeshes::on_demand(plan.dataset, scene);
    let read = |path: &&Path| read_scene(path, scene, &atlases);
    let predictions: Vec<PredictedScene> = plan.submissions.iter().map(read).collect::<Result<_, _>>()?;
    let mut open = None;
    let has_sink = plan.pictures.is_some() || plan.seen.is_some();
    let mut scores: Vec<Option<Vec<SceneScore>>> =
        predictions.iter().map(|p| plan.read_cached(scene, p).filter(|_| !has_sink)).collect();
    let uncached: Vec<usize> = (0..scores.len()).filter(|&at| scores[at].is_none()).collect();
    if !uncached.is_empty() {
        let chosen: Vec<PredictedScene> = uncached.iter().map(|&at| predictions[at].clone()).collect();
        let (found, opened) = plan.open_and_score(scene, &chosen, progress)?;
        open = Some(opened);
        for (&at, found) in uncached.iter().zip(found) {
            for (protocol, score) in plan.protocols.iter().zip(&found) {
                plan.keep(&plan.score_key(scene, &predictions[at], protocol), score)?;
            }
            scores[at] = Some(found);
        }
    }
    let mut outcomes = Vec::new();
    for ((path, prediction), scores) in plan.submissions.iter().zip(predictions).zip(scores) {
        // One family at a time: each member has as many maps as the scene.
        let twins = Twins::read(plan.dataset, path, scene, &atlases)?;
        let constancy = plan.constancy(scene, &prediction, &twins, &mut open, progress)?;
        let (mut findings, mut files) = (prediction.findings, prediction.files);
        findings.extend(twins.findings);
        files.extend(twins.answers.into_iter().flat_map(|(_, answer)| answer.files));
        let scores = scores.expect("scores that were not cached have just been computed");
        outcomes.push(SceneOutcome { findings, files, scores, constancy });
    }
    if let Some(timed) = plan.timed.filter(|_| !uncached.is_empty()) {
        timed(&scene.id, start.elapsed());
    }
    Ok(outcomes)
}

impl ScorePlan<'_> {
    /// The scores, and the scene that was opened for them.
    fn open_and_score(
        &self,
        scene: &SceneFile,
        predictions: &[PredictedScene],
        progress: Progress<'_>,
    ) -> Result<(Vec<Vec<SceneScore>>, OpenScene), EvalError> {
        let reference = if self.has(Track::True) { StoredReference::listed(self.dataset, scene)? } else { None };
        // A dataset that has references has them all: a scene without one would silently have no light.
        if self.has(Track::True) && reference.is_none() && scene.photo.is_none() && has_references(self.dataset) {
            return Err(EvalError::reference(self.dataset, scene, "it is missing"));
        }
        let renderer = self.dataset.photo_renderer(scene).filter(|_| self.has(Track::Fitted));
        if let Some(renderer) = renderer {
            // Numbers carry the dataset's fingerprint, so the photos must be those that it covers.
            let folder = format!("ground_truth/renders/{renderer}/");
            self.dataset.check_files(&scene.id, |file| file.starts_with(&folder) && file.ends_with("/rgb.exr"))?;
        }
        if !scene.source.kind.states_materials() {
            self.dataset.check_files(&scene.id, |file| file == format!("views/{INPUT}/rgb.exr"))?;
        }
        let open = OpenScene::read(self.dataset, scene)?;
        let folder_of = |root: &Path, at: usize| match self.submissions.len() {
            1 => root.to_owned(),
            _ => root.join(at.to_string()),
        };
        let folders = |root| (0..self.submissions.len()).map(|at| folder_of(root, at)).collect();
        let pictures = self.pictures.map(|root| PicturesDir { folders: folders(root) });
        let scores = score_scene(&SceneTask {
            dataset: self.dataset,
            scene,
            open: &open,
            views: scored_views(self.dataset, scene)?,
            set: ViewSet::Turned,
            predictions,
            protocols: &self.protocols,
            lpips: self.lpips.network(),
            reference: reference.as_ref(),
            renderer,
            pictures: pictures.as_ref(),
            seen: self.seen,
            progress,
        })?;
        Ok((scores, open))
    }
}

/// Scores every submission under every protocol. Returns the scores by submission, then by protocol.
fn score_scene(task: &SceneTask<'_>) -> Result<Vec<Vec<SceneScore>>, EvalError> {
    let blank = || task.protocols.iter().map(|_| ScoreSheet::default()).collect();
    let mut sheets: Vec<Vec<ScoreSheet>> = task.predictions.iter().map(|_| blank()).collect();
    let scoring: Vec<usize> = (0..task.protocols.len()).filter(|&at| task.protocols[at].scores(task.scene)).collect();
    if !scoring.is_empty() && !task.scene.source.kind.states_materials() {
        task.score_measured(&scoring, &mut sheets)?;
        for &at in &scoring {
            if let Some(rules) = &task.protocols[at].photos {
                score_photos(task, rules, at, &mut sheets)?;
            }
        }
    } else if !scoring.is_empty() {
        for part in [ViewSet::Turned, ViewSet::Wide].into_iter().filter_map(|set| task.over(set)) {
            let has_views = |at: &usize| part.set == ViewSet::Turned || task.protocols[*at].wide_views;
            let protocols: Vec<usize> = scoring.iter().copied().filter(has_views).collect();
            if protocols.is_empty() {
                continue;
            }
            let truths = part.truths()?;
            let base_colors = part.score_materials(&truths, &protocols, &mut sheets)?;
            for at in protocols {
                score_light(&part, &truths, &base_colors, at, &mut sheets)?;
            }
        }
        task.score_texels(&mut sheets)?;
    }
    let finish = |mut sheet: ScoreSheet| {
        sheet.state_noise();
        SceneScore { instances: sheet.errors.finish(task.scene), ..sheet.score }
    };
    Ok(sheets.into_iter().map(|sheets| sheets.into_iter().map(finish).collect()).collect())
}

fn finish(
    plan: &ScorePlan<'_>,
    scored: &[&SceneFile],
    tracer_check: Option<TracerCheck>,
    mut submission: SubmissionScores,
) -> ResultFile {
    let manifest = &plan.dataset.file.manifest_sha256;
    let weights = plan.lpips.network().map(Lpips::sha256);
    let ids: Vec<&SceneId> = scored.iter().map(|scene| &scene.id).collect();
    let not_predicted = not_predicted(&submission.files);
    submission.findings.extend(scoring_findings(plan, scored, &submission.scores, &not_predicted));
    let protocols = plan.protocols.iter().zip(submission.scores).map(|(protocol, scores)| {
        let fingerprint = protocol.fingerprint(manifest, &ids, weights);
        (protocol.name.clone(), protocol_result(protocol, fingerprint, scores, &not_predicted))
    });
    let protocols: BTreeMap<String, ProtocolResult> = protocols.collect();
    let missing = missing(plan, scored);
    submission.findings.sort();
    ResultFile {
        format: RESULT_FORMAT.to_owned(),
        tool: plan.tool.clone(),
        method: submission.file.method,
        submission: SubmissionId {
            sha256: submission_sha256(&submission.files),
            description: submission.file.description,
            url: submission.file.url,
            licence: submission.file.licence,
            cost: submission.file.cost,
            trained_on: submission.file.trained_on,
            oracle: submission.file.oracle,
            geometry: submission.file.geometry,
        },
        dataset: DatasetId::new(plan.dataset, scored.iter().copied()),
        lpips_weights: BTreeMap::from([(LPIPS_NET.name().to_owned(), weights.map(str::to_owned))]),
        protocols,
        constancy: submission.constancy,
        not_predicted: not_predicted.iter().map(|map| map.stem().to_owned()).collect(),
        tracer_check,
        missing,
        findings: submission.findings,
    }
}

/// The scores of one submission under one protocol, scene by scene, without those of maps that it does not predict.
fn protocol_result(
    protocol: &Protocol,
    fingerprint: String,
    scores: Vec<(SceneId, SceneScore)>,
    not_predicted: &[Map],
) -> ProtocolResult {
    let has_value = |kind: PictureKind| kind.map().is_none_or(|map| !not_predicted.contains(&map));
    let (mut pictures, mut texels, mut instances, mut measured) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut noise, mut fits) = (BTreeMap::new(), BTreeMap::new());
    for (scene, score) in scores {
        pictures.extend(score.pictures.into_iter().filter(|picture| has_value(picture.picture.kind)));
        texels.extend(score.texels.into_iter().filter(|_| has_value(PictureKind::TextureBaseColor)));
        instances.extend(score.instances.into_iter().filter(|errors| has_value(errors.picture)));
        measured.extend(score.measured.into_iter().filter(|_| has_value(PictureKind::Measured)));
        if !score.noise.is_empty() {
            noise.insert(scene.clone(), score.noise);
        }
        fits.extend(score.fit.map(|fit| (scene, fit)));
    }
    let (scenes, summary) = means(&pictures, &texels);
    let summary_noise = summary_noise(&noise, &scenes);
    let protocol = protocol.clone();
    ProtocolResult {
        protocol,
        fingerprint,
        summary,
        scenes,
        summary_noise,
        noise,
        fits,
        pictures,
        texels,
        instances,
        measured,
    }
}

/// The findings that scoring adds to those of reading a submission: light that is not finite, scenes of another
/// protocol, captured scenes without measured colours, scenes of unknown light, and maps that are not predicted.
fn scoring_findings(
    plan: &ScorePlan<'_>,
    scored: &[&SceneFile],
    scores: &[Vec<(SceneId, SceneScore)>],
    not_predicted: &[Map],
) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (protocol, scores) in plan.protocols.iter().zip(scores) {
        for (scene, score) in scores.iter().filter(|(_, score)| score.not_finite > 0) {
            let message =
                format!("protocol '{}': {} contributions of light were not finite", protocol.name, score.not_finite);
            let action = "they count as no light; please report this submission";
            let file = format!("scenes/{scene}");
            findings.push(Finding::new(Severity::Warning, "not_finite_light", file, "", message, action));
        }
    }
    for scene in scored {
        let without: Vec<&Protocol> = plan.protocols.iter().filter(|protocol| !protocol.scores(scene)).collect();
        let names: Vec<&str> = without.iter().map(|protocol| protocol.name.as_str()).collect();
        // A warning is printed; notes are only counted. A result without any number must not pass unnoticed.
        let is_empty = without.iter().any(|protocol| !scored.iter().any(|other| protocol.scores(other)));
        let severity = if is_empty { Severity::Warning } else { Severity::Note };
        if !names.is_empty() {
            let file = format!("scenes/{}/scene.json", scene.id);
            let (message, action) = match scene.source.kind.states_materials() {
                false => ("the scene is captured, so that its true materials are not known", "--protocol capture-1"),
                true => ("the scene is not captured, so that no colour in it was measured", "another --protocol"),
            };
            let action = format!("has no value under '{}'; score it with {action}", names.join("', '"));
            findings.push(Finding::new(severity, "other_protocol", file, "/source/kind", message, action));
        }
        let is_captured = !scene.source.kind.states_materials();
        if is_captured && names.len() < plan.protocols.len() && !plan.dataset.folder(&scene.id).has_measured() {
            let (file, message) = (format!("scenes/{}", scene.id), "no colours were measured in the captured room");
            let action = "scored its photos alone; do not rank methods by `rgb_fitted` alone";
            findings.push(Finding::new(Severity::Note, "no_measured", file, "", message, action));
        }
    }
    if plan.protocols.iter().any(|protocol| !protocol.light.tracks.is_empty()) {
        let has_unknown_light = |scene: &&&SceneFile| scene.photo.is_some() && scene.source.kind.states_materials();
        for scene in scored.iter().filter(has_unknown_light) {
            let file = format!("scenes/{}/scene.json", scene.id);
            let message = "the input picture is a photo from elsewhere, and the true light of the scene is not known";
            let action = "scored its materials and not its light";
            findings.push(Finding::new(Severity::Note, "unknown_light", file, "/photo", message, action));
        }
    }
    for map in not_predicted {
        let message = format!("the submission holds no {} of any scored instance", map.stem());
        let action = "it has no value; under light it is rendered as the default";
        findings.push(Finding::new(Severity::Note, "not_predicted", SUBMISSION, "", message, action));
    }
    findings
}

impl<'a> ScorePlan<'a> {
    /// All scenes, one after the other, without a cache.
    pub fn new(
        dataset: &'a Dataset,
        submissions: Vec<&'a Path>,
        protocols: Vec<Protocol>,
        lpips: LpipsWeights,
        tool: impl Into<String>,
    ) -> Self {
        Self {
            dataset,
            submissions,
            protocols,
            scenes: Vec::new(),
            lpips,
            tool: tool.into(),
            jobs: 1,
            cache: None,
            only_cached: false,
            pictures: None,
            seen: None,
            timed: None,
        }
    }

    /// Fails if this scorer cannot follow a protocol, or LPIPS has another network.
    fn check(&self) -> Result<(), EvalError> {
        self.protocols.iter().try_for_each(Protocol::check)?;
        let (expected, found) = (LPIPS_NET.name(), self.lpips.network().map_or(LPIPS_NET, Lpips::net).name());
        if expected == found { Ok(()) } else { Err(EvalError::LpipsNet { expected, found }) }
    }

    /// Fails where scores are missing that may not be computed, and names them all.
    fn check_cached(&self, scenes: &[&SceneFile]) -> Result<(), EvalError> {
        if !self.only_cached {
            return Ok(());
        }
        let mut missing = Vec::new();
        for path in &self.submissions {
            let mut of_submission = Vec::new();
            for scene in scenes {
                let atlases = AtlasMeshes::on_demand(self.dataset, scene);
                let prediction = read_scene(path, scene, &atlases)?;
                let twins = Twins::read(self.dataset, path, scene, &atlases)?;
                let constancy = |members: Vec<_>| self.recall::<Option<Constancy>>(&self.family_key(scene, &members));
                let is_unknown = |members| constancy(members).is_none();
                if self.read_cached(scene, &prediction).is_none() || twins.members(&prediction).is_some_and(is_unknown)
                {
                    of_submission.push(scene.id.clone());
                }
            }
            if !of_submission.is_empty() {
                missing.push((path.to_path_buf(), of_submission));
            }
        }
        if missing.is_empty() { Ok(()) } else { Err(EvalError::NotCached { missing }) }
    }

    fn has(&self, track: Track) -> bool {
        self.protocols.iter().any(|protocol| protocol.light.tracks.contains(&track))
    }

    /// The constancy of a submission in the family of a scene, recalled or computed. Absent where [`Twins::members`]
    /// are. The scene is opened if it is not yet.
    fn constancy(
        &self,
        scene: &SceneFile,
        prediction: &PredictedScene,
        twins: &Twins,
        open: &mut Option<OpenScene>,
        progress: Progress<'_>,
    ) -> Result<Option<Constancy>, EvalError> {
        let Some(members) = twins.members(prediction) else { return Ok(None) };
        let key = self.family_key(scene, &members);
        if let Some(found) = self.recall(&key) {
            return Ok(found);
        }
        let open = match open {
            Some(open) => open,
            none => none.insert(OpenScene::read(self.dataset, scene)?),
        };
        let lightings = twins.answers.iter().map(|(lighting, _)| *lighting).collect();
        let found = Family { scene, lightings, members }.constancy(open, progress)?;
        self.keep(&key, &found)?;
        Ok(found)
    }

    /// The key of a scene's constancy: everything that it depends on.
    fn family_key(&self, scene: &SceneFile, members: &[&PredictedScene]) -> Key {
        let answers: Vec<_> = members.iter().map(|member| (&member.files, &member.findings)).collect();
        let of = ("constancy", &self.tool, &self.dataset.file.manifest_sha256, &scene.id, answers);
        Key::of(json::to_text(&of).as_bytes())
    }

    /// The key of a scene's scores under a protocol: everything that they depend on.
    fn score_key(&self, scene: &SceneFile, prediction: &PredictedScene, protocol: &Protocol) -> Key {
        let weights = self.lpips.network().map(Lpips::sha256);
        let file = &self.dataset.file;
        let print = protocol.fingerprint(&file.manifest_sha256, &[&scene.id], weights);
        // A file that cannot be read has no hash, but may replace a map by its default; a finding states it.
        let scored = (&self.tool, print, &prediction.files, &prediction.findings);
        Key::of(json::to_text(&scored).as_bytes())
    }

    /// The scores that an earlier run wrote to the cache, if all of them can be read.
    fn read_cached(&self, scene: &SceneFile, prediction: &PredictedScene) -> Option<Vec<SceneScore>> {
        self.protocols.iter().map(|protocol| self.recall(&self.score_key(scene, prediction, protocol))).collect()
    }

    /// An entry of the cache. A truncated or foreign file counts as missing.
    fn recall<T: DeserializeOwned>(&self, key: &Key) -> Option<T> {
        let cache = Cache::new(self.cache?);
        json::parse(&cache.path(key), &cache.read(key, MOST_CACHED_BYTES).ok()??).ok()
    }

    fn keep(&self, key: &Key, found: &impl Serialize) -> Result<(), EvalError> {
        let keep = |folder| Cache::new(folder).keep(key, json::to_text(found).as_bytes());
        Ok(self.cache.map_or(Ok(()), keep)?)
    }
}

fn open_submission(path: &Path, plan: &ScorePlan<'_>) -> Result<SubmissionScores, EvalError> {
    let SubmissionJson { file, hashed } = SubmissionJson::read(path)?;
    let mut findings = Vec::new();
    let expected = &plan.dataset.file.manifest_sha256;
    if file.dataset_manifest_sha256 != *expected {
        findings.push(Finding::new(
            Severity::Warning,
            "other_dataset",
            SUBMISSION,
            "/dataset_manifest_sha256",
            format!("made for the dataset {}, scored on {expected}", file.dataset_manifest_sha256),
            "scored nevertheless; make the submission again for this dataset",
        ));
    }
    let scores = vec![Vec::new(); plan.protocols.len()];
    Ok(SubmissionScores { file, findings, files: vec![hashed], scores, constancy: Vec::new() })
}

/// Whether the dataset was rendered by the scorer, so that scenes of unknown light aside each has a reference.
fn has_references(dataset: &Dataset) -> bool {
    dataset.file.photo_renderer.is_some()
        || dataset.scenes.iter().any(|scene| dataset.folder(&scene.id).scorer().exists())
}

/// The verdict of `prep compare` on this very dataset; absent if it was not run.
fn tracer_check(dataset: &Dataset) -> Result<Option<TracerCheck>, EvalError> {
    let file = VerdictFile::read_beside(&dataset.root)?;
    let file = file.filter(|file| file.manifest_sha256 == dataset.file.manifest_sha256);
    Ok(file.map(|file| {
        let sum = |of: fn(&CompareCounts) -> usize| file.scenes.values().map(of).sum::<usize>();
        let agree = sum(|counts| counts.agree);
        TracerCheck { informative: agree + sum(|counts| counts.differ), agree }
    }))
}

/// The maps that a submission's files do not contain.
fn not_predicted(files: &[HashedFile]) -> Vec<Map> {
    let is_of = |file: &HashedFile, map: Map| {
        let name = file.path.rsplit('/').next().unwrap_or_default();
        name.split_once('.').is_some_and(|(stem, _)| stem == map.stem())
    };
    Map::ALL.into_iter().filter(|map| !files.iter().any(|file| is_of(file, *map))).collect()
}

/// The metrics that lack weights, renders or measured colours.
fn missing(plan: &ScorePlan<'_>, scored: &[&SceneFile]) -> Vec<MissingMetric> {
    let mut missing = Vec::new();
    if let LpipsWeights::Missing { reason, fix } = &plan.lpips {
        missing.push(MissingMetric {
            metric: MissingNumbers::Metric(Metric::LpipsAlex),
            reason: reason.clone(),
            fix: fix.clone(),
        });
    }
    // Base colours of captured scenes are compared with measured ones alone.
    let captured: Vec<&&SceneFile> = scored.iter().filter(|scene| !scene.source.kind.states_materials()).collect();
    let are_scored = plan.protocols.iter().any(|protocol| protocol.measured.is_some()) && !captured.is_empty();
    if are_scored && !captured.iter().any(|scene| plan.dataset.folder(&scene.id).has_measured()) {
        missing.push(MissingMetric {
            metric: MissingNumbers::Picture(PictureKind::Measured),
            reason: "the captured rooms have no measured colours".to_owned(),
            fix: "state `measured` in the recipe, and mateval prep build".to_owned(),
        });
    }
    if scored.iter().any(|scene| scene.photo.is_none()) {
        let has_renders = |track: &Track| match track.row().is_fitted {
            true => plan.dataset.file.photo_renderer.is_some(),
            false => has_references(plan.dataset),
        };
        let tracks = Track::ALL.iter().copied().filter(|track| plan.has(*track));
        missing.extend(tracks.filter(|track| !has_renders(track)).map(|track| MissingMetric {
            metric: MissingNumbers::Picture(track.row().picture),
            reason: "the dataset has no renders to compare with".to_owned(),
            fix: "mateval prep render DATASET".to_owned(),
        }));
    }
    missing
}
