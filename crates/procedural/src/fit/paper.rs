//! The fit of graphs as PSDR-Room does it (Yan et al. 2023): a grid of turns and sizes, then gradient descent. It is
//! here to be compared with.
//!
//! Like PSDR-Room's: turns of -45, 0, 45 and 90 degrees, eight scales over a range of 16, one phase; the best place of
//! the grid, and only it, is improved by 201 steps of Adam at a rate of 0.005; the loss adds a mean of absolute
//! differences (weight 1), that of mean colours (10) and that of textures (0.1).
//!
//! Unlike it: colours at points of a part are compared, with the light that is left, in place of rendered pixels, so
//! that neither light nor roughness is fitted. The textures' loss is the mean difference of the logarithms of structure
//! functions at nine distances and six directions, in place of Gram matrices of VGG-19. The loss also has the
//! difference of variances, as PhotoScene's. All 28 graphs of our library are tried, in place of the ones that CLIP
//! retrieves from 118 Substance graphs. Sizes are a quarter to four times the defaults in metres, in place of 0.5 to 8
//! times a unit of texture coordinates. Rotations are in radians, lengths and sizes as logarithms, shifts in metres,
//! and colours and shares as they are; all have the one rate.

use super::candidate::Candidate;
use super::choose::{Fit, Fitter};
use super::model::{Model, Role, role};
use super::statistics::Pairs;
use super::{Point, median, sound, split};
use crate::error::ProceduralError;
use crate::graph::Settings;
use crate::program::op::sign;

const TURNS: [f64; 4] = [-45.0, 0.0, 45.0, 90.0];
const SCALES: u32 = 8;
const STEPS: i32 = 201;
const RATE: f64 = 0.005;
const MEAN_WEIGHT: f64 = 10.0;
const TEXTURE_WEIGHT: f64 = 0.1;

/// Keeps logarithms of structure functions finite.
const LEAST_SQUARE: f64 = 1e-5;

/// Fits the graphs to points, of which unsound ones are left out: the best graph by the grid, after gradient descent,
/// and the others as the grid left them. Fails where no point is sound.
pub fn fit_as_paper(fitter: &Fitter, points: &[Point]) -> Result<Fit, ProceduralError> {
    let sound = sound(points)?;
    let (seen, held_out) = split(&sound);
    let (seen, judged) = if seen.is_empty() || held_out.is_empty() { (sound.clone(), sound) } else { (seen, held_out) };
    let loss = Loss::new(&seen);
    let mut all: Vec<(f64, &Model, Settings)> = fitter
        .models()
        .filter_map(|model| loss.best_of_grid(model).map(|(found, start)| (found, model, start)))
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut candidates = all.into_iter().enumerate().map(|(place, (_, model, start))| {
        let settings = if place == 0 { loss.descended(model, start) } else { start };
        Candidate::judged(model, settings, &judged)
    });
    let chosen = candidates.next().expect("every library has graphs");
    Ok(Fit { chosen, others: candidates.collect::<Vec<Candidate>>() })
}

/// What is seen, as the loss compares it.
struct Loss {
    pairs: Pairs,
    mean: [f64; 3],
    variance: [f64; 3],
    logs: Vec<f64>,
}

impl Loss {
    fn new(points: &[Point]) -> Self {
        let pairs = Pairs::new(points);
        let colors: Vec<[f64; 3]> = pairs.points.iter().map(|point| point.albedo).collect();
        let [mean, variance] = moments(&colors);
        Self { logs: logs(&pairs, &colors), pairs, mean, variance }
    }

    /// The least loss over turns and scales, and its settings.
    fn best_of_grid(&self, model: &Model) -> Option<(f64, Settings)> {
        let mut best: Option<(f64, Settings)> = None;
        for turn in TURNS {
            for scale in 0..SCALES {
                let factor = libm::exp2(4.0 * f64::from(scale) / f64::from(SCALES - 1) - 2.0);
                let settings = self.scaled(model, turn, factor);
                let loss = self.value(&self.colors(model, &settings));
                if loss.is_finite() && best.as_ref().is_none_or(|(least, _)| loss < *least) {
                    best = Some((loss, settings));
                }
            }
        }
        best
    }

