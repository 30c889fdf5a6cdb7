//! An instance's squared error, taken apart by kind so that the parts add up.
//!
//! First, the error in pixels whose surface the photo does not show is set apart: nothing in the photo determines it.
//! Over the other pixels of one instance, in all views and channels, let t be the truth and m0 = p the prediction, both
//! linear. Step k replaces the model m(k-1) by that m(k) of its family of models which is nearest to t, in the sum of
//! squares E(k) = |t - m(k)|²:
//!
//! 1. scale: m1 = s m0, one s for all; s = <t, m0> / <m0, m0>.
//! 2. chroma: m2 = s_c m1, one s_c a channel, by the same formula.
//! 3. shading: m3 = m2 + m2 q_v(x, y), one quadratic polynomial a view, the same for all channels ([`factors`]).
//! 4. misplacement: m4(x) = m2(x - d_v) (1 + q_v(x)), one whole-pixel shift a view; the polynomial stays
//!    ([`take_shift`]).
//! 5. detail: m5 = m4 + b (t - G t), one b >= 0, G the one of some Gaussians that does best ([`take_detail`]).
//!
//! Steps 1, 2 and 3 are orthogonal projections of the residual t - m(k-1) on the space that the step spans, step 5 is
//! one on a half line, and step 4 picks the best of a list that includes no shift. No step therefore increases E: the
//! part of its kind is E(k-1) - E(k) >= 0 and the rest is E(5). Together with the unobserved part they add up to the
//! whole error.
//!
//! **Order matters.** An error that two steps could remove counts for the first of them. Scale and chroma remove a
//! little of every error, because the best fit to values that do not match is dimmer. A quadratic also follows smooth
//! changes of the truth that the prediction lacks, whether or not light causes them: for a flat prediction, 'shading'
//! is the slope of the truth itself. Detail comes after misplacement, because misplaced detail is missing where it
//! belongs. Detail of the prediction that the truth does not have is rest. In views and instances of few pixels, steps
//! 3 and 4 fit chance.

use std::collections::BTreeMap;

use mateval_eval::shown::SceneAlbedo;
use mateval_image::{LinearRgb, Picture};

use super::file::KindShares;

/// A patch of fewer pixels gets neither a smooth factor nor a shift, which would fit chance: eight pixels for each
/// term of the factor.
const FEWEST_PIXELS: usize = 48;
/// 1, x, y and their products of second order.
const TERMS: usize = 6;
/// A term is left out if less than this share of its squares is independent of the terms before it, as in a patch of
/// one row.
const LEAST_NEW: f64 = 1e-9;
/// The farthest shift along either axis, in pixels.
const FARTHEST: isize = 4;
/// Standard deviations of the Gaussians, in pixels.
const SIGMAS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// The valid pixels of one instance in one view, with their bounding box.
pub(super) struct Patch {
    /// Number of the view.
    pub(super) view: usize,
    /// Column and row of the box's top left pixel in the picture.
    pub(super) corner: [usize; 2],
    /// Columns and rows of the box.
    pub(super) size: [usize; 2],
    /// The pixel at each position of the box, row by row.
    index: Vec<Option<u32>>,
    /// Column and row in the picture, row by row.
    pub(super) places: Vec<[usize; 2]>,
    /// Linear RGB of the truth at each place.
    pub(super) truth: Vec<[f64; 3]>,
    /// Linear RGB of the prediction at each place.
    pub(super) predicted: Vec<[f64; 3]>,
    /// Whether the photo shows the surface at each place.
    pub(super) observed: Vec<bool>,
}

/// The patches of every instance that has any, by its index, in the order of views. Pixels that show no instance are
/// left out.
pub(super) fn patches(views: &[SceneAlbedo]) -> BTreeMap<u16, Vec<Patch>> {
    let mut all: BTreeMap<u16, Vec<Patch>> = BTreeMap::new();
    for (number, view) in views.iter().enumerate() {
        let width = view.truth.valid.width();
        let mut places: BTreeMap<u16, Vec<[usize; 2]>> = BTreeMap::new();
        for (at, instance) in view.truth.instances.pixels().iter().enumerate() {
            if *instance != 0 && view.truth.valid.pixels()[at] {
                places.entry(*instance).or_default().push([at % width, at / width]);
            }
        }
        for (instance, places) in places {
            let values = |picture: &Picture<LinearRgb>| {
                places.iter().map(|&[x, y]| picture.get(x, y).0.map(f64::from)).collect()
            };
            let (truth, predicted) = (values(&view.truth.albedo), values(&view.predicted[0]));
            let unobserved = view.truth.unobserved.as_ref();
            let observed = places.iter().map(|&[x, y]| unobserved.is_none_or(|mask| !mask.get(x, y))).collect();
            all.entry(instance).or_default().push(Patch::new(number, places, truth, predicted, observed));
        }
    }
    all
}

