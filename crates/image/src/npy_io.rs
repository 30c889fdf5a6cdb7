//! Reads pictures from untrusted NumPy files (`.npy`), as Python programs save the arrays of a network.
//!
//! Shapes: rows, columns (grey); rows, columns, channels; or channels, rows, columns, where the channels are 1, 3 or 4;
//! leading axes of length 1 are dropped. Types: `u1` and `u2`, which count as the integers of a PNG, and the floats
//! `f2`, `f4` and `f8`, which count as linear like those of an EXR.
//!
//! The header is checked before the library parses it. The library takes memory for the header's stated length,
//! recurses as deep as its brackets and multiplies the shape's numbers unchecked. The header is therefore compared with
//! what NumPy writes for a plain array before the library sees it. Pickled objects and structured types have other
//! headers and are refused too.

use std::path::Path;

use crate::limits::check_size;
use crate::texture::Encoding;
use crate::{ImageError, Texels, Texture, Wrap};

/// The first bytes of a NumPy file.
pub const NPY_SIGNATURE: &[u8] = b"\x93NUMPY";
/// The largest header. NumPy's own are below 200 bytes.
pub(crate) const MAX_HEADER_BYTES: usize = 4096;
/// The most bytes before the header: magic string, version and the header's length.
pub(crate) const MAX_PREFIX_BYTES: usize = 12;
/// The most digits in a header. The product of any numbers that are written with 16 digits together, times the bytes of
/// one number, is below 10^17.
const MAX_HEADER_DIGITS: usize = 16;

/// Why the header of a NumPy file is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NpyHeaderError {
    /// The bytes end within the prefix or the header.
    #[error("expected a NumPy array, found {found} bytes, which end within the header")]
    CutOff { found: usize },
    /// The header is too long.
    #[error("its header is {found} bytes long; expected at most {most}")]
    LongHeader {
        /// The header's stated length.
        found: usize,
        /// The greatest length allowed.
        most: usize,
    },
    /// NumPy does not write such a header for a plain array of numbers.
    #[error("its header is not one that NumPy writes for a plain array of numbers; pickled objects are never read")]
    OtherHeader,
}

/// The data behind the header. Fails where the header is not that of a plain array.
pub fn checked_data(bytes: &[u8]) -> Result<&[u8], NpyHeaderError> {
    let (header, data) = split(bytes)?;
    if is_plain(header) { Ok(data) } else { Err(NpyHeaderError::OtherHeader) }
}

/// The header's text and the data behind it.
fn split(bytes: &[u8]) -> Result<(&[u8], &[u8]), NpyHeaderError> {
    let cut_off = || NpyHeaderError::CutOff { found: bytes.len() };
    let from = if bytes.get(6) == Some(&1) { 10 } else { MAX_PREFIX_BYTES };
    let length = bytes.get(8..from).ok_or_else(cut_off)?;
    let length = length.iter().rev().fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte));
    if length > MAX_HEADER_BYTES {
        return Err(NpyHeaderError::LongHeader { found: length, most: MAX_HEADER_BYTES });
    }
    bytes[from..].split_at_checked(length).ok_or_else(cut_off)
}

/// Whether the header is one dictionary with one tuple of decimal numbers, without escapes, lists, large numbers and
/// pickled objects.
fn is_plain(header: &[u8]) -> bool {
    let count = |bytes: &[u8]| header.iter().filter(|byte| bytes.contains(byte)).count();
    let digits = header.iter().filter(|byte| byte.is_ascii_digit()).count();
    let shape = header.split(|byte| *byte == b'(').nth(1).and_then(|rest| rest.split(|byte| *byte == b')').next());
    let is_decimal = |shape: &[u8]| shape.iter().all(|byte| byte.is_ascii_digit() || b", ".contains(byte));
    let is_object = header.windows(3).any(|word| word == b"'|O" || word == b"'O'");
    count(b"{") == 1
        && count(b"(") == 1
        && count(b"[\\") == 0
        && digits <= MAX_HEADER_DIGITS
        && shape.is_some_and(is_decimal)
        && !is_object
}

