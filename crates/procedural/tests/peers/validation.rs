//! The built-in files in MaterialX: valid, and translated to OSL, GLSL and MDL.

use std::ffi::OsStr;
use std::path::PathBuf;

use mateval_procedural::Settings;
use mateval_procedural::library::LIBRARY;
use mateval_procedural::mtlx::{to_text, to_text_of_all};
use serde_json::Value;

use super::python::with_materialx;

fn check(files: &[PathBuf]) -> Vec<Value> {
    let files: Vec<&OsStr> = files.iter().map(|file| file.as_os_str()).collect();
    serde_json::from_slice(&with_materialx("check_files.py", &files)).unwrap()
}

/// Files as they are in the folder, and as this crate writes them.
#[test]
fn all_files_are_valid_and_have_shaders_in_three_languages() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    for entry in &LIBRARY {
        for (kind, text) in [("built_in", entry.text.to_owned()), ("written", to_text(&entry.graph().unwrap()))] {
            files.push(folder.path().join(format!("{}_{kind}.mtlx", entry.name)));
            std::fs::write(files.last().unwrap(), text).unwrap();
        }
    }
    let reports = check(&files);
    assert_eq!(reports.len(), 56);
    for report in reports {
        assert_eq!(report["faults"], "", "{report}");
        for language in ["osl", "glsl", "mdl"] {
            // Three outputs and a material.
            let lengths = report["shaders"][language].as_array().unwrap();
            assert!(lengths.len() == 4 && lengths.iter().all(|length| length.as_u64() > Some(300)), "{report}");
        }
    }
}

/// One file that holds graphs of different settings under names of their own.
#[test]
fn a_file_of_all_graphs_is_valid() {
    let folder = tempfile::tempdir().unwrap();
    let named = LIBRARY.iter().enumerate().map(|(at, entry)| {
        let graph = entry.graph().unwrap();
        Settings::defaults(&graph).as_defaults(&graph, &format!("part_{at}"))
    });
    let file = folder.path().join("materials.mtlx");
    std::fs::write(&file, to_text_of_all(&named.collect::<Vec<_>>())).unwrap();
    let reports = check(&[file]);
    assert_eq!(reports[0]["faults"], "", "{reports:?}");
    // Three outputs and a material each.
    assert_eq!(reports[0]["shaders"]["osl"].as_array().unwrap().len(), 4 * LIBRARY.len());
}

/// The twin: a file whose nodes do not fit together.
#[test]
fn a_faulty_file_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("faulty.mtlx");
    let text = LIBRARY[0].text.replacen(r#"type="color3" interfacename"#, r#"type="float" interfacename"#, 1);
    assert_ne!(text, LIBRARY[0].text);
    std::fs::write(&file, text).unwrap();
    assert_ne!(check(&[file])[0]["faults"], "");
}
