//! The error of this crate, split by what a caller can do about it, and why a result cannot stand beside another one,
//! or does not match the dataset or the submission that it names.

use std::fmt;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::DatasetVersion;
use mateval_dataset::open::Dataset;
use mateval_dataset::{DatasetError, Finding, SceneId, Severity};
use mateval_eval::EvalError;
use mateval_eval::protocol::SCORER_VERSION;
use mateval_eval::result::ResultFile;
use mateval_eval::result::key::ResultKey;
use mateval_files::FileError;

/// Why results could not be shown, or a dataset not be published or described.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// Results cannot be shown together, or do not match the dataset or the submission: every reason.
    #[error("{}", joined(.0))]
    Mismatch(Vec<Mismatch>),
    #[error("cannot compare results: none was given; name at least one RESULT.json")]
    NoResults,
    #[error(
        "'{}' holds no result; expected <name>.json or <method>/<name>.json below it, as `mateval eval score --out` writes it",
        folder.display()
    )]
    NoResultsBelow { folder: PathBuf },
    #[error("'{}' is not a regular file; expected a file, not a link to one; copy it there", path.display())]
    NotAFile { path: PathBuf },
    /// Every reason.
    #[error("these results cannot make a leaderboard:{}", Finding::list(.0))]
    UnfitFiles(Vec<Finding>),
    /// Every reason.
    #[error("these votes cannot be counted:{}", Finding::list(.0))]
    UnfitVotes(Vec<Finding>),
    /// Files that were given are not about the dataset that is released, or are something else: every reason. Correct
    /// them, or leave them out.
    #[error("these files cannot be part of the release's report:{}", Finding::list(.0))]
    UnfitForRelease(Vec<Finding>),
    #[error(
        "'{}' holds no .json file; expected what `mateval prep compare --out` or `--format json` writes, in the folder \
         or directly below it",
        folder.display()
    )]
    NoVerdicts { folder: PathBuf },
    /// A folder that is not the report of a release would be replaced: choose another one.
    #[error("'{}' exists and is not the report of a release; choose another --report", path.display())]
    NotAReport { path: PathBuf },
    /// The dataset has no ground truth that could be withheld.
    #[error("'{}' has no ground truth to withhold", path.display())]
    NoGroundTruth { path: PathBuf },
    /// The truth of scenes can be made again from public files, however it is packed.
    #[error(
        "'{}' cannot be kept secret: {} of its scenes {}, have the materials of their source, so that anybody who has \
         the source can make the truth again; redress them (`redress` in the recipe), state `source = \"private\"` in \
         the recipe for sources that nobody else has, or add --open-book to withhold the truth without claiming that it \
         is secret",
        path.display(), scenes.len(), named(scenes)
    )]
    OpenBook { path: PathBuf, scenes: Vec<SceneId> },
    /// A key or signature in a file cannot be read or used.
    #[error("'{}' is not a key as `mateval key new` and minisign write it, or has a password: {reason}", path.display())]
    BadKey { path: PathBuf, reason: String },
    #[error("the results hold no score under protocol '{protocol}' that {output} can show")]
    NothingToShow {
        protocol: String,
        /// What was to be made of the scores, as in "a table".
        output: &'static str,
    },
    #[error("'{}' exists and is not a leaderboard; choose another --out", path.display())]
    NotALeaderboard { path: PathBuf },
    #[error(
        "no result was made from the submission '{}' as it is now; score it, or leave it out of --submission",
        path.display()
    )]
    UnscoredSubmission { path: PathBuf },
    #[error(
        "no scene has pictures of the truth and of two methods that people could vote on; add --dataset with a \
         --submission for each method, or --pictures, or leave out --votes"
    )]
    NothingToVoteOn,
    /// Why results on the original rooms cannot be laid beside a board's.
    #[error("the results of --original: {0}")]
    Original(Box<Self>),
    #[error(
        "'{}' shows the truth of a hidden split, which everybody who opens the board would see: leave out --pictures, \
         or add --with-ground-truth",
        path.display()
    )]
    PictureOfHiddenTruth { path: PathBuf },
    #[error("cannot show track 'relit', which has several lightings for each view; show 'true' or 'fitted'")]
    RelitTrack,
    /// More than the bootstrap can draw from.
    #[error("cannot rank scenes of {houses} houses; at most {most} are supported")]
    TooManyHouses { houses: usize, most: usize },
    #[error(transparent)]
    Files(#[from] FileError),
    /// The dataset could not be read.
    #[error(transparent)]
    Dataset(#[from] mateval_dataset::DatasetError),
    /// The dataset could not be verified, or its recipe not be read.
    #[error(transparent)]
    Prep(#[from] mateval_prep::PrepError),
    /// A scene could not be rendered or scored again.
    #[error(transparent)]
    Eval(#[from] mateval_eval::EvalError),
    #[error(transparent)]
    Submission(#[from] mateval_submission::SubmissionError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
    #[error("cannot compare {what}: {source}")]
    Metric { what: String, source: mateval_metrics::MetricError },
}

impl ReportError {
    /// Fails with all mismatches if there are any.
    pub(crate) fn refuse(mismatches: Vec<Mismatch>) -> Result<(), Self> {
        if mismatches.is_empty() { Ok(()) } else { Err(Self::Mismatch(mismatches)) }
    }
}

/// The first of the scenes, by name.
fn named(scenes: &[SceneId]) -> String {
    let names: Vec<&str> = scenes.iter().take(3).map(SceneId::as_str).collect();
    format!("({}{})", names.join(", "), if scenes.len() > names.len() { ", ..." } else { "" })
}

fn joined(mismatches: &[Mismatch]) -> String {
    mismatches.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

/// One reason. Methods are named as their submissions name them.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Mismatch {
    #[error(
        "the result of '{method}' has no scores under protocol '{protocol}', only under: {}; score it with \
         --protocol {protocol}, or choose another --protocol",
        scored.join(", ")
    )]
    Protocol { method: String, protocol: String, scored: Vec<String> },
    #[error(
        "'{first}' and '{other}' have different fingerprints: dataset, protocol, scorer or LPIPS weights differ; \
         score both again with the same ones"
    )]
    Fingerprints { first: String, other: String },
    #[error(
        "the ceiling '{method}' is not the truth: expected 0 for '{key}', found {value:?}; score the submission of \
         `mateval baseline gt` in its place"
    )]
    Ceiling { method: String, key: ResultKey, value: f64 },
    #[error("'{first}' and '{other}' were scored on different scenes; score both on the same scenes")]
    Scenes { first: String, other: String },
    #[error(
        "'{method}' was scored on {scored} of {scenes} scenes; score it on all, or add --partial to rank it on these"
    )]
    TooFewScenes { method: String, scored: usize, scenes: usize },
    #[error("'{first}' and '{other}' assign scene '{scene}' to different houses: one was changed; score both again")]
    Houses { first: String, other: String, scene: SceneId },
    #[error("the result of '{method}' does not state the house of scene '{scene}'; score it again with this version")]
    NoHouse { method: String, scene: SceneId },
    #[error("the result of '{method}' lists a scene twice; score it again")]
    RepeatedScene { method: String },
    #[error(
        "the result of '{method}' states fingerprint {stated}, but its protocol, dataset, scenes and weights give \
         {found}: it was changed; score it again"
    )]
    Changed { method: String, stated: String, found: String },
    #[error("the result of '{method}' holds {value:e} for '{key}', which is not a possible score; score it again")]
    ImpossibleScore { method: String, key: ResultKey, value: f64 },
    #[error(
        "the results of --original are on {dataset}, the board's own dataset; give results on the original rooms, \
         whose materials are public, or leave --original out"
    )]
    SameDataset { dataset: DatasetVersion },
    #[error(
        "the results of --original were scored under different rules of protocol '{protocol}' (scorer version \
         {original}, the board's: {board}); score both with one version"
    )]
    OtherRules { protocol: String, board: u32, original: u32 },
    #[error(
        "no method of the board ({}) has a result among those of --original ({}); methods are paired by the name in \
         submission.json",
        board.join(", "), original.join(", ")
    )]
    NoPair { board: Vec<String>, original: Vec<String> },
    #[error("the result has scorer version {found}, expected {SCORER_VERSION}; score it again")]
    Scorer { found: u32 },
    #[error(
        "the result was made on {}, but the dataset '{}' is {}; use the dataset that was scored, or score again",
        expected, path.display(), found
    )]
    Dataset { expected: DatasetVersion, path: PathBuf, found: DatasetVersion },
    #[error(
        "the floor '{method}' lacks {missing} of the scenes that are scored, '{first}' first; score it on all of them"
    )]
    FloorScenes { method: String, missing: usize, first: SceneId },
    #[error("scene '{scene}' was not scored; choose one of: {}", ids(scored))]
    SceneNotScored { scene: SceneId, scored: Vec<SceneId> },
    /// One hash covers all files of a submission, so that it does not show which file differs.
    #[error(
        "the result was made from {}, but the submission '{}' is {}, hashed over submission.json and its {maps} maps of \
         the scored scenes: it is another one, or a file has changed; score it again",
        expected, path.display(), found
    )]
    Submission { expected: SubmissionVersion, path: PathBuf, found: SubmissionVersion, maps: usize },
    #[error(
        "'{key}' of scene '{scene}' is {} in the result, but {found} computed again: the result was changed, or made by \
         another version; score it again",
        expected.map_or("missing".to_owned(), |expected| expected.to_string())
    )]
    Score { key: ResultKey, scene: SceneId, expected: Option<f64>, found: f64 },
}

