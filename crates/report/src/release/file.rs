//! `release.json`: everything that the report of a release states, for programs.
//!
//! Here are also the facts about a publication that its files do not hold, with the citation, and what must not become
//! public while the ground truth is withheld: everything that was measured on it in single scenes, and every sentence
//! that may quote it. What remains of it are means over scenes, as a leaderboard shows them too, the counts of checks,
//! and the settings of the renderer.

use std::collections::BTreeSet;
use std::str::FromStr;

use mateval_dataset::dataset::{DatasetFile, Secrecy, SharedLicence, Target};
use mateval_dataset::layout::INPUT;
use mateval_dataset::manifest::Manifest;
use mateval_dataset::open::Dataset;
use mateval_dataset::scene_cost::StepCost;
use mateval_dataset::{Finding, RendererId, SceneId, Severity};
use mateval_prep::stats::StatsFile;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::given::{ReferenceScores, SceneVerdict};
use super::remake::{Remake, SceneInputs};
use super::renders::{RenderedWith, Thumbnail, ViewNoise};
use crate::error::ReportError;

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
    /// The commitment to the ground truth, if it is withheld; then everything that was measured on it is null, except
    /// for means over at least two scenes and the counts of checks.
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
    /// How to make the dataset again; null where the ground truth is withheld.
    pub remake: Option<Remake>,
    /// The licences of the sources.
    pub licences: Vec<SharedLicence>,
    /// Scenes whose source came without a licence.
    pub without_licence: Vec<SceneId>,
    /// The scenes, in the dataset's order.
    pub scenes: Vec<ReleasedScene>,
}

/// What the release scores: the last three rows of Table I.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Evaluated {
    /// Whether input views are scored.
    pub original_view: bool,
    /// Whether other views are scored.
    pub novel_view: bool,
    /// Whether every scored view has its true albedo.
    pub albedo: bool,
}

impl Evaluated {
    pub(crate) fn of(dataset: &Dataset) -> Result<Self, ReportError> {
        let targets = &dataset.targets.targets;
        let is_input = |target: &&Target| target.view.as_str() == INPUT;
        let Manifest { entries, withheld, .. } = Manifest::read(&dataset.root)?;
        let files: BTreeSet<String> = entries.into_iter().map(|entry| entry.file).chain(withheld).collect();
        let albedo = |target: &Target| {
            files.contains(&format!("scenes/{}/ground_truth/views/{}/albedo.exr", target.scene, target.view))
        };
        Ok(Self {
            original_view: targets.iter().any(|target| is_input(&target)),
            novel_view: !targets.iter().all(|target| is_input(&target)),
            // Of a captured room these pictures are placeholders.
            albedo: !targets.is_empty()
                && targets.iter().all(albedo)
                && dataset.scenes.iter().all(|scene| scene.source.kind.states_materials()),
        })
    }
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
    /// What that is worth.
    pub secrecy: Secrecy,
    /// HMAC-SHA256, in hexadecimal, of the hashes of the withheld files: that of the public manifest.
    pub commitment: String,
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
    /// What was wrong with its source and what was done instead, as in `scene.json`; empty where the ground truth is
    /// withheld.
    pub findings: Vec<Finding>,
    /// The files of its source; null where the ground truth is withheld.
    pub inputs: Option<SceneInputs>,
}

impl ReleaseFile {
    /// Whether nothing in the report speaks against the release: the dataset is sound, and every comparison that was
    /// given agrees.
    pub fn is_good(&self) -> bool {
        self.verification.sound && self.comparisons().all(|verdict| verdict.agrees)
    }

    /// Whether all scenes are captured rooms, which protocol `capture-1` scores.
    pub fn is_captured(&self) -> bool {
        !self.stats.per_scene.is_empty()
            && self.stats.per_scene.iter().all(|scene| !scene.source_kind.states_materials())
    }

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

/// Facts that the dataset does not hold.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Publication {
    /// The day of publication.
    pub date: Option<Day>,
    /// Where the dataset is published.
    pub url: Option<String>,
    /// The authors, separated by ` and ` as in BibTeX.
    pub authors: Option<String>,
}

