//! The error of this crate, whose recipes and scenes have faults of their own.

use std::path::PathBuf;

use mateval_dataset::dataset::PerturbationKind;
use mateval_dataset::ids::{counted, quoted};
use mateval_dataset::{RendererId, SceneId};
use mateval_files::FileError;
use mateval_files::untrusted::in_words;

use crate::build::fault::BuildFault;
use crate::recipe::fault::RecipeFault;
use crate::redress::secret::SecretFault;

/// Why a dataset, its renders or a survey could not be made or examined.
#[derive(Debug, thiserror::Error)]
pub enum PrepError {
    #[error(transparent)]
    Files(#[from] FileError),
    /// A file or folder is not what the command needs, or must not be replaced.
    #[error("'{}' {why}", path.display())]
    Unusable {
        path: PathBuf,
        /// The rest of the message: what is wrong, and what to do.
        why: &'static str,
    },
    /// Pictures exist that were rendered with another number of samples.
    #[error(
        "'{}' has {views} views that were rendered with {found} samples each half, not {wanted}; give --samples {found} to \
         keep them, or --force to replace them, which changes the dataset's identity",
        path.display()
    )]
    OtherSamples { path: PathBuf, views: usize, found: u32, wanted: u32 },
    /// The recipe is not valid, or its sources are missing; all faults are listed.
    #[error("recipe '{}': {}", path.display(), joined(faults))]
    Recipe { path: PathBuf, faults: Vec<RecipeFault> },
    /// A file of a survey's rules that is not valid.
    #[error("rules '{}': {}", path.display(), in_words(source.to_string().trim_end()))]
    Rules {
        path: PathBuf,
        /// What is wrong with it, and where.
        source: Box<toml::de::Error>,
    },
    /// A level that a kind of perturbation does not have.
    #[error("{kind} has the levels 0 to {most}, found {found}")]
    NoSuchLevel {
        kind: PerturbationKind,
        /// The level that was asked for.
        found: u32,
        most: u32,
    },
    /// A scene without ground truth, from which pictures of its geometry are made.
    #[error(
        "scene '{scene}' has no ground truth, without which its pictures cannot be made again; add its ground_truth/"
    )]
    NoTruth { scene: SceneId },
    /// A house that was named alone is none of the survey's.
    #[error(
        "'{name}' is none of the survey's {houses} houses; name one by its file relative to --source, or by the file's name"
    )]
    UnknownHouse { name: String, houses: usize },
    /// The key of a survey's redressed scenes.
    #[error(transparent)]
    Key(#[from] SecretFault),
    /// A path given to a survey does not lie in the source's folder.
    #[error("{0}; a recipe cannot refer to it: name the folder that contains all inputs with --source")]
    OutsideSource(#[from] mateval_files::source_folder::BelowError),
    /// A picture of a view has another size than its camera's.
    #[error("{picture} has {}x{} pixels, expected {}x{}{hint}", found[0], found[1], expected[0], expected[1])]
    PictureSize {
        /// Which one, as in "'instance.png'".
        picture: String,
        /// Width and height in pixels.
        expected: [usize; 2],
        found: [usize; 2],
        hint: &'static str,
    },
    /// The renderer has rendered no view of any of the scenes.
    #[error(
        "'{}' has no pictures by {renderer} of scene {}; run `mateval prep render DATASET --renderer {renderer}`",
        path.display(), quoted(scenes)
    )]
    NotRendered { path: PathBuf, renderer: RendererId, scenes: Vec<SceneId> },
    /// A view's pictures do not have the size of its camera's picture.
    #[error(
        "'{}' contains pictures that do not have the camera's {}x{} pixels; run `mateval prep verify`",
        path.display(), expected[0], expected[1]
    )]
    ViewSize {
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
    /// The output folder holds scenes that the recipe would make otherwise, or not at all.
    #[error("'{}' holds a build of another recipe, other source files or another version:{}", path.display(), other_scenes(changed, dropped))]
    OtherBuild {
        path: PathBuf,
        /// The scenes that were made otherwise.
        changed: Vec<SceneId>,
        /// The scenes that the recipe lacks.
        dropped: Vec<SceneId>,
    },
    #[error(
        "'{}' lacks {} of the recipe: {}; make them by `prep build --scene`, or finish without them by --without",
        path.display(), counted(scenes.len(), "scene"), quoted(scenes)
    )]
    MissingScenes { path: PathBuf, scenes: Vec<SceneId> },
    #[error(
        "'{}' holds what is no scene of the dataset: '{}'; run `mateval prep finish` if it was built apart, otherwise move \
         it away",
        path.display(), names.join("', '")
    )]
    StrayScenes { path: PathBuf, names: Vec<String> },
    #[error("scene '{scene}': {fault}")]
    Scene { scene: SceneId, fault: Box<BuildFault> },
    /// The source could not be read at all.
    #[error(transparent)]
    Source(#[from] mateval_sources::SourceError),
    /// The tracer cannot work with the scene.
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    /// The dataset could not be read or written.
    #[error(transparent)]
    Dataset(#[from] mateval_dataset::DatasetError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl PrepError {
    /// A [`PrepError::Unusable`].
    pub(crate) fn unusable(path: impl Into<PathBuf>, why: &'static str) -> Self {
        Self::Unusable { path: path.into(), why }
    }
    /// A [`PrepError::Scene`]; to be used with `map_err`.
    pub(crate) fn scene<E: Into<BuildFault>>(scene: &SceneId) -> impl FnOnce(E) -> Self {
        move |fault| Self::Scene { scene: scene.clone(), fault: Box::new(fault.into()) }
    }
}

fn joined(faults: &[RecipeFault]) -> String {
    faults.iter().map(RecipeFault::to_string).collect::<Vec<_>>().join("; ")
}

fn other_scenes(changed: &[SceneId], dropped: &[SceneId]) -> String {
    let mut text = String::new();
    if !changed.is_empty() {
        let (count, ids) = (counted(changed.len(), "scene"), quoted(changed));
        text += &format!("\n  {count} would be made otherwise: {ids}; replace one by --scene SCENE --force");
    }
    if !dropped.is_empty() {
        let (count, ids) = (counted(dropped.len(), "scene"), quoted(dropped));
        text += &format!(
            "\n  {count} not in the recipe: {ids}; name them there, and leave them out by `prep finish --without`"
        );
    }
    text + "\n  --force without --scene makes the whole dataset again"
}
