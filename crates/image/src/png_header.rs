//! The header of a PNG and the names of its chunks, read without decoding pixels.

use std::collections::BTreeSet;

/// The first bytes of a PNG.
pub const PNG_SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// The header's colour type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PngColor {
    /// Grey.
    Grey,
    /// Red, green, blue.
    Rgb,
    /// Indices into a palette.
    Palette,
    /// Grey with opacity.
    GreyAlpha,
    /// Red, green, blue with opacity.
    Rgba,
}

impl PngColor {
    /// The name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grey => "grey",
            Self::Rgb => "RGB",
            Self::Palette => "palette",
            Self::GreyAlpha => "grey with alpha",
            Self::Rgba => "RGB with alpha",
        }
    }
}

/// Why the header of a PNG cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PngHeaderError {
    /// The first bytes are not [`PNG_SIGNATURE`].
    #[error("it does not begin with the signature of a PNG")]
    NoSignature,
    /// The first chunk is another one, or cut.
    #[error("its first chunk is not a whole header (IHDR)")]
    NoHeader,
    /// The header is too short or too long.
    #[error("its header has {found} bytes; expected 13")]
    HeaderLength {
        /// How long it is.
        found: usize,
    },
    /// A colour type that PNG does not have.
    #[error("its colour type is {found}; expected 0, 2, 3, 4 or 6")]
    ColorType {
        /// The colour type.
        found: u8,
    },
}

/// The header of a PNG, and the names of its chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PngHeader {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bits a sample: 1, 2, 4, 8 or 16.
    pub bit_depth: u8,
    /// The colour type.
    pub color: PngColor,
    /// Whether rows are interlaced (Adam7).
    pub interlaced: bool,
    /// The names of all chunks.
    pub chunks: BTreeSet<[u8; 4]>,
    /// Whether the closing chunk (IEND) exists.
    pub ended: bool,
    /// Bytes behind the closing chunk.
    pub trailing_bytes: usize,
}

impl PngHeader {
    /// Reads the header and walks over the other chunks. Fails where the first chunk is not a valid header.
    pub fn of(bytes: &[u8]) -> Result<Self, PngHeaderError> {
        let Some(rest) = bytes.strip_prefix(PNG_SIGNATURE) else {
            return Err(PngHeaderError::NoSignature);
        };
        let mut chunks = Chunks { rest };
        let Some((b"IHDR", data)) = chunks.next() else {
            return Err(PngHeaderError::NoHeader);
        };
        let mut header = Self::of_data(data)?;
        for (name, _) in chunks.by_ref() {
            header.chunks.insert(*name);
            if name == b"IEND" {
                header.ended = true;
                break;
            }
        }
        header.trailing_bytes = if header.ended { chunks.rest.len() } else { 0 };
        Ok(header)
    }

    fn of_data(data: &[u8]) -> Result<Self, PngHeaderError> {
        let (size, &[bit_depth, color, _, _, interlace]) = data
            .split_first_chunk::<8>()
            .and_then(|(size, rest)| Some((size, <&[u8; 5]>::try_from(rest).ok()?)))
            .ok_or(PngHeaderError::HeaderLength { found: data.len() })?;
        let side = |at: usize| u32::from_be_bytes([size[at], size[at + 1], size[at + 2], size[at + 3]]);
        let color = match color {
            0 => PngColor::Grey,
            2 => PngColor::Rgb,
            3 => PngColor::Palette,
            4 => PngColor::GreyAlpha,
            6 => PngColor::Rgba,
            found => return Err(PngHeaderError::ColorType { found }),
        };
        Ok(Self {
            width: side(0),
            height: side(4),
            bit_depth,
            color,
            interlaced: interlace != 0,
            chunks: BTreeSet::new(),
            ended: false,
            trailing_bytes: 0,
        })
    }

    /// Whether the file has a chunk with this name, as in `iCCP`.
    pub fn has(&self, chunk: &[u8; 4]) -> bool {
        self.chunks.contains(chunk)
    }
}

/// Iterates over the names and data of chunks; ends at the first chunk that is cut off.
struct Chunks<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Chunks<'a> {
    type Item = (&'a [u8; 4], &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let (length, rest) = self.rest.split_first_chunk::<4>()?;
        let (name, rest) = rest.split_first_chunk::<4>()?;
        let (data, rest) = rest.split_at_checked(u32::from_be_bytes(*length) as usize)?;
        let (_, rest) = rest.split_first_chunk::<4>()?;
        self.rest = rest;
        Some((name, data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Picture, png_io};

    fn written() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        png_io::write_rgba_bytes(&path, &Picture::filled(5, 3, [1; 4])).unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn the_header_of_a_written_picture() {
        let header = PngHeader::of(&written()).unwrap();
        assert_eq!((header.width, header.height, header.bit_depth, header.color), (5, 3, 8, PngColor::Rgba));
        assert!(header.ended && header.has(b"IDAT") && !header.has(b"gAMA") && !header.interlaced);
        assert_eq!(header.trailing_bytes, 0);
    }

    #[test]
    fn what_is_cut_has_no_end_and_what_follows_is_counted() {
        let mut bytes = written();
        for length in 33..bytes.len() - 1 {
            assert!(!PngHeader::of(&bytes[..length]).unwrap().ended, "{length}");
        }
        for length in 0..33 {
            assert!(PngHeader::of(&bytes[..length]).is_err(), "{length}");
        }
        bytes.extend(b"more");
        assert_eq!(PngHeader::of(&bytes).unwrap().trailing_bytes, 4);
    }
}
