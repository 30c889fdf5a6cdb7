//! Reads untrusted NumPy files (`.npy`): pictures, as Python programs save the arrays of a network, and lists of whole
//! numbers.
//!
//! Shapes of pictures: rows, columns (grey); rows, columns, channels; or channels, rows, columns, where the channels
//! are 1, 3 or 4; leading axes of length 1 are dropped. Types: `u1` and `u2`, which count as the integers of a PNG, and
//! the floats `f2`, `f4` and `f8`, which count as linear like those of an EXR.
//!
//! The header is checked before the library parses it. The library takes memory for the header's stated length,
//! recurses as deep as its brackets and multiplies the shape's numbers unchecked. The header is therefore compared with
//! what NumPy writes for a plain array before the library sees it. Pickled objects and structured types have other
//! headers and are refused too.

use std::path::Path;

use crate::limits::{Malformed, check_size};
use crate::texture::Encoding;
use crate::{ImageError, Texels, Texture, Wrap};

/// The first bytes of a NumPy file.
pub(crate) const NPY_SIGNATURE: &[u8] = b"\x93NUMPY";
/// The largest header. NumPy's own are below 200 bytes.
const MAX_HEADER_BYTES: usize = 4096;
/// The most bytes before the header: magic string, version and the header's length.
const MAX_PREFIX_BYTES: usize = 12;
/// The most digits in a header. The product of any numbers that are written with 16 digits together, times the bytes of
/// one number, is below 10^17.
const MAX_HEADER_DIGITS: usize = 16;

/// The most bytes of a file of `count` numbers of any type.
pub const fn most_bytes(count: usize) -> u64 {
    (MAX_PREFIX_BYTES + MAX_HEADER_BYTES + size_of::<u64>() * count) as u64
}

/// The array, and the data behind its header. Fails where the header is not that of a plain array.
fn open(bytes: &[u8]) -> Result<(npyz::NpyFile<&[u8]>, &[u8]), Malformed> {
    let cut_off =
        || Malformed(format!("expected a NumPy array, found {} bytes, which end within the header", bytes.len()));
    let from = if bytes.get(6) == Some(&1) { 10 } else { MAX_PREFIX_BYTES };
    let length = bytes.get(8..from).ok_or_else(cut_off)?;
    let length = length.iter().rev().fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte));
    if length > MAX_HEADER_BYTES {
        return Err(Malformed(format!("its header is {length} bytes long; expected at most {MAX_HEADER_BYTES}")));
    }
    let (header, data) = bytes[from..].split_at_checked(length).ok_or_else(cut_off)?;
    if !is_plain(header) {
        let what =
            "its header is not one that NumPy writes for a plain array of numbers; pickled objects are never read";
        return Err(Malformed(what.to_owned()));
    }
    Ok((npyz::NpyFile::new(bytes).map_err(unsound)?, data))
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

fn unsound(reason: std::io::Error) -> Malformed {
    Malformed(format!("not a valid NumPy array: {reason}"))
}

fn joined(shape: &[u64]) -> String {
    shape.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")
}

/// Returns the numbers of `$file`, whose `$data` is known to be small enough for memory, as `$make` makes them of the
/// first of these types that is the file's. Fails where it has none of them, and where the data has another length than
/// the header states.
macro_rules! read_numbers {
    ($file:ident, $data:ident, $expected:literal; $($number:ty => $make:expr),* $(,)?) => {{
        let (count, described) = ($file.len(), $file.dtype().descr());
        // The library gives the file back where it does not hold numbers of the requested type.
        $(let $file = match $file.try_data::<$number>() {
            Ok(numbers) => {
                let (expected, found) = (count * size_of::<$number>() as u64, $data.len());
                if found as u64 != expected {
                    return Err(Malformed(format!("expected {expected} bytes of numbers, found {found}")));
                }
                return numbers.collect::<Result<Vec<$number>, _>>().map($make).map_err(unsound);
            }
            Err(file) => file,
        };)*
        drop($file);
        Err(Malformed(format!(concat!("an array of {}; ", $expected), described)))
    }};
}

