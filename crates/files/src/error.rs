//! The error of this crate, which the errors of all other crates wrap.

use std::path::PathBuf;
use std::time::Duration;

use crate::owner::Owner;

/// Why a file or folder could not be read, written or guarded.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was attempted, as in "read" or "write".
        action: &'static str,
        path: PathBuf,
        source: std::io::Error,
    },
    /// A folder that did not exist when work on it began exists now.
    #[error("'{}' was made by another process meanwhile; it stays as it is, and this run's result is removed", path.display())]
    MadeMeanwhile { path: PathBuf },
    /// An output that may be replaced holds an input.
    #[error("'{}' holds '{}', which would be deleted with it; choose another output", path.display(), input.display())]
    HoldsInput { path: PathBuf, input: PathBuf },
    /// Another process works on the same scene or dataset.
    #[error(
        "process {} on {} is at work on {what}, and gave its last sign of life {} seconds ago; wait for it, or, if it is \
         gone, remove '{}'",
        holder.process, holder.host, silence.as_secs(), path.display()
    )]
    InUse {
        /// What is being worked on, as in "scene 'room'".
        what: String,
        holder: Box<Owner>,
        /// How long it has given no sign of life.
        silence: Duration,
        /// The file that states it.
        path: PathBuf,
    },
    /// An output exists and replacing it was not allowed.
    #[error("'{}' already exists; choose another {place}, or add --force to overwrite it", path.display())]
    Exists {
        path: PathBuf,
        /// The argument of the command that names the output, as in `--out`.
        place: &'static str,
    },
    /// A place such as `.` or `/`, beside which nothing can be written.
    #[error("'{}': unsupported: a folder without a name; name the folder to be made", path.display())]
    Nameless { path: PathBuf },
}

impl FileError {
    /// A constructor of [`FileError::Io`] for `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}
