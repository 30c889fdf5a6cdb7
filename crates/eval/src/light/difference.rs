//! The encoded difference between a prediction's render and the reference R, from few paths.
//!
//! The prediction P and the truth T travel along the same paths, in four independent quarters: q_i is the mean of P in
//! quarter i, t_i that of T, all linear and exposed. Quarters 1 and 2 form one half, 3 and 4 the other; for a half h, o
//! is the other half. f clips above 1 and encodes to sRGB, f' is its slope.
//!
//! ```text
//! r   = (clip(a_P) + 0.001) / (a_T + 0.001), at most 8     a_P, a_T: base colour in the view, from the atlases of both
//! b   = min(r, 1),   g = min(r, 2)
//! m_i = b R + (q_i - b t_i);   m_h = the mean of its quarters
//! F_o = filter(m_o - g R), by the noise of its quarters
//! k_o = sum clip(m_o, 0, 1) / sum clip(r R, 0, 1), each value clipped, over the valid pixels and channels,
//!       within 0.1 to 10
//! p_h = g R + F_o, limited to k_o r R / 2 ... 2 k_o r R
//! s_h = f'(p_h), 0 where p_h >= 1;   p'_h = clip(p_h, 0, 1)
//! X_h = f(p'_h) + s_h (m_h - p'_h) - f(R);   u_h = s_h times half the difference of the quarters
//! ```
//!
//! r R is what the prediction would show if light between surfaces did not change. b is r, but at most 1, since a
//! larger factor would enlarge the truth's noise; g R is the part of r R that the filter need not carry, bounded
//! because r is large only where the truth is dark, and R's own noise would be enlarged with it. Encoding is a curve,
//! so the mean of encoded noise is not the encoded mean. Here the curve is replaced by its tangent at a pivot p that
//! half h does not know: X_h is linear in m_h, and its mean is the encoded mean as far as the pivot is right. m_i is a
//! control variate (Owen, "Monte Carlo theory, methods and examples", section 8.9) that moves no expectation, whatever
//! r is, as far as R is the mean of t. For the true maps q = t and r = 1, so that m = R, F = 0, k = 1 and X = 0:
//! exactly, at any number of paths.

use mateval_image::transfer::srgb_with_slope;
use mateval_image::{LinearRgb, Picture, SrgbRgb};
use mateval_tracer::noise_filter::{Surfaces, filtered_mean};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::metric::ColorPicture;
use crate::truth::ViewTruth;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DifferenceRules {
    /// Added to both base colours before they are divided.
    pub ratio_offset: f32,
    /// The largest ratio r of base colours.
    pub most_ratio: f32,
    /// b is r, but at most this.
    pub most_control: f32,
    /// g is r, but at most this.
    pub most_guide: f32,
    /// k is kept in this range.
    pub scale_range: [f64; 2],
    /// The pivot lies between k r R divided by this and k r R times this.
    pub pivot_factor: f64,
}

pub const DIFFERENCE: DifferenceRules = DifferenceRules {
    ratio_offset: 1e-3,
    most_ratio: 8.0,
    most_control: 1.0,
    most_guide: 2.0,
    scale_range: [0.1, 10.0],
    pivot_factor: 2.0,
};

/// What is known about a prediction's view without noise. All pictures have one size.
#[derive(Clone, Copy)]
pub struct ViewGuide<'a> {
    /// R in one lighting, exposed.
    pub reference: &'a Picture<LinearRgb>,
    /// r.
    pub ratio: &'a Picture<LinearRgb>,
    /// What the filter may average.
    pub surfaces: Surfaces<'a>,
}

/// What is known of each view of a prediction in one lighting.
pub(crate) struct ViewGuides<'a> {
    pub(crate) truths: &'a [ViewTruth],
    /// r.
    pub(crate) ratios: &'a [Picture<LinearRgb>],
    /// R, exposed.
    pub(crate) references: &'a [ColorPicture],
}

