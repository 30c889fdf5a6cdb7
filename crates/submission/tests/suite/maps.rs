//! The maps of untrusted submissions: malicious and broken pictures are read or refused within limits, and lint reports
//! the same bad texels that scoring replaces.

use std::cell::Cell;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use exr::prelude as ex;
use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::submission::{Map, instance_folder};
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_dataset::{Finding, Severity, TriangleMesh, glb};
use mateval_image::exr_io::{Precision, write_linear, write_scalar};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Picture, Texture, Wrap, png_io};
use mateval_submission::atlas::AtlasMeshes;
use mateval_submission::error::FileFault;
use mateval_submission::files::SubmittedFile;
use mateval_submission::lint::{LintPlan, lint};
use mateval_submission::map_file::{MapFile, decode};
use mateval_submission::prediction::{PredictedScene, read_scene};
use mateval_testkit::sample_dataset::photos;
use proptest::prelude::*;

use super::lint::{copy_public, write_truth};

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

fn room() -> &'static SceneFile {
    photos().scenes.iter().find(|scene| scene.id.as_str() == "room").unwrap()
}

/// `gt` with the maps of every instance of the room written as EXR, each texel `value(instance, x, y, side)` in all
/// channels where that is a number and the truth elsewhere.
fn planted(value: impl Fn(usize, usize, usize, usize) -> Option<f32>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_truth(&submission(&folder));
    for (at, instance) in room().instances.iter().enumerate().filter(|(_, instance)| instance.atlas.is_some()) {
        for map in Map::ALL {
            let png =
                instance_folder(&submission(&folder), &room().id, &instance.id).join(map.stem()).with_extension("png");
            let encoding = if map == Map::BaseColor { Encoding::Srgb } else { Encoding::Linear };
            let truth = read_texture(&png, encoding, Wrap::Clamp).unwrap();
            std::fs::remove_file(&png).unwrap();
            let (side, exr) = (truth.width(), png.with_extension("exr"));
            let texel = |x: usize, y: usize| value(at, x, y, side).map_or(truth.texel(x, y), |value| [value; 3]);
            if map == Map::BaseColor {
                let picture = Picture::from_fn(side, side, |x, y| LinearRgb(texel(x, y)));
                write_linear(&exr, &picture, Precision::Float).unwrap();
            } else {
                let picture = Picture::from_fn(side, side, |x, y| texel(x, y)[0]);
                write_scalar(&exr, &picture, Precision::Float).unwrap();
            }
        }
    }
    folder
}

fn submission(folder: &tempfile::TempDir) -> PathBuf {
    folder.path().join("gt")
}

fn read(submission: &Path) -> PredictedScene {
    read_scene(submission, room(), &AtlasMeshes::on_demand(photos(), room())).unwrap()
}

/// The texels of each atlas from which a lookup in a triangle is at most a texel away, by the rasteriser that bakes the
/// truth.
fn owners() -> Vec<Vec<bool>> {
    let nodes = glb::read(&photos().folder(&room().id).instances()).unwrap();
    let owned = |(node, side): (glb::GlbNode, usize)| {
        let atlas = UvAtlas::new(&node.mesh, side);
        (0..side * side).map(|at| atlas.owner(at % side, at / side).is_some()).collect()
    };
    let sides = room().instances.iter().map(|instance| instance.atlas.as_ref().map_or(1, |atlas| atlas.size as usize));
    nodes.into_iter().zip(sides).map(owned).collect()
}

fn bits(texture: &Texture, at: usize, side: usize) -> [u32; 3] {
    texture.texel(at % side % texture.width(), at / side % texture.height()).map(f32::to_bits)
}

