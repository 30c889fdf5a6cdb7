//! `eval lint` on the sample: the good submission is clean, and every planted fault is found by its own code, with no
//! other error and no other warning.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use exr::prelude as ex;
use exr::prelude::traits::*;
use mateval_dataset::Severity;
use mateval_image::exr_io::{self, Precision};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::transfer::{linear_from_srgb, srgb_from_linear};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_submission::lint::{LintFile, LintPlan, lint};
use mateval_testkit::sample_dataset::{bounds, photos, write_from_photo, write_nearest};

use super::maps::{chunk, exr_header, insert, layer, layer_of, png, replace, rows};

/// A code, its severity, and the change of a good submission.
type Fault = (&'static str, Severity, fn(&Path));

const ERROR: Severity = Severity::Error;
const WARNING: Severity = Severity::Warning;
const NOTE: Severity = Severity::Note;

/// The map for faults that need only one: textured, and visible in the input view.
fn map(submission: &Path, name: &str) -> PathBuf {
    submission.join("scenes/room/rug").join(name)
}

/// All maps with this name.
fn every(submission: &Path, name: &str) -> Vec<PathBuf> {
    let scenes = ["living", "room"].map(|scene| submission.join("scenes").join(scene));
    let instances = scenes.iter().flat_map(|scene| std::fs::read_dir(scene).unwrap());
    let files: Vec<PathBuf> = instances.map(|entry| entry.unwrap().path().join(name)).collect();
    assert!(files.len() > 20 && files.iter().all(|file| file.is_file()));
    files
}

/// Writes the submission `gt`.
pub fn write_truth(out: &Path) {
    bounds::write_truth(photos(), out, false).unwrap();
}

fn good() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_truth(&folder.path().join("gt"));
    folder
}

fn linted(submission: &Path) -> LintFile {
    let plan = LintPlan { dataset: photos(), submission, tool: "test".to_owned() };
    lint(&plan, &|_| ()).unwrap()
}

fn codes(file: &LintFile, severity: Severity) -> BTreeSet<String> {
    let of_severity = file.findings.iter().filter(|finding| finding.severity == severity);
    of_severity.map(|finding| finding.code.clone()).collect()
}

#[test]
fn the_good_submission_is_clean() {
    let folder = good();
    let file = linted(&folder.path().join("gt"));
    assert!(file.good && file.maps > 60, "{file:?}");
    assert_eq!((codes(&file, ERROR), codes(&file, WARNING)), (BTreeSet::new(), BTreeSet::new()), "{file:?}");
    // Being the truth is not a fault, but is reported.
    assert_eq!(codes(&file, NOTE), BTreeSet::from(["copy_of_truth".to_owned()]));
    assert_eq!(file.method.as_deref(), Some("gt"));
}

