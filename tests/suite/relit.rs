//! Track `relit`: the truth under other weights of its lights agrees with Blender's render of a scene with those
//! lights.

use std::path::{Path, PathBuf};

use mateval_image::{LinearRgb, Picture, exr_io};

use super::blender::blender;
use super::command::{build, render_photos, run};
use super::sample::{json, recipe_text, write_source};

const HEAD: &str = "resolution = [96, 72]\natlas_size = 64\nviews = []";
const SAMPLES: u32 = 32;
/// Side of the compared tiles, in pixels.
const TILE: usize = 8;

/// Factors for the two lamps of the room's XML; the sky is unchanged.
const WEIGHTS: [[f32; 3]; 2] = [[1.3, 1.0, 0.6], [0.3, 0.45, 0.65]];

/// The room's source with its lamps multiplied by the weights.
fn reweighted(scene: &str) -> String {
    const START: &str = "name=\"radiance\" value=\"";
    let mut parts = scene.split(START);
    let mut text = parts.next().unwrap().to_owned();
    for (part, weights) in parts.zip(WEIGHTS) {
        let (value, rest) = part.split_once('"').unwrap();
        let values = value.split(", ").zip(weights).map(|(v, w)| (v.parse::<f32>().unwrap() * w).to_string());
        text += &format!("{START}{}\"{rest}", values.collect::<Vec<_>>().join(", "));
    }
    text
}

/// Two halves of the input view, `what` being `rgb` or a group.
fn halves(scene: &Path, what: &str) -> [Picture<LinearRgb>; 2] {
    let folder = scene.join("ground_truth/renders/blender/input");
    ["a", "b"].map(|half| exr_io::read_linear(&folder.join(format!("{what}_{half}.exr"))).unwrap())
}

/// The weighted sum of the groups, half by half.
fn weighted(scene: &Path, weights: &[[f32; 3]]) -> [Picture<LinearRgb>; 2] {
    let groups: Vec<_> = (0..weights.len()).map(|group| halves(scene, &format!("group_{group:02}"))).collect();
    [0, 1].map(|half| {
        Picture::from_fn(96, 72, |x, y| {
            let channel = |c: usize| groups.iter().zip(weights).map(|(g, w)| g[half].get(x, y).0[c] * w[c]).sum();
            LinearRgb([0, 1, 2].map(channel))
        })
    })
}

/// The difference of the means in standard errors, for each tile and channel, and for each channel of the whole
/// picture. Variances come from the halves.
fn z_values(a: &[Picture<LinearRgb>; 2], b: &[Picture<LinearRgb>; 2]) -> (Vec<f64>, Vec<f64>) {
    let sums =
        |pictures: &[Picture<LinearRgb>; 2], columns: std::ops::Range<usize>, rows: std::ops::Range<usize>, c| {
            let (mut mean, mut variance) = (0.0, 0.0);
            for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
                let [p, q] = [0, 1].map(|half: usize| f64::from(pictures[half].get(x, y).0[c]));
                mean += (p + q) / 2.0;
                variance += (p - q) * (p - q) / 4.0;
            }
            (mean, variance)
        };
    let z = |columns: std::ops::Range<usize>, rows: std::ops::Range<usize>, c: usize| {
        let (mean_a, variance_a) = sums(a, columns.clone(), rows.clone(), c);
        let (mean_b, variance_b) = sums(b, columns, rows, c);
        (mean_a - mean_b) / (variance_a + variance_b).sqrt().max(1e-9)
    };
    let tiles = (0..72 / TILE).flat_map(|row| (0..96 / TILE).map(move |column| (column * TILE, row * TILE)));
    let tiles = tiles.flat_map(|(x, y)| [0, 1, 2].map(|c| z(x..x + TILE, y..y + TILE, c))).collect();
    (tiles, [0, 1, 2].map(|c| z(0..96, 0..72, c)).to_vec())
}

/// A few tiles may differ by more than three standard errors, because they are noisy: 0.27 % of normal deviates do.
fn agree((tiles, whole): &(Vec<f64>, Vec<f64>)) -> bool {
    let far = tiles.iter().filter(|z| z.abs() > 3.0).count() as f64 / tiles.len() as f64;
    far < 0.03 && whole.iter().all(|z| z.abs() < 4.0)
}

#[test]
fn weighted_truth_agrees_with_a_render_of_that_lighting() {
    let Some((python, _turn)) = blender() else { return };
    let folder = tempfile::tempdir().unwrap();
    let made = |name: &str, change: fn(&str) -> String| -> PathBuf {
        let source = folder.path().join(format!("{name}-source"));
        let recipe = write_source(&source, HEAD, &["room"]);
        // Another id results in other seeds.
        std::fs::write(&recipe, recipe_text(HEAD, &[name])).unwrap();
        let xml = source.join("room/scene.xml");
        std::fs::write(&xml, change(&std::fs::read_to_string(&xml).unwrap())).unwrap();
        let dataset = folder.path().join(name);
        run(&mut build(&recipe, &dataset)).ends_with(0);
        let mut command = render_photos(&dataset, SAMPLES);
        run(command.args(["--renderer", "blender", "--blender"]).arg(&python)).ends_with(0);
        dataset.join("scenes").join(name)
    };
    let (plain, relit) = (made("plain", str::to_owned), made("relit", reweighted));
    // The group of each lamp is found by their emission.
    let radiances = |scene: &Path| -> Vec<Option<[f32; 3]>> {
        let groups = json(&scene.join("ground_truth/lights.json"))["groups"].as_array().unwrap().clone();
        groups.iter().map(|group| serde_json::from_value(group["emission"]["radiance"].clone()).ok()).collect()
    };
    let pairs = radiances(&plain).into_iter().zip(radiances(&relit));
    let ratio = |(a, b): (Option<[f32; 3]>, Option<[f32; 3]>)| match (a, b) {
        (Some(a), Some(b)) => [0, 1, 2].map(|c| b[c] / a[c]),
        _ => [1.0; 3],
    };
    let weights: Vec<[f32; 3]> = pairs.map(ratio).collect();
    assert_eq!(weights.iter().filter(|weight| **weight != [1.0; 3]).count(), 2, "{weights:?}");
    let rendered = halves(&relit, "rgb");
    let found = z_values(&weighted(&plain, &weights), &rendered);
    assert!(agree(&found), "{found:?}");
    let unweighted = z_values(&weighted(&plain, &vec![[1.0; 3]; weights.len()]), &rendered);
    assert!(!agree(&unweighted), "the twin passes");
}
