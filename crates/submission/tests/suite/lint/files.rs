//! Faults of the files of maps: kinds, sizes, chunks, channels, numbers.

use std::path::Path;

use exr::prelude as ex;
use exr::prelude::traits::*;
use mateval_image::{Picture, png_io};

use super::written::{exr_header, insert, layer, layer_of, png, replace, rows};
use super::{ERROR, Fault, NOTE, WARNING, map};

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

pub const FAULTS: &[Fault] = &[
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
        let before = super::written::chunk(b"PLTE", &palette);
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
