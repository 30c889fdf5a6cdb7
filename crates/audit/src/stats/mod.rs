//! What a dataset holds, counted: the paper's Table I, and what stands behind it.
//!
//! In: an open dataset; of its files only `dataset.json` and every `scene.json` are counted. Out: [`StatsFile`], which
//! [`text`] sets in tables and [`picture`] draws.

pub mod picture;
pub mod text;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::layout::DATASET;
use mateval_scene::open::Dataset;
use mateval_scene::super_categories::SUPER_CATEGORIES;
use mateval_scene::{Finding, FindingCount, Role, SceneError, SceneId, Severity, SourceKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::AuditError;

/// The word for this version of the statistics.
pub const STATS_FORMAT: &str = "mateval-stats/1";

/// What `mateval prep stats --format json` prints: counts of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StatsFile {
    /// Always `mateval-stats/1`.
    pub format: String,
    /// What counted, as in `mateval 0.1.0`.
    pub tool: String,
    /// What was counted.
    pub dataset: CountedDataset,
    /// Table I, "Number of scenes".
    pub scenes: usize,
    /// Houses that the scenes are of; scenes of one house are not independent of each other.
    pub houses: usize,
    /// Scenes by the kind of their source, sorted by it.
    pub source_kinds: Vec<SourceKindCount>,
    /// Table I, "Avg. Objects/Scene"; null where no scene says what its objects are.
    pub objects_per_scene: Option<Spread>,
    /// Table I, "Avg. Categories/Scene": different super-categories, as the paper's categories are the eight; null as
    /// above.
    pub super_categories_per_scene: Option<Spread>,
    /// Different categories of objects that have one; null as above.
    pub categories_per_scene: Option<Spread>,
    /// All scenes together.
    pub total: Counts,
    /// Each scene, in the dataset's order.
    pub per_scene: Vec<SceneStats>,
}

/// The dataset that was counted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CountedDataset {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of its manifest, hex.
    pub manifest_sha256: String,
}

/// Scenes from one kind of source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SourceKindCount {
    /// The kind of source.
    pub kind: SourceKind,
    /// How many.
    pub scenes: usize,
}

/// A number that each scene has one of. Scenes that do not say what their objects are take no part: zero would be wrong
/// for them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Scenes that take part.
    pub scenes: usize,
    /// Its mean over scenes.
    pub mean: f64,
    /// Its least.
    pub min: usize,
    /// Its largest.
    pub max: usize,
}

/// One scene's counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneStats {
    /// The scene.
    pub scene: SceneId,
    /// The kind of its source.
    pub source_kind: SourceKind,
    /// Its house.
    pub house: String,
    /// What it holds.
    pub counts: Counts,
}

/// What a scene, or all scenes together, hold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Counts {
    /// Objects, architecture and others.
    pub instances: usize,
    /// Furniture and light fixtures.
    pub objects: usize,
    /// Instances that belong to the building.
    pub architecture: usize,
    /// Instances of any other role: every shape of a source that does not state roles.
    pub others: usize,
    /// Instances that a submission needs textures for.
    pub instances_with_atlas: usize,
    /// The benchmark's eight in their order, even where there is none of them; then any other word, sorted.
    pub super_categories: Vec<SuperCategoryCount>,
    /// Those that are there, in the order of their super-categories, the most frequent first.
    pub categories: Vec<CategoryCount>,
    /// What was wrong with the sources, by severity and code.
    pub findings: Vec<FindingCount>,
}

/// Objects of one super-category.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SuperCategoryCount {
    /// As in `scene.json`; null for objects without one.
    pub super_category: Option<String>,
    /// How many.
    pub objects: usize,
    /// Of all objects, 0 to 1; null where there are no objects.
    pub share: Option<f64>,
}

