//! Input of unknown origin: files are read within limits, hashed, and named where they are something else than was
//! expected; texts are made fit for a message.
//!
//! Messages use [`quoted`], or [`shortened`] where they set quotes themselves or must show that the text was cut. Pages
//! and tables use [`shown`], which takes the length that they have room for.

use std::borrow::Cow;
use std::io::{Error, ErrorKind, Read as _};
use std::path::Path;

use sha2::{Digest as _, Sha256};

use crate::error::FileError;

/// The bytes of an ordinary file; fails where there are more than `most`. Anything else, such as `/dev/zero` or a pipe,
/// is not opened, since its length is unknown and may be endless.
pub fn read_at_most(path: &Path, most: u64) -> std::io::Result<Vec<u8>> {
    let data = std::fs::metadata(path)?;
    if data.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "it is a folder, expected a file"));
    }
    if !data.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "it is not an ordinary file"));
    }
    let mut bytes = Vec::new();
    // The file may grow while it is read.
    if data.len() <= most {
        std::fs::File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    }
    if data.len().max(bytes.len() as u64) > most {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("it has more than {most} bytes")));
    }
    Ok(bytes)
}

/// The byte order mark that some editors put before UTF-8.
const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";

/// Kinds of files that are found in place of others, by their first bytes: a name, and behind a semicolon what to do.
/// The first that matches counts.
const KINDS: [(&[u8], &str); 44] = [
    (b"version https://git-lfs.", "a Git LFS pointer in place of the file; run `git lfs pull` where it was cloned"),
    (b"\xff\xfe\0\0", "UTF-32 text; save it as UTF-8"),
    (b"\0\0\xfe\xff", "UTF-32 text; save it as UTF-8"),
    (b"\xff\xfe", "UTF-16 text; save it as UTF-8"),
    (b"\xfe\xff", "UTF-16 text; save it as UTF-8"),
    (b"PK\x03\x04", "a ZIP archive; unpack it"),
    (b"\x1f\x8b", "gzip data; unpack it"),
    (b"BZh", "bzip2 data; unpack it"),
    (b"\xfd7zXZ\0", "XZ data; unpack it"),
    (b"(\xb5/\xfd", "Zstandard data; unpack it (a .blend is compressed in this way too)"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive; unpack it"),
    (b"Rar!", "a RAR archive; unpack it"),
    (b"BLENDER", "a Blender file"),
    (b"Kaydara FBX Binary", "an FBX file"),
    (b"PXR-USDC", "a USD file, which MatEval does not read"),
    (b"#usda", "a USD file, which MatEval does not read"),
    (b"glTF", "a binary glTF"),
    (b"ply", "a PLY file"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"\x76\x2f\x31\x01", "an OpenEXR picture"),
    (b"#?RADIANCE", "a Radiance HDR picture"),
    (b"#?RGBE", "a Radiance HDR picture"),
    (b"GIF8", "a GIF picture; convert it to PNG"),
    (b"qoif", "a QOI picture; convert it to PNG"),
    (b"8BPS", "a Photoshop file; export it as PNG, or as OpenEXR if its numbers are floats"),
    (b"gimp xcf", "a GIMP file; export it as PNG, or as OpenEXR if its numbers are floats"),
    // Many raw formats of cameras, such as DNG, NEF and ARW, are TIFF.
    (b"II*\0", TIFF),
    (b"MM\0*", TIFF),
    (b"II+\0", TIFF),
    (b"MM\0+", TIFF),
    (b"\0\0\0\x0cjP  \r\n", "a JPEG 2000 picture; convert it to PNG"),
    (b"\xff\x4f\xff\x51", "a JPEG 2000 picture; convert it to PNG"),
    (b"\0\0\0\x0cJXL \r\n", JPEG_XL),
    (b"\xff\x0a", JPEG_XL),
    (b"\xabKTX 20\xbb", "a KTX2 texture; convert it with `gltf-transform ktxdecompress`, or to PNG"),
    (b"\xabKTX 11\xbb", "a KTX texture; convert it to PNG, or to OpenEXR if its numbers are floats"),
    (b"sB\x13\0", "a Basis Universal texture; convert it to PNG"),
    (b"\x13\xab\xa1\x5c", "an ASTC texture; convert it to PNG"),
    (b"DDS ", "a DDS texture; convert it to PNG, or to OpenEXR if its numbers are floats"),
    (b"\0\0\x02\0\0\0\0\0\0\0\0\0", TARGA),
    (b"\0\0\n\0\0\0\0\0\0\0\0\0", TARGA),
    (b"\x93NUMPY", "a NumPy array"),
    (b"%PDF", "a PDF"),
];

const TIFF: &str =
    "a TIFF picture (or a camera's raw file); convert it to PNG, or to OpenEXR if its numbers are floats";
const JPEG_XL: &str = "a JPEG XL picture; convert it to PNG, or to OpenEXR if its numbers are floats";
const TARGA: &str = "a Targa picture; convert it to PNG";

/// Kinds that begin with a length, by what follows it (ISO/IEC 14496-12).
const KINDS_BEHIND_LENGTH: [(&[u8], &str); 11] = [
    (b"ftypavif", "an AVIF picture; save it as PNG or JPEG"),
    (b"ftypavis", "an AVIF picture; save it as PNG or JPEG"),
    (b"ftypheic", HEIC),
    (b"ftypheix", HEIC),
    (b"ftypheim", HEIC),
    (b"ftypheis", HEIC),
    (b"ftyphevc", HEIC),
    (b"ftyphevx", HEIC),
    (b"ftypmif1", HEIC),
    (b"ftypmsf1", HEIC),
    (b"ftypcrx ", "a camera's raw file; develop it, and save it as PNG"),
];
const HEIC: &str = "a HEIC picture, as telephones write it; save it as PNG or JPEG";

/// How a web page begins, in lower case.
const WEB_PAGE: [&[u8]; 2] = [b"<!doctype html", b"<html"];

/// The kind of a file that cannot be read as what was expected, and what to do; `None` where its first bytes are those
/// of no kind that is often mistaken for another.
pub fn mistaken_for(bytes: &[u8]) -> Option<&'static str> {
    if bytes.is_empty() {
        return Some("an empty file");
    }
    let among = |kinds: &[(&[u8], &'static str)], bytes: &[u8]| {
        kinds.iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, kind)| *kind)
    };
    let known = among(&KINDS, bytes).or_else(|| among(&KINDS_BEHIND_LENGTH, bytes.get(4..)?));
    let known = known.or_else(|| {
        is_web_page(bytes).then_some("a web page in place of the file; a download probably asked to sign in")
    });
    let known = known.or(match bytes {
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some("a WebP picture"),
        // The four bytes behind the length are reserved; text has no zeros.
        [b'B', b'M', _, _, _, _, 0, 0, 0, 0, ..] => Some("a BMP picture"),
        _ => None,
    });
    // ASCII characters as UTF-16 without a mark: every second byte is 0.
    let is_utf16 = || bytes.len() >= 4 && (bytes[..2].contains(&0) && bytes[2..4].contains(&0) && bytes[..4] != [0; 4]);
    known.or_else(|| is_utf16().then_some("UTF-16 text; save it as UTF-8"))
}

