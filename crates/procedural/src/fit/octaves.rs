//! What waves confuse: a size with its multiples and fractions, shifts of rows, and whole numbers.

use super::cells::cell_error;
use super::model::Model;
use super::periods::Layout;
use super::points::Point;
use crate::settings::Settings;

/// By what a size is multiplied, with the number of places where the larger cells may begin.
const FACTORS: [(f64, u32); 6] = [(0.5, 1), (2.0, 2), (1.0 / 3.0, 1), (3.0, 3), (1.5, 3), (2.0 / 3.0, 2)];

/// The number of shifts from row to row that are tried.
const SHIFTS: u32 = 80;

/// The settings with the size, the shift of rows, or the whole number that leaves the least error of cells; `None` where
/// those are the ones they have.
pub(super) fn better(model: &Model, layout: Layout, settings: &Settings, points: &[Point]) -> Option<Settings> {
    let before = cell_error(model, settings, points)?;
    let mut all = match layout {
        Layout::Axes { u, v, shift, .. } => {
            let mut along = resized(model, settings, u, 0.0);
            if let Some(shift) = shift {
                along = along.into_iter().flat_map(|resized| same_rows(model, settings, resized, [u, shift])).collect();
                along.extend(reshifted(model, settings, shift));
            }
            along.extend(resized(model, settings, v, 90.0));
            along
        }
        Layout::Rows { width, length, .. } => {
            let mut all = resized(model, settings, width, 90.0);
            all.extend(lengthened(model, settings, length));
            all
        }
        Layout::Similar { whole: Some((name, least, most)), .. } => numbered(model, settings, name, least..=most),
        Layout::Similar { whole: None, .. } => return None,
    };
    all.retain(|tried| tried != settings);
    let judged = all.into_iter().filter_map(|settings| Some((cell_error(model, &settings, points)?, settings)));
    let (error, best) = judged.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (error < before).then_some(best)
}

/// The settings with other lengths of boards, about which no wave says anything.
fn lengthened(model: &Model, settings: &Settings, length: &str) -> Vec<Settings> {
    let Some(at) = model.slot(length) else { return Vec::new() };
    let with_length = |step: i32| {
        let mut lengthened = settings.clone();
        model.set(&mut lengthened, length, settings.numbers()[at] * libm::exp(0.1 * f64::from(step)));
        lengthened
    };
    (-12..=8).map(with_length).collect()
}

/// The settings with every value of a whole number.
fn numbered(model: &Model, settings: &Settings, name: &str, range: std::ops::RangeInclusive<i32>) -> Vec<Settings> {
    let with_number = |number: i32| {
        let mut numbered = settings.clone();
        model.set(&mut numbered, name, f64::from(number));
        numbered
    };
    range.map(with_number).collect()
}

/// The settings with all shifts from row to row. Shifts add up, so that they have to be close.
fn reshifted(model: &Model, settings: &Settings, shift: &str) -> Vec<Settings> {
    let shifted = |at: u32| {
        let mut shifted = settings.clone();
        model.set(&mut shifted, shift, f64::from(at) / f64::from(SHIFTS));
        shifted
    };
    (0..SHIFTS).map(shifted).collect()
}

/// Settings of another length with the shifts from row to row that leave every row where it was: up to one of the
/// former lengths.
fn same_rows(model: &Model, before: &Settings, resized: Settings, [length, shift]: [&str; 2]) -> Vec<Settings> {
    let (Some(length_at), Some(shift_at)) = (model.slot(length), model.slot(shift)) else { return Vec::new() };
    let factor = resized.numbers()[length_at] / before.numbers()[length_at].max(1e-12);
    let with_shift = |lengths: u32| {
        let share = (before.numbers()[shift_at] + f64::from(lengths)) / factor.max(1e-12);
        let mut shifted = resized.clone();
        model.set(&mut shifted, shift, share - share.floor());
        shifted
    };
    (0..factor.ceil().clamp(1.0, 3.0) as u32).map(with_shift).collect()
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