impl Patch {
    /// `places` holds at least one position, each once. `truth`, `predicted` and `observed` hold a value for each.
    pub(super) fn new(
        view: usize,
        places: Vec<[usize; 2]>,
        truth: Vec<[f64; 3]>,
        predicted: Vec<[f64; 3]>,
        observed: Vec<bool>,
    ) -> Self {
        let least = |axis: usize| places.iter().map(|place| place[axis]).min().unwrap_or(0);
        let most = |axis: usize| places.iter().map(|place| place[axis]).max().unwrap_or(0);
        let corner = [0, 1].map(least);
        let size = [0, 1].map(|axis| most(axis) - corner[axis] + 1);
        let mut index = vec![None; size[0] * size[1]];
        for (at, [x, y]) in places.iter().enumerate() {
            index[(y - corner[1]) * size[0] + x - corner[0]] = Some(at as u32);
        }
        Self { view, corner, size, index, places, truth, predicted, observed }
    }

    /// The pixels whose surface the photo shows; none if it shows no such pixel.
    pub(super) fn observed_part(&self) -> Option<Self> {
        fn kept<T: Copy>(values: &[T], observed: &[bool]) -> Vec<T> {
            values.iter().zip(observed).filter(|(_, observed)| **observed).map(|(value, _)| *value).collect()
        }
        let places = kept(&self.places, &self.observed);
        let [truth, predicted] = [&self.truth, &self.predicted].map(|values| kept(values, &self.observed));
        let all = vec![true; places.len()];
        (!places.is_empty()).then(|| Self::new(self.view, places, truth, predicted, all))
    }

    /// The pixel at a position of the box; none if it does not belong to the instance.
    pub(super) fn at(&self, x: isize, y: isize) -> Option<usize> {
        let inside = |v: isize, axis: usize| usize::try_from(v).ok().filter(|v| *v < self.size[axis]);
        let (x, y) = (inside(x, 0)?, inside(y, 1)?);
        self.index[y * self.size[0] + x].map(|at| at as usize)
    }

    /// Column and row in the box.
    pub(super) fn in_box(&self, pixel: usize) -> [isize; 2] {
        let place = self.places[pixel];
        [0, 1].map(|axis| (place[axis] - self.corner[axis]) as isize)
    }
}

/// Linear RGB of every pixel, patch by patch, in the order of the patch's places.
type Model = Vec<Vec<[f64; 3]>>;

/// The squared error of all patches, summed over pixels and channels.
fn error(patches: &[Patch], model: &Model) -> f64 {
    patches.iter().zip(model).map(|(patch, model)| patch_error(&patch.truth, model)).sum()
}

/// The squared error of one patch, summed over pixels and channels.
pub(super) fn patch_error(truth: &[[f64; 3]], model: &[[f64; 3]]) -> f64 {
    truth.iter().zip(model).map(|(t, m)| (0..3).map(|c| (t[c] - m[c]).powi(2)).sum::<f64>()).sum()
}

/// The error of one instance, or of several, taken apart.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Explained {
    pub(super) pixels: usize,
    /// The number of those pixels whose surface the photo does not show.
    pub(super) unobserved_pixels: usize,
    /// Sum over pixels and channels.
    pub(super) squared_error: f64,
    /// The squared error in observed pixels: before the first step, and after each step.
    left: [f64; 6],
    pub(super) scale: f64,
    pub(super) channel_scales: [f64; 3],
    /// The shifts of step 4, for the views in which one lowers the error.
    pub(super) shifts: Vec<Shift>,
    pub(super) blur_sigma_pixels: Option<f64>,
}

