//! Findings about files that were given for the report and do not fit it.

use std::path::Path;

use mateval_scene::open::Dataset;
use mateval_scene::{Finding, SceneError, Severity};

/// What to do with a file that does not fit.
const ACTION: &str = "make it again from this dataset, or leave it out";

/// A finding about the place, a JSON pointer, of a file.
pub(crate) fn unfit(path: &Path, place: &str, message: String) -> Finding {
    Finding {
        severity: Severity::Error,
        code: "unfit_file".to_owned(),
        file: path.display().to_string(),
        place: place.to_owned(),
        message,
        action: ACTION.to_owned(),
    }
}

/// What was read from the file at `path`. A file that is not what was `expected` is a finding; any other failure ends the
/// reading.
pub(crate) fn fitting<T>(
    read: Result<T, SceneError>,
    expected: &str,
    path: &Path,
    findings: &mut Vec<Finding>,
) -> Result<Option<T>, SceneError> {
    let (place, found) = match read {
        Ok(value) => return Ok(Some(value)),
        Err(SceneError::Format { found, expected, .. }) => {
            ("/format".to_owned(), format!("the format '{found}' in place of '{expected}'"))
        }
        Err(SceneError::Invalid { findings: faults, .. }) => {
            faults.into_iter().next().map(|fault| (fault.place, fault.message)).unwrap_or_default()
        }
        Err(other) => return Err(other),
    };
    findings.push(unfit(path, &place, format!("expected {expected}, found: {found}")));
    Ok(None)
}

/// A finding if the file is about another dataset than this one; `manifest` is the hash that it states.
pub(crate) fn foreign(path: &Path, manifest: &str, dataset: &Dataset) -> Option<Finding> {
    let ours = &dataset.file.manifest_sha256;
    let message = || {
        let found = mateval_scene::findings::shortened(manifest);
        format!("it is about the dataset with manifest '{found}', and this one has '{ours}'")
    };
    (manifest != ours).then(|| unfit(path, "/dataset/manifest_sha256", message()))
}