/// Gutters of NaN and infinity, in every map: no finding, and what lies on the surfaces is read to the last bit.
#[test]
fn gutters_may_hold_anything() {
    let owners = owners();
    let near = |instance: usize, x: usize, y: usize, side: usize| {
        let around = |at: usize| at.saturating_sub(1)..(at + 2).min(side);
        around(y).any(|y| around(x).any(|x| owners[instance][y * side + x]))
    };
    let count = Cell::new(0);
    let value = |at: usize, x: usize, y: usize, side: usize| {
        let is_gutter = !near(at, x, y, side);
        count.set(count.get() + usize::from(is_gutter));
        is_gutter.then_some(if x.is_multiple_of(2) { f32::NAN } else { f32::INFINITY })
    };
    let [sound, damaged] = [read(&submission(&planted(|_, _, _, _| None))), read(&submission(&planted(value)))];
    assert_eq!(damaged.findings, Vec::new());
    assert!(count.get() > 10_000, "{} texels were changed", count.get());
    let mut counts = [0; 2];
    for (at, (sound, damaged)) in sound.materials.iter().zip(&damaged.materials).enumerate() {
        let (Some(sound), Some(damaged)) = (sound, damaged) else { continue };
        let side = room().instances[at].atlas.as_ref().unwrap().size as usize;
        for (texel, owned) in owners[at].iter().enumerate() {
            counts[usize::from(*owned)] += 1;
            let equal = |map: Map| bits(sound.texture(map), texel, side) == bits(damaged.texture(map), texel, side);
            assert!(!owned || Map::ALL.into_iter().all(equal), "{at} {texel}");
        }
    }
    assert!(counts.iter().all(|count| *count > 10_000), "{counts:?}");
}

/// Some bad texels everywhere, so that some maps keep theirs and none is sound.
fn sprinkled() -> tempfile::TempDir {
    planted(|at, x, y, _| (x * 31 + y * 17 + at).is_multiple_of(211).then_some(f32::NAN))
}

#[test]
fn lint_reports_what_scoring_reports() {
    let folder = sprinkled();
    let read = read(&submission(&folder));
    let scored: Vec<Finding> = read.findings.into_iter().filter(|finding| finding.code == "bad_texels").collect();
    assert!(scored.len() > 20 && scored.iter().all(|finding| finding.severity == Severity::Warning), "{scored:?}");
    let plan = LintPlan { dataset: photos(), submission: &submission(&folder), tool: "test".to_owned() };
    let file = lint(&plan, &|_| ()).unwrap();
    let folded = file.findings.iter().find(|finding| finding.code == "bad_texels").unwrap();
    let sorted = |mut all: Vec<Finding>| {
        all.sort();
        all
    };
    assert_eq!(sorted(folded.examples.clone()), sorted(scored));
}

#[test]
fn maps_are_the_same_for_any_number_of_threads() {
    let folder = sprinkled();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| read(&submission(&folder)))
    };
    let [one, several] = [with(1), with(5)];
    assert_eq!((one.scattering_key, one.findings), (several.scattering_key, several.findings));
    for (one, several) in one.materials.iter().zip(&several.materials) {
        let (Some(one), Some(several)) = (one, several) else { continue };
        assert!(Map::ALL.into_iter().all(|map| one.texture(map).bytes() == several.texture(map).bytes()));
    }
}

/// A changed `instances.glb` is an error for maps with bad texels, and unnecessary for sound ones.
#[test]
fn atlases_are_read_for_bad_texels_only() {
    let public = tempfile::tempdir().unwrap();
    copy_public(&photos().root, public.path());
    let opened = Dataset::open(public.path()).unwrap();
    std::fs::write(opened.folder(&room().id).instances(), "glTF").unwrap();
    let read =
        |folder: &tempfile::TempDir| read_scene(&submission(folder), room(), &AtlasMeshes::on_demand(&opened, room()));
    assert_eq!(read(&planted(|_, _, _, _| None)).unwrap().findings, Vec::new());
    assert!(read(&sprinkled()).unwrap_err().to_string().contains("instances.glb"));
}

/// A chunk of a PNG.
pub fn chunk(name: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let mut sum = flate2::Crc::new();
    sum.update(name);
    sum.update(data);
    [&(data.len() as u32).to_be_bytes()[..], name, data, &sum.sum().to_be_bytes()].concat()
}

/// Inserts a chunk after the header.
pub fn insert(path: &Path, name: &[u8; 4], data: &[u8]) {
    const HEADER_END: usize = 33;
    let bytes = std::fs::read(path).unwrap();
    let with = [&bytes[..HEADER_END], &chunk(name, data), &bytes[HEADER_END..]].concat();
    std::fs::write(path, with).unwrap();
}

