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
        /// The file.
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
    /// The pictures of companions changed while they were read.
    #[error("the companions in '{}' were changed or removed while they were in use; score again", path.display())]
    CompanionsVanished {
        /// Their folder.
        path: PathBuf,
    },
    /// The dataset names no renderer whose pictures are scored.
    #[error("the dataset '{}' has no renders that are scored; run `mateval prep render DATASET`", dataset.display())]
    NoScoredRenderer {
        /// Its folder.
        dataset: PathBuf,
    },
    /// The scene has a photo from elsewhere, so it has no renders.
    #[error("scene '{scene}' has no renders: its input picture is a photo from elsewhere, whose light is not known")]
    Photographed {
        /// The scene.
        scene: SceneId,
    },
    /// No protocol has the name.
    #[error("cannot score: there is no protocol '{name}'; use one of: {}", known.join(", "))]
    UnknownProtocol {
        /// The name.
        name: String,
        /// The names that exist.
        known: &'static [&'static str],
    },
    /// The protocol was removed.
    #[error(
        "cannot score: protocol '{name}' was removed before any release, because under it the true material did not always \
         score best; use 'mateval-2'"
    )]
    RemovedProtocol {
        /// The name.
        name: String,
    },
    /// A protocol was written for another version of the scorer.
    #[error(
        "cannot score: protocol '{protocol}' expects version {found} of the scorer, this is version {expected}; \
         use the protocols of this version"
    )]
    ScorerVersion {
        /// The protocol's name.
        protocol: String,
        /// The version of this scorer.
        expected: u32,
        /// The protocol's version.
        found: u32,
    },
    /// A protocol states a constant that the code does not have.
    #[error(
        "cannot score: protocol '{protocol}' states fixed.{rule} = {found}, the code has {expected}, which no protocol can \
         change; use the protocols of this version"
    )]
    FixedRule {
        /// The protocol's name.
        protocol: String,
        /// The constant's name.
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
    NoInputView {
        /// The scene.
        scene: SceneId,
    },
    /// `targets.json` lists no view of a scene.
    #[error("scene '{scene}': expected a view of it in targets.json, found none; run `mateval prep verify`")]
    NoTargets {
        /// The scene.
        scene: SceneId,
    },
    /// `targets.json` lists views of a scene without its input view.
    #[error(
        "scene '{scene}': targets.json lists views without the input view, to which light is fitted; add it, or score \
         without light"
    )]
    InputNotTarget {
        /// The scene.
        scene: SceneId,
    },
    /// An atlas has a size that the format does not allow.
    #[error(
        "'{}': the atlas of instance '{instance}' has {found} texels a side, expected {} to {}; run `mateval prep \
         verify`",
        path.display(), expected.start(), expected.end()
    )]
    AtlasSize {
        /// `scene.json`.
        path: PathBuf,
        /// The instance.
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
        /// The map.
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
        /// The view.
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
    Metric {
        /// The scene.
        scene: SceneId,
        /// The view.
        view: ViewId,
        /// Why not.
        source: mateval_metrics::MetricError,
    },
}

impl EvalError {
    /// Whether the file system refused.
    pub(crate) fn is_io(&self) -> bool {
        use mateval_image::ImageError;
        use mateval_scene::SceneError;
        matches!(self, Self::Io { .. } | Self::Image(ImageError::Io { .. }) | Self::Dataset(SceneError::Io { .. }))
    }
}

fn missing_line(submission: &std::path::Path, scenes: &[SceneId]) -> String {
    format!("\n  '{}': {} scenes: {}", submission.display(), scenes.len(), quoted(scenes))
}
