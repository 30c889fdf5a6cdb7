//! The strongest waves of a pattern that is known at scattered points: directions, periods and phases in closed form.
//!
//! The logarithm of the colour, without a cubic polynomial that takes up what shading is left, is splatted to a grid,
//! whose Fourier transform has a peak near each wave. A peak is refined by the transform at the points themselves, the
//! wave is subtracted, and the next one is sought (Högbom 1974, "CLEAN").

use std::f64::consts::TAU;

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

use super::least_squares::{log_grey, smooth_part};
use super::{Point, extent, median};

/// Fewer points cannot distinguish a wave from chance.
const LEAST_POINTS: usize = 50;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Periods a metre along u and v; the first one that is not zero is positive.
    pub frequency: [f64; 2],
    /// The amplitude at phase zero: the mean of signal times `exp(-i TAU f . x)`.
    pub amplitude: [f64; 2],
    /// Its share of the signal's variance.
    pub share: f64,
}

impl Wave {
    /// Metres from crest to crest.
    pub fn period(&self) -> f64 {
        1.0 / libm::hypot(self.frequency[0], self.frequency[1])
    }

    /// The direction across the crests, in radians from u, above -pi/2 and up to pi/2.
    pub fn direction(&self) -> f64 {
        libm::atan2(self.frequency[1], self.frequency[0])
    }

    /// `exp(-i TAU f . x)` at a place.
    pub(super) fn turned(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = libm::sincos(-TAU * (self.frequency[0] * u + self.frequency[1] * v));
        [cos, sin]
    }

    pub(super) fn phase(&self) -> f64 {
        libm::atan2(self.amplitude[1], self.amplitude[0])
    }
}

/// A number at each point.
pub(super) struct Signal {
    places: Vec<[f64; 2]>,
    weights: Vec<f64>,
    values: Vec<f64>,
}

impl Signal {
    /// The logarithm of the points' brightness without its smooth part.
    pub(super) fn of(points: &[Point]) -> Self {
        let values = points.iter().zip(smooth_part(points)).map(|(point, smooth)| log_grey(point) - smooth);
        Self::new(points, values.collect())
    }

    /// The logarithm of the points' brightness without its mean: for points without light.
    pub(super) fn without_mean(points: &[Point]) -> Self {
        let mut signal = Self::new(points, points.iter().map(log_grey).collect());
        let mean: f64 = signal.values.iter().zip(&signal.weights).map(|(value, weight)| weight * value).sum();
        signal.values.iter_mut().for_each(|value| *value -= mean);
        signal
    }

    fn new(points: &[Point], values: Vec<f64>) -> Self {
        let total: f64 = points.iter().map(|point| point.weight).sum();
        Self {
            places: points.iter().map(|point| [point.u, point.v]).collect(),
            weights: points.iter().map(|point| point.weight / total).collect(),
            values,
        }
    }

    /// Its mean square.
    pub(super) fn variance(&self) -> f64 {
        self.values.iter().zip(&self.weights).map(|(value, weight)| weight * value * value).sum()
    }

    /// The Fourier transform, given `exp(-i TAU f . x)` at each point.
    pub(super) fn along(&self, turned: &[[f64; 2]]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (([cos, sin], value), weight) in turned.iter().zip(&self.values).zip(&self.weights) {
            sum[0] += weight * value * cos;
            sum[1] += weight * value * sin;
        }
        sum
    }

    /// The Fourier transform at a frequency.
    fn transform(&self, frequency: [f64; 2]) -> [f64; 2] {
        let wave = Wave { frequency, amplitude: [0.0; 2], share: 0.0 };
        self.along(&self.places.iter().map(|place| wave.turned(*place)).collect::<Vec<_>>())
    }

    fn power(&self, frequency: [f64; 2]) -> f64 {
        let [re, im] = self.transform(frequency);
        re * re + im * im
    }

    fn subtract(&mut self, wave: &Wave) {
        let [fu, fv] = wave.frequency;
        for (place, value) in self.places.iter().zip(&mut self.values) {
            let (sin, cos) = libm::sincos(TAU * (fu * place[0] + fv * place[1]));
            *value -= 2.0 * (wave.amplitude[0] * cos - wave.amplitude[1] * sin);
        }
    }
}

