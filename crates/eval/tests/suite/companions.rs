//! Companions' pictures are made once, wherever they are kept; what is truncated, edited or of other inputs is named and
//! never used, and no score depends on where they came from.

use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex};

use mateval_eval::dataset_companions::{CompanionsReport, make_companions};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::PictureValue;
use mateval_eval::score::{ScorePlan, score};
use mateval_scene::companions_file::COMPANIONS_JSON;
use mateval_scene::dataset::DatasetFile;
use mateval_scene::open::Dataset;
use mateval_scene::render_file::{RENDER_FILE, RenderFile};
use mateval_scene::{Report, SceneId, Severity};
use mateval_testkit::kept_folder::{copy_folder, kept_folder};

use super::sample::{dataset, hasty, plan, write_grey};

const SCENE: &str = "room";

/// A submission, and its scores where no pictures are kept.
struct Scored {
    submission: PathBuf,
    pictures: Vec<PictureValue>,
}

static SCORED: LazyLock<Scored> = LazyLock::new(|| {
    let submission = kept_folder("companions").join("grey");
    write_grey(&submission);
    let pictures = scores(dataset(), &submission, None).0;
    assert!(pictures.iter().any(|value| value.noise.is_some()));
    Scored { submission, pictures }
});

/// The scores of a submission, and what was said meanwhile about pictures that were not used or not kept.
fn scores(dataset: &Dataset, submission: &Path, cache: Option<&Path>) -> (Vec<PictureValue>, Vec<String>) {
    let said = Mutex::new(Vec::new());
    let progress = |report: Report<'_>| {
        if let Report::Message(text) = report {
            said.lock().unwrap().push(text.to_owned());
        }
    };
    let protocol = hasty();
    let plan = ScorePlan { dataset, companion_cache: cache, ..plan(&[submission], &protocol, &[SCENE]) };
    let mut results = score(&plan, &progress).unwrap();
    let pictures = results.remove(0).protocols.remove("mateval-2").unwrap().pictures;
    (pictures, said.into_inner().unwrap())
}

fn same_scores(dataset: &Dataset, cache: Option<&Path>) -> Vec<String> {
    let (pictures, said) = scores(dataset, &SCORED.submission, cache);
    assert!(pictures == SCORED.pictures, "the scores depend on where the companions' pictures come from");
    said
}

fn make(root: &Path, protocol: &Protocol) -> CompanionsReport {
    let report = make_companions(root, &[SceneId::new(SCENE).unwrap()], protocol, &|_| ()).unwrap();
    mateval_prep::finish::finish_again(root, &|_| ()).unwrap();
    report
}

/// Writes the manifest of changed files.
fn rehash(root: &Path) {
    let path = root.join("dataset.json");
    let file: DatasetFile = mateval_scene::json::read(&path).unwrap();
    let manifest_sha256 = mateval_scene::manifest::write(root).unwrap();
    mateval_scene::json::write(&path, &DatasetFile { manifest_sha256, ..file }).unwrap();
}

/// A copy of the dataset.
fn copied() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_folder(&dataset().root, folder.path());
    folder
}

fn only_folder(parent: &Path) -> PathBuf {
    let mut folders = std::fs::read_dir(parent).unwrap().map(|entry| entry.unwrap().path());
    let folder = folders.next().unwrap();
    assert_eq!(folders.next(), None, "nothing else lies in {}", parent.display());
    folder
}

fn truncate(path: &Path) {
    let bytes = std::fs::read(path).unwrap();
    std::fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
}