/// Objects of one category. A category is a name within its super-category.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CategoryCount {
    /// As in `scene.json`; null for objects without one.
    pub super_category: Option<String>,
    /// As in `scene.json`; null for objects without one.
    pub category: Option<String>,
    /// How many.
    pub objects: usize,
}

/// Counts the dataset. Fails where a scene or an instance is listed twice, and then names all of these.
pub fn count(dataset: &Dataset, tool: &str) -> Result<StatsFile, AuditError> {
    let findings = doubles(dataset);
    if !findings.is_empty() {
        return Err(SceneError::Invalid { path: dataset.root.clone(), findings }.into());
    }
    let scenes = &dataset.scenes;
    let per_scene: Vec<SceneStats> = scenes.iter().map(scene_stats).collect();
    Ok(StatsFile {
        format: STATS_FORMAT.to_owned(),
        tool: tool.to_owned(),
        dataset: CountedDataset {
            name: dataset.file.name.clone(),
            version: dataset.file.version.clone(),
            manifest_sha256: dataset.file.manifest_sha256.clone(),
        },
        scenes: scenes.len(),
        houses: scenes.iter().map(|scene| &scene.source.house).collect::<BTreeSet<_>>().len(),
        source_kinds: tally(scenes.iter().map(|scene| scene.source.kind))
            .into_iter()
            .map(|(kind, scenes)| SourceKindCount { kind, scenes })
            .collect(),
        objects_per_scene: spread(&per_scene, |counts| counts.objects),
        super_categories_per_scene: spread(&per_scene, Counts::different_super_categories),
        categories_per_scene: spread(&per_scene, Counts::different_categories),
        total: counts(scenes),
        per_scene,
    })
}

impl SceneStats {
    /// Whether the scene states which instances are objects. Rooms of 3D-FRONT do, so that a room without objects counts as
    /// empty. The shapes of a Bitterli scene have names only.
    pub fn knows_its_objects(&self) -> bool {
        self.counts.others < self.counts.instances || self.counts.instances == 0
    }
}

impl Counts {
    /// Super-categories that at least one object is of.
    pub fn different_super_categories(&self) -> usize {
        self.super_categories.iter().filter(|row| row.objects > 0).count()
    }

    /// Categories that at least one object is of.
    pub fn different_categories(&self) -> usize {
        self.categories.iter().filter(|row| row.category.is_some()).count()
    }

    /// Findings of this severity, whatever their code.
    pub fn findings_of(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|row| row.severity == severity).map(|row| row.count).sum()
    }
}

fn scene_stats(scene: &SceneFile) -> SceneStats {
    SceneStats {
        scene: scene.id.clone(),
        source_kind: scene.source.kind,
        house: scene.source.house.clone(),
        counts: counts(std::slice::from_ref(scene)),
    }
}

fn counts(scenes: &[SceneFile]) -> Counts {
    let instances = || scenes.iter().flat_map(|scene| &scene.instances);
    let objects: Vec<&Instance> = instances().filter(|instance| instance.role.is_furniture()).collect();
    let findings = scenes.iter().flat_map(|scene| &scene.findings);
    Counts {
        instances: instances().count(),
        objects: objects.len(),
        architecture: instances().filter(|instance| instance.role.is_architecture()).count(),
        others: instances().filter(|instance| matches!(instance.role, Role::Other {})).count(),
        instances_with_atlas: instances().filter(|instance| instance.atlas.is_some()).count(),
        super_categories: super_categories(&objects),
        categories: categories(&objects),
        findings: FindingCount::of(findings),
    }
}

/// The rank of a super-category: the eight first, then any other word, then none.
fn place(super_category: Option<&str>) -> usize {
    let after = SUPER_CATEGORIES.len();
    super_category.map_or(after + 1, |word| SUPER_CATEGORIES.iter().position(|known| *known == word).unwrap_or(after))
}

