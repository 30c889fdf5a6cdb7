//! Planted errors of each kind are recognised as that kind.

use std::collections::BTreeMap;

use mateval_scene::{InstanceId, SceneId};

use super::file::KindShares;
use super::kinds::{Explained, explained};
use super::patch::Patch;
use super::{light, lost_detail, text};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::{InstancePixelErrors, ProtocolResult};
use mateval_eval::result_key::{PictureKind, Views};

type Pixel = [f64; 3];

/// White noise from 0.3 to 0.7, three fourths of it shared by all channels, computed from the position with integers
/// alone.
fn texture(x: i64, y: i64) -> Pixel {
    let noise = |channel: i64| {
        let mut word =
            (x.wrapping_mul(0x9E37_79B9) ^ y.wrapping_mul(0x85EB_CA6B) ^ channel.wrapping_mul(0xC2B2_AE35)) as u64;
        for _ in 0..3 {
            word = (word ^ (word >> 15)).wrapping_mul(0xD6E8_FEB8_6659_FD93);
        }
        (word >> 40) as f64 / (1 << 24) as f64
    };
    [1, 2, 3].map(|channel| 0.3 + 0.3 * noise(0) + 0.1 * noise(channel))
}

/// Two views of a disc, each of another part of the texture; `prediction` maps a position and the truth there to a
/// pixel.
fn discs(prediction: impl Fn(i64, i64, Pixel) -> Pixel) -> Vec<Patch> {
    [0, 1]
        .map(|view| {
            let offset = 1000 * view as i64;
            let inside = |x: i64, y: i64| (x - 40) * (x - 40) + (y - 30) * (y - 30) < 28 * 28;
            let places: Vec<[i64; 2]> =
                (0..60).flat_map(|y| (0..80).map(move |x| [x, y])).filter(|[x, y]| inside(*x, *y)).collect();
            let truth: Vec<Pixel> = places.iter().map(|[x, y]| texture(x + offset, *y)).collect();
            let predicted = places.iter().zip(&truth).map(|([x, y], t)| prediction(*x + offset, *y, *t)).collect();
            let (places, observed) =
                (places.iter().map(|place| place.map(|v| v as usize)).collect(), observed_all(&truth));
            Patch::new(view, places, truth, predicted, observed)
        })
        .into()
}

fn observed_all(truth: &[Pixel]) -> Vec<bool> {
    vec![true; truth.len()]
}

fn list(kinds: &KindShares) -> [f64; 7] {
    [kinds.unobserved, kinds.scale, kinds.chroma, kinds.shading, kinds.misplacement, kinds.detail, kinds.rest]
}

/// Checks that the shares add up, that none is below 0, and that the kind at place `kind` has more than `least`.
fn check(found: &Explained, kind: usize, least: f64) {
    let shares = list(&found.kinds().unwrap());
    assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{shares:?}");
    assert!(shares.iter().all(|share| *share > -1e-12), "{shares:?}");
    assert!(shares[kind] > least, "{shares:?}");
}

#[test]
fn a_planted_scale_is_scale() {
    let found = explained(&discs(|_, _, t| t.map(|v| 0.6 * v)));
    check(&found, 1, 0.999_999);
    assert!((found.scale - 1.0 / 0.6).abs() < 1e-12);
}

#[test]
fn a_planted_tint_is_chroma() {
    let tint = [1.25, 0.95, 0.8];
    let found = explained(&discs(|_, _, t| std::array::from_fn(|c| tint[c] * t[c])));
    check(&found, 2, 0.9);
    for (found_scale, tint) in found.channel_scales.iter().zip(tint) {
        assert!((found.scale * found_scale * tint - 1.0).abs() < 1e-12);
    }
}

/// Brighter to the right and down, as from a window.
#[test]
fn planted_shading_is_shading() {
    let found = explained(&discs(|x, y, t| {
        let light = 0.5 + 0.8 * ((x % 1000) as f64 / 80.0) + 0.3 * (y as f64 / 60.0).powi(3);
        t.map(|v| v * light)
    }));
    check(&found, 3, 0.9);
}

