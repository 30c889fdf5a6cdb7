//! A NumPy array of whole numbers along one axis (`.npy`, versions 1 to 3).
//!
//! The reader takes memory for the header's length, follows its brackets as deep as they go and multiplies the shape's
//! numbers unchecked. So a header is held against what NumPy writes for a plain array before it is interpreted; and a file
//! holds its numbers and no more.

/// Largest header: NumPy's own are below 200 bytes.
pub const MAX_HEADER_BYTES: usize = 4096;
/// Bytes before the header at most: magic word, version, its length.
pub const MAX_PREFIX_BYTES: usize = 12;
/// The widest whole number, in bytes.
pub const MAX_NUMBER_BYTES: usize = 8;
/// Most digits in a header: so few that the product of any numbers written with them, times a width, is below 10^17.
const MAX_HEADER_DIGITS: usize = 16;

/// The numbers of an array with at most one axis that is not 1: (N,), (N, 1) or (1, N). Those above 2^63 come back as
/// their negative complements. In words what is wrong with any other.
pub fn whole_numbers(bytes: &[u8]) -> Result<Vec<i64>, String> {
    let (header, data) = split(bytes)?;
    if !is_plain(header) {
        return Err("its header is none that NumPy writes for an array of whole numbers".to_owned());
    }
    let file = npyz::NpyFile::new(bytes).map_err(|error| format!("no sound NumPy array: {error}"))?;
    let count = length(file.shape())?;
    let descr = file.dtype().descr();
    macro_rules! try_types {
        ($file:expr; $($number:ty),*) => {{
            let file = $file;
            $(let file = match file.try_data::<$number>() {
                Ok(numbers) => {
                    check_length(data.len(), count, size_of::<$number>())?;
                    let numbers = numbers.map(|number| number.map(|number| number as i64));
                    return numbers.collect::<Result<_, _>>().map_err(|error| format!("it ends early: {error}"));
                }
                Err(file) => file,
            };)*
            drop(file);
        }};
    }
    try_types!(file; i64, i32, i16, i8, u64, u32, u16, u8);
    Err(format!("an array of {descr}; expected whole numbers, as in '<i8'"))
}

/// The header's text and what follows it.
fn split(bytes: &[u8]) -> Result<(&[u8], &[u8]), String> {
    let cut_off = || "no NumPy array: it is too short".to_owned();
    let from = if bytes.get(6) == Some(&1) { 10 } else { MAX_PREFIX_BYTES };
    let length = bytes.get(8..from).ok_or_else(cut_off)?;
    let length = length.iter().rev().fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte));
    if length > MAX_HEADER_BYTES {
        return Err(format!("its header is {length} bytes long; expected at most {MAX_HEADER_BYTES}"));
    }
    bytes[from..].split_at_checked(length).ok_or_else(|| "no NumPy array: its header is cut off".to_owned())
}

/// Whether it is one dictionary with one tuple of decimal numbers, without escapes, lists and large numbers.
fn is_plain(header: &[u8]) -> bool {
    let count = |bytes: &[u8]| header.iter().filter(|byte| bytes.contains(byte)).count();
    let digits = header.iter().filter(|byte| byte.is_ascii_digit()).count();
    let shape = header.split(|byte| *byte == b'(').nth(1).and_then(|rest| rest.split(|byte| *byte == b')').next());
    let is_decimal = |shape: &[u8]| shape.iter().all(|byte| byte.is_ascii_digit() || b", ".contains(byte));
    count(b"{") == 1
        && count(b"(") == 1
        && count(b"[\\") == 0
        && digits <= MAX_HEADER_DIGITS
        && shape.is_some_and(is_decimal)
}

/// The length of its one axis that is not 1. With two of them the order of the numbers would be anybody's guess.
fn length(shape: &[u64]) -> Result<u64, String> {
    match shape {
        [count] | [count, 1] | [1, count] => Ok(*count),
        _ => {
            let axes: Vec<String> = shape.iter().map(u64::to_string).collect();
            Err(format!("an array of shape ({}); expected (N,), (N, 1) or (1, N)", axes.join(", ")))
        }
    }
}

/// There are as many bytes as the numbers take.
fn check_length(found: usize, count: u64, width: usize) -> Result<(), String> {
    let (found, expected) = (found as u64, count * width as u64);
    match found.checked_sub(expected) {
        None => Err(format!("it ends early: {found} bytes of numbers, expected {expected}")),
        Some(0) => Ok(()),
        Some(behind) => Err(format!("{behind} bytes behind its numbers, expected none")),
    }
}

#[cfg(test)]
mod tests {
    use npyz::WriterBuilder as _;
    use proptest::prelude::*;

    use super::*;

    /// As another program writes it.
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

    /// In Fortran's order the numbers of two axes lie otherwise; of one axis there is no other order.
    #[test]
    fn two_axes_are_refused_in_either_order() {
        for order in [npyz::Order::C, npyz::Order::Fortran] {
            let fault = whole_numbers(&npy(&[1_i64; 6], &[2, 3], order)).unwrap_err();
            assert_eq!(fault, "an array of shape (2, 3); expected (N,), (N, 1) or (1, N)");
            assert_eq!(whole_numbers(&npy(&[5_i64, 6], &[2, 1], order)).unwrap(), [5, 6]);
        }
        for shape in [&[1, 1, 4][..], &[]] {
            whole_numbers(&npy(&[1_i64; 4][..shape.iter().product::<u64>() as usize], shape, npyz::Order::C))
                .unwrap_err();
        }
    }

    #[test]
    fn a_file_holds_its_numbers_and_no_more() {
        let mut bytes = npy(&[1_i64, 2], &[2], npyz::Order::C);
        assert!(whole_numbers(&bytes[..bytes.len() - 1]).unwrap_err().contains("it ends early"));
        bytes.push(0);
        assert_eq!(whole_numbers(&bytes).unwrap_err(), "1 bytes behind its numbers, expected none");
    }

    #[test]
    fn other_headers_are_refused() {
        let plain = "{'descr': '<i8', 'fortran_order': False, 'shape': (1,), }";
        assert_eq!(whole_numbers(&with_header(plain, &[5, 0, 0, 0, 0, 0, 0, 0])).unwrap(), [5]);
        for (from, to) in [
            // Once multiplied beyond 64 bits: a panic, or a small number.
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
        assert!(whole_numbers(&long).unwrap_err().contains("4294967295 bytes long"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_an_answer(mut bytes in prop::collection::vec(any::<u8>(), 0..300), whole in any::<bool>()) {
            if whole {
                let sound = npy(&[1_i64; 4], &[4], npyz::Order::C);
                let noise = bytes.iter().chain(std::iter::repeat(&0));
                bytes = sound.iter().zip(noise).map(|(a, b)| a ^ (b & b >> 4)).collect();
            }
            let _ = whole_numbers(&bytes);
        }
    }
}
