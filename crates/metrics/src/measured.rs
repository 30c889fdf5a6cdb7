//! Scores of regions whose colour was measured: MAW's two numbers as its board has them, and CIEDE2000 without any
//! scale.
//!
//! MAW (Wu et al., "Measured Albedo in the Wild", ICCP 2023; MeasuredAlbedo/code, `numerical_albedo.py`) sees a
//! prediction as an 8-bit sRGB picture of 320x240 pixels, which Pillow has made of it, and a region as the mean of its
//! linear pixels. Its intensity error multiplies all regions by the one factor that fits best; its chromaticity error
//! multiplies each region by a factor of its own. [`maw_picture`] and [`maw_mask`] make Pillow's bytes.
//!
//! Lab is that of colour-science's defaults: the four-digit matrix of IEC 61966-2-1, and the white of D65 at the
//! chromaticity (0.3127, 0.3290).

use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{LinearRgb, Picture};

/// Width and height of the pictures that MAW compares.
pub const MAW_SIZE: [usize; 2] = [320, 240];
/// The least denominator of a factor that is fitted.
pub const MAW_LEAST: f64 = 1e-6;

/// A region's colours, linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionColors {
    /// The pixels whose mean `predicted` is.
    pub pixels: usize,
    pub predicted: [f64; 3],
    pub measured: [f64; 3],
}

const XYZ_FROM_SRGB: [[f64; 3]; 3] = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
const WHITE: [f64; 3] = [0.3127 / 0.3290, 1.0, (1.0 - 0.3127 - 0.3290) / 0.3290];

