//! Arrays of NumPy: pictures and lists of vectors as arrays, pictures of a view read detached from Python, and maps
//! that Python gives, whose dtype decides how they are stored.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use half::f16;
use mateval_dataset::{Camera, SceneError};
use mateval_image::limits::MAX_PIXELS;
use mateval_image::transfer::linear_from_srgb;
use mateval_image::{ImageError, LinearRgb, Mask, Picture, SrgbRgb};
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods as _, PyUntypedArray, PyUntypedArrayMethods as _,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::long_work::failed;

/// Rows of pixels as an array of shape (height, width).
pub fn plane<'py, T: Element + Copy>(py: Python<'py>, picture: &Picture<T>) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_slice(py, picture.pixels()).reshape([picture.height(), picture.width()])
}

/// Rows of pixels as an array of shape (height, width, 3).
pub fn triples<'py, P: Copy, T: Element + Copy>(
    py: Python<'py>,
    picture: &Picture<P>,
    channels: impl Fn(P) -> [T; 3],
) -> PyResult<Bound<'py, PyArray3<T>>> {
    let values: Vec<T> = picture.pixels().iter().flat_map(|pixel| channels(*pixel)).collect();
    PyArray1::from_vec(py, values).reshape([picture.height(), picture.width(), 3])
}

/// Vectors as an array of shape (number, N).
pub fn rows<'py, T: Element + Copy, const N: usize>(
    py: Python<'py>,
    vectors: impl Iterator<Item = [T; N]>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let values: Vec<T> = vectors.flatten().collect();
    let count = values.len() / N;
    PyArray1::from_vec(py, values).reshape([count, N])
}

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

/// The numbers of an array, row by row.
pub enum Numbers {
    /// uint8: a stored value times 255.
    Bytes(Vec<u8>),
    /// uint16: a stored value times 65535.
    Words(Vec<u16>),
    /// float16, exactly.
    Halves(Vec<f32>),
    /// float32, or float64 rounded.
    Floats(Vec<f32>),
}

/// An array with the name of its argument, for errors.
pub struct MapInput {
    name: &'static str,
    shape: Vec<usize>,
    pub numbers: Numbers,
}

impl MapInput {
    /// Copies the array. Fails for anything but an array of the dtypes of [`Numbers`], and for one of more numbers than
    /// a picture may have: views such as those of `numpy.broadcast_to` may be larger than memory.
    pub fn new(name: &'static str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array = untyped(name, given)?;
        let count = array.shape().iter().try_fold(1_u64, |count, axis| count.checked_mul(*axis as u64));
        if count.is_none_or(|count| count > 4 * MAX_PIXELS) {
            let found = array.shape();
            let message = format!("{name}: expected at most {MAX_PIXELS} pixels, found an array of shape {found:?}");
            return Err(PyValueError::new_err(message));
        }
        let numbers = if let Some(bytes) = copied::<u8>(array)? {
            Numbers::Bytes(bytes)
        } else if let Some(words) = copied::<u16>(array)? {
            Numbers::Words(words)
        } else if let Some(halves) = copied::<f16>(array)? {
            Numbers::Halves(halves.into_iter().map(f32::from).collect())
        } else if let Some(floats) = copied::<f32>(array)? {
            Numbers::Floats(floats)
        } else if let Some(doubles) = copied::<f64>(array)? {
            Numbers::Floats(doubles.into_iter().map(|value| value as f32).collect())
        } else {
            let expected = "uint8, uint16, float16, float32 or float64";
            return Err(PyTypeError::new_err(format!("{name}: expected {expected}, found {}", array.dtype())));
        };
        Ok(Self { name, shape: array.shape().to_vec(), numbers })
    }

    /// The array as a picture of colours. `None` where its shape is not (height, width, 3).
    fn colours(&self) -> Option<Picture<[f32; 3]>> {
        let [height, width, 3] = *self.shape.as_slice() else { return None };
        let pixels = self.unit_values().as_chunks::<3>().0.to_vec();
        Picture::new(width, height, pixels).ok()
    }

    /// The array as a picture of numbers. `None` where its shape is not (height, width).
    fn scalars(&self) -> Option<Picture<f32>> {
        let [height, width] = *self.shape.as_slice() else { return None };
        Picture::new(width, height, self.unit_values()).ok()
    }

    /// A linear picture of shape (height, width, 3): integers are decoded from sRGB, floats are linear.
    pub fn linear(&self) -> PyResult<Picture<LinearRgb>> {
        let picture = self.colours().ok_or_else(|| self.wrong_shape("(height, width, 3)"))?;
        let decode = |value: f32| if self.is_stored() { linear_from_srgb(value) } else { value };
        Ok(picture.map(|rgb| LinearRgb(rgb.map(decode))))
    }

    /// A picture of shape (height, width).
    pub fn plane(&self) -> PyResult<Picture<f32>> {
        self.scalars().ok_or_else(|| self.wrong_shape("(height, width)"))
    }

    /// A picture in its own encoding: colours for the shape (height, width, 3), else numbers.
    pub fn colours_or_numbers(&self) -> PyResult<ColoursOrNumbers> {
        let colours = self.colours().map(|picture| ColoursOrNumbers::Colours(picture.map(SrgbRgb)));
        let numbers = || self.scalars().map(ColoursOrNumbers::Numbers);
        colours.or_else(numbers).ok_or_else(|| self.wrong_shape("(height, width, 3) or (height, width)"))
    }

