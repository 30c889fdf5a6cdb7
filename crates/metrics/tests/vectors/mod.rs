//! Small pictures made from integers, and the values that scikit-image and lpips compute for them: `vectors.json`,
//! which `make_vectors.py` writes from the same pictures.

use mateval_image::{Mask, Picture, SrgbRgb};
use mateval_scene::manifest::sha256_of_bytes;
use mateval_scene::splitmix64::number;
use serde::Deserialize;

use super::{Case, Loaded};

type Bytes = Picture<[u8; 3]>;

#[derive(Deserialize)]
struct Vectors {
    cases: Vec<Vector>,
}

#[derive(Deserialize)]
struct Vector {
    /// SHA-256 of the bytes of prediction, reference and mask (0 and 1).
    sha256: [String; 3],
    #[serde(flatten)]
    case: Case,
}

/// All cases with their pictures, whose bytes equal those of the script.
pub fn load() -> Vec<Loaded> {
    let vectors: Vectors = serde_json::from_str(include_str!("vectors.json")).unwrap();
    vectors.cases.into_iter().map(loaded).collect()
}

fn loaded(Vector { sha256, case }: Vector) -> Loaded {
    let reference = reference(&case.reference);
    let prediction = predicted(&reference, &case.prediction);
    let mask = mask(reference.width(), reference.height());
    let bits: Vec<u8> = mask.pixels().iter().map(|counts| u8::from(*counts)).collect();
    let bytes = [prediction.pixels().as_flattened(), reference.pixels().as_flattened(), &bits];
    assert_eq!(bytes.map(sha256_of_bytes), sha256, "{} {}: not the script's pictures", case.reference, case.prediction);
    let encoded = |picture: &Bytes| picture.map(|rgb| SrgbRgb(rgb.map(|byte| f32::from(byte) / 255.0)));
    Loaded { prediction: encoded(&prediction), reference: encoded(&reference), mask: Some(mask), case }
}

fn picture(width: usize, height: usize, value: impl Fn(usize, usize, usize) -> u64) -> Bytes {
    Picture::from_fn(width, height, |x, y| [0, 1, 2].map(|c| u8::try_from(value(x, y, c)).unwrap()))
}

fn reference(name: &str) -> Bytes {
    match name {
        "tiles" => picture(80, 72, tiles),
        "waves" => picture(64, 67, waves),
        other => panic!("no picture '{other}'"),
    }
}

/// Flat tiles with a gradient and a fine grain.
fn tiles(x: usize, y: usize, c: usize) -> u64 {
    let tile = (y / 9) * 16 + x / 10;
    let [flat, grain] = [number(7, (3 * tile + c) as u64) % 200, number(8, ((y * 128 + x) * 3 + c) as u64) % 16];
    flat + (3 * x as u64 + 2 * y as u64) % 40 + grain
}

/// Slanted waves, slightly shifted in each channel.
fn waves(x: usize, y: usize, c: usize) -> u64 {
    (2 * triangle_wave(3 * x + 2 * y, 64 + 8 * c) + triangle_wave(5 * y + 2 * x, 37)) / 3
}

/// 0 to 255 and back over `period`.
fn triangle_wave(at: usize, period: usize) -> u64 {
    let within = at % period;
    (within.min(period - within) * 510 / period) as u64
}

/// The reference with errors as a method might make them.
fn predicted(reference: &Bytes, kind: &str) -> Bytes {
    let (width, height) = (reference.width(), reference.height());
    let clamped = |at: usize, by: i64, side: usize| (at as i64 + by).clamp(0, side as i64 - 1) as usize;
    let at = |x, y, c: usize, dx, dy| u64::from(reference.get(clamped(x, dx, width), clamped(y, dy, height))[c]);
    let noise = |x, y, c| number(9, ((y * 128 + x) * 3 + c) as u64) % 81;
    let around = || (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
    match kind {
        "noise" => picture(width, height, |x, y, c| (at(x, y, c, 0, 0) + noise(x, y, c)).saturating_sub(40).min(255)),
        "shift" => picture(width, height, |x, y, c| at(x, y, c, -3, 2)),
        "blur" => picture(width, height, |x, y, c| around().map(|(dx, dy)| at(x, y, c, dx, dy)).sum::<u64>() / 9),
        "darker" => picture(width, height, |x, y, c| at(x, y, c, 0, 0) * (2 + c as u64) / 5),
        "grey" => Picture::filled(width, height, [128; 3]),
        other => panic!("no prediction '{other}'"),
    }
}

/// A disc and a bar.
fn mask(width: usize, height: usize) -> Mask {
    let from_centre = |at: usize, side: usize| at.abs_diff(side / 2).pow(2);
    Picture::from_fn(width, height, |x, y| {
        from_centre(x, width) + from_centre(y, height) < 30 * 30 || (3..17).contains(&x)
    })
}
