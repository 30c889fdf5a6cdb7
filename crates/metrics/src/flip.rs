//! LDR-FLIP: the difference that an observer sees when two pictures alternate in one place.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: "FLIP: A Difference Evaluator for Alternating
//! Images", 2020. Two pipelines end in one number per pixel. Colours are blurred as the eye blurs them at the viewing
//! distance, and compared in a perceptual space. Features (edges and points) are looked for in both pictures. Where the
//! features differ, the difference of the colours counts for more.
//!
//! As in the authors' tool, `flip-evaluator` of PyPI, all filters are separable and repeat the picture's edge pixels
//! beyond its border. The tool computes in `f32`, this module in `f64`. Means over textured pictures agree to 1e-7. In
//! flat areas they can differ by 5e-5, since the square root of a feature difference amplifies the tool's rounding.
//!
//! Lower is better: 0 for equal pictures, 1 at most. Meant for sRGB-encoded pictures; values are clipped to 0..1.

use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::sync::LazyLock;

use mateval_image::transfer::linear_from_srgb;
use mateval_image::{Mask, Picture, SrgbRgb};
use rayon::prelude::*;

use crate::MetricError;
use crate::pixel::{check_pair, reference_filled};

/// Pixels per degree of the observer's view: a monitor of 3840 pixels on 0.7 metres, seen from 0.7 metres, which is the
/// default of `flip-evaluator`.
pub const PIXELS_PER_DEGREE: f64 = 67.020_643_276_582_25;

/// The exponent that compresses differences of colours (the paper's q_c).
const COLOR_EXPONENT: f64 = 0.7;
/// The share of the largest difference of colours up to which `COLOR_SPLIT_VALUE` is spent (p_c).
const COLOR_SPLIT: f64 = 0.4;
/// The value that a difference at the split has (p_t).
const COLOR_SPLIT_VALUE: f64 = 0.95;
/// The width of the features that are looked for, in degrees (w).
const FEATURE_DEGREES: f64 = 0.082;
/// The exponent that amplifies differences of features (q_f).
const FEATURE_EXPONENT: f64 = 0.5;

/// Weights a and b of the eye's contrast sensitivity: at a distance of d degrees, a channel's filter in the plane is
/// a sqrt(π / b) exp(-π² d² / b). In order: achromatic, red to green, and two terms of blue to yellow, which add up.
const SENSITIVITY: [(f64, f64); 4] = [(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04), (13.5, 0.025)];

