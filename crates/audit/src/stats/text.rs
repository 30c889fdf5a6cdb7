//! Prints the counts as tables. Numbers are rounded here; the JSON has all digits.

use mateval_scene::Severity;
use mateval_scene::text_table::{Table, row};

use mateval_scene::super_categories::SUPER_CATEGORIES;

use super::{Counts, SceneStats, Spread, StatsFile, shown};

/// Length of the longest name that is printed in full, in characters.
const LONGEST: usize = 60;

/// Headings of the columns of the eight super-categories, in their order.
const HEADS: [&str; 8] = ["cabinet", "sofa", "lighting", "chair", "others", "bed", "table", "stool"];

/// All tables. Table I comes first, with the paper's headings.
pub fn text(stats: &StatsFile) -> String {
    let tables = [
        table_one(stats),
        beside(stats),
        super_categories(&stats.total),
        categories(&stats.total),
        findings(&stats.total),
        scenes(stats),
        scenes_by_super_category(stats),
    ];
    tables.map(|table| table.text()).join("\n")
}

fn table_one(stats: &StatsFile) -> Table {
    let mut rows = vec![row(["", "", "min", "max", "scenes"])];
    rows.push(row(["Number of scenes", &stats.scenes.to_string()]));
    rows.push(spread_row("Avg. Objects/Scene", stats.objects_per_scene));
    rows.push(spread_row("Avg. Categories/Scene", stats.super_categories_per_scene));
    let [name, version] = [&stats.dataset.name, &stats.dataset.version].map(|word| shown(word, LONGEST));
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

fn beside(stats: &StatsFile) -> Table {
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
    word.as_ref().map_or_else(|| "(none)".to_owned(), |word| shown(word, LONGEST))
}

fn findings(total: &Counts) -> Table {
    let mut rows = vec![row(["severity", "code", "findings"])];
    rows.extend(total.findings.iter().map(|found| {
        let severity = match found.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        row([severity, &shown(&found.code, LONGEST), &found.count.to_string()])
    }));
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
            [scene.scene.as_str(), &scene.source_kind.to_string(), &scene.house].map(|word| shown(word, LONGEST));
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

/// One column for each of the eight super-categories. All other objects share a last column, which exists only where there
/// are any.
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
