//! Levenberg-Marquardt steps of a graph's shape and colours together, with Huber's loss.

use super::colors::mean_loss;
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
    let (mut damping, mut error) = (1e-3, mean_loss(model, settings, points, huber));
    for _ in 0..steps {
        let normal = equations(model, settings, &chosen, points);
        let before = error;
        for _ in 0..5 {
            let Some(step) = normal.solve(|_, diagonal| damping * diagonal + 1e-9) else { return };
            let tried = stepped(model, settings, &chosen, &step);
            let found = mean_loss(model, &tried, points, huber);
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

/// Twice Huber's loss: the square of small differences; linear in large ones, with the same slope where they meet.
fn huber(difference: f64) -> f64 {
    let size = difference.abs();
    if size > HUBER { HUBER * (2.0 * size - HUBER) } else { size * size }
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
        let number = tried.number_mut(at);
        *number = model.slots[at].clamped(*number + step);
    }
    tried
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weights of the equations are those of the loss: its slope over twice the difference.
    #[test]
    fn the_loss_and_its_slope_are_continuous() {
        assert_eq!([huber(0.1), huber(-0.1)], [0.1 * 0.1; 2]);
        for difference in [0.05, HUBER - 1e-4, HUBER + 1e-4, 0.9] {
            let slope = (huber(difference + 1e-6) - huber(difference - 1e-6)) / 2e-6;
            let robust = if difference > HUBER { HUBER / difference } else { 1.0 };
            assert!((slope - 2.0 * robust * difference).abs() < 1e-6, "{difference}: {slope}");
        }
    }
}
