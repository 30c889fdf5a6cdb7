//! Pictures of a view, read detached from Python and checked against the view's camera.

use std::path::PathBuf;

use mateval_image::{ImageError, Picture};
use mateval_scene::{Camera, SceneError};
use pyo3::prelude::*;

use crate::failure::failed;

/// Reads a picture. Fails where it cannot be read or is not as large as the camera's picture.
pub fn read_picture<T: Copy + Send>(
    py: Python<'_>,
    path: PathBuf,
    camera: &Camera,
    read: impl FnOnce(&std::path::Path) -> Result<Picture<T>, ImageError> + Send,
) -> PyResult<Picture<T>> {
    let picture = py.detach(|| read(&path)).map_err(failed)?;
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    if (picture.width(), picture.height()) == (width, height) {
        return Ok(picture);
    }
    let found = format!("{}x{} pixels", picture.width(), picture.height());
    let what = format!("it has {found}; scene.json says {width}x{height}; run `mateval prep verify`");
    Err(failed(SceneError::Unsupported { path, what }))
}