/// A PNG of these rows of bytes, each preceded by its filter; `before` are chunks in front of the picture.
pub fn png(side: u32, depth: u8, color: u8, interlace: u8, before: &[u8], rows: &[u8]) -> Vec<u8> {
    let size = side.to_be_bytes();
    let header = [&size[..], &size, &[depth, color, 0, 0, interlace]].concat();
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(rows).unwrap();
    let packed = packed.finish().unwrap();
    let signature = b"\x89PNG\r\n\x1a\n";
    [&signature[..], &chunk(b"IHDR", &header), before, &chunk(b"IDAT", &packed), &chunk(b"IEND", b"")].concat()
}

/// `count` rows of `bytes` bytes each, without filters.
pub fn rows(count: usize, bytes: usize, value: impl Fn(usize, usize) -> u8) -> Vec<u8> {
    (0..count)
        .flat_map(|y| {
            std::iter::once(0).chain((0..bytes).map(move |x| (x, y)).map(|(x, y)| value(x, y)).collect::<Vec<_>>())
        })
        .collect()
}

/// A layer of 64x64 texels of these channels, all of `value`.
pub fn layer(names: &[&str], value: f32) -> ex::Layer<ex::AnyChannels<ex::FlatSamples>> {
    layer_of(names, || ex::FlatSamples::F32(vec![value; 64 * 64]))
}

/// The same with any type of numbers.
pub fn layer_of(names: &[&str], samples: impl Fn() -> ex::FlatSamples) -> ex::Layer<ex::AnyChannels<ex::FlatSamples>> {
    let channels = names.iter().map(|name| ex::AnyChannel::new(*name, samples())).collect();
    let encoding = ex::Encoding::SMALL_LOSSLESS;
    ex::Layer::new((64, 64), ex::LayerAttributes::default(), encoding, ex::AnyChannels::sort(channels))
}

/// Replaces a PNG by an EXR.
pub fn replace(png: &Path, write: impl FnOnce(&Path) -> Result<(), exr::error::Error>) {
    std::fs::remove_file(png).unwrap();
    write(&png.with_extension("exr")).unwrap();
}

/// The header of an OpenEXR file without data: deep or flat, with these channels and their sampling rates.
pub fn exr_header(side: i32, deep: bool, channels: &[(&str, i32)]) -> Vec<u8> {
    let attribute = |name: &str, kind: &str, value: &[u8]| {
        [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &(value.len() as i32).to_le_bytes(), value].concat()
    };
    let numbers = |values: &[i32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let channel = |(name, every): &(&str, i32)| {
        [name.as_bytes(), b"\0", &numbers(&[2]), &[0, 0, 0, 0], &numbers(&[*every, *every])].concat()
    };
    let list = [channels.iter().flat_map(channel).collect::<Vec<u8>>(), vec![0]].concat();
    let window = numbers(&[0, 0, side - 1, side - 1]);
    let mut bytes = [&[0x76, 0x2f, 0x31, 0x01][..], &numbers(&[if deep { 0x802 } else { 2 }])].concat();
    bytes.extend(attribute("channels", "chlist", &list));
    bytes.extend(attribute("compression", "compression", &[0]));
    bytes.extend(attribute("dataWindow", "box2i", &window));
    bytes.extend(attribute("displayWindow", "box2i", &window));
    bytes.extend(attribute("lineOrder", "lineOrder", &[0]));
    bytes.extend(attribute("pixelAspectRatio", "float", &floats(&[1.0])));
    bytes.extend(attribute("screenWindowCenter", "v2f", &floats(&[0.0, 0.0])));
    bytes.extend(attribute("screenWindowWidth", "float", &floats(&[1.0])));
    if deep {
        bytes.extend(attribute("name", "string", b"deep"));
        bytes.extend(attribute("type", "string", b"deepscanline"));
        bytes.extend(attribute("version", "int", &numbers(&[1])));
        bytes.extend(attribute("chunkCount", "int", &numbers(&[side])));
        bytes.extend(attribute("maxSamplesPerPixel", "int", &numbers(&[4])));
    }
    bytes.push(0);
    bytes
}
