//! Reads one-dimensional NumPy arrays of integers (`.npy`, versions 1 to 3).
//!
//! The header is checked before the library sees it, and the data must have exactly the length that follows from it.

use crate::npy_io::{self, MAX_HEADER_BYTES, MAX_PREFIX_BYTES, NpyHeaderError, joined};

/// The widest integer, in bytes.
const MAX_NUMBER_BYTES: usize = 8;

/// The size of the largest file of `count` numbers, in bytes.
pub fn max_bytes(count: usize) -> u64 {
    (MAX_PREFIX_BYTES + MAX_HEADER_BYTES + MAX_NUMBER_BYTES * count) as u64
}

/// Why bytes are not an array of integers along one axis.
#[derive(Debug, thiserror::Error)]
pub enum NpyError {
    /// The header is cut off, too long, or not that of a plain array.
    #[error(transparent)]
    Header(#[from] NpyHeaderError),
    #[error("expected a valid NumPy array: {reason}")]
    Unsound { reason: std::io::Error },
    #[error("an array of shape ({}); expected (N,), (N, 1) or (1, N)", joined(shape))]
    Shape { shape: Vec<u64> },
    #[error("an array of {found}; expected integers, as in '<i8'")]
    NotIntegers { found: String },
    #[error("expected {expected} bytes of numbers, found {found}")]
    Length { expected: u64, found: u64 },
}

/// The numbers of an array with at most one axis whose length is not 1: (N,), (N, 1) or (1, N). Numbers of 2^63 or more
/// wrap around to negative ones.
pub fn whole_numbers(bytes: &[u8]) -> Result<Vec<i64>, NpyError> {
    // The header, before and by the library.
    let data = npy_io::checked_data(bytes)?;
    let unsound = |reason| NpyError::Unsound { reason };
    let file = npyz::NpyFile::new(bytes).map_err(unsound)?;
    let count = length(file.shape())?;
    // The numbers, of whichever type.
    let found = file.dtype().descr();
    macro_rules! try_types {
        ($file:expr; $($number:ty),*) => {{
            let file = $file;
            $(let file = match file.try_data::<$number>() {
                Ok(numbers) => {
                    check_length(data.len(), count, size_of::<$number>())?;
                    let numbers = numbers.map(|number| number.map(|number| number as i64));
                    return numbers.collect::<Result<_, _>>().map_err(unsound);
                }
                Err(file) => file,
            };)*
            drop(file);
        }};
    }
    try_types!(file; i64, i32, i16, i8, u64, u32, u16, u8);
    Err(NpyError::NotIntegers { found })
}

/// The number of elements. With two long axes, their order would be ambiguous.
fn length(shape: &[u64]) -> Result<u64, NpyError> {
    match shape {
        [count] | [count, 1] | [1, count] => Ok(*count),
        _ => Err(NpyError::Shape { shape: shape.to_vec() }),
    }
}

/// Checks that the data has the length of `count` numbers of `width` bytes.
fn check_length(found: usize, count: u64, width: usize) -> Result<(), NpyError> {
    let (found, expected) = (found as u64, count * width as u64);
    if found == expected { Ok(()) } else { Err(NpyError::Length { expected, found }) }
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
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(&(header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
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
        let short = whole_numbers(&bytes[..bytes.len() - 1]);
        assert!(matches!(short, Err(NpyError::Length { expected: 16, found: 15 })), "{short:?}");
        bytes.push(0);
        let long = whole_numbers(&bytes);
        assert!(matches!(long, Err(NpyError::Length { expected: 16, found: 17 })), "{long:?}");
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
        assert!(matches!(
            whole_numbers(&long),
            Err(NpyError::Header(NpyHeaderError::LongHeader { found: 4_294_967_295, .. }))
        ));
    }

    proptest! {
        #[test]
        fn no_bytes_cause_a_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..300), whole in any::<bool>()) {
            if whole {
                let sound = npy(&[1_i64; 4], &[4], npyz::Order::C);
                let noise = bytes.iter().chain(std::iter::repeat(&0));
                bytes = sound.iter().zip(noise).map(|(a, b)| a ^ (b & b >> 4)).collect();
            }
            let _ = whole_numbers(&bytes);
        }
    }
}
