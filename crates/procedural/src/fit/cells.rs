//! Patterns of cells, such as tiles and boards, each of which has a tone of its own.
//!
//! A graph draws the tones at random, so they cannot be predicted. But wherever its cells are, the points of one cell
//! must be alike: that shows where the cells are, and with the tones taken away the joints are plain to see.
//!
//! - Boards in rows begin at random: the beginning of each row is the one that makes the points of a board most alike.
//! - Thin joints show a polish no way to their place from farther than their width, but the more of a cell is in place,
//!   the more alike its points are: [`settled`] searches for the place of cells.
//! - [`better`] decides what waves confuse: a size with its multiples and fractions, shifts of rows, and whole numbers.

use super::least_squares::{log_grey, project};
use super::model::{Layout, Model};
use super::{Point, extent};
use crate::graph::Settings;

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

/// The number of each point's cell, and the price of what else was chosen to find them; `None` for graphs without
/// cells.
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
        let moved =
            ["theta", "t_u", "t_v"].iter().zip(moves).map(|(name, add)| (*name, model.number(settings, name) + add));
        cell_error(model, &model.with(settings, &moved.collect::<Vec<_>>()), points)
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

/// The number of beginnings of a row that are compared, over the length of a board.
const BEGINNINGS: usize = 12;

/// The number that a board has is that of its row times this, and its place in the row.
const ROW: i64 = 1 << 24;

/// A point in its row.
#[derive(Clone, Copy)]
struct InRow {
    /// The place of the point in the list.
    at: usize,
    row: i64,
    /// Board lengths along the row.
    along: f64,
    log: f64,
    weight: f64,
}

/// The number of each point's board, and the price of having chosen where the rows begin: the logarithm of the number
/// of ways. `sizes` are the slots of the width and the length of a board.
fn boards(model: &Model, settings: &Settings, [width, length]: [usize; 2], points: &[Point]) -> (Vec<i64>, f64) {
    let [theta, t_u, t_v] = ["theta", "t_u", "t_v"].map(|name| model.number(settings, name));
    let (sin, cos) = libm::sincos(theta.to_radians());
    let [width, length] = [width, length].map(|at| settings.numbers()[at].max(1e-9));
    let in_row = |(at, point): (usize, &Point)| {
        let (u, v) = (point.u - t_u, point.v - t_v);
        let row = ((v * cos - u * sin) / width).floor() as i64;
        InRow { at, row, along: (u * cos + v * sin) / length, log: log_grey(point), weight: point.weight }
    };
    let mut all: Vec<InRow> = points.iter().enumerate().map(in_row).collect();
    all.sort_by(|a, b| a.row.cmp(&b.row).then(a.along.total_cmp(&b.along)));
    let mut numbers = vec![0; points.len()];
    let mut rows = 0;
    for row in all.chunk_by(|a, b| a.row == b.row) {
        let beginnings = (0..BEGINNINGS).map(|at| at as f64 / BEGINNINGS as f64);
        let best = beginnings.map(|begin| (outer(row, begin), begin)).max_by(|a, b| a.0.total_cmp(&b.0));
        let begin = best.map_or(0.0, |(_, begin)| begin);
        row.iter().for_each(|point| numbers[point.at] = point.row * ROW + board(point, begin));
        rows += 1;
    }
    (numbers, f64::from(rows) * libm::log(BEGINNINGS as f64))
}

fn board(point: &InRow, begin: f64) -> i64 {
    (point.along + begin).floor() as i64
}

/// How much of the squares of a row is between boards: the sum of the squares of their sums over their weights.
fn outer(row: &[InRow], begin: f64) -> f64 {
    let of_board = |points: &[InRow]| {
        let sum: f64 = points.iter().map(|point| point.weight * point.log).sum();
        sum * sum / points.iter().map(|point| point.weight).sum::<f64>()
    };
    row.chunk_by(|a, b| board(a, begin) == board(b, begin)).map(of_board).sum()
}

/// The first step, in the least length of a cell; each next one is half as long.
const STEP: f64 = 0.16;

/// The number of steps' lengths.
const LEVELS: i32 = 4;

/// A change of the pattern that leaves the middle of the points where it is, but for shifts.
#[derive(Clone, Copy)]
enum Move<'a> {
    Shift([f64; 2]),
    Turn,
    Scale(&'a [(&'a str, [f64; 2])]),
}

