//! Examines finished datasets: whether they are sound, whether two renderers agree on them, what they contain.
//!
//! In: a dataset's folder. Out: findings ([`verify`]), the agreement of Blender's pictures with those of the built-in
//! tracer ([`compare`]), counts ([`stats`]), a scene for Mitsuba 3 ([`mitsuba_export`]), a public and a private copy
//! ([`publish`]).

pub mod compare;
pub mod mitsuba_export;
pub mod publish;
pub mod stats;
pub mod verify;

use std::path::PathBuf;

use mateval_dataset::ids::quoted;
use mateval_dataset::{SceneId, ViewId};
use mateval_prep::render::RendererKind;

/// Why a dataset could not be examined, exported or published.
#[derive(Debug, thiserror::Error)]
pub enum AuditError {
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was attempted, as in "read" or "write".
        action: &'static str,
        path: PathBuf,
        source: std::io::Error,
    },
    /// The folder contains no finished dataset.
    #[error("'{}' has no dataset.json: it is not a dataset, or its build did not finish and `prep build` must be run again", path.display())]
    NotADataset { path: PathBuf },
    /// The dataset has no ground truth that could be withheld.
    #[error("'{}' has no ground truth to withhold", path.display())]
    NoGroundTruth { path: PathBuf },
    /// The scene has no such view.
    #[error("'{}' has no view '{view}' of the scene '{scene}'", path.display())]
    NoView {
        path: PathBuf,
        scene: SceneId,
        /// The view that it does not have.
        view: ViewId,
    },
    /// The renderer has rendered no view of any of the scenes.
    #[error(
        "'{}' has no pictures by {renderer} of scene {}; run `mateval prep render DATASET --renderer {renderer}`",
        path.display(), quoted(scenes)
    )]
    NotRendered { path: PathBuf, renderer: RendererKind, scenes: Vec<SceneId> },
    /// A view's pictures do not have the size of its camera's picture.
    #[error(
        "'{}' contains pictures that do not have the camera's {}x{} pixels; run `mateval prep verify`",
        path.display(), expected[0], expected[1]
    )]
    WrongSize {
        path: PathBuf,
        /// Width and height of the camera's picture, in pixels.
        expected: [usize; 2],
    },
    /// The pictures of one view under each light are larger than the memory reserved for them.
    #[error("scene '{scene}': the pictures of one view under {lights} lights take more than {most_bytes} bytes")]
    TooManyLights {
        scene: SceneId,
        /// The number of its lights.
        lights: usize,
        /// The memory reserved, in bytes.
        most_bytes: u64,
    },
    /// The output would lie in the dataset.
    #[error("'{}' would lie in the dataset, whose manifest does not list it; choose another --out", path.display())]
    OutputInDataset { path: PathBuf },
    /// The output exists and is not a comparison.
    #[error("'{}' exists and is not a comparison; it is not replaced: choose another --out", path.display())]
    NotAComparison { path: PathBuf },
    /// Pictures could not be rendered, or the recipe could not be read.
    #[error(transparent)]
    Prep(#[from] mateval_prep::PrepError),
    /// The tracer cannot work with the scene.
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    /// The dataset could not be read or written.
    #[error(transparent)]
    Dataset(#[from] mateval_dataset::SceneError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl AuditError {
    /// A constructor of [`AuditError::Io`] for `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}