/// Checks one table of faults and returns the number of codes.
fn check(faults: &[Fault]) {
    let mut wrong = Vec::new();
    for (at, (code, severity, plant)) in faults.iter().enumerate() {
        let folder = good();
        let submission = folder.path().join("gt");
        plant(&submission);
        let file = linted(&submission);
        let (errors, warnings) = (codes(&file, ERROR), codes(&file, WARNING));
        let own = BTreeSet::from([(*code).to_owned()]);
        let found = match severity {
            Severity::Error => errors == own && warnings.is_empty(),
            Severity::Warning => errors.is_empty() && warnings == own,
            Severity::Note => errors.is_empty() && warnings.is_empty() && codes(&file, NOTE).contains(*code),
        };
        if !found || file.good != errors.is_empty() {
            wrong
                .push(format!("{at} {code}: errors {errors:?}, warnings {warnings:?}, notes {:?}", codes(&file, NOTE)));
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
}

#[test]
fn faults_of_names_and_of_submission_json() {
    check(NAME_FAULTS);
}

#[test]
fn faults_of_files() {
    check(FILE_FAULTS);
}

#[test]
fn faults_that_only_pictures_reveal() {
    check(PICTURE_FAULTS);
}

#[test]
fn each_fault_has_a_code_of_its_own() {
    let all = [NAME_FAULTS, FILE_FAULTS, PICTURE_FAULTS].concat();
    let distinct: BTreeSet<&str> = all.iter().map(|(code, ..)| *code).collect();
    // A truncated JSON and a duplicate key are the same fault.
    assert_eq!(distinct.len(), all.len() - 1);
    assert!(distinct.len() >= 40, "{} codes", distinct.len());
}

/// Baselines have no findings but those that state what they are.
#[test]
fn baselines_are_not_accused() {
    let folder = tempfile::tempdir().unwrap();
    let nn = folder.path().join("nn");
    write_nearest(&nn);
    let file = linted(&nn);
    assert_eq!((codes(&file, ERROR), codes(&file, WARNING)), (BTreeSet::new(), BTreeSet::new()), "{file:?}");
    let grey = folder.path().join("grey");
    bounds::write_grey(photos(), &grey, false).unwrap();
    let file = linted(&grey);
    assert_eq!(codes(&file, ERROR), BTreeSet::new());
    assert!(codes(&file, WARNING).contains("same_base_color"), "{file:?}");
}

/// Without the ground truth lint finds the same, except copies of it.
#[test]
fn a_public_dataset_is_enough() {
    let (folder, public) = (good(), tempfile::tempdir().unwrap());
    copy_public(&photos().root, public.path());
    let opened = mateval_dataset::open::Dataset::open(public.path()).unwrap();
    let submission = folder.path().join("gt");
    let look =
        |submission: &Path| lint(&LintPlan { dataset: &opened, submission, tool: "test".to_owned() }, &|_| ()).unwrap();
    assert!(look(&submission).findings.is_empty());
    flip(&submission);
    assert_eq!(codes(&look(&submission), WARNING), BTreeSet::from(["flipped_vertically".to_owned()]));
}

pub fn copy_public(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(|entry| entry.unwrap()) {
        let place = to.join(entry.file_name());
        if entry.file_name() == "ground_truth" {
            continue;
        }
        if entry.path().is_dir() {
            copy_public(&entry.path(), &place);
        } else {
            std::fs::copy(entry.path(), place).unwrap();
        }
    }
}

fn json(submission: &Path) -> PathBuf {
    submission.join("submission.json")
}

/// Replaces a piece of `submission.json`.
fn edit_json(submission: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(json(submission)).unwrap();
    assert!(text.contains(from), "{text}");
    std::fs::write(json(submission), text.replacen(from, to, 1)).unwrap();
}

/// Changes the value of a key.
fn set(submission: &Path, key: &str, value: serde_json::Value) {
    let mut object: serde_json::Value = serde_json::from_slice(&std::fs::read(json(submission)).unwrap()).unwrap();
    object[key] = value;
    std::fs::write(json(submission), object.to_string()).unwrap();
}

fn rename(submission: &Path, from: &str, to: &str) {
    std::fs::rename(submission.join(from), submission.join(to)).unwrap();
}

fn link(submission: &Path, place: &str, to: &Path) {
    let place = submission.join(place);
    if place.is_dir() {
        std::fs::remove_dir_all(&place).unwrap();
    } else {
        let _ = std::fs::remove_file(&place);
    }
    std::os::unix::fs::symlink(to, place).unwrap();
}

/// Faults of names and of `submission.json`.
const NAME_FAULTS: &[Fault] = &[
    ("no_submission_file", ERROR, |root| std::fs::remove_file(json(root)).unwrap()),
    ("bad_json", ERROR, |root| {
        let text = std::fs::read_to_string(json(root)).unwrap();
        std::fs::write(json(root), &text[..text.len() / 2]).unwrap();
    }),
    ("bad_json", ERROR, |root| edit_json(root, "\"method\"", "\"method\": \"twice\", \"method\"")),
    ("wrong_type", ERROR, |root| set(root, "method", 3.into())),
    ("missing_key", ERROR, |root| edit_json(root, "\"method\": \"gt\",", "")),
    ("unknown_key", ERROR, |root| set(root, "autor", "me".into())),
    ("wrong_format", ERROR, |root| set(root, "format", "mateval-submission/9".into())),
    ("bad_number", ERROR, |root| set(root, "cost", serde_json::json!({"seconds_a_scene": -1.0}))),
    ("json_too_large", ERROR, |root| set(root, "description", "x".repeat(2 << 20).into())),
    ("other_dataset", WARNING, |root| set(root, "dataset_manifest_sha256", "0".repeat(64).into())),
    ("bad_hash", WARNING, |root| set(root, "dataset_manifest_sha256", "latest".into())),
    ("no_method_name", WARNING, |root| set(root, "method", " ".into())),
    ("bad_method_name", WARNING, |root| set(root, "method", "a\nb".into())),
    ("no_scenes_folder", ERROR, |root| rename(root, "scenes", "results")),
    ("nested_submission", ERROR, |root| {
        let inner = root.with_file_name("inner");
        std::fs::rename(root, &inner).unwrap();
        std::fs::create_dir(root).unwrap();
        std::fs::rename(inner, root.join("mine")).unwrap();
    }),
    ("missing_scene", ERROR, |root| std::fs::remove_dir_all(root.join("scenes/living")).unwrap()),
    ("misnamed_scene", ERROR, |root| rename(root, "scenes/living", "scenes/Living_")),
    ("extra_scene", WARNING, |root| std::fs::create_dir(root.join("scenes/kitchen")).unwrap()),
    ("missing_object", ERROR, |root| std::fs::remove_dir_all(root.join("scenes/room/rug")).unwrap()),
    ("misnamed_object", ERROR, |root| rename(root, "scenes/room/wall_paper", "scenes/room/wallpaper")),
    ("extra_object", WARNING, |root| std::fs::create_dir(root.join("scenes/room/elephant")).unwrap()),
    ("not_a_folder", ERROR, |root| {
        std::fs::remove_dir_all(root.join("scenes/room/rug")).unwrap();
        std::fs::write(root.join("scenes/room/rug"), "").unwrap();
    }),
    ("missing_map", ERROR, |root| std::fs::remove_file(map(root, "base_color.png")).unwrap()),
    ("misnamed_map", ERROR, |root| rename(root, "scenes/room/rug/base_color.png", "scenes/room/rug/albedo.png")),
    ("wrong_ending", ERROR, |root| {
        rename(root, "scenes/room/rug/base_color.png", "scenes/room/rug/base_color.jpg");
    }),
    ("ambiguous_map", ERROR, |root| std::fs::write(map(root, "base_color.exr"), "").unwrap()),
    ("not_a_file", ERROR, |root| {
        std::fs::remove_file(map(root, "base_color.png")).unwrap();
        std::fs::create_dir(map(root, "base_color.png")).unwrap();
    }),
    ("default_roughness", NOTE, |root| std::fs::remove_file(map(root, "roughness.png")).unwrap()),
    ("default_metallic", NOTE, |root| std::fs::remove_file(map(root, "metallic.png")).unwrap()),
    ("extra_file", NOTE, |root| std::fs::write(root.join("README.md"), "mine").unwrap()),
    ("link_leads_out", ERROR, |root| {
        let outside = root.with_file_name("outside.png");
        std::fs::copy(map(root, "base_color.png"), &outside).unwrap();
        link(root, "scenes/room/rug/base_color.png", &outside);
    }),
    ("broken_link", ERROR, |root| link(root, "scenes/room/rug/base_color.png", Path::new("nowhere.png"))),
    ("useless_link", WARNING, |root| link(root, "notes", Path::new("/etc"))),
    ("bad_name", ERROR, |root| {
        use std::os::unix::ffi::OsStrExt as _;
        std::fs::write(root.join(std::ffi::OsStr::from_bytes(b"\xff.png")), "").unwrap();
    }),
];

fn base(root: &Path) -> std::path::PathBuf {
    map(root, "base_color.png")
}

fn rough(root: &Path) -> std::path::PathBuf {
    map(root, "roughness.png")
}

/// Changes the bytes of a file.
fn edit(path: &Path, change: impl FnOnce(&mut Vec<u8>)) {
    let mut bytes = std::fs::read(path).unwrap();
    change(&mut bytes);
    std::fs::write(path, bytes).unwrap();
}

/// Replaces the base colour or the roughness by an EXR with these channels.
fn exr(png: &Path, names: &[&str], value: f32) {
    let image = ex::Image::from_layer(layer(names, value));
    replace(png, |path| image.write().to_file(path));
}

/// Replaces a map by an EXR that has only a header.
fn header(png: &Path, side: i32, deep: bool, channels: &[(&str, i32)]) {
    std::fs::remove_file(png).unwrap();
    std::fs::write(png.with_extension("exr"), exr_header(side, deep, channels)).unwrap();
}

const GREY: fn(usize, usize) -> u8 = |x, y| (x * 3 + y) as u8;

/// Faults of the files of maps: kinds, sizes, chunks, channels, numbers.
const FILE_FAULTS: &[Fault] = &[
    ("empty_file", ERROR, |root| std::fs::write(base(root), "").unwrap()),
    ("git_lfs_pointer", ERROR, |root| {
        std::fs::write(base(root), "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n").unwrap();
    }),
    ("wrong_kind", ERROR, |root| std::fs::write(base(root), b"\xff\xd8\xff\xe0 a JPEG").unwrap()),
    ("file_too_large", ERROR, |root| {
        std::fs::OpenOptions::new().write(true).open(base(root)).unwrap().set_len(513 << 20).unwrap();
    }),
    ("bad_header", ERROR, |root| edit(&base(root), |bytes| bytes[25] = 7)),
    ("truncated_picture", ERROR, |root| edit(&base(root), |bytes| bytes.truncate(bytes.len() / 2))),
    ("unreadable_picture", ERROR, |root| {
        edit(&base(root), |bytes| {
            let at = bytes.len() / 2;
            bytes[at] ^= 0xff;
        })
    }),
    ("not_square", ERROR, |root| png_io::write_rgb_bytes(&base(root), &Picture::filled(128, 64, [9; 3])).unwrap()),
    ("too_few_texels", ERROR, |root| png_io::write_grey_bytes(&rough(root), &Picture::filled(32, 32, 9)).unwrap()),
    ("too_many_texels", ERROR, |root| {
        std::fs::write(rough(root), png(100_000, 8, 0, 0, b"", b"")).unwrap();
    }),
    ("missing_channel", ERROR, |root| exr(&base(root), &["X", "Y", "Z"], 0.5)),
    ("deep_data", ERROR, |root| header(&base(root), 64, true, &[("B", 1), ("G", 1), ("R", 1)])),
    ("subsampled_channel", ERROR, |root| header(&rough(root), 64, false, &[("V", 2)])),
    ("too_many_channels", ERROR, |root| {
        let others = ["A", "B", "C", "D", "E", "F", "H", "I", "V"].map(|name| (name, 1));
        header(&rough(root), 4096, false, &others);
    }),
    ("bad_texels", WARNING, |root| {
        let samples = || {
            let mut values = vec![0.5; 64 * 64];
            values[32 * 64 + 32] = f32::NAN;
            ex::FlatSamples::F32(values)
        };
        let image = ex::Image::from_layer(layer_of(&["V"], samples));
        replace(&rough(root), |path| image.write().to_file(path));
    }),
    ("nan", ERROR, |root| exr(&rough(root), &["V"], f32::NAN)),
    ("infinity", ERROR, |root| exr(&base(root), &["R", "G", "B"], f32::INFINITY)),
    ("out_of_range", ERROR, |root| exr(&rough(root), &["V"], 1.5)),
    ("low_bit_depth", WARNING, |root| {
        std::fs::write(rough(root), png(64, 4, 0, 0, b"", &rows(64, 32, GREY))).unwrap();
    }),
    ("palette", WARNING, |root| {
        let palette: Vec<u8> = (0..768).map(|at| (at / 3) as u8).collect();
        let before = chunk(b"PLTE", &palette);
        std::fs::write(base(root), png(64, 8, 3, 0, &before, &rows(64, 64, GREY))).unwrap();
    }),
    ("alpha", WARNING, |root| {
        let colors = png_io::read_rgb_bytes(&base(root)).unwrap();
        png_io::write_rgba_bytes(&base(root), &colors.map(|[r, g, b]| [r, g, b, 255])).unwrap();
    }),
    ("transparent_colour", WARNING, |root| insert(&base(root), b"tRNS", &[0, 1, 0, 2, 0, 3])),
    ("colour_scalar", WARNING, |root| {
        png_io::write_rgb_bytes(&rough(root), &Picture::filled(64, 64, [128, 9, 9])).unwrap();
    }),
    ("gamma_chunk", WARNING, |root| insert(&base(root), b"gAMA", &45_455_u32.to_be_bytes())),
    ("icc_profile", WARNING, |root| insert(&base(root), b"iCCP", b"mine\0\0not even packed")),
    ("primaries_chunk", WARNING, |root| insert(&base(root), b"cHRM", &[0; 32])),
    ("coding_chunk", WARNING, |root| insert(&base(root), b"cICP", &[9, 16, 0, 1])),
    ("srgb_chunk", WARNING, |root| insert(&rough(root), b"sRGB", &[0])),
    ("animated", WARNING, |root| insert(&base(root), b"acTL", &[0, 0, 0, 1, 0, 0, 0, 0])),
    ("trailing_bytes", WARNING, |root| edit(&base(root), |bytes| bytes.extend(b"more"))),
    ("interlaced", NOTE, |root| {
        // Adam7 of a constant: seven passes, each of rows of the same bytes.
        let passes = [(8, 8), (8, 8), (8, 16), (16, 16), (16, 32), (32, 32), (32, 64)];
        let data: Vec<u8> = passes.iter().flat_map(|(height, width)| rows(*height, *width, |_, _| 128)).collect();
        std::fs::write(rough(root), png(64, 8, 0, 1, b"", &data)).unwrap();
    }),
    ("several_parts", WARNING, |root| {
        let named = |name: &str| {
            let mut layer = layer(&["R", "G", "B"], 0.5);
            layer.attributes.layer_name = Some(name.into());
            layer
        };
        let attributes = ex::ImageAttributes::with_size((64, 64));
        let image = ex::Image::from_layers(attributes, vec![named("a"), named("b")]);
        replace(&base(root), |path| image.write().to_file(path));
    }),
    ("cropped_window", WARNING, |root| {
        let mut image = ex::Image::from_layer(layer(&["V"], 0.5));
        image.attributes.display_window.size = ex::Vec2(128, 128);
        replace(&rough(root), |path| image.write().to_file(path));
    }),
    ("other_primaries", WARNING, |root| {
        let mut image = ex::Image::from_layer(layer(&["R", "G", "B"], 0.5));
        let [red, green, blue, white] = [(0.7, 0.3), (0.2, 0.8), (0.1, 0.0), (0.3, 0.3)].map(|(x, y)| ex::Vec2(x, y));
        image.attributes.chromaticities = Some(exr::meta::attribute::Chromaticities { red, green, blue, white });
        replace(&base(root), |path| image.write().to_file(path));
    }),
    ("whole_numbers", WARNING, |root| {
        let samples = || ex::FlatSamples::U32(vec![1; 64 * 64]);
        let image = ex::Image::from_layer(layer_of(&["V"], samples));
        replace(&rough(root), |path| image.write().to_file(path));
    }),
    ("extra_channels", WARNING, |root| exr(&base(root), &["A", "B", "G", "R"], 0.5)),
    ("beyond_unit", WARNING, |root| exr(&base(root), &["B", "G", "R"], 1.5)),
    ("tiled", NOTE, |root| {
        let mut tiled = layer(&["V"], 0.5);
        tiled.encoding.blocks = ex::Blocks::Tiles(ex::Vec2(16, 16));
        let image = ex::Image::from_layer(tiled);
        replace(&rough(root), |path| image.write().to_file(path));
    }),
];

/// Each is one warning for each of both scenes, and no other; the twins are warned of by none.
#[test]
fn numbers_of_another_range_are_found() {
    let rough = |root: &Path, largest: u16| {
        for path in every(root, "roughness.png") {
            png_io::write_ids(&path, &Picture::from_fn(64, 64, |x, _| largest / 8 * (x as u16 % 8) + largest % 8))
                .unwrap();
        }
    };
    let metal = |root: &Path, largest: u8| {
        for path in every(root, "metallic.png") {
            png_io::write_grey_bytes(&path, &Picture::from_fn(64, 64, |x, _| if x < 8 { largest } else { 0 })).unwrap();
        }
    };
    let base = |root: &Path, factor: f32| {
        for path in every(root, "base_color.png") {
            let values = bytes(&path).map(|rgb| LinearRgb(rgb.map(|byte| factor * f32::from(byte))));
            std::fs::remove_file(&path).unwrap();
            exr_io::write_linear(&path.with_extension("exr"), &values, Precision::Float).unwrap();
        }
    };
    type Plant<'a> = &'a dyn Fn(&Path);
    let cases: [(Plant<'_>, &str); 6] = [
        (&|root| rough(root, 4095), "as those of 12 bits do"),
        (&|root| rough(root, 1023), "as those of 10 bits do"),
        (&|root| metal(root, 1), "no number above 0.003921569 of 1"),
        (&|root| base(root, 1e-33), "of 1"),
        (&|root| change(root, |picture| picture.map(|_| [0; 3])), "black everywhere"),
        (&|root| change(root, |picture| picture.map(|rgb| rgb.map(|byte| byte / 200))), "no number above 0.003921569"),
    ];
    for (plant, expected) in cases {
        let folder = good();
        let root = folder.path().join("gt");
        plant(&root);
        let file = linted(&root);
        let found = file.findings.iter().find(|finding| finding.code == "small_numbers");
        let found = found.unwrap_or_else(|| panic!("{expected}: {file:?}"));
        assert!(found.count == 2 && found.examples[0].message.contains(expected), "{found:?}");
    }
    let twins: [Plant<'_>; 3] = [&|root| rough(root, 65535), &|root| metal(root, 3), &|root| rough(root, 7000)];
    for plant in twins {
        let folder = good();
        let root = folder.path().join("gt");
        plant(&root);
        assert!(!codes(&linted(&root), WARNING).contains("small_numbers"));
    }
}

/// The bytes of a map of 8 or 16 bits, three a texel.
fn bytes(path: &Path) -> Picture<[u8; 3]> {
    let texture = read_texture(path, Encoding::Linear, Default::default()).unwrap();
    Picture::from_fn(texture.width(), texture.height(), |x, y| {
        texture.texel(x, y).map(|value| (value * 255.0).round() as u8)
    })
}

/// Changes every base colour.
fn change(root: &Path, change: impl Fn(&Picture<[u8; 3]>) -> Picture<[u8; 3]>) {
    for path in every(root, "base_color.png") {
        png_io::write_rgb_bytes(&path, &change(&bytes(&path))).unwrap();
    }
}

fn turned(picture: &Picture<[u8; 3]>, place: impl Fn(usize, usize, usize) -> (usize, usize)) -> Picture<[u8; 3]> {
    let last = picture.width() - 1;
    Picture::from_fn(picture.width(), picture.height(), |x, y| {
        let (x, y) = place(x, y, last);
        picture.get(x, y)
    })
}

/// Turns every atlas upside down.
fn flip(root: &Path) {
    change(root, |picture| turned(picture, |x, y, last| (x, last - y)));
}

fn swap_files(root: &Path) {
    for roughness in every(root, "roughness.png") {
        let (metallic, aside) = (roughness.with_file_name("metallic.png"), roughness.with_file_name("aside"));
        std::fs::rename(&roughness, &aside).unwrap();
        std::fs::rename(&metallic, &roughness).unwrap();
        std::fs::rename(&aside, &metallic).unwrap();
    }
}

/// Writes every base colour as an EXR whose values are `linear` of the encoded ones.
fn into_exr(root: &Path, linear: fn(f32) -> f32) {
    for path in every(root, "base_color.png") {
        let values = bytes(&path).map(|rgb| LinearRgb(rgb.map(|byte| linear(f32::from(byte) / 255.0))));
        std::fs::remove_file(&path).unwrap();
        exr_io::write_linear(&path.with_extension("exr"), &values, Precision::Half).unwrap();
    }
}

/// Replaces the good submission by another one.
fn instead(root: &Path, write: impl Fn(&Path)) {
    std::fs::remove_dir_all(root).unwrap();
    write(root);
}

/// Faults that only pictures reveal, planted in every map of both scenes as a faulty script would.
const PICTURE_FAULTS: &[Fault] = &[
    ("flipped_vertically", WARNING, flip),
    ("flipped_horizontally", WARNING, |root| change(root, |picture| turned(picture, |x, y, last| (last - x, y)))),
    ("turned_half", WARNING, |root| change(root, |picture| turned(picture, |x, y, last| (last - x, last - y)))),
    ("transposed", WARNING, |root| change(root, |picture| turned(picture, |x, y, _| (y, x)))),
    ("swapped_red_blue", WARNING, |root| change(root, |picture| picture.map(|[r, g, b]| [b, g, r]))),
    ("linear_in_png", WARNING, |root| {
        let linear = |byte: u8| (linear_from_srgb(f32::from(byte) / 255.0) * 255.0).round() as u8;
        change(root, |picture| picture.map(|rgb| rgb.map(linear)));
    }),
    ("srgb_in_exr", WARNING, |root| into_exr(root, |encoded| encoded)),
    // As lifted from a float picture of sRGB numbers by an adapter that states linear ones, and the reverse.
    ("encoded_twice", WARNING, |root| {
        let encoded = |byte: u8| (srgb_from_linear(f32::from(byte) / 255.0) * 255.0).round() as u8;
        change(root, |picture| picture.map(|rgb| rgb.map(encoded)));
    }),
    ("decoded_twice", WARNING, |root| into_exr(root, |encoded| linear_from_srgb(linear_from_srgb(encoded)))),
    ("shading_baked_in", WARNING, |root| instead(root, write_from_photo)),
    ("swapped_roughness_metallic", WARNING, swap_files),
    ("same_roughness_metallic", WARNING, |root| {
        for path in every(root, "roughness.png") {
            std::fs::copy(&path, path.with_file_name("metallic.png")).unwrap();
        }
    }),
    ("small_numbers", WARNING, |root| {
        for path in every(root, "metallic.png") {
            let bits = Picture::from_fn(64, 64, |x, y| u8::from((x / 8 + y / 8) % 2 == 0));
            png_io::write_grey_bytes(&path, &bits).unwrap();
        }
    }),
    ("same_base_color", WARNING, |root| {
        let all = every(root, "base_color.png");
        let (first, others) = all.split_first().unwrap();
        for path in others {
            std::fs::copy(first, path).unwrap();
        }
    }),
    ("unobserved_empty", WARNING, empty_unobserved),
    ("copy_of_truth", NOTE, |_| ()),
];

/// Makes texels black that the input view does not show.
fn empty_unobserved(root: &Path) {
    instead(root, write_nearest);
    for scene in &photos().scenes {
        mateval_testkit::sample_dataset::blacken_unobserved(scene, &root.join("scenes").join(scene.id.as_str()));
    }
}
