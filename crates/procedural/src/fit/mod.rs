//! The fit of graphs to what is seen of one part.
//!
//! In: colours at places of a part's surface, in metres ([`Point`]), and perhaps the category of the thing.
//! Out: the graph that explains them best, with its settings, or `paint` where none is better than one colour
//! ([`choose::Fitter`]). A [`candidate::Candidate`] shows its colours anywhere, with as much of what is random as
//! wanted.
//!
//! 1. Shading that is left is taken away, and a quarter of the points is held out.
//! 2. Periodic graphs: the strongest waves of the colours (`waves`), and those that stand out against waves of similar
//!    period, suggest turns, periods and shifts. Those whose waves agree best are judged by colours, which are a linear
//!    least squares problem. Cells such as tiles have random tones, and rows of boards begin anywhere. The most
//!    promising patterns are searched for the place of their cells and polished by Levenberg-Marquardt steps; sizes are
//!    then compared with their multiples and fractions.
//! 3. What is random, in all graphs: sizes, amplitudes and scattered colours are those whose statistics, from the same
//!    points and footprints, come closest to those seen: structure functions over distances and directions, their
//!    sparseness and asymmetry, quantiles and chromaticity. Its phase cannot be known. Textures are left out where a
//!    periodic graph is surely better.
//! 4. The choice.
//!
//! [`paper`] fits as PSDR-Room does, to be compared with.

pub mod candidate;
mod cells;
pub mod choose;
mod least_squares;
pub mod model;
pub mod paper;
mod starts;
mod statistics;
mod texture;
mod waves;

use crate::error::ProceduralError;
use crate::noise::cell;

/// A place of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// First coordinate in metres.
    pub u: f64,
    /// Second coordinate in metres.
    pub v: f64,
    /// Extent of its pixel in metres.
    pub footprint: f64,
    /// Linear colour.
    pub albedo: [f64; 3],
    /// How much the colour is trusted, relative to other points.
    pub weight: f64,
}

impl Point {
    /// Whether it can be used: finite, with a colour, a footprint and a weight above 0.
    pub fn is_sound(&self) -> bool {
        let finite = self.u.is_finite() && self.v.is_finite() && self.albedo.iter().all(|c| c.is_finite() && *c >= 0.0);
        let positive = |x: f64| x.is_finite() && x > 0.0;
        finite && positive(self.footprint) && positive(self.weight)
    }

    /// The mean of the channels.
    pub(crate) fn grey(&self) -> f64 {
        self.albedo.iter().sum::<f64>() / 3.0
    }
}

/// The share of blocks that the fit does not see.
const HELD_OUT: f64 = 0.25;

/// The side of a block, in footprints.
const BLOCK: f64 = 16.0;

/// Points to fit to, and points to judge the fit by: whole blocks of the surface, so that neighbours of a point do not
/// give it away. The order of the points is kept.
pub fn split(points: &[Point]) -> (Vec<Point>, Vec<Point>) {
    let side = BLOCK * median(points.iter().map(|point| point.footprint).collect());
    points.iter().partition(|point| cell(point.u / side, point.v / side) >= HELD_OUT)
}

/// The points that can be used. Fails where there are none.
fn sound(points: &[Point]) -> Result<Vec<Point>, ProceduralError> {
    let sound: Vec<Point> = points.iter().filter(|point| point.is_sound()).copied().collect();
    let expected = "points with finite places, colours from 0 up, and footprints and weights above 0";
    match sound.is_empty() {
        true => Err(ProceduralError::Unusable(format!("cannot fit a graph: expected {expected}"))),
        false => Ok(sound),
    }
}

/// The middle number; 0 where there are none.
pub(crate) fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}

/// Every n-th point, so that at most `most` remain.
pub(crate) fn thinned(points: &[Point], most: usize) -> Vec<Point> {
    let step = points.len().div_ceil(most).max(1);
    points.iter().step_by(step).copied().collect()
}

/// The lengths of the smallest upright rectangle around the points.
pub(crate) fn extent(points: &[Point]) -> [f64; 2] {
    let range = |of: fn(&Point) -> f64| {
        let (least, most) = points.iter().map(of).fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        (most - least).max(0.0)
    };
    [range(|point| point.u), range(|point| point.v)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_of_the_blocks_is_held_out() {
        let at = |i: u32| Point {
            u: f64::from(i % 200) * 0.01,
            v: f64::from(i / 200) * 0.01,
            footprint: 0.005,
            albedo: [0.5; 3],
            weight: 1.0,
        };
        let points: Vec<Point> = (0..40_000).map(at).collect();
        let (fit, held) = split(&points);
        assert_eq!(fit.len() + held.len(), points.len());
        let share = held.len() as f64 / points.len() as f64;
        assert!((share - HELD_OUT).abs() < 0.05, "{share}");
        // Points of one block are on one side.
        let near = |a: &Point, b: &Point| cell(a.u / 0.08, a.v / 0.08) == cell(b.u / 0.08, b.v / 0.08);
        assert!(!held.iter().any(|point| fit.iter().take(2000).any(|other| near(point, other))));
    }

    #[test]
    fn unsound_points_are_known() {
        let good = Point { u: 0.0, v: 0.0, footprint: 0.01, albedo: [0.5; 3], weight: 1.0 };
        assert!(good.is_sound());
        for bad in [
            Point { u: f64::NAN, ..good },
            Point { footprint: 0.0, ..good },
            Point { albedo: [0.5, -0.1, 0.5], ..good },
            Point { weight: f64::INFINITY, ..good },
        ] {
            assert!(!bad.is_sound(), "{bad:?}");
        }
    }
}
