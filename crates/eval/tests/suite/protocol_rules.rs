//! Every number and word of a protocol rules: changing it by itself changes its hash and what is computed, or the
//! scorer refuses it.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use mateval_dataset::Camera;
use mateval_dataset::lighting::lightings;
use mateval_dataset::open::Dataset;
use mateval_eval::EvalError;
use mateval_eval::metric::Metric;
use mateval_eval::protocol::{Protocol, Track};
use mateval_eval::result::ProtocolResult;
use mateval_eval::score::{ScorePlan, score};
use mateval_light::light_stage;
use mateval_testkit::scenes::{box_camera, box_quad, box_room};
use mateval_tracer::World;
use mateval_tracer::shared_centre::noise_blocks;
use serde_json::{Value, json};

use super::sample::{dataset, hasty, plan, write_grey};
use mateval_testkit::kept_folder;
use mateval_testkit::sample_dataset::built_with_wide_views;

/// The start of JSON pointers, and a value that the rules below it decide.
type Reading = (&'static str, fn(&Protocol) -> Value);

/// What shows that a part of a protocol is read, by the start of its JSON pointers. A leaf under none of these fails.
const READINGS: [Reading; 18] = [
    ("/name", scores),
    ("/mask_rule", scores),
    ("/albedo_space", scores),
    ("/rounded_decimals", stored_flip),
    ("/headline", headline),
    ("/wide_views", wide_scores),
    ("/light/tracks/", light),
    ("/light/flavour", light),
    ("/light/max_bounces", light),
    ("/light/roulette_", light),
    ("/light/stage/", stage),
    ("/light/fit/", fitted),
    ("/light/relit/", relit),
    ("/light/samples/seed", light),
    ("/light/samples/block_pixels", blocks),
    ("/fixed/", refusal),
    ("/scorer_version", refusal),
    ("/light/", light),
];

#[test]
fn every_leaf_of_a_protocol_is_read_or_refused() {
    let base = serde_json::to_value(quick()).unwrap();
    let mut leaves = Vec::new();
    find_leaves(&base, String::new(), &mut leaves);
    assert!(leaves.len() > 60, "{}", leaves.len());
    let mut unchanged = BTreeMap::new();
    for leaf in leaves {
        let (start, reading) = READINGS.iter().find(|(start, _)| leaf.starts_with(start)).expect(&leaf);
        let before = unchanged.entry(*start).or_insert_with(|| reading(&quick())).clone();
        let mut changes = changes(base.pointer(&leaf).unwrap()).into_iter().filter_map(|change| {
            let mut changed = base.clone();
            *changed.pointer_mut(&leaf).unwrap() = change;
            serde_json::from_value(changed).ok()
        });
        let is_read = |changed: Protocol| {
            assert!(changed == quick() || changed.sha256() != quick().sha256(), "{leaf} is not in the hash");
            reading(&changed) != before
        };
        assert!(changes.any(is_read), "nothing reads {leaf}");
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
        Value::Bool(flag) => vec![json!(!flag)],
        Value::String(key) if key.contains('.') => vec![json!("albedo.wide.mse")],
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

/// `mateval-3` with all tracks, so that every rule is read, and so few samples that it is computed in a moment.
fn quick() -> Protocol {
    let mut protocol = hasty();
    protocol.light.tracks = Track::ALL.to_vec();
    protocol.light.fit.samples = 2;
    protocol.light.samples.each_half = 2;
    protocol
}

/// The scores of a submission without light.
fn scores(protocol: &Protocol) -> Value {
    albedo_scores(dataset(), protocol)
}

/// The same for a dataset with views from other places.
fn wide_scores(protocol: &Protocol) -> Value {
    static DATASET: LazyLock<Dataset> = LazyLock::new(|| Dataset::open(&built_with_wide_views()).unwrap());
    albedo_scores(&DATASET, protocol)
}

fn albedo_scores(dataset: &'static Dataset, protocol: &Protocol) -> Value {
    let mut protocol = protocol.clone();
    protocol.light.tracks.clear();
    let plan = ScorePlan { dataset, ..plan(&[&GREY], &protocol, &["room"]) };
    let results = score(&plan, &|_| ()).unwrap();
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

/// FLIP of the room's true light.
fn stored_flip(protocol: &Protocol) -> Value {
    let result = scores_of_light(protocol, "living");
    json!(result.summary.iter().filter(|(key, _)| key.metric == Metric::Flip).collect::<Vec<_>>())
}

/// The order of a result's keys is that of all protocols; the list itself is published.
fn headline(protocol: &Protocol) -> Value {
    json!(protocol.headline)
}

/// A room with a panel that leans by 6 degrees and one that stands 6 mm before a wall: walls to some rules only.
fn stage(protocol: &Protocol) -> Value {
    static ROOM: LazyLock<World> = LazyLock::new(|| {
        let leaning = box_quad([4.0, 0.0, 5.2], [0.0, 0.0, 0.7], [-0.1, 1.0, 0.0]);
        let proud = box_quad([3.994, 1.1, 5.2], [0.0, 0.0, 0.7], [0.0, 1.0, 0.0]);
        World::new(Arc::new(box_room(vec![leaning, proud]))).unwrap()
    });
    let lights = light_stage::lights(&protocol.light.stage, &ROOM, &[2, 3, 4, 5, 6, 7], &[box_camera()]);
    json!(format!("{lights:?}"))
}

/// Lightings of five groups, each half as bright as the one before.
fn relit(protocol: &Protocol) -> Value {
    json!(format!("{:?}", lightings(&protocol.light.relit, &[16.0, 8.0, 4.0, 2.0, 1.0].map(|light| [light; 3]))))
}

fn blocks(protocol: &Protocol) -> Value {
    let cameras: [Camera; 1] = [dataset().scenes[0].views[0].camera];
    json!(noise_blocks(&cameras, protocol.light.samples.block_pixels)[0].pixels())
}

fn refusal(protocol: &Protocol) -> Value {
    match protocol.check() {
        Ok(()) => json!("accepted"),
        Err(EvalError::OtherRule { rule, found, .. }) => json!([rule, found]),
        Err(other) => panic!("{other}"),
    }
}

/// The scores under every light.
fn light(protocol: &Protocol) -> Value {
    let result = scores_of_light(protocol, "living");
    let lit = result.summary.iter().filter(|(key, _)| key.to_string().starts_with("rgb_"));
    json!([lit.collect::<Vec<_>>(), result.noise])
}

fn fitted(protocol: &Protocol) -> Value {
    json!(scores_of_light(protocol, "living").fits)
}

fn scores_of_light(protocol: &Protocol, scene: &str) -> ProtocolResult {
    let mut results = score(&plan(&[&GREY], protocol, &[scene]), &|_| ()).unwrap();
    results.remove(0).protocols.into_values().next().unwrap()
}
