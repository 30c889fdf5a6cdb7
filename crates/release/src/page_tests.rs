//! The page of a made-up release of many scenes. `MATEVAL_TEST_PICTURES=DIR` keeps the page.

use std::collections::BTreeMap;

use mateval_audit::compare::file::State;
use mateval_audit::stats::{CountedDataset, Counts, STATS_FORMAT, SceneStats, Spread, StatsFile};
use mateval_eval::result_key::ResultKey;
use mateval_scene::scene_cost::{Step, StepCost};
use mateval_scene::{Finding, SceneId, Severity, SourceKind, ViewId};

use crate::comparisons::{SceneVerdict, StateCount};
use crate::file::{RELEASE_FORMAT, ReleaseFile, ReleasedDataset, ReleasedScene, Verification};
use crate::inputs::SceneInputs;
use crate::page::page;
use crate::publication::Publication;
use crate::reference_scores::ReferenceScores;
use crate::remake::Remake;
use crate::table_one::Evaluated;
use crate::truth_renders::ViewNoise;
use crate::withholding::{NOT_SHOWN, withhold};

const SCENES: usize = 184;

/// Scene 170 does not agree, scene 180 has an error.
fn release() -> ReleaseFile {
    let scenes: Vec<ReleasedScene> = (0..SCENES).map(scene).collect();
    let ids = || scenes.iter().map(|scene| scene.scene.clone());
    let spread = |mean| Some(Spread { scenes: SCENES, mean, min: 1, max: 20 });
    ReleaseFile {
        format: RELEASE_FORMAT.to_owned(),
        tool: "mateval 0".to_owned(),
        dataset: ReleasedDataset {
            name: "made-up".to_owned(),
            version: "1.0".to_owned(),
            manifest_sha256: "0123456789abcdef".repeat(4),
            photo_renderer: None,
        },
        publication: Publication::default(),
        citation: "@misc{made-up}".to_owned(),
        withheld: None,
        stats: StatsFile {
            format: STATS_FORMAT.to_owned(),
            tool: "mateval 0".to_owned(),
            dataset: CountedDataset {
                name: "made-up".to_owned(),
                version: "1.0".to_owned(),
                manifest_sha256: String::new(),
            },
            scenes: SCENES,
            houses: 120,
            source_kinds: Vec::new(),
            objects_per_scene: spread(13.17),
            super_categories_per_scene: spread(4.3),
            categories_per_scene: spread(8.0),
            total: counts(),
            per_scene: ids()
                .map(|scene| SceneStats {
                    scene,
                    source_kind: SourceKind::Front3d,
                    house: "a house".to_owned(),
                    counts: counts(),
                })
                .collect(),
        },
        evaluated: Evaluated { original_view: true, novel_view: true, albedo: true },
        verification: Verification { sound: false, findings: vec![finding(180, "scene 180 is broken")] },
        ceiling: Some(scores("gt", 49.0, ids())),
        floor: Some(scores("grey", 9.5, ids())),
        rendered: Vec::new(),
        remake: Remake {
            tool: "mateval 0".to_owned(),
            recipe_sha256: String::new(),
            recipe: "name = \"made-up\"".to_owned(),
            commands: vec!["mateval prep build recipe.toml --source SOURCE --out DATASET".to_owned()],
        },
        licences: Vec::new(),
        without_licence: ids().collect(),
        scenes,
    }
}

fn id(at: usize) -> SceneId {
    SceneId::new(format!("0a1b2c3d-livingdiningroom-{at:03}")).unwrap()
}

fn finding(at: usize, message: &str) -> Finding {
    Finding {
        severity: Severity::Error,
        code: "bad".to_owned(),
        file: format!("scenes/{}/views/input/depth.exr", id(at)),
        place: "pixel 1.2345678".to_owned(),
        message: message.to_owned(),
        action: "make it again".to_owned(),
    }
}

fn counts() -> Counts {
    Counts {
        instances: 20,
        objects: 13,
        architecture: 7,
        others: 0,
        instances_with_atlas: 20,
        unstated: Default::default(),
        super_categories: Vec::new(),
        categories: Vec::new(),
        findings: Vec::new(),
    }
}

fn scene(at: usize) -> ReleasedScene {
    let agrees = at != 170;
    let count = |state, checks| StateCount { state, checks };
    let cost = |step, seconds| StepCost {
        step,
        renderer: None,
        runs: 1,
        wall_seconds: seconds,
        cpu_seconds: Some(2.0 * seconds),
    };
    let view = |view: &&str| ViewNoise {
        view: ViewId::new(*view).unwrap(),
        mean_of_halves_mse: 1.23456789e-4,
        denoised_mse: 1e-5,
        mean_of_halves_psnr_db: Some(36.0 + at as f64 / 50.0),
    };
    let note = |_: usize| Finding {
        severity: Severity::Note,
        place: "/parts/3".to_owned(),
        ..finding(at, "a part has no area and was left out")
    };
    ReleasedScene {
        scene: id(at),
        photo: false,
        picture: None,
        comparison: (at % 10 != 3).then(|| SceneVerdict {
            tool: "mateval 0".to_owned(),
            agrees,
            checks: if agrees {
                vec![count(State::Agrees, 75)]
            } else {
                vec![count(State::Agrees, 74), count(State::Differs, 1)]
            },
            faults: Some(if agrees { Vec::new() } else { vec!["input: rgb DIFFERS: 12.3 %".to_owned()] }),
        }),
        noise: Some(["input", "up_left", "up_right", "down_left", "down_right"].iter().map(view).collect()),
        costs: vec![cost(Step::Build, 40.0), cost(Step::Render, 1800.0), cost(Step::Scorer, 300.0)],
        findings: (0..at % 7).map(note).collect(),
        inputs: SceneInputs { files: 40, sha256: "0123456789abcdef".repeat(4) },
    }
}

