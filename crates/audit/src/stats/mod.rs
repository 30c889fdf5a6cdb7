//! Counts what a dataset contains: the numbers of the paper's Table I, and those behind them.
//!
//! In: an open dataset, but only its `dataset.json` and the `scene.json` of each scene. Out: [`StatsFile`], which
//! [`text`] prints as tables and [`picture`] draws as a chart.

pub mod picture;
pub mod text;

#[cfg(test)]
mod tests;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::layout::DATASET;
use mateval_scene::material::MaterialParameter;
use mateval_scene::open::Dataset;
use mateval_scene::super_categories::SUPER_CATEGORIES;
use mateval_scene::{Finding, FindingCount, Role, SceneError, SceneId, Severity, SourceKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::AuditError;

/// The value of `format` in this version of the statistics.
pub const STATS_FORMAT: &str = "mateval-stats/1";

/// What `mateval prep stats --format json` prints: counts of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StatsFile {
    /// Always `mateval-stats/1`.
    pub format: String,
    /// The program that counted and its version, as in `mateval 0.1.0`.
    pub tool: String,
    /// The dataset that was counted.
    pub dataset: CountedDataset,
    /// Number of scenes ("Number of scenes" of Table I).
    pub scenes: usize,
    /// Number of different houses. Scenes of one house are not independent of each other.
    pub houses: usize,
    /// Number of scenes of each kind of source, sorted by kind.
    pub source_kinds: Vec<SourceKindCount>,
    /// Number of objects per scene ("Avg. Objects/Scene" of Table I); null where no scene states which instances are objects.
    pub objects_per_scene: Option<Spread>,
    /// Number of different super-categories per scene ("Avg. Categories/Scene" of Table I, whose categories are the eight
    /// super-categories); null as above.
    pub super_categories_per_scene: Option<Spread>,
    /// Number of different categories per scene, of the objects that have a category; null as above.
    pub categories_per_scene: Option<Spread>,
    /// Counts of all scenes together.
    pub total: Counts,
    /// Counts of each scene, in the dataset's order.
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
    /// SHA-256 of its manifest, in hexadecimal.
    pub manifest_sha256: String,
}

/// The number of scenes from one kind of source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SourceKindCount {
    /// The kind of source.
    pub kind: SourceKind,
    /// Number of scenes.
    pub scenes: usize,
}

/// The distribution over scenes of a number that each scene has. Scenes that do not state which instances are objects are
/// not included, since their number is unknown and not zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Number of scenes that were included.
    pub scenes: usize,
    /// Mean over these scenes.
    pub mean: f64,
    /// Smallest value.
    pub min: usize,
    /// Largest value.
    pub max: usize,
}

/// The counts of one scene, and where it comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneStats {
    /// The scene.
    pub scene: SceneId,
    /// The kind of its source.
    pub source_kind: SourceKind,
    /// Its house.
    pub house: String,
    /// The counts.
    pub counts: Counts,
}

/// The counts of a scene, or of all scenes together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Counts {
    /// Number of all instances: objects, architecture and others.
    pub instances: usize,
    /// Number of objects: furniture and light fixtures.
    pub objects: usize,
    /// Number of instances that belong to the building.
    pub architecture: usize,
    /// Number of instances with any other role, as have all shapes of a source that does not state roles.
    pub others: usize,
    /// Number of instances with an atlas, for which a submission needs textures.
    pub instances_with_atlas: usize,
    /// Number of those whose source does not state each parameter.
    pub unstated: UnstatedCounts,
    /// The benchmark's eight super-categories in their order, with zero where no object has one; then all others, sorted.
    pub super_categories: Vec<SuperCategoryCount>,
    /// The categories found, in the order of their super-categories and within each by decreasing number.
    pub categories: Vec<CategoryCount>,
    /// Faults of the sources, counted by severity and code.
    pub findings: Vec<FindingCount>,
}

/// For each parameter, the number of instances with an atlas whose source does not state it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UnstatedCounts {
    /// The base colour.
    pub base_color: usize,
    /// The roughness.
    pub roughness: usize,
    /// The metallic.
    pub metallic: usize,
    /// The emission.
    pub emission: usize,
}

/// The number of objects in one super-category.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SuperCategoryCount {
    /// The super-category, as in `scene.json`; null for objects without one.
    pub super_category: Option<String>,
    /// Number of objects.
    pub objects: usize,
    /// Share of all objects, 0 to 1; null where there are no objects.
    pub share: Option<f64>,
}

