//! Faults that only pictures reveal, planted in every map of both scenes as a faulty script would.

use std::path::Path;

use mateval_image::exr_io::{self, Precision};
use mateval_image::transfer::{linear_from_srgb, srgb_from_linear};
use mateval_image::{LinearRgb, Picture, png_io};

use super::{Fault, NOTE, WARNING, every};
use mateval_testkit::sample_dataset::{dataset, write_from_photo, write_nearest};

/// The bytes of a map of 8 or 16 bits, three a texel.
fn bytes(path: &Path) -> Picture<[u8; 3]> {
    let texture =
        mateval_image::texture_io::read_texture(path, mateval_image::texture_io::Encoding::Linear, Default::default())
            .unwrap();
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
pub fn flip(root: &Path) {
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

pub const FAULTS: &[Fault] = &[
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
    for scene in &dataset().scenes {
        mateval_testkit::sample_dataset::blacken_unobserved(scene, &root.join("scenes").join(scene.id.as_str()));
    }
}
