//! Reads Blender's pictures of a view; a picture that is missing or unreadable becomes a check.

use std::path::{Path, PathBuf};

use mateval_image::{ImageError, LinearRgb, Picture, exr_io};

use super::file::{Check, Quantity, State};
use super::tiles::Halves;

/// The folder of Blender's pictures of a view.
#[derive(Clone, Debug)]
pub(super) struct TheirView {
    pub(super) folder: PathBuf,
    /// Width and height that every picture must have.
    pub(super) size: (usize, usize),
}

impl TheirView {
    /// Reads a picture. Fails with the check that reports why it could not be read. `picture` is its name without extension.
    pub(super) fn read<T: Copy>(
        &self,
        picture: &str,
        file: &str,
        read: impl FnOnce(&Path) -> Result<Picture<T>, ImageError>,
    ) -> Result<Picture<T>, Check> {
        let path = self.folder.join(file);
        if !path.exists() {
            return Err(file_check(picture, State::Missing, format!("'{file}' does not exist; render the view again")));
        }
        let unreadable = |what: String| file_check(picture, State::Unreadable, what);
        let found = read(&path).map_err(|error| unreadable(error.to_string()))?;
        let size = (found.width(), found.height());
        if size == self.size {
            return Ok(found);
        }
        let (expected, size) = (format!("{}x{}", self.size.0, self.size.1), format!("{}x{}", size.0, size.1));
        Err(unreadable(format!("'{file}' has {size} pixels, expected {expected}")))
    }

    /// Reads a picture of linear RGB.
    pub(super) fn linear(&self, picture: &str, file: &str) -> Result<Picture<LinearRgb>, Check> {
        self.read(picture, file, exr_io::read_linear)
    }

    /// Reads `<picture>_a.exr` and `<picture>_b.exr`.
    pub(super) fn halves(&self, picture: &str) -> Result<Halves, Check> {
        let [a, b] = ["a", "b"].map(|half| self.linear(picture, &format!("{picture}_{half}.exr")));
        Ok(Halves { a: a?, b: b? })
    }
}

/// A check of the file itself, which has no number.
pub(super) fn file_check(picture: &str, state: State, message: String) -> Check {
    let picture = picture.to_owned();
    Check { picture, quantity: Quantity::File, state, measured: None, bound: None, count: 0, message }
}
