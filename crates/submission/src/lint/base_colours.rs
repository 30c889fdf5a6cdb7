//! Base colours compared with the input picture: turned atlases, exchanged channels, numbers that were encoded or
//! decoded once too often, light and shadow baked in.

use mateval_dataset::Finding;
use mateval_image::LinearRgb;
use mateval_image::transfer::{linear_from_srgb, srgb_from_linear};

use super::sight::{Look, Pairs, Turn};
use crate::error::warning;

/// Fewest pixels of a scene that allow a judgement.
const FEWEST_PIXELS: f64 = 400.0;
/// Darker values hold more noise than material.
const DARKEST: f64 = 1e-3;

/// The least correlation of the base colour, turned back, with the picture.
const LEAST_TURNED_CORRELATION: f64 = 0.35;
/// How much larger that must be than the correlation of the base colour as it is.
const LEAST_TURNED_GAIN: f64 = 0.25;

/// A finding where another turn explains the picture clearly better: v was counted from the wrong end, say, or left and
/// right are exchanged.
///
/// Within an instance and a small neighbourhood of the picture, light hardly changes: a brighter pixel shows a brighter
/// material. So the base colour correlates with the picture where it lies right and does not where it was turned.
/// Turning it back must then restore the correlation.
pub(super) fn turned(place: &str, looks: &[Look]) -> Option<Finding> {
    let own = detail(looks, 0);
    let (turn, best) = (1..Turn::ALL.len())
        .map(|at| (Turn::ALL[at], detail(looks, at)))
        .max_by(|a, b| a.1.correlation().total_cmp(&b.1.correlation()))?;
    let (now, then) = (own.correlation(), best.correlation());
    if own.count() < FEWEST_PIXELS || then < LEAST_TURNED_CORRELATION || then - now < LEAST_TURNED_GAIN {
        return None;
    }
    let (code, what, action) = match turn {
        Turn::None => return None,
        Turn::Vertical => {
            ("flipped_vertically", "upside down", "write row 0 of a texture at v = 0 of instances.glb: the top")
        }
        Turn::Horizontal => ("flipped_horizontally", "left and right exchanged", "write column 0 at u = 0"),
        Turn::Half => ("turned_half", "turned by half a turn", "write column 0 at u = 0, row 0 at v = 0: the top left"),
        Turn::Transposed => ("transposed", "rows and columns exchanged", "write u along rows, v along columns"),
    };
    let message = format!(
        "base colours seem {what}: turned back, their detail correlates with the input picture's by {then:.2}, as they are by \
         {now:.2} (over {:.0} pixels)",
        own.count()
    );
    Some(warning(code, place, message, action))
}

/// Brightness of the base colour and of the picture, within instances and neighbourhoods.
fn detail(looks: &[Look], turn: usize) -> Pairs {
    let pair = |look: &Look| {
        let [base, photo] = [LinearRgb(look.base_color[turn]).luminance(), LinearRgb(look.photo?).luminance()];
        (photo > DARKEST).then(|| ((look.instance, look.tile), base.max(DARKEST).ln(), photo.ln()))
    };
    Pairs::within(looks.iter().filter_map(pair))
}

/// The least standard deviation, of logarithms, of the hues of base colours and of the picture.
const LEAST_HUE: f64 = 0.1;
/// The least strength of a negative correlation with the picture from which channels count as exchanged.
const LEAST_EXCHANGED: f64 = 0.5;
/// The least correlation of hues with the picture from which their strength is judged.
const LEAST_HUE_CORRELATION: f64 = 0.8;
/// The factor by which the hues of base colours are stronger than those of the picture, since all surfaces reflect some
/// white light off their facets. On the built-in scenes the truth's is 1.23 to 1.26.
const PALER_PICTURE: f64 = 1.2;
/// Hues stronger or weaker than expected by this factor are decoded wrongly. Up to 2.2 is expected then (1.56 on a
/// built-in scene, whose strongest hues are too dark to count), 1 otherwise.
const LEAST_FACTOR: f64 = 1.45;
/// Darker values hold more noise and rounding than hue.
const DARKEST_HUE: f32 = 0.01;

