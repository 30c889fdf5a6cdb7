//! The colours of a graph in closed form: they enter linearly, so that for given shapes they are a linear least squares
//! problem (variable projection; Golub and Pereyra 1973).

use super::model::Model;
use super::points::Point;
use super::system::Normal;
use crate::settings::Settings;

/// The colours that a surface may have.
pub(super) const RANGE: [f64; 2] = [0.01, 1.0];

/// How much each colour is pulled to the mean colour, relative to the weight of all points.
const PULL: f64 = 1e-4;

/// Sets the colours to those that come closest to the points. Returns the weighted mean square of what remains.
pub(super) fn project(model: &Model, settings: &mut Settings, points: &[Point]) -> f64 {
    let total: f64 = points.iter().map(|point| point.weight).sum();
    let slots: [Vec<usize>; 3] = std::array::from_fn(|channel| model.colors.iter().map(|at| at + channel).collect());
    for (channel, slots) in slots.iter().enumerate() {
        let mean = points.iter().map(|point| point.weight * point.albedo[channel]).sum::<f64>() / total;
        // No colour is clamped here, so that the derivatives are the masks.
        slots.iter().for_each(|&slot| *settings.number_mut(slot) = mean.clamp(RANGE[0], 0.6));
    }
    let count = model.colors.len();
    let mut normals = [0, 1, 2].map(|_| Normal::new(count));
    model.visit(settings, &slots.concat(), points, |point, channel, value, slopes| {
        let masks = &slopes[channel * count..][..count];
        normals[channel].add(masks, point.albedo[channel] - value, point.weight);
    });
    for (slots, normal) in slots.iter().zip(&normals) {
        let Some(step) = normal.solve(|_, _| PULL * total) else { continue };
        for (&slot, step) in slots.iter().zip(step) {
            let number = settings.number_mut(slot);
            *number = (*number + step).clamp(RANGE[0], RANGE[1]);
        }
    }
    mean_square(model, settings, points)
}

/// The weighted mean square of the differences between model and points.
pub(super) fn mean_square(model: &Model, settings: &Settings, points: &[Point]) -> f64 {
    mean_loss(model, settings, points, |difference| difference * difference)
}

/// The weighted mean of a loss of the differences between model and points.
pub(super) fn mean_loss(model: &Model, settings: &Settings, points: &[Point], loss: fn(f64) -> f64) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (point, shown) in points.iter().zip(model.shown(settings, points)) {
        let of_channels: f64 = point.albedo.iter().zip(shown.albedo).map(|(a, b)| loss(a - b)).sum();
        sum += point.weight * of_channels / 3.0;
        total += point.weight;
    }
    sum / total
}
