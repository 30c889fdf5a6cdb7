//! `submission.json` as scoring reads it.

use std::path::Path;

use mateval_scene::submission::{MAX_SUBMISSION_BYTES, SUBMISSION, SubmissionFile};

use crate::error::SubmissionError;
use crate::hashed_file::HashedFile;
use crate::submitted_file::SubmittedFile;

/// What `submission.json` states, and the hash of its bytes.
#[derive(Clone, Debug)]
pub struct SubmissionJson {
    /// The method and how the submission was made.
    pub file: SubmissionFile,
    /// Of the bytes that [`SubmissionJson::file`] was parsed from.
    pub hashed: HashedFile,
}

impl SubmissionJson {
    /// Reads it from a submission's folder. Fails where it is missing, a link that leads out, or of another format.
    pub fn read(submission: &Path) -> Result<Self, SubmissionError> {
        let path = submission.join(SUBMISSION);
        path.symlink_metadata().map_err(SubmissionError::io("read", &path))?;
        let source = SubmittedFile::read(submission, &path, MAX_SUBMISSION_BYTES)
            .map_err(|fault| SubmissionError::File { path: path.clone(), fault })?;
        Ok(Self { file: SubmissionFile::parse(&path, source.bytes())?, hashed: source.hashed().clone() })
    }
}
