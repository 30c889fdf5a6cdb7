//! Why an archive is not unpacked.

use mateval_scene::findings::shortened;
use mateval_scene::{Finding, Severity};

/// Why an archive is not unpacked.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The archive is refused, for at least one reason.
    #[error("the archive is refused:{}", Finding::list(.0))]
    Refused(Vec<Finding>),
    /// The file system refused.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

impl Fault {
    /// Refuses an archive as a whole.
    pub(super) fn refused(code: &str, message: impl Into<String>, action: &str) -> Self {
        Self::Refused(vec![refusal(code, "", message, action)])
    }

    /// Refuses an archive that is not what its format prescribes.
    pub(super) fn damaged(message: impl Into<String>) -> Self {
        Self::refused("damaged_archive", message, "pack it again")
    }
}

/// A finding about one entry, or about the whole archive where `entry` is empty.
pub(super) fn refusal(code: &str, entry: &str, message: impl Into<String>, action: &str) -> Finding {
    Finding {
        severity: Severity::Error,
        code: code.to_owned(),
        file: shortened(entry),
        place: String::new(),
        message: message.into(),
        action: action.to_owned(),
    }
}