impl ViewGuides<'_> {
    pub(crate) fn of(&self, view: usize) -> ViewGuide<'_> {
        let ViewTruth { instances, normals, valid, .. } = &self.truths[view];
        let surfaces = Surfaces { base_color: None, instances, normals, valid };
        ViewGuide { reference: &self.references[view].linear, ratio: &self.ratios[view], surfaces }
    }

    /// The difference in every view, from its four quarters.
    pub(crate) fn differences(&self, quarters: &[Vec<Picture<LinearRgb>>]) -> Vec<LightDifference> {
        let views = quarters.par_iter().enumerate();
        views.map(|(view, quarters)| difference([0, 1, 2, 3].map(|at| &quarters[at]), &self.of(view))).collect()
    }
}

/// The difference of a prediction's view from the reference, encoded.
#[derive(Clone, Debug, PartialEq)]
pub struct LightDifference {
    /// X of both halves.
    pub halves: [Picture<SrgbRgb>; 2],
    /// u of both halves: noise like theirs, around 0.
    pub noise: [Picture<SrgbRgb>; 2],
    /// The prediction with little noise, within 0..1: for SSIM, LPIPS, FLIP and display.
    pub shown: Picture<SrgbRgb>,
}

/// The ratio r of base colours, from their pictures.
pub fn base_color_ratio(prediction: &Picture<LinearRgb>, truth: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    let DifferenceRules { ratio_offset, most_ratio, .. } = DIFFERENCE;
    Picture::from_fn(truth.width(), truth.height(), |x, y| {
        let (LinearRgb(p), LinearRgb(t)) = (prediction.get(x, y), truth.get(x, y));
        LinearRgb([0, 1, 2].map(|c| ((p[c].clamp(0.0, 1.0) + ratio_offset) / (t[c] + ratio_offset)).min(most_ratio)))
    })
}

/// One quarter m, exposed: from the radiances of prediction and truth, R and r.
pub fn corrected_quarter(
    prediction: &Picture<LinearRgb>,
    truth: &Picture<LinearRgb>,
    exposure: f64,
    reference: &Picture<LinearRgb>,
    ratio: &Picture<LinearRgb>,
) -> Picture<LinearRgb> {
    Picture::from_fn(reference.width(), reference.height(), |x, y| {
        let [q, t, reference, ratio] = [prediction, truth, reference, ratio].map(|picture| picture.get(x, y).0);
        LinearRgb([0, 1, 2].map(|c| {
            let b = f64::from(ratio[c].min(DIFFERENCE.most_control));
            (b * f64::from(reference[c]) + exposure * (f64::from(q[c]) - b * f64::from(t[c]))) as f32
        }))
    })
}

/// f and f' of a value. Values below 0, which only noise has, continue the curve's straight part.
fn encoded_with_slope(value: f64) -> (f64, f64) {
    if value >= 1.0 { (1.0, 0.0) } else { srgb_with_slope(value) }
}

/// f: at most 1.
pub fn encoded(value: f64) -> f64 {
    encoded_with_slope(value).0
}

