//! `release.json`: everything that the report of a release states, for programs.

use std::collections::BTreeSet;

use mateval_audit::stats::StatsFile;
use mateval_scene::scene_cost::StepCost;
use mateval_scene::{Finding, RendererId, SceneId, Severity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::comparisons::SceneVerdict;
use crate::inputs::{SceneInputs, SharedLicence};
use crate::publication::Publication;
use crate::reference_scores::ReferenceScores;
use crate::remake::Remake;
use crate::table_one::Evaluated;
use crate::thumbnails::Thumbnail;
use crate::truth_renders::{RenderedWith, ViewNoise};

/// The format of this version of the file.
pub const RELEASE_FORMAT: &str = "mateval-release/1";

/// The file's name in the report's folder; a folder without it is not a report and is never replaced.
pub const RELEASE: &str = "release.json";

/// A release.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReleaseFile {
    /// Always `mateval-release/1`.
    pub format: String,
    /// The program that wrote the report and its version.
    pub tool: String,
    /// The dataset.
    pub dataset: ReleasedDataset,
    /// What was stated about the publication.
    pub publication: Publication,
    /// An entry for BibTeX.
    pub citation: String,
    /// The commitment to the ground truth, if it is withheld; then everything that was measured on it is null, except for
    /// means over at least two scenes and the counts of checks.
    pub withheld: Option<Withheld>,
    /// The counts of the dataset.
    pub stats: StatsFile,
    /// What is scored.
    pub evaluated: Evaluated,
    /// The verdict of `prep verify`.
    pub verification: Verification,
    /// The scores of the truth itself; null where no result was given.
    pub ceiling: Option<ReferenceScores>,
    /// The scores of a constant estimate; null where no result was given.
    pub floor: Option<ReferenceScores>,
    /// How the RGB truth was rendered.
    pub rendered: Vec<RenderedWith>,
    /// How to make the dataset again.
    pub remake: Remake,
    /// The licences of the sources.
    pub licences: Vec<SharedLicence>,
    /// Scenes whose source came without a licence.
    pub without_licence: Vec<SceneId>,
    /// The scenes, in the dataset's order.
    pub scenes: Vec<ReleasedScene>,
}

/// The dataset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReleasedDataset {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of its manifest, in hexadecimal: its identity.
    pub manifest_sha256: String,
    /// The renderer of the RGB truth; null where not all scenes without a photo from elsewhere are rendered, and
    /// where there are none.
    pub photo_renderer: Option<RendererId>,
}

/// The ground truth that the release withholds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Withheld {
    /// SHA-256 of the manifest's lines of the withheld files, in hexadecimal.
    pub commitment_sha256: String,
}

/// The verdict of `prep verify`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Verification {
    /// Whether there is no finding of severity `error`.
    pub sound: bool,
    /// Its findings, sorted.
    pub findings: Vec<Finding>,
}

/// One scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReleasedScene {
    /// The scene.
    pub scene: SceneId,
    /// Whether its input picture is a photo from elsewhere. Such a scene has no renders and cannot be compared.
    pub photo: bool,
    /// A small picture of the input view; null where it is not rendered.
    pub picture: Option<Thumbnail>,
    /// Whether two renderers agree on it; null where no comparison was given.
    pub comparison: Option<SceneVerdict>,
    /// The noise of the RGB truth; null where the scene is not rendered or the ground truth is withheld.
    pub noise: Option<Vec<ViewNoise>>,
    /// What making it has cost; empty where that was not recorded.
    pub costs: Vec<StepCost>,
    /// What was wrong with its source and what was done instead, as in `scene.json`.
    pub findings: Vec<Finding>,
    /// The files of its source.
    pub inputs: SceneInputs,
}

impl ReleaseFile {
    /// Whether nothing in the report speaks against the release: the dataset is sound, and every comparison that was given
    /// agrees.
    pub fn is_good(&self) -> bool {
        self.verification.sound && self.comparisons().all(|verdict| verdict.agrees)
    }

    /// The comparisons that were given.
    pub fn comparisons(&self) -> impl Iterator<Item = &SceneVerdict> {
        self.scenes.iter().filter_map(|scene| scene.comparison.as_ref())
    }

    /// The findings of `prep verify` about one scene.
    pub fn verified(&self, scene: &SceneId) -> impl Iterator<Item = &Finding> {
        self.verification.findings.iter().filter(move |finding| scene_of(finding) == Some(scene.as_str()))
    }

    /// The findings of `prep verify` about no scene of the dataset.
    pub fn verified_whole(&self) -> impl Iterator<Item = &Finding> {
        let ids: BTreeSet<&str> = self.scenes.iter().map(|scene| scene.scene.as_str()).collect();
        self.verification.findings.iter().filter(move |finding| !scene_of(finding).is_some_and(|id| ids.contains(id)))
    }

    /// Whether `prep verify` found an error in the scene.
    pub fn is_sound(&self, scene: &SceneId) -> bool {
        self.verified(scene).all(|finding| finding.severity != Severity::Error)
    }
}

/// The folder in `scenes` that the finding is about.
fn scene_of(finding: &Finding) -> Option<&str> {
    finding.file.strip_prefix("scenes/")?.split('/').next()
}