    /// The defaults, turned and scaled, with the median colour of what is seen.
    fn scaled(&self, model: &Model, turn: f64, factor: f64) -> Settings {
        let mut settings = Settings::defaults(&model.graph);
        model.set(&mut settings, "theta", turn);
        for at in model.shape.iter().copied().chain(model.of_role(Role::RandomSize)).filter(|at| model.is_length(*at)) {
            if role(&model.graph, model.slots[at].parameter) != Role::Shift {
                let number = settings.number_mut(at);
                *number = model.slots[at].clamped(*number * factor);
            }
        }
        let shown = self.colors(model, &settings);
        for channel in 0..3 {
            let own = median(shown.iter().map(|color| color[channel]).collect());
            let seen = median(self.pairs.points.iter().map(|point| point.albedo[channel]).collect());
            for first in &model.colors {
                let number = settings.number_mut(first + channel);
                *number = (*number * seen / own.max(1e-6)).clamp(0.01, 0.95);
            }
        }
        settings
    }

    fn colors(&self, model: &Model, settings: &Settings) -> Vec<[f64; 3]> {
        model.shown(settings, &self.pairs.points).iter().map(|point| point.albedo).collect()
    }

    fn value(&self, colors: &[[f64; 3]]) -> f64 {
        let count = colors.len() as f64;
        let apart =
            |(point, color): (&Point, &[f64; 3])| (0..3).map(|c| (point.albedo[c] - color[c]).abs()).sum::<f64>();
        let pixels = self.pairs.points.iter().zip(colors).map(apart).sum::<f64>() / (3.0 * count);
        let [mean, variance] = moments(colors);
        let difference = |a: [f64; 3], b: [f64; 3]| (0..3).map(|c| (a[c] - b[c]).abs()).sum::<f64>() / 3.0;
        let own = logs(&self.pairs, colors);
        let textures = own.iter().zip(&self.logs).map(|(a, b)| (a - b).abs()).sum::<f64>() / own.len() as f64;
        pixels
            + MEAN_WEIGHT * difference(mean, self.mean)
            + difference(variance, self.variance)
            + TEXTURE_WEIGHT * textures
    }

    /// The derivative of the loss in each channel of each point's colour.
    fn slopes(&self, colors: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let count = colors.len() as f64;
        let [mean, variance] = moments(colors);
        let mut slopes: Vec<[f64; 3]> = colors
            .iter()
            .zip(&self.pairs.points)
            .map(|(color, point)| {
                std::array::from_fn(|c| {
                    let of_pixels = sign(color[c] - point.albedo[c]);
                    let of_mean = MEAN_WEIGHT * sign(mean[c] - self.mean[c]);
                    let of_variance = 2.0 * sign(variance[c] - self.variance[c]) * (color[c] - mean[c]);
                    (of_pixels + of_mean + of_variance) / (3.0 * count)
                })
            })
            .collect();
        let own = logs(&self.pairs, colors);
        for ((bin, own), seen) in
            self.pairs.bins.iter().zip(&own).zip(&self.logs).filter(|((bin, _), _)| !bin.is_empty())
        {
            let outer =
                TEXTURE_WEIGHT * sign(own - seen) / (self.logs.len() as f64 * libm::exp(*own) * bin.len() as f64);
            for &[a, b] in bin {
                let inner = 2.0 * outer * (grey(&colors[a]) - grey(&colors[b])) / 3.0;
                slopes[a].iter_mut().for_each(|slope| *slope += inner);
                slopes[b].iter_mut().for_each(|slope| *slope -= inner);
            }
        }
        slopes
    }

