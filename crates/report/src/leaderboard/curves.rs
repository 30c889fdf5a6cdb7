//! Pages of charts, a series for each method and the same numbers as a table: how scores fall in views from other places
//! than the input view's, and the more the geometry that a method is given differs from the true one; and how accurate
//! methods are against how far their answers move with the light.

use std::collections::{BTreeMap, BTreeSet};

use mateval_dataset::dataset::PerturbationKind;
use mateval_dataset::dataset::WideView;
use mateval_dataset::layout::INPUT;
use mateval_dataset::{SceneId, ViewId};
use mateval_eval::metric::Metric;
use mateval_eval::result::PictureValues;
use mateval_eval::result::key::PictureName;
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::board::Board;
use super::columns::{Column, headlines, least_span};
use super::entries::is_in_curves;
use super::site::{Page, SiteWriter};
use crate::error::ReportError;
use crate::tables::ConstancyMeans;

/// Classes of the share of pixels that the input view does not show.
const SHARES: u32 = 5;
/// Size of a chart, and the margins around its lines, in its own units.
const SIZE: [f64; 2] = [320.0, 180.0];
const MARGIN: [f64; 2] = [28.0, 16.0];
/// The width and height of a point's label.
const LABEL: [f64; 2] = [12.0, 8.0];
/// The right end of the axis of accuracy: the truth's own value, 60 dB and more, would press the methods into a corner.
const MOST_ACCURATE_DB: f64 = 40.0;

pub(super) fn has_wide_views(board: &Board<'_>) -> bool {
    board.results.iter().any(|result| !result.dataset.wide_views.is_empty())
}

/// Writes the page, if any scene has wide views.
pub(super) fn write_wide_views(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    if !has_wide_views(board) {
        return Ok(());
    }
    let methods: Vec<Method<'_>> = board
        .best_first()
        .into_iter()
        .map(|at| Method {
            name: &board.heads[at].name,
            pictures: &board.scores[at].pictures,
            wide_views: &board.results[at].dataset.wide_views,
        })
        .collect();
    let scenes = methods.first().map(|method| method.wide_views);
    let sections = [
        ("By distance from the input camera", Axis::Distance),
        ("By the share of the picture that the input view does not show", Axis::UnseenShare),
    ]
    .map(|(title, axis)| Section { title: title.to_owned(), charts: charts(&methods, axis) });
    site.page(&Page {
        file: "wide_views.html",
        template: "wide_views.j2",
        title: "Wide views",
        scripts: &[],
        values: context! {
            views => scenes.map_or(0, |scenes| scenes.values().map(BTreeMap::len).sum()),
            scenes => scenes.map_or(0, BTreeMap::len),
            sections => Serde(&sections),
        },
    })
}

/// Whether any submission was made from perturbed geometry.
pub(super) fn has_perturbed(board: &Board<'_>) -> bool {
    board.results.iter().any(|result| result.submission.geometry.is_some())
}

/// Writes the page, if any submission was made from perturbed geometry.
pub(super) fn write_perturbed(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    if !has_perturbed(board) {
        return Ok(());
    }
    let sections: Vec<Section> = PerturbationKind::ALL.iter().filter_map(|kind| section(board, *kind)).collect();
    site.page(&Page {
        file: "perturbed.html",
        template: "perturbed.j2",
        title: "Imperfect geometry",
        scripts: &[],
        values: context! { sections => Serde(&sections) },
    })
}

pub(super) fn has_constancy(board: &Board<'_>) -> bool {
    board.results.iter().chain(board.ceiling).any(|result| !result.constancy.is_empty())
}

