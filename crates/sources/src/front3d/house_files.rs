//! The paths of a house's files, and how findings give them.

use std::path::{Path, PathBuf};

use super::appearance_rule::AppearanceRule;

/// Paths of a house and its library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HouseFiles {
    /// The folder that the other paths are relative to.
    pub root: PathBuf,
    /// The house's JSON.
    pub house: PathBuf,
    /// 3D-FUTURE's folder, with `model_info.json` and a folder for each model.
    pub models: PathBuf,
    /// 3D-FRONT's folder of textures. Without it the architecture shows its colours only.
    pub textures: Option<PathBuf>,
    /// A file of designers' cameras beside the house.
    pub cameras: Option<PathBuf>,
    /// Whether to place everything as BlenderProc does: the architecture mirrored, and each piece of furniture mirrored
    /// back.
    pub blenderproc_compat: bool,
    /// Where roughness and metallic come from.
    pub appearance: AppearanceRule,
}

/// A path with forward slashes, as findings and lists of files give it.
pub(super) fn shown_path(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}