/// The numbers of an array with at most one axis whose length is not 1: (N,), (N, 1) or (1, N). Numbers of 2^63 or more
/// wrap around to negative ones.
pub fn whole_numbers(bytes: &[u8]) -> Result<Vec<i64>, Malformed> {
    fn widened<T>(wide: fn(T) -> i64) -> impl Fn(Vec<T>) -> Vec<i64> {
        move |numbers| numbers.into_iter().map(wide).collect()
    }
    let (file, data) = open(bytes)?;
    // With two long axes, the order of the numbers would be ambiguous.
    if !matches!(file.shape(), [_] | [_, 1] | [1, _]) {
        let shape = joined(file.shape());
        return Err(Malformed(format!("an array of shape ({shape}); expected (N,), (N, 1) or (1, N)")));
    }
    read_numbers!(file, data, "expected integers, as in '<i8'";
        i64 => |numbers| numbers,
        i32 => widened(i64::from),
        i16 => widened(i64::from),
        i8 => widened(i64::from),
        u64 => widened(|number| number as i64),
        u32 => widened(i64::from),
        u16 => widened(i64::from),
        u8 => widened(i64::from),
    )
}

/// The shape of an array of floating-point numbers, and its numbers row by row.
pub fn real_numbers(bytes: &[u8]) -> Result<(Vec<u64>, Vec<f64>), Malformed> {
    fn numbers(file: npyz::NpyFile<&[u8]>, data: &[u8]) -> Result<Vec<f64>, Malformed> {
        read_numbers!(file, data, "expected f4 or f8";
            f64 => |numbers| numbers,
            f32 => |numbers: Vec<f32>| numbers.into_iter().map(f64::from).collect(),
        )
    }
    let (file, data) = open(bytes)?;
    check_order(&file)?;
    let shape = file.shape().to_vec();
    Ok((shape, numbers(file, data)?))
}