/// Takes the error of one instance apart, given its patches.
pub(super) fn explained(patches: &[Patch]) -> Explained {
    let whole: Model = patches.iter().map(|patch| patch.predicted.clone()).collect();
    let squared_error = error(patches, &whole);
    let pixels = patches.iter().map(|patch| patch.places.len()).sum();
    let unobserved_pixels = patches.iter().flat_map(|patch| &patch.observed).filter(|observed| !**observed).count();
    let patches = &patches.iter().filter_map(Patch::observed_part).collect::<Vec<_>>()[..];
    let mut model: Model = patches.iter().map(|patch| patch.predicted.clone()).collect();
    let observed = error(patches, &model);
    let scale = take_scale(patches, &mut model);
    let after_scale = error(patches, &model);
    let channel_scales = take_channel_scales(patches, &mut model);
    let after_chroma = error(patches, &model);
    let factors: Vec<Vec<f64>> = patches.iter().zip(&model).map(|(patch, model)| factors(patch, model)).collect();
    let unmoved: Model = model.iter().zip(&factors).map(|(model, factors)| shaded(model, factors)).collect();
    let after_shading = error(patches, &unmoved);
    let views = patches.iter().zip(&mut model).zip(&factors);
    let shifts = views.filter_map(|((patch, model), factors)| take_shift(patch, model, factors)).collect();
    let after_shift = error(patches, &model);
    let blur_sigma_pixels = take_detail(patches, &mut model);
    let left = [observed, after_scale, after_chroma, after_shading, after_shift, error(patches, &model)];
    Explained { pixels, unobserved_pixels, squared_error, left, scale, channel_scales, shifts, blur_sigma_pixels }
}

impl Explained {
    /// The sum over several instances, without scales, shifts and blur, which only single instances have.
    pub(super) fn sum<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        let none = Self {
            pixels: 0,
            unobserved_pixels: 0,
            squared_error: 0.0,
            left: [0.0; 6],
            scale: 1.0,
            channel_scales: [1.0; 3],
            shifts: Vec::new(),
            blur_sigma_pixels: None,
        };
        all.fold(none, |sum, one| Self {
            pixels: sum.pixels + one.pixels,
            unobserved_pixels: sum.unobserved_pixels + one.unobserved_pixels,
            squared_error: sum.squared_error + one.squared_error,
            left: std::array::from_fn(|step| sum.left[step] + one.left[step]),
            ..sum
        })
    }

    /// Mean squared error over pixels and channels; 0 if there are no pixels.
    pub(super) fn mse(&self) -> f64 {
        if self.pixels == 0 { 0.0 } else { self.squared_error / (3 * self.pixels) as f64 }
    }

    /// The shares of the kinds; none if there is no error.
    pub(super) fn kinds(&self) -> Option<KindShares> {
        let [observed, scale, chroma, shading, shift, detail] = self.left;
        let share = |before: f64, after: f64| (before - after) / self.squared_error;
        (self.squared_error > 0.0).then(|| KindShares {
            unobserved: share(self.squared_error, observed),
            scale: share(observed, scale),
            chroma: share(scale, chroma),
            shading: share(chroma, shading),
            misplacement: share(shading, shift),
            detail: share(shift, detail),
            rest: share(detail, 0.0),
        })
    }
}

/// Sums over all pixels, by channel: of truth times model, and of the model's squares.
fn sums(patches: &[Patch], model: &Model) -> ([f64; 3], [f64; 3]) {
    let (mut products, mut squares) = ([0.0; 3], [0.0; 3]);
    for (truth, model) in patches.iter().zip(model).flat_map(|(patch, model)| patch.truth.iter().zip(model)) {
        for c in 0..3 {
            products[c] += truth[c] * model[c];
            squares[c] += model[c] * model[c];
        }
    }
    (products, squares)
}

/// The scale with the least squared error; 1 if the model is black.
pub(super) fn best_scale(product: f64, square: f64) -> f64 {
    if square == 0.0 { 1.0 } else { product / square }
}

/// Step 1: multiplies the model by the one scale that brings it nearest to the truth. Returns the scale.
fn take_scale(patches: &[Patch], model: &mut Model) -> f64 {
    let (products, squares) = sums(patches, model);
    let scale = best_scale(products.iter().sum(), squares.iter().sum());
    multiply(model, [scale; 3]);
    scale
}

/// Step 2: multiplies the model's channels by the scales that bring them nearest to the truth. Returns the scales.
fn take_channel_scales(patches: &[Patch], model: &mut Model) -> [f64; 3] {
    let (products, squares) = sums(patches, model);
    let scales = std::array::from_fn(|c| best_scale(products[c], squares[c]));
    multiply(model, scales);
    scales
}

fn multiply(model: &mut Model, scales: [f64; 3]) {
    for pixel in model.iter_mut().flatten() {
        *pixel = std::array::from_fn(|c| pixel[c] * scales[c]);
    }
}

