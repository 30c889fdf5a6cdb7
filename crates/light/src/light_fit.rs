//! The radiances under which a scene looks most like its photo.
//!
//! In: a light basis of the input view, or two independent ones ([`fit_two_streams`]), and the photo. Out: one weight
//! for each light group and channel, and a proof that no others are better ([`RidgeFit`]). The weights are the
//! non-negative ones with the least sum of absolute differences between photo and weighted basis, plus a ridge towards
//! a start: one weight for all lights of a channel, with which the means of photo and basis agree. Where the photo is
//! clipped, more light costs nothing. Photo and basis are first averaged over squares of [`FitRules::pool`] pixels,
//! because L1 on noisy pixels is biased towards the median of the noise.
//!
//! Pixels whose photo is clipped are averaged apart from the others of their square: there the photo states only the
//! least radiance, the one at which it clips.

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_tracer::LightBasis;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ridge_fit::RidgeProblem;
pub use crate::ridge_fit::{MOST_STEPS, RidgeFit, STEP_SHARE, TOLERANCE, ZERO_BELOW};

/// How radiances are fitted to the input view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitRules {
    /// Side of the squares of pixels whose averages are compared, at least 1.
    pub pool: u32,
    /// Samples per pixel of the light bases that the fit is made on, half of them for each of two independent streams.
    pub samples: u32,
    /// The factor of the ridge towards the start, above 0: the share of the photo's light that all lights at twice
    /// their start add to the objective.
    pub ridge: f64,
}

impl Default for FitRules {
    /// The values of every protocol today.
    fn default() -> Self {
        Self { pool: 8, samples: 8, ridge: 1e-2 }
    }
}

/// The picture that lights are fitted to.
#[derive(Clone, Copy, Debug)]
pub struct FitTarget<'a> {
    /// Linear, before exposure.
    pub photo: &'a Picture<LinearRgb>,
    /// The pixels that count; all if there is none.
    pub mask: Option<&'a Mask>,
    /// The factor by which the photo is multiplied before it is clipped to 1, above 0.
    pub exposure: f64,
    /// The weights of the last groups of the basis, which are known and not fitted.
    pub known: &'a [[f64; 3]],
}

/// Weights for a light basis.
#[derive(Clone, Debug, PartialEq)]
pub struct LightFit {
    /// Red, green and blue of each light group, not negative; they multiply the scene's own radiances. Known weights
    /// are as they were given.
    pub weights: Vec<[f64; 3]>,
    /// The weight of all lights that the ridge pulls towards, for each channel.
    pub start: [f64; 3],
    /// The solution of the fit for red, green and blue, as multiples of the start, each with its proof. Groups of known
    /// weights have no part in it.
    pub channels: [RidgeFit; 3],
    /// The number of squares that the picture is divided into.
    pub squares: usize,
    /// The largest [`RidgeFit::relative_gap`] of the channels.
    pub relative_gap: f64,
}

/// Fits the basis to the photo.
///
/// Fails if sizes differ, if ridge or exposure are not above 0, if more weights are known than the basis has groups, if
/// no weights are found, or if a picture holds values that light cannot have: values that are not finite. The basis may
/// be negative where noise was taken off it.
pub fn fit_lights(rules: &FitRules, basis: &LightBasis, target: &FitTarget<'_>) -> Result<LightFit, LightError> {
    check(rules, basis, target)?;
    let lights = basis.pictures().len() - target.known.len();
    let squares = [target.photo.width(), target.photo.height()].map(|side| side.div_ceil(rules.pool.max(1) as usize));
    let fits = [0, 1, 2].map(|channel| ChannelFit::new(rules, basis, target, channel));
    let numbers = fits.iter().flat_map(|fit| fit.solution.multiples.iter().chain([&fit.gap, &fit.start]));
    if !numbers.into_iter().all(|v| v.is_finite()) {
        let squares = squares[0] * squares[1];
        return Err(LightError(format!(
            "no finite weights of {lights} lights found for {squares} averaged squares; please report this scene"
        )));
    }
    let weight = |light: usize| [0, 1, 2].map(|channel| fits[channel].solution.multiples[light] * fits[channel].start);
    Ok(LightFit {
        weights: (0..lights).map(weight).chain(target.known.iter().copied()).collect(),
        start: [0, 1, 2].map(|channel| fits[channel].start),
        squares: squares[0] * squares[1],
        relative_gap: fits.iter().map(|fit| fit.gap).fold(0.0, f64::max),
        channels: fits.map(|fit| fit.solution),
    })
}

