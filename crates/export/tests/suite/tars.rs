//! Tars have the same bytes everywhere, and unpacked they are the dataset.

use std::path::Path;

use mateval_export::Format;
use mateval_scene::manifest::{self, sha256_of_file};
use mateval_scene::open::Dataset;
use mateval_testkit::packed::files;

use super::sample::{copy, exported, root};

fn unpack(tar: &Path, place: &Path) {
    tar::Archive::new(std::fs::File::open(tar).unwrap()).unpack(place).unwrap();
}

/// Times, modes and hidden files of the dataset's folder do not reach the tars.
#[test]
fn they_depend_on_nothing_but_the_files() {
    let other = copy();
    std::fs::write(other.path().join(".hidden"), "x").unwrap();
    for (name, _) in files(other.path()) {
        let file = std::fs::File::options().write(true).open(other.path().join(name)).unwrap();
        file.set_modified(std::time::SystemTime::UNIX_EPOCH).unwrap();
    }
    let (first, _) = exported(root(), Format::Tar);
    let (second, found) = exported(other.path(), Format::Tar);
    assert_eq!(found.unwrap().scenes, 2);
    let names: Vec<String> = files(&first.path().join("out")).into_iter().map(|(name, _)| name).collect();
    let expected = ["TARS.sha256", "base.tar", "licences/room.txt", "scenes/living.tar", "scenes/room.tar"];
    assert_eq!(names, expected);
    assert!(files(&first.path().join("out")) == files(&second.path().join("out")));
}

#[test]
fn headers_hold_nothing_of_the_machine_and_names_are_sorted() {
    let (folder, _) = exported(root(), Format::Tar);
    let mut seen = 0;
    for name in ["base.tar", "scenes/living.tar", "scenes/room.tar"] {
        let mut archive = tar::Archive::new(std::fs::File::open(folder.path().join("out").join(name)).unwrap());
        let mut names = Vec::new();
        for entry in archive.entries().unwrap() {
            let entry = entry.unwrap();
            let header = entry.header();
            assert_eq!(
                [header.mtime().unwrap(), header.uid().unwrap(), header.gid().unwrap(), header.mode().unwrap().into()],
                [0, 0, 0, 0o644]
            );
            assert_eq!(header.entry_type(), tar::EntryType::Regular);
            names.push(entry.path().unwrap().to_str().unwrap().to_owned());
        }
        assert!(names.is_sorted(), "{names:?}");
        seen += names.len();
    }
    assert_eq!(seen, manifest::entries(root()).unwrap().len() + 2);
}

#[test]
fn unpacked_they_are_the_dataset() {
    let (folder, _) = exported(root(), Format::Tar);
    let (out, place) = (folder.path().join("out"), folder.path().join("again"));
    for line in std::fs::read_to_string(out.join("TARS.sha256")).unwrap().lines() {
        let (sha256, name) = line.split_once("  ").unwrap();
        assert_eq!(sha256_of_file(&out.join(name)).unwrap(), sha256);
        unpack(&out.join(name), &place);
    }
    // What `prep` keeps for itself does not travel.
    let of_dataset = |root: &Path| {
        let mut files = files(root);
        files.retain(|(name, _)| !name.starts_with(".build"));
        files
    };
    assert!(of_dataset(&place) == of_dataset(root()));
}

#[test]
fn the_base_and_one_scene_open() {
    let (folder, _) = exported(root(), Format::Tar);
    let (out, place) = (folder.path().join("out"), folder.path().join("part"));
    unpack(&out.join("base.tar"), &place);
    assert_eq!(Dataset::open(&place).unwrap().absent.len(), 2);
    unpack(&out.join("scenes/room.tar"), &place);
    let dataset = Dataset::open(&place).unwrap();
    assert_eq!(dataset.scenes.iter().map(|scene| scene.id.as_str()).collect::<Vec<_>>(), ["room"]);
    dataset.check_files(&dataset.scenes[0].id, |_| true).unwrap();
}
