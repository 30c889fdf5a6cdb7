//! Patterns of cells, such as tiles and boards, each of which has a tone of its own.
//!
//! A graph draws the tones at random, so they cannot be predicted. But wherever its cells are, the points of one cell
//! must be alike: that shows where the cells are, and with the tones taken away the joints are plain to see. Rows of
//! boards that begin at random are sought row by row ([`super::boards`]).

use super::boards::boards;
use super::colors::project;
use super::model::Model;
use super::points::Point;
use super::smooth::log_grey;
use crate::settings::Settings;

/// Points of which less than this is a cell belong to its joint.
const LEAST_MASK: f64 = 0.5;

/// The number that stands for all joints.
const JOINT: i64 = i64::MAX;

/// The greatest share of points that may be used up by the cells' tones.
const MOST_CELLS: f64 = 0.4;

/// Keeps the variance of the points of a cell above 0.
const LEAST_VARIANCE: f64 = 1e-6;

/// Turns in degrees, and shifts in metres, at which the same cells are elsewhere.
const ELSEWHERE: [[f64; 3]; 4] = [[13.0, 0.31, 0.17], [-17.0, -0.23, 0.41], [29.0, 0.13, -0.37], [-37.0, 0.53, 0.11]];

/// The number of each point's cell, and the price of what else was chosen to find them; `None` for graphs without cells.
fn cells(model: &Model, settings: &Settings, points: &[Point]) -> Option<(Vec<i64>, f64)> {
    let tone = model.tone.as_ref()?;
    let chosen: Vec<usize> = std::iter::once(tone.slot).chain(tone.colors.iter().copied()).collect();
    let tones = model.slopes(settings, &chosen, points);
    // The slope of a tone is a cell's random number times what is seen of the cell: their quotient is the number.
    let number = |slopes: &Vec<f64>| {
        let (of_tone, of_color) = (slopes[0], slopes[1..].iter().sum::<f64>());
        if of_color < LEAST_MASK { JOINT } else { (1e6 * of_tone / of_color).round() as i64 }
    };
    let mut numbers: Vec<i64> = tones.iter().map(number).collect();
    let Some(sizes) = tone.boards else { return Some((numbers, 0.0)) };
    let (of_boards, price) = boards(model, settings, sizes, points);
    for (number, board) in numbers.iter_mut().zip(of_boards).filter(|(number, _)| **number != JOINT) {
        *number = board;
    }
    Some((numbers, price))
}

/// Sums over a cell, of weights and of weighted logarithms of the brightness.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    weight: f64,
    log: f64,
    square: f64,
}

impl Sums {
    fn add(&mut self, point: &Point) {
        let log = log_grey(point);
        self.count += 1.0;
        self.weight += point.weight;
        self.log += point.weight * log;
        self.square += point.weight * log * log;
    }

    fn mean(&self) -> f64 {
        self.log / self.weight.max(1e-300)
    }

    /// The weighted sum of squares around the mean.
    fn inner(&self) -> f64 {
        (self.square - self.log * self.mean()).max(0.0)
    }
}

/// The tones of cells as random effects: normal around one mean, with a variance that follows from the points (analysis
/// of variance; Searle, Casella and McCulloch 1992). Tones of few points are drawn to the mean, and cells that do not
/// differ cost nothing.
struct Tones {
    /// The cells with their sums, in the order of their numbers; the joint last.
    cells: Vec<(i64, Sums)>,
    mean: f64,
    /// The variance of the tones over that of the points of a cell.
    ratio: f64,
}

impl Tones {
    fn new(numbers: &[i64], points: &[Point]) -> Self {
        let cells = summed(numbers, points);
        let own = || cells.iter().filter(|(number, _)| *number != JOINT).map(|(_, sums)| sums);
        let count: f64 = own().map(|sums| sums.count).sum();
        let weight: f64 = own().map(|sums| sums.weight).sum();
        let mean = own().map(|sums| sums.log).sum::<f64>() / weight.max(1e-300);
        // Per point, as if all weights were 1.
        let unit = count / weight.max(1e-300);
        let inner = unit * own().map(Sums::inner).sum::<f64>();
        let outer = unit * own().map(|sums| sums.weight * (sums.mean() - mean).powi(2)).sum::<f64>();
        let number = own().count() as f64;
        let variance = inner / (count - number).max(1.0) + LEAST_VARIANCE;
        let squares: f64 = own().map(|sums| sums.count * sums.count).sum();
        let between = (outer - (number - 1.0) * variance) / (count - squares / count.max(1.0)).max(1.0);
        Self { mean, ratio: between.max(0.0) / variance, cells }
    }

    /// What the points of each cell are multiplied by.
    fn gains(&self) -> Vec<f64> {
        let gain = |(number, sums): &(i64, Sums)| {
            let known = sums.count * self.ratio;
            if *number == JOINT { 1.0 } else { libm::exp(known / (1.0 + known) * (self.mean - sums.mean())) }
        };
        self.cells.iter().map(gain).collect()
    }

    /// The price of the tones: the sum of the logarithms of how much each cell's variance is reduced.
    fn price(&self) -> f64 {
        let own = self.cells.iter().filter(|(number, _)| *number != JOINT);
        own.map(|(_, sums)| libm::log(1.0 + sums.count * self.ratio)).sum()
    }