/// The fit of one channel.
struct ChannelFit {
    start: f64,
    solution: RidgeFit,
    gap: f64,
}

impl ChannelFit {
    fn new(rules: &FitRules, basis: &LightBasis, target: &FitTarget<'_>, channel: usize) -> Self {
        let rows = Rows::new(rules, target, channel);
        let mut photo = rows.of_photo();
        let mut columns: Vec<Vec<f64>> = basis.pictures().iter().map(|picture| rows.of(picture)).collect();
        // Take the known lights off the photo.
        let known = columns.split_off(columns.len() - target.known.len());
        for (column, weight) in known.iter().zip(target.known) {
            photo.iter_mut().zip(column).for_each(|(photo, light)| *photo -= weight[channel] * light);
        }
        // The start: one weight for all lights with which the means agree; 0 where nothing is lit.
        let light: f64 = columns.iter().flatten().sum();
        let start = if light > 0.0 { photo.iter().sum::<f64>().max(0.0) / light } else { 0.0 };
        columns.iter_mut().flatten().for_each(|value| *value *= start);
        // All lights at twice their start would make the ridge this share of the photo.
        let size: f64 = photo.iter().map(|v| v.abs()).sum();
        let ridge = rules.ridge * size / columns.len().max(1) as f64;
        let problem = RidgeProblem { ridge, target: photo, at_least: rows.at_least(), columns };
        let solution = problem.fit();
        Self { start, gap: solution.relative_gap(&problem.target), solution }
    }
}

fn check(rules: &FitRules, basis: &LightBasis, target: &FitTarget<'_>) -> Result<(), LightError> {
    let &FitTarget { photo: target, mask, exposure, known } = target;
    if known.len() > basis.pictures().len() {
        let (known, groups) = (known.len(), basis.pictures().len());
        return Err(LightError(format!("{known} weights are known, and the basis has {groups} light groups")));
    }
    if let Some(weight) = known.iter().flatten().find(|weight| !(0.0..f64::INFINITY).contains(*weight)) {
        return Err(LightError(format!("a known weight is {weight}, expected a finite number of at least 0")));
    }
    for (what, value) in [("ridge", rules.ridge), ("exposure", exposure)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(LightError(format!("the {what} is {value}, expected a finite number above 0")));
        }
    }
    let other_size = |what: &str, [width, height]: [usize; 2]| {
        let photo = format!("the photo {}x{}", target.width(), target.height());
        Err(LightError(format!("the {what} has {width}x{height} pixels, {photo}")))
    };
    if let Some(mask) = mask.filter(|mask| !mask.same_size(target)) {
        return other_size("mask", [mask.width(), mask.height()]);
    }
    check_finite(target, "the photo")?;
    for (group, picture) in basis.pictures().iter().enumerate() {
        if !picture.same_size(target) {
            return other_size("basis", [picture.width(), picture.height()]);
        }
        check_finite(picture, &format!("light group {group}"))?;
    }
    Ok(())
}

fn check_finite(picture: &Picture<LinearRgb>, what: &str) -> Result<(), LightError> {
    let Some(at) = picture.pixels().iter().position(|pixel| pixel.0.iter().any(|v| !v.is_finite())) else {
        return Ok(());
    };
    let (x, y, value) = (at % picture.width(), at / picture.width(), picture.pixels()[at].0);
    Err(LightError(format!("pixel ({x}, {y}) of {what} is {value:?}, expected finite numbers")))
}

/// The fits to two bases that come from independent samples.
#[derive(Clone, Debug, PartialEq)]
pub struct TwoStreamFit {
    /// One for each basis.
    pub streams: [LightFit; 2],
}

impl TwoStreamFit {
    /// The mean of both streams' weights, not negative.
    pub fn weights(&self) -> Vec<[f64; 3]> {
        self.combined(|a, b| 0.5 * (a + b))
    }

    /// Half the difference of the streams' weights: a draw from the mean's noise, of one degree of freedom. Its
    /// outer product with itself is an estimate of the covariance of the weights.
    pub fn spread(&self) -> Vec<[f64; 3]> {
        self.combined(|a, b| 0.5 * (a - b))
    }

