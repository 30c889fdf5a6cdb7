//! The radiances of lights and the colours of parts that explain a photo together.
//!
//! In: a photo, the part that each pixel shows, and the photo's light split by lights ([`SplitLight`]). Out: a radiance
//! for each light and a base colour for each part, by channel. With radiances x, colours a, and sums over lights and
//! over what the photo itself lights (D, G), each square of pixels of one part should hold I = a D(x) + G(x). The fit
//! minimises
//!
//! sum of w rho(log(I - G) - log D - log a) + k_a sum (log a - log a_0)^2 + k_x sum (log x - log x_0 - their mean)^2
//! + k_s sum (log x - log x_s)^2
//!
//! with rho(r) = 2 s^2 (sqrt(1 + (r / s)^2) - 1), which is nearly |r| for large r. The weights w are shares of the
//! photo, times a number that does not depend on its size. Lights that the photo shows have the radiance x_s that it
//! shows; the third sum is over the others. The mean of the channels is fitted first, towards equal radiances x_0; then
//! each channel, towards the radiances of that fit, since lamps of one room differ less in colour than in radiance.
//! Light that the photo holds does not scale with x, so that it fixes the scale, as lights that are shown do; where
//! there is too little of both, the usual colour a_0 does. Solved by Levenberg and Marquardt's method with reweighted
//! rows.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_tracer::{LightBasis, SplitLight};

use crate::ridge_fit::{back_substitute, cholesky, dot};

/// How light and colour are separated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointFitRules {
    /// The weight k_a of the usual colour.
    pub color_prior: f64,
    /// The usual base colour a_0, linear.
    pub usual_color: f64,
    /// The weight k_x of equal radiances in the mean of the channels.
    pub light_prior: f64,
    /// The weight k_x of lights of one colour.
    pub light_color_prior: f64,
}

impl Default for JointFitRules {
    fn default() -> Self {
        Self { color_prior: 0.01, usual_color: 0.45, light_prior: 0.1, light_color_prior: 10.0 }
    }
}

/// Side of the squares of pixels whose averages are compared.
const POOL: usize = 8;
/// The residual s, in powers of e, at which a square begins to count as an outlier.
const SOFTNESS: f64 = 0.2;
/// The number of squares that a photo counts as: more pixels are no more evidence about what the model leaves out.
const EVIDENCE: f64 = 400.0;
/// The weight k_s of the radiance that the photo shows of a light.
const SHOWN_PRIOR: f64 = 50.0;
/// The largest number of steps.
const STEPS: u32 = 40;
/// The least light I - G of a square, as a share of I.
const LEAST_DIFFUSE: f64 = 0.05;
/// The least radiance of a channel that is shown, as a share of the brightest one.
const DARK: f64 = 1e-3;
/// Damping at which no step is worth trying.
const MOST_DAMPING: f64 = 1e9;
/// The gain, as a share of the objective, below which the fit has ended.
const LEAST_GAIN: f64 = 1e-7;

/// What is fitted to. All pictures have one size.
#[derive(Clone, Copy, Debug)]
pub struct JointTarget<'a> {
    /// Linear, before exposure.
    pub photo: &'a Picture<LinearRgb>,
    /// The pixels that count.
    pub valid: &'a Mask,
    /// The part that each pixel shows.
    pub parts: &'a Picture<u16>,
    /// The lights' pictures, and the photo's own as the last one; independent renders of them, which are averaged.
    pub light: &'a [SplitLight],
    /// For each light the radiance that the photo shows of it, as a factor of the one it has in `light`.
    pub shown: &'a [Option<[f64; 3]>],
}

/// Radiances and colours, linear, all above 0.
#[derive(Clone, Debug, PartialEq)]
pub struct JointFit {
    /// For each light the factor of its radiance, by channel.
    pub radiances: Vec<[f64; 3]>,
    /// The base colour of each part that the photo shows, by channel; it may exceed 1.
    pub colors: BTreeMap<u16, [f64; 3]>,
}