/// XYZ of linear Rec. 709 with the tool's digits; its illuminant, D65, is white's XYZ and so the sums of the rows.
const XYZ_FROM_LINEAR: [[f64; 3]; 3] = [
    [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
    [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
    [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
];
/// The inverse of `XYZ_FROM_LINEAR`.
const LINEAR_FROM_XYZ: [[f64; 3]; 3] = [
    [3.2410032329763583, -1.5373989694887853, -0.4986158819963628],
    [-0.9692242522025163, 1.8759299836951757, 0.04155422634008469],
    [0.05563941985197541, -0.20401120612390994, 1.0571489771875333],
];

/// The mean of [`flip_map`] over the pixels of the mask. Outside, the prediction gets the reference's pixels first.
///
/// `None` where no pixel counts. The filters reach across the mask's edge, so the reference is read everywhere and the
/// prediction inside the mask: a value there that is not finite is an error, as are sizes that differ.
pub fn flip(
    prediction: &Picture<SrgbRgb>,
    reference: &Picture<SrgbRgb>,
    mask: &Mask,
) -> Result<Option<f64>, MetricError> {
    check_pair(prediction, reference, Some(mask))?;
    let map = flip_map(&reference_filled(prediction, reference, mask)?, reference)?;
    let (mut sum, mut count) = (0.0_f64, 0_usize);
    for (&value, _) in map.pixels().iter().zip(mask.pixels()).filter(|&(_, &counts)| counts) {
        sum += f64::from(value);
        count += 1;
    }
    Ok((count > 0).then(|| sum / count as f64))
}

/// The difference at every pixel, 0 to 1, at [`PIXELS_PER_DEGREE`]. Fails if sizes differ or a value is not finite.
///
/// ```
/// use mateval_image::{Picture, SrgbRgb};
///
/// let green = Picture::filled(4, 3, SrgbRgb([0.0, 1.0, 0.0]));
/// let blue = Picture::filled(4, 3, SrgbRgb([0.0, 0.0, 1.0]));
/// assert_eq!(mateval_metrics::flip_map(&green, &green)?, Picture::filled(4, 3, 0.0));
/// // The two colours of a monitor that differ most.
/// assert_eq!(mateval_metrics::flip_map(&green, &blue)?, Picture::filled(4, 3, 1.0));
/// # Ok::<(), mateval_metrics::MetricError>(())
/// ```
pub fn flip_map(prediction: &Picture<SrgbRgb>, reference: &Picture<SrgbRgb>) -> Result<Picture<f32>, MetricError> {
    check_pair(prediction, reference, None)?;
    if prediction.pixels().is_empty() {
        // No edge pixel to repeat.
        return Ok(Picture::filled(prediction.width(), prediction.height(), 0.0));
    }
    let [p, r] = [prediction, reference].map(|picture| picture.map(opponent_from_srgb));
    let [p_colors, r_colors] = [&p, &r].map(perceived_colors);
    let [p_features, r_features] = [&p, &r].map(features);
    let value = |i: usize| {
        let color = color_difference(&p_colors.pixels()[i], &r_colors.pixels()[i]);
        let feature = feature_difference(&p_features.pixels()[i], &r_features.pixels()[i]);
        // Rounding must not make the exponent negative, with which a colour difference of 0 would be infinite.
        libm::pow(color, (1.0 - feature).max(0.0)) as f32
    };
    let values = (0..p.pixels().len()).into_par_iter().map(value).collect();
    Ok(Picture::new(prediction.width(), prediction.height(), values).expect("one value for each pixel"))
}

// Colours.

/// The opponent channels Y, Cx and Cz, linear in light: achromatic, red to green, blue to yellow.
fn opponent_from_srgb(SrgbRgb(encoded): SrgbRgb) -> [f64; 3] {
    let linear = encoded.map(|value| f64::from(linear_from_srgb(value.clamp(0.0, 1.0))));
    let [x, y, z] = relative_xyz(linear);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn linear_from_opponent([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (y + 16.0) / 116.0;
    let relative = [y + cx / 500.0, y, y - cz / 200.0];
    let xyz = std::array::from_fn(|i| relative[i] * XYZ_FROM_LINEAR[i].iter().sum::<f64>());
    product(&LINEAR_FROM_XYZ, xyz)
}

/// XYZ of a linear colour, divided by that of white.
fn relative_xyz(linear: [f64; 3]) -> [f64; 3] {
    let xyz = product(&XYZ_FROM_LINEAR, linear);
    std::array::from_fn(|i| xyz[i] / XYZ_FROM_LINEAR[i].iter().sum::<f64>())
}

fn product(matrix: &[[f64; 3]; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    matrix.map(|[a, b, c]| a * x + b * y + c * z)
}

/// What is left of each colour at the viewing distance, in Lab with Hunt's adjustment.
fn perceived_colors(opponents: &Picture<[f64; 3]>) -> Picture<[f64; 3]> {
    let taps = sensitivity_taps();
    // Blue to yellow has two filters, which are summed only in the plane: a sum of separable filters is not separable.
    let blurred = convolved(opponents, Axis::X, &taps, |sums: &mut [f64; 4], weights, [y, cx, cz]| {
        (0..4).for_each(|i| sums[i] += weights[i] * [y, cx, cz, cz][i]);
    });
    let blurred = convolved(&blurred, Axis::Y, &taps, |sums: &mut [f64; 4], weights, values| {
        (0..4).for_each(|i| sums[i] += weights[i] * values[i]);
    });
    let perceived = |&[y, cx, cz_1, cz_2]: &[f64; 4]| {
        // The filters can leave the monitor's colours.
        hunt_lab(linear_from_opponent([y, cx, cz_1 + cz_2]).map(|value| value.clamp(0.0, 1.0)))
    };
    let pixels = blurred.pixels().par_iter().map(perceived).collect();
    Picture::new(opponents.width(), opponents.height(), pixels).expect("one colour for each pixel")
}

/// The filters of [`SENSITIVITY`] along one axis, at distances of -radius to radius pixels. In the plane each channel's
/// weights sum to 1, those of blue to yellow over both terms.
fn sensitivity_taps() -> Vec<[f64; 4]> {
    // Three standard deviations of the widest Gaussian.
    let widest = SENSITIVITY.iter().fold(0.0_f64, |widest, &(_, b)| widest.max(b));
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let tap = |distance: i32| {
        let degrees = f64::from(distance) / PIXELS_PER_DEGREE;
        // The root of the plane's amplitude, since the filter is applied along both axes.
        SENSITIVITY.map(|(a, b)| (a * (PI / b).sqrt()).sqrt() * libm::exp(-PI * PI * degrees * degrees / b))
    };
    let taps: Vec<[f64; 4]> = (-radius..=radius).map(tap).collect();
    let [y, cx, cz_1, cz_2]: [f64; 4] = std::array::from_fn(|i| taps.iter().map(|tap| tap[i]).sum());
    // A separable filter sums to the square of its sum along one axis.
    let cz = (cz_1 * cz_1 + cz_2 * cz_2).sqrt();
    taps.into_iter().map(|tap| [tap[0] / y, tap[1] / cx, tap[2] / cz, tap[3] / cz]).collect()
}

/// CIE Lab of a linear colour, with a and b in proportion to L: colours look less colourful in the dark.
fn hunt_lab(linear: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let curve = |t: f64| {
        if t > DELTA * DELTA * DELTA { libm::cbrt(t) } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = relative_xyz(linear).map(curve);
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// The difference of two perceived colours, 0 to 1.
fn color_difference(p: &[f64; 3], r: &[f64; 3]) -> f64 {
    // No two colours of a monitor differ by more than green and blue.
    static LARGEST: LazyLock<f64> =
        LazyLock::new(|| compressed_hyab(&hunt_lab([0.0, 1.0, 0.0]), &hunt_lab([0.0, 0.0, 1.0])));
    let difference = compressed_hyab(p, r);
    let split = COLOR_SPLIT * *LARGEST;
    if difference < split {
        difference * (COLOR_SPLIT_VALUE / split)
    } else {
        COLOR_SPLIT_VALUE + (difference - split) / (*LARGEST - split) * (1.0 - COLOR_SPLIT_VALUE)
    }
}

/// HyAB, the distance that suits large differences (Abasi et al. 2020), compressed.
fn compressed_hyab(p: &[f64; 3], r: &[f64; 3]) -> f64 {
    let [lightness, a, b]: [f64; 3] = std::array::from_fn(|i| p[i] - r[i]);
    libm::pow(lightness.abs() + (a * a + b * b).sqrt(), COLOR_EXPONENT)
}

// Features.

/// How strong an edge and a point a pixel shows.
#[derive(Clone, Copy)]
struct Feature {
    edge: f64,
    point: f64,
}

/// Edges and points of the achromatic channel, which no eye has blurred.
fn features(opponents: &Picture<[f64; 3]>) -> Picture<Feature> {
    let taps = feature_taps();
    let along_x = convolved(opponents, Axis::X, &taps, |sums: &mut [f64; 3], weights, [y, _, _]| {
        let gray = (y + 16.0) / 116.0;
        (0..3).for_each(|i| sums[i] += weights[i] * gray);
    });
    // The derivatives by x and by y of first and of second order, each blurred along the other axis.
    let derivatives = convolved(&along_x, Axis::Y, &taps, |sums: &mut [f64; 4], [blur, first, second], along_x| {
        let [blurred, first_x, second_x] = along_x;
        let terms = [blur * first_x, first * blurred, blur * second_x, second * blurred];
        (0..4).for_each(|i| sums[i] += terms[i]);
    });
    derivatives.map(|[x, y, xx, yy]| Feature { edge: (x * x + y * y).sqrt(), point: (xx * xx + yy * yy).sqrt() })
}

/// A Gaussian and its first and second derivatives, at distances of -radius to radius pixels. The Gaussian's weights
/// sum to 1, the derivatives' positive weights to 1 and the negative ones to -1.
fn feature_taps() -> Vec<[f64; 3]> {
    let sigma = 0.5 * FEATURE_DEGREES * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma).ceil() as i32;
    let tap = |distance: i32| {
        let d = f64::from(distance) / sigma;
        let gaussian = libm::exp(-0.5 * d * d);
        [gaussian, -d * gaussian, (d * d - 1.0) * gaussian]
    };
    let mut taps: Vec<[f64; 3]> = (-radius..=radius).map(tap).collect();
    for i in 0..3 {
        let positive: f64 = taps.iter().map(|tap| tap[i].max(0.0)).sum();
        let negative: f64 = taps.iter().map(|tap| (-tap[i]).max(0.0)).sum();
        // The Gaussian has no negative weight, which would be divided by 0.
        taps.iter_mut().for_each(|tap| tap[i] /= if tap[i] > 0.0 { positive } else { negative });
    }
    taps
}

/// The difference of two pixels' features, 0 to 1: of edges or of points, whichever is larger.
fn feature_difference(p: &Feature, r: &Feature) -> f64 {
    let largest = (p.edge - r.edge).abs().max((p.point - r.point).abs());
    libm::pow(FRAC_1_SQRT_2 * largest, FEATURE_EXPONENT)
}

// Filters.

#[derive(Clone, Copy)]
enum Axis {
    X,
    Y,
}

/// At every pixel, the sum that `add(sum, tap, value)` makes of the taps and the pixels along one axis, the pixel
/// itself at the middle tap. Beyond the border the edge pixels repeat. Rows run in parallel and taps in order, so the
/// number of threads changes no bit.
fn convolved<Value, Tap, Sums>(
    picture: &Picture<Value>,
    axis: Axis,
    taps: &[Tap],
    add: impl Fn(&mut Sums, &Tap, Value) + Sync,
) -> Picture<Sums>
where
    Value: Copy + Sync,
    Tap: Sync,
    Sums: Copy + Default + Send,
{
    let (width, height, radius) = (picture.width(), picture.height(), taps.len() / 2);
    let clamped = |position: usize, length: usize| position.saturating_sub(radius).min(length - 1);
    let row_at = |y: usize| &picture.pixels()[y * width..(y + 1) * width];
    let row = |y: usize| -> Vec<Sums> {
        let widened: Vec<Value> = match axis {
            Axis::X => (0..width + 2 * radius).map(|x| row_at(y)[clamped(x, width)]).collect(),
            Axis::Y => Vec::new(),
        };
        let mut sums = vec![Sums::default(); width];
        for (i, tap) in taps.iter().enumerate() {
            // The pixels that this tap meets, in the order of the sums.
            let values = match axis {
                Axis::X => &widened[i..i + width],
                Axis::Y => row_at(clamped(y + i, height)),
            };
            sums.iter_mut().zip(values).for_each(|(sum, &value)| add(sum, tap, value));
        }
        sums
    };
    let rows: Vec<Vec<Sums>> = (0..height).into_par_iter().map(row).collect();
    Picture::new(width, height, rows.concat()).expect("one sum for each pixel")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Eighths or sixteenths, which `f32` holds exactly.
    fn made((width, height): (usize, usize), value: impl Fn(usize, usize, usize) -> f32) -> Picture<SrgbRgb> {
        Picture::from_fn(width, height, |x, y| SrgbRgb(std::array::from_fn(|channel| value(x, y, channel))))
    }

    fn stripes(size: (usize, usize), a: usize, b: usize, c: usize) -> Picture<SrgbRgb> {
        made(size, |x, y, channel| ((a * x + b * y + c * channel) % 17) as f32 / 16.0)
    }

    fn blocks(size: (usize, usize), side: usize, offset: usize) -> Picture<SrgbRgb> {
        made(size, |x, y, channel| ((x / side * 3 + y / side * 5 + channel * 2 + offset) % 8) as f32 / 8.0)
    }

    fn mean(map: &Picture<f32>) -> f64 {
        map.pixels().iter().map(|&value| f64::from(value)).sum::<f64>() / map.pixels().len() as f64
    }

    /// flip-evaluator 1.7: the same pictures as NumPy arrays of `float32`,
    /// `evaluate(reference, prediction, "LDR", inputsRGB=True, applyMagma=False)[0]`, then its mean in doubles (the
    /// tool sums its own mean in single precision). The third pair is smaller than the filters.
    #[test]
    fn agrees_with_the_authors_tool() {
        let (wide, tall, tiny) = ((40, 30), (33, 50), (5, 3));
        let cases = [
            (stripes(wide, 3, 7, 5), stripes(wide, 5, 2, 11), 0.292_304_537),
            (blocks(tall, 8, 0), blocks(tall, 8, 1), 0.724_601_782),
            (stripes(tiny, 3, 7, 5), stripes(tiny, 5, 2, 11), 0.624_509_291),
        ];
        for (p, r, expected) in cases {
            let found = mean(&flip_map(&p, &r).unwrap());
            assert!((found - expected).abs() < 1e-7, "{found} {expected}");
        }
        // Single pixels of the first pair, corners among them.
        let map = flip_map(&stripes(wide, 3, 7, 5), &stripes(wide, 5, 2, 11)).unwrap();
        let pixels = [(0, 0, 0.894_652), (39, 0, 0.559_760), (20, 15, 0.104_768), (39, 29, 0.488_800)];
        for (x, y, expected) in pixels {
            assert!((map.get(x, y) - expected).abs() < 3e-6, "({x}, {y}): {} {expected}", map.get(x, y));
        }
    }

    /// Without features, a pixel is its difference of colours. Black and white by hand: 100^0.7 lies beyond the split
    /// of 0.4 times 41.2760, the compressed difference of green and blue. The tool finds 0.967388 and, for the greys,
    /// 0.206027: its features of flat pictures are rounding errors of about 1e-8, and it takes their square root.
    #[test]
    fn flat_pictures_differ_by_their_colours_alone() {
        let flat = |value: f32| Picture::filled(8, 8, SrgbRgb([value; 3]));
        let found = mean(&flip_map(&flat(1.0), &flat(0.0)).unwrap());
        let by_hand = 0.95 + 0.05 * (100.0_f64.powf(0.7) - 0.4 * 41.276) / (0.6 * 41.276);
        assert!((found - by_hand).abs() < 1e-6 && (found - 0.967_388_3).abs() < 1e-4, "{found} {by_hand}");
        let greys = mean(&flip_map(&flat(0.5), &flat(0.5625)).unwrap());
        assert!((greys - 0.206_026_8).abs() < 1e-4, "{greys}");
    }

    /// Not from an independent source: the bits of this implementation, for any number of threads.
    #[test]
    fn every_machine_computes_the_same_bits() {
        let (p, r) = (stripes((40, 30), 3, 7, 5), stripes((40, 30), 5, 2, 11));
        let all = Picture::filled(40, 30, true);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| flip(&p, &r, &all)).unwrap(), Some(0.292_304_538_255_557_4));
        }
    }

    #[test]
    fn the_reference_fills_what_the_mask_leaves_out() {
        let (p, r) = (blocks((33, 50), 8, 0), blocks((33, 50), 8, 1));
        let mask = Picture::from_fn(33, 50, |x, y| x + y > 30);
        let mut holes = p.clone();
        holes.set(0, 0, SrgbRgb([f32::NAN; 3]));
        let found = flip(&holes, &r, &mask).unwrap();
        // By the definition.
        let map = flip_map(&reference_filled(&p, &r, &mask).unwrap(), &r).unwrap();
        let counted: Vec<f64> = (0..33 * 50).filter(|&i| mask.pixels()[i]).map(|i| map.pixels()[i].into()).collect();
        assert_eq!(found, Some(counted.iter().sum::<f64>() / counted.len() as f64));
        // Its twin: what lies outside would count without the filling, since filters reach across the edge.
        assert_ne!(found, flip(&p, &r, &Picture::filled(33, 50, true)).unwrap());
        assert_eq!(flip(&p, &r, &Picture::filled(33, 50, false)).unwrap(), None);
    }

    #[test]
    fn values_must_be_finite_and_sizes_agree() {
        let good = Picture::filled(2, 1, SrgbRgb([0.5; 3]));
        let mut bad = good.clone();
        bad.set(1, 0, SrgbRgb([0.5, f32::NAN, 0.5]));
        let left = Picture::new(2, 1, vec![true, false]).unwrap();
        assert_eq!(flip(&bad, &good, &left).unwrap(), Some(0.0));
        // The filters read the reference outside the mask too.
        let error = flip(&good, &bad, &left).unwrap_err();
        assert!(matches!(error, MetricError::NotFinite { .. }));
        let error = flip_map(&bad, &good).unwrap_err();
        assert!(matches!(error, MetricError::NotFinite { picture: "prediction", x: 1, y: 0, channel: 1, .. }));
        let tall = Picture::filled(1, 2, SrgbRgb([0.5; 3]));
        assert!(matches!(flip_map(&good, &tall), Err(MetricError::SizesDiffer { what: "reference", .. })));
    }

    #[test]
    fn values_are_clipped() {
        let pixel = |value| Picture::filled(1, 1, SrgbRgb(value));
        let map = flip_map(&pixel([-0.5, 0.25, 3.0]), &pixel([0.0, 0.25, 1.0])).unwrap();
        assert_eq!(map.pixels(), &[0.0]);
    }

    #[test]
    fn an_empty_picture_has_no_value() {
        for (width, height) in [(0, 0), (0, 3), (3, 0)] {
            let empty = Picture::filled(width, height, SrgbRgb::default());
            assert_eq!(flip(&empty, &empty, &Picture::filled(width, height, true)).unwrap(), None);
        }
    }

    fn pictures() -> impl Strategy<Value = Picture<SrgbRgb>> {
        let pixels = prop::collection::vec(prop::array::uniform3(0.0_f32..1.0).prop_map(SrgbRgb), 6 * 5);
        pixels.prop_map(|pixels| Picture::new(6, 5, pixels).unwrap())
    }

    proptest! {
        #[test]
        fn identity_symmetry_and_range(p in pictures(), r in pictures()) {
            prop_assert_eq!(flip_map(&p, &p).unwrap(), Picture::filled(6, 5, 0.0));
            let map = flip_map(&p, &r).unwrap();
            prop_assert!(map.pixels().iter().all(|value| (0.0..=1.0).contains(value)));
            prop_assert_eq!(flip_map(&r, &p).unwrap(), map);
        }
    }
}
