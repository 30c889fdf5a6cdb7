//! Shows the counts: as tables, and as an SVG chart with one bar per category, grouped by super-category, and a
//! histogram of the number of objects per scene; or, for two datasets, with the histograms of both looks. Numbers are
//! rounded here; the JSON has all digits.
//!
//! Positions and texts of the chart are computed here; the template `picture.j2` turns them into markup and escapes
//! every name. The same counts give the same bytes.

use mateval_dataset::Severity;
use mateval_dataset::dataset::{DatasetVersion, SUPER_CATEGORIES};
use mateval_dataset::ids::counted;
use mateval_dataset::progress::{Table, row};
use mateval_files::untrusted::shown;
use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior};
use serde::Serialize;

use super::look::{self, Beside, LookStats, Pair};
use super::{CategoryCount, Counts, SceneStats, Spread, StatsFile, SuperCategoryCount};

/// Length of the longest name that is printed in full, in characters.
const LONGEST_CELL: usize = 60;

/// Headings of the columns of the eight super-categories, in their order.
const HEADS: [&str; 8] = ["cabinet", "sofa", "lighting", "chair", "others", "bed", "table", "stool"];

/// All tables, for a terminal of `columns`; of any width if absent. Table I comes first, with the paper's headings.
pub fn text(stats: &StatsFile, columns: Option<usize>) -> String {
    let look = stats.look.iter().map(|look| look::table(look, stats.beside.as_ref()));
    let tables = [table_one(stats), further_counts(stats)].into_iter().chain(look).chain([
        super_categories(&stats.total),
        categories(&stats.total),
        findings(&stats.total),
        scenes(stats),
        scenes_by_super_category(stats),
    ]);
    tables.map(|table| table.text(columns)).collect::<Vec<_>>().join("\n")
}

fn table_one(stats: &StatsFile) -> Table {
    let mut rows = vec![row(["", "", "min", "max", "scenes"])];
    rows.push(row(["Number of scenes", &stats.scenes.to_string()]));
    rows.push(spread_row("Avg. Objects/Scene", stats.objects_per_scene));
    rows.push(spread_row("Avg. Categories/Scene", stats.super_categories_per_scene));
    let [name, version] = [&stats.dataset.name, &stats.dataset.version].map(|word| shown(word, LONGEST_CELL));
    Table { title: format!("Table I of the paper, for {name} {version}"), words: 1, rows }
}

fn spread_row(name: &str, spread: Option<Spread>) -> Vec<String> {
    match spread {
        Some(Spread { scenes, mean, min, max }) => {
            row([name, &format!("{mean:.1}"), &min.to_string(), &max.to_string(), &scenes.to_string()])
        }
        None => row([name, "unknown"]),
    }
}

fn further_counts(stats: &StatsFile) -> Table {
    let total = &stats.total;
    let mut rows = vec![row(["", "", "min", "max", "scenes"]), row(["houses", &stats.houses.to_string()])];
    let kinds = stats.source_kinds.iter();
    rows.extend(kinds.map(|kind| row([&format!("scenes of {}", kind.kind), &kind.scenes.to_string()])));
    rows.push(row(["instances", &total.instances.to_string()]));
    rows.push(row(["  with an atlas", &total.instances_with_atlas.to_string()]));
    let unstated = [
        ("base colour", total.unstated.base_color),
        ("roughness", total.unstated.roughness),
        ("metallic", total.unstated.metallic),
    ];
    for (name, count) in unstated.into_iter().filter(|(_, count)| *count > 0) {
        rows.push(row([&format!("    that do not state {name}"), &count.to_string()]));
    }
    rows.push(row(["  objects", &total.objects.to_string()]));
    rows.push(row(["  architecture", &total.architecture.to_string()]));
    rows.push(row(["  others", &total.others.to_string()]));
    rows.push(row(["different categories", &total.different_categories().to_string()]));
    rows.push(spread_row("  avg. per scene", stats.categories_per_scene));
    Table { title: "Further counts".to_owned(), words: 1, rows }
}

