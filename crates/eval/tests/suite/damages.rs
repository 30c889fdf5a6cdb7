//! The truth is never beaten, neither by grey nor by damaged copies of itself, whose scores fall with the damage.
//!
//! All submissions are scored together, on the same paths; the truth's light is exact.

use std::path::{Path, PathBuf};

use mateval_eval::metric::{Metric, PictureKind};
use mateval_eval::result::ProtocolResult;
use mateval_eval::result::key::{ResultKey, Surfaces, Views};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Picture, Wrap, png_io};

use super::sample::{dataset, hasty, plan, scored, write_changed, write_grey, write_truth};
use mateval_testkit::kept_folder;

/// Kinds of damage to the truth, and their numbers of strengths.
const KINDS: [(&str, usize); 7] =
    [("grey", 1), ("blurred", 2), ("tinted", 2), ("shaded", 2), ("replaced", 2), ("smoother", 2), ("metallic", 2)];

/// Writes the damaged truth; 0 is the smallest strength.
fn write_damaged(kind: &str, strength: usize, out: &Path) {
    match kind {
        "grey" => write_grey(out),
        "blurred" => write_changed(out, |truth| blurred(truth, [2, 6][strength])),
        "tinted" => write_changed(out, |truth| tinted(truth, [[1.0, 0.8, 0.6], [1.0, 0.6, 0.3]][strength])),
        "shaded" => write_changed(out, |truth| shaded(truth, [0.4, 0.8][strength])),
        "replaced" => write_changed(out, |truth| replaced(truth, [1, 2][strength])),
        "smoother" => write_moved(out, "roughness", [0.4, 0.8][strength], 0.0),
        _ => write_moved(out, "metallic", [0.4, 0.8][strength], 1.0),
    }
}

/// Blurs with a box of 2 `radius` + 1 texels a side.
fn blurred(truth: &Picture<LinearRgb>, radius: usize) -> Picture<LinearRgb> {
    let around = |at: usize, end: usize| at.saturating_sub(radius)..(at + radius + 1).min(end);
    Picture::from_fn(truth.width(), truth.height(), |x, y| {
        let rows = around(y, truth.height());
        let texels = rows.flat_map(|y| around(x, truth.width()).map(move |x| truth.get(x, y).0));
        let (sum, count) =
            texels.fold(([0.0; 3], 0.0), |(sum, count), rgb| ([0, 1, 2].map(|c| sum[c] + rgb[c]), count + 1.0));
        LinearRgb(sum.map(|v: f32| v / count))
    })
}

fn tinted(truth: &Picture<LinearRgb>, factor: [f32; 3]) -> Picture<LinearRgb> {
    truth.map(|LinearRgb(rgb)| LinearRgb([0, 1, 2].map(|c| rgb[c] * factor[c])))
}

/// Adds shading that falls towards one corner of the atlas, down to 1 - `depth`.
fn shaded(truth: &Picture<LinearRgb>, depth: f32) -> Picture<LinearRgb> {
    let (width, height) = (truth.width() as f32, truth.height() as f32);
    Picture::from_fn(truth.width(), truth.height(), |x, y| {
        let light = 1.0 - depth * 0.5 * (x as f32 / width + y as f32 / height);
        LinearRgb(truth.get(x, y).0.map(|v| v * light))
    })
}

/// Replaces this number of every four squares by grey.
fn replaced(truth: &Picture<LinearRgb>, quarters: usize) -> Picture<LinearRgb> {
    Picture::from_fn(truth.width(), truth.height(), |x, y| {
        if (x / 8 + 2 * (y / 8)) % 4 < quarters { LinearRgb([0.5; 3]) } else { truth.get(x, y) }
    })
}

/// Writes the truth with every value of `map` moved towards `end` by `share` of the distance.
fn write_moved(out: &Path, map: &str, share: f32, end: f32) {
    write_truth(out);
    for scene in &dataset().scenes {
        for instance in scene.instances.iter().filter(|instance| instance.atlas.is_some()) {
            let path = out.join(format!("scenes/{}/{}/{map}.png", scene.id, instance.id));
            let texture = read_texture(&path, Encoding::Linear, Wrap::Clamp).unwrap();
            let moved = |value: f32| ((value + share * (end - value)) * 255.0).round() as u8;
            let texels = Picture::from_fn(texture.width(), texture.height(), |x, y| moved(texture.texel(x, y)[0]));
            png_io::write_grey_bytes(&path, &texels).unwrap();
        }
    }
}