/// Writes the page, if any result has constancy.
pub(super) fn write_constancy(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    if !has_constancy(board) {
        return Ok(());
    }
    let listed = board.best_first().into_iter().map(|at| (board.heads[at].name.as_str(), &board.results[at]));
    let ceiling = board.ceiling.map(|result| (result.method.as_str(), result));
    let means: Vec<(&str, ConstancyMeans)> = listed
        .chain(ceiling)
        .filter_map(|(name, result)| Some((name, ConstancyMeans::of(&result.constancy)?)))
        .collect();
    let chart = |(title, at): (&str, usize)| {
        let points: Vec<Point<'_>> =
            means.iter().map(|(name, means)| (*name, means.mean_psnr, means.relative[at])).collect();
        let cells = |(_, means): &(&str, ConstancyMeans)| {
            let relative = means.relative[at].map(|value| format!("{value:.3}"));
            let linear = format!("{:.4}", means.linear[at]);
            let delta_e = Metric::DeltaE.style().text(means.delta_e[at]);
            vec![Some(Metric::Psnr.style().text(means.mean_psnr)), relative, Some(linear), Some(delta_e)]
        };
        Chart::of_points(title.to_owned(), &points, means.iter().map(cells).collect())
    };
    let charts = [("As answered", 0), ("Aligned", 1)].map(chart);
    let sections =
        [Section { title: "Accuracy against deviation".to_owned(), charts: charts.into_iter().flatten().collect() }];
    let families = board.results.iter().chain(board.ceiling).map(|result| result.constancy.len()).max();
    site.page(&Page {
        file: "constancy.html",
        template: "constancy.j2",
        title: "Constancy",
        scripts: &[],
        values: context! { sections => Serde(&sections), families },
    })
}

/// The charts of one kind; absent if no submission was made from such geometry.
fn section(board: &Board<'_>, kind: PerturbationKind) -> Option<Section> {
    let mut stated = board.results.iter().filter_map(|result| result.submission.geometry);
    if !stated.any(|perturbation| perturbation.kind == kind) {
        return None;
    }
    let charts: Vec<Chart> = headlines(&board.columns)
        .into_iter()
        .filter_map(|column| {
            let title = format!("{}, {}", column.title, column.metric_title);
            let level = |level| if level == 0 { "true".to_owned() } else { format!("level {level}") };
            Chart::new(title, level, &by_level(board, kind, column), column.least_span, |value| column.text(value))
        })
        .collect();
    let title = match kind {
        PerturbationKind::Pose => "Furniture that is moved and turned",
        PerturbationKind::Scale => "Furniture that is enlarged or reduced",
        PerturbationKind::Shape => "Furniture whose surface is bent",
    };
    Some(Section { title: title.to_owned(), charts })
}

/// The values of the methods that have one of this kind, by level; level 0 is the true geometry.
fn by_level<'a>(board: &'a Board<'_>, kind: PerturbationKind, column: &Column) -> Vec<Values<'a>> {
    let mut lines: Vec<Values<'_>> = Vec::new();
    for at in board.best_first() {
        let result = &board.results[at];
        let level = match result.submission.geometry {
            None => 0,
            Some(perturbation) if perturbation.kind == kind => perturbation.level,
            Some(_) => continue,
        };
        let Some(value) = board.scores[at].summary.get(&column.key) else { continue };
        let place = lines.iter().position(|(name, _)| *name == result.method).unwrap_or(lines.len());
        if place == lines.len() {
            lines.push((&result.method, BTreeMap::new()));
        }
        // Of several submissions of a method at one level, the one that the board lists first counts.
        lines[place].1.entry(level).or_insert(*value);
    }
    lines.retain(|(_, values)| values.keys().any(|level| *level > 0));
    lines
}

struct Method<'a> {
    name: &'a str,
    pictures: &'a [PictureValues],
    wide_views: &'a BTreeMap<SceneId, BTreeMap<ViewId, WideView>>,
}

/// By what views are sorted into classes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axis {
    /// Centimetres from the input camera; the input view is at 0.
    Distance,
    /// Fifths of the valid pixels that the input view does not show.
    UnseenShare,
}