/// CIE Lab of a linear colour of at most 1 a channel.
fn lab(color: [f64; 3]) -> [f64; 3] {
    let color = color.map(|value| value.min(1.0));
    let f = |t: f64| if t > (24.0_f64 / 116.0).powi(3) { libm::cbrt(t) } else { 841.0 / 108.0 * t + 16.0 / 116.0 };
    let [x, y, z] = std::array::from_fn(|row| {
        let [a, b, c] = XYZ_FROM_SRGB[row];
        f((a * color[0] + b * color[1] + c * color[2]) / WHITE[row])
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIEDE2000 of two linear colours, which are clipped to at most 1. Not [`crate::color_difference`]: another Lab.
pub fn measured_difference(a: [f64; 3], b: [f64; 3]) -> f64 {
    ciede2000(lab(a), lab(b))
}

/// CIEDE2000 of two colours of CIE Lab (Sharma, Wu and Dalal 2005, "The CIEDE2000 color-difference formula", equations
/// 2 to 22, with all parametric factors 1). The one of `palette`, with which albedo pictures are compared, has rounded
/// constants.
fn ciede2000([l1, a1, b1]: [f64; 3], [l2, a2, b2]: [f64; 3]) -> f64 {
    let seventh = |chroma: f64| {
        let power = libm::pow(chroma, 7.0);
        (power / (power + 25_f64.powi(7))).sqrt()
    };
    let g = 0.5 * (1.0 - seventh(0.5 * (libm::hypot(a1, b1) + libm::hypot(a2, b2))));
    let [a1, a2] = [a1, a2].map(|a| (1.0 + g) * a);
    let (c1, c2) = (libm::hypot(a1, b1), libm::hypot(a2, b2));
    let hue = |a: f64, b: f64| libm::atan2(b, a).to_degrees().rem_euclid(360.0);
    let (h1, h2) = (hue(a1, b1), hue(a2, b2));
    // Hues are compared the shorter way around. A grey has none, and the mean is that of the other colour.
    let (turn, hue) = match h2 - h1 {
        _ if c1 * c2 == 0.0 => (0.0, if c1 == 0.0 { h2 } else { h1 }),
        turn if turn.abs() <= 180.0 => (turn, 0.5 * (h1 + h2)),
        turn => (turn - 360.0 * turn.signum(), 0.5 * (h1 + h2 + if h1 + h2 < 360.0 { 360.0 } else { -360.0 })),
    };
    let [sin, cos] = [libm::sin, libm::cos].map(|of| move |degrees: f64| of(degrees.to_radians()));
    let (lightness, chroma) = (0.5 * (l1 + l2), 0.5 * (c1 + c2));
    let t = 1.0 - 0.17 * cos(hue - 30.0) + 0.24 * cos(2.0 * hue) + 0.32 * cos(3.0 * hue + 6.0)
        - 0.20 * cos(4.0 * hue - 63.0);
    let from_middle = (lightness - 50.0).powi(2);
    let l = (l2 - l1) / (1.0 + 0.015 * from_middle / (20.0 + from_middle).sqrt());
    let c = (c2 - c1) / (1.0 + 0.045 * chroma);
    let h = 2.0 * (c1 * c2).sqrt() * sin(0.5 * turn) / (1.0 + 0.015 * chroma * t);
    let blue = 30.0 * libm::exp(-((hue - 275.0) / 25.0).powi(2));
    let rotation = -sin(2.0 * blue) * 2.0 * seventh(chroma);
    (l * l + c * c + h * h + rotation * c * h).max(0.0).sqrt()
}

/// The mean CIEDE2000 over regions between predicted and measured colour, without any scale. Regions count alike,
/// however large they are: each is one measurement. `None` without regions.
pub fn region_delta_e(regions: &[RegionColors]) -> Option<f64> {
    let sum: f64 = regions.iter().map(|region| measured_difference(region.predicted, region.measured)).sum();
    (!regions.is_empty()).then(|| sum / regions.len() as f64)
}

/// How far the measured colour may be from the true one: CIEDE2000 for one standard error of each channel, whose
/// squares are summed. Each is the mean of both directions.
pub fn measurement_delta_e(measured: [f64; 3], standard_error: [f64; 3]) -> f64 {
    let along = |channel: usize| {
        let moved = |sign: f64| {
            let mut moved = measured;
            moved[channel] = (moved[channel] + sign * standard_error[channel]).clamp(0.0, 1.0);
            measured_difference(moved, measured)
        };
        (moved(1.0) + moved(-1.0)) / 2.0
    };
    (0..3).map(|channel| along(channel).powi(2)).sum::<f64>().sqrt()
}

fn grey(color: [f64; 3]) -> f64 {
    color.iter().sum::<f64>() / 3.0
}

/// The mean weighted by pixels.
fn weighted(regions: &[RegionColors], value: impl Fn(&RegionColors) -> f64) -> Option<f64> {
    let weight: f64 = regions.iter().map(|region| region.pixels as f64).sum();
    let sum: f64 = regions.iter().map(|region| region.pixels as f64 * value(region)).sum();
    (weight > 0.0).then(|| sum / weight)
}

/// MAW's intensity error (`si`, `mean`): the mean squared difference of the means over channels, after the factor that
/// fits all regions best. Regions are those of [`maw_picture`], and count by their pixels.
pub fn maw_intensity(regions: &[RegionColors]) -> Option<f64> {
    let sum = |of: fn(f64, f64) -> f64| {
        let of = |region: &RegionColors| region.pixels as f64 * of(grey(region.predicted), grey(region.measured));
        regions.iter().map(of).sum::<f64>()
    };
    let scale = sum(|p, m| p * m) / sum(|p, _| p * p).max(MAW_LEAST);
    weighted(regions, |region| (scale * grey(region.predicted) - grey(region.measured)).powi(2))
}

/// MAW's chromaticity error (`per_si`, `deltae`): CIEDE2000 after a factor for each region that makes its mean over
/// channels the measured one.
pub fn maw_chromaticity(regions: &[RegionColors]) -> Option<f64> {
    weighted(regions, |region| {
        let (p, m) = (grey(region.predicted), grey(region.measured));
        let scale = p * m / (p * p).max(MAW_LEAST);
        measured_difference(region.predicted.map(|value| scale * value), region.measured)
    })
}

/// A prediction as MAW sees it: clipped to 0..1, as 8-bit sRGB, and of 320x240 pixels by Pillow's `BILINEAR`.
pub fn maw_picture(prediction: &Picture<LinearRgb>) -> Picture<[u8; 3]> {
    let bytes = prediction.map(|LinearRgb(rgb)| rgb.map(|v| byte_from_unit(srgb_from_linear(v.clamp(0.0, 1.0)))));
    let [width, height] = MAW_SIZE;
    transposed(&narrowed(&transposed(&narrowed(&bytes, width)), height))
}

fn transposed(picture: &Picture<[u8; 3]>) -> Picture<[u8; 3]> {
    Picture::from_fn(picture.height(), picture.width(), |x, y| picture.get(y, x))
}

/// Bits behind the point of Pillow's whole coefficients.
const PRECISION: u32 = 22;

/// The picture with another number of columns, by the triangle filter of Pillow's `Resample.c`, which is as wide as the
/// new pixels where there are fewer.
fn narrowed(picture: &Picture<[u8; 3]>, columns: usize) -> Picture<[u8; 3]> {
    if picture.width() == columns {
        return picture.clone();
    }
    let scale = picture.width() as f64 / columns as f64;
    let support = scale.max(1.0);
    let taps = |column: usize| -> (usize, Vec<i64>) {
        let centre = (column as f64 + 0.5) * scale;
        let first = (centre - support + 0.5).max(0.0) as usize;
        let end = ((centre + support + 0.5) as usize).min(picture.width());
        let weight = |at: usize| (1.0 - ((at as f64 - centre + 0.5) / support).abs()).max(0.0);
        let weights: Vec<f64> = (first..end).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        (first, weights.iter().map(|w| (0.5 + w / sum * f64::from(1_u32 << PRECISION)) as i64).collect())
    };
    let taps: Vec<(usize, Vec<i64>)> = (0..columns).map(taps).collect();
    Picture::from_fn(columns, picture.height(), |x, y| {
        let (first, weights) = &taps[x];
        std::array::from_fn(|channel| {
            let texel = |at: usize| i64::from(picture.get(first + at, y)[channel]);
            let sum: i64 = weights.iter().enumerate().map(|(at, weight)| weight * texel(at)).sum();
            ((sum + (1 << (PRECISION - 1))) >> PRECISION).clamp(0, 255) as u8
        })
    })
}

/// A picture of regions at MAW's size, by Pillow's `NEAREST`.
pub fn maw_mask(regions: &Picture<u16>) -> Picture<u16> {
    // Pillow adds the step up, and its rounding with it.
    let places = |from: usize, to: usize| -> Vec<usize> {
        let step = from as f64 / to as f64;
        let places = std::iter::successors(Some(0.5 * step), |place| Some(place + step));
        places.take(to).map(|place| (place as usize).min(from - 1)).collect()
    };
    let [width, height] = MAW_SIZE;
    let (columns, rows) = (places(regions.width(), width), places(regions.height(), height));
    Picture::from_fn(width, height, |x, y| regions.get(columns[x], rows[y]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of 0 to 1 from a linear congruence (Numerical Recipes, section 7.1), which the Python of the pinned
    /// values computes too.
    struct Draws(u32);

    impl Draws {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(self.0 >> 8) / f64::from(1_u32 << 24)
        }

        fn color(&mut self) -> [f64; 3] {
            [self.next(), self.next(), self.next()]
        }
    }

    /// A set of two to eight regions.
    fn set(seed: u32) -> Vec<RegionColors> {
        let mut draws = Draws(seed);
        (0..2 + seed % 7)
            .map(|_| RegionColors {
                pixels: 1 + (draws.next() * 500.0) as usize,
                predicted: draws.color(),
                measured: draws.color(),
            })
            .collect()
    }

    /// For seeds 1 to 20: intensity, chromaticity and absolute CIEDE2000, by
    /// `tests/independent/measured_scores.py` with colour-science 0.4 and NumPy.
    const PINNED: [[f64; 3]; 20] = [
        [0.071_047_231, 22.439_004_138, 20.389_796_837],
        [0.093_354_630, 19.604_605_929, 26.436_915_884],
        [0.064_552_415, 26.367_781_947, 28.173_728_634],
        [0.009_045_423, 22.105_288_268, 26.056_755_480],
        [0.004_335_131, 30.349_865_233, 33.578_941_824],
        [0.050_011_262, 23.921_512_231, 35.426_222_340],
        [0.004_169_942, 43.085_166_223, 42.331_315_383],
        [0.008_609_090, 30.291_829_825, 31.188_302_100],
        [0.024_958_192, 39.555_186_279, 44.290_980_986],
        [0.003_109_784, 27.307_878_150, 32.301_613_931],
        [0.019_456_712, 34.631_216_306, 35.400_694_439],
        [0.052_374_244, 25.528_584_138, 28.707_887_886],
        [0.022_342_493, 44.009_138_257, 43.403_388_949],
        [0.003_557_555, 24.060_016_310, 31.330_745_269],
        [0.138_512_428, 35.039_190_566, 42.857_281_157],
        [0.017_285_743, 29.725_173_285, 28.628_796_160],
        [0.009_245_379, 43.108_928_417, 40.606_064_185],
        [0.048_483_971, 17.568_538_061, 28.666_202_922],
        [0.019_581_453, 39.932_456_451, 40.795_310_160],
        [0.066_219_554, 31.411_625_460, 35.059_752_919],
    ];

    #[test]
    fn twenty_sets_have_the_scores_of_an_independent_implementation() {
        for (seed, [intensity, chromaticity, absolute]) in (1..).zip(PINNED) {
            let regions = set(seed);
            let found = [maw_intensity(&regions), maw_chromaticity(&regions), region_delta_e(&regions)];
            for (found, expected) in found.into_iter().zip([intensity, chromaticity, absolute]) {
                let found = found.unwrap();
                assert!((found - expected).abs() < 1e-6, "{seed}: {found} {expected}");
            }
        }
    }

    /// Pairs of table 1 of the paper, chosen so that each case of the formula's mean hue and hue difference occurs.
    #[test]
    fn ciede2000_has_the_values_of_its_paper() {
        let pairs = [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, 2.49, -0.001], [50.0, -2.49, 0.001], 7.1792),
            ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0011], 7.2195),
            ([50.0, -0.001, 2.49], [50.0, 0.001, -2.49], 4.8045),
            ([50.0, -0.001, 2.49], [50.0, 0.0011, -2.49], 4.7461),
            ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([50.0, 2.5, 0.0], [56.0, -27.0, -3.0], 31.9030),
            ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
            ([63.0109, -31.0961, -5.8663], [62.8187, -29.7946, -4.0864], 1.2630),
            ([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514], 0.9082),
        ];
        for (a, b, expected) in pairs {
            let (found, back) = (ciede2000(a, b), ciede2000(b, a));
            assert!((found - expected).abs() < 5.1e-5 && (found - back).abs() < 1e-9, "{a:?} {b:?}: {found} {back}");
            assert_eq!(ciede2000(a, a), 0.0);
        }
    }

    fn checksum(values: impl Iterator<Item = u32>) -> u32 {
        values.fold(0, |sum: u32, value| sum.wrapping_mul(31).wrapping_add(value))
    }

    /// Sizes, and checksums of what Pillow 13 makes of the same bytes, by the same script: enlarged, reduced, and
    /// reduced along rows alone.
    #[test]
    fn pictures_have_pillows_bytes() {
        let pinned: [((usize, usize), u32, u32); 3] = [
            ((50, 37), 1_870_926_356, 4_032_756_608),
            ((640, 400), 360_887_491, 1_283_267_072),
            ((321, 240), 2_760_085_568, 2_362_716_416),
        ];
        for ((width, height), of_picture, of_mask) in pinned {
            let level = |x: usize, y: usize| [(7 * x + 3 * y) % 256, (x * y) % 256, (x / 5 * 40 + y) % 256];
            // A linear value in the middle of those that become the byte.
            let linear = |byte: usize| mateval_image::transfer::linear_from_srgb_byte(byte as u8);
            let picture = Picture::from_fn(width, height, |x, y| LinearRgb(level(x, y).map(linear)));
            let found = maw_picture(&picture);
            assert_eq!(checksum(found.pixels().iter().flatten().map(|byte| u32::from(*byte))), of_picture);
            let mask = maw_mask(&Picture::from_fn(width, height, |x, y| level(x, y)[1] as u16));
            assert_eq!(checksum(mask.pixels().iter().map(|value| u32::from(*value))), of_mask);
        }
    }

    /// By hand: an error of one channel is the distance to the moved colour; without an error there is none.
    #[test]
    fn the_measurements_error_is_a_distance() {
        let (measured, moved) = ([0.5, 0.4, 0.3], [[0.51, 0.4, 0.3], [0.49, 0.4, 0.3]]);
        let expected = moved.map(|moved| measured_difference(moved, measured)).iter().sum::<f64>() / 2.0;
        assert!((measurement_delta_e(measured, [0.01, 0.0, 0.0]) - expected).abs() < 1e-12);
        assert_eq!(measurement_delta_e(measured, [0.0; 3]), 0.0);
        assert!(measurement_delta_e(measured, [0.01; 3]) > expected);
    }

    #[test]
    fn no_region_has_no_score() {
        assert_eq!([region_delta_e(&[]), maw_intensity(&[]), maw_chromaticity(&[])], [None; 3]);
    }
}
