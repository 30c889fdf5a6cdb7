//! Levenberg-Marquardt steps of a graph's shape and colours together, with Huber's loss.

use super::colors::mean_square;
use super::model::Model;
use super::points::Point;
use super::system::Normal;
use crate::settings::Settings;

/// The difference of colours from which on errors count linearly.
const HUBER: f64 = 0.15;

/// Improves the settings in at most `steps` steps. They stay in the parameters' ranges.
pub(super) fn polish(model: &Model, settings: &mut Settings, points: &[Point], steps: usize) {
    let colors = model.colors.iter().flat_map(|first| (0..3).map(move |channel| first + channel));
    let chosen: Vec<usize> = model.shape.iter().copied().chain(colors).collect();
    let (mut damping, mut error) = (1e-3, mean_square(model, settings, points));
    for _ in 0..steps {
        let normal = equations(model, settings, &chosen, points);
        let before = error;
        for _ in 0..5 {
            let Some(step) = normal.solve(|_, diagonal| damping * diagonal + 1e-9) else { return };
            let tried = stepped(model, settings, &chosen, &step);
            let found = mean_square(model, &tried, points);
            if found < error {
                (*settings, error) = (tried, found);
                damping = (damping / 5.0).max(1e-8);
                break;
            }
            damping *= 6.0;
        }
        if error > before * (1.0 - 1e-5) {
            return;
        }
    }
}

fn equations(model: &Model, settings: &Settings, chosen: &[usize], points: &[Point]) -> Normal {
    let mut normal = Normal::new(chosen.len());
    model.visit(settings, chosen, points, |point, channel, value, slopes| {
        let error = point.albedo[channel] - value;
        let robust = if error.abs() > HUBER { HUBER / error.abs() } else { 1.0 };
        normal.add(slopes, error, point.weight * robust);
    });
    normal
}

fn stepped(model: &Model, settings: &Settings, chosen: &[usize], step: &[f64]) -> Settings {
    let mut tried = settings.clone();
    for (&at, step) in chosen.iter().zip(step) {
        let slot = &model.slots[at];
        let number = tried.number_mut(at);
        *number = (*number + step).clamp(slot.least.unwrap_or(f64::MIN), slot.most.unwrap_or(f64::MAX));
    }
    tried
}
