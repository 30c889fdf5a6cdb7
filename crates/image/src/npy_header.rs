//! The header of a NumPy file, checked before the library parses it.
//!
//! The library takes memory for the header's stated length, recurses as deep as its brackets and multiplies the shape's
//! numbers unchecked. The header is therefore compared with what NumPy writes for a plain array before the library sees
//! it. Pickled objects and structured types have other headers and are refused here too.

/// The first bytes of a NumPy file.
pub const NPY_SIGNATURE: &[u8] = b"\x93NUMPY";
/// The largest header. NumPy's own are below 200 bytes.
pub const MAX_HEADER_BYTES: usize = 4096;
/// The most bytes before the header: magic string, version and the header's length.
pub const MAX_PREFIX_BYTES: usize = 12;
/// The most digits in a header. The product of any numbers that are written with 16 digits together, times the bytes of
/// one number, is below 10^17.
const MAX_HEADER_DIGITS: usize = 16;

/// Why the header of a NumPy file is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NpyHeaderError {
    /// The bytes end within the prefix or the header.
    #[error("expected a NumPy array, found {found} bytes, which end within the header")]
    CutOff {
        /// The number of bytes.
        found: usize,
    },
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