/// The charts of every kind of picture and metric that wide views have values of.
fn charts(methods: &[Method<'_>], axis: Axis) -> Vec<Chart> {
    let mut kinds: Vec<(PictureName, Metric)> = Vec::new();
    let pictures = methods.iter().flat_map(|method| method.pictures);
    for picture in pictures.filter(|picture| picture.view.is_wide() && is_in_curves(picture)) {
        for metric in picture.values.keys() {
            let kind = (picture.picture, *metric);
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
    }
    kinds.into_iter().filter_map(|kind| chart(methods, axis, kind)).collect()
}

fn chart(methods: &[Method<'_>], axis: Axis, (picture, metric): (PictureName, Metric)) -> Option<Chart> {
    let means: Vec<Values<'_>> =
        methods.iter().map(|method| (method.name, means(method, axis, picture, metric))).collect();
    let title = format!("{}, {}", picture.kind.title(), metric.style().title);
    Chart::new(title, |class| class_title(axis, class), &means, least_span(metric), |value| metric.style().text(value))
}

/// The mean of a method's values in each class.
fn means(method: &Method<'_>, axis: Axis, picture: PictureName, metric: Metric) -> BTreeMap<u32, f64> {
    let mut sums: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for of_view in method.pictures.iter().filter(|values| values.picture == picture && is_in_curves(values)) {
        let (Some(class), Some(number)) = (class_of(method, axis, of_view), of_view.values.get(&metric)) else {
            continue;
        };
        let (sum, count) = sums.entry(class).or_default();
        *sum += number;
        *count += 1.0;
    }
    sums.into_iter().map(|(class, (sum, count))| (class, sum / count)).collect()
}

fn class_of(method: &Method<'_>, axis: Axis, picture: &PictureValues) -> Option<u32> {
    let wide = method.wide_views.get(&picture.scene)?;
    match (axis, wide.get(&picture.view)) {
        (Axis::Distance, Some(view)) => Some((100.0 * view.distance_m).round() as u32),
        (Axis::Distance, None) => (picture.view.as_str() == INPUT).then_some(0),
        (Axis::UnseenShare, Some(view)) => {
            Some(((f64::from(SHARES) * view.unseen_share).floor() as u32).min(SHARES - 1))
        }
        (Axis::UnseenShare, None) => None,
    }
}

fn class_title(axis: Axis, class: u32) -> String {
    match axis {
        Axis::Distance => format!("{:.2} m", f64::from(class) / 100.0),
        Axis::UnseenShare => format!("{} to {} %", 100 * class / SHARES, 100 * (class + 1) / SHARES),
    }
}

/// A chart. The heading of its classes and the text of its values are the caller's.
#[derive(Debug, PartialEq, Serialize)]
struct Chart {
    title: String,
    /// The classes of values, from left to right; of points the least and the largest accuracy.
    classes: Vec<String>,
    /// The place of each class, in units of the chart.
    columns: Vec<f64>,
    /// The heads of the columns of the table.
    heads: Vec<String>,
    /// The places of the top and bottom lines, and their values.
    scale: [(f64, String); 2],
    lines: Vec<Line>,
    /// Of points: their rows in the table, beside them; points that lie on each other share one.
    labels: Vec<([f64; 2], String)>,
}

/// The line of one method.
#[derive(Debug, PartialEq, Serialize)]
struct Line {
    name: String,
    /// Places of the points, as SVG states them.
    points: String,
    dots: Vec<[f64; 2]>,
    /// The values of all classes.
    cells: Vec<Option<String>>,
}

/// A method's accuracy in dB, and how far its answers deviate; absent where its answers have no contrast.
type Point<'a> = (&'a str, f64, Option<f64>);

/// The values of a method by class; lines have the classes' numbers as their places.
type Values<'a> = (&'a str, BTreeMap<u32, f64>);

impl Chart {
    /// Absent if there are fewer than two classes, which make no line. The axis shows at least a part of `least_span`,
    /// with the values in its middle.
    fn new(
        title: String,
        class_title: impl Fn(u32) -> String,
        methods: &[Values<'_>],
        least_span: f64,
        text: impl Fn(f64) -> String,
    ) -> Option<Self> {
        let classes: BTreeSet<u32> = methods.iter().flat_map(|(_, values)| values.keys().copied()).collect();
        if classes.len() < 2 {
            return None;
        }
        let values = || methods.iter().flat_map(|(_, values)| values.values()).copied();
        let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let margin = ((least_span - (high - low)) / 2.0).max(0.0);
        let (low, high) = (low - margin, high + margin);
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
        let titles: Vec<String> = classes.iter().map(|class| class_title(*class)).collect();
        Some(Self {
            title,
            heads: titles.clone(),
            classes: titles,
            columns: classes.iter().map(|class| column(*class)).collect(),
            scale: [high, low].map(|value| (row(value), text(value))),
            lines: methods.iter().map(line).collect(),
            labels: Vec::new(),
        })
    }

    /// A point for each method, more accurate ones on the right and more constant ones at the bottom; those without a
    /// deviation are in the table alone. Absent if there are no two points to compare.
    fn of_points(title: String, points: &[Point<'_>], cells: Vec<Vec<Option<String>>>) -> Option<Self> {
        let placed = || points.iter().filter_map(|(_, x, y)| Some((x.min(MOST_ACCURATE_DB), (*y)?)));
        if placed().count() < 2 {
            return None;
        }
        let range = |values: &dyn Fn((f64, f64)) -> f64| {
            placed().map(values).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
        };
        let ([left, right], [low, high]) = (range(&|(x, _)| x), range(&|(_, y)| y));
        let share = |value: f64, low: f64, high: f64| if high > low { (value - low) / (high - low) } else { 0.5 };
        let [width, height] = SIZE;
        let column =
            |x: f64| rounded(MARGIN[0] + share(x.min(MOST_ACCURATE_DB), left, right) * (width - 2.0 * MARGIN[0]));
        let row = |y: f64| rounded(height - MARGIN[1] - share(y, low, high) * (height - 2.0 * MARGIN[1]));
        let line = |((name, x, y), cells): (&Point<'_>, Vec<Option<String>>)| Line {
            name: (*name).to_owned(),
            points: String::new(),
            dots: y.iter().map(|y| [column(*x), row(*y)]).collect(),
            cells,
        };
        let lines: Vec<Line> = points.iter().zip(cells).map(line).collect();
        let mut labels: Vec<([f64; 2], String)> = Vec::new();
        for (number, line) in (1..).zip(&lines) {
            for dot in &line.dots {
                let near = |[x, y]: [f64; 2]| (x - dot[0]).abs() < LABEL[0] && (y - dot[1]).abs() < LABEL[1];
                match labels.iter_mut().find(|(place, _)| near(*place)) {
                    Some((_, label)) => *label += &format!(", {number}"),
                    None => labels.push((*dot, number.to_string())),
                }
            }
        }
        let accuracy = |x: f64| {
            let least = if x >= MOST_ACCURATE_DB { "≥ " } else { "" };
            format!("{least}{} dB", Metric::Psnr.style().text(x))
        };
        Some(Self {
            title,
            classes: [left, right].map(accuracy).into(),
            columns: [left, right].map(column).into(),
            heads: ["PSNR of the mean", "Relative deviation", "RMS deviation", "CIEDE2000"].map(str::to_owned).into(),
            scale: [high, low].map(|y| (row(y), format!("{y:.3}"))),
            lines,
            labels,
        })
    }
}

/// Charts under one heading.
#[derive(Serialize)]
struct Section {
    title: String,
    charts: Vec<Chart>,
}

fn rounded(place: f64) -> f64 {
    (10.0 * place).round() / 10.0
}

#[cfg(test)]
mod tests {
    use mateval_eval::metric::PictureKind;
    use mateval_eval::result::key::Region;

    use super::*;

    #[test]
    fn the_highest_is_at_the_top_and_the_first_class_on_the_left() {
        let methods = [("a", BTreeMap::from([(2, 30.0), (3, 25.0), (6, 10.0)])), ("b", BTreeMap::from([(2, 10.0)]))];
        let chart = |methods: &[Values<'_>]| {
            Chart::new("t".to_owned(), |class| class.to_string(), methods, 1.0, |v| format!("{v:.1}"))
        };
        let [width, height] = SIZE;
        let (left, right) = (MARGIN[0], width - MARGIN[0]);
        // A difference of 0.04 dB does not fill the chart.
        let alike = chart(&[("a", BTreeMap::from([(2, 30.04), (3, 30.0)]))]).unwrap();
        let middle = height / 2.0;
        assert!(alike.lines[0].dots.iter().all(|[_, y]| (y - middle).abs() < 4.0), "{alike:?}");
        assert_eq!(alike.scale.map(|(_, text)| text), ["30.5", "29.5"]);
        let chart = chart(&methods).unwrap();
        assert_eq!(chart.classes, ["2", "3", "6"]);
        assert_eq!(chart.lines[0].dots, [[left, MARGIN[1]], [left + 66.0, 53.0], [right, height - MARGIN[1]]]);
        assert_eq!(chart.lines[1].cells, [Some("10.0".to_owned()), None, None]);
        assert_eq!(chart.scale, [(MARGIN[1], "30.0".to_owned()), (height - MARGIN[1], "10.0".to_owned())]);
        let one = [("a", BTreeMap::from([(2, 30.0)]))];
        assert_eq!(Chart::new("t".to_owned(), |class| class.to_string(), &one, 1.0, |v| v.to_string()), None);
    }

    /// The best of both lies at the bottom right; what has no deviation has no point, but a row.
    #[test]
    fn points_are_placed_by_both_numbers() {
        let cells = |count: usize| vec![vec![Some("1".to_owned())]; count];
        let points =
            [("gt", 60.0, Some(0.0)), ("nn", 20.0, Some(0.5)), ("grey", 15.0, None), ("photo", 20.1, Some(0.5))];
        let chart = Chart::of_points("t".to_owned(), &points, cells(4)).unwrap();
        let [width, height] = SIZE;
        assert_eq!(chart.lines[0].dots, [[width - MARGIN[0], height - MARGIN[1]]]);
        assert_eq!(chart.lines[1].dots, [[MARGIN[0], MARGIN[1]]]);
        assert!(chart.lines[2].dots.is_empty() && chart.lines[2].cells.len() == 1);
        assert_eq!(chart.classes, ["20.00 dB", "≥ 40.00 dB"]);
        assert_eq!(chart.labels.iter().map(|(_, label)| label.as_str()).collect::<Vec<_>>(), ["1", "2, 4"]);
        let one = [("gt", 60.0, Some(0.0)), ("grey", 15.0, None)];
        assert_eq!(Chart::of_points("t".to_owned(), &one, cells(2)), None);
    }

    fn value(view: &str, number: f64) -> PictureValues {
        PictureValues {
            scene: SceneId::new("a").unwrap(),
            view: ViewId::new(view).unwrap(),
            picture: PictureName::whole(PictureKind::Albedo),
            lighting: None,
            region: Region::Valid,
            pixels: 1,
            left_out: None,
            values: BTreeMap::from([(Metric::Psnr, number)]),
            mse_error: None,
            exact: false,
            lower_bound: false,
        }
    }

    fn wide(distance_m: f64, unseen_share: f64) -> WideView {
        WideView { distance_m, unseen_share }
    }

    #[test]
    fn values_are_sorted_into_classes() {
        let pictures = [
            value("input", 40.0),
            value("up_left", 35.0),
            value("wide_1", 30.0),
            value("wide_2", 20.0),
            value("wide_3", 10.0),
        ];
        let views = [("wide_1", wide(0.3, 0.1)), ("wide_2", wide(0.3, 0.19)), ("wide_3", wide(1.0, 1.0))];
        let views = views.map(|(id, view)| (ViewId::new(id).unwrap(), view));
        let wide_views = BTreeMap::from([(SceneId::new("a").unwrap(), BTreeMap::from(views))]);
        let methods = [Method { name: "m", pictures: &pictures, wide_views: &wide_views }];
        let cells = |axis| {
            let charts = charts(&methods, axis);
            assert_eq!(charts.len(), 1);
            let cells: Vec<String> = charts[0].lines[0].cells.iter().flatten().cloned().collect();
            (charts[0].classes.clone(), cells)
        };
        let titles = |titles: &[&str]| titles.iter().map(|title| (*title).to_owned()).collect::<Vec<_>>();
        assert_eq!(
            cells(Axis::Distance),
            (titles(&["0.00 m", "0.30 m", "1.00 m"]), titles(&["40.00", "25.00", "10.00"]))
        );
        assert_eq!(cells(Axis::UnseenShare), (titles(&["0 to 20 %", "80 to 100 %"]), titles(&["25.00", "10.00"])));
    }
}
