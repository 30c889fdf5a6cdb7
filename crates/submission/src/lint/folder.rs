//! The names of a submission's folders and files: listed, four levels deep, and compared with the dataset's. Names may
//! be missing, superfluous or misspelt. Links that lead out of the folder are not followed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::{Instance, SceneFile};
use mateval_dataset::open::Dataset;
use mateval_dataset::submission::{Map, SUBMISSION};
use mateval_dataset::{Finding, SceneId};
use mateval_files::FileError;
use mateval_files::untrusted::{distance, nearest, plain, shortened};

use crate::archive::MAX_ENTRIES;
use crate::error::{SubmissionError, error, note, warning};
use crate::map_file::default_value;
use crate::prediction::MISSING_MAP;

/// How deep maps lie: `scenes/<scene>/<instance>/<map>`.
const DEPTH: usize = 4;
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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    File,
    Folder,
    /// Leads nowhere, or out of the folder.
    BadLink,
    Other,
}

/// Entries by their path, relative to the submission, with forward slashes.
pub(super) struct Tree {
    entries: BTreeMap<String, Kind>,
}

impl Tree {
    /// Lists the folder. Names that are not UTF-8 and entries beyond the limit are findings.
    pub(super) fn walk(root: &Path) -> Result<(Self, Vec<Finding>), SubmissionError> {
        let real = root.canonicalize().map_err(FileError::io("open", root))?;
        let (mut tree, mut findings) = (Self { entries: BTreeMap::new() }, Vec::new());
        let mut folders = vec![(String::new(), 1)];
        while let Some((folder, depth)) = folders.pop() {
            let path = real.join(&folder);
            for entry in std::fs::read_dir(&path).map_err(FileError::io("list", &path))? {
                let entry = entry.map_err(FileError::io("list", &path))?;
                if tree.entries.len() == MAX_ENTRIES {
                    let message = format!("more than {MAX_ENTRIES} files and folders; the rest was not checked");
                    findings.push(error("too_many_files", &folder, message, "keep submission.json and the maps only"));
                    return Ok((tree, findings));
                }
                let Some(name) = entry.file_name().to_str().map(|name| joined(&folder, name)) else {
                    let name = shortened(&entry.file_name().to_string_lossy());
                    findings.push(error("bad_name", &joined(&folder, &name), "a name that is not UTF-8", "rename it"));
                    continue;
                };
                let kind = kind_of(&real, &entry.path());
                if kind == Kind::Folder && depth < DEPTH {
                    folders.push((name.clone(), depth + 1));
                }
                tree.entries.insert(name, kind);
            }
        }
        Ok((tree, findings))
    }

    pub(super) fn kind(&self, path: &str) -> Option<Kind> {
        self.entries.get(path).copied()
    }

    /// Names and kinds of the entries in a folder, sorted; an empty path is the submission's own folder.
    pub(super) fn children<'a>(&'a self, folder: &str) -> impl Iterator<Item = (&'a str, Kind)> + use<'a> {
        let prefix = if folder.is_empty() { String::new() } else { format!("{folder}/") };
        let length = prefix.len();
        let below = self.entries.range(prefix.clone()..).take_while(move |(path, _)| path.starts_with(&prefix));
        below.filter_map(move |(path, kind)| (!path[length..].contains('/')).then_some((&path[length..], *kind)))
    }
}

pub(super) fn joined(folder: &str, name: &str) -> String {
    if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") }
}

/// The kind of an entry; a link that stays inside the folder has the kind of its target.
fn kind_of(root: &Path, path: &Path) -> Kind {
    let is_link = path.symlink_metadata().is_ok_and(|data| data.is_symlink());
    let place: Option<PathBuf> = if is_link { path.canonicalize().ok() } else { Some(path.to_owned()) };
    let Some(place) = place.filter(|place| place.starts_with(root)) else { return Kind::BadLink };
    match place.metadata() {
        Ok(data) if data.is_file() => Kind::File,
        Ok(data) if data.is_dir() => Kind::Folder,
        _ => Kind::Other,
    }
}

pub(super) fn check(dataset: &Dataset, tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, kind) in tree.children("") {
        match (name, kind) {
            (SUBMISSION, _) | ("scenes", Kind::Folder) => {}
            _ => findings.extend(unexpected(name, kind)),
        }
    }
    // A submission may cover scenes that were not downloaded, and twins, and need not.
    let twins = &dataset.file.twins;
    let exists = |id: &SceneId| tree.kind(&joined("scenes", id.as_str())).is_some();
    let is_covered = |id: &&SceneId| exists(id) || !dataset.absent.contains(id) && !twins.contains_key(id);
    for (id, twin) in twins.iter().filter(|(id, _)| !exists(id) && !dataset.absent.contains(id)) {
        let message = format!("the folder of this twin of scene '{}' is missing", twin.of);
        let action = "answer it from its own photo; without it constancy has no value";
        findings.push(warning("missing_twin", &joined("scenes", id.as_str()), message, action));
    }
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
                findings.push(error(MISSING_MAP, &place, message, "write it; a missing one scores as linear 0.5"));
            }
            0 => {
                // Each map has a code of its own, since the findings of one code become one line.
                let code = format!("default_{}", map.stem());
                let message = format!("{} is missing, which the format allows", map.stem());
                let value = default_value(map);
                let action = format!("rendered as {value}; scored as {value} too if any other instance has the map");
                findings.push(note(&code, &place, message, action));
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
    let stem = plain(stem);
    let near = |map: &Map| distance(&stem, &plain(map.stem())) <= 2;
    let named = |(map, names): &(Map, &[&str])| names.contains(&stem.as_str()).then_some(*map);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_ends_after_four_levels() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("scenes/s/i/deep/deeper")).unwrap();
        std::fs::write(folder.path().join("scenes/s/i/a.png"), "").unwrap();
        std::fs::write(folder.path().join("scenes/s/i/deep/b.png"), "").unwrap();
        let (tree, findings) = Tree::walk(folder.path()).unwrap();
        assert_eq!(findings, Vec::new());
        let inside: Vec<_> = tree.children("scenes/s/i").collect();
        assert_eq!(inside, [("a.png", Kind::File), ("deep", Kind::Folder)]);
        assert_eq!((tree.children("").count(), tree.kind("scenes/s/i/deep/b.png")), (1, None));
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_are_not_followed_and_loops_end() {
        let (folder, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let link = |to: &Path, name: &str| std::os::unix::fs::symlink(to, folder.path().join(name)).unwrap();
        link(outside.path(), "out");
        link(Path::new("nowhere"), "broken");
        link(folder.path(), "loop");
        let (tree, _) = Tree::walk(folder.path()).unwrap();
        let kinds = ["out", "broken", "loop", "loop/loop/loop/out"].map(|name| tree.kind(name));
        assert_eq!(kinds, [Kind::BadLink, Kind::BadLink, Kind::Folder, Kind::BadLink].map(Some));
        assert_eq!(tree.kind("loop/loop/loop/loop/loop"), None);
    }
}
