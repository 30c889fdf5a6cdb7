//! The fit of what is random in a graph: sizes, amplitudes and colours whose statistics come closest to those seen.
//!
//! The colours of a texture whose phase is random are those that give it the distribution of the colours seen. Places
//! are matched by their rank of brightness, the brightest with the brightest (optimal transport in one dimension); then
//! colours are a linear least squares problem. Ranks and colours are found in turn.

use super::least_squares::{Normal, RANGE};
use super::model::{Model, Role};
use super::statistics::{COUNT, DIRECTIONS, Target, bounded, spread};
use super::{Point, extent, median};
use crate::graph::Settings;
use crate::library::Class;

/// Shifts in metres at which a graph is compared: what is random there is not the same.
const PHASES: [[f64; 2]; 6] = [[0.0, 0.0], [3.71, -2.13], [-1.37, 5.19], [6.53, 4.31], [-4.19, -1.71], [2.23, 7.07]];

/// Factors of sizes that are tried.
const SIZES: [f64; 8] = [0.125, 0.25, 0.4, 0.63, 1.0, 1.6, 2.5, 5.0];

/// The first step of the search, as a logarithm, and that of the turn in degrees.
const STEP: f64 = 0.35;
const TURN_STEP: f64 = 5.0;

/// The width of the range of directions that are averaged, in degrees.
const KERNEL: f64 = 7.0;

/// How often the search goes through all parameters; each time its steps are half as long.
const SWEEPS: usize = 3;

/// What is seen, as textures are compared with it.
pub(super) struct Sight {
    pub(super) target: Target,
    sorted: Vec<[f64; 3]>,
    /// The direction in which the texture is stretched, in degrees.
    stretched: f64,
    footprint: f64,
    side: f64,
}

/// A graph's settings and how far their statistics are from those seen.
#[derive(Clone, Debug)]
pub(super) struct Texture {
    pub(super) settings: Settings,
    pub(super) distance: f64,
}

/// Whether colours follow from the distribution of what is seen, or stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Colors {
    Ranked,
    Kept,
}

impl Sight {
    pub(super) fn new(points: &[Point]) -> Self {
        let target = Target::new(points);
        let sorted = by_brightness(&target.pairs.points);
        let [width, height] = extent(points);
        Self {
            stretched: stretched(&target),
            footprint: median(points.iter().map(|point| point.footprint).collect()),
            side: width.max(height),
            target,
            sorted,
        }
    }

    /// The distance of settings, whose colours are found first where they are not kept.
    fn texture(&self, model: &Model, mut settings: Settings, colors: Colors) -> Texture {
        let shown = if colors == Colors::Ranked && !model.colors.is_empty() {
            let masks = model.masks(&settings, &self.target.pairs.points);
            recolored(model, &mut settings, &masks, &self.sorted)
        } else {
            self.shown(model, &settings)
        };
        let distance = self.target.distance(&self.target.of(&shown, 0));
        // A user's graph may have values that are not numbers.
        Texture { distance: if distance.is_finite() { distance } else { f64::INFINITY }, settings }
    }

    /// The colours of a graph at the points.
    fn shown(&self, model: &Model, settings: &Settings) -> Vec<[f64; 3]> {
        model.shown(settings, &self.target.pairs.points).iter().map(|point| point.albedo).collect()
    }

    /// The best strength and turn of a graph without a period for each of a few sizes, best first.
    pub(super) fn starts(&self, model: &Model) -> Vec<Texture> {
        let defaults = Settings::defaults(&model.graph);
        let lengths = sizes(model).into_iter();
        let main = lengths.map(|at| defaults.numbers()[at]).min_by(f64::total_cmp);
        let is_shown = |size: f64| size > 0.7 * self.footprint && size < 0.5 * self.side;
        let of_size = |factor: f64| {
            let ways =
                self.turns(model).into_iter().flat_map(|turn| strengths(model).into_iter().map(move |s| (turn, s)));
            ways.map(|(turn, strength)| {
                self.texture(model, scaled(model, &defaults, factor, strength, turn), Colors::Ranked)
            })
            .min_by(|a, b| a.distance.total_cmp(&b.distance))
        };
        let shown = SIZES.into_iter().filter(|factor| main.is_none_or(|main| is_shown(main * factor)));
        let mut all: Vec<Texture> = shown.filter_map(of_size).collect();
        all.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        all
    }

    /// Settings of a periodic graph with half of the default amplitudes.
    pub(super) fn with_amplitudes(&self, model: &Model, mut settings: Settings, colors: Colors) -> Texture {
        for at in model.of_role(Role::Amplitude) {
            *settings.number_mut(at) = 0.5 * model.slots[at].value;
        }
        self.texture(model, settings, colors)
    }

    fn turns(&self, model: &Model) -> Vec<f64> {
        match model.class {
            Some(Class::Isotropic) => vec![0.0],
            _ => vec![self.stretched, self.stretched + 90.0],
        }
    }