/// The difference of a view, from its four corrected quarters, those of the first half first.
pub fn difference(quarters: [&Picture<LinearRgb>; 4], guide: &ViewGuide<'_>) -> LightDifference {
    let halves = [[quarters[0], quarters[1]], [quarters[2], quarters[3]]];
    let means = halves.map(|[first, second]| mean_of(first, second));
    let guided = [0, 1].map(|half| guided_mean(halves[half], guide));
    let scales = [0, 1].map(|half| scale(&means[half], guide));
    let encoded_reference: Vec<[f64; 3]> =
        guide.reference.pixels().iter().map(|LinearRgb(rgb)| rgb.map(|value| encoded(f64::from(value)))).collect();
    let (width, height) = (guide.reference.width(), guide.reference.height());
    // X and u of a half, at a tangent whose pivot and scale come from the other half.
    let of_half = |half: usize| {
        let value = |at: usize, c: usize| -> [f32; 2] {
            let of = |picture: &Picture<LinearRgb>| f64::from(picture.pixels()[at].0[c]);
            let expected = scales[1 - half] * of(guide.ratio) * of(guide.reference);
            let [least, most] = [expected / DIFFERENCE.pivot_factor, expected * DIFFERENCE.pivot_factor];
            let p = of(&guided[1 - half]).clamp(least, most).clamp(0.0, 1.0);
            let (f, slope) = encoded_with_slope(p);
            let x = f + slope * (of(&means[half]) - p) - encoded_reference[at][c];
            let u = slope * 0.5 * (of(halves[half][0]) - of(halves[half][1]));
            [x as f32, u as f32]
        };
        let both = Picture::from_fn(width, height, |x, y| [0, 1, 2].map(|c| value(y * width + x, c)));
        [0, 1].map(|which| both.map(|pixel| SrgbRgb(pixel.map(|value| value[which]))))
    };
    let ([first, u], [second, v]) = (of_half(0), of_half(1));
    let shown = guided_mean(means.each_ref(), guide).to_srgb();
    LightDifference { halves: [first, second], noise: [u, v], shown }
}

/// g R + F: the mean of two independent pictures, whose remainder beyond g R is filtered.
pub fn guided_mean(pair: [&Picture<LinearRgb>; 2], guide: &ViewGuide<'_>) -> Picture<LinearRgb> {
    let shifted = |picture: &Picture<LinearRgb>, sign: f32| {
        Picture::from_fn(picture.width(), picture.height(), |x, y| {
            let [value, reference, ratio] = [picture, guide.reference, guide.ratio].map(|p| p.get(x, y).0);
            LinearRgb([0, 1, 2].map(|c| value[c] + sign * ratio[c].min(DIFFERENCE.most_guide) * reference[c]))
        })
    };
    let [a, b] = pair.map(|picture| shifted(picture, -1.0));
    shifted(&filtered_mean([&a, &b], &guide.surfaces), 1.0)
}

/// k: how much brighter the half is than R times the ratio of base colours, over the whole view; 1 where R is black.
fn scale(half: &Picture<LinearRgb>, guide: &ViewGuide<'_>) -> f64 {
    let (mut of_half, mut of_reference) = (0.0, 0.0);
    let valid = guide.surfaces.valid.pixels();
    for at in (0..valid.len()).filter(|&at| valid[at]) {
        let [value, reference, ratio] = [half, guide.reference, guide.ratio].map(|picture| picture.pixels()[at].0);
        for c in 0..3 {
            of_half += f64::from(value[c]).clamp(0.0, 1.0);
            of_reference += (f64::from(ratio[c]) * f64::from(reference[c])).clamp(0.0, 1.0);
        }
    }
    let [least, most] = DIFFERENCE.scale_range;
    if of_reference > 0.0 { (of_half / of_reference).clamp(least, most) } else { 1.0 }
}

pub(crate) fn mean_of(a: &Picture<LinearRgb>, b: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    Picture::from_fn(a.width(), a.height(), |x, y| {
        let (LinearRgb(a), LinearRgb(b)) = (a.get(x, y), b.get(x, y));
        LinearRgb([0, 1, 2].map(|c| (0.5 * (f64::from(a[c]) + f64::from(b[c]))) as f32))
    })
}

#[cfg(test)]
mod tests {
    use mateval_image::{Mask, Normal};
    use mateval_metrics::mse;
    use mateval_testkit::statistics::{Render, SCATTERS, Scatter, mean_and_deviation, waves};

    use crate::light::mse::LightMse;

    use super::*;

    const SIDE: usize = 24;

    struct Room {
        reference: Picture<LinearRgb>,
        ratio: Picture<LinearRgb>,
        instances: Picture<u16>,
        normals: Picture<Normal>,
        valid: Mask,
    }

