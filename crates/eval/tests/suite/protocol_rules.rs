//! Every number and word of a protocol rules: changing it by itself changes what is computed, or the scorer refuses it.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use mateval_eval::EvalError;
use mateval_eval::lit_scene::{LitScene, Photo};
use mateval_eval::measure::rounded_lpips;
use mateval_eval::noise_blocks::noise_blocks;
use mateval_eval::pilot::samples_under_bound;
use mateval_eval::predicted_light::predicted_light;
use mateval_eval::protocol::Protocol;
use mateval_eval::relit::lightings;
use mateval_eval::rgb::LightReference;
use mateval_eval::score::score;
use mateval_eval::truth::{RgbTruth, ViewTruth};
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_light::light_stage;
use mateval_metrics::NoisePsnr;
use mateval_scene::{Camera, RendererId, TriangleMesh, glb, reference_io};
use mateval_submission::prediction::{PredictedScene, read_scene};
use mateval_testkit::box_room::{self, box_room, quad};
use mateval_tracer::World;
use serde_json::{Value, json};

use super::sample::{dataset, hasty, plan, write_grey};
use mateval_testkit::kept_folder::kept_folder;

/// The start of JSON pointers, and a value that the rules below it decide.
type Reading = (&'static str, fn(&Protocol) -> Value);

/// What shows that a part of a protocol is read, by the start of its JSON pointers. A leaf under none of these fails.
const READINGS: [Reading; 16] = [
    ("/name", scores),
    ("/mask_rule", scores),
    ("/albedo_space", scores),
    ("/lpips_decimals", stored_lpips),
    ("/light/tracks/", light),
    ("/light/flavour", light),
    ("/light/max_bounces", light),
    ("/light/roulette_", light),
    ("/light/stage/", stage),
    ("/light/fit/", light),
    ("/light/relit/", relit),
    ("/light/noise/block_pixels", blocks),
    ("/light/noise/least_samples", light),
    ("/light/noise/", samples),
    ("/fixed/", refusal),
    ("/scorer_version", refusal),
];

#[test]
fn every_leaf_of_a_protocol_is_read_or_refused() {
    let base = serde_json::to_value(quick()).unwrap();
    let mut leaves = Vec::new();
    find_leaves(&base, String::new(), &mut leaves);
    assert!(leaves.len() > 70, "{}", leaves.len());
    let mut unchanged = BTreeMap::new();
    for leaf in leaves {
        let (start, reading) = READINGS.iter().find(|(start, _)| leaf.starts_with(start)).expect(&leaf);
        let before = unchanged.entry(*start).or_insert_with(|| reading(&quick())).clone();
        let changes = changes(base.pointer(&leaf).unwrap()).into_iter().filter_map(|change| {
            let mut changed = base.clone();
            *changed.pointer_mut(&leaf).unwrap() = change;
            serde_json::from_value(changed).ok()
        });
        assert!(changes.into_iter().any(|changed: Protocol| reading(&changed) != before), "nothing reads {leaf}");
    }
}

/// Other values for a leaf. One of them changing what is computed shows that the leaf is read.
fn changes(value: &Value) -> Vec<Value> {
    match value {
        Value::Number(number) if number.is_u64() => {
            let number = number.as_u64().unwrap();
            [1, number + 1, 4 * number].into_iter().filter(|other| *other != number).map(Value::from).collect()
        }
        Value::Number(number) => [0.25, 4.0, 100.0, 1e4].map(|by| json!(by * number.as_f64().unwrap() + 1e-9)).to_vec(),
        Value::String(_) => {
            ["black_fill", "inside", "srgb", "mitsuba", "true", "fitted", "another"].map(Value::from).to_vec()
        }
        other => panic!("a protocol holds {other}"),
    }
}

fn find_leaves(value: &Value, at: String, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| find_leaves(value, format!("{at}/{key}"), found)),
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(k, value)| find_leaves(value, format!("{at}/{k}"), found));
        }
        _ => found.push(at),
    }
}

/// `mateval-1` with so few samples that it is computed in a moment.
fn quick() -> Protocol {
    let mut protocol = hasty();
    protocol.light.fit.samples = 2;
    protocol.light.noise.least_samples = 2;
    protocol.light.noise.most_samples = 64;
    protocol
}

/// The scores of a submission without light.
fn scores(protocol: &Protocol) -> Value {
    let mut protocol = protocol.clone();
    protocol.light.tracks.clear();
    let results = score(&plan(&[&GREY], &protocol, &["room"]), &|_, _, _| ()).unwrap();
    let mut protocols = serde_json::to_value(&results[0].protocols).unwrap();
    for result in protocols.as_object_mut().unwrap().values_mut() {
        for key in ["protocol", "fingerprint"] {
            result.as_object_mut().unwrap().remove(key);
        }
    }
    protocols
}

static GREY: LazyLock<std::path::PathBuf> = LazyLock::new(|| {
    let submission = kept_folder("protocol_rules").join("grey");
    write_grey(&submission);
    submission
});

