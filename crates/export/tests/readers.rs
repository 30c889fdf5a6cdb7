//! Opens the exports with the packages that they are made for.
//!
//! `tools/test_exports.sh` installs the packages, sets `MATEVAL_EXPORT_PYTHON` to the Python interpreter that has them, and
//! runs these tests.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]
#![allow(clippy::print_stderr, reason = "what the packages print is shown")]

use std::path::Path;
use std::process::Command;

use mateval_export::codabench::{self, Column, Competition};
use mateval_export::croissant::Publication;
use mateval_export::{ExportOptions, Format, export};
use mateval_testkit::sample_dataset;

/// Exports the sample to `out`.
fn write(format: Format, out: &Path) {
    let publication = Publication {
        url: None,
        date: Some("2026-11-24".to_owned()),
        citation: Some("The sample of MatEval".to_owned()),
    };
    let dataset = sample_dataset::dataset().root.clone();
    let options = ExportOptions { dataset, format, out: out.to_owned(), publication };
    export(&options, &|_| ()).unwrap();
}

/// Runs `tests/readers/<script>` with these words; its caches lie in `home`.
fn run(script: &str, home: &Path, words: &[&Path]) {
    let python = std::env::var_os("MATEVAL_EXPORT_PYTHON")
        .expect("MATEVAL_EXPORT_PYTHON names no Python with the packages: run tools/test_exports.sh");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/readers").join(script);
    let mut command = Command::new(python);
    // A package that looked for something on the network would fail.
    command.env("HF_HUB_OFFLINE", "1").env("HF_HOME", home.join("hf")).env("CROISSANT_CACHE", home.join("croissant"));
    let output = command.arg(&script).arg(&sample_dataset::dataset().root).args(words).output().unwrap();
    let [stdout, stderr] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    eprintln!("{stdout}{stderr}");
    assert!(output.status.success(), "{}: {}", script.display(), output.status);
}

#[test]
fn mlcroissant_validates_the_description_and_loads_its_records() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    write(Format::Croissant, &out);
    run("read_croissant.py", folder.path(), &[&out]);
}

#[test]
fn datasets_loads_the_split_and_huggingface_hub_reads_the_card() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    write(Format::Huggingface, &out);
    run("read_huggingface.py", folder.path(), &[&out]);
}

#[test]
fn pycolmap_projects_points_to_the_pixels_of_transforms_json() {
    let folder = tempfile::tempdir().unwrap();
    let [colmap, nerfstudio] = ["colmap", "nerfstudio"].map(|name| folder.path().join(name));
    write(Format::Colmap, &colmap);
    write(Format::Nerfstudio, &nerfstudio);
    run("read_cameras.py", folder.path(), &[&colmap, &nerfstudio]);
}

/// One task of both scenes, and one for each.
#[test]
fn competitions_are_what_codabench_documents() {
    for (seconds_a_scene, tasks) in [(None, 1), (Some(400), 2)] {
        let folder = tempfile::tempdir().unwrap();
        let column = |key: &str| Column { key: key.to_owned(), higher_is_better: true, digits: 2 };
        let competition = Competition {
            dataset: sample_dataset::dataset().root.clone(),
            private: None,
            floors: Vec::new(),
            out: folder.path().join("out"),
            image: "example/mateval:1".to_owned(),
            columns: ["albedo.novel.psnr", "rgb_true.novel.psnr"].map(column).to_vec(),
            seconds_a_scene,
            limit: 600,
            url: None,
            date: None,
        };
        assert_eq!(codabench::export(&competition, &|_| ()).unwrap(), (2, tasks));
        run("read_codabench.py", folder.path(), &[&competition.out, Path::new(&tasks.to_string())]);
    }
}