/// The prediction lies 3 pixels too far right and 2 too high.
#[test]
fn a_planted_shift_is_misplacement() {
    let found = explained(&discs(|x, y, _| texture(x - 3, y + 2)));
    check(&found, 4, 0.8);
    assert_eq!(found.shifts.iter().map(|shift| shift.pixels).collect::<Vec<_>>(), [[-3, 2]; 2]);
}

#[test]
fn planted_blur_is_detail() {
    for sigma in [1.0, 2.0, 4.0] {
        let patches = discs(|_, _, t| t).into_iter().map(|patch| {
            let predicted = lost_detail::blurred(&patch, sigma);
            Patch::new(patch.view, patch.places, patch.truth, predicted, patch.observed)
        });
        let found = explained(&patches.collect::<Vec<_>>());
        check(&found, 5, 0.95);
        assert_eq!(found.blur_sigma_pixels, Some(sigma));
    }
}

/// The twin of them all: detail of another texture is of no known kind.
#[test]
fn planted_noise_is_rest() {
    let found = explained(&discs(|x, y, t| {
        let other = texture(x + 500_000, y);
        std::array::from_fn(|c| t[c] + other[c] - 0.5)
    }));
    check(&found, 6, 0.75);
}

/// A disc whose upper part the photo does not show: an error there is of no other kind, and does not change the kinds
/// of the errors in the lower part.
#[test]
fn errors_of_hidden_surfaces_stay_apart() {
    let hidden = |mut patches: Vec<Patch>| {
        for patch in &mut patches {
            patch.observed = patch.places.iter().map(|[_, y]| *y >= 30).collect();
        }
        patches
    };
    let flat_above = explained(&hidden(discs(|_, y, t| if y < 30 { [0.5; 3] } else { t })));
    check(&flat_above, 0, 0.999);
    let both = explained(&hidden(discs(|_, y, t| if y < 30 { [0.5; 3] } else { t.map(|v| 0.6 * v) })));
    let shares = list(&both.kinds().unwrap());
    let below = 1.0 - shares[0];
    assert!((0.1..0.9).contains(&below) && shares[1] > 0.999 * below, "{shares:?}");
    assert_eq!(both.unobserved_pixels, flat_above.unobserved_pixels);
    assert!((0.4..0.6).contains(&(both.unobserved_pixels as f64 / both.pixels as f64)));
}

#[test]
fn flat_predictions_do_not_improve_by_moving() {
    let found = explained(&discs(|_, _, _| [0.5; 3]));
    check(&found, 5, 0.8);
    assert!(found.shifts.is_empty());
}

#[test]
fn the_truth_has_no_kinds() {
    let found = explained(&discs(|_, _, t| t));
    assert_eq!((found.kinds(), found.mse()), (None, 0.0));
}

/// Patches of one pixel, of one row and of black pixels do not fail, and their shares add up.
#[test]
fn degenerate_patches() {
    let row = |length: usize, predicted: Pixel| {
        let places: Vec<[usize; 2]> = (0..length).map(|x| [x, 7]).collect();
        let truth: Vec<Pixel> = places.iter().map(|[x, y]| texture(*x as i64, *y as i64)).collect();
        let observed = observed_all(&truth);
        Patch::new(0, places, truth, vec![predicted; length], observed)
    };
    for (length, predicted) in [(1, [0.2; 3]), (100, [0.2; 3]), (100, [0.0; 3]), (100, [0.2, 0.0, 0.0])] {
        let shares = list(&explained(&[row(length, predicted)]).kinds().unwrap());
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9 && shares.iter().all(|v| *v > -1e-12), "{shares:?}");
    }
}

