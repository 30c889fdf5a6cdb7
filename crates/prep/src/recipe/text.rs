//! Reads the text of a recipe, or of a file of survey rules, within a limit.

use std::path::Path;

use mateval_image::file_kind::{hint, without_mark};
use mateval_image::limits::read_at_most;

use crate::error::PrepError;

/// The largest file that is read, in bytes.
const MAX_BYTES: u64 = 16 << 20;

/// The text of an ordinary file of at most [`MAX_BYTES`].
pub(crate) fn read_text(path: &Path) -> Result<String, PrepError> {
    let bytes = read_at_most(path, MAX_BYTES).map_err(PrepError::io("read", path))?;
    let not_text = |_| {
        let message = format!("expected UTF-8, found other bytes{}", hint(&bytes));
        std::io::Error::new(std::io::ErrorKind::InvalidData, message)
    };
    let text = std::str::from_utf8(without_mark(&bytes)).map_err(not_text).map_err(PrepError::io("read", path))?;
    Ok(text.to_owned())
}
