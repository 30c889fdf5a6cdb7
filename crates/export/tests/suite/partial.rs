//! Datasets from which whole scenes are absent.

use mateval_export::Format;
use mateval_scene::dataset::DatasetFile;
use mateval_scene::dataset_id::DatasetId;
use mateval_scene::open::{Dataset, chosen_ids};
use mateval_scene::{SceneId, json};

use super::sample::{copy, exported};

fn id(text: &str) -> SceneId {
    SceneId::new(text).unwrap()
}

#[test]
fn an_absent_scene_is_named_where_it_is_needed() {
    let folder = copy();
    std::fs::remove_dir_all(folder.path().join("scenes/living")).unwrap();
    let dataset = Dataset::open(folder.path()).unwrap();
    assert_eq!(dataset.absent, [id("living")]);
    assert_eq!(dataset.chosen_scenes(&[]).unwrap().len(), 1);
    let absence = dataset.absence().unwrap();
    assert!(absence.starts_with("1 of the 2 scenes of '"), "{absence}");
    let expected = "/dataset.json' lists are missing: unpack 'scenes/living.tar' in the dataset's folder";
    for error in [
        dataset.scene(&id("living")).unwrap_err(),
        dataset.check_whole().unwrap_err(),
        // What rewrites the manifest would drop the absent scene's lines.
        chosen_ids(folder.path(), &dataset.file, &[id("room")]).unwrap_err(),
    ] {
        let text = error.to_string();
        assert!(text.starts_with("the folders of 1 of the 2 scenes that '") && text.ends_with(expected), "{text}");
    }
    // Results state that they are partial.
    let stated = DatasetId::new(&dataset, &dataset.scenes);
    assert_eq!((stated.scenes, stated.total_scenes), (vec![id("room")], 2));
}

#[test]
fn without_any_scene_nothing_can_be_chosen() {
    let folder = copy();
    std::fs::remove_dir_all(folder.path().join("scenes")).unwrap();
    let dataset = Dataset::open(folder.path()).unwrap();
    assert!(dataset.scenes.is_empty());
    let text = dataset.chosen_scenes(&[]).unwrap_err().to_string();
    assert!(text.contains("'scenes/living.tar', 'scenes/room.tar'"), "{text}");
}

/// A scene that the manifest does not list was never part of the dataset.
#[test]
fn a_scene_that_only_dataset_json_lists_is_a_fault() {
    let folder = copy();
    let path = folder.path().join("dataset.json");
    let mut file: DatasetFile = json::read(&path).unwrap();
    file.scenes.push(id("attic"));
    json::write(&path, &file).unwrap();
    let text = Dataset::open(folder.path()).unwrap_err().to_string();
    assert!(text.contains("scenes/attic/scene.json"), "{text}");
}

/// The twin: a scene is there as a whole or not at all.
#[test]
fn a_scene_that_is_half_there_is_refused() {
    let folder = copy();
    std::fs::remove_file(folder.path().join("scenes/living/scene.json")).unwrap();
    let text = Dataset::open(folder.path()).unwrap_err().to_string();
    assert!(text.contains("scenes/living/scene.json"), "{text}");
}

#[test]
fn formats_of_the_whole_dataset_need_all_scenes() {
    let folder = copy();
    std::fs::remove_dir_all(folder.path().join("scenes/living")).unwrap();
    for format in [Format::Tar, Format::Croissant, Format::Huggingface] {
        let text = exported(folder.path(), format).1.unwrap_err().to_string();
        assert!(text.starts_with("the folders of 1 of the 2 scenes"), "{text}");
    }
    for format in [Format::Nerfstudio, Format::Colmap] {
        assert_eq!(exported(folder.path(), format).1.unwrap().scenes, 1);
    }
}