/// Step 3: the factor 1 + q for each pixel, where q is the quadratic polynomial of its position that brings the model
/// times 1 + q nearest to the truth: the residual is projected on the products of the model and each term. All channels
/// share the polynomial.
fn factors(patch: &Patch, model: &[[f64; 3]]) -> Vec<f64> {
    if model.len() < FEWEST_PIXELS {
        return vec![1.0; model.len()];
    }
    let (mut matrix, mut right) = ([[0.0; TERMS]; TERMS], [0.0; TERMS]);
    for (pixel, value) in model.iter().enumerate() {
        let terms = terms(patch, pixel);
        let square: f64 = value.iter().map(|v| v * v).sum();
        let product: f64 = (0..3).map(|c| (patch.truth[pixel][c] - value[c]) * value[c]).sum();
        for i in 0..TERMS {
            right[i] += product * terms[i];
            for j in 0..TERMS {
                matrix[i][j] += square * terms[i] * terms[j];
            }
        }
    }
    let weights = solution(matrix, right);
    let factor =
        |pixel| 1.0 + terms(patch, pixel).iter().zip(&weights).map(|(term, weight)| term * weight).sum::<f64>();
    (0..model.len()).map(factor).collect()
}

/// The terms of the polynomial at a pixel, whose position runs from -1 to 1 over the patch's box.
fn terms(patch: &Patch, pixel: usize) -> [f64; TERMS] {
    let place = patch.in_box(pixel);
    let [x, y] = [0, 1].map(|axis| match patch.size[axis] {
        1 => 0.0,
        size => 2.0 * place[axis] as f64 / (size - 1) as f64 - 1.0,
    });
    [1.0, x, y, x * x, x * y, y * y]
}

/// Solves the normal equations by Cholesky decomposition; a term that depends on those before it gets weight 0.
fn solution(matrix: [[f64; TERMS]; TERMS], right: [f64; TERMS]) -> [f64; TERMS] {
    let mut lower = [[0.0; TERMS]; TERMS];
    let mut forward = [0.0; TERMS];
    for i in 0..TERMS {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            lower[i][j] = match (i == j, lower[j][j]) {
                (true, _) => {
                    if rest > LEAST_NEW * matrix[i][i] {
                        rest.sqrt()
                    } else {
                        0.0
                    }
                }
                (false, 0.0) => 0.0,
                (false, pivot) => rest / pivot,
            };
        }
        let rest = right[i] - (0..i).map(|k| lower[i][k] * forward[k]).sum::<f64>();
        forward[i] = if lower[i][i] == 0.0 { 0.0 } else { rest / lower[i][i] };
    }
    let mut weights = [0.0; TERMS];
    for i in (0..TERMS).rev() {
        let rest = forward[i] - (i + 1..TERMS).map(|k| lower[k][i] * weights[k]).sum::<f64>();
        weights[i] = if lower[i][i] == 0.0 { 0.0 } else { rest / lower[i][i] };
    }
    weights
}

/// How far the model of one view was moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shift {
    /// Number of the view.
    pub(super) view: usize,
    /// To the right and down.
    pub(super) pixels: [i32; 2],
}

/// A model's pixels times their factors.
fn shaded(model: &[[f64; 3]], factors: &[f64]) -> Vec<[f64; 3]> {
    model.iter().zip(factors).map(|(value, factor)| value.map(|v| v * factor)).collect()
}

/// Step 4: moves the model by the whole pixels that bring it, times the factors, nearest to the truth, and multiplies
/// it by the factors. Returns none if the model is best unmoved. Factors do not move, and a pixel whose new value would
/// come from outside the instance keeps its own, so that a flat prediction cannot improve. Of equally good shifts, the
/// first by row, then by column, is taken.
fn take_shift(patch: &Patch, model: &mut [[f64; 3]], factors: &[f64]) -> Option<Shift> {
    let farthest = if model.len() < FEWEST_PIXELS { 0 } else { FARTHEST };
    let (mut least, mut best) = (patch_error(&patch.truth, &shaded(model, factors)), [0, 0]);
    for dy in -farthest..=farthest {
        for dx in -farthest..=farthest {
            let found = moved_error(patch, model, factors, [dx, dy], least);
            if found < least {
                (least, best) = (found, [dx, dy]);
            }
        }
    }
    let moved: Vec<[f64; 3]> = (0..model.len()).map(|pixel| moved(patch, model, factors, pixel, best)).collect();
    model.copy_from_slice(&moved);
    (best != [0, 0]).then(|| Shift { view: patch.view, pixels: best.map(|v| v as i32) })
}