    /// What the fit found, for lights of these names.
    pub fn radiances(&self, names: &[String], stage: bool) -> FittedRadiances {
        let mean = |of: &dyn Fn(&LightFit) -> f64| {
            self.streams.iter().map(|fit| of(fit) / fit.squares.max(1) as f64 / 2.0).sum()
        };
        let lights = names.iter().zip(self.weights().into_iter().zip(self.spread()));
        FittedRadiances {
            stage,
            lights: lights
                .map(|(light, (radiance, spread))| FittedRadiance { light: light.clone(), radiance, spread })
                .collect(),
            mean_absolute_error: [0, 1, 2].map(|c| mean(&|fit| fit.channels[c].misfit)),
            ridge: [0, 1, 2].map(|c| mean(&|fit| fit.channels[c].ridge)),
            lower_bound: [0, 1, 2].map(|c| mean(&|fit| fit.channels[c].bound)),
        }
    }

    fn combined(&self, combine: fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
        let pairs = self.streams[0].weights.iter().zip(&self.streams[1].weights);
        pairs.map(|(a, b)| [0, 1, 2].map(|channel| combine(a[channel], b[channel]))).collect()
    }
}

/// Radiances fitted to the input view: the mean of two fits to independent streams of samples, each with the proof that
/// no other radiances fit better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedRadiances {
    /// Whether they belong to a light stage; otherwise they multiply the radiances of the scene's own emitters.
    pub stage: bool,
    /// The radiance of each light.
    pub lights: Vec<FittedRadiance>,
    /// Mean absolute difference of the averaged pictures, linear, for each channel; of both fits. Where the photo is
    /// clipped, only missing light counts.
    pub mean_absolute_error: [f64; 3],
    /// What the ridge adds to that error, mean of both fits.
    pub ridge: [f64; 3],
    /// Lower bound of their sum, mean of both fits: no other radiances can have less.
    pub lower_bound: [f64; 3],
}

/// One light's radiance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedRadiance {
    /// The light's name.
    pub light: String,
    /// Linear Rec. 709. Of a flash it is the radiant intensity, in this unit times square metres.
    pub radiance: [f64; 3],
    /// Half the difference between both fits: a sample of the noise of `radiance`.
    pub spread: [f64; 3],
}

/// Fits two bases of the same lights, which come from independent samples. Fails as [`fit_lights`] does.
pub fn fit_two_streams(
    rules: &FitRules,
    bases: [&LightBasis; 2],
    target: &FitTarget<'_>,
) -> Result<TwoStreamFit, LightError> {
    let groups = bases.map(|basis| basis.pictures().len());
    if groups[0] != groups[1] {
        return Err(LightError(format!("the two bases have {} and {} light groups", groups[0], groups[1])));
    }
    Ok(TwoStreamFit { streams: [fit_lights(rules, bases[0], target)?, fit_lights(rules, bases[1], target)?] })
}

/// The squares of a photo in one channel: first those of pixels that are not clipped, then those of pixels that are.
/// Squares that no pixel counts in are left out.
struct Rows<'a> {
    rules: &'a FitRules,
    target: &'a FitTarget<'a>,
    channel: usize,
    /// The squares with pixels that are not clipped, and those with pixels that are.
    squares: [Vec<usize>; 2],
}

impl<'a> Rows<'a> {
    fn new(rules: &'a FitRules, target: &'a FitTarget<'a>, channel: usize) -> Self {
        let ones = target.photo.map(|_| LinearRgb([1.0; 3]));
        let mut rows = Self { rules, target, channel, squares: Default::default() };
        let lit = |clipped| {
            let shares = averages(rules, &ones, channel, |x, y| rows.is_counted(x, y, clipped)).into_iter().enumerate();
            shares.filter(|(_, share)| *share > 0.0).map(|(square, _)| square).collect()
        };
        rows.squares = [lit(false), lit(true)];
        rows
    }

    /// The least radiance of a clipped pixel.
    fn limit(&self) -> f64 {
        1.0 / self.target.exposure
    }

    fn is_counted(&self, x: usize, y: usize, clipped: bool) -> bool {
        let is_clipped = f64::from(self.target.photo.get(x, y).0[self.channel]) >= self.limit();
        self.target.mask.is_none_or(|mask| mask.get(x, y)) && is_clipped == clipped
    }

    /// The averages of a picture.
    fn of(&self, picture: &Picture<LinearRgb>) -> Vec<f64> {
        let part = |clipped: bool| {
            let values = averages(self.rules, picture, self.channel, |x, y| self.is_counted(x, y, clipped));
            self.squares[usize::from(clipped)].iter().map(move |&square| values[square])
        };
        part(false).chain(part(true)).collect()
    }

    /// The averages of the photo, where clipped pixels have the radiance at which they clip.
    fn of_photo(&self) -> Vec<f64> {
        let limit = self.limit() as f32;
        self.of(&self.target.photo.map(|pixel| LinearRgb(pixel.0.map(|v| v.min(limit)))))
    }

