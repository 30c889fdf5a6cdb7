//! A view: what methods may see of it, and the way to its ground truth.

use std::path::PathBuf;
use std::sync::Arc;

use mateval_image::{LinearRgb, Mask, Normal, Picture, exr_io, png_io};
use mateval_scene::dataset;
use mateval_scene::layout::{INPUT, part_picture};
use numpy::{PyArray2, PyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{plane, triples};
use crate::camera::Camera;
use crate::failure::withheld;
use crate::picture_file::read_picture;
use crate::scene_source::SceneSource;
use crate::truth::Truth;

/// A view of a scene. Its pictures are read from their files at each access.
#[pyclass(frozen, module = "mateval")]
pub struct View {
    source: Arc<SceneSource>,
    at: usize,
}

impl View {
    /// The view at this place of the scene, which must exist.
    pub fn new(source: &Arc<SceneSource>, at: usize) -> Self {
        Self { source: Arc::clone(source), at }
    }

    fn file(&self) -> &dataset::View {
        &self.source.file().views[self.at]
    }

    fn path(&self, name: &str) -> PathBuf {
        self.source.folder().view(&self.file().id).join(name)
    }

    /// Methods see the picture of the input view alone.
    fn check_input(&self, picture: &str) -> PyResult<()> {
        let id = &self.file().id;
        if id.as_str() == INPUT {
            return Ok(());
        }
        let message =
            format!("view '{id}' has no {picture}: methods see that of the view '{INPUT}' only; use truth.rgb");
        Err(PyValueError::new_err(message))
    }

    fn mask(&self, py: Python<'_>, name: &str) -> PyResult<Mask> {
        read_picture(py, self.path(name), &self.file().camera, png_io::read_mask)
    }

    fn ids<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray2<u16>>> {
        plane(py, &read_picture(py, self.path(name), &self.file().camera, png_io::read_ids)?)
    }
}

#[pymethods]
impl View {
    /// Its id, as in `input`, `up_left` or `wide_1`.
    #[getter]
    fn id(&self) -> &str {
        self.file().id.as_str()
    }

    /// Degrees by which the input camera was turned about its own X axis; up is positive.
    #[getter]
    fn x_deg(&self) -> f64 {
        self.file().x_deg
    }

    /// Degrees by which the input camera was then turned about its own Y axis; left is positive.
    #[getter]
    fn y_deg(&self) -> f64 {
        self.file().y_deg
    }

    /// Metres between this camera and the input view's; 0 for views that are the input view turned.
    #[getter]
    fn distance_m(&self) -> f64 {
        self.file().wide.map_or(0.0, |wide| wide.distance_m)
    }

    /// The camera of every picture of the view.
    #[getter]
    fn camera(&self) -> Camera {
        Camera(self.file().camera)
    }

    /// The photo, linear radiance in Rec. 709 before exposure: (height, width, 3), float32. Only of the input view.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.check_input("rgb")?;
        let picture = read_picture(py, self.path("rgb.exr"), &self.file().camera, exr_io::read_linear)?;
        triples(py, &picture, |LinearRgb(rgb)| rgb)
    }

    /// The photo after exposure, clipped, sRGB: (height, width, 3), uint8. Only of the input view.
    #[getter]
    fn preview<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        self.check_input("preview")?;
        let picture = read_picture(py, self.path("rgb.png"), &self.file().camera, png_io::read_rgb_bytes)?;
        triples(py, &picture, |rgb| rgb)
    }

    /// Depth along the camera's axis, not along the ray, in metres; 0 where nothing is hit: (height, width), float32.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        plane(py, &read_picture(py, self.path("depth.exr"), &self.file().camera, exr_io::read_scalar)?)
    }

    /// Shading normals in world space, of unit length, turned to the camera's side; 0 where nothing is hit: (height,
    /// width, 3), float32.
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let picture = read_picture(py, self.path("normal.exr"), &self.file().camera, exr_io::read_normal)?;
        triples(py, &picture, |Normal(xyz)| xyz)
    }

    /// `Instance.index` of each pixel; 0 where nothing is hit: (height, width), uint16.
    #[getter]
    fn instance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u16>>> {
        self.ids(py, "instance.png")
    }

    /// `Part.index` of each pixel; 0 where nothing is hit: (height, width), uint16.
    #[getter]
    fn part<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u16>>> {
        self.ids(py, &part_picture(None))
    }

    /// Whether each pixel counts: (height, width), bool.
    #[getter]
    fn valid<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        plane(py, &self.mask(py, "valid.png")?)
    }

    /// Whether each pixel is valid and shows a point that the input view does not; nowhere in the input view itself:
    /// (height, width), bool.
    #[getter]
    fn unobserved<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        if self.file().id.as_str() == INPUT {
            let k = &self.file().camera.intrinsics;
            return plane(py, &Picture::filled(k.width as usize, k.height as usize, false));
        }
        plane(py, &self.mask(py, "unobserved.png")?)
    }

    /// The ground truth. Raises `mateval.Withheld` where the dataset does not hold it.
    #[getter]
    fn truth(&self) -> PyResult<Truth> {
        let folder = self.source.folder().truth_view(&self.file().id);
        if folder.is_dir() {
            return Ok(Truth::new(&self.source, self.at));
        }
        let shown = folder.display();
        let message = format!("'{shown}' does not exist: the ground truth of this dataset is withheld");
        Err(withheld(message))
    }

    fn __repr__(&self) -> String {
        let k = &self.file().camera.intrinsics;
        format!("<mateval.View '{}' of scene '{}', {}x{}>", self.file().id, self.source.file().id, k.width, k.height)
    }
}