fn super_categories(total: &Counts) -> Table {
    let mut rows = vec![row(["super-category", "objects", "share"])];
    rows.extend(total.super_categories.iter().map(|found| {
        let share = found.share.map_or_else(|| "none".to_owned(), |share| format!("{:.1} %", 100.0 * share));
        let other_word = found.super_category.as_deref().is_some_and(|word| !SUPER_CATEGORIES.contains(&word));
        let mark = if other_word { " (not of the eight)" } else { "" };
        row([&(word_or_none(&found.super_category) + mark), &found.objects.to_string(), &share])
    }));
    Table { title: "Objects by super-category".to_owned(), words: 1, rows }
}

fn categories(total: &Counts) -> Table {
    let mut rows = vec![row(["super-category", "category", "objects"])];
    rows.extend(total.categories.iter().map(|found| {
        let words = [&found.super_category, &found.category].map(word_or_none);
        row([&words[0], &words[1], &found.objects.to_string()])
    }));
    Table { title: "Objects by category".to_owned(), words: 2, rows }
}

/// A category or super-category, or `(none)`.
fn word_or_none(word: &Option<String>) -> String {
    word.as_ref().map_or_else(|| "(none)".to_owned(), |word| shown(word, LONGEST_CELL))
}

fn findings(total: &Counts) -> Table {
    let mut rows = vec![row(["severity", "code", "findings"])];
    rows.extend(
        total.findings.iter().map(|found| {
            row([&found.severity.to_string(), &shown(&found.code, LONGEST_CELL), &found.count.to_string()])
        }),
    );
    Table { title: "Findings about the sources".to_owned(), words: 2, rows }
}

fn scenes(stats: &StatsFile) -> Table {
    let head =
        ["scene", "source", "house", "objects", "super-categories", "categories", "architecture", "others", "atlases"];
    let mut rows = vec![row(head)];
    rows[0].extend(["errors", "warnings", "notes"].map(str::to_owned));
    rows.extend(stats.per_scene.iter().map(|scene| {
        let counts = &scene.counts;
        let words =
            [scene.scene.as_str(), &scene.source_kind.to_string(), &scene.house].map(|word| shown(word, LONGEST_CELL));
        let objects = [counts.objects, counts.different_super_categories(), counts.different_categories()];
        let objects = objects.map(|number| known(scene, number));
        let numbers = [
            counts.architecture,
            counts.others,
            counts.instances_with_atlas,
            counts.findings_of(Severity::Error),
            counts.findings_of(Severity::Warning),
            counts.findings_of(Severity::Note),
        ];
        words.into_iter().chain(objects).chain(numbers.map(|number| number.to_string())).collect()
    }));
    Table { title: "Scenes".to_owned(), words: 3, rows }
}

/// One column for each of the eight super-categories. All other objects share a last column, which exists only where
/// there are any.
fn scenes_by_super_category(stats: &StatsFile) -> Table {
    let has_more = stats.total.super_categories.len() > SUPER_CATEGORIES.len();
    let mut rows = vec![row(["scene"])];
    rows[0].extend(HEADS.map(str::to_owned));
    rows[0].extend(has_more.then(|| "not of the eight".to_owned()));
    rows.extend(stats.per_scene.iter().map(|scene| {
        let objects = scene.counts.super_categories.iter().map(|found| found.objects);
        let eight = objects.clone().take(SUPER_CATEGORIES.len());
        let more = has_more.then(|| objects.skip(SUPER_CATEGORIES.len()).sum());
        let numbers = eight.chain(more).map(|number| known(scene, number));
        std::iter::once(scene.scene.to_string()).chain(numbers).collect()
    }));
    Table { title: "Objects by scene and super-category".to_owned(), words: 1, rows }
}

/// A number of objects or of their categories; `?` where the scene does not state which instances are objects.
fn known(scene: &SceneStats, number: usize) -> String {
    if scene.knows_its_objects() { number.to_string() } else { "?".to_owned() }
}

const TEMPLATE: &str = include_str!("picture.j2");

/// Largest number of rows drawn. No real dataset needs more.
const MOST_ROWS: usize = 200;
/// Largest number of columns of the histogram.
const MOST_COLUMNS: usize = 10;
/// Length of the longest name that fits on a line, in characters.
const LONGEST_LABEL: usize = 50;

