//! A search for the place of cells. Thin joints show a polish no way to their place from farther than their width, but
//! the more of a cell is in place, the more alike its points are.

use super::cells::cell_error;
use super::model::Model;
use super::periods::Layout;
use super::points::{Point, extent};
use crate::settings::Settings;

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

/// Moves, turns and scales the cells as long as that makes the points of a cell more alike. Nothing where a graph has no
/// cells.
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
        let number = |name: &str| model.slot(name).map_or(0.0, |at| settings.numbers()[at]);
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
        let turn = model.slot("theta").map_or(0.0, |at| moved.numbers()[at]);
        let (sin, cos) = libm::sincos(turn.to_radians());
        model.set(&mut moved, "t_u", self.middle[0] - (place[0] * cos - place[1] * sin));
        model.set(&mut moved, "t_v", self.middle[1] - (place[0] * sin + place[1] * cos));
        moved
    }
}
