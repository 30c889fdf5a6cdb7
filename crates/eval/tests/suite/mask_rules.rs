//! The effect of the paper's mask rule on a strip: most of the frame is black in both pictures and counts as equal.

use std::collections::BTreeMap;

use mateval_eval::materials::score::measure_albedo;
use mateval_eval::metric::{ColorPicture, Metric};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::PictureValues;
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_metrics::Lpips;
use mateval_metrics::mask_rule::MaskRule;

use super::sample::lpips;

/// Wide, so that few of its windows lie across a strip's edge.
const WIDTH: usize = 960;
const HEIGHT: usize = 64;

/// A wall with a pattern, posts and a slope of light.
fn reference() -> Picture<LinearRgb> {
    Picture::from_fn(WIDTH, HEIGHT, |x, y| {
        let wave = |k: f32| 0.5 + 0.5 * libm::sinf(k);
        let slope = 0.3 + 0.6 * (x % 240) as f32 / 240.0;
        let post = if (x / 20 + y / 16) % 3 == 0 { 0.5 } else { 1.0 };
        LinearRgb([slope * post, 0.6 * wave(x as f32 / 7.0) * post, 0.5 * wave((x + 2 * y) as f32 / 11.0)])
    })
}

fn prediction() -> Picture<LinearRgb> {
    let reference = reference();
    Picture::from_fn(WIDTH, HEIGHT, |x, y| {
        let LinearRgb([r, g, b]) = reference.get(x, y);
        let patch = if (x / 8 + y / 8) % 2 == 0 { 0.75 } else { 1.0 };
        LinearRgb([r * patch, 0.5 * g + 0.1, b * patch])
    })
}

/// Both strips of a share, at the left and at the right edge.
fn strips(columns: usize) -> [Mask; 2] {
    [Mask::from_fn(WIDTH, HEIGHT, |x, _| x < columns), Mask::from_fn(WIDTH, HEIGHT, |x, _| x >= WIDTH - columns)]
}

fn measured(rule: MaskRule, mask: &Mask, lpips: Option<&Lpips>) -> BTreeMap<Metric, f64> {
    let protocol = Protocol { mask_rule: rule, ..Protocol::named("mateval-3").unwrap() };
    let (prediction, reference) = (ColorPicture::new(prediction()), ColorPicture::new(reference()));
    let mut values: PictureValues = serde_json::from_value(serde_json::json!({
        "scene": "s", "view": "input", "picture": "albedo", "region": "valid", "pixels": 1, "values": {},
    }))
    .unwrap();
    measure_albedo(&protocol, lpips, &prediction, &reference, mask, true, &mut values).unwrap();
    values.values
}

/// Ten of the 950 columns of SSIM's windows lie across the strip's edge. Each is between 0 and 1 under both rules, so
/// the two differ by at most 10 / 950. LPIPS of a strip depends slightly on the surroundings, black or the truth, since
/// its receptive fields are larger than the strip. This gives no bound; 15 % of its value was sufficient.
#[test]
fn a_black_frame_dilutes_a_strip() {
    const ACROSS: f64 = 10.0 / (WIDTH - 10) as f64;
    let lpips = lpips();
    for (columns, other) in [(96, 0.2), (192, 0.1)] {
        let share = columns as f64 / WIDTH as f64;
        for mask in strips(columns) {
            let [inside, black] =
                [MaskRule::Inside, MaskRule::BlackFill].map(|rule| measured(rule, &mask, lpips.as_ref()));
            for metric in [Metric::Mse, Metric::Psnr] {
                assert_eq!(inside[&metric], black[&metric], "{metric} looks outside the strip");
            }
            let [s, diluted] = [&inside, &black].map(|found| found[&Metric::Ssim]);
            let off = |share: f64| (diluted - (1.0 - share * (1.0 - s))).abs();
            assert!(off(share) < ACROSS && off(other) > ACROSS, "{share}: SSIM {s} inside, {diluted} black");
            let [l, diluted] = [&inside, &black].map(|found| found.get(&Metric::LpipsAlex));
            let Some((l, diluted)) = l.zip(diluted) else { continue };
            let off = |share: f64| (diluted / (share * l) - 1.0).abs();
            assert!(off(share) < 0.15 && off(other) > 0.3, "{share}: LPIPS {l} inside, {diluted} black");
        }
    }
}