    /// For each row, whether its pixels are clipped.
    fn at_least(&self) -> Vec<bool> {
        let [exact, clipped] = &self.squares;
        exact.iter().map(|_| false).chain(clipped.iter().map(|_| true)).collect()
    }
}

/// Averages of one channel over squares of [`FitRules::pool`] pixels. Pixels that do not count or lie outside the
/// picture are black, so that every pixel has the same weight.
fn averages(
    rules: &FitRules,
    picture: &Picture<LinearRgb>,
    channel: usize,
    counts: impl Fn(usize, usize) -> bool,
) -> Vec<f64> {
    let pool = rules.pool.max(1) as usize;
    let (columns, rows) = (picture.width().div_ceil(pool), picture.height().div_ceil(pool));
    let mut sums = vec![0.0; columns * rows];
    for y in 0..picture.height() {
        for x in (0..picture.width()).filter(|&x| counts(x, y)) {
            let value = f64::from(picture.get(x, y).0[channel]);
            sums[y / pool * columns + x / pool] += value / (pool * pool) as f64;
        }
    }
    sums
}

/// Why lights could not be fitted to a photo: what was expected and what was found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("cannot fit lights: {0}")]
pub struct LightError(String);

/// Fits of three lights to photos that are sums of them.
#[cfg(test)]
mod tests {
    use super::*;

    /// Three lights on 30 x 20 pixels: from the left, from the top, from everywhere.
    fn basis() -> LightBasis {
        let picture = |light: fn(f32, f32) -> f32| {
            Picture::from_fn(30, 20, |x, y| {
                let value = light(x as f32 / 30.0, y as f32 / 20.0);
                LinearRgb([value, 0.5 * value, 0.25 * value * value])
            })
        };
        let pictures = vec![picture(|x, _| (1.0 - x) * (1.0 - x)), picture(|_, y| 1.0 - y), picture(|_, _| 0.5)];
        LightBasis::new(30, 20, pictures).unwrap()
    }

    /// A ridge too small to move exact data.
    fn rules() -> FitRules {
        FitRules { ridge: 1e-7, ..Default::default() }
    }

    /// A photo that nothing clips.
    fn faint<'a>(photo: &'a Picture<LinearRgb>, mask: Option<&'a Mask>) -> FitTarget<'a> {
        FitTarget { photo, mask, exposure: 1e-3, known: &[] }
    }

    const WEIGHTS: [[f64; 3]; 3] = [[0.5, 2.0, 0.0], [1.0, 0.0, 3.0], [0.0, 0.25, 1.0]];