/// The name of a kind that is often mistaken for another, without what to do: `a DDS texture`.
pub fn kind_name(bytes: &[u8]) -> Option<&'static str> {
    mistaken_for(bytes).map(|kind| kind.split_once(';').map_or(kind, |(name, _)| name))
}

fn is_web_page(bytes: &[u8]) -> bool {
    let bytes = without_mark(bytes).trim_ascii_start();
    WEB_PAGE.iter().any(|start| bytes.get(..start.len()).is_some_and(|found| found.eq_ignore_ascii_case(start)))
}

/// Whether the file is a Git LFS pointer, which no format of ours begins like.
pub fn is_lfs_pointer(bytes: &[u8]) -> bool {
    bytes.starts_with(KINDS[0].0)
}

/// The bytes without a UTF-8 byte order mark.
pub fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes)
}

/// A sentence's end that names the kind: `; it is a ZIP archive; unpack it`, or nothing.
pub fn hint(bytes: &[u8]) -> Cow<'static, str> {
    mistaken_for(bytes).map_or(Cow::Borrowed(""), |kind| Cow::Owned(format!("; it is {kind}")))
}

/// SHA-256 of bytes, hex.
pub fn sha256_of_bytes(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// SHA-256 of a file's bytes, hex.
pub fn sha256_of_file(path: &Path) -> Result<String, FileError> {
    let mut file = std::fs::File::open(path).map_err(FileError::io("read", path))?;
    let mut hash = Sha256::new();
    let mut block = vec![0; 1 << 16];
    loop {
        let length = file.read(&mut block).map_err(FileError::io("read", path))?;
        if length == 0 {
            return Ok(hex(&hash.finalize()));
        }
        hash.update(&block[..length]);
    }
}

/// Bytes in hexadecimal digits, as hashes are written.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The first 80 characters of untrusted text, with control characters escaped.
pub fn shortened(text: &str) -> String {
    let short: String = text.chars().take(80).collect::<String>().escape_debug().to_string();
    if text.chars().nth(80).is_some() { format!("{short}...") } else { short }
}

/// An untrusted text in quotes, without control characters and at most 80 characters long.
pub fn quoted(text: &str) -> String {
    format!("'{}'", text.chars().take(80).collect::<String>().escape_debug())
}

/// An untrusted name, made safe to print: one line of at most `most` characters, without characters that control a
/// terminal or reverse the direction of the text.
pub fn shown(name: &str, most: usize) -> String {
    let is_control = |c: char| {
        c.is_control()
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
            || (c as u32) & 0xfffe == 0xfffe
    };
    let whole: Vec<char> = name.chars().take(most + 1).map(|c| if is_control(c) { '\u{fffd}' } else { c }).collect();
    match whole.len() > most {
        true => whole[..most - 1].iter().collect::<String>() + "…",
        false => whole.into_iter().collect(),
    }
}

/// The message of a reader of JSON or TOML, with words for the Rust types that it expects: what the file's author must
/// write.
pub fn in_words(message: &str) -> String {
    const EXPECTED: &str = ", expected ";
    let Some(at) = message.rfind(EXPECTED).map(|at| at + EXPECTED.len()) else { return message.to_owned() };
    let (before, after) = message.split_at(at);
    // JSON's reader appends the place, that of TOML puts it first, above the line that it quotes.
    let (found, rest) = after.split_at(after.find(" at line ").or(after.find('\n')).unwrap_or(after.len()));
    let whole = |least: i128, most: u128| format!("a whole number from {least} to {most}");
    let words = match found {
        "u8" => whole(0, u8::MAX.into()),
        "u16" => whole(0, u16::MAX.into()),
        "u32" => whole(0, u32::MAX.into()),
        "u64" | "usize" => whole(0, u64::MAX.into()),
        "i32" => whole(i32::MIN.into(), i32::MAX as u128),
        "i64" => whole(i64::MIN.into(), i64::MAX as u128),
        "a nonzero u16" => whole(1, u16::MAX.into()),
        "a nonzero u32" => whole(1, u32::MAX.into()),
        "f32" | "f64" => "a number".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a sequence" => "a list".to_owned(),
        "unit" => "null".to_owned(),
        _ if ["a map", "struct ", "tuple struct "].iter().any(|start| found.starts_with(start)) => {
            if message.starts_with("TOML") { "a table" } else { "an object" }.to_owned()
        }
        _ => found.to_owned(),
    };
    format!("{before}{words}{rest}")
}

/// A name in lower case, letters and digits only: `Base-Color` becomes `basecolor`.
pub fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The candidate nearest to `name`, comparing letters and digits only. At most a third of its letters may differ.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = plain(name);
    let most = (wanted.chars().count() / 3).max(1);
    candidates
        .into_iter()
        .map(|candidate| (distance(&wanted, &plain(candidate)), candidate))
        .filter(|(distance, _)| *distance <= most)
        .min()
        .map(|(_, candidate)| candidate)
}

