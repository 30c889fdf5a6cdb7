//! The one error of this crate.

use std::path::PathBuf;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::ids::quoted;
use mateval_dataset::open::Dataset;
use mateval_dataset::{SceneId, ViewId};
use mateval_files::FileError;

#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    #[error(transparent)]
    Files(#[from] FileError),
    /// Scores may only be taken from the cache, and are not there.
    #[error(
        "these scores are not in the cache:{}\nscore these scenes with the same --cache, --protocol and version first",
        missing.iter().map(|(path, scenes)| missing_line(path, scenes)).collect::<String>()
    )]
    NotCached { missing: Vec<(PathBuf, Vec<SceneId>)> },
    /// A scene's reference under light cannot be used, or is missing.
    #[error(
        "the scorer's reference of scene '{scene}' in '{}' cannot be used: {what}; make it again: mateval prep render --only \
         scorer --scene {scene} '{}', then mateval prep finish '{}'",
        path.display(), dataset.display(), dataset.display()
    )]
    Reference {
        dataset: PathBuf,
        scene: SceneId,
        /// The folder of the reference.
        path: PathBuf,
        what: String,
    },
    /// A sound reference was rendered with another number of samples.
    #[error(
        "the reference of scene '{scene}' was rendered with {found} samples each half, not {wanted}; give --scorer-samples \
         {found} to keep it, or --force to replace it, which changes the dataset's identity"
    )]
    ReferenceSamples { scene: SceneId, found: u32, wanted: u32 },
    /// A result states a number that does not follow from the others in it.
    #[error(
        "'{}': at {place} it states {said}, but the numbers below it give {found}: one of them was changed by hand; write it \
         again: mateval eval score SUBMISSION --dataset DATASET --out '{}' --force",
        path.display(), path.display()
    )]
    Contradiction { path: PathBuf, place: String, said: String, found: String },
    #[error("the dataset '{}' has no renders; run `mateval prep render DATASET`", dataset.display())]
    NoPhotoRenderer { dataset: PathBuf },
    /// The scene has a photo from elsewhere, so it has no renders.
    #[error("scene '{scene}' has no renders: its input picture is a photo from elsewhere, whose light is not known")]
    Photographed { scene: SceneId },
    #[error("cannot score: there is no protocol '{name}'; use one of: {}", known.join(", "))]
    UnknownProtocol { name: String, known: &'static [&'static str] },
    #[error(
        "cannot score: protocol '{protocol}' states {rule} = {found}, the code has {expected}, which no protocol can \
         change; use the protocols of this version"
    )]
    OtherRule { protocol: String, rule: String, expected: String, found: String },
    /// The loaded network of LPIPS is not the one whose numbers results hold.
    #[error(
        "cannot score: expected the weights of LPIPS' network '{expected}', found those of '{found}'; load '{expected}'"
    )]
    LpipsNet { expected: &'static str, found: &'static str },
    /// A result holds LPIPS, and the weights to compute it again are missing.
    #[error("cannot verify the result: it holds LPIPS, and its weights are missing: {reason}; run: {fix}")]
    LpipsWeights { reason: String, fix: String },
    /// The dataset is not what its format says.
    #[error("{place}: expected {expected}, found {found}; run `mateval prep verify`")]
    Unsound { place: String, expected: String, found: String },
    /// `targets.json` lists views of a scene without its input view.
    #[error(
        "scene '{scene}': targets.json lists views without the input view, to which light is fitted; add it, or score \
         without light"
    )]
    InputNotTarget { scene: SceneId },
    #[error(transparent)]
    Dataset(#[from] mateval_dataset::DatasetError),
    #[error(transparent)]
    Submission(#[from] mateval_submission::SubmissionError),
    #[error(transparent)]
    Light(#[from] mateval_light::LightError),
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
    #[error("scene '{scene}', view '{view}': {source}")]
    Metric { scene: SceneId, view: ViewId, source: mateval_metrics::MetricError },
}

impl EvalError {
    /// The scene's reference cannot be used.
    pub(crate) fn reference(dataset: &Dataset, scene: &SceneFile, what: impl Into<String>) -> Self {
        let path = dataset.folder(&scene.id).scorer();
        Self::Reference { dataset: dataset.root.clone(), scene: scene.id.clone(), path, what: what.into() }
    }

    pub(crate) fn no_input_view(scene: &SceneId) -> Self {
        Self::unsound(format!("scene '{scene}'"), "an input view", "none")
    }

    pub(crate) fn unsound(place: String, expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self::Unsound { place, expected: expected.into(), found: found.into() }
    }
}

fn missing_line(submission: &std::path::Path, scenes: &[SceneId]) -> String {
    format!("\n  '{}': {} scenes: {}", submission.display(), scenes.len(), quoted(scenes))
}