/// What makes a wave stand out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// Its share of the variance.
    Power,
    /// Its power over that of waves of similar period: joints, which have many harmonics, before the tones of cells.
    Contrast,
}

/// Up to `most` waves, those that stand out most first; their share is by how much they do. Fewer where the points are
/// too few.
pub(super) fn waves(points: &[Point], most: usize, order: Order) -> Vec<Wave> {
    if points.len() < LEAST_POINTS {
        return Vec::new();
    }
    let mut signal = Signal::of(points);
    let variance = signal.variance();
    let grid = Grid::around(points);
    let mut found: Vec<Wave> = Vec::new();
    for _ in 0..most {
        let Some((contrast, frequency)) = grid.strongest(&signal, order) else { break };
        let frequency = refined(&signal, frequency, 0.25 / (grid.cell * grid.side as f64));
        let amplitude = signal.transform(frequency);
        let share = 2.0 * (amplitude[0] * amplitude[0] + amplitude[1] * amplitude[1]) / variance.max(1e-12);
        signal.subtract(&Wave { frequency, amplitude, share });
        let share = if order == Order::Contrast { contrast } else { share };
        found.push(Wave { frequency, amplitude, share });
    }
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    found
}

/// A square grid over the points.
struct Grid {
    origin: [f64; 2],
    cell: f64,
    side: usize,
    least_frequency: f64,
}

impl Grid {
    const SIDES: [usize; 2] = [64, 512];

    /// Cells of the size of a pixel, as far as the number of cells allows; twice as long as the points' extent, so that
    /// frequencies are finer than the patch resolves.
    fn around(points: &[Point]) -> Self {
        let [width, height] = extent(points);
        let length = width.max(height).max(1e-6);
        let pixel = median(points.iter().map(|point| point.footprint).collect());
        let wanted = 2.0 * length / pixel.max(1e-9);
        // The bound comes first: the next power of two of a great number does not exist.
        let side = (wanted.min(Self::SIDES[1] as f64) as usize).next_power_of_two().max(Self::SIDES[0]);
        let least = |of: fn(&Point) -> f64| points.iter().map(of).fold(f64::MAX, f64::min);
        let origin = [least(|point| point.u), least(|point| point.v)];
        Self { origin, cell: 2.0 * length / side as f64, side, least_frequency: 1.5 / length }
    }

    /// The frequency of the greatest power, or contrast, that is neither too low nor close to what the grid cannot
    /// show, after that power or contrast.
    fn strongest(&self, signal: &Signal, order: Order) -> Option<(f64, [f64; 2])> {
        let power = self.spectrum(signal);
        let unit = 1.0 / (self.cell * self.side as f64);
        let signed = |at: usize| if at > self.side / 2 { at as f64 - self.side as f64 } else { at as f64 };
        let rings = self.rings(&power);
        let mut best = None;
        for row in 0..=self.side / 2 {
            for column in 0..self.side {
                let frequency = [signed(row) * unit, signed(column) * unit];
                let size = libm::hypot(frequency[0], frequency[1]);
                let shown = size > self.least_frequency && size < 0.45 / self.cell;
                let background = if order == Order::Contrast { rings[self.ring(row, column)] } else { 1.0 };
                let found = power[row * self.side + column] / background.max(1e-300);
                if shown && best.is_none_or(|(most, _)| found > most) {
                    best = Some((found, frequency));
                }
            }
        }
        best
    }

    /// The ring of similar frequencies that a cell belongs to: four an octave.
    fn ring(&self, row: usize, column: usize) -> usize {
        let near = |at: usize| at.min(self.side - at) as f64;
        let square = near(row) * near(row) + near(column) * near(column);
        // Half of the binary logarithm of a square is that of its root.
        (2.0 * libm::log2(square.max(1.0))) as usize
    }

    /// The mean power of each ring.
    fn rings(&self, power: &[f64]) -> Vec<f64> {
        let mut sums = vec![[0.0, 0.0]; 4 * 12];
        for row in 0..=self.side / 2 {
            for column in 0..self.side {
                let [sum, count] = &mut sums[self.ring(row, column)];
                *sum += power[row * self.side + column];
                *count += 1.0;
            }
        }
        sums.iter().map(|[sum, count]| sum / f64::max(*count, 1.0)).collect()
    }

