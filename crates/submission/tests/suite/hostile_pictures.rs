//! Malicious and broken pictures, read as a submission's maps: each is read or refused within limits.

use std::path::Path;

use mateval_image::exr_io::{Precision, write_linear, write_scalar};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::TriangleMesh;
use mateval_scene::submission::Map;
use mateval_submission::file_fault::FileFault;
use mateval_submission::map_file::{MapFile, decode};
use mateval_submission::submitted_file::SubmittedFile;
use proptest::prelude::*;

use super::lint::written::{chunk, exr_header, png, rows};

/// Decodes a map of an instance whose atlas has no uv, so that every texel counts.
fn decoded(file: SubmittedFile, map: Map) -> Result<MapFile, FileFault> {
    let atlas = TriangleMesh::default();
    decode(file, map, || Ok(&atlas)).unwrap()
}

fn read_png(bytes: &[u8]) -> Result<MapFile, FileFault> {
    decoded(SubmittedFile::from_bytes(Path::new(""), Path::new("a.png"), bytes.to_vec()), Map::Roughness)
}

fn read_exr(bytes: &[u8]) -> Result<MapFile, FileFault> {
    decoded(SubmittedFile::from_bytes(Path::new(""), Path::new("a.exr"), bytes.to_vec()), Map::BaseColor)
}

#[track_caller]
fn code(read: Result<MapFile, FileFault>) -> &'static str {
    read.map(|file| file.sha256).unwrap_err().code
}

/// A sound PNG of 8 or 16 bits, and a sound EXR.
fn sound() -> [Vec<u8>; 3] {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let ramp = Picture::from_fn(64, 64, |x, y| (x * y) as u16);
    png_io::write_ids(&path, &ramp).unwrap();
    let words = std::fs::read(&path).unwrap();
    png_io::write_grey_bytes(&path, &ramp.map(|value| value as u8)).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    write_linear(&path, &ramp.map(|value| LinearRgb([f32::from(value) / 4096.0; 3])), Precision::Half).unwrap();
    [bytes, words, std::fs::read(&path).unwrap()]
}

/// The twin of all tests below.
#[test]
fn sound_pictures_are_read() {
    let [bytes, words, exr] = sound();
    assert_eq!(read_png(&bytes).unwrap().texture.texel(3, 5), [15.0 / 255.0; 3]);
    assert_eq!(read_png(&words).unwrap().texture.texel(3, 5), [15.0 / 65535.0; 3]);
    assert_eq!(read_exr(&exr).unwrap().texture.texel(64 - 1, 2), [126.0 / 4096.0; 3]);
}

/// For any size that a header states, no memory is taken before it is checked.
#[test]
fn sizes_are_checked_before_anything_is_decoded() {
    for side in [4097, 100_000, u32::MAX] {
        assert_eq!(code(read_png(&png(side, 16, 6, 0, b"", b""))), "too_many_texels", "{side}");
    }
    for side in [4097, 100_000, i32::MAX / 2] {
        let header = exr_header(side, false, &[("B", 1), ("G", 1), ("R", 1)]);
        assert!(matches!(code(read_exr(&header)), "too_many_texels" | "bad_header"), "{side}");
    }
    // The largest allowed size, and no data after the header.
    assert!(matches!(code(read_png(&png(4096, 8, 0, 0, b"", b""))), "unreadable_picture"));
    assert!(read_exr(&exr_header(4096, false, &[("B", 1), ("G", 1), ("R", 1)])).is_err());
}

/// Zeros that unpack to a thousand times their size: as texels beyond the picture, as a profile, as text.
#[test]
fn packed_data_beside_the_texels_is_skipped() {
    let zeros = |before: &[u8]| {
        let mut packed = flate2::write::ZlibEncoder::new(before.to_vec(), flate2::Compression::default());
        std::io::Write::write_all(&mut packed, &vec![0; 256 << 20]).unwrap();
        packed.finish().unwrap()
    };
    let texels = rows(64, 64, |x, _| x as u8);
    for (name, start) in [(b"iCCP", &b"mine\0\0"[..]), (b"zTXt", b"mine\0\0"), (b"iTXt", b"mine\0\x01\0\0\0")] {
        let file = read_png(&png(64, 8, 0, 0, &chunk(name, &zeros(start)), &texels)).unwrap();
        assert_eq!(file.texture.texel(9, 9), [9.0 / 255.0; 3]);
    }
    // More rows than the picture has: read or refused, but not unpacked into memory.
    let _ = read_png(&png(64, 8, 0, 0, b"", &vec![0; 256 << 20]));
}

