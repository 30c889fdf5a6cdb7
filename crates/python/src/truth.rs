//! The ground truth of a view.

use std::path::PathBuf;
use std::sync::Arc;

use mateval_eval::EvalError;
use mateval_image::{LinearRgb, exr_io, png_io};
use mateval_scene::dataset;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;

use crate::arrays::{plane, triples};
use crate::failure::failed;
use crate::picture_file::read_picture;
use crate::scene_source::SceneSource;

/// The ground truth of a view. Its pictures are read from their files at each access. They hold values for pixels that
/// are not valid too: use `View.valid`.
#[pyclass(frozen, module = "mateval")]
pub struct Truth {
    source: Arc<SceneSource>,
    at: usize,
}

impl Truth {
    /// That of the view at this place of the scene, which must exist.
    pub fn new(source: &Arc<SceneSource>, at: usize) -> Self {
        Self { source: Arc::clone(source), at }
    }

    fn view(&self) -> &dataset::View {
        &self.source.file().views[self.at]
    }

    fn colours<'py>(&self, py: Python<'py>, path: PathBuf) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let picture = read_picture(py, path, &self.view().camera, exr_io::read_linear)?;
        triples(py, &picture, |LinearRgb(rgb)| rgb)
    }

    fn numbers<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray2<f32>>> {
        plane(py, &read_picture(py, self.path(name), &self.view().camera, exr_io::read_scalar)?)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.source.folder().truth_view(&self.view().id).join(name)
    }
}

#[pymethods]
impl Truth {
    /// base_color, linear Rec. 709: (height, width, 3), float32.
    #[getter]
    fn albedo<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.colours(py, self.path("albedo.exr"))
    }

    /// base_color * (1 - metallic), linear Rec. 709: (height, width, 3), float32.
    #[getter]
    fn diffuse_albedo<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.colours(py, self.path("diffuse_albedo.exr"))
    }

    /// Perceptual roughness, 0 to 1: (height, width), float32.
    #[getter]
    fn roughness<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.numbers(py, "roughness.exr")
    }

    /// Metallic, 0 to 1: (height, width), float32.
    #[getter]
    fn metallic<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.numbers(py, "metallic.exr")
    }

    /// Whether each pixel is valid and metallic or smooth: (height, width), bool.
    #[getter]
    fn specular_region<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        plane(py, &read_picture(py, self.path("specular_region.png"), &self.view().camera, png_io::read_mask)?)
    }

    /// The picture of the photo's renderer, linear radiance in Rec. 709 before exposure: (height, width, 3), float32. Raises
    /// MatEvalError where the scene is not rendered.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let dataset = &self.source.dataset;
        let scene = self.source.file();
        if scene.photo.is_some() {
            return Err(failed(EvalError::Photographed { scene: scene.id.clone() }));
        }
        let Some(renderer) = dataset.photo_renderer(scene) else {
            return Err(failed(EvalError::NoPhotoRenderer { dataset: dataset.root.clone() }));
        };
        self.colours(py, self.source.folder().render(renderer, &self.view().id).join("rgb.exr"))
    }

    fn __repr__(&self) -> String {
        format!("<mateval.Truth of view '{}' of scene '{}'>", self.view().id, self.source.file().id)
    }
}