/// Letters of a name that [`distance`] compares, whose cost grows with their square.
const LONGEST: usize = 80;

/// The number of letters to insert, delete, change or exchange with their neighbour (optimal string alignment).
pub fn distance(a: &str, b: &str) -> usize {
    let [a, b] = [a, b].map(|text| text.chars().take(LONGEST).collect::<Vec<char>>());
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    for (i, j) in (0..=a.len()).flat_map(|i| (0..=b.len()).map(move |j| (i, j))) {
        if i == 0 || j == 0 {
            rows[i][j] = i + j;
            continue;
        }
        let changed = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
        let mut least = changed.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
        if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
            least = least.min(rows[i - 2][j - 2] + 1);
        }
        rows[i][j] = least;
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_cut() {
        assert_eq!(shortened("a\nb"), "a\\nb");
        assert_eq!(shortened(&"x".repeat(100)).len(), 83);
    }

    #[test]
    fn no_more_is_read_than_is_wanted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "abc").unwrap();
        assert_eq!(read_at_most(&path, 3).unwrap(), b"abc");
        assert_eq!(read_at_most(&path, 2).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read_at_most(folder.path(), 3).unwrap_err().kind(), ErrorKind::IsADirectory);
        assert_eq!(read_at_most(&folder.path().join("none"), 3).unwrap_err().kind(), ErrorKind::NotFound);
    }

    /// The system reports their length as 0.
    #[cfg(unix)]
    #[test]
    fn what_has_no_end_is_not_begun() {
        assert!(read_at_most(Path::new("/dev/zero"), 3).unwrap_err().to_string().contains("not an ordinary file"));
    }

    #[test]
    fn mistaken_files_are_named() {
        let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 3\n";
        assert!(is_lfs_pointer(pointer) && hint(pointer).contains("git lfs pull"));
        for (bytes, word) in [
            (b"\xff\xfe{\0}\0".as_slice(), "UTF-16"),
            (b"{\0\"\0", "UTF-16"),
            (b"\0{\0\"", "UTF-16"),
            (b"PK\x03\x04...", "ZIP"),
            (b"#usda 1.0", "USD"),
            (b"", "empty"),
            (b"<!DOCTYPE html>", "web page"),
            (b"\n<HTML lang='en'>", "web page"),
            (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", "HEIC"),
            (b"\0\0\0\x18ftypmif1", "HEIC"),
            (b"\0\0\0\x1cftypavif", "AVIF"),
            (b"II*\0\x08\0\0\0", "TIFF"),
            (b"MM\0*\0\0\0\x08", "TIFF"),
            (b"II+\0\x08\0\0\0", "TIFF"),
            (b"8BPS\0\x01", "Photoshop"),
            (b"RIFF\x24\0\0\0WEBPVP8L", "WebP"),
            (b"BM\x46\0\0\0\0\0\0\0\x36\0", "BMP"),
            (b"\xff\x0a\x7a\x1f", "JPEG XL"),
            (b"\0\0\0\x0cJXL \r\n\x87\n", "JPEG XL"),
            (b"\0\0\0\x0cjP  \r\n\x87\n", "JPEG 2000"),
            (b"\xabKTX 20\xbb\r\n\x1a\n", "KTX2"),
            (b"\xabKTX 11\xbb\r\n\x1a\n", "KTX texture"),
            (b"DDS |\0\0\0", "DDS"),
            (b"\0\0\x0a\0\0\0\0\0\0\0\0\0\x40\0", "Targa"),
        ] {
            assert!(mistaken_for(bytes).is_some_and(|kind| kind.contains(word)), "{word}");
        }
        // Twins: what the readers expect.
        for bytes in
            [b"{}".as_slice(), b"<scene version='3'/>", b"v 0 0 0\n", b"\xef\xbb\xbf{}", b"{", b"\0\0\0\0", b"<htm"]
        {
            assert_eq!(mistaken_for(bytes), None);
        }
        assert_eq!(kind_name(b"DDS |"), Some("a DDS texture"));
        assert_eq!((without_mark(b"\xef\xbb\xbf{}"), without_mark(b"{}")), (b"{}".as_slice(), b"{}".as_slice()));
    }

    #[test]
    fn readers_name_no_type_of_rust() {
        for (message, words) in [
            ("invalid type: string \"x\", expected u8 at line 1 column 9", "a whole number from 0 to 255 at line 1"),
            ("invalid value: integer `-1`, expected u32", "`-1`, expected a whole number from 0 to 4294967295"),
            ("invalid type: null, expected f64 at line 2 column 1", "expected a number at line 2"),
            ("TOML parse error at line 1, column 3\n\ninvalid type: integer `1`, expected struct Cost\n", "a table\n"),
            ("invalid type: integer `1`, expected struct Cost with 2 elements at line 1 column 1", "an object at line"),
            ("unknown field `a`, expected `u8` or `b`", "expected `u8` or `b`"),
            ("EOF while parsing a value at line 1 column 0", "EOF while"),
        ] {
            assert!(in_words(message).contains(words), "{}", in_words(message));
        }
    }

    #[test]
    fn distances_of_known_words() {
        for (a, b, expected) in [("kitten", "sitting", 3), ("", "abc", 3), ("ab", "ba", 1), ("same", "same", 0)] {
            assert_eq!((distance(a, b), distance(b, a)), (expected, expected), "{a} {b}");
        }
    }

    #[test]
    fn the_nearest_name_or_none() {
        let known = ["wall_paper", "table", "table-2", "rug"];
        assert_eq!(nearest("Wall-Paper", known), Some("wall_paper"));
        assert_eq!(nearest("tabel", known), Some("table"));
        assert_eq!(nearest("table2", known), Some("table-2"));
        assert_eq!(nearest("sofa", known), None);
    }
}
