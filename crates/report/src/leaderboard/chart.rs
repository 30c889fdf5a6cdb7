//! A chart with a line for each method, and the same numbers as a table.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

/// A chart. The heading of its classes and the text of its values are the caller's.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Chart {
    pub(super) title: String,
    /// The classes of values, from left to right.
    pub(super) classes: Vec<String>,
    /// The place of each class, in units of the chart.
    columns: Vec<f64>,
    /// The places of the top and bottom lines, and their values.
    scale: [(f64, String); 2],
    pub(super) lines: Vec<Line>,
}

/// The line of one method.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Line {
    name: String,
    /// Places of the points, as SVG states them.
    points: String,
    dots: Vec<[f64; 2]>,
    /// The values of all classes.
    pub(super) cells: Vec<Option<String>>,
}

/// The values of a method by class; lines have the classes' numbers as their places.
pub(super) type Values<'a> = (&'a str, BTreeMap<u32, f64>);

/// Size of a chart, and the margins around its lines, in its own units.
const SIZE: [f64; 2] = [320.0, 180.0];
const MARGIN: [f64; 2] = [28.0, 16.0];

impl Chart {
    /// None where there are fewer than two classes, which make no line.
    pub(super) fn new(
        title: String,
        class_title: impl Fn(u32) -> String,
        methods: &[Values<'_>],
        text: impl Fn(f64) -> String,
    ) -> Option<Self> {
        let classes: BTreeSet<u32> = methods.iter().flat_map(|(_, values)| values.keys().copied()).collect();
        if classes.len() < 2 {
            return None;
        }
        let values = || methods.iter().flat_map(|(_, values)| values.values()).copied();
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let [width, height] = SIZE;
        let (first, last) = (*classes.first()?, *classes.last()?);
        let column = |class: u32| {
            let share = f64::from(class - first) / f64::from(last - first);
            rounded(MARGIN[0] + share * (width - 2.0 * MARGIN[0]))
        };
        let row = |value: f64| {
            let share = if high > low { (high - value) / (high - low) } else { 0.5 };
            rounded(MARGIN[1] + share * (height - 2.0 * MARGIN[1]))
        };
        let line = |(name, values): &Values<'_>| {
            let dots: Vec<[f64; 2]> = values.iter().map(|(class, value)| [column(*class), row(*value)]).collect();
            Line {
                name: (*name).to_owned(),
                points: dots.iter().map(|[x, y]| format!("{x},{y}")).collect::<Vec<_>>().join(" "),
                dots,
                cells: classes.iter().map(|class| Some(text(*values.get(class)?))).collect(),
            }
        };
        Some(Self {
            title,
            classes: classes.iter().map(|class| class_title(*class)).collect(),
            columns: classes.iter().map(|class| column(*class)).collect(),
            scale: [high, low].map(|value| (row(value), text(value))),
            lines: methods.iter().map(line).collect(),
        })
    }
}

/// Charts under one heading.
#[derive(Serialize)]
pub(super) struct Section {
    pub(super) title: String,
    pub(super) charts: Vec<Chart>,
}

fn rounded(place: f64) -> f64 {
    (10.0 * place).round() / 10.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_is_at_the_top_and_the_first_class_on_the_left() {
        let methods = [("a", BTreeMap::from([(2, 30.0), (3, 25.0), (6, 10.0)])), ("b", BTreeMap::from([(2, 10.0)]))];
        let chart = Chart::new("t".to_owned(), |class| class.to_string(), &methods, |v| format!("{v:.1}")).unwrap();
        assert_eq!(chart.classes, ["2", "3", "6"]);
        let [width, height] = SIZE;
        let (left, right) = (MARGIN[0], width - MARGIN[0]);
        assert_eq!(chart.lines[0].dots, [[left, MARGIN[1]], [left + 66.0, 53.0], [right, height - MARGIN[1]]]);
        assert_eq!(chart.lines[1].cells, [Some("10.0".to_owned()), None, None]);
        assert_eq!(chart.scale, [(MARGIN[1], "30.0".to_owned()), (height - MARGIN[1], "10.0".to_owned())]);
        let one = [("a", BTreeMap::from([(2, 30.0)]))];
        assert_eq!(Chart::new("t".to_owned(), |class| class.to_string(), &one, |v| v.to_string()), None);
    }
}