/// Fits radiances and colours, starting from radiances that are as shown, else equal. Squares without light are
/// ignored; if no square has light, no part has a colour.
pub fn fit_jointly(rules: &JointFitRules, target: &JointTarget<'_>) -> JointFit {
    let lights = target.light.first().map_or(0, |light| light.diffuse.pictures().len() - 1);
    let (parts, all) = rows(target, |pixel| pixel.0.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0);
    // The logarithm of what is shown, of a channel or of their mean.
    let shown = |value: &dyn Fn([f64; 3]) -> f64| -> Vec<Option<f64>> {
        // A black background may be a sky that the camera does not see; a black channel of a lamp is one.
        let log = |radiance: [f64; 3]| {
            let brightest = radiance.into_iter().fold(0.0, f64::max);
            Some(value(radiance).max(DARK * brightest)).filter(|v| *v > 0.0 && v.is_finite()).map(libm::log)
        };
        (0..lights).map(|light| target.shown.get(light).copied().flatten().and_then(log)).collect()
    };
    let (centre, shown_grey) = (vec![0.0; lights], shown(&|rgb| rgb.iter().sum::<f64>() / 3.0));
    let light_prior = rules.light_prior;
    let grey = Problem { rules, centre, light_prior, shown: shown_grey, parts: parts.len(), rows: all }.solve();
    let fits = [0, 1, 2].map(|channel| {
        let (parts, rows) = rows(target, |pixel| f64::from(pixel.0[channel]));
        let (centre, light_prior) = (grey[..lights].to_vec(), rules.light_color_prior);
        let shown = shown(&|rgb| rgb[channel]);
        let problem = Problem { rules, centre, light_prior, shown, parts: parts.len(), rows };
        (parts, problem.solve())
    });
    let radiances = (0..lights).map(|light| [0, 1, 2].map(|channel| libm::exp(fits[channel].1[light]))).collect();
    // A part has a colour where every channel has one.
    let place = |channel: usize, part| fits[channel].0.binary_search(&part).ok();
    let color = |part: u16| {
        let log = |channel: usize| place(channel, part).map(|at| libm::exp(fits[channel].1[lights + at]));
        Some((part, [log(0)?, log(1)?, log(2)?]))
    };
    let colors = fits[0].0.iter().filter_map(|part| color(*part)).collect();
    JointFit { radiances, colors }
}

/// The pixels of one part in one square.
struct Row {
    /// The place of the part among those that occur.
    part: usize,
    /// The share of all valid pixels that they are, times [`EVIDENCE`].
    weight: f64,
    /// Means of the photo, and of the pictures of each light and of the photo's own light.
    photo: f64,
    diffuse: Vec<f64>,
    gloss: Vec<f64>,
}

/// The parts in order, and the rows.
fn rows(target: &JointTarget<'_>, value: impl Fn(&LinearRgb) -> f64) -> (Vec<u16>, Vec<Row>) {
    let (width, height) = (target.photo.width(), target.photo.height());
    let columns = width.div_ceil(POOL);
    let mut pixels: BTreeMap<(usize, u16), Vec<usize>> = BTreeMap::new();
    for k in (0..width * height).filter(|&k| target.valid.pixels()[k]) {
        let square = k / width / POOL * columns + k % width / POOL;
        pixels.entry((square, target.parts.pixels()[k])).or_default().push(k);
    }
    let mean = |picture: &Picture<LinearRgb>, of: &[usize]| {
        of.iter().map(|&k| value(&picture.pixels()[k])).sum::<f64>() / of.len() as f64
    };
    let valid: usize = pixels.values().map(Vec::len).sum();
    let mut found = Vec::new();
    for ((_, part), of) in pixels {
        let photo = mean(target.photo, &of);
        let means = |basis: fn(&SplitLight) -> &LightBasis| -> Vec<f64> {
            let count = target.light.first().map_or(0, |light| basis(light).pictures().len());
            let sum = |k: usize| target.light.iter().map(|light| mean(&basis(light).pictures()[k], &of)).sum::<f64>();
            (0..count).map(|k| sum(k) / target.light.len() as f64).collect()
        };
        let (diffuse, gloss) = (means(|light| &light.diffuse), means(|light| &light.gloss));
        if photo > 0.0 && diffuse.iter().sum::<f64>() > 0.0 {
            found.push((part, photo, of.len(), diffuse, gloss));
        }
    }
    let mut parts: Vec<u16> = found.iter().map(|row| row.0).collect();
    parts.sort_unstable();
    parts.dedup();
    let row = |(part, photo, count, diffuse, gloss): (u16, f64, usize, Vec<f64>, Vec<f64>)| Row {
        part: parts.partition_point(|other| *other < part),
        weight: count as f64 / valid as f64 * EVIDENCE,
        photo,
        diffuse,
        gloss,
    };
    let rows = found.into_iter().map(row).collect();
    (parts, rows)
}