// Lengths are in the chart's units, which are pixels where it is shown at its natural size.
const WIDTH: f64 = 480.0;
const MARGIN: f64 = 20.0;
const INNER: f64 = WIDTH - 2.0 * MARGIN;
/// Distance from a line to the heading of the next group.
const GROUP: f64 = 40.0;
/// Distance from a heading or a bar to the next bar.
const BAR: f64 = 30.0;
const COLUMNS_HEIGHT: f64 = 90.0;

/// All values that the template needs. Lengths are text, so that their digits are fixed.
#[derive(Serialize)]
struct Drawing {
    width: String,
    height: String,
    left: String,
    right: String,
    inner: String,
    title: String,
    subtitle: String,
    rows: Vec<Row>,
    columns: Vec<Column>,
    /// Positions of the axes of histograms.
    axes: Vec<String>,
    lines: Vec<Line>,
}

/// A line of text, with a bar beneath it where it shows a category.
#[derive(Serialize)]
struct Row {
    class: &'static str,
    x: String,
    y: String,
    name: String,
    value: String,
    bar: Option<Bar>,
}

#[derive(Serialize)]
struct Bar {
    y: String,
    length: String,
}

/// A column of the histogram: the number of scenes whose number of objects is in the label's range.
#[derive(Serialize)]
struct Column {
    x: String,
    y: String,
    width: String,
    height: String,
    middle: String,
    label_y: String,
    label: String,
    value_y: String,
    value: String,
}

/// A histogram's outline, or its sample in the legend.
#[derive(Serialize)]
struct Line {
    class: &'static str,
    path: String,
}

/// The chart as SVG: of both looks if the counts have another dataset's beside their own. It has its own background,
/// light or dark as the reader's system prefers.
pub fn picture(stats: &StatsFile) -> String {
    let drawing = match (&stats.look, &stats.beside) {
        (Some(look), Some(beside)) => drawing_of_looks(&stats.dataset, look, beside),
        _ => drawing(stats),
    };
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    // The extension `.xml` turns escaping on.
    environment
        .render_named_str("picture.xml", TEMPLATE, Serde(&drawing))
        .expect("the template uses only values that `Drawing` has")
}

fn drawing(stats: &StatsFile) -> Drawing {
    let mut y = 58.0;
    let mut rows = category_rows(stats, &mut y);
    y += GROUP + 4.0;
    rows.push(text_row("group", y, "Objects a scene", mean_text(stats)));
    y += 20.0;
    rows.push(text_row("quiet", y, &histogram_subtitle(stats), String::new()));
    let known = stats.per_scene.iter().filter(|scene| scene.knows_its_objects());
    let objects: Vec<usize> = known.map(|scene| scene.counts.objects).collect();
    let axis_y = (!objects.is_empty()).then_some(y + 32.0 + COLUMNS_HEIGHT);
    Drawing {
        width: number(WIDTH),
        height: number(axis_y.map_or(y, |axis_y| axis_y + 18.0) + MARGIN),
        left: number(MARGIN),
        right: number(WIDTH - MARGIN),
        inner: number(INNER),
        title: label(&stats.dataset),
        subtitle: subtitle(stats),
        rows,
        columns: axis_y.map_or_else(Vec::new, |axis_y| columns(&objects, axis_y)),
        axes: axis_y.map(number).into_iter().collect(),
        lines: Vec::new(),
    }
}

/// A dataset's name and version.
fn label(dataset: &DatasetVersion) -> String {
    let [name, version] = [&dataset.name, &dataset.version].map(|word| shown(word, LONGEST_LABEL / 2));
    format!("{name} {version}")
}