/// Why a NumPy file is not a picture.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NpyPictureError {
    /// The library refused the array.
    #[error("not a valid NumPy array: {0}")]
    Unsound(std::io::Error),
    /// The axes do not describe one picture.
    #[error(
        "an array of shape ({}); expected (rows, columns), (rows, columns, channels) or (channels, rows, columns) with 1, 3 or 4 channels",
        joined(.0)
    )]
    Shape(Vec<u64>),
    /// Either of two axes could hold the channels.
    #[error(
        "an array of shape ({}), whose first and last axis could both be channels; save the picture as PNG or EXR",
        joined(.0)
    )]
    Ambiguous(Vec<u64>),
    /// The first axis changes fastest, as in Fortran.
    #[error("an array in Fortran order; save numpy.ascontiguousarray(array)")]
    Fortran,
    /// The type of the numbers is not supported.
    #[error("an array of {0}; expected u1, u2, f2, f4 or f8; convert it with array.astype('f4')")]
    Type(String),
    /// The data has another length than the header states.
    #[error("expected {expected} bytes of numbers, found {found}")]
    Length {
        /// Bytes that the numbers take.
        expected: u64,
        /// Bytes behind the header.
        found: u64,
    },
}

pub(crate) fn joined(shape: &[u64]) -> String {
    shape.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")
}

/// Rows, columns and channels of an array, and which axis holds the channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Layout {
    rows: u64,
    columns: u64,
    channels: u64,
    /// Whether all rows of one channel come before the next channel.
    is_planar: bool,
}

impl Layout {
    fn of(shape: &[u64]) -> Result<Self, NpyPictureError> {
        let lead = shape.iter().take(shape.len().saturating_sub(3)).take_while(|axis| **axis == 1).count();
        let is_channels = |axis: u64| matches!(axis, 1 | 3 | 4);
        match shape[lead..] {
            [rows, columns] => Ok(Self { rows, columns, channels: 1, is_planar: false }),
            [first, middle, last] => match (is_channels(first), is_channels(last)) {
                (true, true) => Err(NpyPictureError::Ambiguous(shape.to_vec())),
                (false, true) => Ok(Self { rows: first, columns: middle, channels: last, is_planar: false }),
                (true, false) => Ok(Self { rows: middle, columns: last, channels: first, is_planar: true }),
                (false, false) => Err(NpyPictureError::Shape(shape.to_vec())),
            },
            _ => Err(NpyPictureError::Shape(shape.to_vec())),
        }
    }

    /// The colours of all pixels; alpha is dropped and grey repeated.
    fn pixels<T: Copy>(self, values: &[T]) -> Vec<[T; 3]> {
        let (count, channels) = ((self.rows * self.columns) as usize, self.channels as usize);
        let at = |pixel: usize, channel: usize| {
            if self.is_planar { values[channel * count + pixel] } else { values[pixel * channels + channel] }
        };
        let channel = |wanted: usize| if channels == 1 { 0 } else { wanted };
        (0..count).map(|pixel| [0, 1, 2].map(|wanted| at(pixel, channel(wanted)))).collect()
    }
}

/// The numbers of an array, of one of the supported types; all floats are converted to single precision.
enum Numbers {
    Bytes(Vec<u8>),
    Words(Vec<u16>),
    Floats(Vec<f32>),
}

/// Reads a picture from the bytes of a NumPy file; `path` serves for errors only. Every value must be finite.
pub(crate) fn texture_of_npy(path: &Path, bytes: &[u8], encoding: Encoding, wrap: Wrap) -> Result<Texture, ImageError> {
    let invalid = |what: String| ImageError::Invalid { path: path.to_owned(), what };
    let data = checked_data(bytes).map_err(|error| invalid(error.to_string()))?;
    let file = npyz::NpyFile::new(bytes).map_err(|error| invalid(NpyPictureError::Unsound(error).to_string()))?;
    let layout = Layout::of(file.shape()).map_err(|error| invalid(error.to_string()))?;
    check_size(path, layout.columns, layout.rows)?;
    let numbers = numbers(file, layout, data.len() as u64).map_err(|error| invalid(error.to_string()))?;
    if let Numbers::Floats(values) = &numbers
        && let Some(at) = values.iter().position(|value| !value.is_finite())
    {
        return Err(invalid(format!("number {at} is {}; expected finite numbers", values[at])));
    }
    let texels = match (numbers, encoding) {
        (Numbers::Bytes(values), Encoding::Srgb) => Texels::Srgb8(layout.pixels(&values)),
        (Numbers::Bytes(values), Encoding::Linear) => Texels::Linear8(layout.pixels(&values)),
        (Numbers::Words(values), Encoding::Srgb) => Texels::Srgb16(layout.pixels(&values)),
        (Numbers::Words(values), Encoding::Linear) => {
            let shares: Vec<f32> = values.into_iter().map(|word| f32::from(word) / 65535.0).collect();
            Texels::Linear(layout.pixels(&shares))
        }
        (Numbers::Floats(values), _) => Texels::Linear(layout.pixels(&values)),
    };
    Texture::new(layout.columns as usize, layout.rows as usize, texels, wrap)
}