    impl Room {
        fn new(ratio: f32) -> Self {
            Self {
                reference: waves(SIDE).map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| 0.5 * v))),
                ratio: Picture::filled(SIDE, SIDE, LinearRgb([ratio; 3])),
                instances: Picture::filled(SIDE, SIDE, 1),
                normals: Picture::filled(SIDE, SIDE, Normal([0.0, 0.0, 1.0])),
                valid: Mask::filled(SIDE, SIDE, true),
            }
        }

        fn guide(&self) -> ViewGuide<'_> {
            let Self { reference, ratio, instances, normals, valid } = self;
            ViewGuide { reference, ratio, surfaces: Surfaces { base_color: None, instances, normals, valid } }
        }

        /// The difference of a prediction of `factor` times the light, whose paths have noise that is that of the
        /// truth's.
        fn difference(&self, factor: f32, scatter: Scatter, seed: u64) -> LightDifference {
            let quarter = |which: u64| {
                let render = Render { scatter, strength: 0.7, samples: 8, blocks: None, view: 0 };
                let truth = render.picture(&self.reference, 4 * seed + which);
                let prediction = truth.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| factor * v)));
                corrected_quarter(&prediction, &truth, 1.0, &self.reference, &self.ratio)
            };
            let [a, b, c, d] = [0, 1, 2, 3].map(quarter);
            difference([&a, &b, &c, &d], &self.guide())
        }
    }

    #[test]
    fn the_truth_is_exact_whatever_its_noise() {
        let room = Room::new(1.0);
        for scatter in SCATTERS {
            let found = room.difference(1.0, scatter, 5);
            let zero = Picture::filled(SIDE, SIDE, SrgbRgb([0.0; 3]));
            assert_eq!((&found.halves, &found.noise), (&[zero.clone(), zero.clone()], &[zero.clone(), zero]));
            assert_eq!(found.shown, room.reference.to_srgb());
        }
    }

    /// Over 200 seeds: the mean is the error of the exact pictures, and the stated error is the spread. The ratio of
    /// base colours explains all, half, or nothing of the prediction's light.
    #[test]
    fn the_error_has_no_bias_and_is_stated() {
        let blocks = Picture::from_fn(SIDE, SIDE, |x, y| (y * SIDE + x) as u64);
        for (factor, ratio) in [(0.6, 0.6), (0.6, 0.8), (1.5, 1.0), (0.5, 1.0)] {
            let room = Room::new(ratio);
            let exact = room.reference.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| factor * v)));
            let exact = mse(&exact.to_srgb(), &room.reference.to_srgb(), None).unwrap().unwrap();
            for scatter in SCATTERS {
                let found = |seed| LightMse::new(&room.difference(factor, scatter, seed), &room.valid, &blocks);
                let found: Vec<LightMse> = (0..200).map(|seed| found(seed).unwrap().unwrap()).collect();
                let (mean, spread) = mean_and_deviation(&found.iter().map(|mse| mse.mse).collect::<Vec<_>>());
                let stated = found.iter().map(LightMse::standard_error).sum::<f64>() / 200.0;
                let what = format!("{factor} {ratio} {scatter:?}: {mean} {exact}, {stated} {spread}");
                // A pivot that is off leaves a bias of a fifth of a decibel at most.
                assert!((mean - exact).abs() < 0.045 * exact + 4.0 * spread / 200_f64.sqrt(), "{what}");
                assert!(spread < 1e-9 || (0.75..1.35).contains(&(stated / spread)), "{what}");
            }
        }
    }

    #[test]
    fn ratios_are_bounded() {
        let picture = |rgb| Picture::filled(1, 1, LinearRgb(rgb));
        let of = |p, t| base_color_ratio(&picture(p), &picture(t)).get(0, 0).0;
        assert_eq!(of([0.25, 0.9, 0.0], [0.25, 0.0, 0.0]), [1.0, 8.0, 1.0]);
        assert_eq!(of([16.0, -1.0, 0.999], [1.0, 0.999, 0.499]), [1.0, 1e-3, 2.0]);
    }
}
