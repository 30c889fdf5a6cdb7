//! Reads the text of a recipe, or of a file of survey rules, within a limit.

use std::path::Path;

use mateval_image::file_kind::{hint, mistaken_for, without_mark};
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
    // Text of another kind, such as a Git LFS pointer. TOML may begin like one, as in `#usda`.
    if mistaken_for(&bytes).is_some() && text.parse::<toml::Table>().is_err() {
        let message = format!("expected TOML, found another file{}", hint(&bytes));
        return Err(PrepError::io("read", path)(std::io::Error::new(std::io::ErrorKind::InvalidData, message)));
    }
    Ok(text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_another_kind_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("recipe.toml");
        let read = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read_text(&path)
        };
        for (bytes, words) in [
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 3\n".as_slice(), "git lfs pull"),
            (b"<!DOCTYPE html>\n", "web page"),
            (b"n\0a\0m\0e\0", "UTF-16"),
            (b"\xff\xfen\0", "UTF-16"),
        ] {
            let error = read(bytes).unwrap_err().to_string();
            assert!(error.contains("recipe.toml") && error.contains(words), "{error}");
        }
        assert_eq!(read(b"\xef\xbb\xbfname = 'x'").unwrap(), "name = 'x'");
        // TOML, though a USD file begins like it, and what its reader says more about.
        for sound in ["#usda kitchens\nname = 'x'", "", "no TOML"] {
            assert_eq!(read(sound.as_bytes()).unwrap(), sound);
        }
    }
}