/// The number of objects in one category. A category is a name within its super-category.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CategoryCount {
    /// The super-category, as in `scene.json`; null for objects without one.
    pub super_category: Option<String>,
    /// The category, as in `scene.json`; null for objects without one.
    pub category: Option<String>,
    /// Number of objects.
    pub objects: usize,
}

/// Counts the dataset. Fails where scenes or instances are listed twice, and reports all of them.
pub fn count(dataset: &Dataset, tool: &str) -> Result<StatsFile, AuditError> {
    let findings = duplicates(dataset);
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
    /// Number of super-categories that have at least one object.
    pub fn different_super_categories(&self) -> usize {
        self.super_categories.iter().filter(|row| row.objects > 0).count()
    }

    /// Number of categories that have at least one object.
    pub fn different_categories(&self) -> usize {
        self.categories.iter().filter(|row| row.category.is_some()).count()
    }

    /// Number of findings of this severity, whatever their code.
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
        unstated: UnstatedCounts {
            base_color: unstated(scenes, MaterialParameter::BaseColor),
            roughness: unstated(scenes, MaterialParameter::Roughness),
            metallic: unstated(scenes, MaterialParameter::Metallic),
            emission: unstated(scenes, MaterialParameter::Emission),
        },
        super_categories: super_categories(&objects),
        categories: categories(&objects),
        findings: FindingCount::of(findings),
    }
}

/// The number of instances with an atlas that do not state the parameter.
fn unstated(scenes: &[SceneFile], parameter: MaterialParameter) -> usize {
    let instances = scenes.iter().flat_map(|scene| &scene.instances).filter(|instance| instance.atlas.is_some());
    instances.filter(|instance| instance.unstated.contains(&parameter)).count()
}

/// The position of a super-category in tables: the eight come first, then all others, then objects without one.
fn rank(super_category: Option<&str>) -> usize {
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
    // The sort is stable, so that unknown super-categories stay sorted by name.
    rows.sort_by_key(|row| rank(row.super_category.as_deref()));
    rows
}

fn categories(objects: &[&Instance]) -> Vec<CategoryCount> {
    let found =
        tally(objects.iter().map(|instance| (instance.super_category.as_deref(), instance.category.as_deref())));
    let row = |((super_category, category), objects): ((Option<&str>, Option<&str>), usize)| CategoryCount {
        super_category: super_category.map(str::to_owned),
        category: category.map(str::to_owned),
        objects,
    };
    let mut rows: Vec<CategoryCount> = found.into_iter().map(row).collect();
    // The sort is stable and the tally is sorted, so that ties stay sorted by category.
    rows.sort_by_key(|row| (rank(row.super_category.as_deref()), row.super_category.clone(), Reverse(row.objects)));
    rows
}

/// How often each value occurs, sorted by value.
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

/// A finding for each scene and instance that is listed twice, since it would be counted twice.
fn duplicates(dataset: &Dataset) -> Vec<Finding> {
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

/// A finding for each id that occurs earlier in the list.
fn repeats<'a>(file: &str, list: &str, key: &str, ids: impl Iterator<Item = &'a str>) -> Vec<Finding> {
    let mut seen = BTreeSet::new();
    ids.enumerate()
        .filter(|(_, id)| !seen.insert(*id))
        .map(|(at, id)| Finding {
            severity: Severity::Error,
            code: "duplicate_id".to_owned(),
            file: file.to_owned(),
            place: format!("/{list}/{at}{key}"),
            message: format!("'{id}' is listed twice"),
            action: "download the dataset again, or build it again".to_owned(),
        })
        .collect()
}

/// An untrusted name, made safe to print: one line of at most `most` characters, without characters that control a terminal
/// or reverse the direction of the text.
pub(crate) fn shown(name: &str, most: usize) -> String {
    let is_control = |c: char| {
        c.is_control()
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
            || (c as u32) & 0xfffe == 0xfffe
    };
    let whole: Vec<char> = name.chars().take(most + 1).map(|c| if is_control(c) { '\u{fffd}' } else { c }).collect();
    match whole.len() > most {
        true => whole[..most - 1].iter().collect::<String>() + "…",
        false => whole.into_iter().collect(),
    }
}
