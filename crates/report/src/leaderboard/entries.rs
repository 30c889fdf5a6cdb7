//! The entries of a board, read from their files. All files are checked before any is refused, so that the error lists
//! everything that must change.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_eval::EvalError;
use mateval_eval::result::{PictureValues, ResultFile};
use mateval_scene::findings::shortened;
use mateval_scene::{Finding, SceneError, Severity};
use mateval_submission::method_name;

use super::errata::ErrataFile;
use super::results_folder::ResultsFolder;
use super::verified::{self, Verified};
use super::wide_curves;
use crate::error::ReportError;

/// What to do with a file that is not what a board expects in its place.
const UNFIT: &str = "correct it, or leave it out: a folder of results holds NAME.json as `mateval eval score --out` \
                     writes it, NAME.verified.json as `mateval eval verify --out` writes it, and in the folder itself \
                     ceiling.json, a result, and errata.json";

/// What a board is made from.
#[derive(Debug, Default)]
pub struct Entries {
    /// The results of the methods, with the scores of those single pictures alone that curves show.
    pub results: Vec<ResultFile>,
    /// Whether each of them was verified.
    pub verified: Vec<Verified>,
    /// The result of the truth.
    pub ceiling: Option<ResultFile>,
    /// The errata.
    pub errata: Option<ErrataFile>,
}

/// Reads the files. Fails with every reason for which they cannot make a board: a file is something else, a board cannot
/// show the name of a method, or two results have the same name or submission. A file that the system does not let us
/// read is the only reason then.
pub fn read(files: &ResultsFolder) -> Result<Entries, ReportError> {
    let (mut entries, mut paths, mut findings) = (Entries::default(), Vec::new(), Vec::new());
    for path in &files.results {
        let Some(result) = read_result(path, &mut findings)? else { continue };
        let sidecar = verified::sidecar(path);
        let mark = fitting(verified::read(path, &result), "a verification", &sidecar, &mut findings)?;
        entries.verified.push(mark.unwrap_or(Verified::No));
        entries.results.push(result);
        paths.push(path.as_path());
    }
    if let Some(path) = &files.ceiling {
        entries.ceiling = read_result(path, &mut findings)?;
    }
    if let Some(path) = &files.errata {
        entries.errata = fitting(ErrataFile::read(path), "errata", path, &mut findings)?;
    }
    let results = &entries.results;
    let shown: Vec<String> = results.iter().map(ResultFile::shown_method).collect();
    let names = shown.iter().map(|name| name.trim());
    findings.extend(repeated(&paths, names, "name", "/method", "give each method its own name, or leave one out"));
    let hashes = results.iter().map(|result| result.submission.sha256.as_str());
    let action = "a submission is ranked once: leave one out";
    findings.extend(repeated(&paths, hashes, "submission", "/submission/sha256", action));
    if findings.is_empty() { Ok(entries) } else { Err(ReportError::UnfitFiles(findings)) }
}

/// The result in the file, if it is one; what is wrong with it or with its method's name is added to the findings.
fn read_result(path: &Path, findings: &mut Vec<Finding>) -> Result<Option<ResultFile>, ReportError> {
    let read = ResultFile::read(path).map_err(|error| match error {
        EvalError::Dataset(error) => ReportError::Dataset(error),
        other => ReportError::Eval(other),
    });
    let Some(mut result) = fitting(read, "a result", path, findings)? else { return Ok(None) };
    let bad_name = method_name::check(&result.method, Severity::Error, &path.display().to_string());
    findings.extend(bad_name.map(|finding| Finding { place: "/method".to_owned(), ..finding }));
    // Single pictures are most of a result's memory, and the site shows those of curves alone.
    let wide_views = &result.dataset.wide_views;
    let is_kept = |picture: &PictureValues| wide_views.contains_key(&picture.scene) && wide_curves::is_shown(picture);
    for scores in result.protocols.values_mut() {
        scores.pictures.retain(is_kept);
        scores.pictures.shrink_to_fit();
    }
    Ok(Some(result))
}

/// What was read from the file at `path`. A file that is not what was `expected` is a finding; any other failure ends the
/// reading.
fn fitting<T>(
    read: Result<T, ReportError>,
    expected: &str,
    path: &Path,
    findings: &mut Vec<Finding>,
) -> Result<Option<T>, ReportError> {
    let (place, found) = match read {
        Ok(value) => return Ok(Some(value)),
        Err(ReportError::Dataset(SceneError::Format { found, expected: format, .. })) => {
            (String::new(), format!("the format '{found}' in place of '{format}'"))
        }
        Err(ReportError::Dataset(SceneError::Invalid { findings: faults, .. })) => {
            let fault = faults.into_iter().next().map(|fault| (fault.place, fault.message));
            fault.unwrap_or_default()
        }
        Err(ReportError::Eval(EvalError::Contradiction { place, said, found, .. })) => {
            (place, format!("{said} where its own numbers give {found}"))
        }
        Err(other) => return Err(other),
    };
    let message = format!("expected {expected}, found: {found}");
    findings.push(error("unfit_file", path, &place, message, UNFIT));
    Ok(None)
}

