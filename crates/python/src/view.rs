//! A view: what methods may see of it, its ground truth, and its camera, for many points at once.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec2, DVec3};
use mateval_dataset::layout::{INPUT, part_picture};
use mateval_dataset::{camera, dataset};
use mateval_eval::EvalError;
use mateval_image::{LinearRgb, Mask, Normal, Picture, exr_io, png_io};
use numpy::ndarray::{ArrayD, Axis, IxDyn};
use numpy::{IntoPyArray as _, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods as _};
use pyo3::exceptions::{PyFileNotFoundError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{numbers, plane, read_picture, rows, triples};
use crate::instance::SharedScene;
use crate::long_work::{failed, shown_in_notebook, withheld, wrong_shape};

/// A view of a scene. Its pictures are read from their files at each access.
#[pyclass(frozen, module = "mateval")]
pub struct View {
    pub source: Arc<SharedScene>,
    /// Its place in the scene, which must exist.
    pub at: usize,
}

impl View {
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
        let only = format!("methods see that of the view '{INPUT}' only; use truth.rgb");
        Err(PyValueError::new_err(format!("view '{id}' has no {picture}: {only}")))
    }

    fn mask(&self, py: Python<'_>, name: &str) -> PyResult<Mask> {
        read_picture(py, self.path(name), &self.file().camera, png_io::read_mask)
    }

    fn ids<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray2<u16>>> {
        plane(py, read_picture(py, self.path(name), &self.file().camera, png_io::read_ids)?)
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

    /// The photo, linear radiance in Rec. 709 before exposure: (height, width, 3), float32, RGB. Only of the
    /// input view.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.check_input("rgb")?;
        let picture = read_picture(py, self.path("rgb.exr"), &self.file().camera, exr_io::read_linear)?;
        triples(py, picture, |LinearRgb(rgb)| rgb)
    }

    /// The photo after exposure, clipped, sRGB: (height, width, 3), uint8, RGB. Only of the input view.
    #[getter]
    fn preview<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        self.check_input("preview")?;
        let picture = read_picture(py, self.path("rgb.png"), &self.file().camera, png_io::read_rgb_bytes)?;
        triples(py, picture, |rgb| rgb)
    }

    /// Depth along the camera's axis, not along the ray, in metres; 0 where nothing is hit: (height, width), float32.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        plane(py, read_picture(py, self.path("depth.exr"), &self.file().camera, exr_io::read_scalar)?)
    }

    /// Shading normals in world space, of unit length, on the camera's side of their triangle; those that are
    /// interpolated near silhouettes may point away from the camera. 0 where nothing is hit: (height, width, 3), float32.
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let picture = read_picture(py, self.path("normal.exr"), &self.file().camera, exr_io::read_normal)?;
        triples(py, picture, |Normal(xyz)| xyz)
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

    /// Whether each pixel counts: (height, width), bool. See "Pictures of a view" of the dataset's format for the rule.
    #[getter]
    fn valid<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        plane(py, self.mask(py, "valid.png")?)
    }

    /// Whether each pixel is valid and shows a point that the input view does not; nowhere in the input view itself:
    /// (height, width), bool.
    #[getter]
    fn unobserved<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        if self.file().id.as_str() == INPUT {
            let k = &self.file().camera.intrinsics;
            return plane(py, Picture::filled(k.width as usize, k.height as usize, false));
        }
        plane(py, self.mask(py, "unobserved.png")?)
    }

    /// The paths of a pickled view: the copy opens the same folder.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (PathBuf, String, String))> {
        let reopen = py.import("mateval.dataset")?.getattr("reopened_view")?;
        let root = std::path::absolute(&self.source.dataset.root)?;
        Ok((reopen, (root, self.source.file().id.to_string(), self.id().to_owned())))
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        shown_in_notebook(slf, "view")
    }

    /// The ground truth. Raises `mateval.Withheld` where the dataset does not hold it, and `mateval.Error` where the scene
    /// is captured, whose true materials nobody knows.
    #[getter]
    fn truth(&self) -> PyResult<Truth> {
        self.source.file().check_materials_known().map_err(failed)?;
        check_truth_held(&self.source, &self.source.folder().truth_view(&self.file().id))?;
        Ok(Truth { source: Arc::clone(&self.source), at: self.at })
    }

    fn __repr__(&self) -> String {
        let k = &self.file().camera.intrinsics;
        format!("<mateval.View '{}' of scene '{}', {}x{}>", self.file().id, self.source.file().id, k.width, k.height)
    }
}