/// One panel per quantity, with the histograms of both datasets as outlines of one scale.
fn drawing_of_looks(dataset: &DatasetVersion, look: &LookStats, beside: &Beside) -> Drawing {
    let mut y = 60.0;
    let (mut rows, mut lines, mut axes) = (Vec::new(), Vec::new(), Vec::new());
    for (class, name) in [("own", label(dataset)), ("other", label(&beside.dataset) + " (original)")] {
        y += 20.0;
        lines.push(Line { class, path: format!("M{} {}h24", number(MARGIN), number(y - 4.0)) });
        rows.push(Row { x: number(MARGIN + 32.0), ..text_row("name", y, &name, String::new()) });
    }
    for Pair { name, own, other, distance } in look.pairs(&beside.look) {
        y += GROUP;
        let distance = distance.map_or_else(|| "no values".to_owned(), |distance| format!("distance {distance:.3}"));
        rows.push(text_row("group", y, name, distance));
        y += COLUMNS_HEIGHT + 12.0;
        axes.push(number(y));
        let most = own.histogram.iter().chain(&other.histogram).copied().fold(f64::MIN_POSITIVE, f64::max);
        for (class, histogram) in [("own", &own.histogram), ("other", &other.histogram)] {
            lines.push(Line { class, path: outline(histogram, most, y) });
        }
        y += 16.0;
        rows.push(text_row("quiet", y, "0", (own.bin * own.histogram.len() as f64).to_string()));
    }
    let views = counted(look.views, "input view");
    Drawing {
        width: number(WIDTH),
        height: number(y + MARGIN),
        left: number(MARGIN),
        right: number(WIDTH - MARGIN),
        inner: number(INNER),
        title: "True albedo, side by side".to_owned(),
        subtitle: format!("{views} and {} of the original; heights are shares", beside.look.views),
        rows,
        columns: Vec::new(),
        axes,
        lines,
    }
}

/// The steps of a histogram that stands on `axis_y`; the share `most` has the full height.
fn outline(histogram: &[f64], most: f64, axis_y: f64) -> String {
    let pitch = INNER / histogram.len() as f64;
    let steps = histogram.iter().enumerate().map(|(at, share)| {
        let [x, y] = [MARGIN + pitch * (at + 1) as f64, axis_y - COLUMNS_HEIGHT * share / most].map(number);
        format!("V{y}H{x}")
    });
    let [x, y] = [MARGIN, axis_y].map(number);
    format!("M{x} {y}{}V{y}", steps.collect::<String>())
}

fn subtitle(stats: &StatsFile) -> String {
    let objects = several(stats.total.objects, "object", "objects");
    let categories = several(stats.total.different_categories(), "category", "categories");
    format!("{objects} of {categories} in {}", several(stats.scenes, "scene", "scenes"))
}

fn mean_text(stats: &StatsFile) -> String {
    stats.objects_per_scene.map_or_else(|| "unknown".to_owned(), |spread| format!("mean {:.1}", spread.mean))
}

fn histogram_subtitle(stats: &StatsFile) -> String {
    let Some(Spread { scenes, .. }) = stats.objects_per_scene else {
        return "no scene states which instances are objects".to_owned();
    };
    let known = several(scenes, "scene", "scenes");
    match stats.scenes - scenes {
        0 => format!("{known} by number of objects"),
        1 => format!("{known} by number of objects; unknown for 1 more"),
        more => format!("{known} by number of objects; unknown for {more} more"),
    }
}