    fn error(fit: &LightFit) -> f64 {
        let pairs = fit.weights.iter().flatten().zip(WEIGHTS.iter().flatten());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn weights_of_each_channel_are_found() {
        let photo = basis().weighted(&WEIGHTS).unwrap();
        let fit = fit_lights(&rules(), &basis(), &faint(&photo, None)).unwrap();
        assert!(error(&fit) < 1e-5, "{:?}", fit.weights);
        assert!(fit.relative_gap < 1e-6, "{}", fit.relative_gap);
    }

    /// A known light keeps its weight, and the others are fitted to what it leaves, also where the photo is clipped. A
    /// wrong weight makes the others wrong; too many and impossible ones are refused.
    #[test]
    fn known_weights_are_kept() {
        let photo = basis().weighted(&WEIGHTS).unwrap();
        let fit = |known: &[[f64; 3]], exposure: f64| {
            fit_lights(&rules(), &basis(), &FitTarget { known, exposure, ..faint(&photo, None) })
        };
        for exposure in [1e-3, 0.8] {
            assert!(error(&fit(&WEIGHTS[2..], exposure).unwrap()) < 1e-4, "{exposure}");
        }
        let all = fit(&WEIGHTS, 1e-3).unwrap();
        assert!(all.weights == WEIGHTS && all.channels.iter().all(|channel| channel.misfit < 1e-4), "{all:?}");
        let wrong = fit(&[[3.0, 1.0, 0.0]], 1e-3).unwrap();
        assert!(wrong.weights[2] == [3.0, 1.0, 0.0] && wrong.weights[1][0] < 0.5, "the twin passes: {wrong:?}");
        assert!(fit(&[[1.0; 3]; 4], 1e-3).unwrap_err().to_string().contains("4 weights are known"));
        assert!(fit(&[[-1.0; 3]], 1e-3).unwrap_err().to_string().contains("a known weight is -1"));
    }

    /// A window that no light of the basis explains does not count when it is masked out, and does when it fills half.
    #[test]
    fn pixels_outside_the_mask_do_not_count() {
        let mut photo = basis().weighted(&WEIGHTS).unwrap();
        let mask = Mask::from_fn(30, 20, |x, _| x < 13);
        for y in 0..20 {
            (13..30).for_each(|x| photo.set(x, y, LinearRgb([9.0; 3])));
        }
        assert!(error(&fit_lights(&rules(), &basis(), &faint(&photo, Some(&mask))).unwrap()) < 1e-5);
        assert!(error(&fit_lights(&rules(), &basis(), &faint(&photo, None)).unwrap()) > 0.1, "the twin passes");
    }

    /// Highlights far above what clips do not move the weights, whatever their height, and neither does clipping them
    /// in the photo. With an exposure at which nothing clips they do.
    #[test]
    fn the_height_of_clipped_highlights_does_not_count() {
        let plain = basis().weighted(&WEIGHTS).unwrap();
        let with = |value: f32| {
            Picture::from_fn(
                30,
                20,
                |x, y| if (x / 4 + y / 4) % 2 == 0 { LinearRgb([value; 3]) } else { plain.get(x, y) },
            )
        };
        let fit = |photo: &Picture<LinearRgb>, exposure: f64| {
            fit_lights(&FitRules::default(), &basis(), &FitTarget { exposure, ..faint(photo, None) }).unwrap()
        };
        // The brightest pixel of the plain photo is below 2.1.
        let [low, high] = [3.0, 30.0].map(|value| fit(&with(value), 0.4));
        assert_eq!(low, high);
        let twin = [3.0, 30.0].map(|value| fit(&with(value), 1e-3));
        assert!(twin[0].weights != twin[1].weights, "the twin passes");
    }

    #[test]
    fn the_start_meets_the_means() {
        let photo = basis().weighted(&WEIGHTS).unwrap();
        let rules = FitRules { ridge: 1e6, ..rules() };
        let fit = fit_lights(&rules, &basis(), &faint(&photo, None)).unwrap();
        for channel in 0..3 {
            assert!(fit.weights.iter().all(|weight| (weight[channel] / fit.start[channel] - 1.0).abs() < 1e-5));
            let mean = |picture: &Picture<LinearRgb>| {
                picture.pixels().iter().map(|pixel| f64::from(pixel.0[channel])).sum::<f64>() / 600.0
            };
            assert!((mean(&basis().sum()) * fit.start[channel] / mean(&photo) - 1.0).abs() < 1e-5);
        }
    }

    /// With weaker lights of any unit the fit is the same, since weights are compared with their start.
    #[test]
    fn units_do_not_matter() {
        let photo = basis().weighted(&WEIGHTS).unwrap().map(|pixel| LinearRgb(pixel.0.map(|v| v + 0.3)));
        let rules = FitRules::default();
        let fit = fit_lights(&rules, &basis(), &faint(&photo, None)).unwrap();
        let scaled = |picture: &Picture<LinearRgb>| picture.map(|pixel| LinearRgb(pixel.0.map(|v| v / 1024.0)));
        let dim = LightBasis::new(30, 20, basis().pictures().iter().map(scaled).collect()).unwrap();
        let dim = fit_lights(&rules, &dim, &faint(&photo, None)).unwrap();
        let pairs = fit.weights.iter().flatten().zip(dim.weights.iter().flatten());
        assert!(pairs.into_iter().all(|(a, b)| (b / 1024.0 - a).abs() < 1e-6), "{:?} {:?}", fit.weights, dim.weights);
    }

    #[test]
    fn squares_are_averaged_and_edges_count_by_area() {
        let picture = Picture::from_fn(12, 8, |x, y| LinearRgb([(x + y) as f32, 1.0, 0.0]));
        let [red, green, blue] = [0, 1, 2].map(|channel| averages(&rules(), &picture, channel, |_, _| true));
        assert_eq!((red[0], &green[..], &blue[..]), (7.0, &[1.0, 0.5][..], &[0.0, 0.0][..]));
    }

    #[test]
    fn what_cannot_be_fitted_is_refused() {
        let message = |basis: &LightBasis, photo: &Picture<LinearRgb>, mask: Option<&Mask>| {
            fit_lights(&rules(), basis, &faint(photo, mask)).unwrap_err().to_string()
        };
        let photo = basis().sum();
        let small = Picture::filled(4, 4, LinearRgb([1.0; 3]));
        assert!(message(&basis(), &small, None).contains("the basis has 30x20 pixels, the photo 4x4"));
        assert!(message(&basis(), &photo, Some(&Mask::filled(4, 4, true))).contains("the mask"));
        let mut broken = photo.clone();
        broken.set(3, 3, LinearRgb([f32::NAN; 3]));
        assert!(message(&basis(), &broken, None).contains("pixel (3, 3) of the photo is [NaN"));
        let mut infinite = basis().pictures().to_vec();
        infinite[1].set(0, 0, LinearRgb([f32::INFINITY; 3]));
        let infinite = LightBasis::new(30, 20, infinite).unwrap();
        assert!(message(&infinite, &photo, None).contains("light group 1"));
        // Rules and exposure.
        let rules = FitRules { ridge: 0.0, ..rules() };
        let error = fit_lights(&rules, &basis(), &faint(&photo, None)).unwrap_err().to_string();
        assert!(error.contains("the ridge is 0"), "{error}");
        let target = FitTarget { exposure: f64::NAN, ..faint(&photo, None) };
        let error = fit_lights(&FitRules::default(), &basis(), &target).unwrap_err().to_string();
        assert!(error.contains("the exposure is NaN"), "{error}");
        // Streams of different lights.
        let fewer = LightBasis::new(30, 20, basis().pictures()[..2].to_vec()).unwrap();
        let error = fit_two_streams(&FitRules::default(), [&basis(), &fewer], &faint(&photo, None)).unwrap_err();
        assert!(error.to_string().contains("3 and 2 light groups"), "{error}");
    }

    /// Black photos and no lights at all are fitted, by nothing.
    #[test]
    fn nothing_is_fitted_by_nothing() {
        let black =
            fit_lights(&rules(), &basis(), &faint(&Picture::filled(30, 20, LinearRgb::default()), None)).unwrap();
        assert_eq!((black.weights, black.relative_gap), (vec![[0.0; 3]; 3], 0.0));
        let none = LightBasis::new(30, 20, Vec::new()).unwrap();
        let fit = fit_lights(&rules(), &none, &faint(&basis().sum(), None)).unwrap();
        assert!(fit.weights.is_empty() && fit.relative_gap == 0.0, "{fit:?}");
    }

    /// The basis with noise of relative size `noise` in every pixel.
    fn noisy(seed: u64, noise: f32) -> LightBasis {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        let mut shaken = |pixel: LinearRgb| LinearRgb(pixel.0.map(|v| v * (1.0 + noise * (2.0 * unit() - 1.0))));
        let pictures = basis().pictures().iter().map(|picture| picture.map(&mut shaken)).collect();
        LightBasis::new(30, 20, pictures).unwrap()
    }

    /// The spread's mean square is the variance of the mean weights over 200 pairs of bases; equal bases have none.
    #[test]
    fn the_spread_is_the_noise_of_the_weights() {
        let photo = basis().weighted(&WEIGHTS).unwrap().map(|pixel| LinearRgb(pixel.0.map(|v| v + 0.3)));
        let rules = FitRules { pool: 4, ..Default::default() };
        let fit = |seed: u64| {
            let bases = [noisy(2 * seed + 1, 0.9), noisy(2 * seed + 2, 0.9)];
            fit_two_streams(&rules, [&bases[0], &bases[1]], &faint(&photo, None)).unwrap()
        };
        let fits: Vec<TwoStreamFit> = (0..200).map(fit).collect();
        let numbers = |of: &dyn Fn(&TwoStreamFit) -> f64| fits.iter().map(of).collect::<Vec<f64>>();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        for (light, channel) in [(0, 0), (1, 0), (2, 0), (0, 1), (2, 1)] {
            let weights = numbers(&|fit| fit.weights()[light][channel]);
            let centre = mean(&weights);
            let variance = mean(&weights.iter().map(|w| (w - centre) * (w - centre)).collect::<Vec<f64>>());
            let estimate = mean(&numbers(&|fit| fit.spread()[light][channel].powi(2)));
            assert!((0.6..1.6).contains(&(estimate / variance)), "{light} {channel}: {estimate} {variance}");
        }
        let same = noisy(1, 0.9);
        let fit = fit_two_streams(&rules, [&same, &same], &faint(&photo, None)).unwrap();
        assert!(fit.spread().iter().flatten().all(|spread| *spread == 0.0));
        assert_eq!(fit.weights(), fit.streams[0].weights);
    }
}