    /// The power of each frequency: rows are those along u, columns those along v.
    fn spectrum(&self, signal: &Signal) -> Vec<f64> {
        let side = self.side;
        let mut cells = vec![Complex::new(0.0, 0.0); side * side];
        for ((place, value), weight) in signal.places.iter().zip(&signal.values).zip(&signal.weights) {
            let at = |axis: usize| (((place[axis] - self.origin[axis]) / self.cell) as usize).min(side - 1);
            cells[at(1) * side + at(0)] += weight * value;
        }
        let fft = FftPlanner::new().plan_fft_forward(side);
        // Every row of the cells is transformed, then every column, which is a row from then on.
        fft.process(&mut cells);
        transpose(&mut cells, side);
        fft.process(&mut cells);
        cells.iter().map(|cell| cell.norm_sqr()).collect()
    }
}

fn transpose(cells: &mut [Complex<f64>], side: usize) {
    for row in 0..side {
        for column in 0..row {
            cells.swap(row * side + column, column * side + row);
        }
    }
}

/// Climbs to the greatest power near a frequency by a pattern search whose step halves.
fn refined(signal: &Signal, start: [f64; 2], mut step: f64) -> [f64; 2] {
    let (mut best, mut most) = (start, signal.power(start));
    for _ in 0..12 {
        for [du, dv] in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
            let tried = [best[0] + du * step, best[1] + dv * step];
            let power = signal.power(tried);
            if power > most {
                (best, most) = (tried, power);
            }
        }
        step *= 0.6;
    }
    upright(best)
}

/// The frequency or its opposite, whose direction is above -pi/2 and up to pi/2.
fn upright([fu, fv]: [f64; 2]) -> [f64; 2] {
    if fu < 0.0 || (fu == 0.0 && fv < 0.0) { [-fu, -fv] } else { [fu, fv] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stripes with noise and shading, seen at an angle: places are denser at the near end.
    fn stripes(period: f64, degrees: f64) -> Vec<Point> {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        let point = |i: u32| {
            let random = |k: i32| crate::noise::cell(f64::from(i) + 0.5, f64::from(k) + 0.5);
            let (s, t) = (random(0), random(1));
            let (u, v) = ((s - 0.5) * (1.0 + t), 2.0 * t * t);
            let stripe = if ((u * cos + v * sin) / period).rem_euclid(1.0) < 0.5 { 0.6 } else { 0.3 };
            let shading = 1.0 + 0.4 * (u + 0.5 * v - 0.5);
            let albedo = [stripe * shading * (1.0 + 0.2 * (random(2) - 0.5)); 3];
            Point { u, v, footprint: 0.005, albedo, weight: 1.0 }
        };
        (0..3000).map(point).collect()
    }

    #[test]
    fn period_and_direction_of_stripes_are_found() {
        for (period, degrees) in [(0.2, 10.0), (0.11, -35.0), (0.05, 71.0), (0.3, 88.0)] {
            let points = stripes(period, degrees);
            let found = waves(&points, 4, Order::Power);
            let best = found[0];
            assert!((best.period() / period - 1.0).abs() < 0.01, "{period}: {}", best.period());
            let off = (best.direction().to_degrees() - degrees + 90.0).rem_euclid(180.0) - 90.0;
            assert!(off.abs() < 1.0, "{degrees}: {off}");
            assert!(best.share > 0.4, "{}", best.share);
        }
        // The twin: noise has no wave.
        let mut noise = stripes(0.2, 10.0);
        for (i, point) in noise.iter_mut().enumerate() {
            point.albedo = [0.3 + 0.3 * crate::noise::cell(i as f64 + 0.5, 9.5); 3];
        }
        assert!(waves(&noise, 4, Order::Power)[0].share < 0.05);
    }

    #[test]
    fn grids_are_bounded_however_far_apart_the_points_are() {
        let mut points = stripes(0.2, 10.0);
        assert_eq!(Grid::around(&points).side, 512);
        for far in [1e15, f64::MAX] {
            points[0].u = far;
            assert_eq!(Grid::around(&points).side, 512, "{far}");
        }
        // The twin: large pixels make a small grid.
        points.iter_mut().for_each(|point| *point = Point { u: point.v, footprint: 1.0, ..*point });
        assert_eq!(Grid::around(&points).side, 64);
    }
}