/// The truth's result, and those of all strengths by kind.
struct Results {
    truth: ProtocolResult,
    damaged: Vec<(&'static str, Vec<ProtocolResult>)>,
}

fn results() -> Results {
    let folder = kept_folder("damages");
    write_truth(&folder.join("gt"));
    let places: Vec<(&str, usize, PathBuf)> = KINDS
        .iter()
        .flat_map(|&(kind, strengths)| (0..strengths).map(move |strength| (kind, strength)))
        .map(|(kind, strength)| (kind, strength, folder.join(format!("{kind}_{strength}"))))
        .collect();
    places.iter().for_each(|(kind, strength, place)| write_damaged(kind, *strength, place));
    let truth = folder.join("gt");
    let submissions: Vec<&Path> =
        std::iter::once(truth.as_path()).chain(places.iter().map(|(.., place)| place.as_path())).collect();
    let mut protocol = hasty();
    // The same for all, and enough that small damage shows under every light.
    protocol.light.samples.each_half = 16;
    let mut all = scored(&plan(&submissions, &protocol, &[]))
        .into_iter()
        .map(|mut result| result.protocols.remove("mateval-3").unwrap());
    let truth = all.next().unwrap();
    let damaged = KINDS.iter().map(|&(kind, strengths)| (kind, all.by_ref().take(strengths).collect())).collect();
    Results { truth, damaged }
}

/// The amount by which `a` is better than `b`, in the metric's unit.
fn lead(key: ResultKey, a: &ProtocolResult, b: &ProtocolResult) -> f64 {
    key.metric.better().sign() * (a.summary[&key] - b.summary[&key])
}

/// The mean standard error of the MSEs of light that count for a key; 0 for all others.
fn mse_error(key: ResultKey, result: &ProtocolResult) -> f64 {
    let errors = result.pictures.iter().filter(|picture| picture.key(key.metric) == key);
    let errors: Vec<f64> = errors.filter_map(|picture| picture.mse_error).collect();
    errors.iter().sum::<f64>() / errors.len().max(1) as f64
}

/// Pictures whose squared error must rise with a kind of damage.
fn affected_by(kind: &str) -> &'static [PictureKind] {
    use PictureKind::*;
    match kind {
        "smoother" => &[Roughness],
        "metallic" => &[Metallic, RgbTrue, RgbRelit],
        _ => &[Albedo, TextureBaseColor, RgbTrue, RgbFitted, RgbRelit],
    }
}

#[test]
fn the_truth_is_never_beaten_and_more_damage_is_worse() {
    let Results { truth, damaged } = results();
    let (mut wrong, mut compared) = (Vec::new(), 0);
    let mut hold = |what: &str, key: ResultKey, lead: f64, least: f64| {
        compared += 1;
        if lead < least {
            wrong.push(format!("{what}: {key}: {lead:.2e}, expected {least:.2e} or more"));
        }
    };
    for (kind, strengths) in &damaged {
        for (strength, damage) in strengths.iter().enumerate() {
            let what = format!("{kind} {strength}");
            // Nothing is better than the truth, in any number.
            for &key in truth.summary.keys().filter(|key| damage.summary.contains_key(key)) {
                // An error without bias may be negative by its noise; the PSNR that ranks is bounded by it.
                let least = if key.metric == Metric::Mse { -3.0 * mse_error(key, damage) } else { 0.0 };
                hold(&what, key, lead(key, &truth, damage), least);
            }
            let before = strength.checked_sub(1).map_or(&truth, |less| &strengths[less]);
            let measured = |key: &&ResultKey| key.metric == Metric::Mse && damage.summary.contains_key(key);
            for &key in truth.summary.keys().filter(measured) {
                let is_whole = key.picture.surfaces == Surfaces::All;
                if is_whole && affected_by(kind).contains(&key.picture.kind) {
                    // Light's unobserved regions are small, and mild damage to them is less than render noise.
                    let is_faint = key.picture.kind.is_light() && key.views == Views::Unobserved;
                    let least = if is_faint { -1e-4 } else { f64::MIN_POSITIVE };
                    hold(&what, key, lead(key, before, damage), least);
                }
            }
        }
    }
    assert!(wrong.is_empty(), "of {compared} comparisons these fail:\n{}", wrong.join("\n"));
    assert!(compared > 700, "{compared}");
    // The twin: the worst damage in the role of the truth.
    let worst = &damaged[3].1[1];
    assert!(truth.summary.keys().filter(|key| lead(**key, worst, &truth) < 0.0).count() > 20);
}
