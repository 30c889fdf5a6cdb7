//! `eval lint` on the sample: the good submission is clean, and every planted fault is found by its own code, with no
//! other error and no other warning.

mod files;
mod folder;
mod pictures;
pub mod written;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_scene::Severity;
use mateval_submission::lint::{LintFile, LintPlan, lint};

use mateval_testkit::sample_dataset::{dataset, write_truth};

/// A code, its severity, and the change of a good submission.
type Fault = (&'static str, Severity, fn(&Path));

const ERROR: Severity = Severity::Error;
const WARNING: Severity = Severity::Warning;
const NOTE: Severity = Severity::Note;

/// The map for faults that need only one: textured, and visible in the input view.
fn map(submission: &Path, name: &str) -> PathBuf {
    submission.join("scenes/room/rug").join(name)
}

/// All maps with this name.
fn every(submission: &Path, name: &str) -> Vec<PathBuf> {
    let scenes = ["living", "room"].map(|scene| submission.join("scenes").join(scene));
    let instances = scenes.iter().flat_map(|scene| std::fs::read_dir(scene).unwrap());
    let files: Vec<PathBuf> = instances.map(|entry| entry.unwrap().path().join(name)).collect();
    assert!(files.len() > 20 && files.iter().all(|file| file.is_file()));
    files
}

fn good() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_truth(&folder.path().join("gt"));
    folder
}

fn linted(submission: &Path) -> LintFile {
    let plan = LintPlan { dataset: dataset(), submission, tool: "test".to_owned() };
    lint(&plan, &|_| ()).unwrap()
}

fn codes(file: &LintFile, severity: Severity) -> BTreeSet<String> {
    let of_severity = file.findings.iter().filter(|finding| finding.severity == severity);
    of_severity.map(|finding| finding.code.clone()).collect()
}

#[test]
fn the_good_submission_is_clean() {
    let folder = good();
    let file = linted(&folder.path().join("gt"));
    assert!(file.good && file.maps > 60, "{file:?}");
    assert_eq!((codes(&file, ERROR), codes(&file, WARNING)), (BTreeSet::new(), BTreeSet::new()), "{file:?}");
    // Being the truth is not a fault, but is reported.
    assert_eq!(codes(&file, NOTE), BTreeSet::from(["copy_of_truth".to_owned()]));
    assert_eq!(file.method.as_deref(), Some("gt"));
}

/// Checks one table of faults and returns the number of codes.
fn check(faults: &[Fault]) {
    let mut wrong = Vec::new();
    for (at, (code, severity, plant)) in faults.iter().enumerate() {
        let folder = good();
        let submission = folder.path().join("gt");
        plant(&submission);
        let file = linted(&submission);
        let (errors, warnings) = (codes(&file, ERROR), codes(&file, WARNING));
        let own = BTreeSet::from([(*code).to_owned()]);
        let found = match severity {
            Severity::Error => errors == own && warnings.is_empty(),
            Severity::Warning => errors.is_empty() && warnings == own,
            Severity::Note => errors.is_empty() && warnings.is_empty() && codes(&file, NOTE).contains(*code),
        };
        if !found || file.good != errors.is_empty() {
            wrong
                .push(format!("{at} {code}: errors {errors:?}, warnings {warnings:?}, notes {:?}", codes(&file, NOTE)));
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
}

#[test]
fn faults_of_names_and_of_submission_json() {
    check(folder::FAULTS);
}

#[test]
fn faults_of_files() {
    check(files::FAULTS);
}

#[test]
fn faults_that_only_pictures_reveal() {
    check(pictures::FAULTS);
}

#[test]
fn each_fault_has_a_code_of_its_own() {
    let all = [folder::FAULTS, files::FAULTS, pictures::FAULTS].concat();
    let distinct: BTreeSet<&str> = all.iter().map(|(code, ..)| *code).collect();
    // A truncated JSON and a duplicate key are the same fault.
    assert_eq!(distinct.len(), all.len() - 1);
    assert!(distinct.len() >= 40, "{} codes", distinct.len());
}

/// Baselines have no findings but those that state what they are.
#[test]
fn baselines_are_not_accused() {
    let folder = tempfile::tempdir().unwrap();
    let nn = folder.path().join("nn");
    mateval_testkit::sample_dataset::write_nearest(&nn);
    let file = linted(&nn);
    assert_eq!((codes(&file, ERROR), codes(&file, WARNING)), (BTreeSet::new(), BTreeSet::new()), "{file:?}");
    let grey = folder.path().join("grey");
    mateval_testkit::sample_dataset::write_grey(&grey);
    let file = linted(&grey);
    assert_eq!(codes(&file, ERROR), BTreeSet::new());
    assert!(codes(&file, WARNING).contains("same_base_color"), "{file:?}");
}

/// Without the ground truth lint finds the same, except copies of it.
#[test]
fn a_public_dataset_is_enough() {
    let (folder, public) = (good(), tempfile::tempdir().unwrap());
    copy_public(&dataset().root, public.path());
    let opened = mateval_scene::open::Dataset::open(public.path()).unwrap();
    let submission = folder.path().join("gt");
    let look =
        |submission: &Path| lint(&LintPlan { dataset: &opened, submission, tool: "test".to_owned() }, &|_| ()).unwrap();
    assert!(look(&submission).findings.is_empty());
    pictures::flip(&submission);
    assert_eq!(codes(&look(&submission), WARNING), BTreeSet::from(["flipped_vertically".to_owned()]));
}

pub fn copy_public(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(|entry| entry.unwrap()) {
        let place = to.join(entry.file_name());
        if entry.file_name() == "ground_truth" {
            continue;
        }
        if entry.path().is_dir() {
            copy_public(&entry.path(), &place);
        } else {
            std::fs::copy(entry.path(), place).unwrap();
        }
    }
}
