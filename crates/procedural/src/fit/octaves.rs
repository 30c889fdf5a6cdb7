//! Sizes and shifts of rows that waves confuse: a size with its multiples and fractions.

use super::cells::cell_error;
use super::model::Model;
use super::periods::Layout;
use super::points::Point;
use crate::settings::Settings;

/// By what a size is multiplied, with the number of places where the larger cells may begin.
const FACTORS: [(f64, u32); 6] = [(0.5, 1), (2.0, 2), (1.0 / 3.0, 1), (3.0, 3), (1.5, 3), (2.0 / 3.0, 2)];

/// The number of shifts from row to row that are tried.
const SHIFTS: u32 = 80;

/// The settings with the size, or the shift of rows, that leaves the least error of cells; `None` where that is the
/// size and shift they have.
pub(super) fn better(model: &Model, layout: Layout, settings: &Settings, points: &[Point]) -> Option<Settings> {
    let before = cell_error(model, settings, points)?;
    let (axes, shift): (Vec<(&str, f64)>, Option<&str>) = match layout {
        Layout::Axes { u, v, shift, .. } => (vec![(u, 0.0), (v, 90.0)], shift),
        Layout::Rows { width, .. } => (vec![(width, 90.0)], None),
        Layout::Similar { .. } => return None,
    };
    let mut all: Vec<Settings> =
        axes.into_iter().flat_map(|(name, turn)| resized(model, settings, name, turn)).collect();
    if let Some(shift) = shift {
        all.extend(reshifted(model, settings, layout, shift));
    }
    let judged = all.into_iter().filter_map(|settings| Some((cell_error(model, &settings, points)?, settings)));
    let (error, best) = judged.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (error < before).then_some(best)
}

/// The settings with all shifts from row to row, for each length along rows: one is right only with the other. Shifts
/// add up from row to row, so that they have to be close.
fn reshifted(model: &Model, settings: &Settings, layout: Layout, shift: &str) -> Vec<Settings> {
    let Layout::Axes { u, .. } = layout else { return Vec::new() };
    let Some(length) = model.slot(u) else { return Vec::new() };
    let mut all = Vec::new();
    for factor in [1.0, 0.5, 2.0, 1.0 / 3.0] {
        for at in 0..SHIFTS {
            let mut shifted = settings.clone();
            model.set(&mut shifted, u, settings.numbers()[length] * factor);
            model.set(&mut shifted, shift, f64::from(at) / f64::from(SHIFTS));
            all.push(shifted);
        }
    }
    all
}

/// The settings with other sizes along an axis, which is at an angle in degrees to the pattern's first.
fn resized(model: &Model, settings: &Settings, name: &str, turn: f64) -> Vec<Settings> {
    let number = |name: &str| model.slot(name).map_or(0.0, |at| settings.numbers()[at]);
    let (sin, cos) = libm::sincos((number("theta") + turn).to_radians());
    let mut all = Vec::new();
    for (factor, places) in FACTORS {
        for place in 0..places {
            let along = f64::from(place) * number(name) * factor / f64::from(places);
            let mut resized = settings.clone();
            model.set(&mut resized, name, number(name) * factor);
            model.set(&mut resized, "t_u", number("t_u") + along * cos);
            model.set(&mut resized, "t_v", number("t_v") + along * sin);
            all.push(resized);
        }
    }
    all
}
