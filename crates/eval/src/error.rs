//! The one error of this crate.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use mateval_scene::ids::quoted;
use mateval_scene::{InstanceId, SceneId, ViewId};

/// Why something could not be scored or shown.
#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    /// The file system refused.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was tried, as in "read" or "write".
        action: &'static str,
        path: PathBuf,
        /// What the system reported.
        source: std::io::Error,
    },
    /// Scores may only be taken from the cache, and are not there.
    #[error(
        "these scores are not in the cache:{}\nscore these scenes with the same --cache, --protocol and version first",
        missing.iter().map(|(path, scenes)| missing_line(path, scenes)).collect::<String>()
    )]
    NotCached {
        /// The submissions and their scenes.
        missing: Vec<(PathBuf, Vec<SceneId>)>,
    },
    /// A scene's reference under light cannot be used, or is missing.
    #[error(
        "the scorer's reference of scene '{scene}' in '{}' cannot be used: {what}; make it again: mateval prep render --only \
         scorer --scene {scene} '{}', then mateval prep finish '{}'",
        path.display(), dataset.display(), dataset.display()
    )]
    Reference {
        /// Folder of the dataset.
        dataset: PathBuf,
        scene: SceneId,
        /// The folder of the reference.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// A result states a number that does not follow from the others in it.
    #[error("'{}': at {place} it states {said}, but its own numbers give {found}; it was changed by hand", path.display())]
    Contradiction {
        path: PathBuf,
        place: String,
        /// The number in the result.
        said: String,
        /// The number that follows.
        found: String,
    },
    /// The dataset has no renders.
    #[error("the dataset '{}' has no renders; run `mateval prep render DATASET`", dataset.display())]
    NoPhotoRenderer { dataset: PathBuf },
    /// The scene has a photo from elsewhere, so it has no renders.
    #[error("scene '{scene}' has no renders: its input picture is a photo from elsewhere, whose light is not known")]
    Photographed { scene: SceneId },
    /// No protocol has the name.
    #[error("cannot score: there is no protocol '{name}'; use one of: {}", known.join(", "))]
    UnknownProtocol {
        name: String,
        /// The names that exist.
        known: &'static [&'static str],
    },
    /// The protocol was removed.
    #[error("cannot score: protocol '{name}' was removed before any release, since {reason}; use 'mateval-3'")]
    RemovedProtocol { name: String, reason: &'static str },
    /// A protocol was written for another version of the scorer.
    #[error(
        "cannot score: protocol '{protocol}' expects version {found} of the scorer, this is version {expected}; \
         use the protocols of this version"
    )]
    ScorerVersion {
        protocol: String,
        /// The version of this scorer.
        expected: u32,
        found: u32,
    },
    /// A protocol states a constant that the code does not have.
    #[error(
        "cannot score: protocol '{protocol}' states fixed.{rule} = {found}, the code has {expected}, which no protocol can \
         change; use the protocols of this version"
    )]
    FixedRule {
        protocol: String,
        rule: String,
        /// Its value in the code, as JSON.
        expected: String,
        /// Its value in the protocol, as JSON.
        found: String,
    },
    /// The loaded network of LPIPS is not the one whose numbers results hold.
    #[error(
        "cannot score: expected the weights of LPIPS' network '{expected}', found those of '{found}'; load '{expected}'"
    )]
    LpipsNet {
        /// The network that results hold numbers of.
        expected: &'static str,
        /// The network that was loaded.
        found: &'static str,
    },
    /// A result holds LPIPS, and the weights to compute it again are missing.
    #[error("cannot verify the result: it holds LPIPS, and its weights are missing: {reason}; run: {fix}")]
    LpipsWeights {
        /// Why they are missing.
        reason: String,
        /// The command that fetches them.
        fix: String,
    },
    /// A scene has no input view.
    #[error("scene '{scene}': expected an input view, found none; run `mateval prep verify`")]
    NoInputView { scene: SceneId },
    /// `targets.json` lists no view of a scene.
    #[error("scene '{scene}': expected a view of it in targets.json, found none; run `mateval prep verify`")]
    NoTargets { scene: SceneId },
    /// `targets.json` lists views of a scene without its input view.
    #[error(
        "scene '{scene}': targets.json lists views without the input view, to which light is fitted; add it, or score \
         without light"
    )]
    InputNotTarget { scene: SceneId },
    /// An atlas has a size that the format does not allow.
    #[error(
        "'{}': the atlas of instance '{instance}' has {found} texels a side, expected {} to {}; run `mateval prep \
         verify`",
        path.display(), expected.start(), expected.end()
    )]
    AtlasSize {
        /// `scene.json`.
        path: PathBuf,
        instance: InstanceId,
        /// The sizes that the format allows.
        expected: RangeInclusive<usize>,
        /// The size that `scene.json` states.
        found: usize,
    },
    /// A map of the truth does not have the size of its atlas.
    #[error(
        "'{}': expected {expected}x{expected} texels, as scene.json states, found {}x{}; run `mateval prep verify`",
        path.display(), found[0], found[1]
    )]
    TruthMapSize {
        path: PathBuf,
        /// Width and height of the atlas.
        expected: usize,
        /// Width and height of the map.
        found: [usize; 2],
    },
    /// A picture of the truth does not have the size of its camera's picture.
    #[error(
        "view '{view}': expected pictures of {}x{} pixels, the camera's size, found {}x{}; run `mateval prep verify`",
        expected[0], expected[1], found[0], found[1]
    )]
    TruthPictureSize {
        view: ViewId,
        /// Width and height of the camera's picture.
        expected: [usize; 2],
        /// Width and height of the picture.
        found: [usize; 2],
    },
    /// A result could not be turned into JSON to compare it.
    #[error("cannot compare results: {0}; please report this result")]
    Compare(serde_json::Error),
    /// The dataset or the submission could not be read.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// The submission could not be read.
    #[error(transparent)]
    Submission(#[from] mateval_submission::SubmissionError),
    /// The lights could not be fitted.
    #[error(transparent)]
    Light(#[from] mateval_light::LightError),
    /// The tracer cannot work with the scene.
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    /// A picture could not be read.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
    /// Two pictures of a view could not be compared.
    #[error("scene '{scene}', view '{view}': {source}")]
    Metric { scene: SceneId, view: ViewId, source: mateval_metrics::MetricError },
}

impl EvalError {
    /// The error of an action on a path.
    pub(crate) fn io(action: &'static str, path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self + use<> {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source }
    }
}

fn missing_line(submission: &std::path::Path, scenes: &[SceneId]) -> String {
    format!("\n  '{}': {} scenes: {}", submission.display(), scenes.len(), quoted(scenes))
}
