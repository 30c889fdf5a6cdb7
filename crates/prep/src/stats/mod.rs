//! Counts what a dataset contains: the numbers of the paper's Table I, and those behind them.
//!
//! In: an open dataset, but only its `dataset.json` and the `scene.json` of each scene. Out: [`StatsFile`], which
//! [`show`] prints as tables and draws as a chart. [`look`](look::look) adds how the true albedo of input views looks,
//! alone or beside another dataset's; [`findings`](findings::findings) sums up the findings about the sources.

pub mod findings;
pub mod look;
pub mod show;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use mateval_dataset::dataset::SUPER_CATEGORIES;
use mateval_dataset::dataset::{DatasetVersion, Instance, SceneFile};
use mateval_dataset::layout::DATASET;
use mateval_dataset::material::MaterialParameter;
use mateval_dataset::open::Dataset;
use mateval_dataset::{DatasetError, Finding, FindingCount, Role, SceneId, Severity, SourceKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::PrepError;
use look::{Beside, LookStats};

/// The value of `format` in this version of the statistics.
pub const STATS_FORMAT: &str = "mateval-stats/2";

/// What `mateval prep stats --format json` prints: counts of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StatsFile {
    /// Always `mateval-stats/2`.
    pub format: String,
    /// The program that counted and its version, as in `mateval 0.1.0`.
    pub tool: String,
    /// The dataset that was counted.
    pub dataset: DatasetVersion,
    /// Number of scenes ("Number of scenes" of Table I).
    pub scenes: usize,
    /// Number of different houses. Scenes of one house are not independent of each other.
    pub houses: usize,
    /// Number of scenes of each kind of source, sorted by kind.
    pub source_kinds: Vec<SourceKindCount>,
    /// Number of objects per scene ("Avg. Objects/Scene" of Table I); null where no scene states which instances are
    /// objects.
    pub objects_per_scene: Option<Spread>,
    /// Number of different super-categories per scene ("Avg. Categories/Scene" of Table I, whose categories are the
    /// eight super-categories); null as above.
    pub super_categories_per_scene: Option<Spread>,
    /// Number of different categories per scene, of the objects that have a category; null as above.
    pub categories_per_scene: Option<Spread>,
    /// How the true albedo looks; absent where the ground truth is withheld, and in reports.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look: Option<LookStats>,
    /// The look of the dataset that `--beside` names; absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beside: Option<Beside>,
    /// Counts of all scenes together.
    pub total: Counts,
    /// Counts of each scene, in the dataset's order.
    pub per_scene: Vec<SceneStats>,
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

/// The distribution over scenes of a number that each scene has. Scenes that do not state which instances are objects
/// are not included, since their number is unknown and not zero.
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
    /// The benchmark's eight super-categories in their order, with zero where no object has one; then all others,
    /// sorted.
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
pub fn count(dataset: &Dataset, tool: &str) -> Result<StatsFile, PrepError> {
    let findings = duplicates(dataset);
    if !findings.is_empty() {
        return Err(DatasetError::Invalid { path: dataset.root.clone(), findings }.into());
    }
    let scenes = &dataset.scenes;
    let per_scene: Vec<SceneStats> = scenes.iter().map(scene_stats).collect();
    Ok(StatsFile {
        format: STATS_FORMAT.to_owned(),
        tool: tool.to_owned(),
        dataset: dataset.file.named(),
        scenes: scenes.len(),
        houses: scenes.iter().map(|scene| &scene.source.house).collect::<BTreeSet<_>>().len(),
        source_kinds: tally(scenes.iter().map(|scene| scene.source.kind))
            .into_iter()
            .map(|(kind, scenes)| SourceKindCount { kind, scenes })
            .collect(),
        objects_per_scene: spread(&per_scene, |counts| counts.objects),
        super_categories_per_scene: spread(&per_scene, Counts::different_super_categories),
        categories_per_scene: spread(&per_scene, Counts::different_categories),
        look: None,
        beside: None,
        total: counts(scenes),
        per_scene,
    })
}

impl SceneStats {
    /// Whether the scene states which instances are objects. Rooms of 3D-FRONT do, so that a room without objects
    /// counts as empty. The shapes of a Bitterli scene have names only.
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
        .map(|(at, id)| {
            Finding::new(
                Severity::Error,
                "duplicate_id",
                file,
                format!("/{list}/{at}{key}"),
                format!("'{id}' is listed twice"),
                "download the dataset again, or build it again",
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use mateval_dataset::dataset::{Atlas, DatasetFile, FORMAT, SceneSource, TargetsFile, TrueMaterials};
    use mateval_dataset::{InstanceId, InstanceIndex, SceneLights};

    use super::show::{picture, text};
    use super::*;

    /// Role, super-category, category, and whether the instance has an atlas.
    type Thing<'a> = (Role, Option<&'a str>, Option<&'a str>, bool);

    fn instance(at: usize, (role, super_category, category, has_atlas): &Thing<'_>) -> Instance {
        let atlas = Atlas { size: 64, charts: 1, coverage: 0.5, texel_m: 0.01, half_pixel_m: None };
        Instance {
            id: InstanceId::new(format!("thing-{at}")).unwrap(),
            index: InstanceIndex(std::num::NonZeroU16::new(at as u16 + 1).unwrap()),
            name: "thing".to_owned(),
            role: role.clone(),
            category: category.map(str::to_owned),
            super_category: super_category.map(str::to_owned),
            triangles: 2,
            unstated: Vec::new(),
            atlas: has_atlas.then_some(atlas),
        }
    }

    fn scene(id: &str, kind: SourceKind, house: &str, things: &[Thing<'_>]) -> SceneFile {
        SceneFile {
            format: FORMAT.to_owned(),
            id: SceneId::new(id).unwrap(),
            source: SceneSource {
                kind,
                house: house.to_owned(),
                private: false,
                states_roughness: true,
                states_metallic: true,
                shift_m: [0.0; 3],
                files: Vec::new(),
            },
            lights: SceneLights::Own,
            materials: TrueMaterials::Converted,
            exposure: 1.0,
            photo: None,
            novel_photos: BTreeMap::new(),
            flash: None,
            redressed: None,
            views: Vec::new(),
            instances: things.iter().enumerate().map(|(at, thing)| instance(at, thing)).collect(),
            parts: Vec::new(),
            part_sets: Vec::new(),
            findings: Vec::new(),
        }
    }

    fn finding(severity: Severity, code: &str) -> Finding {
        let [file, place, message, action] = [(); 4].map(|()| String::new());
        Finding::new(severity, code, file, place, message, action)
    }

    fn dataset(scenes: Vec<SceneFile>) -> Dataset {
        Dataset {
            root: "dataset".into(),
            file: DatasetFile::new("hand-made", "1.0", "", scenes.iter().map(|scene| scene.id.clone()).collect()),
            targets: TargetsFile { format: FORMAT.to_owned(), targets: Vec::new() },
            scenes,
            twins: Vec::new(),
            absent: Vec::new(),
        }
    }

    const SOFA: Thing<'_> = (Role::Furniture {}, Some("Sofa"), Some("Three-Seat / Multi-seat Sofa"), true);
    const LOVESEAT: Thing<'_> = (Role::Furniture {}, Some("Sofa"), Some("Loveseat Sofa"), true);
    const LAMP: Thing<'_> = (Role::LightFixture {}, Some("Lighting"), Some("Pendant Lamp"), false);
    const STOOL: Thing<'_> = (Role::Furniture {}, Some("Pier/Stool"), None, true);
    const PIANO: Thing<'_> = (Role::Furniture {}, Some("Instrument"), Some("Piano"), true);
    const WALL: Thing<'_> = (Role::Architecture { kind: String::new() }, None, None, true);
    const SHAPE: Thing<'_> = (Role::Other {}, None, None, false);

    /// Two rooms of one house and a Bitterli scene; 7 objects, 2 walls, 1 other shape.
    fn hand_made() -> Dataset {
        let mut living = scene("living", SourceKind::Front3d, "h1", &[WALL, SOFA, LOVESEAT, LOVESEAT, LAMP, STOOL]);
        living.findings = vec![finding(Severity::Warning, "no_atlas"), finding(Severity::Note, "unmapped_triangles")];
        let mut dining = scene("dining", SourceKind::Front3d, "h1", &[LAMP, PIANO, WALL]);
        dining.findings = vec![finding(Severity::Warning, "no_atlas"), finding(Severity::Warning, "missing_file")];
        dataset(vec![living, dining, scene("stairs", SourceKind::Bitterli, "stairs", &[SHAPE])])
    }

    fn counted(dataset: &Dataset) -> StatsFile {
        count(dataset, "mateval test").unwrap()
    }

    /// All expected numbers were counted by hand in the list above. The means are 7 / 2, 5 / 2 and 5 / 2, since the
    /// Bitterli scene does not state which of its shapes are objects.
    #[test]
    fn hand_made_scenes_are_counted_exactly() {
        let stats = counted(&hand_made());
        assert_eq!((stats.scenes, stats.houses), (3, 2));
        let kinds: Vec<(SourceKind, usize)> = stats.source_kinds.iter().map(|row| (row.kind, row.scenes)).collect();
        assert_eq!(kinds, [(SourceKind::Bitterli, 1), (SourceKind::Front3d, 2)]);
        assert_eq!(stats.objects_per_scene, Some(Spread { scenes: 2, mean: 3.5, min: 2, max: 5 }));
        let categories = Spread { scenes: 2, mean: 2.5, min: 2, max: 3 };
        assert_eq!(stats.super_categories_per_scene, Some(categories));
        assert_eq!(stats.categories_per_scene, Some(categories));
        let total = &stats.total;
        let mut reversed = hand_made();
        reversed.scenes.reverse();
        assert_eq!(&counted(&reversed).total, total);
        let sum = |of: fn(&Counts) -> usize| stats.per_scene.iter().map(|scene| of(&scene.counts)).sum::<usize>();
        assert_eq!(sum(|counts| counts.instances), total.instances);
        assert_eq!(sum(|counts| counts.objects), total.objects);
        assert_eq!(sum(|counts| counts.findings_of(Severity::Warning)), total.findings_of(Severity::Warning));
        assert_eq!((total.instances, total.objects, total.architecture, total.others), (10, 7, 2, 1));
        assert_eq!(total.instances_with_atlas, 7);
        let of = |rows: &[SuperCategoryCount]| rows.iter().map(|row| row.objects).collect::<Vec<_>>();
        assert_eq!(of(&total.super_categories), [0, 3, 2, 0, 0, 0, 0, 1, 1]);
        assert_eq!(total.super_categories[8].super_category.as_deref(), Some("Instrument"));
        assert_eq!(total.super_categories[1].share, Some(0.428_571_428_571_428_55));
        let categories: Vec<(Option<&str>, usize)> =
            total.categories.iter().map(|row| (row.category.as_deref(), row.objects)).collect();
        let sofas = [(Some("Loveseat Sofa"), 2), (Some("Three-Seat / Multi-seat Sofa"), 1)];
        let others = [(Some("Pendant Lamp"), 2), (None, 1), (Some("Piano"), 1)];
        assert_eq!(categories, [&sofas[..], &others].concat());
        let findings: Vec<(&str, usize)> = total.findings.iter().map(|row| (row.code.as_str(), row.count)).collect();
        assert_eq!(findings, [("missing_file", 1), ("no_atlas", 2), ("unmapped_triangles", 1)]);
        assert_eq!(total.findings_of(Severity::Warning), 3);
        assert_eq!(of(&stats.per_scene[1].counts.super_categories), [0, 0, 1, 0, 0, 0, 0, 0, 1]);
        // The twin: one object fewer, and other numbers.
        let mut changed = hand_made();
        changed.scenes[0].instances.pop();
        assert_ne!(counted(&changed).total.super_categories, stats.total.super_categories);
    }

    /// A room of walls alone has zero objects, which counts; a scene without roles is not included.
    #[test]
    fn unknown_counts_are_not_zero() {
        let stats = |things: &[Thing<'_>]| {
            let rooms = [("a", &[SOFA, LAMP][..]), ("b", things)]
                .map(|(id, things)| scene(id, SourceKind::Front3d, id, things));
            counted(&dataset(rooms.into())).objects_per_scene.unwrap()
        };
        assert_eq!(stats(&[WALL]), Spread { scenes: 2, mean: 1.0, min: 0, max: 2 });
        assert_eq!(stats(&[SHAPE]), Spread { scenes: 1, mean: 2.0, min: 2, max: 2 });
        assert_eq!(stats(&[SHAPE, SOFA]), Spread { scenes: 2, mean: 1.5, min: 1, max: 2 });
    }

    #[test]
    fn an_empty_dataset_has_no_mean() {
        let stats = counted(&dataset(Vec::new()));
        assert_eq!((stats.scenes, stats.objects_per_scene, stats.total.super_categories[0].share), (0, None, None));
        assert!(text(&stats, None).contains("Avg. Objects/Scene     unknown"));
        roxmltree::Document::parse(&picture(&stats)).unwrap();
    }

    #[test]
    fn all_duplicates_are_reported_together() {
        let mut twice = hand_made();
        let again = twice.scenes[0].instances[0].clone();
        twice.scenes[0].instances.push(again);
        twice.file.scenes.push(SceneId::new("dining").unwrap());
        twice.scenes.push(twice.scenes[1].clone());
        let error = count(&twice, "").unwrap_err().to_string();
        assert_eq!(error.matches("duplicate_id").count(), 2, "{error}");
        assert!(error.contains("'dataset.json' /scenes/3: ") && error.contains("/instances/6/id: "), "{error}");
    }

    /// The texts of a chart and the lengths of its bars, as an XML parser reads them.
    fn read_picture(svg: &str) -> (Vec<String>, Vec<f64>) {
        let document = roxmltree::Document::parse(svg).unwrap();
        let nodes = || document.descendants().filter(|node| node.is_element());
        let known = ["svg", "style", "rect", "text"];
        assert!(nodes().all(|node| known.contains(&node.tag_name().name())), "{svg}");
        let texts = nodes().filter(|node| node.has_tag_name(("http://www.w3.org/2000/svg", "text")));
        let bars = nodes().filter(|node| node.attribute("class") == Some("bar"));
        let length = |node: roxmltree::Node<'_, '_>| node.attribute("width").unwrap().parse().unwrap();
        (texts.map(|node| node.text().unwrap_or_default().to_owned()).collect(), bars.map(length).collect())
    }

    /// Bars are proportional to their counts, which are written beside them.
    #[test]
    fn bars_are_proportional_to_counts() {
        let stats = counted(&hand_made());
        let (texts, bars) = read_picture(&picture(&stats));
        assert_eq!(bars[..5], [440.0, 220.0, 440.0, 220.0, 220.0]);
        for expected in [
            "hand-made 1.0",
            "7 objects of 4 categories in 3 scenes",
            "3 · 42.9 %",
            "Piano",
            "mean 3.5",
            "2 scenes by number of objects; unknown for 1 more",
        ] {
            assert!(texts.iter().any(|text| text == expected), "{expected} not in {texts:?}");
        }
        assert_eq!(picture(&stats), picture(&counted(&hand_made())));
        // The twin.
        let mut changed = hand_made();
        changed.scenes[0].instances.pop();
        assert_ne!(picture(&stats), picture(&counted(&changed)));
    }

    /// The picture of two looks names both datasets and draws two outlines for each quantity.
    #[test]
    fn two_looks_are_drawn_side_by_side() {
        let beside = |bin: usize| {
            let of = |at: usize| {
                let mut histogram = [0.0; 32];
                histogram[at] = 1.0;
                look::LookDistribution { mean: 0.0, deviation: 0.0, bin: 0.01, histogram }
            };
            let look = |at: usize| LookStats {
                views: 2,
                luminance: of(at),
                lightness: of(3),
                chroma: of(3),
                local_contrast: of(3),
                fine_share: of(3),
                weak_area_share: None,
            };
            let [luminance, same] = [0.01 * bin.abs_diff(3) as f64, 0.0].map(Some);
            let distance =
                look::LookDistance { luminance, lightness: same, chroma: same, local_contrast: same, fine_share: same };
            let dataset = DatasetVersion { name: "before".to_owned(), version: "2.0".to_owned(), ..Default::default() };
            let mut stats = counted(&hand_made());
            (stats.look, stats.beside) = (Some(look(3)), Some(Beside { dataset, look: look(bin), distance }));
            stats
        };
        let svg = picture(&beside(8));
        let document = roxmltree::Document::parse(&svg).unwrap();
        let texts: Vec<&str> = document.descendants().filter_map(|node| node.text()).collect();
        for expected in ["hand-made 1.0", "before 2.0 (original)", "distance 0.050", "0.32"] {
            assert!(texts.contains(&expected), "{expected} not in {texts:?}");
        }
        let paths: Vec<&str> = document.descendants().filter_map(|node| node.attribute("d")).collect();
        // Both samples of the legend, then two outlines for each of five quantities.
        assert_eq!(paths.len(), 2 + 2 * 5);
        assert!(paths[2] != paths[3] && paths[4] == paths[5], "{paths:?}");
        assert!(text(&beside(8), None).contains("True albedo of 2 input views, beside 2 of before 2.0"));
        // The twin: the same look.
        assert_ne!(svg, picture(&beside(3)));
        assert!(picture(&beside(3)).contains("distance 0.000"));
    }

    /// A hostile name adds no element, no script and no line.
    #[test]
    fn untrusted_names_are_escaped() {
        let hostile = "</text><script>alert(1)</script> & \"quoted\" 'too' ]]> {{ width }}";
        let steering = "\u{1b}[31m\0\u{202e}\u{ffff}\n";
        let piece = |group, category| (Role::Furniture {}, Some(group), Some(category), true);
        let things = [piece(hostile, steering), piece("Sofa", hostile)];
        let mut made = dataset(vec![scene("a", SourceKind::Front3d, hostile, &things)]);
        made.file.name = hostile.to_owned();
        let stats = counted(&made);
        let (texts, _) = read_picture(&picture(&stats));
        assert!(
            texts.iter().any(|text| text.starts_with("</text><script>alert(1)</script> & \"quoted\"")),
            "{texts:?}"
        );
        let tables = text(&stats, None);
        assert!(!tables.contains(['\u{1b}', '\0', '\u{202e}']), "{tables:?}");
        // The twin: without escaping, such a name breaks the XML.
        assert!(roxmltree::Document::parse(&format!("<text>{hostile}</text>")).is_err());
    }

    /// The size of a chart is limited, however many and long the names are. It states how many rows it left out.
    #[test]
    fn the_size_of_a_chart_is_limited() {
        let long = "m".repeat(1 << 10);
        let names: Vec<String> = (0..1000).map(|at| format!("{at} {long}")).collect();
        let things: Vec<Thing<'_>> =
            names.iter().map(|name| (Role::Furniture {}, Some("Sofa"), Some(name.as_str()), true)).collect();
        let (texts, bars) =
            read_picture(&picture(&counted(&dataset(vec![scene("a", SourceKind::Front3d, "h", &things)]))));
        // 200 rows, 2 of them headings without a bar, and one column of the histogram.
        assert_eq!(bars.len(), 198 + 1);
        assert!(texts.iter().any(|text| text == "and 808 more rows"), "{texts:?}");
        assert!(texts.iter().all(|text| text.chars().count() <= 50));
    }
}