fn moved(patch: &Patch, model: &[[f64; 3]], factors: &[f64], pixel: usize, [dx, dy]: [isize; 2]) -> [f64; 3] {
    let [x, y] = patch.in_box(pixel);
    model[patch.at(x - dx, y - dy).unwrap_or(pixel)].map(|v| v * factors[pixel])
}

/// The squared error after a shift, or any number of at least `enough` if the error is at least `enough`.
fn moved_error(patch: &Patch, model: &[[f64; 3]], factors: &[f64], shift: [isize; 2], enough: f64) -> f64 {
    let mut sum = 0.0;
    for (pixel, truth) in patch.truth.iter().enumerate() {
        let value = moved(patch, model, factors, pixel, shift);
        sum += (0..3).map(|c| (truth[c] - value[c]).powi(2)).sum::<f64>();
        if sum >= enough {
            break;
        }
    }
    sum
}

/// Step 5: adds b · (t - G t) to the model, with the b and the Gaussian G that bring it nearest to the truth t. Returns
/// the standard deviation of G, or none if no b above 0 brings the model nearer. G averages over the instance's pixels
/// alone.
fn take_detail(patches: &[Patch], model: &mut Model) -> Option<f64> {
    let mut best: Option<(f64, f64, f64, Model)> = None;
    for sigma in SIGMAS {
        let detail: Model = patches.iter().map(|patch| detail(patch, sigma)).collect();
        let (mut product, mut square) = (0.0, 0.0);
        for ((patch, model), detail) in patches.iter().zip(&*model).zip(&detail) {
            for ((truth, value), detail) in patch.truth.iter().zip(model).zip(detail) {
                for c in 0..3 {
                    product += (truth[c] - value[c]) * detail[c];
                    square += detail[c] * detail[c];
                }
            }
        }
        let gain = if product > 0.0 { product * product / square } else { 0.0 };
        if gain > best.as_ref().map_or(0.0, |(gain, ..)| *gain) {
            best = Some((gain, sigma, product / square, detail));
        }
    }
    let (_, sigma, amount, detail) = best?;
    for (value, detail) in model.iter_mut().flatten().zip(detail.iter().flatten()) {
        *value = std::array::from_fn(|c| value[c] + amount * detail[c]);
    }
    Some(sigma)
}

/// The truth minus the blurred truth.
fn detail(patch: &Patch, sigma: f64) -> Vec<[f64; 3]> {
    let smooth = blurred(patch, sigma);
    patch.truth.iter().zip(smooth).map(|(t, s)| std::array::from_fn(|c| t[c] - s[c])).collect()
}

/// The truth blurred by a Gaussian over the instance's pixels alone, cut off at three standard deviations.
pub(super) fn blurred(patch: &Patch, sigma: f64) -> Vec<[f64; 3]> {
    let radius = (3.0 * sigma) as isize;
    let weights: Vec<f64> =
        (-radius..=radius).map(|d| libm::exp(-0.5 * (d as f64 / sigma) * (d as f64 / sigma))).collect();
    let [width, height] = patch.size;
    // Red, green and blue by weight, and the weight; nothing outside the instance.
    let mut values = vec![[0.0; 4]; width * height];
    for (pixel, [r, g, b]) in patch.truth.iter().enumerate() {
        let [x, y] = patch.in_box(pixel);
        values[y as usize * width + x as usize] = [*r, *g, *b, 1.0];
    }
    for (step, length) in [(1, width), (width, height)] {
        values = along(&values, step, length, &weights);
    }
    let value = |pixel: usize| {
        let [x, y] = patch.in_box(pixel);
        let [r, g, b, weight] = values[y as usize * width + x as usize];
        [r, g, b].map(|v| v / weight)
    };
    (0..patch.places.len()).map(value).collect()
}

/// Weighted sums along one axis, whose neighbours are `step` apart and which is `length` long.
fn along(values: &[[f64; 4]], step: usize, length: usize, weights: &[f64]) -> Vec<[f64; 4]> {
    let radius = weights.len() / 2;
    let sum = |at: usize| {
        let place = at / step % length;
        let mut sum = [0.0; 4];
        for other in place.saturating_sub(radius)..=(place + radius).min(length - 1) {
            let weight = weights[other + radius - place];
            let value = values[at - place * step + other * step];
            (0..4).for_each(|c| sum[c] += weight * value[c]);
        }
        sum
    };
    (0..values.len()).map(sum).collect()
}
