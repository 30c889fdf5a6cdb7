//! What a build is asked for.

use std::path::PathBuf;

use mateval_scene::SceneId;

use crate::render::BlenderOptions;

/// The inputs of a build.
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// The recipe.
    pub recipe: PathBuf,
    /// The folder that the recipe's paths are relative to; if absent, the recipe's own.
    pub source: Option<PathBuf>,
    /// The dataset's folder.
    pub out: PathBuf,
    /// Make only these scenes, and leave the files of the whole dataset to [`crate::finish`]; all scenes where empty.
    pub scenes: Vec<SceneId>,
    /// Replace what exists: the scenes that are named, or the whole dataset where none is.
    pub force: bool,
    /// The Blender that reads `.blend` files; absent if none was found.
    pub blender: Option<BlenderOptions>,
    /// The folder of atlases that earlier builds made; none to make all of them.
    pub atlas_cache: Option<PathBuf>,
}