    /// Fails where a float is out of range.
    pub fn check_range(&self, range: &RangeInclusive<f32>) -> PyResult<()> {
        let (Numbers::Halves(floats) | Numbers::Floats(floats)) = &self.numbers else { return Ok(()) };
        let Some(at) = floats.iter().position(|value| !range.contains(value)) else { return Ok(()) };
        let expected = format!("values from {} to {}", range.start(), range.end());
        let (found, index) = (floats[at], index_of(at, &self.shape));
        Err(PyValueError::new_err(format!("{}: expected {expected}, found {found} at {index:?}", self.name)))
    }

    /// The side of a square map with a third axis of three channels, or without one. Fails for other shapes and sides.
    pub fn side(&self, has_channels: bool, sides: &RangeInclusive<usize>) -> PyResult<usize> {
        let square = match (self.shape.as_slice(), has_channels) {
            (&[height, width, 3], true) | (&[height, width], false) => (height == width).then_some(width),
            _ => None,
        };
        let axes = if has_channels { "(side, side, 3)" } else { "(side, side)" };
        let expected = format!("{axes} with a side of {} to {} texels", sides.start(), sides.end());
        square.filter(|side| sides.contains(side)).ok_or_else(|| self.wrong_shape(&expected))
    }

    /// Fails where one array holds integers and the other floats: they would be compared in different encodings.
    pub fn check_same_kind(&self, other: &Self) -> PyResult<()> {
        if self.is_stored() == other.is_stored() {
            return Ok(());
        }
        let kind = |input: &Self| if input.is_stored() { "integers" } else { "floats" };
        let expected = format!("{} like the {}", kind(other), other.name);
        Err(PyTypeError::new_err(format!("{}: expected {expected}, found {}", self.name, kind(self))))
    }

    /// Fails where the other array has another height or width.
    pub fn check_same_size(&self, other: &Self) -> PyResult<()> {
        let size = |input: &Self| input.shape.iter().take(2).copied().collect::<Vec<_>>();
        if size(self) == size(other) {
            return Ok(());
        }
        let expected = format!("the height and width of {}, {:?}", other.name, size(other));
        Err(PyValueError::new_err(format!("{}: expected {expected}, found {:?}", self.name, size(self))))
    }

    fn is_stored(&self) -> bool {
        matches!(self.numbers, Numbers::Bytes(_) | Numbers::Words(_))
    }

    /// The numbers, integers divided by the largest of their type.
    fn unit_values(&self) -> Vec<f32> {
        match &self.numbers {
            Numbers::Bytes(bytes) => bytes.iter().map(|byte| f32::from(*byte) / 255.0).collect(),
            Numbers::Words(words) => words.iter().map(|word| f32::from(*word) / 65535.0).collect(),
            Numbers::Halves(floats) | Numbers::Floats(floats) => floats.clone(),
        }
    }

    fn wrong_shape(&self, expected: &str) -> PyErr {
        PyValueError::new_err(format!("{}: expected the shape {expected}, found {:?}", self.name, self.shape))
    }
}

/// A picture whose pixels are colours or numbers.
pub enum ColoursOrNumbers {
    /// As the metrics take colours: sRGB-encoded.
    Colours(Picture<SrgbRgb>),
    Numbers(Picture<f32>),
}

/// A mask. Fails for anything but an array of bool of the shape (height, width).
pub fn mask_of(given: &Bound<'_, PyAny>) -> PyResult<Mask> {
    let array = untyped("mask", given)?;
    let Some(pixels) = copied::<bool>(array)? else {
        return Err(PyTypeError::new_err(format!("mask: expected bool, found {}", array.dtype())));
    };
    let wrong = || format!("mask: expected the shape (height, width), found {:?}", array.shape());
    match *array.shape() {
        [height, width] => Mask::new(width, height, pixels).ok(),
        _ => None,
    }
    .ok_or_else(|| PyValueError::new_err(wrong()))
}

fn untyped<'a, 'py>(name: &str, given: &'a Bound<'py, PyAny>) -> PyResult<&'a Bound<'py, PyUntypedArray>> {
    given.cast::<PyUntypedArray>().or_else(|_| {
        let found = given.get_type().fully_qualified_name()?;
        Err(PyTypeError::new_err(format!("{name}: expected a NumPy array, found {found}")))
    })
}

/// The elements of an array in row-major order, whatever its strides. `None` where it has another dtype.
fn copied<T: Element + Copy>(array: &Bound<'_, PyUntypedArray>) -> PyResult<Option<Vec<T>>> {
    let Ok(array) = array.cast::<PyArrayDyn<T>>() else { return Ok(None) };
    let array = array.try_readonly().map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(Some(array.as_array().iter().copied().collect()))
}

/// The index of the element `at` in row-major order.
fn index_of(mut at: usize, shape: &[usize]) -> Vec<usize> {
    let mut index = shape.to_vec();
    for length in index.iter_mut().rev() {
        (*length, at) = (at % *length, at / *length);
    }
    index
}