/// What was read from the file at `path`. A file that is not what was `expected` is a finding, with `action` as what to
/// do; any other failure ends the reading.
pub(crate) fn fitting<T>(
    read: Result<T, impl Into<ReportError>>,
    expected: &str,
    path: &Path,
    action: &str,
    findings: &mut Vec<Finding>,
) -> Result<Option<T>, ReportError> {
    let (place, message) = match read.map_err(Into::into) {
        Ok(value) => return Ok(Some(value)),
        Err(ReportError::Dataset(error) | ReportError::Eval(EvalError::Dataset(error))) => match error {
            DatasetError::Format { found, expected: format, .. } => (
                "/format".to_owned(),
                format!("expected {expected}, found: the format '{found}' in place of '{format}'"),
            ),
            DatasetError::Invalid { findings: faults, .. } => {
                let (place, found) =
                    faults.into_iter().next().map(|fault| (fault.place, fault.message)).unwrap_or_default();
                (place, format!("expected {expected}, found: {found}"))
            }
            other => return Err(other.into()),
        },
        Err(ReportError::Eval(EvalError::Contradiction { place, said, found, .. })) => {
            (place, format!("it states {said}, but its own numbers give {found}"))
        }
        Err(other) => return Err(other),
    };
    let file = path.display().to_string();
    findings.push(Finding::new(Severity::Error, "unfit_file", file, place, message, action));
    Ok(None)
}

/// A submission, as a result names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubmissionVersion {
    pub method: String,
    pub sha256: String,
}

impl fmt::Display for SubmissionVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "'{}' with hash {}", self.method, self.sha256)
    }
}

impl Mismatch {
    /// The reason for which a result is not about a dataset, if it is about another one.
    pub(crate) fn of_dataset(result: &ResultFile, dataset: &Dataset) -> Option<Self> {
        let (expected, found) = (result.dataset.named(), dataset.file.named());
        let is_other = expected.manifest_sha256 != found.manifest_sha256;
        is_other.then(|| Self::Dataset { expected, path: dataset.root.clone(), found })
    }

    /// The reason for which a result has no scores under a protocol, if it has none.
    pub(crate) fn of_result(result: &ResultFile, protocol: &str) -> Option<Self> {
        let method = result.shown_method();
        let scored = || result.protocols.keys().cloned().collect();
        let is_scored = result.protocols.contains_key(protocol);
        (!is_scored).then(|| Self::Protocol { method, protocol: protocol.to_owned(), scored: scored() })
    }
}

fn ids(scenes: &[SceneId]) -> String {
    scenes.iter().map(SceneId::as_str).collect::<Vec<_>>().join(", ")
}