/// Whether the base colours of a scene were written as they are read, judged by their hues.
///
/// A quotient of two channels does not depend on brightness. In the picture it is the material's, times that of the
/// light, which hardly varies within a scene. So log(red / blue) and log(red / green) of picture and base colour lie
/// along a line of slope 1. Exchanging red and blue makes the slope of the first negative. The sRGB curve is close to a
/// power of 2.2: values decoded once too often are 2.2 times as far from grey, values decoded once too few 2.2 times as
/// near.
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

/// A finding where red and blue are exchanged.
pub(super) fn swapped_red_blue(place: &str, looks: &[Look]) -> Option<Finding> {
    let hues = hue(looks, 2, |value| value);
    let [base, photo] = hues.deviations();
    let correlation = hues.correlation();
    if hues.count() < FEWEST_PIXELS || base < LEAST_HUE || photo < LEAST_HUE || correlation > -LEAST_EXCHANGED {
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

/// The strength of the base colour's hues over that of the picture's; absent if they do not correlate.
fn strength(looks: &[Look], change: fn(f32) -> f32) -> Option<f64> {
    let hues = [1, 2].map(|channel| hue(looks, channel, change));
    let judged = hues.iter().filter(|hues| {
        let [base, photo] = hues.deviations();
        hues.count() >= FEWEST_PIXELS
            && base.min(photo) >= LEAST_HUE / 2.0
            && hues.correlation() >= LEAST_HUE_CORRELATION
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
        if [base[0], base[channel], photo[0], photo[channel]].iter().all(|value| *value > DARKEST_HUE) {
            let ratio = |rgb: [f32; 3]| f64::from(rgb[0] / rgb[channel]).ln();
            pairs.add(ratio(base), ratio(photo));
        }
    }
    pairs
}

/// Fewest measured pixels, of all scenes together, that allow a judgement.
const FEWEST_TOGETHER: usize = 3000;
/// White is white in every reading, and pictures are clipped there: brighter base colours do not count for brightness.
const WHITE: f64 = 0.98;
/// Least share of a scene's pixels that must be darker than [`WHITE`] for its brightness to be measured.
const LEAST_COLOURED: f64 = 0.1;
/// Darker values are replaced by this one: bytes resolve them too coarsely.
const DARKEST_READING: f64 = 2e-3;
/// Base colours that correlate less with the picture, or vary less (standard deviation of logarithms), have no slope.
const LEAST_SLOPE_CORRELATION: f64 = 0.35;
const LEAST_SLOPE_CONTRAST: f64 = 0.05;

/// The distribution of a number over rooms.
struct Typical {
    mean: f64,
    deviation: f64,
}

/// Over the truth and its baselines (lifted, medians, procedural, of the truth and of de-lit pictures) of eleven rooms:
/// the built-in sample, six rooms of two 3D-FRONT houses, and three of Bitterli's scenes, at 96x72 and 320x240 pixels.
const BRIGHTNESS: Typical = Typical { mean: -1.38, deviation: 0.37 };
const SLOPE: Typical = Typical { mean: -0.18, deviation: 0.23 };
/// Numbers further from [`Typical::mean`] count as this number of deviations. So a number that is typical in another
/// reading gains at most half the square of it, which is [`LEAST_READING_GAIN`], and does not suffice alone.
const MOST_DEVIATIONS: f64 = 3.0;
/// How much larger the log-likelihood of another reading must be for a warning.
const LEAST_READING_GAIN: f64 = 4.5;

/// How base colours are read.
#[derive(Clone, Copy, Debug)]
enum Reading {
    AsTheyAre,
    DecodedOnceMore,
    EncodedOnceMore,
}

impl Reading {
    const ALL: [Self; 3] = [Self::AsTheyAre, Self::DecodedOnceMore, Self::EncodedOnceMore];

    fn luminance(self, rgb: [f32; 3]) -> f64 {
        let read = match self {
            Self::AsTheyAre => rgb,
            Self::DecodedOnceMore => rgb.map(linear_from_srgb),
            Self::EncodedOnceMore => rgb.map(srgb_from_linear),
        };
        LinearRgb(read).luminance()
    }
}

/// The two numbers of a scene in each of [`Reading::ALL`]. They reveal base colours that were encoded or decoded once
/// too often, in files of any kind, by comparison with typical rooms.
///
/// If a method's pictures hold sRGB numbers and are lifted as if they were linear, or the reverse, all maps are valid
/// and far too bright or too dark. [`decoding`] compares hues and names the kind of file that was written wrongly. This
/// check compares brightness, so that the kind of file does not matter and rooms without strong hues are judged too.
///
/// - The mean of ln(luminance). Few surfaces of a room are nearly black or nearly white: for rooms that are lit by
///   electric light EN 12464-1 recommends reflectances of 0.7 to 0.9 for ceilings, 0.5 to 0.8 for walls, 0.2 to 0.7 for
///   furniture and 0.2 to 0.4 for floors. Encoding turns 0.3 into 0.58, and decoding turns it into 0.07.
/// - The slope of ln(picture) over ln(base colour), pixel by pixel. It is near 1, because light hardly depends on the
///   base colour that it falls on, and a little less, because glossy reflections brighten dark surfaces most. Encoding
///   is close to a power of 1 / 2.2 and doubles the slope; decoding halves it. Noise in the picture does not change it.
///
/// The better a reading fits rooms, the larger its log-likelihood under two normal distributions. Either number may be
/// far off for another reason: the input picture as base colour is as dark as its exposure, and a poor estimate has too
/// little contrast. So neither suffices for a warning without the other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Readings {
    /// Measured pixels.
    pixels: usize,
    /// The mean of ln(luminance); absent for a scene that is white.
    brightness: Option<[f64; 3]>,
    /// ln of the slope; absent without a picture, or if the base colours do not explain it.
    slope: Option<[f64; 3]>,
}

pub(super) fn readings(looks: &[Look]) -> Readings {
    if looks.len() < FEWEST_PIXELS as usize {
        return Readings::default();
    }
    Readings { pixels: looks.len(), brightness: brightness(looks), slope: slope(looks) }
}

fn brightness(looks: &[Look]) -> Option<[f64; 3]> {
    // All readings use the same pixels.
    let coloured: Vec<[f32; 3]> =
        looks.iter().map(Look::own).filter(|rgb| Reading::AsTheyAre.luminance(*rgb) < WHITE).collect();
    let count = coloured.len() as f64;
    let mean = |reading: Reading| {
        coloured.iter().map(|rgb| reading.luminance(*rgb).max(DARKEST_READING).ln()).sum::<f64>() / count
    };
    (count >= LEAST_COLOURED * looks.len() as f64).then(|| Reading::ALL.map(mean))
}

fn slope(looks: &[Look]) -> Option<[f64; 3]> {
    let all = Reading::ALL.map(|reading| against_photo(looks, reading));
    let [as_they_are, ..] = all;
    let is_explained = as_they_are.count() >= FEWEST_PIXELS && as_they_are.correlation() >= LEAST_SLOPE_CORRELATION;
    if !is_explained || as_they_are.deviations()[0] < LEAST_SLOPE_CONTRAST {
        return None;
    }
    let slopes = all.map(|pairs| {
        let [base, photo] = pairs.deviations();
        pairs.correlation() * photo / base
    });
    slopes.iter().all(|slope| *slope > 0.0).then(|| slopes.map(f64::ln))
}

/// ln(base colour) and ln(picture) of each pixel.
fn against_photo(looks: &[Look], reading: Reading) -> Pairs {
    let mut pairs = Pairs::default();
    for look in looks {
        let photo = look.photo.map_or(0.0, |photo| LinearRgb(photo).luminance());
        if photo > DARKEST_READING {
            pairs.add(reading.luminance(look.own()).max(DARKEST_READING).ln(), photo.ln());
        }
    }
    pairs
}

/// A finding if the base colours of the whole submission are clearly closer to rooms in another reading. Numbers are
/// means over scenes: a wrong script is wrong in all of them, and the peculiarities of single rooms cancel.
pub(super) fn untypical_encoding(scenes: &[Readings]) -> Option<Finding> {
    let pixels: usize = scenes.iter().map(|scene| scene.pixels).sum();
    let brightness = means(scenes.iter().filter_map(|scene| scene.brightness))?;
    let slope = means(scenes.iter().filter_map(|scene| scene.slope))?;
    let fit = |at: usize| log_likelihood(brightness[at], &BRIGHTNESS) + log_likelihood(slope[at], &SLOPE);
    // In the order of `Reading::ALL`, without `AsTheyAre`.
    let changes = [
        ("encoded_twice", "decoded once more (from sRGB to linear)"),
        ("decoded_twice", "encoded once more (from linear to sRGB)"),
    ];
    let (best, (code, change)) = (1..).zip(changes).max_by(|a, b| fit(a.0).total_cmp(&fit(b.0)))?;
    if pixels < FEWEST_TOGETHER || fit(best) - fit(0) <= LEAST_READING_GAIN {
        return None;
    }
    let shown = |numbers: [f64; 3], typical: &Typical| {
        let [own, then, rooms] = [numbers[0], numbers[best], typical.mean].map(f64::exp);
        format!("{own:.2} as they are, {then:.2} then, {rooms:.2} in rooms")
    };
    let message = format!(
        "base colours are clearly closer to those of rooms if they are {change}: their geometric mean luminance is {}; the \
         slope of log picture over log base colour is {} (over {pixels} pixels)",
        shown(brightness, &BRIGHTNESS),
        shown(slope, &SLOPE)
    );
    let action = "correct `encoding` in the adapter, or the script that writes the maps; with the ground truth at hand, \
                  `mateval baseline encoding` finds for certain which encoding a method's pictures have";
    Some(warning(code, "scenes", message, action))
}

/// The mean of each reading's numbers; absent without numbers.
fn means(scenes: impl Iterator<Item = [f64; 3]>) -> Option<[f64; 3]> {
    let (sums, count) = scenes
        .fold(([0.0; 3], 0), |(sums, count), numbers| (std::array::from_fn(|at| sums[at] + numbers[at]), count + 1));
    (count > 0).then(|| sums.map(|sum| sum / f64::from(count)))
}

fn log_likelihood(number: f64, typical: &Typical) -> f64 {
    let deviations = ((number - typical.mean) / typical.deviation).abs().min(MOST_DEVIATIONS);
    -deviations * deviations / 2.0
}

/// The least standard deviation, of logarithms, of the picture's brightness within instances.
const LEAST_SHADING: f64 = 0.15;
/// The correlation from which the base colour is the picture itself: at most a tenth of the picture's variance is left
/// to light. A picture of 64x48 pixels, blurred by resampling to atlases, reaches 0.97; the truth 0.3 to 0.4.
const LEAST_SHADED_CORRELATION: f64 = 0.95;

/// A finding where the base colour is the input picture itself, with its light and shadow: where, within
/// instances, it varies in brightness as the picture does.
pub(super) fn shading_baked_in(place: &str, looks: &[Look]) -> Option<Finding> {
    let pair = |look: &Look| {
        let [base, photo] = [LinearRgb(look.own()).luminance(), LinearRgb(look.photo?).luminance()];
        // Pictures are clipped at white.
        (photo > DARKEST && base > DARKEST && base < 0.98).then(|| (look.instance, base.ln(), photo.ln()))
    };
    let pairs = Pairs::within(looks.iter().filter_map(pair));
    let ([_, photo], correlation) = (pairs.deviations(), pairs.correlation());
    if pairs.count() < FEWEST_PIXELS || photo < LEAST_SHADING || correlation < LEAST_SHADED_CORRELATION {
        return None;
    }
    let message = format!(
        "base colours are the input picture with its light and shadow (correlation {correlation:.3} within instances, \
         over {:.0} pixels)",
        pairs.count()
    );
    Some(warning("shading_baked_in", place, message, "remove the light: base colour belongs to the material alone"))
}

#[cfg(test)]
mod tests {
    use mateval_dataset::splitmix64::number;

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

    /// Reflectances of white paint, a grey wall, wood, cloth and black plastic.
    const SURFACES: [f32; 5] = [0.75, 0.5, 0.3, 0.12, 0.05];

    /// A room of 40 surfaces under light that varies by a factor of 4, seen in 4000 pixels; `write` makes the base
    /// colour of a reflectance and of the picture.
    fn room(write: impl Fn(f32, f32) -> f32) -> Vec<Look> {
        let look = |at: usize| {
            let light = 0.5 * libm::exp2f((number(3, at as u64) >> 40) as f32 / (1 << 23) as f32);
            let reflectance = SURFACES[at / 100 % 5];
            // Facets reflect some light unchanged.
            let photo = light * (0.96 * reflectance + 0.02);
            Look {
                instance: at / 100,
                tile: at / 250,
                photo: Some([photo; 3]),
                base_color: [[write(reflectance, photo); 3]; 5],
            }
        };
        (0..4000).map(look).collect()
    }

    fn code(looks: &[Look]) -> Option<String> {
        untypical_encoding(&[readings(looks)]).map(|finding| finding.code)
    }

    #[test]
    fn each_wrong_reading_is_found_and_the_right_one_is_not() {
        assert_eq!(code(&room(|truth, _| truth)), None);
        assert_eq!(code(&room(|truth, _| srgb_from_linear(truth))).as_deref(), Some("encoded_twice"));
        assert_eq!(code(&room(|truth, _| linear_from_srgb(truth))).as_deref(), Some("decoded_twice"));
    }

    /// Base colours that are untypical of rooms in one of the numbers only.
    #[test]
    fn one_number_alone_is_not_enough() {
        // A dark picture as base colour, a single colour, and colours that are half as bright as they should be.
        assert_eq!(code(&room(|_, photo| 0.05 * photo)), None);
        for grey in [0.02, 0.5, 0.9] {
            assert_eq!(code(&room(|_, _| grey)), None, "{grey}");
        }
        assert_eq!(code(&room(|truth, _| 0.25 * truth)), None);
        // As little contrast as encoding leaves, as bright as rooms are.
        assert_eq!(code(&room(|truth, _| 0.35 * srgb_from_linear(truth))), None);
        let mut unlit = room(|truth, _| srgb_from_linear(truth));
        unlit.iter_mut().for_each(|look| look.photo = None);
        assert_eq!(code(&unlit), None);
    }

    /// Scenes are judged together: enough pixels, and the same mistake in all of them.
    #[test]
    fn a_few_pixels_or_half_of_the_scenes_are_not_enough() {
        let [right, wrong] = [room(|truth, _| truth), room(|truth, _| srgb_from_linear(truth))];
        let few: Vec<Look> = wrong.iter().step_by(4).copied().collect();
        assert_eq!(code(&few), None);
        let together = [readings(&few); 3];
        assert_eq!(untypical_encoding(&together).map(|finding| finding.code).as_deref(), Some("encoded_twice"));
        assert_eq!(untypical_encoding(&[readings(&right), readings(&wrong)]), None);
    }
}