/// The numbers. Fails where the `found` bytes of data have another length than the header states. `layout` is within
/// the limits of pictures, so no product overflows.
fn numbers(file: npyz::NpyFile<&[u8]>, layout: Layout, found: u64) -> Result<Numbers, NpyPictureError> {
    if file.order() != npyz::Order::C {
        return Err(NpyPictureError::Fortran);
    }
    let count = layout.rows * layout.columns * layout.channels;
    let described = file.dtype().descr();
    // The library gives the file back where it does not hold numbers of the requested type.
    macro_rules! try_types {
        ($file:expr; $($number:ty => $make:expr),*) => {{
            let file = $file;
            $(let file = match file.try_data::<$number>() {
                Ok(numbers) => {
                    let expected = count * size_of::<$number>() as u64;
                    if found != expected {
                        return Err(NpyPictureError::Length { expected, found });
                    }
                    let numbers: Result<Vec<$number>, _> = numbers.collect();
                    return numbers.map($make).map_err(NpyPictureError::Unsound);
                }
                Err(file) => file,
            };)*
            drop(file);
        }};
    }
    try_types!(file;
        u8 => Numbers::Bytes,
        u16 => Numbers::Words,
        f32 => Numbers::Floats,
        f64 => |values: Vec<f64>| Numbers::Floats(values.into_iter().map(|value| value as f32).collect()),
        npyz::half::f16 => |values: Vec<npyz::half::f16>| Numbers::Floats(values.into_iter().map(f32::from).collect())
    );
    Err(NpyPictureError::Type(described))
}

#[cfg(test)]
mod tests {
    use npyz::WriterBuilder as _;
    use proptest::prelude::*;

    use super::*;

    /// An array as the library writes it.
    fn npy<T: npyz::AutoSerialize + Copy>(numbers: &[T], shape: &[u64], order: npyz::Order) -> Vec<u8> {
        let mut bytes = Vec::new();
        let options = npyz::WriteOptions::new().default_dtype().shape(shape).order(order);
        let mut writer = options.writer(&mut bytes).begin_nd().unwrap();
        writer.extend(numbers.iter().copied()).unwrap();
        writer.finish().unwrap();
        bytes
    }

    fn read(bytes: &[u8]) -> Result<Texture, ImageError> {
        texture_of_npy(Path::new("a.npy"), bytes, Encoding::Linear, Wrap::Clamp)
    }

    fn refused(bytes: &[u8]) -> String {
        read(bytes).unwrap_err().to_string()
    }