    /// The points without their cells' tones.
    fn taken_from(&self, numbers: &[i64], points: &[Point]) -> Vec<Point> {
        let gains = self.gains();
        let scaled = |(point, number): (&Point, &i64)| {
            let at = self.cells.binary_search_by_key(number, |(number, _)| *number).expect("every number has sums");
            Point { albedo: point.albedo.map(|channel| channel * gains[at]), ..*point }
        };
        points.iter().zip(numbers).map(scaled).collect()
    }
}

/// The cells with their sums, in the order of their numbers.
fn summed(numbers: &[i64], points: &[Point]) -> Vec<(i64, Sums)> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by_key(|at| numbers[*at]);
    let mut all: Vec<(i64, Sums)> = Vec::new();
    for at in order {
        if all.last().is_none_or(|(number, _)| *number != numbers[at]) {
            all.push((numbers[at], Sums::default()));
        }
        all.last_mut().expect("one was added").1.add(&points[at]);
    }
    all
}

/// The mean square that is left when every cell has a tone of its own and colours are those that come closest, times
/// the price of the tones, so that its logarithm is proportional to that of a likelihood. `None` for graphs without
/// cells, or where they are too many.
pub(super) fn cell_error(model: &Model, settings: &Settings, points: &[Point]) -> Option<f64> {
    let (numbers, price) = cells(model, settings, points)?;
    let tones = Tones::new(&numbers, points);
    if tones.cells.len() as f64 > MOST_CELLS * points.len() as f64 {
        return None;
    }
    let toneless = tones.taken_from(&numbers, points);
    let error = project(model, &mut settings.clone(), &toneless);
    Some(error * libm::exp((price + tones.price()) / points.len() as f64))
}

/// The logarithm of the ratio of the cells' error to that of the same cells elsewhere: negative where cells are in
/// place; 0 for graphs without cells.
pub(super) fn excess(model: &Model, settings: &Settings, points: &[Point]) -> f64 {
    let Some(own) = cell_error(model, settings, points) else { return 0.0 };
    let elsewhere = ELSEWHERE.iter().filter_map(|moves| {
        let mut moved = settings.clone();
        for (name, add) in ["theta", "t_u", "t_v"].iter().zip(moves) {
            if let Some(at) = model.slot(name) {
                let number = moved.numbers()[at] + add;
                model.set(&mut moved, name, number);
            }
        }
        cell_error(model, &moved, points)
    });
    let logs: Vec<f64> = elsewhere.map(|error| libm::log(error.max(1e-12))).collect();
    let mean = logs.iter().sum::<f64>() / logs.len().max(1) as f64;
    if logs.is_empty() { 0.0 } else { (libm::log(own.max(1e-12)) - mean).min(0.0) }
}

/// The points with every cell scaled to the mean tone of all cells; unchanged for graphs without cells.
pub(super) fn without_tones(model: &Model, settings: &Settings, points: &[Point]) -> Vec<Point> {
    match cells(model, settings, points) {
        Some((numbers, _)) => Tones::new(&numbers, points).taken_from(&numbers, points),
        None => points.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::{Class, entry};
    use crate::noise::cell::cell;

    /// Tiles whose tones have nothing to do with those that the graph would draw.
    fn tiles() -> (Model, Settings, Vec<Point>) {
        let model = Model::new(entry("tile").unwrap().graph().unwrap(), Some(Class::Lattice));
        let settings = model.start();
        let random = |i: u32, of: f64| cell(f64::from(i) + 0.5, of);
        let place = |i: u32| {
            let (u, v) = (2.0 * random(i, 1.5), 2.0 * random(i, 2.5));
            let tone = 0.7 + 0.6 * cell((u / 0.2).floor() + 0.5, (v / 0.2).floor() + 100.5);
            let noise = 0.97 + 0.06 * random(i, 3.5);
            Point { u, v, footprint: 0.002, albedo: [0.5 * tone * noise, 0.4 * tone * noise, 0.3], weight: 1.0 }
        };
        (model, settings, (0..1500).map(place).collect())
    }

    #[test]
    fn cells_in_place_leave_less_than_the_same_cells_elsewhere() {
        let (model, settings, points) = tiles();
        let in_place = excess(&model, &settings, &points);
        assert!(in_place < -0.5, "{in_place}");
        let mut moved = settings.clone();
        model.set(&mut moved, "t_u", 0.1);
        assert!(cell_error(&model, &moved, &points).unwrap() > 1.5 * cell_error(&model, &settings, &points).unwrap());
        // The twin: colours without cells.
        let flat: Vec<Point> = points.iter().map(|point| Point { albedo: [0.4; 3], ..*point }).collect();
        assert!(excess(&model, &settings, &flat).abs() < 0.2);
    }

    #[test]
    fn without_tones_cells_are_alike() {
        let (model, settings, points) = tiles();
        let spread = |points: &[Point]| {
            let mean = points.iter().map(Point::grey).sum::<f64>() / points.len() as f64;
            points.iter().map(|point| (point.grey() - mean).powi(2)).sum::<f64>() / points.len() as f64
        };
        assert!(spread(&without_tones(&model, &settings, &points)) < 0.2 * spread(&points));
        // The twin: a graph without cells takes nothing away.
        let stripes = Model::new(entry("stripes").unwrap().graph().unwrap(), Some(Class::Stripe));
        assert_eq!(without_tones(&stripes, &stripes.start(), &points), points);
    }
}
