//! The error of this crate, split by what a caller can do about it.

use std::path::PathBuf;

use mateval_scene::Finding;

use crate::mismatch::Mismatch;

/// Why results could not be shown.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// Results cannot be shown together, or do not match the dataset or the submission: every reason. Score again, or
    /// choose other inputs.
    #[error("{}", joined(.0))]
    Mismatch(Vec<Mismatch>),
    /// No result was given: name at least one.
    #[error("cannot compare results: none was given; name at least one RESULT.json")]
    NoResults,
    /// A folder of results holds none: name another one.
    #[error(
        "'{}' holds no result; expected <name>.json or <method>/<name>.json below it, as `mateval eval score --out` writes it",
        folder.display()
    )]
    NoResultsBelow {
        /// The folder.
        folder: PathBuf,
    },
    /// A `.json` entry of a folder of results is a link or something else that is not a regular file: copy the file
    /// there.
    #[error("'{}' is not a regular file; expected a file, not a link to one; copy it there", path.display())]
    NotAFile {
        /// The entry of the folder.
        path: PathBuf,
    },
    /// Files from which a leaderboard should be made cannot make one: every reason. Correct the files, or leave them out.
    #[error("these results cannot make a leaderboard:{}", Finding::list(.0))]
    UnfitFiles(Vec<Finding>),
    /// The results hold no score that can be shown: choose another protocol, or score again.
    #[error("the results hold no score under protocol '{protocol}' that {output} can show")]
    NothingToShow {
        /// The protocol that was asked for.
        protocol: String,
        /// What was to be made of the scores, as in "a table".
        output: &'static str,
    },
    /// A folder that is not a leaderboard would be replaced: choose another one.
    #[error("'{}' exists and is not a leaderboard; choose another --out", path.display())]
    NotALeaderboard {
        /// The folder.
        path: PathBuf,
    },
    /// A submission whose pictures should be shown belongs to none of the results: score it, or leave it out.
    #[error(
        "no result was made from the submission '{}' as it is now; score it, or leave it out of --submission",
        path.display()
    )]
    UnscoredSubmission {
        /// The folder of the submission.
        path: PathBuf,
    },
    /// The track `relit` has several pictures for each view, and none of them can be chosen: show another track.
    #[error("cannot show track 'relit', which has several lightings for each view; show 'true' or 'fitted'")]
    RelitTrack,
    /// More houses than the bootstrap can draw from: rank fewer scenes.
    #[error("cannot rank scenes of {houses} houses; at most {most} are supported")]
    TooManyHouses {
        /// The number of houses.
        houses: usize,
        /// The largest number that is supported.
        most: usize,
    },
    /// The dataset could not be read, or a file could not be read or written.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// A scene could not be rendered or scored again.
    #[error(transparent)]
    Eval(#[from] mateval_eval::EvalError),
    /// The submission could not be read.
    #[error(transparent)]
    Submission(#[from] mateval_submission::SubmissionError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
    /// Two pictures could not be compared.
    #[error("cannot compare {what}: {source}")]
    Metric {
        /// Which pictures.
        what: String,
        /// Why not.
        source: mateval_metrics::MetricError,
    },
}

impl ReportError {
    /// Fails with all mismatches if there are any.
    pub(crate) fn refuse(mismatches: Vec<Mismatch>) -> Result<(), Self> {
        if mismatches.is_empty() { Ok(()) } else { Err(Self::Mismatch(mismatches)) }
    }
}

fn joined(mismatches: &[Mismatch]) -> String {
    mismatches.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}