/// A day, as in `2026-11-24`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
pub struct Day(String);

/// A text that is not a day.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{}' is not a day; expected one as in 2026-11-24", mateval_files::untrusted::shortened(.0))]
pub struct BadDay(String);

impl FromStr for Day {
    type Err = BadDay;

    fn from_str(text: &str) -> Result<Self, BadDay> {
        let parts: Vec<&str> = text.split('-').collect();
        let is_number = |part: &str, digits: usize| part.len() == digits && part.bytes().all(|b| b.is_ascii_digit());
        let within = |part: &str, most: u32| part.parse::<u32>().is_ok_and(|number| (1..=most).contains(&number));
        match parts[..] {
            [year, month, day]
                if is_number(year, 4)
                    && is_number(month, 2)
                    && is_number(day, 2)
                    && within(month, 12)
                    && within(day, 31) =>
            {
                Ok(Self(text.to_owned()))
            }
            _ => Err(BadDay(text.to_owned())),
        }
    }
}

impl TryFrom<String> for Day {
    type Error = BadDay;

    fn try_from(text: String) -> Result<Self, BadDay> {
        text.parse()
    }
}

impl From<Day> for String {
    fn from(day: Day) -> Self {
        day.0
    }
}

impl Day {
    /// The day that lies this many days after 1970-01-01. Howard Hinnant, "chrono-Compatible Low-Level Date
    /// Algorithms": years begin in March, so that a leap day is the last of its year, and an era has 400 years. Of the
    /// years 0 to 9999.
    pub fn since_epoch(days: i64) -> Self {
        let days = days + 719_468;
        let (era, of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
        let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
        let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        let month_from_march = (5 * of_year + 2) / 153;
        let day = of_year - (153 * month_from_march + 2) / 5 + 1;
        let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
        let year = era * 400 + year_of_era + i64::from(month <= 2);
        Self(format!("{year:04}-{month:02}-{day:02}"))
    }

    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// An entry for BibTeX. It names the manifest, so that the citation fixes every byte of the dataset.
pub fn bibtex(dataset: &DatasetFile, publication: &Publication) -> String {
    let manifest = &dataset.manifest_sha256;
    let date = publication.date.as_ref().map(Day::as_str);
    let title = format!("{}, version {}", escaped(&dataset.name), escaped(&dataset.version));
    let fields = [
        ("author", publication.authors.as_deref().map(escaped)),
        ("title", Some(format!("{{{title}}}"))),
        ("year", date.map(|date| date[..4].to_owned())),
        ("date", date.map(str::to_owned)),
        ("url", publication.url.clone().map(|url| url.replace(['{', '}', '\\'], ""))),
        ("note", Some(format!("Dataset, SHA-256 of its manifest: {manifest}"))),
    ];
    let lines = fields.into_iter().filter_map(|(name, value)| Some(format!("  {name:<6} = {{{}}},\n", value?)));
    format!("@misc{{{},\n{}}}\n", key(dataset), lines.collect::<String>())
}

/// The entry's key: the name and the beginning of the hash.
fn key(dataset: &DatasetFile) -> String {
    let name: String = dataset.name.chars().filter(char::is_ascii_alphanumeric).take(40).collect();
    let hash: String = dataset.manifest_sha256.chars().take(8).collect();
    format!("{}-{hash}", if name.is_empty() { "dataset" } else { &name })
}

/// The text in one line, with the characters escaped that TeX interprets.
fn escaped(text: &str) -> String {
    let one = |c: char| match c {
        '#' | '$' | '%' | '&' | '_' => format!("\\{c}"),
        '{' | '}' => String::new(),
        '\\' => "\\textbackslash ".to_owned(),
        '~' => "\\textasciitilde ".to_owned(),
        '^' => "\\textasciicircum ".to_owned(),
        c if c.is_control() => " ".to_owned(),
        c => c.to_string(),
    };
    text.chars().map(one).collect()
}

/// In place of sentences that may quote the ground truth.
pub(crate) const NOT_SHOWN: &str = "not shown, since the ground truth is withheld";

/// Removes from a report what must not become public while the ground truth is withheld.
pub(crate) fn withhold(file: &mut ReleaseFile, secrecy: Secrecy, commitment: &str) {
    file.withheld = Some(Withheld { secrecy, commitment: commitment.to_owned() });
    file.remake = None;
    // The counts of the split, whose scenes have no findings.
    file.stats.dataset.manifest_sha256.clone_from(&file.dataset.manifest_sha256);
    let per_scene = file.stats.per_scene.iter_mut().map(|scene| &mut scene.counts);
    per_scene.chain([&mut file.stats.total]).for_each(|counts| counts.findings.clear());
    file.verification.findings.iter_mut().for_each(silence);
    [&mut file.ceiling, &mut file.floor].into_iter().flatten().for_each(only_means);
    for scene in &mut file.scenes {
        scene.noise = None;
        scene.findings.clear();
        scene.inputs = None;
        if let Some(verdict) = &mut scene.comparison {
            verdict.faults = None;
        }
    }
}

/// Keeps the kind of a finding and its file. Any message of the verification may quote a pixel.
fn silence(finding: &mut Finding) {
    finding.place.clear();
    finding.message = NOT_SHOWN.to_owned();
    finding.action = "run `mateval prep verify` on the whole dataset".to_owned();
}

/// Keeps means over two scenes or more: the mean over one scene is that scene's score.
fn only_means(scores: &mut ReferenceScores) {
    if let Some(scenes) = scores.scenes.take() {
        scores.summary.retain(|key, _| scenes.values().filter(|values| values.contains_key(key)).count() >= 2);
    }
    if scores.scenes_scored < 2 {
        scores.summary.clear();
    }
    scores.summary_noise.retain(|key, _| scores.summary.contains_key(key));
    scores.noise = None;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dataset(name: &str) -> DatasetFile {
        let text = serde_json::json!({
            "format": "mateval/3", "name": name, "version": "1.0", "tool": "mateval 0", "scenes": [],
            "photo_renderer": null, "licences": [], "manifest_sha256": "0123456789abcdef",
        });
        serde_json::from_value(text).unwrap()
    }

    #[test]
    fn days() {
        assert_eq!("2026-11-24".parse::<Day>().unwrap().as_str(), "2026-11-24");
        for bad in ["", "2026", "2026-13-01", "2026-1-1", "2026-01-00", "+026-01-01", "2026-01-01-01", "<b>"] {
            assert!(bad.parse::<Day>().is_err(), "{bad}");
        }
    }

    /// Days by Python's `datetime.date.fromordinal`.
    #[test]
    fn days_are_those_of_the_calendar() {
        let of = |days| String::from(Day::since_epoch(days));
        assert_eq!([of(0), of(59), of(11_016), of(11_017)], ["1970-01-01", "1970-03-01", "2000-02-29", "2000-03-01"]);
        assert_eq!([of(20_784), of(47_540)], ["2026-11-27", "2100-02-28"]);
    }

    #[test]
    fn the_entry_names_the_manifest_and_stays_one() {
        let publication = Publication {
            date: "2026-11-24".parse().ok(),
            url: Some("https://example.org/a_b".to_owned()),
            authors: Some("A. Author and B. Author".to_owned()),
        };
        let entry = bibtex(&dataset("rooms_1}, author={x"), &publication);
        assert!(entry.starts_with("@misc{rooms1authorx-01234567,\n  author = {A. Author and B. Author},\n"), "{entry}");
        assert!(entry.contains("  title  = {{rooms\\_1, author=x, version 1.0}},\n"), "{entry}");
        assert!(entry.contains("0123456789abcdef") && entry.contains("  year   = {2026},\n"), "{entry}");
        let bare = bibtex(&dataset("♥"), &Publication::default());
        assert!(bare.starts_with("@misc{dataset-01234567,\n  title"), "{bare}");
        assert!(!bare.contains("year"), "{bare}");
    }
}