fn stored_lpips(protocol: &Protocol) -> Value {
    json!(rounded_lpips(protocol, Some(0.123_456_789_012), 1).value)
}

/// A room with a panel that leans by 6 degrees and one that stands 6 mm before a wall: walls to some rules only.
fn stage(protocol: &Protocol) -> Value {
    static ROOM: LazyLock<World> = LazyLock::new(|| {
        let leaning = quad([4.0, 0.0, 5.2], [0.0, 0.0, 0.7], [-0.1, 1.0, 0.0]);
        let proud = quad([3.994, 1.1, 5.2], [0.0, 0.0, 0.7], [0.0, 1.0, 0.0]);
        World::new(Arc::new(box_room(vec![leaning, proud]))).unwrap()
    });
    let lights = light_stage::lights(&protocol.light.stage, &ROOM, &[2, 3, 4, 5, 6, 7], &[box_room::camera()]);
    json!(format!("{lights:?}"))
}

/// Lightings of five groups, each half as bright as the one before.
fn relit(protocol: &Protocol) -> Value {
    let groups = [16.0, 8.0, 4.0, 2.0, 1.0].map(|light| Picture::filled(2, 1, LinearRgb([light; 3])));
    json!(format!("{:?}", lightings(&protocol.light.relit, &groups, &Mask::filled(2, 1, true))))
}

fn blocks(protocol: &Protocol) -> Value {
    let cameras: [Camera; 1] = [dataset().scenes[0].views[0].camera];
    json!(noise_blocks(&protocol.light.noise, &cameras)[0].pixels())
}

/// Samples that pilots of several noises ask for, below and above the truth's own noise.
fn samples(protocol: &Protocol) -> Value {
    let noises = [0.01, 0.02, 0.04, 0.08, 0.16, 9.0].map(|own| [0.0, 0.04].map(|reference| (own, reference)));
    let asked = noises.as_flattened().iter().map(|&(prediction, reference)| {
        let pilot = NoisePsnr { total: prediction, prediction, reference };
        samples_under_bound(&protocol.light.noise, Some(pilot))
    });
    json!(asked.collect::<Vec<_>>())
}

fn refusal(protocol: &Protocol) -> Value {
    match protocol.check() {
        Ok(()) => json!("accepted"),
        Err(EvalError::FixedRule { rule, .. }) => json!(rule),
        Err(EvalError::ScorerVersion { found, .. }) => json!(found),
        Err(other) => panic!("{other}"),
    }
}

/// The input view of a prediction under every light: pictures, fitted radiances, samples.
fn light(protocol: &Protocol) -> Value {
    let Lit { world, atlases, prediction, truth, own } = &*LIT;
    let (scene, view) = (&dataset().scenes[0], &dataset().scenes[0].views[0]);
    let reference = LightReference::new(protocol, None, own, scene.exposure).unwrap();
    let groups: Vec<_> = (0..world.emitters().groups()).map(|_| Picture::filled(64, 48, LinearRgb([1.0; 3]))).collect();
    let lit = LitScene {
        scene,
        world,
        atlases,
        views: vec![view],
        truths: std::slice::from_ref(truth),
        references: &[reference],
        blocks: &noise_blocks(&protocol.light.noise, &[view.camera]),
        photo: Photo { view, light: own.shown.clone(), valid: &truth.valid },
        lightings: lightings(&protocol.light.relit, &groups, &truth.valid),
    };
    let mut rules = protocol.light.clone();
    rules.noise.most_samples = rules.noise.least_samples;
    let mut seen = Vec::new();
    predicted_light(&lit, &rules, std::slice::from_ref(prediction), &|_, _, _| (), &mut |_, light| {
        let pictures = light.pictures.iter().map(|picture| (picture.track, mean_of_half(&picture.views[0][0])));
        seen.push(json!([pictures.collect::<Vec<_>>(), light.fit, light.samples]));
        Ok(())
    })
    .unwrap();
    Value::from(seen)
}

fn mean_of_half(half: &Picture<LinearRgb>) -> f64 {
    half.pixels().iter().flat_map(|pixel| pixel.0).map(f64::from).sum()
}

/// The scene of the sample that is lit by a stage, with the prediction `grey`.
struct Lit {
    world: World,
    atlases: Vec<TriangleMesh>,
    prediction: PredictedScene,
    truth: ViewTruth,
    own: RgbTruth,
}

static LIT: LazyLock<Lit> = LazyLock::new(|| {
    let scene = &dataset().scenes[0];
    let folder = dataset().folder(&scene.id);
    let nodes = glb::read(&folder.instances()).unwrap();
    Lit {
        world: World::new(Arc::new(reference_io::read(&folder).unwrap())).unwrap(),
        atlases: nodes.into_iter().map(|node| node.mesh).collect(),
        prediction: read_scene(&GREY, scene),
        truth: ViewTruth::read(&folder, &scene.views[0]).unwrap(),
        own: RgbTruth::read(&folder, &RendererId::new("builtin").unwrap(), &scene.views[0]).unwrap(),
    }
});