fn several(count: usize, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

/// A heading for each super-category, and its categories beneath it. Rows beyond the limit are only counted. Moves `y`
/// to the last row.
fn category_rows(stats: &StatsFile, y: &mut f64) -> Vec<Row> {
    let total = &stats.total;
    let most = total.categories.iter().map(|found| found.objects).max().unwrap_or(1);
    let mut rows = Vec::new();
    for group in &total.super_categories {
        if rows.len() >= MOST_ROWS {
            break;
        }
        *y += GROUP;
        let name = group
            .super_category
            .as_deref()
            .map_or_else(|| "(no super-category)".to_owned(), |name| shown(name, LONGEST_LABEL));
        rows.push(text_row("group", *y, &name, group_value(group)));
        let of_group = total.categories.iter().filter(|found| found.super_category == group.super_category);
        for category in of_group.take(MOST_ROWS - rows.len()) {
            *y += BAR;
            rows.push(bar_row(*y, category, most));
        }
    }
    let left_out = total.super_categories.len() + total.categories.len() - rows.len();
    if left_out > 0 {
        *y += BAR;
        rows.push(text_row("quiet", *y, &format!("and {left_out} more rows"), String::new()));
    }
    rows
}

fn group_value(group: &SuperCategoryCount) -> String {
    match group.share {
        Some(share) if group.objects > 0 => format!("{} · {:.1} %", group.objects, 100.0 * share),
        _ => group.objects.to_string(),
    }
}

fn text_row(class: &'static str, y: f64, name: &str, value: String) -> Row {
    Row { class, x: number(MARGIN), y: number(y), name: name.to_owned(), value, bar: None }
}

fn bar_row(y: f64, category: &CategoryCount, most: usize) -> Row {
    let name =
        category.category.as_deref().map_or_else(|| "(no category)".to_owned(), |name| shown(name, LONGEST_LABEL));
    let length = INNER * category.objects as f64 / most as f64;
    let bar = Some(Bar { y: number(y + 5.0), length: number(length.max(1.0)) });
    Row { bar, ..text_row("name", y, &name, category.objects.to_string()) }
}

/// The histogram, whose columns stand on `axis_y`.
fn columns(objects: &[usize], axis_y: f64) -> Vec<Column> {
    let bins = bins(objects);
    let most = bins.iter().map(|bin| bin.scenes).max().unwrap_or(1).max(1);
    let pitch = INNER / MOST_COLUMNS as f64;
    // A few columns are centred and as narrow as many.
    let start = MARGIN + (INNER - pitch * bins.len() as f64) / 2.0;
    let column = |(at, bin): (usize, &Bin)| {
        let x = start + pitch * at as f64;
        let height = COLUMNS_HEIGHT * bin.scenes as f64 / most as f64;
        Column {
            x: number(x + 2.0),
            y: number(axis_y - height),
            width: number(pitch - 4.0),
            height: number(height),
            middle: number(x + pitch / 2.0),
            label_y: number(axis_y + 16.0),
            label: bin.label(),
            value_y: number(axis_y - height - 5.0),
            value: bin.scenes.to_string(),
        }
    };
    bins.iter().enumerate().map(column).collect()
}

/// The number of scenes with `first` to `last` objects.
#[derive(Debug, PartialEq, Eq)]
struct Bin {
    first: usize,
    last: usize,
    scenes: usize,
}

impl Bin {
    fn label(&self) -> String {
        if self.first == self.last { self.first.to_string() } else { format!("{}–{}", self.first, self.last) }
    }
}

/// Bins from the smallest to the largest value. Their width is the smallest of 1, 2, 5, 10, 20, ... that needs no more
/// than [`MOST_COLUMNS`] bins.
fn bins(values: &[usize]) -> Vec<Bin> {
    let (Some(min), Some(max)) = (values.iter().min(), values.iter().max()) else { return Vec::new() };
    let widths = (0..u32::MAX).flat_map(|power| [1, 2, 5].map(|digit| digit * 10_usize.saturating_pow(power)));
    let fits = |width: &usize| max / width - min / width < MOST_COLUMNS;
    let width = widths.into_iter().find(fits).expect("a width above the largest value needs one column");
    (min / width..=max / width)
        .map(|at| Bin {
            first: at * width,
            last: at * width + (width - 1),
            scenes: values.iter().filter(|value| **value / width == at).count(),
        })
        .collect()
}

/// A length as text, with at most one digit after the point.
fn number(value: f64) -> String {
    let text = format!("{value:.1}");
    text.strip_suffix(".0").map_or_else(|| text.clone(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_in_one_bin() {
        for largest in [0, 1, 9, 10, 19, 20, 137, 99_999] {
            let values: Vec<usize> = (0..50).map(|k| largest * k / 49).collect();
            let bins = bins(&values);
            assert!((1..=MOST_COLUMNS).contains(&bins.len()), "{bins:?}");
            assert_eq!(bins.iter().map(|bin| bin.scenes).sum::<usize>(), values.len());
            assert!(bins.windows(2).all(|pair| pair[0].last + 1 == pair[1].first), "{bins:?}");
        }
        assert_eq!(bins(&[]), []);
    }

    /// 3 to 21 objects, as in the rooms of ATISS: bins of two.
    #[test]
    fn bins_are_as_narrow_as_possible() {
        let bins = bins(&[3, 7, 8, 21]);
        let [first, last] = [&bins[0], &bins[bins.len() - 1]].map(|bin| (bin.first, bin.last, bin.scenes));
        assert_eq!((bins.len(), first, last), (10, (2, 3, 1), (20, 21, 1)));
        assert_eq!(bins[0].label(), "2–3");
    }
}
