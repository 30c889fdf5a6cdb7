//! A periodic graph with its own waves, which do not depend on what is seen.

use super::model::Model;
use super::periods::Layout;
use super::points::Point;
use super::waves::{Wave, waves};
use crate::noise::cell::cell;
use crate::settings::Settings;

/// The number of its own waves that are kept.
const WAVES: usize = 8;

/// A graph that is ready to be fitted.
pub(super) struct Pattern {
    pub(super) model: Model,
    pub(super) layout: Layout,
    /// For a pattern of one length: for each value of its whole number, settings without a turn and their waves.
    pub(super) own: Vec<(Settings, Vec<Wave>)>,
}

impl Pattern {
    pub(super) fn new(model: Model, layout: Layout) -> Self {
        let own = match layout {
            Layout::Similar { length, whole } => own(&model, length, whole),
            Layout::Axes { .. } | Layout::Rows { .. } => Vec::new(),
        };
        Self { model, layout, own }
    }
}

fn own(model: &Model, length: &str, whole: Option<(&str, i32, i32)>) -> Vec<(Settings, Vec<Wave>)> {
    let mut start = model.start();
    model.set(&mut start, "theta", 0.0);
    // Squares of strips have lines that are closer than their side.
    let across = if whole.is_some_and(|(name, ..)| name == "strips") { 6.0 } else { 20.0 };
    let side = across * model.slot(length).map_or(1.0, |at| start.numbers()[at]);
    let with_waves = |settings: Settings| {
        let found = waves(&model.shown(&settings, &scattered(side)), WAVES);
        (settings, found)
    };
    let Some((name, least, most)) = whole else { return vec![with_waves(start)] };
    let numbered = (least..=most).map(|number| {
        let mut settings = start.clone();
        model.set(&mut settings, name, f64::from(number));
        with_waves(settings)
    });
    numbered.collect()
}

/// Places scattered over a square.
fn scattered(side: f64) -> Vec<Point> {
    let place = |i: u32| Point {
        u: side * cell(f64::from(i) + 0.5, 0.5),
        v: side * cell(f64::from(i) + 0.5, 1.5),
        footprint: side / 160.0,
        albedo: [0.0; 3],
        weight: 1.0,
    };
    (0..3000).map(place).collect()
}