fn scores(method: &str, psnr: f64, ids: impl Iterator<Item = SceneId>) -> ReferenceScores {
    let keys = ["albedo.novel.psnr", "rgb_true.novel.psnr", "albedo.input.psnr"];
    let values = |add: f64| -> BTreeMap<ResultKey, f64> {
        keys.iter().enumerate().map(|(at, key)| (key.parse().unwrap(), psnr + add + at as f64)).collect()
    };
    ReferenceScores {
        tool: "mateval 0".to_owned(),
        method: method.to_owned(),
        description: String::new(),
        protocol: "mateval-3".to_owned(),
        scorer_version: 1,
        fingerprint: "f".repeat(64),
        scenes_scored: SCENES,
        summary: values(0.25),
        summary_noise: BTreeMap::new(),
        scenes: Some(ids.enumerate().map(|(at, id)| (id, values(at as f64 / 1e3))).collect()),
        noise: Some(BTreeMap::new()),
    }
}

#[test]
fn many_scenes_stay_readable_and_failures_come_first() {
    let html = page(&release());
    if let Some(folder) = std::env::var_os("MATEVAL_TEST_PICTURES") {
        std::fs::write(std::path::Path::new(&folder).join("release.html"), &html).unwrap();
    }
    assert!(html.len() < 1_500_000, "{} bytes", html.len());
    let table = &html[html.find("<h2 id=\"scenes\">").unwrap()..html.find("<h2 id=\"details\">").unwrap()];
    let rows: Vec<&str> = table.split("<tr><th scope=\"row\"").skip(1).collect();
    assert_eq!(rows.len(), SCENES);
    for (row, at) in rows.iter().zip([170, 180, 0, 1]) {
        assert!(row.contains(id(at).as_str()), "{row}");
    }
    assert!(rows[1].contains("1 error") && rows[0].contains("74 of 75 agree"), "{}", rows[0]);
    let summary = &html[..html.find("<h2 id=\"scenes\">").unwrap()];
    for text in [
        "What fails",
        "2 scenes",
        "74 of 75 checks agree, 1 differs",
        "19 of 184 scenes are not compared",
        "13.2",
        "9.75 – 49.25",
        "218.8 h",
    ] {
        assert!(summary.contains(text), "no '{text}' in {summary}");
    }
}

#[test]
fn a_withheld_truth_leaves_verdicts_and_means() {
    let mut file = release();
    withhold(&mut file, "c0ffee".to_owned());
    let html = page(&file);
    for text in ["scene 180 is broken", "1.2345678", "12.3 %", "36.0", "9.51 –"] {
        assert!(!html.contains(text), "'{text}' leaks");
        assert!(page(&release()).contains(text), "no '{text}' without withholding");
    }
    for text in ["c0ffee", NOT_SHOWN, "1 error", "74 of 75 checks agree", "9.75 – 49.25"] {
        assert!(html.contains(text), "no '{text}'");
    }
    // The mean over one scene is a score.
    file.ceiling.as_mut().unwrap().scenes_scored = 1;
    withhold(&mut file, "c0ffee".to_owned());
    assert!(file.ceiling.unwrap().summary.is_empty() && !file.floor.unwrap().summary.is_empty());
}

/// The mean over one scene is that scene's score: of a value that one scene alone has, too.
#[test]
fn a_withheld_truth_leaves_no_mean_over_one_scene() {
    let mut file = release();
    let ceiling = file.ceiling.as_mut().unwrap();
    let of_one = *ceiling.summary.keys().next().unwrap();
    assert!(ceiling.summary.len() > 1);
    let scenes = ceiling.scenes.as_mut().unwrap();
    let first = scenes.keys().next().unwrap().clone();
    scenes.iter_mut().filter(|(id, _)| **id != first).for_each(|(_, values)| values.retain(|key, _| *key != of_one));
    let mut alone = release();
    alone.ceiling.as_mut().unwrap().scenes.as_mut().unwrap().retain(|id, _| *id == first);
    for file in [&mut file, &mut alone] {
        withhold(file, "c0ffee".to_owned());
        assert!(!file.floor.as_ref().unwrap().summary.is_empty());
    }
    let left = file.ceiling.unwrap().summary;
    assert!(!left.is_empty() && !left.contains_key(&of_one), "{left:?}");
    assert!(alone.ceiling.unwrap().summary.is_empty());
}