/// Moves, turns and scales the cells as long as that makes the points of a cell more alike. Nothing where a graph has
/// no cells.
pub(super) fn settled(model: &Model, layout: Layout, settings: Settings, points: &[Point]) -> Settings {
    let Some(mut least) = cell_error(model, &settings, points) else { return settings };
    let [both, u, v] = [[1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
    // The lengths that scale together, with the axes along which they scale the pattern.
    let scales: Vec<Vec<(&str, [f64; 2])>> = match layout {
        Layout::Similar { length, .. } => vec![vec![(length, both)]],
        Layout::Rows { width, .. } => vec![vec![(width, v)]],
        Layout::Axes { u: along, v: across, .. } => vec![vec![(along, u)], vec![(across, v)]],
    };
    let mut moves = vec![Move::Turn, Move::Shift([0.0, 1.0])];
    if !matches!(layout, Layout::Rows { .. }) {
        moves.push(Move::Shift([1.0, 0.0]));
    }
    moves.extend(scales.iter().map(|scale| Move::Scale(scale)));
    let lengths = scales.iter().flatten().filter_map(|(name, _)| model.slot(name));
    let size = lengths.map(|at| settings.numbers()[at]).fold(f64::MAX, f64::min);
    let frame = Frame::new(points, size);
    let mut best = settings;
    for level in 0..LEVELS {
        let step = STEP * size * libm::pow(0.5, f64::from(level));
        for change in &moves {
            for signed in [step, -step] {
                let tried = frame.moved(model, &best, *change, signed);
                let error = cell_error(model, &tried, points).unwrap_or(f64::INFINITY);
                if error < least {
                    (best, least) = (tried, error);
                    break;
                }
            }
        }
    }
    best
}

/// The middle of the points, and the distance from it at which a step is measured.
struct Frame {
    middle: [f64; 2],
    reach: f64,
}

impl Frame {
    fn new(points: &[Point], size: f64) -> Self {
        let count = points.len().max(1) as f64;
        let mean = |of: fn(&Point) -> f64| points.iter().map(of).sum::<f64>() / count;
        let [width, height] = extent(points);
        Self { middle: [mean(|point| point.u), mean(|point| point.v)], reach: (0.4 * width.max(height)).max(size) }
    }

    /// The settings after a change by a step in metres, of points at the reach.
    fn moved(&self, model: &Model, settings: &Settings, change: Move, step: f64) -> Settings {
        let number = |name: &str| model.number(settings, name);
        let mut moved = settings.clone();
        // The middle in the frame of the pattern.
        let (sin, cos) = libm::sincos(number("theta").to_radians());
        let [du, dv] = [self.middle[0] - number("t_u"), self.middle[1] - number("t_v")];
        let mut place = [du * cos + dv * sin, dv * cos - du * sin];
        match change {
            Move::Shift([u, v]) => place = [place[0] + step * u, place[1] + step * v],
            Move::Turn => model.set(&mut moved, "theta", number("theta") + (step / self.reach).to_degrees()),
            Move::Scale(lengths) => {
                let factor = 1.0 + step / self.reach;
                for (name, axes) in lengths {
                    model.set(&mut moved, name, number(name) * factor);
                    place = [0, 1].map(|axis| if axes[axis] > 0.0 { place[axis] * factor } else { place[axis] });
                }
            }
        }
        let (sin, cos) = libm::sincos(model.number(&moved, "theta").to_radians());
        model.set(&mut moved, "t_u", self.middle[0] - (place[0] * cos - place[1] * sin));
        model.set(&mut moved, "t_v", self.middle[1] - (place[0] * sin + place[1] * cos));
        moved
    }
}

/// By what a size is multiplied, with the number of places where the larger cells may begin.
const FACTORS: [(f64, u32); 6] = [(0.5, 1), (2.0, 2), (1.0 / 3.0, 1), (3.0, 3), (1.5, 3), (2.0 / 3.0, 2)];

/// The number of shifts from row to row that are tried.
const SHIFTS: u32 = 80;

/// The settings with the size, the shift of rows, or the whole number that leaves the least error of cells; `None`
/// where those are the ones they have.
pub(super) fn better(model: &Model, layout: Layout, settings: &Settings, points: &[Point]) -> Option<Settings> {
    let before = cell_error(model, settings, points)?;
    let mut all = match layout {
        Layout::Axes { u, v, shift, .. } => {
            let mut along = resized(model, settings, u, 0.0);
            if let Some(shift) = shift {
                along = along.into_iter().flat_map(|resized| same_rows(model, settings, resized, [u, shift])).collect();
                // Shifts add up, so that they have to be close.
                along.extend((0..SHIFTS).map(|at| model.with(settings, &[(shift, f64::from(at) / f64::from(SHIFTS))])));
            }
            along.extend(resized(model, settings, v, 90.0));
            along
        }
        Layout::Rows { width, length, .. } => {
            let mut all = resized(model, settings, width, 90.0);
            // No wave says anything about the length of boards.
            let now = model.number(settings, length);
            all.extend((-12..=8).map(|k| model.with(settings, &[(length, now * libm::exp(0.1 * f64::from(k)))])));
            all
        }
        Layout::Similar { whole: Some((name, least, most)), .. } => {
            (least..=most).map(|number| model.with(settings, &[(name, f64::from(number))])).collect()
        }
        Layout::Similar { whole: None, .. } => return None,
    };
    all.retain(|tried| tried != settings);
    let judged = all.into_iter().filter_map(|settings| Some((cell_error(model, &settings, points)?, settings)));
    let (error, best) = judged.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (error < before).then_some(best)
}

/// Settings of another length with the shifts from row to row that leave every row where it was: up to one of the
/// former lengths.
fn same_rows(model: &Model, before: &Settings, resized: Settings, [length, shift]: [&str; 2]) -> Vec<Settings> {
    let factor = model.number(&resized, length) / model.number(before, length).max(1e-12);
    let with_shift = |lengths: u32| {
        let share = (model.number(before, shift) + f64::from(lengths)) / factor.max(1e-12);
        model.with(&resized, &[(shift, share - share.floor())])
    };
    (0..factor.ceil().clamp(1.0, 3.0) as u32).map(with_shift).collect()
}

/// The settings with other sizes along an axis, which is at an angle in degrees to the pattern's first.
fn resized(model: &Model, settings: &Settings, name: &str, turn: f64) -> Vec<Settings> {
    let [theta, t_u, t_v, size] = ["theta", "t_u", "t_v", name].map(|name| model.number(settings, name));
    let (sin, cos) = libm::sincos((theta + turn).to_radians());
    let resized = |factor: f64, place: u32, places: u32| {
        let along = f64::from(place) * size * factor / f64::from(places);
        model.with(settings, &[(name, size * factor), ("t_u", t_u + along * cos), ("t_v", t_v + along * sin)])
    };
    let all = FACTORS.into_iter();
    all.flat_map(|(factor, places)| (0..places).map(move |place| (factor, place, places)))
        .map(|(factor, place, places)| resized(factor, place, places))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::{Class, entry};
    use crate::noise::cell;

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

    /// Boards whose rows begin elsewhere than the graph's have numbers of their own.
    #[test]
    fn boards_that_begin_anywhere_are_found() {
        let model = Model::new(entry("plank").unwrap().graph().unwrap(), Some(Class::Lattice));
        let settings = model.start();
        let sizes = ["width", "length"].map(|name| model.slot(name).unwrap());
        let [width, length] = sizes.map(|at| settings.numbers()[at]);
        let random = |i: u32, of: f64| cell(f64::from(i) + 0.5, of);
        let planted = |u: f64, v: f64| {
            let row = (v / width).floor();
            [row, (u / length + (8.0 * cell(row + 0.5, 9.5)).floor() / 12.0).floor()]
        };
        let place = |i: u32| {
            let (u, v) = (4.0 * random(i, 1.5), 1.5 * random(i, 2.5));
            let [row, board] = planted(u, v);
            let tone = 0.3 + 0.3 * cell(row + 30.5, board + 40.5);
            Point { u, v, footprint: 0.002, albedo: [tone; 3], weight: 1.0 }
        };
        let points: Vec<Point> = (0..2000).map(place).collect();
        let (found, _) = boards(&model, &settings, sizes, &points);
        let share = |numbers: &[i64]| {
            let is_right = |(i, j): &(usize, usize)| {
                let same = planted(points[*i].u, points[*i].v) == planted(points[*j].u, points[*j].v);
                (numbers[*i] == numbers[*j]) == same
            };
            let pairs: Vec<(usize, usize)> = (0..300).flat_map(|i| (0..i).map(move |j| (i, j))).collect();
            pairs.iter().filter(|pair| is_right(pair)).count() as f64 / pairs.len() as f64
        };
        assert_eq!(share(&found), 1.0);
        // The twin: boards of another length.
        let mut longer = settings.clone();
        *longer.number_mut(sizes[1]) = 1.4 * length;
        assert!(share(&boards(&model, &longer, sizes, &points).0) < 0.999);
    }
}