#[test]
fn a_dataset_carries_them() {
    let copy = copied();
    let companions = Dataset::open(copy.path()).unwrap().folder(&SceneId::new(SCENE).unwrap()).companions();
    // What a killed run left is removed.
    std::fs::create_dir_all(companions.join(".companions-1")).unwrap();
    assert_eq!(make(copy.path(), &hasty()), CompanionsReport { made: 1, kept: 0 });
    assert_eq!(make(copy.path(), &hasty()), CompanionsReport { made: 0, kept: 1 });
    let pass = only_folder(&companions);
    assert_eq!(std::fs::read_dir(&pass).unwrap().count(), 1 + 2 * 5, "the list, and two halves of five views");
    let dataset = Dataset::open(copy.path()).unwrap();
    assert!(mateval_scene::manifest::check_those(copy.path(), |_| true).unwrap().is_empty());
    assert_eq!(same_scores(&dataset, None), Vec::<String>::new());

    // Of other rules: replaced.
    let mut other = hasty();
    (other.light.noise.least_companion_samples, other.light.noise.most_companion_samples) = (2, 2);
    assert_eq!(make(copy.path(), &other), CompanionsReport { made: 1, kept: 0 });
    let said = same_scores(&Dataset::open(copy.path()).unwrap(), None);
    assert!(said.len() == 1 && said[0].contains("was made from other inputs or rules"), "{said:?}");
    assert_eq!(make(copy.path(), &hasty()), CompanionsReport { made: 1, kept: 0 });

    // As many samples as the truth: fewer of those, and the pictures are made anew.
    let mut following = hasty();
    following.light.noise.most_companion_samples = 1000;
    assert_eq!(make(copy.path(), &following), CompanionsReport { made: 1, kept: 0 });
    assert_eq!(make(copy.path(), &following), CompanionsReport { made: 0, kept: 1 });
    for view in &dataset.scenes.iter().find(|scene| scene.id.as_str() == SCENE).unwrap().views {
        let scene = dataset.folder(&SceneId::new(SCENE).unwrap());
        let path = scene.render(dataset.file.scored_renderer.as_ref().unwrap(), &view.id).join(RENDER_FILE);
        let file: RenderFile = mateval_scene::json::read(&path).unwrap();
        mateval_scene::json::write(&path, &RenderFile { samples_each_half: 16, ..file }).unwrap();
    }
    rehash(copy.path());
    assert_eq!(make(copy.path(), &following), CompanionsReport { made: 1, kept: 0 });
    assert_eq!(make(copy.path(), &hasty()), CompanionsReport { made: 1, kept: 0 });
    let dataset = Dataset::open(copy.path()).unwrap();

    // A swapped picture: named, and not used.
    std::fs::copy(pass.join("input_a.exr"), pass.join("input_b.exr")).unwrap();
    let said = same_scores(&dataset, None);
    assert!(said.len() == 1 && said[0].contains("input_b.exr' is not the file that"), "{said:?}");

    // Companions of other files of the scene: `prep verify` warns.
    let stale = || {
        let found = mateval_audit::verify::verify(copy.path(), &|_| ()).unwrap();
        found.into_iter().filter(|finding| finding.code == "stale_companions").collect::<Vec<_>>()
    };
    assert_eq!(stale(), []);
    let scene_json = dataset.folder(&SceneId::new(SCENE).unwrap()).scene_file();
    let text = std::fs::read_to_string(&scene_json).unwrap();
    std::fs::write(&scene_json, format!("{text}\n")).unwrap();
    rehash(copy.path());
    let found = stale();
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].severity == Severity::Warning
            && found[0].file.ends_with("room/ground_truth/companions/own/companions.json")
    );
}

#[test]
fn a_cache_is_filled_once_and_repaired() {
    let cache = tempfile::tempdir().unwrap();
    assert_eq!(same_scores(dataset(), Some(cache.path())), Vec::<String>::new());
    let folder = only_folder(cache.path());
    let list = std::fs::read(folder.join(COMPANIONS_JSON)).unwrap();
    let faults: [(&str, &dyn Fn()); 4] = [
        ("is not the file that", &|| truncate(&folder.join("input_a.exr"))),
        ("input_b.exr", &|| std::fs::remove_file(folder.join("input_b.exr")).unwrap()),
        (COMPANIONS_JSON, &|| truncate(&folder.join(COMPANIONS_JSON))),
        ("other inputs", &|| {
            let text = String::from_utf8(list.clone()).unwrap();
            let at = text.find("\"key\": \"").unwrap() + 8;
            std::fs::write(
                folder.join(COMPANIONS_JSON),
                format!("{}{}{}", &text[..at], "0".repeat(64), &text[at + 64..]),
            )
            .unwrap();
        }),
    ];
    for (expected, damage) in faults {
        damage();
        let said = same_scores(dataset(), Some(cache.path()));
        assert!(said.len() == 1 && said[0].contains(expected), "{expected}: {said:?}");
        assert_eq!(std::fs::read(folder.join(COMPANIONS_JSON)).unwrap(), list, "{expected}: made anew");
    }
    assert_eq!(same_scores(dataset(), Some(cache.path())), Vec::<String>::new());
}

#[test]
fn a_cache_that_cannot_be_written_does_not_end_a_score() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    std::fs::write(&cache, "a file").unwrap();
    let said = same_scores(dataset(), Some(&cache));
    assert!(said.len() == 1 && said[0].contains("companions cannot be kept"), "{said:?}");
}

#[test]
fn two_scorings_share_a_cache() {
    let cache = tempfile::tempdir().unwrap();
    std::thread::scope(|scope| {
        let both = [(); 2].map(|()| scope.spawn(|| same_scores(dataset(), Some(cache.path()))));
        both.into_iter().for_each(|one| assert_eq!(one.join().unwrap(), Vec::<String>::new()));
    });
    only_folder(cache.path());
}
