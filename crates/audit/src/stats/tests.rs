//! Counts of hand-made scenes, properties of totals, and charts with untrusted names.

use mateval_scene::dataset::{Atlas, DatasetFile, FORMAT, SceneSource, TargetsFile, TrueMaterials};
use mateval_scene::{InstanceId, InstanceIndex, SceneLights};
use proptest::prelude::*;

use super::picture::picture;
use super::text::text;
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
            states_roughness: true,
            states_metallic: true,
            shift_m: [0.0; 3],
            files: Vec::new(),
        },
        lights: SceneLights::Own,
        materials: TrueMaterials::Converted,
        exposure: 1.0,
        photo: None,
        views: Vec::new(),
        instances: things.iter().enumerate().map(|(at, thing)| instance(at, thing)).collect(),
        parts: Vec::new(),
        part_sets: Vec::new(),
        findings: Vec::new(),
    }
}

fn finding(severity: Severity, code: &str) -> Finding {
    let [file, place, message, action] = [(); 4].map(|()| String::new());
    Finding { severity, code: code.to_owned(), file, place, message, action }
}

fn dataset(scenes: Vec<SceneFile>) -> Dataset {
    Dataset {
        root: "dataset".into(),
        file: DatasetFile {
            format: FORMAT.to_owned(),
            name: "hand-made".to_owned(),
            version: "1.0".to_owned(),
            tool: String::new(),
            scenes: scenes.iter().map(|scene| scene.id.clone()).collect(),
            photo_renderer: None,
            licences: Vec::new(),
            geometry: None,
            manifest_sha256: String::new(),
        },
        targets: TargetsFile { format: FORMAT.to_owned(), targets: Vec::new() },
        scenes,
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

/// All expected numbers were counted by hand in the list above. The means are 7 / 2, 5 / 2 and 5 / 2, since the Bitterli
/// scene does not state which of its shapes are objects.
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

/// Table I has the paper's headings and rounds as the paper does.
#[test]
fn table_one_comes_first() {
    let text = text(&counted(&hand_made()));
    let expected = "Table I of the paper, for hand-made 1.0
                              min  max  scenes
  Number of scenes         3
  Avg. Objects/Scene     3.5    2    5       2
  Avg. Categories/Scene  2.5    2    3       2
";
    assert!(text.starts_with(expected), "{text}");
    assert!(text.contains("\n  Instrument (not of the eight)        1  14.3 %\n"), "{text}");
    assert!(text.contains("\n  Pier/Stool      (none)                              1\n"), "{text}");
}

/// A room of walls alone has zero objects, which counts; a scene without roles is not included.
#[test]
fn unknown_counts_are_not_zero() {
    let stats = |things: &[Thing<'_>]| {
        let rooms =
            [("a", &[SOFA, LAMP][..]), ("b", things)].map(|(id, things)| scene(id, SourceKind::Front3d, id, things));
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
    assert!(text(&stats).contains("Avg. Objects/Scene     unknown"));
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
    assert!(texts.iter().any(|text| text.starts_with("</text><script>alert(1)</script> & \"quoted\"")), "{texts:?}");
    let tables = text(&stats);
    assert!(!tables.contains(['\u{1b}', '\0', '\u{202e}']), "{tables:?}");
    // The twin: without escaping, such a name breaks the XML.
    assert!(roxmltree::Document::parse(&format!("<text>{hostile}</text>")).is_err());
}

/// The size of a chart is limited, however many and long the names are. It states how many rows it left out.
#[test]
fn the_size_of_a_chart_is_limited() {
    let long = "m".repeat(1 << 16);
    let names: Vec<String> = (0..1000).map(|at| format!("{at} {long}")).collect();
    let things: Vec<Thing<'_>> =
        names.iter().map(|name| (Role::Furniture {}, Some("Sofa"), Some(name.as_str()), true)).collect();
    let (texts, bars) = read_picture(&picture(&counted(&dataset(vec![scene("a", SourceKind::Front3d, "h", &things)]))));
    // 200 rows, of which 2 are headings without a bar, and one column of the histogram.
    assert_eq!(bars.len(), 198 + 1);
    assert!(texts.iter().any(|text| text == "and 808 more rows"), "{texts:?}");
    assert!(texts.iter().all(|text| text.chars().count() <= 50));
}

const WORDS: [Option<&str>; 6] = [None, Some("Sofa"), Some("Bed"), Some("Pier/Stool"), Some("sofa"), Some("")];

fn roles() -> [Role; 4] {
    [Role::Architecture { kind: "Floor".to_owned() }, Role::Furniture {}, Role::LightFixture {}, Role::Other {}]
}

prop_compose! {
    fn any_scene()(
        kind in prop::sample::select(vec![SourceKind::Bitterli, SourceKind::Front3d]),
        house in 0..3,
        things in prop::collection::vec((0..4_usize, 0..6_usize, 0..6_usize, any::<bool>()), 0..30),
        codes in prop::collection::vec((0..3_usize, 0..3), 0..6),
    ) -> SceneFile {
        let things: Vec<Thing<'_>> =
            things.into_iter().map(|(role, group, category, atlas)| (roles()[role].clone(), WORDS[group], WORDS[category], atlas)).collect();
        let severity = [Severity::Error, Severity::Warning, Severity::Note];
        let mut made = scene("a", kind, &format!("house-{house}"), &things);
        made.findings = codes.into_iter().map(|(at, code)| finding(severity[at], &format!("c{code}"))).collect();
        made
    }
}

/// The sum over all scenes of what `of` returns for their counts.
fn sum(stats: &StatsFile, of: impl Fn(&Counts) -> usize) -> usize {
    stats.per_scene.iter().map(|scene| of(&scene.counts)).sum()
}

proptest! {
    /// Totals equal the sums over scenes and over each classification, whatever the order of the scenes.
    #[test]
    fn totals_are_sums(mut scenes in prop::collection::vec(any_scene(), 0..8)) {
        for (at, scene) in scenes.iter_mut().enumerate() {
            scene.id = SceneId::new(format!("s{at}")).unwrap();
        }
        let stats = counted(&dataset(scenes.clone()));
        let total = &stats.total;
        prop_assert_eq!(total.instances, total.objects + total.architecture + total.others);
        prop_assert_eq!(total.super_categories.iter().map(|row| row.objects).sum::<usize>(), total.objects);
        prop_assert_eq!(total.categories.iter().map(|row| row.objects).sum::<usize>(), total.objects);
        prop_assert_eq!(stats.source_kinds.iter().map(|row| row.scenes).sum::<usize>(), stats.scenes);
        prop_assert_eq!(sum(&stats, |counts| counts.instances), total.instances);
        prop_assert_eq!(sum(&stats, |counts| counts.objects), total.objects);
        prop_assert_eq!(sum(&stats, |counts| counts.instances_with_atlas), total.instances_with_atlas);
        for row in &total.super_categories {
            let of = |counts: &Counts| {
                let rows = counts.super_categories.iter().filter(|found| found.super_category == row.super_category);
                rows.map(|found| found.objects).sum()
            };
            prop_assert_eq!(sum(&stats, of), row.objects);
        }
        for row in &total.findings {
            let of = |counts: &Counts| {
                let same = |found: &&FindingCount| (found.severity, &found.code) == (row.severity, &row.code);
                counts.findings.iter().filter(same).map(|found| found.count).sum()
            };
            prop_assert_eq!(sum(&stats, of), row.count);
        }
        for severity in [Severity::Error, Severity::Warning, Severity::Note] {
            prop_assert_eq!(sum(&stats, |counts| counts.findings_of(severity)), total.findings_of(severity));
        }
        if total.objects > 0 {
            let shares: f64 = total.super_categories.iter().filter_map(|row| row.share).sum();
            prop_assert!((shares - 1.0).abs() < 1e-12, "{}", shares);
        }
        if let Some(spread) = stats.objects_per_scene {
            prop_assert!(spread.min as f64 <= spread.mean && spread.mean <= spread.max as f64);
            prop_assert!((spread.mean * spread.scenes as f64 - total.objects as f64).abs() < 1e-9);
        }
        scenes.reverse();
        prop_assert_eq!(&counted(&dataset(scenes)).total, total);
    }
}
