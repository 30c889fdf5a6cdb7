//! The error of this crate.

use std::path::PathBuf;

use mateval_scene::{SceneId, ViewId};

/// Why a dataset could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PrepError {
    /// The file system refused.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was tried, as in "read" or "write".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A recipe that cannot be carried out; every fault is listed.
    #[error("recipe '{}': {}", path.display(), faults.join("; "))]
    Recipe {
        /// The recipe.
        path: PathBuf,
        /// All that is wrong with it.
        faults: Vec<String>,
    },
    /// A file of a survey's rules that is not valid.
    #[error("rules '{}': {}", path.display(), source.to_string().trim_end())]
    Rules {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and where.
        source: Box<toml::de::Error>,
    },
    /// A list of rejected rooms that is not valid.
    #[error("list '{}': {source}", path.display())]
    List {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and where.
        source: csv::Error,
    },
    /// The lists of rejected rooms are too long.
    #[error("list '{}': the lists have more than {most} rows in total", path.display())]
    LongLists {
        /// The file that exceeds the limit.
        path: PathBuf,
        /// The largest number of rows of all lists together.
        most: usize,
    },
    /// An input of a survey does not exist.
    #[error("'{}' does not exist; correct the path, or name its folder with --source", path.display())]
    MissingInput {
        /// The file or folder.
        path: PathBuf,
    },
    /// A survey was given no house.
    #[error("'{}' contains no house; expected JSON files of 3D-FRONT", path.display())]
    NoHouses {
        /// The source's folder.
        path: PathBuf,
    },
    /// The paths given to a survey lie in no common folder.
    #[error("'{}' has no folder in common with the other paths; put them into one and name it with --source", path.display())]
    NoCommonFolder {
        /// One of the paths.
        path: PathBuf,
    },
    /// A path given to a survey does not lie in the source's folder.
    #[error("{0}; a recipe cannot refer to it: name the folder that contains all inputs with --source")]
    OutsideSource(#[from] mateval_sources::below::BelowError),
    /// The output of a survey exists and is not a survey.
    #[error("'{}' exists and is not a survey, or contains other files too; it is not replaced: choose another --out", path.display())]
    NotASurvey {
        /// The folder.
        path: PathBuf,
    },
    /// The dataset's build did not finish.
    #[error("'{}' has no MANIFEST.sha256: its build did not finish; run `prep build` again", path.display())]
    UnfinishedBuild {
        /// The dataset's folder.
        path: PathBuf,
    },
    /// A renderer made a picture of another size than the camera's.
    #[error(
        "scene '{scene}', view '{view}': the rendered picture has {}x{} pixels, expected {}x{}",
        found[0], found[1], expected[0], expected[1]
    )]
    RenderedSize {
        /// The scene.
        scene: SceneId,
        /// The view.
        view: ViewId,
        /// Width and height of the camera's picture, in pixels.
        expected: [usize; 2],
        /// Width and height of the rendered picture, in pixels.
        found: [usize; 2],
    },
    /// The output is in the way.
    #[error("'{}' {what}", path.display())]
    Output {
        /// The dataset's folder.
        path: PathBuf,
        /// What is wrong with it and what to do.
        what: String,
    },
    /// A scene from which nothing can be made.
    #[error("scene '{scene}': {what}")]
    Scene {
        /// Its id.
        scene: String,
        /// What is missing.
        what: String,
    },
    /// The source could not be read at all.
    #[error(transparent)]
    Source(#[from] mateval_sources::SourceError),
    /// The tracer cannot work with the scene.
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    /// The dataset could not be read or written.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl PrepError {
    /// An [`PrepError::Io`]; to be used with `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}
