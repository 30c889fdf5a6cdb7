//! `companions.json`: which pictures of a scene's companions a folder holds, and what they were made from.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::manifest::{self, sha256_of_bytes};
use crate::{SceneError, SceneId};

/// The version in `companions.json`.
pub const COMPANIONS_FORMAT: &str = "mateval-companions/2";

/// The name of the file.
pub const COMPANIONS_JSON: &str = "companions.json";

/// `companions.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompanionsFile {
    /// [`COMPANIONS_FORMAT`].
    pub format: String,
    /// SHA-256, hex, of everything that the pictures depend on.
    pub key: String,
    /// [`light_inputs_sha256`] of the scene that the pictures were made from; part of what `key` covers.
    pub inputs_sha256: String,
    /// SHA-256, hex, of each picture, by file name.
    pub files: BTreeMap<String, String>,
}

/// Whether a file of a scene is made by rendering its other files.
pub fn is_rendered(file: &str) -> bool {
    file.contains("/renders/") || file.contains("/companions/")
}

/// SHA-256, hex, of names and hashes of all files of a scene from which light is rendered, as the manifest lists them.
pub fn light_inputs_sha256(root: &Path, scene: &SceneId) -> Result<String, SceneError> {
    let folder = format!("scenes/{scene}/");
    let entries = manifest::entries(root)?;
    let inputs = entries.iter().filter(|entry| entry.file.starts_with(&folder) && !is_rendered(&entry.file));
    let lines: String = inputs.map(|entry| format!("{}  {}\n", entry.sha256, entry.file)).collect();
    Ok(sha256_of_bytes(lines.as_bytes()))
}