    /// Rows first, planes first, a batch of one and grey give the same pixels; every type keeps its values.
    #[test]
    fn every_shape_and_type_gives_the_picture() {
        use npyz::Order::C;
        let value = |x: usize, y: usize, c: usize| (x + 10 * y + 60 * c) as u8;
        let interleaved: Vec<u8> =
            (0..2).flat_map(|y| (0..5).flat_map(move |x| (0..3).map(move |c| value(x, y, c)))).collect();
        let planar: Vec<u8> =
            (0..3).flat_map(|c| (0..2).flat_map(move |y| (0..5).map(move |x| value(x, y, c)))).collect();
        let pictures = [
            read(&npy(&interleaved, &[2, 5, 3], C)).unwrap(),
            read(&npy(&planar, &[3, 2, 5], C)).unwrap(),
            read(&npy(&planar, &[1, 3, 2, 5], C)).unwrap(),
        ];
        for picture in &pictures {
            assert_eq!((picture.width(), picture.height()), (5, 2));
            for (x, y) in (0..5).flat_map(|x| (0..2).map(move |y| (x, y))) {
                assert_eq!(picture.texel(x, y), [0, 1, 2].map(|c| f32::from(value(x, y, c)) / 255.0));
            }
        }
        // Twin: the numbers of the planes, read row by row, are another picture.
        assert_ne!(read(&npy(&planar, &[2, 5, 3], C)).unwrap().texel(1, 0), pictures[0].texel(1, 0));
        let alone = |bytes: Vec<u8>| read(&bytes).unwrap().texel(1, 1);
        assert_eq!(alone(npy(&[0.0_f32, 1.0, 2.0, -0.5], &[2, 2], C)), [-0.5; 3]);
        assert_eq!(alone(npy(&[0.0_f64, 1.0, 2.0, 0.25], &[2, 2, 1], C)), [0.25; 3]);
        assert_eq!(alone(npy(&[0_u16, 1, 2, 65535], &[2, 2], C)), [1.0; 3]);
        assert_eq!(alone(npy(&[0.5, 1.0, 2.0, 0.75].map(npyz::half::f16::from_f32), &[2, 2], C)), [0.75; 3]);
    }

    #[test]
    fn what_is_no_picture_is_refused_with_the_reason() {
        use npyz::Order::{C, Fortran};
        assert!(refused(&npy(&[1.0_f32; 8], &[8], C)).contains("shape (8); expected (rows, columns)"));
        assert!(refused(&npy(&[1.0_f32; 50], &[5, 2, 5], C)).contains("shape (5, 2, 5)"));
        assert!(refused(&npy(&[1.0_f32; 36], &[3, 3, 4], C)).contains("could both be channels"));
        assert!(refused(&npy(&[1.0_f32; 60], &[2, 5, 2, 3], C)).contains("(2, 5, 2, 3)"));
        assert!(refused(&npy(&[1.0_f32; 6], &[2, 3], Fortran)).contains("ascontiguousarray"));
        assert!(refused(&npy(&[1_i64; 6], &[2, 3], C)).contains("astype('f4')"));
        assert!(refused(&npy(&[0.0, 1.0, f32::NAN, 0.0], &[2, 2], C)).contains("number 2 is NaN"));
        let sound = npy(&[1.0_f32; 6], &[2, 3], C);
        assert!(refused(&sound[..sound.len() - 1]).contains("expected 24 bytes of numbers, found 23"));
        assert!(refused(&sound[..9]).contains("end within the header"));
        assert!(read(&sound).is_ok());
    }

    /// A header that claims a petabyte takes no memory; pickled objects are refused.
    #[test]
    fn claims_are_checked_before_memory_is_taken() {
        let with_header = |header: &str| {
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend(&(header.len() as u16).to_le_bytes());
            bytes.extend(header.as_bytes());
            bytes.extend([0; 16]);
            bytes
        };
        let claim = |shape: &str| {
            refused(&with_header(&format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}")))
        };
        assert!(claim("9999999, 999999").contains("expected 1 to 16384 a side"));
        assert!(claim("16384, 16384").contains("at most 67108864"));
        assert!(claim("8192, 8192, 3").contains("expected 805306368 bytes of numbers, found 16"));
        assert!(claim("0, 4").contains("expected 1 to 16384 a side"));
        assert!(claim("18446744073709551615, 2").contains("plain array"));
        let pickled = with_header("{'descr': '|O', 'fortran_order': False, 'shape': (2, 2), }");
        assert!(refused(&pickled).contains("pickled objects are never read"));
    }

    proptest! {
        #[test]
        fn no_bytes_cause_a_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..300), whole in any::<bool>()) {
            if whole {
                let sound = npy(&[1.0_f32; 24], &[2, 4, 3], npyz::Order::C);
                let noise = bytes.iter().chain(std::iter::repeat(&0));
                bytes = sound.iter().zip(noise).map(|(a, b)| a ^ (b & b >> 4)).collect();
            }
            let _ = read(&bytes);
        }
    }
}