#[test]
fn every_depth_kind_and_order_that_png_has() {
    let palette = chunk(b"PLTE", &(0..=255).flat_map(|k| [k, k, k]).collect::<Vec<u8>>());
    for (depth, color, samples) in [
        (1, 0, 1),
        (2, 0, 1),
        (4, 0, 1),
        (8, 0, 1),
        (16, 0, 1),
        (8, 2, 3),
        (16, 2, 3),
        (8, 4, 2),
        (16, 4, 2),
        (8, 6, 4),
        (16, 6, 4),
        (1, 3, 1),
        (2, 3, 1),
        (4, 3, 1),
        (8, 3, 1),
    ] {
        let before = if color == 3 { &palette[..] } else { b"" };
        let bytes = |side: usize| (side * samples * depth).div_ceil(8);
        let plain = rows(64, bytes(64), |_, _| 0xff);
        let passes = [(8, 8), (8, 8), (8, 16), (16, 16), (16, 32), (32, 32), (32, 64)];
        let interlaced: Vec<u8> =
            passes.iter().flat_map(|(height, width)| rows(*height, bytes(*width), |_, _| 0xff)).collect();
        for (interlace, texels) in [(0, plain), (1, interlaced)] {
            let file = read_png(&png(64, depth as u8, color, interlace, before, &texels)).unwrap();
            let largest = if color == 3 { f32::from((1_u16 << depth) - 1) / 255.0 } else { 1.0 };
            for (x, y) in [(0, 0), (1, 0), (63, 63), (5, 40)] {
                assert_eq!(file.texture.texel(x, y), [largest; 3], "{depth} {color} {interlace}");
            }
        }
    }
    // Kinds that do not exist.
    for (depth, color) in [(8, 1), (8, 5), (3, 0), (16, 3), (4, 2)] {
        assert!(read_png(&png(64, depth, color, 0, &palette, &rows(64, 64, |_, _| 0))).is_err(), "{depth} {color}");
    }
}

#[test]
fn truncated_pictures_are_refused_at_every_length() {
    let [bytes, words, exr] = sound();
    for png in [bytes, words] {
        for length in 0..png.len() {
            let code = code(read_png(&png[..length]));
            assert!(matches!(code, "empty_file" | "bad_header" | "truncated_picture"), "{length}: {code}");
        }
    }
    for length in (0..exr.len() - 1).step_by(3) {
        assert!(read_exr(&exr[..length]).is_err(), "{length}");
    }
}

#[test]
fn numbers_that_are_not_finite_or_out_of_range() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for (value, expected) in [(f32::NAN, "nan"), (f32::NEG_INFINITY, "infinity"), (-1e-3, "out_of_range")] {
        let read = |is_bad: fn(usize, usize) -> bool| {
            let picture = Picture::from_fn(64, 64, |x, y| if is_bad(x, y) { value } else { 0.5 });
            write_scalar(&path, &picture, Precision::Float).unwrap();
            decoded(SubmittedFile::read(folder.path(), &path, 1 << 20).unwrap(), Map::Metallic)
        };
        let fault = read(|x, y| x == 7 && y >= 9).unwrap_err();
        assert_eq!((fault.code, fault.place.as_str()), (expected, "texel (7, 9)"));
        let file = read(|x, y| (x, y) == (7, 9)).unwrap();
        assert_eq!(file.bad_texels.map(|fault| fault.place).as_deref(), Some("texel (7, 9)"));
        assert_eq!(file.texture.texel(7, 9), [0.5; 3]);
    }
}

proptest! {
    /// Any change of a sound file is read or refused.
    #[test]
    fn any_change_has_an_answer(
        which in 0_usize..3,
        places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        let mut bytes = sound()[which].clone();
        for (at, value) in places {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        let read = if which == 2 { read_exr(&bytes) } else { read_png(&bytes) };
        if let Ok(file) = read {
            let finite = |at: usize| file.texture.texel(at % 64, at / 64).iter().all(|value| value.is_finite());
            prop_assert!((0..64 * 64).all(finite));
        }
    }
}
