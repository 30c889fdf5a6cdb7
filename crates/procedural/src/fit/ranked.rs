//! The colours of a texture whose phase is random: those that give it the distribution of the colours seen.
//!
//! Places are matched by their rank of brightness, the brightest with the brightest (optimal transport in one
//! dimension); then colours are a linear least squares problem. Ranks and colours are found in turn.

use super::colors::RANGE;
use super::model::Model;
use super::points::Point;
use super::system::Normal;
use crate::settings::Settings;

/// How often ranks and colours are found.
const ROUNDS: usize = 4;

/// How much each colour is pulled to what it was, relative to the number of points.
const PULL: f64 = 3e-3;

/// The colours of points, the darkest first.
pub(super) fn by_brightness(points: &[Point]) -> Vec<[f64; 3]> {
    let mut colors: Vec<[f64; 3]> = points.iter().map(|point| point.albedo).collect();
    colors.sort_by(|a, b| a.iter().sum::<f64>().total_cmp(&b.iter().sum()));
    colors
}

/// Sets all colours of a graph, of which it shows `masks` at each point, to those that give the distribution of the
/// colours that are seen, sorted by brightness. Returns the graph's colours at the points.
pub(super) fn recolored(
    model: &Model,
    settings: &mut Settings,
    masks: &[Vec<f64>],
    sorted: &[[f64; 3]],
) -> Vec<[f64; 3]> {
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
pub(super) fn colored(model: &Model, settings: &Settings, masks: &[Vec<f64>]) -> Vec<[f64; 3]> {
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
    use crate::library::{Class, entry};
    use crate::noise::cell::cell;

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
