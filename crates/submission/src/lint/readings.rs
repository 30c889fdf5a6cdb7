//! Base colours that were encoded or decoded once too often, in files of any kind, found by comparison with typical rooms.
//!
//! If a method's pictures hold sRGB numbers and are lifted as if they were linear, or the reverse, all maps are valid and
//! far too bright or too dark. [`super::colours`] compares hues and names the kind of file that was written wrongly. This
//! check compares brightness, so that the kind of file does not matter and rooms without strong hues are judged too.
//!
//! Base colours are read in three ways: as they are, decoded once more, and encoded once more. Two numbers of each
//! reading are compared with those of rooms:
//!
//! - the mean of ln(luminance). Few surfaces of a room are nearly black or nearly white: for rooms that are lit by
//!   electric light EN 12464-1 recommends reflectances of 0.7 to 0.9 for ceilings, 0.5 to 0.8 for walls, 0.2 to 0.7 for
//!   furniture and 0.2 to 0.4 for floors. Encoding turns 0.3 into 0.58, and decoding turns it into 0.07.
//! - the slope of ln(picture) over ln(base colour), pixel by pixel. It is near 1, because light hardly depends on the base
//!   colour that it falls on, and a little less, because glossy reflections brighten dark surfaces most. Encoding is close
//!   to a power of 1 / 2.2 and doubles the slope; decoding halves it. Noise in the picture does not change it.
//!
//! The better a reading fits rooms, the larger its log-likelihood under two normal distributions. Either number may be far
//! off for another reason: the input picture as base colour is as dark as its exposure, and a poor estimate has too
//! little contrast. So neither suffices for a warning without the other.

use mateval_image::LinearRgb;
use mateval_image::transfer::{linear_from_srgb, srgb_from_linear};
use mateval_scene::Finding;

use super::finding::warning;
use super::looks::Look;
use super::statistics::Pairs;

/// Fewest pixels of a scene that are measured.
const FEWEST: usize = 400;
/// Fewest measured pixels, of all scenes together, that allow a judgement.
const FEWEST_TOGETHER: usize = 3000;
/// White is white in every reading, and pictures are clipped there: brighter base colours do not count for brightness.
const WHITE: f64 = 0.98;
/// Least share of a scene's pixels that must be darker than [`WHITE`] for its brightness to be measured.
const LEAST_COLOURED: f64 = 0.1;
/// Darker values are replaced by this one: bytes resolve them too coarsely.
const DARKEST: f64 = 2e-3;
/// Base colours that correlate less with the picture, or vary less (standard deviation of logarithms), have no slope.
const LEAST_CORRELATION: f64 = 0.35;
const LEAST_CONTRAST: f64 = 0.05;

/// The distribution of a number over rooms.
struct Typical {
    mean: f64,
    deviation: f64,
}

/// Over the truth and its baselines (lifted, medians, procedural, of the truth and of de-lit pictures) of eleven rooms: the
/// built-in sample, six rooms of two 3D-FRONT houses, and three of Bitterli's scenes, at 96x72 and 320x240 pixels.
const BRIGHTNESS: Typical = Typical { mean: -1.38, deviation: 0.37 };
const SLOPE: Typical = Typical { mean: -0.18, deviation: 0.23 };
/// Numbers further from [`Typical::mean`] count as this number of deviations. So a number that is typical in another
/// reading gains at most half the square of it, which is [`LEAST_GAIN`], and does not suffice alone.
const MOST_DEVIATIONS: f64 = 3.0;
/// How much larger the log-likelihood of another reading must be for a warning.
const LEAST_GAIN: f64 = 4.5;

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

/// The two numbers of a scene in each of [`Reading::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Readings {
    /// Measured pixels.
    pixels: usize,
    /// The mean of ln(luminance); absent for a scene that is white.
    brightness: Option<[f64; 3]>,
    /// ln of the slope; absent without a picture, or if the base colours do not explain it.
    slope: Option<[f64; 3]>,
}

/// Measures a scene.
pub(super) fn readings(looks: &[Look]) -> Readings {
    if looks.len() < FEWEST {
        return Readings::default();
    }
    Readings { pixels: looks.len(), brightness: brightness(looks), slope: slope(looks) }
}

fn brightness(looks: &[Look]) -> Option<[f64; 3]> {
    // All readings use the same pixels.
    let coloured: Vec<[f32; 3]> =
        looks.iter().map(Look::own).filter(|rgb| Reading::AsTheyAre.luminance(*rgb) < WHITE).collect();
    let count = coloured.len() as f64;
    let mean =
        |reading: Reading| coloured.iter().map(|rgb| reading.luminance(*rgb).max(DARKEST).ln()).sum::<f64>() / count;
    (count >= LEAST_COLOURED * looks.len() as f64).then(|| Reading::ALL.map(mean))
}

fn slope(looks: &[Look]) -> Option<[f64; 3]> {
    let all = Reading::ALL.map(|reading| against_photo(looks, reading));
    let [as_they_are, ..] = all;
    let is_explained = as_they_are.count() >= FEWEST as f64 && as_they_are.correlation() >= LEAST_CORRELATION;
    if !is_explained || as_they_are.deviations()[0] < LEAST_CONTRAST {
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
        if photo > DARKEST {
            pairs.add(reading.luminance(look.own()).max(DARKEST).ln(), photo.ln());
        }
    }
    pairs
}

/// A finding if the base colours of the whole submission are clearly closer to rooms in another reading. Numbers are means
/// over scenes: a wrong script is wrong in all of them, and the peculiarities of single rooms cancel.
pub(super) fn check(scenes: &[Readings]) -> Option<Finding> {
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
    if pixels < FEWEST_TOGETHER || fit(best) - fit(0) <= LEAST_GAIN {
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

#[cfg(test)]
mod tests {
    use mateval_scene::splitmix64::number;

    use super::*;

    /// Reflectances of white paint, a grey wall, wood, cloth and black plastic.
    const SURFACES: [f32; 5] = [0.75, 0.5, 0.3, 0.12, 0.05];

    /// A room of 40 surfaces under light that varies by a factor of 4, seen in 4000 pixels; `write` makes the base colour
    /// of a reflectance and of the picture.
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
        check(&[readings(looks)]).map(|finding| finding.code)
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
        assert_eq!(check(&together).map(|finding| finding.code).as_deref(), Some("encoded_twice"));
        assert_eq!(check(&[readings(&right), readings(&wrong)]), None);
    }
}
