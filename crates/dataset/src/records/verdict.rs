//! `compare.json`: whether the tracer and the photo renderer show the same scenes.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::layout::{BuildFolder, COMPARE};
use crate::{DatasetError, SceneId, json};

/// The version in the dataset's `compare.json`.
pub const VERDICT_FORMAT: &str = "mateval-compare-verdict/2";

/// The version before, whose checks counted as disagreeing where they decided nothing.
const EARLIER_FORMAT: &str = "mateval-compare/1";

/// A dataset's `compare.json`, which `mateval prep compare` writes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VerdictFile {
    /// Always `mateval-compare-verdict/2`.
    pub format: String,
    /// The program that compared and its version, as in `mateval 0.1.0`.
    pub tool: String,
    /// SHA-256, hex, of the manifest of the dataset that was compared. After a change of the dataset the verdict is
    /// void.
    pub manifest_sha256: String,
    /// By scene, the numbers of its checks.
    pub scenes: BTreeMap<SceneId, CompareCounts>,
}

/// The outcomes of a scene's checks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompareCounts {
    /// Number of checks within their bounds.
    pub agree: usize,
    /// Number of checks outside their bounds, or whose pictures are missing or unreadable.
    pub differ: usize,
    /// Number of checks that decide nothing: too noisy, of too few samples, or without a pixel to compare.
    pub undecided: usize,
}

impl VerdictFile {
    /// The file of the dataset in `root`; absent if it does not exist or is of an earlier version, since it can be made
    /// again. It may be about an earlier state of the dataset.
    pub fn read_beside(root: &Path) -> Result<Option<Self>, DatasetError> {
        let path = root.join(COMPARE);
        if !path.exists() {
            return Ok(None);
        }
        match json::read_format(&path, VERDICT_FORMAT) {
            Err(_) if json::read_format::<serde_json::Value>(&path, EARLIER_FORMAT).is_ok() => Ok(None),
            read => read.map(Some),
        }
    }

    /// Adds the scenes to the file of the dataset in `root`, and replaces those that it lists. Scenes that were
    /// compared by another version, or before the dataset changed, are dropped. Several processes may compare scenes of
    /// one dataset.
    pub fn add_beside(self, root: &Path) -> Result<(), DatasetError> {
        let _lease = BuildFolder::of(root).lease_of_verdict()?;
        let mut file = self;
        // A file that cannot be read is replaced: it can be made again.
        let earlier = Self::read_beside(root).ok().flatten();
        if let Some(earlier) =
            earlier.filter(|earlier| earlier.manifest_sha256 == file.manifest_sha256 && earlier.tool == file.tool)
        {
            let added = std::mem::replace(&mut file.scenes, earlier.scenes);
            file.scenes.extend(added);
        }
        json::write(&root.join(COMPARE), &file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest;

    fn verdict(manifest: &str, scenes: &[(&str, usize)]) -> VerdictFile {
        let counts = |&(id, agree): &(&str, usize)| {
            (SceneId::new(id).unwrap(), CompareCounts { agree, ..CompareCounts::default() })
        };
        VerdictFile {
            format: VERDICT_FORMAT.to_owned(),
            tool: "test".to_owned(),
            manifest_sha256: manifest.to_owned(),
            scenes: scenes.iter().map(counts).collect(),
        }
    }

    #[test]
    fn scenes_are_added_until_the_dataset_changes() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        std::fs::create_dir(root.join("scenes")).unwrap();
        std::fs::write(root.join("scenes/a"), "a").unwrap();
        let identity = manifest::write(root).unwrap();
        assert_eq!(VerdictFile::read_beside(root).unwrap(), None);
        verdict("one", &[("hall", 1), ("room", 2)]).add_beside(root).unwrap();
        verdict("one", &[("room", 3), ("attic", 4)]).add_beside(root).unwrap();
        let all = verdict("one", &[("attic", 4), ("hall", 1), ("room", 3)]);
        assert_eq!(VerdictFile::read_beside(root).unwrap(), Some(all));
        verdict("two", &[("room", 5)]).add_beside(root).unwrap();
        assert_eq!(VerdictFile::read_beside(root).unwrap(), Some(verdict("two", &[("room", 5)])));
        assert_eq!(manifest::check(root).unwrap(), [], "the manifest does not concern it");
        assert_eq!(manifest::write(root).unwrap(), identity);
        // A verdict of the version before is void, and one of an unknown version is an error.
        for (format, is_void) in [(EARLIER_FORMAT, true), ("mateval-compare-verdict/9", false)] {
            std::fs::write(root.join(COMPARE), format!("{{\"format\": \"{format}\", \"scenes\": {{}}}}")).unwrap();
            assert_eq!(VerdictFile::read_beside(root).is_ok_and(|read| read.is_none()), is_void, "{format}");
        }
        std::fs::write(root.join(COMPARE), "{").unwrap();
        VerdictFile::read_beside(root).unwrap_err();
    }
}
