//! Valid and invalid archives, and a photo of a telephone, written byte by byte.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::files_below;

/// A file in a zip: its packed bytes, and what the central directory states of it.
#[derive(Clone)]
pub struct ZipEntry {
    pub name: Vec<u8>,
    /// Its bytes as they are stored.
    pub data: Vec<u8>,
    /// 0 for stored, 8 for deflated.
    pub method: u16,
    /// General purpose bits; 1 for encrypted.
    pub flags: u16,
    /// Unix mode, in the upper half of the attributes.
    pub mode: u32,
    /// The stated size once unpacked.
    pub size: u64,
    /// The stated CRC-32.
    pub checksum: u32,
    /// Its comment in the central directory.
    pub comment: Vec<u8>,
    /// The entry whose data it points to; none for data of its own.
    pub shares: Option<usize>,
}

/// A grey JPEG of 16 by 8 pixels, as telephones write it: its EXIF data states orientation 6, a turn by 90 degrees.
pub fn turned_jpeg() -> Vec<u8> {
    let mut jpeg = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new(&mut jpeg);
    image::ImageEncoder::write_image(encoder, &[90; 16 * 8 * 3], 16, 8, image::ExtendedColorType::Rgb8).unwrap();
    // APP1 with a little-endian TIFF header and one entry: tag 0x0112, type SHORT, count 1, value 6.
    let tiff = [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0".as_slice(), &[0; 4]].concat();
    let length = u16::try_from(2 + 6 + tiff.len()).unwrap().to_be_bytes();
    jpeg.splice(2..2, [&[0xff, 0xe1][..], &length, b"Exif\0\0", &tiff].concat());
    jpeg
}

/// The same JPEG without EXIF data.
pub fn upright_jpeg() -> Vec<u8> {
    let mut jpeg = turned_jpeg();
    let length = 2 + usize::from(u16::from_be_bytes([jpeg[4], jpeg[5]]));
    jpeg.drain(2..2 + length);
    jpeg
}

/// The checksum of zip and gzip.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut sum = flate2::Crc::new();
    sum.update(bytes);
    sum.sum()
}

impl ZipEntry {
    /// A deflated file.
    pub fn new(name: &str, bytes: &[u8]) -> Self {
        let mut packed = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
        packed.write_all(bytes).unwrap();
        Self {
            name: name.into(),
            data: packed.finish().unwrap(),
            method: 8,
            flags: 0,
            mode: 0o100_644,
            size: bytes.len() as u64,
            checksum: crc32(bytes),
            comment: Vec::new(),
            shares: None,
        }
    }

    /// A stored file.
    pub fn stored(name: &str, bytes: &[u8]) -> Self {
        Self { data: bytes.into(), method: 0, ..Self::new(name, bytes) }
    }
}

/// A zip of these entries, with Zip64 sizes where they need them.
pub fn zip(entries: &[ZipEntry], comment: &[u8]) -> Vec<u8> {
    let (mut bytes, mut offsets) = (Vec::new(), Vec::new());
    for entry in entries {
        if let Some(other) = entry.shares {
            offsets.push(offsets[other]);
            continue;
        }
        offsets.push(bytes.len());
        bytes.extend(b"PK\x03\x04");
        bytes.extend(numbers(&[20, entry.flags, entry.method, 0, 0]));
        bytes.extend(entry.checksum.to_le_bytes());
        bytes.extend((entry.data.len() as u32).to_le_bytes());
        bytes.extend((entry.size.min(u64::from(u32::MAX)) as u32).to_le_bytes());
        bytes.extend(numbers(&[entry.name.len() as u16, 0]));
        bytes.extend(&entry.name);
        bytes.extend(&entry.data);
    }
    let start = bytes.len();
    for (entry, offset) in entries.iter().zip(&offsets) {
        let data = entry.shares.map_or(&entry.data, |other| &entries[other].data);
        let long = entry.size >= u64::from(u32::MAX);
        let extra = if long { [&[1, 0, 8, 0][..], &entry.size.to_le_bytes()].concat() } else { Vec::new() };
        bytes.extend(b"PK\x01\x02");
        bytes.extend(numbers(&[3 << 8 | 20, 20, entry.flags, entry.method, 0, 0]));
        bytes.extend(entry.checksum.to_le_bytes());
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend((if long { u32::MAX } else { entry.size as u32 }).to_le_bytes());
        bytes.extend(numbers(&[entry.name.len() as u16, extra.len() as u16, entry.comment.len() as u16, 0, 0]));
        bytes.extend((entry.mode << 16).to_le_bytes());
        bytes.extend((*offset as u32).to_le_bytes());
        bytes.extend([&entry.name[..], &extra, &entry.comment].concat());
    }
    let length = bytes.len() - start;
    bytes.extend(end(entries.len() as u16, length as u32, start as u32, comment));
    bytes
}

/// The end record.
pub fn end(count: u16, size: u32, offset: u32, comment: &[u8]) -> Vec<u8> {
    let mut bytes = b"PK\x05\x06".to_vec();
    bytes.extend(numbers(&[0, 0, count, count]));
    bytes.extend(size.to_le_bytes());
    bytes.extend(offset.to_le_bytes());
    bytes.extend(numbers(&[comment.len() as u16]));
    bytes.extend(comment);
    bytes
}

fn numbers(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// The header of a tar entry. `size` need not be the size of what follows.
pub fn tar_header(name: &str, kind: u8, size: u64) -> Vec<u8> {
    let mut block = vec![0; 512];
    block[..name.len()].copy_from_slice(name.as_bytes());
    block[100..108].copy_from_slice(b"0000644\0");
    block[124..136].copy_from_slice(format!("{size:011o}\0").as_bytes());
    block[156] = kind;
    block[257..265].copy_from_slice(b"ustar\x0000");
    block[148..156].fill(b' ');
    let sum: u32 = block.iter().map(|byte| u32::from(*byte)).sum();
    block[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    block
}

/// An entry with header and data.
pub fn tar_entry(name: &str, kind: u8, bytes: &[u8]) -> Vec<u8> {
    let padding = (512 - bytes.len() % 512) % 512;
    [&tar_header(name, kind, bytes.len() as u64)[..], bytes, &vec![0; padding]].concat()
}

/// One gzip member; several in a row are read as one stream.
pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed.write_all(bytes).unwrap();
    packed.finish().unwrap()
}

/// The relative names and the bytes of all files in a folder, sorted.
pub fn files(root: &Path) -> Vec<(String, Vec<u8>)> {
    let entry = |file: PathBuf| (file.to_str().unwrap().to_owned(), std::fs::read(root.join(&file)).unwrap());
    let mut found: Vec<_> = files_below(root).into_iter().map(entry).collect();
    found.sort();
    found
}

/// A submission's folder as a zip, below `prefix`.
pub fn zipped(root: &Path, prefix: &str) -> Vec<u8> {
    let entries: Vec<ZipEntry> =
        files(root).iter().map(|(name, bytes)| ZipEntry::new(&format!("{prefix}{name}"), bytes)).collect();
    zip(&entries, b"a comment")
}

/// A submission's folder as a tar in gzip, below `prefix`.
pub fn tarred(root: &Path, prefix: &str) -> Vec<u8> {
    let entries = files(root).into_iter().map(|(name, bytes)| tar_entry(&format!("{prefix}{name}"), b'0', &bytes));
    gzip(&[entries.collect::<Vec<_>>().concat(), vec![0; 1024]].concat())
}