/// Fails where this folder of the scene's ground truth does not exist.
pub fn check_truth_held(source: &SharedScene, folder: &Path) -> PyResult<()> {
    if folder.is_dir() {
        return Ok(());
    }
    let root = &source.dataset.root;
    if !root.is_dir() {
        return Err(PyFileNotFoundError::new_err(format!(
            "'{}' does not exist: the dataset was moved since it was opened; open it again at its new place",
            root.display()
        )));
    }
    let shown = folder.display();
    Err(withheld(format!("'{shown}' does not exist: the ground truth of this dataset is withheld")))
}

/// The ground truth of a view. Its pictures are read from their files at each access. They hold values for pixels that
/// are not valid too: use `View.valid`.
#[pyclass(frozen, module = "mateval")]
pub struct Truth {
    source: Arc<SharedScene>,
    at: usize,
}

impl Truth {
    fn view(&self) -> &dataset::View {
        &self.source.file().views[self.at]
    }

    fn colours<'py>(&self, py: Python<'py>, path: PathBuf) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let picture = read_picture(py, path, &self.view().camera, exr_io::read_linear)?;
        triples(py, picture, |LinearRgb(rgb)| rgb)
    }

    fn numbers<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray2<f32>>> {
        plane(py, read_picture(py, self.path(name), &self.view().camera, exr_io::read_scalar)?)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.source.folder().truth_view(&self.view().id).join(name)
    }
}

#[pymethods]
impl Truth {
    /// base_color, linear Rec. 709: (height, width, 3), float32, RGB.
    #[getter]
    fn albedo<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.colours(py, self.path("albedo.exr"))
    }

    /// base_color * (1 - metallic), linear Rec. 709: (height, width, 3), float32, RGB.
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
        plane(py, read_picture(py, self.path("specular_region.png"), &self.view().camera, png_io::read_mask)?)
    }

    /// The picture of the photo's renderer, linear radiance in Rec. 709 before exposure: (height, width, 3), float32,
    /// RGB. Raises `mateval.Error` where the scene is not rendered.
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

/// A pinhole camera without distortion. It looks along its -Z, +Y is up, +X is right (OpenGL's and Blender's axes).
/// Lengths are metres; pixel centres lie at +0.5 from the top left.
#[pyclass(frozen, module = "mateval")]
pub struct Camera(pub camera::Camera);

