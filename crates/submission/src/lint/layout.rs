//! The names of a submission's folders and files compared with the dataset's: missing, superfluous and misspelt ones.

use std::collections::BTreeMap;

use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::findings::shortened;
use mateval_scene::open::Dataset;
use mateval_scene::submission::{Map, SUBMISSION};
use mateval_scene::{Finding, SceneId};

use super::finding::{error, note, warning};
use super::names::{distance, nearest, plain};
use super::tree::{Kind, Tree, joined};
use crate::default_map::default_value;

/// Most unknown names in a folder that are compared with the missing ones.
const MOST_GUESSED: usize = 200;

/// What other programs call the maps.
const OTHER_NAMES: [(Map, &[&str]); 3] = [
    (Map::BaseColor, &["albedo", "diffuse", "diffusealbedo", "color", "colour", "basecolour", "kd", "rgb", "texture"]),
    (Map::Roughness, &["rough", "roughnessmap", "perceptualroughness"]),
    (Map::Metallic, &["metal", "metalness", "metallicness", "metallicity"]),
];

/// File name endings of pictures that are not read.
const OTHER_ENDINGS: [&str; 12] =
    ["jpg", "jpeg", "tif", "tiff", "tga", "bmp", "webp", "hdr", "npy", "dds", "ktx", "avif"];

/// Every finding about names.
pub(super) fn check(dataset: &Dataset, tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, kind) in tree.children("") {
        match (name, kind) {
            (SUBMISSION, _) | ("scenes", Kind::Folder) => {}
            _ => findings.extend(unexpected(name, kind)),
        }
    }
    // A submission may cover scenes that were not downloaded, and need not.
    let is_covered =
        |id: &&SceneId| !dataset.absent.contains(id) || tree.kind(&joined("scenes", id.as_str())).is_some();
    let known: Vec<&str> = dataset.file.scenes.iter().filter(is_covered).map(SceneId::as_str).collect();
    if tree.kind("scenes") != Some(Kind::Folder) {
        let message = "the folder 'scenes' is missing";
        findings.push(error(
            "no_scenes_folder",
            "scenes",
            message,
            "put scenes/<scene>/<instance>/ beside submission.json",
        ));
        return findings;
    }
    let states = matched("scenes", tree, &known, SCENE, &mut findings);
    for scene in dataset.scenes.iter().filter(|scene| states.get(scene.id.as_str()) == Some(&State::Present)) {
        check_scene(tree, scene, &mut findings);
    }
    findings
}

/// A finding where not the folder given, but one inside it, holds the submission.
pub(super) fn nested(tree: &Tree) -> Option<Finding> {
    if tree.kind(SUBMISSION).is_some() {
        return None;
    }
    let (name, _) = tree.children("").find(|(name, _)| tree.kind(&joined(name, SUBMISSION)).is_some())?;
    let message = "the submission is in this folder, not in the one that was given";
    Some(error("nested_submission", name, message, "give the path of this folder"))
}

/// The codes about one kind of folder, and its name in messages.
struct FolderCodes {
    missing: &'static str,
    misnamed: &'static str,
    extra: &'static str,
    what: &'static str,
}

const SCENE: FolderCodes =
    FolderCodes { missing: "missing_scene", misnamed: "misnamed_scene", extra: "extra_scene", what: "scene" };
const OBJECT: FolderCodes =
    FolderCodes { missing: "missing_object", misnamed: "misnamed_object", extra: "extra_object", what: "instance" };

/// Whether an expected folder exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Present,
    Missing,
    /// Exists under another name.
    Misnamed,
}

/// The state of each expected folder in `folder`. Adds a finding for each that is missing or misnamed, and for any
/// other entry.
fn matched<'a>(
    folder: &str,
    tree: &Tree,
    expected: &[&'a str],
    codes: FolderCodes,
    findings: &mut Vec<Finding>,
) -> BTreeMap<&'a str, State> {
    let exists = |name: &&'a str| tree.kind(&joined(folder, name)).is_some();
    let mut states: BTreeMap<&str, State> =
        expected.iter().map(|name| (*name, if exists(name) { State::Present } else { State::Missing })).collect();
    let mut guesses = MOST_GUESSED;
    for (name, kind) in tree.children(folder) {
        let path = joined(folder, name);
        if states.contains_key(name) {
            findings.extend(not_a_folder(&path, kind));
            continue;
        }
        let missing = states.iter().filter(|(_, state)| **state == State::Missing).map(|(name, _)| *name);
        let near = if kind == Kind::Folder && guesses > 0 { nearest(name, missing) } else { None };
        guesses = guesses.saturating_sub(1);
        match near {
            Some(near) => {
                states.insert(near, State::Misnamed);
                let message = format!("no {} has this name, and '{near}' is missing", codes.what);
                findings.push(error(codes.misnamed, &path, message, format!("rename it to '{near}'")));
            }
            None if kind == Kind::Folder => {
                let message = format!("no {} of the dataset has this name", codes.what);
                findings.push(warning(codes.extra, &path, message, "leave it out; it is not scored"));
            }
            None => findings.extend(unexpected(&path, kind)),
        }
    }
    let missing = states.iter().filter(|(_, state)| **state == State::Missing);
    findings.extend(missing.map(|(name, _)| {
        let action = "write its maps; a missing one scores as grey";
        error(codes.missing, &joined(folder, name), "the folder is missing", action)
    }));
    states
}

