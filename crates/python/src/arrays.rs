//! Arrays of NumPy: pictures and lists of vectors as arrays, pictures of a view read detached from Python, and maps
//! that Python gives, whose dtype decides how they are stored.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use half::f16;
use mateval_dataset::{Camera, DatasetError};
use mateval_image::limits::MAX_PIXELS;
use mateval_image::transfer::{byte_from_unit, linear_from_srgb};
use mateval_image::{ImageError, LinearRgb, Mask, Picture, SrgbRgb, png_io};
use numpy::{
    AllowTypeChange, Element, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayLikeDyn, PyArrayMethods as _,
    PyUntypedArray, PyUntypedArrayMethods as _,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::long_work::{failed, wrong_shape};

/// Rows of pixels as an array of shape (height, width), which takes over the picture's memory.
pub fn plane<'py, T: Element + Copy>(py: Python<'py>, picture: Picture<T>) -> PyResult<Bound<'py, PyArray2<T>>> {
    let shape = [picture.height(), picture.width()];
    PyArray1::from_vec(py, picture.into_pixels()).reshape(shape)
}

/// Rows of pixels as an array of shape (height, width, 3), which takes over the picture's memory where `channels` does
/// not change the size of a pixel.
pub fn triples<'py, P: Copy, T: Element + Copy>(
    py: Python<'py>,
    picture: Picture<P>,
    channels: impl Fn(P) -> [T; 3],
) -> PyResult<Bound<'py, PyArray3<T>>> {
    let shape = [picture.height(), picture.width(), 3];
    let pixels: Vec<[T; 3]> = picture.into_pixels().into_iter().map(channels).collect();
    PyArray1::from_vec(py, pixels.into_flattened()).reshape(shape)
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
    Err(failed(DatasetError::Unsupported { path, what }))
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
    /// Copies the array. Fails for anything but an array or a tensor of the dtypes of [`Numbers`], and for one of more
    /// numbers than a picture may have: views such as those of `numpy.broadcast_to` may be larger than memory.
    pub fn new(name: &'static str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array = &untyped(name, given)?;
        let count = array.shape().iter().try_fold(1_u64, |count, axis| count.checked_mul(*axis as u64));
        if count.is_none_or(|count| count > 4 * MAX_PIXELS) {
            let found = array.shape();
            let message = format!("{name}: expected at most {MAX_PIXELS} pixels, found an array of shape {found:?}");
            return Err(wrong_shape(message));
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

    /// A linear picture of shape (height, width, 3). Unless `is_srgb` says so, integers are decoded from sRGB and floats
    /// are linear.
    pub fn linear(&self, is_srgb: Option<bool>) -> PyResult<Picture<LinearRgb>> {
        let picture = self.colours().ok_or_else(|| self.wrong_shape("(height, width, 3)"))?;
        let is_srgb = is_srgb.unwrap_or_else(|| self.is_stored());
        let decode = |value: f32| if is_srgb { linear_from_srgb(value) } else { value };
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
        let is_bytes = floats.iter().all(|value| (0.0..=255.0).contains(value));
        let advice = if is_bytes { "; divide values of 0 to 255 by 255, or pass them as uint8" } else { "" };
        Err(PyValueError::new_err(format!("{}: expected {expected}, found {found} at {index:?}{advice}", self.name)))
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
        other.check_size_of(self.name, &self.shape)
    }

    /// Fails where the array `name` of this shape has another height or width.
    pub fn check_size_of(&self, name: &str, shape: &[usize]) -> PyResult<()> {
        let size = |shape: &[usize]| shape.iter().take(2).copied().collect::<Vec<_>>();
        let (expected, found) = (size(&self.shape), size(shape));
        if expected == found {
            return Ok(());
        }
        let expected = format!("the height and width of {}, {expected:?}", self.name);
        Err(wrong_shape(format!("{name}: expected {expected}, found {found:?}; scale one of them")))
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

    pub fn wrong_shape(&self, expected: &str) -> PyErr {
        let advice = match *self.shape.as_slice() {
            [3, height, width] if height != 3 && width != 3 => {
                "; `numpy.moveaxis(array, 0, -1)` puts the channels last"
            }
            [1, _, _] | [1, _, _, _] => "; `array[0]` drops the first axis",
            [_, _, 1] => "; `array[..., 0]` drops the last axis",
            [_, _, 4] => "; `array[..., :3]` drops the fourth channel",
            _ => "",
        };
        let (name, found) = (self.name, &self.shape);
        wrong_shape(format!("{name}: expected the shape {expected}, found {found:?}{advice}"))
    }
}

/// A picture whose pixels are colours or numbers.
pub enum ColoursOrNumbers {
    /// As the metrics take colours: sRGB-encoded.
    Colours(Picture<SrgbRgb>),
    Numbers(Picture<f32>),
}

/// A mask of a picture. Fails for anything but an array of bool of the shape (height, width), with the picture's size.
pub fn mask_of(given: &Bound<'_, PyAny>, picture: &MapInput) -> PyResult<Mask> {
    let array = &untyped("mask", given)?;
    let Some(pixels) = copied::<bool>(array)? else {
        return Err(PyTypeError::new_err(format!("mask: expected bool, found {}", array.dtype())));
    };
    let &[height, width] = array.shape() else {
        let found = array.shape();
        return Err(wrong_shape(format!("mask: expected the shape (height, width), found {found:?}")));
    };
    picture.check_size_of("mask", array.shape())?;
    Mask::new(width, height, pixels).map_err(failed)
}

/// A NumPy array as it is, a tensor of another library as an array.
fn untyped<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    if let Ok(array) = given.cast::<PyUntypedArray>() {
        return Ok(array.clone());
    }
    let array = given.py().import("mateval.tensors")?.getattr("as_array")?.call1((name, given))?;
    Ok(array.cast_into::<PyUntypedArray>()?)
}

/// The numbers of an array, a tensor of another library or nested lists.
pub fn numbers<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<PyArrayLikeDyn<'py, f64, AllowTypeChange>> {
    match given.hasattr("detach")? {
        true => untyped(name, given)?.into_any().extract(),
        false => given.extract(),
    }
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

/// A picture of bytes, of shape (height, width, 3), RGB, or (height, width), as the bytes of a PNG file.
#[pyfunction]
pub fn png<'py>(py: Python<'py>, picture: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
    let input = MapInput::new("picture", picture)?;
    let Numbers::Bytes(bytes) = &input.numbers else {
        return Err(PyTypeError::new_err("picture: expected uint8"));
    };
    let file = match *input.shape.as_slice() {
        [height, width, 3] => {
            let pixels = bytes.as_chunks::<3>().0.to_vec();
            png_io::rgb_file(&Picture::new(width, height, pixels).map_err(failed)?)
        }
        [height, width] => png_io::grey_file(&Picture::new(width, height, bytes.clone()).map_err(failed)?),
        _ => return Err(input.wrong_shape("(height, width, 3) or (height, width)")),
    };
    Ok(PyBytes::new(py, &file.map_err(PyValueError::new_err)?))
}

/// Linear colours of shape (height, width, 3) as sRGB: uint8 of the same shape and order of channels, clipped.
#[pyfunction]
pub fn srgb_bytes<'py>(py: Python<'py>, picture: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let linear = MapInput::new("picture", picture)?.linear(Some(false))?;
    triples(py, linear.to_srgb(), |SrgbRgb(rgb)| rgb.map(byte_from_unit))
}