    /// Improves the numbers of these roles one by one.
    pub(super) fn searched(&self, model: &Model, start: Texture, roles: &[Role], colors: Colors) -> Texture {
        let searched: Vec<(usize, Role)> =
            roles.iter().flat_map(|role| model.of_role(*role).into_iter().map(move |at| (at, *role))).collect();
        let mut best = start;
        for sweep in 0..SWEEPS {
            let step = STEP * libm::pow(0.5, sweep as f64);
            for &(at, role) in &searched {
                for signed in [step, -step] {
                    let mut settings = best.settings.clone();
                    let number = settings.number_mut(at);
                    let moved = if role == Role::Turn {
                        *number + TURN_STEP * signed / STEP
                    } else {
                        *number * libm::exp(signed)
                    };
                    *number = model.slots[at].clamped(moved);
                    let tried = self.texture(model, settings, colors);
                    if tried.distance < best.distance {
                        best = tried;
                        break;
                    }
                }
            }
        }
        best
    }

    /// How likely what is seen is among the statistics that a graph has at several places, which are taken as normal
    /// and independent (synthetic likelihood; Wood 2010): twice the negative logarithm for each statistic.
    pub(super) fn judged(&self, model: &Model, settings: &Settings) -> f64 {
        let at_phase = |number: usize| {
            let [u, v] = PHASES[number];
            let moved = [("t_u", u), ("t_v", v)].map(|(name, add)| (name, model.number(settings, name) + add));
            let shifted = model.with(settings, &moved);
            self.target.of(&self.shown(model, &shifted), number + 1).numbers
        };
        let all: Vec<[f64; COUNT]> = (0..PHASES.len()).map(at_phase).collect();
        let count = PHASES.len() as f64;
        let term = |at: usize| {
            let mean = all.iter().map(|numbers| numbers[at]).sum::<f64>() / count;
            let variance = all.iter().map(|numbers| (numbers[at] - mean).powi(2)).sum::<f64>() / (count - 1.0);
            // The few places know the variance poorly: it is drawn to what is expected.
            let expected = 0.25 * spread(at) * spread(at);
            let deviation = (0.7 * variance + 0.55 * expected).sqrt();
            bounded((self.target.seen.numbers[at] - mean) / deviation) + 2.0 * libm::log(deviation / spread(at))
        };
        (0..COUNT).map(term).sum::<f64>() / COUNT as f64
    }
}

/// The lengths that the texture scales by: of a user's graph, all.
fn sizes(model: &Model) -> Vec<usize> {
    let shape = if model.class.is_none() { model.of_role(Role::Shape) } else { Vec::new() };
    model.of_role(Role::RandomSize).into_iter().chain(shape).filter(|at| model.is_length(*at)).collect()
}

/// Sizes times a factor and amplitudes times a strength.
fn scaled(model: &Model, defaults: &Settings, factor: f64, strength: f64, turn: f64) -> Settings {
    let mut settings = defaults.clone();
    for at in sizes(model) {
        let number = settings.number_mut(at);
        *number = model.slots[at].clamped(*number * factor);
    }
    for at in model.of_role(Role::Amplitude) {
        let number = settings.number_mut(at);
        *number = model.slots[at].clamped(*number * strength);
    }
    model.set(&mut settings, "theta", turn - 180.0 * (turn / 180.0).round());
    settings
}

/// Strengths of amplitudes that are tried: colours that differ make up for them.
fn strengths(model: &Model) -> Vec<f64> {
    if model.colors.len() > 1 { vec![0.7] } else { vec![0.4, 0.8, 1.6] }
}

/// The direction of the least differences in degrees: of all directions, the one around which the squares of the pairs'
/// differences, relative to those of their distance, are least.
fn stretched(target: &Target) -> f64 {
    let values = target.brightness();
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for scale in target.pairs.bins.chunks(DIRECTIONS) {
        let of_scale: Vec<(f64, f64)> = scale
            .iter()
            .flatten()
            .map(|&[a, b]| {
                let (from, to) = (&target.pairs.points[a], &target.pairs.points[b]);
                (libm::atan2(to.v - from.v, to.u - from.u).to_degrees(), (values[a] - values[b]).powi(2))
            })
            .collect();
        let mean = of_scale.iter().map(|(_, square)| square).sum::<f64>() / of_scale.len().max(1) as f64;
        pairs.extend(of_scale.into_iter().map(|(angle, square)| (angle, square / mean.max(1e-12))));
    }
    let around = |turn: f64| {
        let (mut sum, mut total) = (0.0, 1e-9);
        for (angle, square) in &pairs {
            let apart = (angle - turn - 180.0 * ((angle - turn) / 180.0).round()) / KERNEL;
            let weight = if apart.abs() < 3.0 { libm::exp(-0.5 * apart * apart) } else { 0.0 };
            sum += weight * square;
            total += weight;
        }
        sum / total
    };
    let turns = (0..60).map(|k| 3.0 * f64::from(k) - 90.0);
    turns.map(|turn| (around(turn), turn)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, turn)| turn)
}

/// How often ranks and colours are found.
const ROUNDS: usize = 4;

/// How much each colour is pulled to what it was, relative to the number of points.
const PULL: f64 = 3e-3;