fn check_order(file: &npyz::NpyFile<&[u8]>) -> Result<(), Malformed> {
    if file.order() == npyz::Order::C {
        return Ok(());
    }
    Err(Malformed("an array in Fortran order; save numpy.ascontiguousarray(array)".to_owned()))
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
    fn of(shape: &[u64]) -> Result<Self, Malformed> {
        let refused = |what: &str| Err(Malformed(format!("an array of shape ({}){what}", joined(shape))));
        const EXPECTED: &str = "; expected (rows, columns), (rows, columns, channels) or (channels, rows, columns) with \
                                1, 3 or 4 channels";
        let lead = shape.iter().take(shape.len().saturating_sub(3)).take_while(|axis| **axis == 1).count();
        let is_channels = |axis: u64| matches!(axis, 1 | 3 | 4);
        match shape[lead..] {
            [rows, columns] => Ok(Self { rows, columns, channels: 1, is_planar: false }),
            [first, middle, last] => match (is_channels(first), is_channels(last)) {
                (true, true) => {
                    refused(", whose first and last axis could both be channels; save the picture as PNG or EXR")
                }
                (false, true) => Ok(Self { rows: first, columns: middle, channels: last, is_planar: false }),
                (true, false) => Ok(Self { rows: middle, columns: last, channels: first, is_planar: true }),
                (false, false) => refused(EXPECTED),
            },
            _ => refused(EXPECTED),
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
    let invalid = |what: String| ImageError::invalid(path, what);
    let unsound = |Malformed(what)| invalid(what);
    let (file, data) = open(bytes).map_err(unsound)?;
    let layout = Layout::of(file.shape()).map_err(unsound)?;
    check_size(path, layout.columns, layout.rows)?;
    let numbers = numbers(file, data).map_err(unsound)?;
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

fn numbers(file: npyz::NpyFile<&[u8]>, data: &[u8]) -> Result<Numbers, Malformed> {
    check_order(&file)?;
    read_numbers!(file, data, "expected u1, u2, f2, f4 or f8; convert it with array.astype('f4')";
        u8 => Numbers::Bytes,
        u16 => Numbers::Words,
        f32 => Numbers::Floats,
        f64 => |values| Numbers::Floats(values.into_iter().map(|value| value as f32).collect()),
        npyz::half::f16 => |values| Numbers::Floats(values.into_iter().map(f32::from).collect()),
    )
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

    fn with_header(header: &str, data: &[u8]) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00".as_slice(), &length, header.as_bytes(), data].concat()
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
        let with_header = |header: &str| with_header(header, &[0; 16]);
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

    #[test]
    fn whole_numbers_of_any_width_come_back() {
        use npyz::Order::C;
        assert_eq!(whole_numbers(&npy(&[7_i64, -1, i64::MIN], &[3], C)).unwrap(), [7, -1, i64::MIN]);
        assert_eq!(whole_numbers(&npy(&[7_i32, -1, i32::MIN], &[3, 1], C)).unwrap(), [7, -1, i64::from(i32::MIN)]);
        assert_eq!(whole_numbers(&npy(&[7_i16, -1], &[1, 2], C)).unwrap(), [7, -1]);
        assert_eq!(whole_numbers(&npy(&[7_i8, -1], &[2], C)).unwrap(), [7, -1]);
        assert_eq!(whole_numbers(&npy(&[9_u8, 200], &[2], C)).unwrap(), [9, 200]);
        assert_eq!(whole_numbers(&npy(&[9_u16, 60_000], &[2], C)).unwrap(), [9, 60_000]);
        assert_eq!(whole_numbers(&npy(&[u64::MAX, 0], &[2], C)).unwrap(), [-1, 0]);
        assert!(whole_numbers(&npy::<i64>(&[], &[0], C)).unwrap().is_empty());
        let big = with_header("{'shape': (2,), 'fortran_order': False, 'descr': '>i2'}\n", &[0, 1, 0xff, 0xfe]);
        assert_eq!(whole_numbers(&big).unwrap(), [1, -2]);
    }

    /// In Fortran's order the numbers of two axes are stored differently; those of one axis are not.
    #[test]
    fn two_axes_are_refused_in_either_order() {
        for order in [npyz::Order::C, npyz::Order::Fortran] {
            let fault = whole_numbers(&npy(&[1_i64; 6], &[2, 3], order)).unwrap_err();
            assert_eq!(fault.to_string(), "an array of shape (2, 3); expected (N,), (N, 1) or (1, N)");
            assert_eq!(whole_numbers(&npy(&[5_i64, 6], &[2, 1], order)).unwrap(), [5, 6]);
        }
        for shape in [&[1, 1, 4][..], &[]] {
            whole_numbers(&npy(&[1_i64; 4][..shape.iter().product::<u64>() as usize], shape, npyz::Order::C))
                .unwrap_err();
        }
    }

    #[test]
    fn data_of_another_length_is_refused() {
        let mut bytes = npy(&[1_i64, 2], &[2], npyz::Order::C);
        let fault = |bytes: &[u8]| whole_numbers(bytes).unwrap_err().to_string();
        assert_eq!(fault(&bytes[..bytes.len() - 1]), "expected 16 bytes of numbers, found 15");
        bytes.push(0);
        assert_eq!(fault(&bytes), "expected 16 bytes of numbers, found 17");
    }

    #[test]
    fn other_headers_are_refused() {
        let plain = "{'descr': '<i8', 'fortran_order': False, 'shape': (1,), }";
        assert_eq!(whole_numbers(&with_header(plain, &[5, 0, 0, 0, 0, 0, 0, 0])).unwrap(), [5]);
        for (from, to) in [
            // The product exceeds 64 bits, which once caused a panic or a small number.
            ("(1,)", "(0xffffffffffffffff, 0xffff)"),
            ("(1,)", "(0b1,)"),
            ("(1,)", "(1_0,)"),
            ("(1,)", "(-1,)"),
            ("(1,)", "(1)"),
            ("(1,)", "(1 1,)"),
            ("(1,)", "(,)"),
            ("(1,)", "(18446744073709551616,)"),
            ("(1,)", "(18446744073709551615,)"),
            ("(1,)", "(4294967296, 4294967296)"),
            ("False", "0"),
            ("'<i8'", "[('a', '<i8')]"),
            ("'<i8'", "'<f8'"),
            ("'<i8'", "'<i16'"),
            ("'<i8'", "'\\x3ci8'"),
            ("'fortran_order': False, ", ""),
            ("'fortran_order'", "'descr'"),
            ("}", "} {}"),
            ("{", "{{"),
        ] {
            let changed = plain.replace(from, to);
            assert_ne!(changed, plain);
            whole_numbers(&with_header(&changed, &[5, 0, 0, 0, 0, 0, 0, 0])).unwrap_err();
        }
        whole_numbers(&with_header(&"[".repeat(4000), &[])).unwrap_err();
        let mut long = b"\x93NUMPY\x02\x00".to_vec();
        long.extend(&u32::MAX.to_le_bytes());
        assert!(whole_numbers(&long).unwrap_err().to_string().contains("header is 4294967295 bytes long"));
    }

    proptest! {
        #[test]
        fn no_bytes_cause_a_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..300), whole in any::<bool>()) {
            if whole {
                let sound = npy(&[1.0_f32; 24], &[2, 4, 3], npyz::Order::C);
                let noise = bytes.iter().chain(std::iter::repeat(&0));
                bytes = sound.iter().zip(noise).map(|(a, b)| a ^ (b & b >> 4)).collect();
            }
            let _ = (read(&bytes), whole_numbers(&bytes));
        }
    }
}