/// Two instances as one scene: the parts of the sum are the sums of the parts.
#[test]
fn sums_of_instances_add_up() {
    let all = [explained(&discs(|_, _, t| t.map(|v| 0.6 * v))), explained(&discs(|x, y, _| texture(x - 3, y + 2)))];
    let whole = Explained::sum(all.iter());
    let shares = list(&whole.kinds().unwrap());
    assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    let scale = all.iter().map(|one| one.squared_error * one.kinds().unwrap().scale).sum::<f64>();
    assert!((shares[1] * whole.squared_error - scale).abs() < 1e-9 * scale);
}

fn errors(instance: &str, views: Views, pixels: usize, mse: f64) -> InstancePixelErrors {
    InstancePixelErrors {
        scene: SceneId::new("s").unwrap(),
        instance: InstanceId::new(instance).unwrap(),
        category: None,
        super_category: None,
        picture: PictureKind::RgbTrue,
        views,
        pixels,
        mse,
    }
}

/// 10 * 0.2 + 30 * 0.2 = 8 against 100 * 0.02 = 2; unobserved pixels belong to the novel views and are not counted
/// twice.
#[test]
fn lights_worst_instances_by_share() {
    let instances = vec![
        errors("a", Views::Input, 10, 0.2),
        errors("a", Views::Novel, 30, 0.2),
        errors("a", Views::Unobserved, 30, 9.0),
        errors("b", Views::Input, 100, 0.02),
    ];
    let scores = ProtocolResult {
        protocol: Protocol::named("mateval-3").unwrap(),
        fingerprint: String::new(),
        summary: BTreeMap::new(),
        scenes: BTreeMap::new(),
        summary_noise: BTreeMap::new(),
        noise: BTreeMap::new(),
        fits: BTreeMap::new(),
        pictures: Vec::new(),
        texels: Vec::new(),
        instances,
    };
    let shares = light::worst(&scores, &SceneId::new("s").unwrap());
    assert_eq!(shares.iter().map(|share| share.instance.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert!((shares[0].share - 0.8).abs() < 1e-12 && (shares[0].mse - 0.2).abs() < 1e-12);
    assert!(light::worst(&scores, &SceneId::new("t").unwrap()).is_empty());
}

/// Text and page hold the same numbers, and the rows of a table have the same length.
#[test]
fn text_and_page() {
    let kinds = KindShares {
        unobserved: 0.25,
        scale: 0.25,
        chroma: 0.25,
        shading: 0.125,
        misplacement: 0.125,
        detail: 0.0,
        rest: 0.0,
    };
    let file = super::file::ExplainFile {
        format: super::file::EXPLAIN_FORMAT.to_owned(),
        tool: String::new(),
        method: "m".to_owned(),
        submission_sha256: String::new(),
        dataset_manifest_sha256: String::new(),
        protocol: "mateval-3".to_owned(),
        fingerprint: String::new(),
        scene: SceneId::new("s").unwrap(),
        views: vec![mateval_scene::ViewId::new("input").unwrap()],
        pixels: 12,
        unobserved_pixels: 3,
        mse: 0.01,
        psnr: 20.0,
        kinds: Some(kinds),
        instances: Vec::new(),
        alignments: Vec::new(),
        light: Vec::new(),
        findings: Vec::new(),
    };
    let plain = text::plain(&file);
    assert!(
        plain.starts_with("m, scene s: albedo MSE 10.000 (1e-3, linear), PSNR 20.00 dB, over 12 pixels in 1 views")
    );
    assert!(plain.contains("(whole scene)"), "{plain}");
    let first = "25.0 % of the squared error lies in the 25.0 % of the pixels whose surface the photo does not show.";
    assert_eq!(plain.lines().nth(1), Some(first));
    let page = text::markdown(&file, &[]);
    let row = "| (whole scene) |  | 100.0 | 12 | 10.000 | 25.0 | 25.0 | 25.0 | 12.5 | 12.5 | 0.0 | 0.0 |\n";
    assert!(page.contains(row), "{page}");
    let lengths: Vec<usize> = page
        .lines()
        .take_while(|line| !line.starts_with("## What"))
        .filter(|line| line.starts_with('|'))
        .map(|line| line.matches('|').count())
        .collect();
    assert_eq!(lengths, [13; 3]);
}