/// The colours of points, the darkest first.
fn by_brightness(points: &[Point]) -> Vec<[f64; 3]> {
    let mut colors: Vec<[f64; 3]> = points.iter().map(|point| point.albedo).collect();
    colors.sort_by(|a, b| a.iter().sum::<f64>().total_cmp(&b.iter().sum()));
    colors
}

/// Sets all colours of a graph, of which it shows `masks` at each point, to those that give the distribution of the
/// colours that are seen, sorted by brightness. Returns the graph's colours at the points.
fn recolored(model: &Model, settings: &mut Settings, masks: &[Vec<f64>], sorted: &[[f64; 3]]) -> Vec<[f64; 3]> {
    scale_to_mean(model, settings, masks, sorted);
    let rounds = if model.colors.len() > 1 { ROUNDS } else { 1 };
    for _ in 0..rounds {
        let shown = colored(model, settings, masks);
        let mut order: Vec<usize> = (0..shown.len()).collect();
        order.sort_by(|&a, &b| shown[a].iter().sum::<f64>().total_cmp(&shown[b].iter().sum()).then(a.cmp(&b)));
        solve(model, settings, masks, &order, sorted);
    }
    colored(model, settings, masks)
}

/// Scales the colours so that the mean is that of what is seen.
fn scale_to_mean(model: &Model, settings: &mut Settings, masks: &[Vec<f64>], sorted: &[[f64; 3]]) {
    let shown = colored(model, settings, masks);
    for channel in 0..3 {
        let sum = |all: &[[f64; 3]]| all.iter().map(|color| color[channel]).sum::<f64>();
        let gain = sum(sorted) / sum(&shown).max(1e-9);
        for &first in &model.colors {
            let number = settings.number_mut(first + channel);
            *number = (*number * gain).clamp(RANGE[0], RANGE[1]);
        }
    }
}

fn solve(model: &Model, settings: &mut Settings, masks: &[Vec<f64>], order: &[usize], sorted: &[[f64; 3]]) {
    let count = model.colors.len();
    let mut normals = [0, 1, 2].map(|_| Normal::new(count));
    let before: Vec<[f64; 3]> =
        model.colors.iter().map(|first| std::array::from_fn(|c| settings.numbers()[first + c])).collect();
    for (at, target) in order.iter().zip(sorted) {
        for (channel, normal) in normals.iter_mut().enumerate() {
            let shown: f64 = masks[*at].iter().zip(&before).map(|(mask, color)| mask * color[channel]).sum();
            normal.add(&masks[*at], target[channel] - shown, 1.0);
        }
    }
    for (channel, normal) in normals.iter().enumerate() {
        let Some(step) = normal.solve(|_, _| PULL * order.len() as f64) else { continue };
        for (first, step) in model.colors.iter().zip(step) {
            let number = settings.number_mut(first + channel);
            *number = (*number + step).clamp(RANGE[0], RANGE[1]);
        }
    }
}

/// The colours at each point.
fn colored(model: &Model, settings: &Settings, masks: &[Vec<f64>]) -> Vec<[f64; 3]> {
    let numbers = settings.numbers();
    let colors: Vec<[f64; 3]> =
        model.colors.iter().map(|at| [numbers[*at], numbers[at + 1], numbers[at + 2]]).collect();
    let color = |masks: &Vec<f64>| {
        std::array::from_fn(|channel| masks.iter().zip(&colors).map(|(mask, color)| mask * color[channel]).sum())
    };
    masks.iter().map(color).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::entry;
    use crate::noise::cell;

    /// Colours are found from the same texture at another place.
    #[test]
    fn colors_of_a_texture_elsewhere_are_found() {
        let model = Model::new(entry("terrazzo").unwrap().graph().unwrap(), Some(Class::Isotropic));
        let random = |i: u32, of: f64| cell(f64::from(i) + 0.5, of);
        let place =
            |i: u32| Point { u: random(i, 1.5), v: random(i, 2.5), footprint: 0.001, albedo: [0.0; 3], weight: 1.0 };
        let places: Vec<Point> = (0..1500).map(place).collect();
        let mut settings = Settings::defaults(&model.graph);
        let sorted = by_brightness(&model.shown(&settings, &places));
        model.set(&mut settings, "t_u", 3.7);
        let masks = model.masks(&settings, &places);
        let planted = settings.clone();
        for first in &model.colors {
            let number = settings.number_mut(*first);
            *number = 0.8 * *number + 0.08;
        }
        let off = |found: &Settings| {
            model.colors.iter().map(|at| (found.numbers()[*at] - planted.numbers()[*at]).abs()).fold(0.0, f64::max)
        };
        let before = off(&settings);
        recolored(&model, &mut settings, &masks, &sorted);
        assert!(off(&settings) < 0.07 && off(&settings) < before, "{} {before}", off(&settings));
        // The twin: the colours of a darker texture are others.
        let darker: Vec<[f64; 3]> = sorted.iter().map(|color| color.map(|channel| 0.6 * channel)).collect();
        recolored(&model, &mut settings, &masks, &darker);
        assert!(off(&settings) > 0.15);
    }
}