/// A finding where the name of an expected folder belongs to something else.
fn not_a_folder(path: &str, kind: Kind) -> Option<Finding> {
    let action = "replace it by the folder itself";
    match kind {
        Kind::Folder => None,
        Kind::BadLink => {
            let message = "a link that leads nowhere, or out of the submission's folder; it is not followed";
            Some(error("link_leads_out", path, message, action))
        }
        _ => Some(error("not_a_folder", path, "expected a folder", action)),
    }
}

/// A finding about an entry that is not expected at all.
fn unexpected(path: &str, kind: Kind) -> Option<Finding> {
    match kind {
        Kind::BadLink => {
            let message = "a link that leads nowhere, or out of the submission's folder; it is not followed";
            Some(warning("useless_link", path, message, "leave it out"))
        }
        _ => Some(note("extra_file", path, "no file or folder of this name is expected", "it is not read")),
    }
}

fn check_scene(tree: &Tree, scene: &SceneFile, findings: &mut Vec<Finding>) {
    let folder = format!("scenes/{}", scene.id);
    let (wanted, unneeded): (Vec<&Instance>, Vec<&Instance>) =
        scene.instances.iter().partition(|instance| instance.atlas.is_some());
    let names: Vec<&str> = wanted.iter().map(|instance| instance.id.as_str()).collect();
    let mut found = Vec::new();
    let states = matched(&folder, tree, &names, OBJECT, &mut found);
    // A folder for an instance that needs no maps is no fault.
    let of_unneeded = |finding: &Finding| {
        unneeded.iter().any(|instance| finding.file == joined(&folder, instance.id.as_str()))
            && finding.code == OBJECT.extra
    };
    for finding in found {
        findings.push(if of_unneeded(&finding) {
            note("unneeded_object", &finding.file, "this instance has no atlas (glass)", "it is not read")
        } else {
            finding
        });
    }
    for name in names.iter().filter(|name| states.get(*name) == Some(&State::Present)) {
        let folder = joined(&folder, name);
        if tree.kind(&folder) == Some(Kind::Folder) {
            check_object(tree, &folder, findings);
        }
    }
}

fn check_object(tree: &Tree, folder: &str, findings: &mut Vec<Finding>) {
    let files = |map: Map| {
        ["png", "exr"].iter().filter(|ending| tree.kind(&format!("{folder}/{}.{ending}", map.stem())).is_some()).count()
    };
    let mut meant: Vec<Map> = Vec::new();
    for (name, kind) in tree.children(folder) {
        let path = joined(folder, name);
        let (stem, ending) = name.rsplit_once('.').unwrap_or((name, ""));
        let own = Map::ALL.into_iter().find(|map| map.stem() == stem && matches!(ending, "png" | "exr"));
        let absent = |map: &Map| files(*map) == 0 && !meant.contains(map);
        match (own, meaning(stem, ending).filter(absent)) {
            (Some(_), _) => {}
            (None, Some(map)) if kind == Kind::File => {
                meant.push(map);
                findings.push(misnamed(&path, map, stem, ending));
            }
            _ => findings.extend(unexpected(&path, kind)),
        }
    }
    for map in Map::ALL {
        let place = format!("{folder}/{}.png", map.stem());
        match files(map) {
            0 if meant.contains(&map) => {}
            0 if map == Map::BaseColor => {
                let message = "expected a PNG or an EXR, found none";
                findings.push(error("missing_map", &place, message, "write it; a missing one scores as linear 0.5"));
            }
            0 => {
                // Each map has a code of its own, since the findings of one code become one line.
                let code = format!("default_{}", map.stem());
                let message = format!("{} is missing, which the format allows", map.stem());
                findings.push(note(&code, &place, message, format!("scored as {}", default_value(map))));
            }
            2 => {
                let message = "found both a PNG and an EXR; expected one of them";
                findings.push(error("ambiguous_map", &place, message, "leave one of them out"));
            }
            _ => {}
        }
    }
}

/// The map that a misnamed file was probably meant to be.
fn meaning(stem: &str, ending: &str) -> Option<Map> {
    let ending = ending.to_lowercase();
    if !matches!(ending.as_str(), "png" | "exr") && !OTHER_ENDINGS.contains(&ending.as_str()) {
        return None;
    }
    let plain = plain(stem);
    let near = |map: &Map| distance(&plain, &super::names::plain(map.stem())) <= 2;
    let named = |(map, names): &(Map, &[&str])| names.contains(&plain.as_str()).then_some(*map);
    Map::ALL.into_iter().find(near).or_else(|| OTHER_NAMES.iter().find_map(named))
}

fn misnamed(path: &str, map: Map, stem: &str, ending: &str) -> Finding {
    let name = map.stem();
    if stem == name && !ending.eq_ignore_ascii_case("png") && !ending.eq_ignore_ascii_case("exr") {
        let message = format!("a .{} file is not read as a map", shortened(ending));
        return error("wrong_ending", path, message, format!("write it as {name}.png or {name}.exr"));
    }
    let message = format!("this file is not read, and {name} is missing");
    error("misnamed_map", path, message, format!("rename it to {name}.{}", ending.to_lowercase()))
}
