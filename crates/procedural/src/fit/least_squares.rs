//! Least squares: weighted sums of squares as linear systems, solved by Cholesky's factors, and what is found by them.
//!
//! - The smooth part of what is seen: shading that is left, which is no pattern.
//! - The colours of a graph in closed form: they enter linearly, so that for given shapes they are a linear least
//!   squares problem (variable projection; Golub and Pereyra 1973).
//! - Shape and colours together, by Levenberg-Marquardt steps with Huber's loss.
//!
//! `light` factors its systems too: it uses crates of ours, which this one does not, and it sums products in fours, which
//! changes the last bits of a solution. So each keeps its twenty lines.
//!
//! The systems need only +, -, *, / and square roots in a fixed order: the same bytes on every machine.

use super::model::Model;
use super::{Point, extent};
use crate::graph::Settings;

/// The normal equations of a linear least squares problem.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    /// The lower triangle, row by row.
    rows: Vec<Vec<f64>>,
    right: Vec<f64>,
}

impl Normal {
    pub(super) fn new(unknowns: usize) -> Self {
        Self { rows: (1..=unknowns).map(|length| vec![0.0; length]).collect(), right: vec![0.0; unknowns] }
    }

    /// Adds the equation `row . x = value`. Zeros of the row cost nothing.
    pub(super) fn add(&mut self, row: &[f64], value: f64, weight: f64) {
        for (i, a) in row.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            let scaled = weight * a;
            self.rows[i].iter_mut().zip(row).for_each(|(sum, b)| *sum += scaled * b);
            self.right[i] += scaled * value;
        }
    }

    /// The least squares solution, after `ridge(unknown, diagonal)` is added to the diagonal; `None` where the system
    /// is singular.
    pub(super) fn solve(&self, ridge: impl Fn(usize, f64) -> f64) -> Option<Vec<f64>> {
        let mut factor = self.rows.clone();
        for i in 0..factor.len() {
            let (done, rest) = factor.split_at_mut(i);
            let row = &mut rest[0];
            row[i] += ridge(i, row[i]);
            for (j, other) in done.iter().enumerate() {
                row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
            }
            let square = row[i] - dot(&row[..i], &row[..i]);
            if square.is_nan() || square <= 0.0 {
                return None;
            }
            row[i] = square.sqrt();
        }
        Some(substituted(&factor, self.right.clone()))
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// x of L L^T x = `right`.
fn substituted(factor: &[Vec<f64>], mut right: Vec<f64>) -> Vec<f64> {
    for (i, row) in factor.iter().enumerate() {
        right[i] = (right[i] - dot(&row[..i], &right[..i])) / row[i];
    }
    for i in (0..right.len()).rev() {
        right[i] /= factor[i][i];
        let value = right[i];
        factor[i][..i].iter().zip(&mut right).for_each(|(l, x)| *x -= l * value);
    }
    right
}

/// Keeps the logarithm of black finite.
pub(super) const FLOOR: f64 = 0.01;

/// The logarithm of a point's brightness.
pub(super) fn log_grey(point: &Point) -> f64 {
    libm::log(point.grey() + FLOOR)
}

/// A cubic polynomial of the place that comes closest to [`log_grey`], at each point; zeros where the points are too
/// few.
pub(super) fn smooth_part(points: &[Point]) -> Vec<f64> {
    smooth_part_of(points, &points.iter().map(log_grey).collect::<Vec<_>>())
}

/// A cubic polynomial of the place that comes closest to a number at each point; zeros where the points are too few.
pub(super) fn smooth_part_of(points: &[Point], values: &[f64]) -> Vec<f64> {
    let Some(first) = points.first() else { return Vec::new() };
    let [width, height] = extent(points);
    let scale = 1.0 / width.max(height).max(1e-9);
    let rows: Vec<[f64; 10]> =
        points.iter().map(|point| cubic((point.u - first.u) * scale, (point.v - first.v) * scale)).collect();
    let mut normal = Normal::new(10);
    for ((row, value), point) in rows.iter().zip(values).zip(points) {
        normal.add(row, *value, point.weight);
    }
    let total: f64 = points.iter().map(|point| point.weight).sum();
    let solved = normal.solve(|_, _| 1e-9 * total).unwrap_or(vec![0.0; 10]);
    rows.iter().map(|row| row.iter().zip(&solved).map(|(a, b)| a * b).sum()).collect()
}

/// The monomials of degree up to three.
fn cubic(x: f64, y: f64) -> [f64; 10] {
    [1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y]
}

/// The points with their smooth part replaced by its mean.
pub(super) fn flattened(points: &[Point]) -> Vec<Point> {
    let smooth = smooth_part(points);
    let total: f64 = points.iter().map(|point| point.weight).sum();
    let mean = points.iter().zip(&smooth).map(|(point, smooth)| point.weight * smooth).sum::<f64>() / total;
    let flat = |(point, smooth): (&Point, &f64)| {
        let gain = libm::exp(mean - smooth);
        Point { albedo: point.albedo.map(|channel| channel * gain), ..*point }
    };
    points.iter().zip(&smooth).map(flat).collect()
}

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
fn mean_loss(model: &Model, settings: &Settings, points: &[Point], loss: fn(f64) -> f64) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (point, shown) in points.iter().zip(model.shown(settings, points)) {
        let of_channels: f64 = point.albedo.iter().zip(shown.albedo).map(|(a, b)| loss(a - b)).sum();
        sum += point.weight * of_channels / 3.0;
        total += point.weight;
    }
    sum / total
}

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

    #[test]
    fn exact_equations_are_solved_and_ridges_pull_to_zero() {
        let mut normal = Normal::new(2);
        for (x, weight) in [(0.0, 1.0), (1.0, 2.0), (3.0, 0.5)] {
            normal.add(&[1.0, x], 2.0 - 0.5 * x, weight);
        }
        let exact = normal.solve(|_, _| 0.0).unwrap();
        assert!((exact[0] - 2.0).abs() < 1e-12 && (exact[1] + 0.5).abs() < 1e-12, "{exact:?}");
        let pulled = normal.solve(|at, _| if at == 1 { 1e9 } else { 0.0 }).unwrap();
        assert!(pulled[1].abs() < 1e-6, "{pulled:?}");
        assert_eq!(Normal::new(2).solve(|_, _| 0.0), None);
    }

    /// Checks under light that falls off: the shading goes, the checks stay.
    #[test]
    fn shading_is_taken_away_and_pattern_is_kept() {
        let checks = |u: f64, v: f64| if (u.floor() + v.floor()).rem_euclid(2.0) < 1.0 { 0.6 } else { 0.2 };
        let at = |i: u32, light: f64| {
            let (u, v) = (f64::from(i % 97) * 0.171, f64::from(i / 97) * 0.171);
            let albedo = [checks(u, v) * (1.0 + light * (u - 8.0) / 8.0); 3];
            Point { u, v, footprint: 0.1, albedo, weight: 1.0 }
        };
        let spread = |points: &[Point]| {
            let light_fields =
                points.iter().filter(|point| checks(point.u, point.v) > 0.5).map(|point| point.albedo[0]);
            let (least, most) = light_fields.fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
            most / least
        };
        let points: Vec<Point> = (0..97 * 97).map(|i| at(i, 0.4)).collect();
        let flat = spread(&flattened(&points));
        assert!(flat < 1.15, "{flat}");
        // The twin: before.
        assert!(spread(&points) > 2.0);
    }

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
