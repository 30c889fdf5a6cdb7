//! A view's camera, for many points at once.

use glam::{DVec2, DVec3};
use mateval_scene::camera;
use numpy::ndarray::{ArrayD, Axis, IxDyn};
use numpy::{AllowTypeChange, IntoPyArray as _, PyArray2, PyArray3, PyArrayDyn, PyArrayLikeDyn};
use numpy::{PyArray1, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::rows;

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

    /// Projects world points of shape (..., 3), in metres. Returns their positions in the picture, (..., 2) in pixels from
    /// the top left, and their depths along the camera's axis, (...) in metres; NaN for points behind the camera.
    #[expect(clippy::type_complexity, reason = "a tuple of arrays, as NumPy's own functions return")]
    fn project<'py>(
        &self,
        py: Python<'py>,
        xyz: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
    ) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArrayDyn<f64>>)> {
        let points = xyz.as_array();
        let Some((3, outer)) = points.shape().split_last().map(|(last, outer)| (*last, outer.to_vec())) else {
            return Err(PyValueError::new_err(format!("xyz: expected the shape (..., 3), found {:?}", points.shape())));
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

    /// The world points, (height, width, 3) in metres, at the centres of the pixels of a depth picture of shape (height,
    /// width), in metres along the camera's axis; NaN where the depth is not above 0, as where nothing was hit.
    fn unproject<'py>(
        &self,
        py: Python<'py>,
        depth: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let depths = depth.as_array();
        let (width, height) = (self.0.intrinsics.width as usize, self.0.intrinsics.height as usize);
        if depths.shape() != [height, width] {
            let expected = format!("the shape {:?} of the camera's picture", [height, width]);
            return Err(PyValueError::new_err(format!("depth: expected {expected}, found {:?}", depths.shape())));
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

    fn __repr__(&self) -> String {
        let k = &self.0.intrinsics;
        format!("<mateval.Camera {}x{}, fx {:.2}, fy {:.2}>", k.width, k.height, k.fx, k.fy)
    }
}

fn shaped<'py>(py: Python<'py>, values: Vec<f64>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let array = ArrayD::from_shape_vec(IxDyn(shape), values);
    Ok(array.map_err(|error| PyValueError::new_err(error.to_string()))?.into_pyarray(py))
}