/// A finding for each file whose value an earlier file has too. `what` names the value, and `place` is its JSON pointer.
fn repeated<'a>(
    paths: &[&Path],
    values: impl Iterator<Item = &'a str>,
    what: &str,
    place: &str,
    action: &str,
) -> Vec<Finding> {
    let mut first: BTreeMap<&str, &Path> = BTreeMap::new();
    let mut findings = Vec::new();
    for (path, value) in paths.iter().zip(values) {
        if let Some(earlier) = first.get(value) {
            let message = format!("the {what} '{}' is that of '{}' too", shortened(value), earlier.display());
            findings.push(error(&format!("repeated_{what}"), path, place, message, action));
        } else {
            first.insert(value, path);
        }
    }
    findings
}

fn error(code: &str, path: &Path, place: &str, message: String, action: &str) -> Finding {
    Finding {
        severity: Severity::Error,
        code: code.to_owned(),
        file: path.display().to_string(),
        place: place.to_owned(),
        message,
        action: action.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use mateval_scene::json;

    use super::*;
    use crate::ranking::tests::{result, scores};

    /// A folder with a result for each of these methods, whose submission has the hash beside its name.
    fn folder(methods: &[(&str, &str)]) -> (tempfile::TempDir, ResultsFolder) {
        let folder = tempfile::tempdir().unwrap();
        for (at, (method, sha256)) in methods.iter().enumerate() {
            let mut result = result(method, &scores(20.0, 0.0));
            (*sha256).clone_into(&mut result.submission.sha256);
            json::write(&folder.path().join(format!("{at}.json")), &result).unwrap();
        }
        let files = ResultsFolder::list(folder.path()).unwrap();
        (folder, files)
    }

    /// The faults of a folder of results: the file's name, the code and the place of each.
    fn faults(files: &ResultsFolder) -> Vec<(PathBuf, String, String)> {
        let Err(ReportError::UnfitFiles(findings)) = read(files) else { panic!("expected findings") };
        let name = |file: &str| PathBuf::from(Path::new(file).file_name().unwrap());
        findings.into_iter().map(|finding| (name(&finding.file), finding.code, finding.place)).collect()
    }

    fn fault(file: &str, code: &str, place: &str) -> (PathBuf, String, String) {
        (PathBuf::from(file), code.to_owned(), place.to_owned())
    }

    #[test]
    fn names_that_a_board_cannot_show_are_all_refused() {
        let long = "x".repeat(100_000);
        let (_folder, files) =
            folder(&[("fine", "a"), (&long, "b"), ("safe\u{202e}gpj", "c"), ("a\0b", "d"), ("", "e")]);
        let bad = |file: &str| fault(file, "bad_method_name", "/method");
        let expected = [bad("1.json"), bad("2.json"), bad("3.json"), fault("4.json", "no_method_name", "/method")];
        assert_eq!(faults(&files), expected);
        let text = read(&files).unwrap_err().to_string();
        assert!(text.len() < 2000 && !text.contains('\u{202e}') && !text.contains('\0'), "{text}");
    }

    /// A mean that was changed by hand; the twin is the result as it was written.
    #[test]
    fn results_that_contradict_themselves_are_refused() {
        let (folder, files) = folder(&[("a", "1")]);
        assert_eq!(read(&files).unwrap().results.len(), 1);
        let path = folder.path().join("0.json");
        let mut result: ResultFile = json::read(&path).unwrap();
        let summary = &mut result.protocols.get_mut("mateval-3").unwrap().summary;
        summary.values_mut().for_each(|mean| *mean += 1.0);
        json::write(&path, &result).unwrap();
        let place = "/protocols/mateval-3/summary/albedo.input.mse";
        assert_eq!(faults(&files), [fault("0.json", "unfit_file", place)]);
    }

    #[test]
    fn equal_names_and_equal_submissions_are_all_refused() {
        let (_folder, files) = folder(&[("a", "1"), ("b", "1"), (" a", "2"), ("a", "3"), ("c", "4")]);
        let name = |file: &str| fault(file, "repeated_name", "/method");
        let expected = [name("2.json"), name("3.json"), fault("1.json", "repeated_submission", "/submission/sha256")];
        assert_eq!(faults(&files), expected);
        // The twin: other names and hashes.
        let (_folder, files) = folder(&[("a", "1"), ("b", "2")]);
        assert_eq!(read(&files).unwrap().results.len(), 2);
    }

    #[test]
    fn foreign_files_are_named_with_what_a_folder_of_results_holds() {
        let (folder, _) = folder(&[("a", "1")]);
        for (name, text) in [
            ("0.verified.json", r#"{"format": "mateval-lint/1"}"#),
            ("foreign.json", r#"{"format": "mateval-lint/1"}"#),
            ("package.json", r#"{"name": "board"}"#),
            ("ceiling.json", "[]"),
            ("errata.json", "{"),
        ] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let files = ResultsFolder::list(folder.path()).unwrap();
        let unfit = ["0.verified.json", "foreign.json", "package.json", "ceiling.json", "errata.json"];
        let found: Vec<PathBuf> = faults(&files).into_iter().map(|(file, ..)| file).collect();
        assert_eq!(found, unfit.map(PathBuf::from));
        let text = read(&files).unwrap_err().to_string();
        assert!(text.contains("expected a result, found: the format 'mateval-lint/1'"), "{text}");
        assert!(text.contains("a folder of results holds") && !text.contains("prep verify"), "{text}");
    }
}
