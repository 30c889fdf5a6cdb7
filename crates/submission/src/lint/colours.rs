//! Base colours that were written wrongly: red and blue exchanged, linear numbers where sRGB is read, or the reverse.
//!
//! A quotient of two channels does not depend on brightness. In the picture it is the material's, times that of the
//! light, which hardly varies within a scene. So log(red / blue) and log(red / green) of picture and base colour lie
//! along a line of slope 1. Exchanging red and blue makes the slope of the first negative. The sRGB curve is close to a
//! power of 2.2: values decoded once too often are 2.2 times as far from grey, values decoded once too few 2.2 times as
//! near.

use mateval_image::transfer::{linear_from_srgb, srgb_from_linear};
use mateval_scene::Finding;

use super::finding::warning;
use super::looks::Look;
use super::statistics::Pairs;

/// Fewest pixels that allow a judgement.
const FEWEST: f64 = 400.0;
/// The least standard deviation, of logarithms, of the hues of base colours and of the picture.
const LEAST_HUE: f64 = 0.1;
/// The least strength of a negative correlation with the picture from which channels count as exchanged.
const LEAST_EXCHANGED: f64 = 0.5;
/// The least correlation of hues with the picture from which their strength is judged.
const LEAST_CORRELATION: f64 = 0.8;
/// The factor by which the hues of base colours are stronger than those of the picture, since all surfaces reflect some white
/// light off their facets. On the built-in scenes the truth's is 1.23 to 1.26.
const PALER_PICTURE: f64 = 1.2;
/// Hues stronger or weaker than expected by this factor are decoded wrongly. Up to 2.2 is expected then (1.56 on a built-in
/// scene, whose strongest hues are too dark to count), 1 otherwise.
const LEAST_FACTOR: f64 = 1.45;
/// Darker values hold more noise and rounding than hue.
const DARKEST: f32 = 0.01;

/// Whether the base colours of a scene were written as they are read, judged by their hues.
#[derive(Debug, Default)]
pub(super) enum Decoding {
    /// Too few hues, no correlation with the picture, or as good a one with either decoding.
    #[default]
    Unknown,
    Right,
    Wrong(Finding),
}

/// The findings of scenes whose base colours were decoded wrongly, if these are most of the scenes that can be judged.
/// One scene proves nothing: reflections of white light make the picture pale as a wrong decoding would. A wrong
/// script, on the other hand, is wrong in every scene.
pub(super) fn mostly_wrong(scenes: Vec<Decoding>) -> Vec<Finding> {
    let judged = scenes.iter().filter(|decoding| !matches!(decoding, Decoding::Unknown)).count();
    let wrong = |decoding| if let Decoding::Wrong(finding) = decoding { Some(finding) } else { None };
    let wrong: Vec<Finding> = scenes.into_iter().filter_map(wrong).collect();
    if 2 * wrong.len() > judged { wrong } else { Vec::new() }
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
        return Decoding::Unknown;
    };
    let [off_own, off_then] = [own, then].map(|strength| strength / PALER_PICTURE);
    let off = if are_png { off_own } else { 1.0 / off_own };
    if off >= LEAST_FACTOR && off_then.ln().abs() <= off_own.ln().abs() / 2.0 {
        let message = format!(
            "base colours seem to be {what}: their hues are {own:.2} times as strong as the input picture's, {then:.2} times \
             once corrected"
        );
        return Decoding::Wrong(warning(code, place, message, action));
    }
    if off_own.ln().abs() <= off_then.ln().abs() / 2.0 { Decoding::Right } else { Decoding::Unknown }
}

/// The strength of the base colour's hues over that of the picture's; none where they do not correlate.
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
    use super::Decoding::{Right, Unknown, Wrong};
    use super::*;

    #[test]
    fn most_scenes_must_agree() {
        let wrong = || Wrong(warning("linear_in_png", "scenes/a", String::new(), "encode"));
        assert_eq!(mostly_wrong(vec![wrong(), Unknown, Unknown]).len(), 1);
        assert_eq!(mostly_wrong(vec![wrong(), Right, wrong()]).len(), 2);
        assert_eq!(mostly_wrong(vec![wrong(), Right]).len(), 0);
        assert_eq!(mostly_wrong(vec![Right, Unknown]).len(), 0);
    }
}