    /// Adam (Kingma and Ba 2015) from a start; the settings with the least loss on the way.
    fn descended(&self, model: &Model, start: Settings) -> Settings {
        let colors = model.colors.iter().flat_map(|first| (0..3).map(move |channel| first + channel));
        let random = [Role::RandomSize, Role::Amplitude].into_iter().flat_map(|role| model.of_role(role));
        let chosen: Vec<usize> = model.shape.iter().copied().chain(colors).chain(random).collect();
        let mut moments = vec![[0.0, 0.0]; chosen.len()];
        let (mut settings, mut best) = (start.clone(), (f64::INFINITY, start));
        for step in 1..=STEPS {
            let colors = self.colors(model, &settings);
            let loss = self.value(&colors);
            if loss < best.0 {
                best = (loss, settings.clone());
            }
            let mut gradient = vec![0.0; chosen.len()];
            let outer = self.slopes(&colors);
            let mut at = 0;
            model.visit(&settings, &chosen, &self.pairs.points, |_, channel, _, slopes| {
                gradient.iter_mut().zip(slopes).for_each(|(sum, slope)| *sum += outer[at / 3][channel] * slope);
                at += 1;
            });
            for ((&slot, gradient), [first, second]) in chosen.iter().zip(gradient).zip(&mut moments) {
                let unit = unit(model, slot, settings.numbers()[slot]);
                let slope = gradient * unit;
                *first = 0.9 * *first + 0.1 * slope;
                *second = 0.999 * *second + 0.001 * slope * slope;
                let [a, b] = [*first / (1.0 - 0.9_f64.powi(step)), *second / (1.0 - 0.999_f64.powi(step))];
                let number = settings.number_mut(slot);
                *number = model.slots[slot].clamped(*number - RATE * unit * a / (b.sqrt() + 1e-8));
            }
        }
        best.1
    }
}

/// What a parameter changes by where its scaled value changes by 1: degrees of a radian, and lengths themselves.
fn unit(model: &Model, slot: usize, number: f64) -> f64 {
    match role(&model.graph, model.slots[slot].parameter) {
        Role::Turn => 1_f64.to_degrees(),
        Role::RandomSize => number.abs().max(1e-6),
        Role::Shape if model.is_length(slot) => number.abs().max(1e-6),
        _ => 1.0,
    }
}

fn grey(color: &[f64; 3]) -> f64 {
    color.iter().sum::<f64>() / 3.0
}

/// The mean and the variance of each channel.
fn moments(colors: &[[f64; 3]]) -> [[f64; 3]; 2] {
    let count = colors.len().max(1) as f64;
    let mean: [f64; 3] = std::array::from_fn(|c| colors.iter().map(|color| color[c]).sum::<f64>() / count);
    let variance =
        std::array::from_fn(|c| colors.iter().map(|color| (color[c] - mean[c]).powi(2)).sum::<f64>() / count);
    [mean, variance]
}

/// The logarithms of structure functions.
fn logs(pairs: &Pairs, colors: &[[f64; 3]]) -> Vec<f64> {
    let square = |&[a, b]: &[usize; 2]| (grey(&colors[a]) - grey(&colors[b])).powi(2);
    let mean = |bin: &Vec<[usize; 2]>| bin.iter().map(square).sum::<f64>() / bin.len().max(1) as f64;
    pairs.bins.iter().map(|bin| libm::log(mean(bin) + LEAST_SQUARE)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::cell;

    /// The slopes of the loss are those of central differences.
    #[test]
    fn slopes_are_the_derivatives_of_the_loss() {
        let random = |i: u32, of: f64| cell(f64::from(i) + 0.5, of);
        let point = |i: u32| Point {
            u: random(i, 1.5),
            v: random(i, 2.5),
            footprint: 0.01,
            albedo: [0.3 + 0.2 * random(i, 3.5), 0.4, 0.3 + 0.3 * random(i, 4.5)],
            weight: 1.0,
        };
        let points: Vec<Point> = (0..400).map(point).collect();
        let loss = Loss::new(&points);
        let colors: Vec<[f64; 3]> = (0..loss.pairs.points.len() as u32)
            .map(|i| [0.2 + 0.5 * random(i, 8.5), 0.3, 0.5 * random(i, 9.5)])
            .collect();
        let slopes = loss.slopes(&colors);
        for (at, channel) in [(0, 0), (7, 1), (31, 2), (100, 0)] {
            let moved = |by: f64| {
                let mut moved = colors.clone();
                moved[at][channel] += by;
                loss.value(&moved)
            };
            let expected = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((slopes[at][channel] / expected - 1.0).abs() < 1e-3, "{} {expected}", slopes[at][channel]);
        }
    }
}