/// The fit of one channel. Unknowns are the logarithms of all radiances, then of all colours.
struct Problem<'a> {
    rules: &'a JointFitRules,
    /// The logarithm of x_0, up to a constant.
    centre: Vec<f64>,
    light_prior: f64,
    /// The logarithm of the radiances that the photo shows.
    shown: Vec<Option<f64>>,
    parts: usize,
    rows: Vec<Row>,
}

impl Problem<'_> {
    fn solve(&self) -> Vec<f64> {
        let mut at = self.start();
        let mut objective = self.objective(&at);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let equations = self.normal_equations(&at);
            let mut gained = 0.0;
            while damping < MOST_DAMPING {
                if let Some(step) = equations.step(damping) {
                    let next: Vec<f64> = at.iter().zip(&step).map(|(a, s)| a + s.clamp(-2.0, 2.0)).collect();
                    let found = self.objective(&next);
                    if found < objective {
                        gained = objective - found;
                        (at, objective) = (next, found);
                        damping = (damping * 0.2).max(1e-9);
                        break;
                    }
                }
                damping *= 5.0;
            }
            if gained <= LEAST_GAIN * objective {
                break;
            }
        }
        at
    }

    /// Radiances as they are shown, else in the proportions of x_0, with which the mean of the photo is explained by
    /// the usual colour; all colours usual.
    fn start(&self) -> Vec<f64> {
        let lights = self.centre.len();
        let mean = self.mean_of_unseen(&self.centre);
        let mut at: Vec<f64> = (0..lights).map(|k| self.shown[k].unwrap_or(self.centre[k] - mean)).collect();
        let (mut unseen, mut rest) = (0.0, 0.0);
        for row in &self.rows {
            let explained = |k: usize| row.weight * (self.rules.usual_color * row.diffuse[k] + row.gloss[k]);
            rest += row.weight * row.photo - explained(lights);
            for (k, log) in at.iter().enumerate() {
                let light = libm::exp(*log) * explained(k);
                if self.shown[k].is_some() {
                    rest -= light;
                } else {
                    unseen += light;
                }
            }
        }
        // Where the photo seems to light itself by more than it holds, lights begin at a small share.
        let photo: f64 = self.rows.iter().map(|row| row.weight * row.photo).sum();
        let factor = if unseen > 0.0 { rest.max(0.05 * photo) / unseen } else { 1.0 };
        for k in (0..lights).filter(|&k| self.shown[k].is_none()) {
            at[k] += libm::log(factor);
        }
        at.extend(vec![libm::log(self.rules.usual_color); self.parts]);
        at
    }

    /// The residual of a row, and its derivatives by the logarithms of radiances.
    fn residual(&self, row: &Row, at: &[f64], radiances: &[f64], slopes: Option<&mut Vec<f64>>) -> f64 {
        let sum = |values: &[f64]| dot(&values[..self.centre.len()], radiances) + values[self.centre.len()];
        let least = LEAST_DIFFUSE * row.photo;
        let shown = row.photo - sum(&row.gloss);
        let (light, diffuse) = (sum(&row.diffuse).max(f64::MIN_POSITIVE), shown.max(least));
        if let Some(slopes) = slopes {
            let gloss = if shown > least { 1.0 / diffuse } else { 0.0 };
            let slope = |k: usize| -radiances[k] * (row.gloss[k] * gloss + row.diffuse[k] / light);
            slopes.clear();
            slopes.extend((0..self.centre.len()).map(slope));
        }
        libm::log(diffuse) - libm::log(light) - at[self.centre.len() + row.part]
    }

    fn objective(&self, at: &[f64]) -> f64 {
        let radiances = self.radiances(at);
        let misfit = self.rows.iter().map(|row| {
            let ratio = self.residual(row, at, &radiances, None) / SOFTNESS;
            row.weight * 2.0 * SOFTNESS * SOFTNESS * ((1.0 + ratio * ratio).sqrt() - 1.0)
        });
        let usual = libm::log(self.rules.usual_color);
        let colors = at[self.centre.len()..].iter().map(|c| (c - usual) * (c - usual)).sum::<f64>();
        let lights = self.light_deviations(at).iter().enumerate().map(|(k, d)| self.prior(k) * d * d).sum::<f64>();
        misfit.sum::<f64>() + self.rules.color_prior * colors + lights
    }

    /// Of the reweighted objective.
    fn normal_equations(&self, at: &[f64]) -> NormalEquations {
        let radiances = self.radiances(at);
        let lights = self.centre.len();
        let mut equations = NormalEquations::zero(lights, self.parts);
        let NormalEquations { lights: matrix, cross, colors, gradient } = &mut equations;
        let mut slopes = Vec::new();
        for row in &self.rows {
            let residual = self.residual(row, at, &radiances, Some(&mut slopes));
            let ratio = residual / SOFTNESS;
            let weight = row.weight / (1.0 + ratio * ratio).sqrt();
            for i in 0..lights {
                let scaled = weight * slopes[i];
                gradient[i] += scaled * residual;
                cross[row.part][i] -= scaled;
                matrix[i].iter_mut().zip(&slopes).for_each(|(value, slope)| *value += scaled * slope);
            }
            gradient[lights + row.part] -= weight * residual;
            colors[row.part] += weight;
        }
        let usual = libm::log(self.rules.usual_color);
        for (part, color) in colors.iter_mut().enumerate() {
            *color += self.rules.color_prior;
            gradient[lights + part] += self.rules.color_prior * (at[lights + part] - usual);
        }
        let deviations = self.light_deviations(at);
        let unseen = self.shown.iter().filter(|shown| shown.is_none()).count() as f64;
        for i in 0..lights {
            gradient[i] += self.prior(i) * deviations[i];
            matrix[i][i] += self.prior(i);
            if self.shown[i].is_none() {
                for j in (0..=i).filter(|&j| self.shown[j].is_none()) {
                    matrix[i][j] -= self.light_prior / unseen;
                }
            }
        }
        equations
    }

    fn radiances(&self, at: &[f64]) -> Vec<f64> {
        at[..self.centre.len()].iter().map(|u| libm::exp(*u)).collect()
    }

    /// The weight of a light's deviation.
    fn prior(&self, light: usize) -> f64 {
        if self.shown[light].is_some() { SHOWN_PRIOR } else { self.light_prior }
    }

    /// What the priors of radiances see: how far they are from what is shown, or from x_0 up to a common factor.
    fn light_deviations(&self, at: &[f64]) -> Vec<f64> {
        let deviations: Vec<f64> = at.iter().zip(&self.centre).map(|(u, centre)| u - centre).collect();
        let mean = self.mean_of_unseen(&deviations);
        let deviation = |k: usize| self.shown[k].map_or(deviations[k] - mean, |shown| at[k] - shown);
        (0..deviations.len()).map(deviation).collect()
    }

    /// The mean over lights that the photo does not show.
    fn mean_of_unseen(&self, values: &[f64]) -> f64 {
        let unseen = values.iter().zip(&self.shown).filter(|(_, shown)| shown.is_none());
        let (sum, count) = unseen.fold((0.0, 0.0), |(sum, count), (value, _)| (sum + value, count + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    }
}

/// Half the Hessian and half the gradient of the objective.
struct NormalEquations {
    /// Between lights: the lower triangle.
    lights: Vec<Vec<f64>>,
    /// For each colour its entries with all lights.
    cross: Vec<Vec<f64>>,
    /// The diagonal of the colours.
    colors: Vec<f64>,
    /// Of the lights, then of the colours.
    gradient: Vec<f64>,
}

impl NormalEquations {
    fn zero(lights: usize, colors: usize) -> Self {
        Self {
            lights: (0..lights).map(|i| vec![0.0; i + 1]).collect(),
            cross: vec![vec![0.0; lights]; colors],
            colors: vec![0.0; colors],
            gradient: vec![0.0; lights + colors],
        }
    }

    /// The step that solves the equations with the diagonal raised by a share of itself; none if they are singular.
    fn step(&self, damping: f64) -> Option<Vec<f64>> {
        let damped = |value: f64| value + damping * (value + 1e-9);
        let (light_gradient, color_gradient) = self.gradient.split_at(self.lights.len());
        let mut matrix = self.lights.clone();
        for (i, row) in matrix.iter_mut().enumerate() {
            row[i] = damped(row[i]);
        }
        let mut right: Vec<f64> = light_gradient.iter().map(|g| -g).collect();
        for ((cross, color), gradient) in self.cross.iter().zip(&self.colors).zip(color_gradient) {
            let color = damped(*color);
            for (i, row) in matrix.iter_mut().enumerate() {
                let factor = cross[i] / color;
                right[i] += factor * gradient;
                row.iter_mut().zip(cross).for_each(|(value, other)| *value -= factor * other);
            }
        }
        let mut step = back_substitute(&cholesky(matrix)?, right);
        let colors: Vec<f64> = { self.cross.iter().zip(&self.colors).zip(color_gradient) }
            .map(|((cross, color), gradient)| (-gradient - dot(cross, &step)) / damped(*color))
            .collect();
        step.extend(colors);
        Some(step)
    }
}

/// Three lights over four parts, of which everything is known.
#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [64, 48];
    const RADIANCES: [[f64; 3]; 3] = [[2.0, 1.8, 1.5], [0.5, 0.5, 0.4], [6.0, 5.0, 4.0]];
    const COLORS: [[f64; 3]; 4] = [[0.8, 0.7, 0.6], [0.3, 0.5, 0.2], [0.1, 0.1, 0.1], [0.5, 0.2, 0.6]];

    fn grey(value: impl Fn(f64, f64) -> f64) -> Picture<LinearRgb> {
        let [width, height] = SIZE;
        Picture::from_fn(width, height, |x, y| {
            LinearRgb([value((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64) as f32; 3])
        })
    }

    /// Lights near three places, and light that the photo holds, which grows to the right.
    fn split() -> SplitLight {
        let near = |at: [f64; 2]| grey(move |x, y| 0.3 / (0.1 + (x - at[0]).powi(2) + (y - at[1]).powi(2)));
        let diffuse = vec![near([0.1, 0.2]), near([0.9, 0.3]), near([0.5, 0.9]), grey(|x, _| 0.3 + 0.8 * x)];
        let gloss =
            diffuse.iter().map(|picture| picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| 0.04 * v)))).collect();
        let basis = |pictures| LightBasis::new(SIZE[0], SIZE[1], pictures).unwrap();
        SplitLight { diffuse: basis(diffuse), gloss: basis(gloss) }
    }

    /// Quarters of the picture.
    fn parts() -> Picture<u16> {
        Picture::from_fn(SIZE[0], SIZE[1], |x, y| u16::from(x >= SIZE[0] / 2) + 2 * u16::from(y >= SIZE[1] / 2))
    }

    fn photo(split: &SplitLight) -> Picture<LinearRgb> {
        let weights: Vec<[f64; 3]> = RADIANCES.into_iter().chain([[1.0; 3]]).collect();
        let [diffuse, gloss] = [&split.diffuse, &split.gloss].map(|basis| basis.weighted(&weights).unwrap());
        let parts = parts();
        Picture::from_fn(SIZE[0], SIZE[1], |x, y| {
            let color = COLORS[usize::from(parts.get(x, y))];
            LinearRgb([0, 1, 2].map(|c| color[c] as f32 * diffuse.get(x, y).0[c] + gloss.get(x, y).0[c]))
        })
    }

    /// Priors too weak to move exact data.
    fn rules() -> JointFitRules {
        JointFitRules { color_prior: 1e-5, light_prior: 1e-5, light_color_prior: 1e-5, ..Default::default() }
    }

    fn fitted(photo: &Picture<LinearRgb>, shown: &[Option<[f64; 3]>]) -> JointFit {
        fitted_under(&rules(), photo, shown)
    }

    fn fitted_under(rules: &JointFitRules, photo: &Picture<LinearRgb>, shown: &[Option<[f64; 3]>]) -> JointFit {
        let (light, valid, parts) = ([split()], photo.map(|_| true), parts());
        fit_jointly(rules, &JointTarget { photo, valid: &valid, parts: &parts, light: &light, shown })
    }

    /// The largest error of radiances and of colours, as shares.
    fn errors(fit: &JointFit) -> [f64; 2] {
        let largest = |pairs: Vec<(f64, f64)>| pairs.iter().map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
        let flat = |values: &[[f64; 3]]| values.iter().flatten().copied().collect::<Vec<_>>();
        let colors: Vec<[f64; 3]> = fit.colors.values().copied().collect();
        let pairs = |found: &[[f64; 3]], truth: &[[f64; 3]]| flat(found).into_iter().zip(flat(truth)).collect();
        [largest(pairs(&fit.radiances, &RADIANCES)), largest(pairs(&colors, &COLORS))]
    }

    /// The scale of exact data is that of the light which the photo holds, whatever colours are usual.
    #[test]
    fn radiances_and_colours_are_separated() {
        let fit = fitted(&photo(&split()), &[]);
        let [radiances, colors] = errors(&fit);
        assert!(radiances < 1e-3 && colors < 1e-3, "{radiances} {colors}");
    }

    /// Squares here and there, an eighth of the picture, that are five times as bright as all lights explain.
    #[test]
    fn outliers_count_little() {
        let plain = photo(&split());
        let photo = Picture::from_fn(SIZE[0], SIZE[1], |x, y| {
            let factor = if (x / 8 + 3 * (y / 8)) % 8 == 0 { 5.0 } else { 1.0 };
            LinearRgb(plain.get(x, y).0.map(|v| factor * v))
        });
        // The usual colour holds the scale, to which the outliers' light would be a hint.
        let rules = JointFitRules { color_prior: 1.0, ..rules() };
        let [before, after] = [&plain, &photo].map(|photo| fitted_under(&rules, photo, &[]).colors);
        for (part, color) in &before {
            let ratios = [0, 1, 2].map(|c| after[part][c] / color[c]);
            assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.3), "part {part}: {ratios:?}");
        }
    }

    /// What the photo shows of a light counts, even where it is wrong.
    #[test]
    fn a_shown_radiance_is_kept() {
        let shown = [None, Some([1.0; 3]), None];
        let fit = fitted(&photo(&split()), &shown);
        assert!(fit.radiances[1].iter().all(|v| (v - 1.0).abs() < 0.05), "{:?}", fit.radiances);
    }

    /// Nothing to fit, and lights that light nothing: finite radiances, and no colour where nothing is lit.
    #[test]
    fn a_black_photo_and_dark_lights_have_finite_radiances() {
        let black = photo(&split()).map(|_| LinearRgb::default());
        let fit = fitted(&black, &[]);
        assert!(fit.radiances.iter().flatten().all(|v| v.is_finite() && *v > 0.0) && fit.colors.is_empty());

        let dark = LightBasis::new(SIZE[0], SIZE[1], vec![grey(|_, _| 0.0); 4]).unwrap();
        let light = [SplitLight { diffuse: dark.clone(), gloss: dark }];
        let (photo, parts) = (photo(&split()), parts());
        let valid = photo.map(|_| true);
        let target = JointTarget { photo: &photo, valid: &valid, parts: &parts, light: &light, shown: &[] };
        let fit = fit_jointly(&JointFitRules::default(), &target);
        assert!(fit.radiances.iter().flatten().all(|v| v.is_finite()) && fit.colors.is_empty());
    }

    /// The equations hold for the step, without damping.
    #[test]
    fn the_step_solves_the_equations() {
        let equations = NormalEquations {
            lights: vec![vec![5.0], vec![1.0, 4.0]],
            cross: vec![vec![1.0, 0.5], vec![-0.3, 0.7], vec![0.2, 0.0]],
            colors: vec![2.0, 3.0, 1.5],
            gradient: vec![1.0, -2.0, 0.5, 0.25, -1.0],
        };
        let step = equations.step(0.0).unwrap();
        let [a, b] = [step[0], step[1]];
        let light = |row: usize, own: f64| own + (0..3).map(|c| equations.cross[c][row] * step[2 + c]).sum::<f64>();
        let mut sums = vec![light(0, 5.0 * a + b), light(1, a + 4.0 * b)];
        sums.extend((0..3).map(|c| dot(&equations.cross[c], &step[..2]) + equations.colors[c] * step[2 + c]));
        let errors = sums.iter().zip(&equations.gradient).map(|(sum, gradient)| (sum + gradient).abs());
        assert!(errors.fold(0.0, f64::max) < 1e-12, "{sums:?}");
    }
}