fn super_categories(objects: &[&Instance]) -> Vec<SuperCategoryCount> {
    let mut found = tally(objects.iter().map(|instance| instance.super_category.as_deref()));
    for known in SUPER_CATEGORIES {
        found.entry(Some(known)).or_insert(0);
    }
    let share = |count| (!objects.is_empty()).then(|| count as f64 / objects.len() as f64);
    let row = |(name, count): (Option<&str>, usize)| SuperCategoryCount {
        super_category: name.map(str::to_owned),
        objects: count,
        share: share(count),
    };
    let mut rows: Vec<SuperCategoryCount> = found.into_iter().map(row).collect();
    // The sort is stable, so that unknown words stay sorted.
    rows.sort_by_key(|row| place(row.super_category.as_deref()));
    rows
}

fn categories(objects: &[&Instance]) -> Vec<CategoryCount> {
    let found =
        tally(objects.iter().map(|instance| (instance.super_category.as_deref(), instance.category.as_deref())));
    let mut rows: Vec<((Option<&str>, Option<&str>), usize)> = found.into_iter().collect();
    rows.sort_by_key(|((super_category, category), count)| {
        (place(*super_category), *super_category, std::cmp::Reverse(*count), *category)
    });
    let row = |((super_category, category), objects): ((Option<&str>, Option<&str>), usize)| CategoryCount {
        super_category: super_category.map(str::to_owned),
        category: category.map(str::to_owned),
        objects,
    };
    rows.into_iter().map(row).collect()
}

/// How often each is there, sorted.
fn tally<T: Ord>(all: impl Iterator<Item = T>) -> BTreeMap<T, usize> {
    all.fold(BTreeMap::new(), |mut found, one| {
        *found.entry(one).or_insert(0) += 1;
        found
    })
}

fn spread(scenes: &[SceneStats], of: impl Fn(&Counts) -> usize) -> Option<Spread> {
    let values: Vec<usize> =
        scenes.iter().filter(|scene| scene.knows_its_objects()).map(|scene| of(&scene.counts)).collect();
    let (min, max) = (*values.iter().min()?, *values.iter().max()?);
    Some(Spread { scenes: values.len(), mean: values.iter().sum::<usize>() as f64 / values.len() as f64, min, max })
}

/// Scenes of a dataset and instances of a scene that are there twice: they would be counted twice.
fn doubles(dataset: &Dataset) -> Vec<Finding> {
    let mut findings = repeats(DATASET, "scenes", "", dataset.file.scenes.iter().map(|id| id.as_str()));
    for scene in &dataset.scenes {
        let file = format!("scenes/{}/scene.json", scene.id);
        findings.extend(repeats(
            &file,
            "instances",
            "/id",
            scene.instances.iter().map(|instance| instance.id.as_str()),
        ));
    }
    findings.sort();
    findings.dedup();
    findings
}

fn repeats<'a>(file: &str, list: &str, key: &str, ids: impl Iterator<Item = &'a str>) -> Vec<Finding> {
    let mut seen = BTreeSet::new();
    ids.enumerate()
        .filter(|(_, id)| !seen.insert(*id))
        .map(|(at, id)| Finding {
            severity: Severity::Error,
            code: "duplicate_id".to_owned(),
            file: file.to_owned(),
            place: format!("/{list}/{at}{key}"),
            message: format!("'{id}' is there already"),
            action: "get the dataset anew, or build it again".to_owned(),
        })
        .collect()
}

/// A name of a stranger for people to read: one line without characters that steer a terminal or turn the text around,
/// at most `most` characters.
pub(crate) fn shown(name: &str, most: usize) -> String {
    let steers = |c: char| {
        c.is_control()
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
            || (c as u32) & 0xfffe == 0xfffe
    };
    let whole: Vec<char> = name.chars().take(most + 1).map(|c| if steers(c) { '\u{fffd}' } else { c }).collect();
    match whole.len() > most {
        true => whole[..most - 1].iter().collect::<String>() + "…",
        false => whole.into_iter().collect(),
    }
}
