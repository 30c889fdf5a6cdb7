//! Colours that are decoded wrongly: red and blue exchanged, linear numbers taken for sRGB or the reverse.
//!
//! The hue of the picture is that of the material, but for the light's own, which is much the same all over: brightness
//! cancels where channels are divided. So log(red / blue) and log(red / green) of picture and base colour lie along a
//! line of slope 1. Exchanged channels make the slope of the first negative. The curve of sRGB is nearly a power of 2.2:
//! numbers decoded once too often are 2.2 times as far from grey, numbers decoded once too few 2.2 times as near.

use mateval_image::transfer::{linear_from_srgb, srgb_from_linear};
use mateval_scene::Finding;

use super::finding::warning;
use super::looks::Look;
use super::statistics::Pairs;

/// Fewest pixels that say anything.
const FEWEST: f64 = 400.0;
/// How much hues of materials and picture must differ from place to place, as a standard deviation of logarithms.
const LEAST_HUE: f64 = 0.1;
/// How well exchanged channels must go along with the picture.
const LEAST_EXCHANGED: f64 = 0.5;
/// How well hues must go along with the picture before their strength is judged.
const LEAST_CORRELATION: f64 = 0.8;
/// Base colours whose hues are this many times as strong as the picture's, or as weak, are decoded wrongly; 2.2 is expected
/// then, 1 otherwise.
const LEAST_FACTOR: f64 = 1.6;
/// Darker values say more of noise, and of rounding, than of hues.
const DARKEST: f32 = 0.01;

/// How the base colours of a scene were decoded, judged by its hues.
#[derive(Debug, Default)]
pub(super) enum Decoding {
    /// There are too few hues, they do not match the picture, or they match it equally well with either decoding.
    #[default]
    Unclear,
    Right,
    Wrong(Finding),
}

/// The findings of scenes whose base colours were decoded wrongly, if they are most of the scenes with a clear decoding. A
/// single scene proves nothing: reflections of white light pale the picture as a wrong decoding would, and a method that
/// decodes wrongly does so in every scene.
pub(super) fn mostly_wrong(scenes: Vec<Decoding>) -> Vec<Finding> {
    let clear = scenes.iter().filter(|decoding| !matches!(decoding, Decoding::Unclear)).count();
    let wrong = |decoding| if let Decoding::Wrong(finding) = decoding { Some(finding) } else { None };
    let wrong: Vec<Finding> = scenes.into_iter().filter_map(wrong).collect();
    if 2 * wrong.len() > clear { wrong } else { Vec::new() }
}

/// Whether red and blue are exchanged.
pub(super) fn exchanged(place: &str, looks: &[Look]) -> Option<Finding> {
    let hues = hue(looks, 2, |value| value);
    let [base, photo] = hues.deviations();
    let correlation = hues.correlation();
    if hues.count() < FEWEST || base < LEAST_HUE || photo < LEAST_HUE || correlation > -LEAST_EXCHANGED {
        return None;
    }
    let message = format!(
        "red and blue seem exchanged: where base colours are redder the input picture is bluer (correlation \
         {correlation:.2} over {:.0} pixels)",
        hues.count()
    );
    Some(warning("swapped_red_blue", place, message, "write red, green, blue in this order (OpenCV has blue first)"))
}

/// `are_png` says what most files of the scene are.
pub(super) fn decoding(place: &str, looks: &[Look], are_png: bool) -> Decoding {
    let (code, what, action, corrected): (_, _, _, fn(f32) -> f32) = if are_png {
        let action = "encode base_color.png as sRGB";
        ("linear_in_png", "linear numbers in PNG, which are read as sRGB", action, srgb_from_linear)
    } else {
        let action = "decode sRGB before base_color.exr is written";
        ("srgb_in_exr", "sRGB numbers in EXR, which are read as linear", action, linear_from_srgb)
    };
    let (Some(own), Some(then)) = (strength(looks, |value| value), strength(looks, corrected)) else {
        return Decoding::Unclear;
    };
    let off = if are_png { own } else { 1.0 / own };
    if off >= LEAST_FACTOR && then.ln().abs() <= own.ln().abs() / 2.0 {
        let message = format!(
            "base colours seem to be {what}: their hues are {own:.2} times as strong as the input picture's, {then:.2} times \
             after that correction"
        );
        return Decoding::Wrong(warning(code, place, message, action));
    }
    if own.ln().abs() <= then.ln().abs() / 2.0 { Decoding::Right } else { Decoding::Unclear }
}

/// How many times as strong the base colour's hues are as the picture's; none where they do not go along with it.
fn strength(looks: &[Look], change: fn(f32) -> f32) -> Option<f64> {
    let hues = [1, 2].map(|channel| hue(looks, channel, change));
    let judged = hues.iter().filter(|hues| {
        let [base, photo] = hues.deviations();
        hues.count() >= FEWEST && base.min(photo) >= LEAST_HUE / 2.0 && hues.correlation() >= LEAST_CORRELATION
    });
    judged
        .map(|hues| hues.deviations())
        .map(|[base, photo]| base / photo)
        .min_by(|a, b| a.ln().abs().total_cmp(&b.ln().abs()))
}

/// log(red / `channel`) of base colour and picture.
fn hue(looks: &[Look], channel: usize, change: fn(f32) -> f32) -> Pairs {
    let mut pairs = Pairs::default();
    for look in looks {
        let Some(photo) = look.photo else { continue };
        let [base, photo] = [look.own().map(change), photo];
        if [base[0], base[channel], photo[0], photo[channel]].iter().all(|value| *value > DARKEST) {
            let ratio = |rgb: [f32; 3]| f64::from(rgb[0] / rgb[channel]).ln();
            pairs.add(ratio(base), ratio(photo));
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::Decoding::{Right, Unclear, Wrong};
    use super::*;

    #[test]
    fn most_scenes_must_agree() {
        let wrong = || Wrong(warning("linear_in_png", "scenes/a", String::new(), "encode"));
        assert_eq!(mostly_wrong(vec![wrong(), Unclear, Unclear]).len(), 1);
        assert_eq!(mostly_wrong(vec![wrong(), Right, wrong()]).len(), 2);
        assert_eq!(mostly_wrong(vec![wrong(), Right]).len(), 0);
        assert_eq!(mostly_wrong(vec![Right, Unclear]).len(), 0);
    }
}