#[pymethods]
impl Camera {
    /// (width, height) in pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.0.intrinsics.width, self.0.intrinsics.height)
    }

    /// The 3x3 matrix of focal lengths and principal point in pixels, for OpenCV's axes; float64.
    #[getter(K)]
    fn intrinsics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let k = &self.0.intrinsics;
        rows(py, [[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]].into_iter())
    }

    /// The 4x4 matrix from the camera's OpenGL axes to the world: a rotation and a translation in metres; float64.
    #[getter]
    fn world_from_camera<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.0.world_from_camera.into_iter())
    }

    /// `world_from_camera` for OpenCV's axes (x right, y down, z forward); float64.
    #[getter]
    fn opencv<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.0.world_from_camera.into_iter().map(|[x, y, z, position]| [x, -y, -z, position]))
    }

    /// Projects world points of shape (..., 3), in metres. Returns their positions in the picture, (..., 2) in pixels
    /// from the top left, and their depths along the camera's axis, (...) in metres; NaN for points behind the camera.
    #[expect(clippy::type_complexity, reason = "a tuple of arrays, as NumPy's own functions return")]
    fn project<'py>(
        &self,
        py: Python<'py>,
        xyz: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArrayDyn<f64>>)> {
        let xyz = numbers("xyz", xyz)?;
        let points = xyz.as_array();
        let Some((3, outer)) = points.shape().split_last().map(|(last, outer)| (*last, outer.to_vec())) else {
            let found = points.shape();
            let advice = "pass x, y and z in the last axis";
            return Err(wrong_shape(format!("xyz: expected the shape (..., 3), found {found:?}; {advice}")));
        };
        let projection = self.0.projection();
        let lanes = points.lanes(Axis(outer.len()));
        let projected = lanes.into_iter().map(|point| projection.project(DVec3::new(point[0], point[1], point[2])));
        let (pixels, depths): (Vec<[f64; 2]>, Vec<f64>) = projected
            .map(|met| met.map_or(([f64::NAN; 2], f64::NAN), |(pixel, depth)| (pixel.to_array(), depth)))
            .unzip();
        let mut with_axes = outer.clone();
        with_axes.push(2);
        Ok((shaped(py, pixels.into_flattened(), &with_axes)?, shaped(py, depths, &outer)?))
    }

    /// The world points, (height, width, 3) in metres, at the centres of the pixels of a depth picture of shape
    /// (height, width), in metres along the camera's axis; NaN where the depth is not above 0, as where nothing was
    /// hit.
    fn unproject<'py>(&self, py: Python<'py>, depth: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let depth = numbers("depth", depth)?;
        let depths = depth.as_array();
        let (width, height) = (self.0.intrinsics.width as usize, self.0.intrinsics.height as usize);
        if depths.shape() != [height, width] {
            let expected = format!("the shape {:?} of the camera's picture", [height, width]);
            let advice = "pass the depth of the whole view, `View.depth` or one of its size";
            return Err(wrong_shape(format!("depth: expected {expected}, found {:?}; {advice}", depths.shape())));
        }
        let matrix = self.0.matrix();
        let points: Vec<f64> = depths
            .iter()
            .enumerate()
            .flat_map(|(at, &depth)| match depth > 0.0 {
                true => {
                    let centre = DVec2::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
                    matrix.transform_point3(self.0.camera_direction(centre) * depth).to_array()
                }
                false => [f64::NAN; 3],
            })
            .collect();
        PyArray1::from_vec(py, points).reshape([height, width, 3])
    }

    /// The numbers of a pickled camera.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, CameraNumbers)> {
        let rebuild = py.import("mateval._core")?.getattr("rebuilt_camera")?;
        let k = &self.0.intrinsics;
        Ok((rebuild, ((k.width, k.height), [k.fx, k.fy, k.cx, k.cy], self.0.world_from_camera)))
    }

    fn __repr__(&self) -> String {
        let k = &self.0.intrinsics;
        format!("<mateval.Camera {}x{}, fx {:.2}, fy {:.2}>", k.width, k.height, k.fx, k.fy)
    }
}

/// Width and height; focal lengths and principal point, as fx, fy, cx, cy; and `world_from_camera`.
type CameraNumbers = ((u32, u32), [f64; 4], [[f64; 4]; 4]);

/// The copy of a pickled camera.
#[pyfunction]
pub fn rebuilt_camera(size: (u32, u32), intrinsics: [f64; 4], world_from_camera: [[f64; 4]; 4]) -> Camera {
    let ((width, height), [fx, fy, cx, cy]) = (size, intrinsics);
    Camera(camera::Camera { world_from_camera, intrinsics: camera::Intrinsics { width, height, fx, fy, cx, cy } })
}

fn shaped<'py>(py: Python<'py>, values: Vec<f64>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let array = ArrayD::from_shape_vec(IxDyn(shape), values);
    Ok(array.map_err(|error| PyValueError::new_err(error.to_string()))?.into_pyarray(py))
}
