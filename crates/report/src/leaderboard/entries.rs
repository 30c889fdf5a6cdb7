//! What a board is made from: the files of a folder of results, read and checked. All files are checked before any is
//! refused, so that the error lists everything that must change.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::layout::INPUT;
use mateval_dataset::open::Dataset;
use mateval_dataset::{DatasetError, Finding, SceneId, Severity, json};
use mateval_eval::result::key::{Region, Surfaces};
use mateval_eval::result::{PictureValues, ResultFile};
use mateval_files::FileError;
use mateval_files::untrusted::{nearest, read_at_most, shortened};
use mateval_submission::lint::submission_json::check_method_name;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::marks::{TrustedKeys, Verified, sidecar};
use crate::error::{Mismatch, ReportError, fitting};
use crate::ranking::file::Ranking;
use crate::ranking::inexact_light;
use crate::strips::Shown;

/// The file of the truth's own result.
const CEILING: &str = "ceiling.json";

/// The file of errors that were found after publication.
const ERRATA: &str = "errata.json";

/// What the board's keeper says about it.
const ABOUT: &str = "about.md";

/// The format of this version of errata.
pub const ERRATA_FORMAT: &str = "mateval-errata/1";

/// What to do with a file that is not what a board expects in its place.
const UNFIT: &str = "correct it, or leave it out: a folder of results holds NAME.json as `mateval eval score --out` \
                     writes it, NAME.verified.json as `mateval eval verify --out` writes it, its \
                     signature NAME.verified.json.minisig, and in the folder itself \
                     ceiling.json, a result, errata.json and about.md";

/// The files of a folder in which a leaderboard's results are collected, for example by pull requests.
///
/// `ceiling.json`, `errata.json` and `about.md` lie in the folder itself. Every other `.json` file, there or in a folder directly
/// below it (for example one for each method), is a result or, if it ends in `.verified.json`, the verification of one.
/// Hidden files and those that systems leave behind are skipped.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ResultsFolder {
    /// The files of the methods' results, sorted; at least one if the folder was listed.
    pub results: Vec<PathBuf>,
    /// The file of the truth's result.
    pub ceiling: Option<PathBuf>,
    pub errata: Option<PathBuf>,
    /// Markdown about the board.
    pub about: Option<PathBuf>,
    /// `.json` files and folders that are skipped because of their names.
    pub skipped: Vec<PathBuf>,
}

/// Whether a name is hidden, or one that systems and editors leave behind: none of them is anybody's result.
fn is_litter(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with('.') || name.ends_with('~') || name == "__MACOSX"
}

/// Whether a name ends in `.json`, in letters of any case.
fn is_json(name: &str) -> bool {
    name.to_ascii_lowercase().ends_with(".json")
}

impl ResultsFolder {
    /// Lists the folder. Fails where it holds no result, and where one of its `.json` files is a link, which could lead
    /// out of the folder.
    pub fn list(folder: &Path) -> Result<Self, ReportError> {
        let mut found = Self::default();
        let mut folders = Vec::new();
        for (path, kind) in entries_of(folder)? {
            match path.file_name().and_then(|name| name.to_str()) {
                name if is_litter(&path) => found.skip(name, path.clone(), kind),
                _ if kind.is_dir() => folders.push(path),
                Some(CEILING) => found.ceiling = Some(regular_file(path, kind)?),
                Some(ERRATA) => found.errata = Some(regular_file(path, kind)?),
                Some(ABOUT) => found.about = Some(regular_file(path, kind)?),
                name => found.add(name, path.clone(), kind)?,
            }
        }
        for folder in folders {
            for (path, kind) in entries_of(&folder)? {
                match path.file_name().and_then(|name| name.to_str()) {
                    name if is_litter(&path) => found.skip(name, path.clone(), kind),
                    name => found.add(name, path.clone(), kind)?,
                }
            }
        }
        if found.results.is_empty() {
            return Err(ReportError::NoResultsBelow { folder: folder.to_owned() });
        }
        found.results.sort();
        found.skipped.sort();
        Ok(found)
    }

    fn skip(&mut self, name: Option<&str>, path: PathBuf, kind: std::fs::FileType) {
        // A folder of a version control system holds no results, and need not be named.
        let may_be_missed = if kind.is_dir() { name != Some(".git") } else { name.is_some_and(is_json) };
        self.skipped.extend(may_be_missed.then_some(path));
    }

    /// Adds the file if its name is that of a result. Fails where it or a verification is a link.
    fn add(&mut self, name: Option<&str>, path: PathBuf, kind: std::fs::FileType) -> Result<(), ReportError> {
        let Some(name) = name.filter(|name| is_json(name) && !kind.is_dir()) else { return Ok(()) };
        let path = regular_file(path, kind)?;
        if !name.to_ascii_lowercase().ends_with(".verified.json") {
            self.results.push(path);
        }
        Ok(())
    }
}

/// What a board is made from.
#[derive(Debug, Default)]
pub struct Entries {
    /// The results of the methods, with the scores of those single pictures alone that curves show.
    pub results: Vec<ResultFile>,
    pub verified: Vec<Verified>,
    /// The result of the truth.
    pub ceiling: Option<ResultFile>,
    pub errata: Option<ErrataFile>,
    /// Markdown about the board; absent where its file has no text.
    pub about: Option<String>,
}

/// No text about a board is larger, in bytes.
const MOST_ABOUT_BYTES: u64 = 1 << 20;

/// Reads the files. Fails with every reason for which they cannot make a board: a file is something else, a board
/// cannot show the name of a method, or two results have the same name or submission. A file that the system does not
/// let us read is the only reason then.
pub fn read(files: &ResultsFolder, trust: &TrustedKeys) -> Result<Entries, ReportError> {
    let (mut entries, mut paths, mut findings) = (Entries::default(), Vec::new(), Vec::new());
    for path in &files.results {
        let Some(result) = read_result(path, &mut findings)? else { continue };
        let sidecar = sidecar(path);
        let mark = fitting(trust.mark(path, &result), "a verification", &sidecar, UNFIT, &mut findings)?;
        entries.verified.push(mark.unwrap_or(Verified::Claimed));
        entries.results.push(result);
        paths.push(path.as_path());
    }
    if let Some(path) = &files.ceiling
        && let Some(result) = read_result(path, &mut findings)?
    {
        findings.extend(not_the_truth(path, &result, trust));
        entries.ceiling = Some(result);
    }
    if let Some(path) = &files.errata {
        entries.errata = fitting(ErrataFile::read(path), "errata", path, UNFIT, &mut findings)?;
    }
    if let Some(path) = &files.about {
        let bytes = read_at_most(path, MOST_ABOUT_BYTES).map_err(FileError::io("read", path))?;
        let is_no_text = |_| std::io::Error::other("it is no UTF-8 text; save it as UTF-8");
        let text = String::from_utf8(bytes).map_err(is_no_text).map_err(FileError::io("read", path))?;
        entries.about = Some(text).filter(|text| !text.trim().is_empty());
    }
    let results = &entries.results;
    let shown: Vec<String> = results.iter().map(ResultFile::shown_method).collect();
    let names = shown.iter().map(|name| name.trim());
    findings.extend(repeated(&paths, names, "name", "/method", "give each method its own name, or leave one out"));
    if let (Some(errata), Some(path)) = (&entries.errata, &files.errata) {
        findings.extend(unknown_names(path, errata, results));
    }
    let hashes = results.iter().map(|result| result.submission.sha256.as_str());
    let action = "a submission is ranked once: leave one out";
    findings.extend(repeated(&paths, hashes, "submission", "/submission/sha256", action));
    if findings.is_empty() { Ok(entries) } else { Err(ReportError::UnfitFiles(findings)) }
}

/// The results of methods on the original rooms of a redressed board: files, and folders as [`ResultsFolder::list`]
/// finds them. Fails as [`read`] does.
pub fn read_original(paths: &[PathBuf]) -> Result<Vec<ResultFile>, ReportError> {
    let mut files = ResultsFolder::default();
    for path in paths {
        match path.is_dir() {
            true => files.results.extend(ResultsFolder::list(path)?.results),
            false => files.results.push(path.clone()),
        }
    }
    Ok(read(&files, &TrustedKeys::default())?.results)
}

/// What a site is made from, and what it shows.
pub struct LeaderboardPlan<'a> {
    pub results: &'a [ResultFile],
    /// The result of the truth itself, which is shown below the methods and not ranked.
    pub ceiling: Option<&'a ResultFile>,
    /// Whether each of the results was verified.
    pub verified: Vec<Verified>,
    /// The protocol whose scores are ranked.
    pub protocol: &'a str,
    /// Whether to accept results that lack some scenes.
    pub partial: bool,
    /// Faults that were found after publication.
    pub errata: Option<&'a ErrataFile>,
    /// What its keeper says about the board, in Markdown.
    pub about: Option<&'a str>,
    /// A set of pictures to show; see `pictures`.
    pub pictures: Option<&'a Path>,
    /// Submissions to draw pictures of.
    pub submissions: Option<Submissions<'a>>,
    /// Whether the site has a page on which people vote on its pictures.
    pub votes: bool,
    /// Results on the original rooms, where the board's own are redressed: the site shows how far methods fall.
    pub original: Option<&'a [ResultFile]>,
    /// Where the board is published on the Hugging Face Hub, if it is.
    pub hub: Option<Hub>,
    pub tool: String,
}

/// A board on the Hugging Face Hub.
#[derive(Clone, Debug)]
pub struct Hub {
    /// The repository of the board's dataset, as in `NAME/dataset`; its `eval.yaml`, which
    /// `prep export --as huggingface` writes, defines the task.
    pub dataset: String,
    /// The address of the folder of the site.
    pub url: String,
}

/// Submissions whose pictures are drawn.
pub struct Submissions<'a> {
    /// The dataset that they were scored on.
    pub dataset: &'a Dataset,
    pub folders: Vec<PathBuf>,
    /// Which pictures are drawn of each.
    pub shown: Vec<Shown>,
}

impl Submissions<'_> {
    /// The dataset's scenes that are ranked, in its order.
    pub(super) fn ranked_scenes(&self, ranking: &Ranking) -> Vec<&SceneFile> {
        self.dataset.scenes.iter().filter(|scene| ranking.scenes.contains(&scene.id)).collect()
    }
}

/// Errata, in the order in which they are shown.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ErrataFile {
    /// Always `mateval-errata/1`.
    pub format: String,
    /// One entry for each error.
    pub entries: Vec<Erratum>,
}

/// One error.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Erratum {
    /// When it was found, as in `2026-03-01`.
    pub date: String,
    /// A title of a few words.
    pub title: String,
    /// What was wrong, and how it was corrected.
    pub text: String,
    /// Names of the methods and scenes that it affects; all of them if empty.
    #[serde(default)]
    pub affects: Vec<String>,
}

impl ErrataFile {
    /// Reads the errata in the file `path`; fails if they have another format.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        Ok(json::read_format(path, ERRATA_FORMAT)?)
    }
}

/// Why a result cannot be the ceiling.
fn not_the_truth(path: &Path, result: &ResultFile, trust: &TrustedKeys) -> Option<Finding> {
    let action = "score the submission of `mateval baseline gt`, or leave the ceiling out";
    let inexact = result.protocols.iter().find_map(|(name, scores)| Some((name, inexact_light(scores)?)));
    if let Some((name, (key, value))) = inexact {
        let message = Mismatch::Ceiling { method: result.shown_method(), key: *key, value }.to_string();
        return Some(error("not_the_truth", path, &format!("/protocols/{name}/summary/{key}"), message, action));
    }
    let is_signed = || trust.mark(path, result).is_ok_and(|mark| mark == Verified::Confirmed);
    if trust.is_empty() || is_signed() {
        return None;
    }
    let message = "the ceiling has no verification that a trusted key signed".to_owned();
    let action = "verify it with `mateval eval verify --sign KEY`, as the other results";
    Some(error("unverified_ceiling", path, "/method", message, action))
}

/// A finding for each name in the errata that no result has: of no method, and of no scene.
fn unknown_names(path: &Path, errata: &ErrataFile, results: &[ResultFile]) -> Vec<Finding> {
    let methods: Vec<String> = results.iter().map(ResultFile::shown_method).collect();
    let scenes = results.iter().flat_map(|result| &result.dataset.scenes).map(SceneId::as_str);
    let known: BTreeSet<&str> = methods.iter().map(String::as_str).chain(scenes).collect();
    let mut findings = Vec::new();
    for (at, erratum) in errata.entries.iter().enumerate() {
        for (number, name) in erratum.affects.iter().enumerate().filter(|(_, name)| !known.contains(name.as_str())) {
            let meant = nearest(name, known.iter().copied()).map(|name| format!("; did you mean '{name}'?"));
            let message = format!("no method or scene is named '{}'{}", shortened(name), meant.unwrap_or_default());
            let place = format!("/entries/{at}/affects/{number}");
            findings.push(error("unknown_name", path, &place, message, "write a name of the board, or leave it out"));
        }
    }
    findings
}

/// The result in the file, if it is one; what is wrong with it or with its method's name is added to the findings.
fn read_result(path: &Path, findings: &mut Vec<Finding>) -> Result<Option<ResultFile>, ReportError> {
    let Some(mut result) = fitting(ResultFile::read(path), "a result", path, UNFIT, findings)? else { return Ok(None) };
    let bad_name = check_method_name(&result.method, Severity::Error, &path.display().to_string());
    findings.extend(bad_name.map(|finding| Finding { place: "/method".to_owned(), ..finding }));
    // Single pictures are most of a result's memory, and the site shows those of curves alone.
    let wide_views = &result.dataset.wide_views;
    let is_kept = |picture: &PictureValues| wide_views.contains_key(&picture.scene) && is_in_curves(picture);
    for scores in result.protocols.values_mut() {
        scores.pictures.retain(is_kept);
        scores.pictures.shrink_to_fit();
    }
    Ok(Some(result))
}

/// A finding for each file whose value an earlier file has too. `what` names the value, and `place` is its JSON
/// pointer.
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
    Finding::new(Severity::Error, code, path.display().to_string(), place, message, action)
}

/// Whether curves show the values of a picture, if its scene has wide views.
pub(super) fn is_in_curves(picture: &PictureValues) -> bool {
    let is_of_a_class = picture.view.is_wide() || picture.view.as_str() == INPUT;
    is_of_a_class && picture.region == Region::Valid && picture.picture.surfaces == Surfaces::All
}

/// The entries of a folder with their types; a link is not followed.
fn entries_of(folder: &Path) -> Result<Vec<(PathBuf, std::fs::FileType)>, DatasetError> {
    let entry = |entry: std::io::Result<std::fs::DirEntry>| {
        let entry = entry?;
        Ok((entry.path(), entry.file_type()?))
    };
    let all = folder.read_dir().and_then(|entries| entries.map(entry).collect());
    Ok(all.map_err(FileError::io("list", folder))?)
}

/// The path, if it is a regular file's.
fn regular_file(path: PathBuf, kind: std::fs::FileType) -> Result<PathBuf, ReportError> {
    if kind.is_file() { Ok(path) } else { Err(ReportError::NotAFile { path }) }
}

#[cfg(test)]
mod tests {
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
        let Err(ReportError::UnfitFiles(findings)) = read(files, &TrustedKeys::default()) else {
            panic!("expected findings")
        };
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
        let text = read(&files, &TrustedKeys::default()).unwrap_err().to_string();
        assert!(text.len() < 2000 && !text.contains('\u{202e}') && !text.contains('\0'), "{text}");
    }

    /// A mean that was changed by hand; the twin is the result as it was written.
    #[test]
    fn results_that_contradict_themselves_are_refused() {
        let (folder, files) = folder(&[("a", "1")]);
        assert_eq!(read(&files, &TrustedKeys::default()).unwrap().results.len(), 1);
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
        assert_eq!(read(&files, &TrustedKeys::default()).unwrap().results.len(), 2);
    }

    #[test]
    fn foreign_files_are_named_with_what_a_folder_of_results_holds() {
        let (folder, _) = folder(&[("a", "1")]);
        for (name, text) in [
            ("foreign.json", r#"{"format": "mateval-lint/1"}"#),
            ("package.json", r#"{"name": "board"}"#),
            ("ceiling.json", "[]"),
            ("errata.json", "{"),
        ] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let files = ResultsFolder::list(folder.path()).unwrap();
        let unfit = ["foreign.json", "package.json", "ceiling.json", "errata.json"];
        let found: Vec<PathBuf> = faults(&files).into_iter().map(|(file, ..)| file).collect();
        assert_eq!(found, unfit.map(PathBuf::from));
        let text = read(&files, &TrustedKeys::default()).unwrap_err().to_string();
        assert!(text.contains("expected a result, found: the format 'mateval-lint/1'"), "{text}");
        assert!(text.contains("a folder of results holds") && !text.contains("prep verify"), "{text}");
    }

    fn folder_of(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "{}").unwrap();
        }
        folder
    }

    #[test]
    fn results_are_found_by_their_place() {
        let files = [
            "b.json",
            "ceiling.json",
            "errata.json",
            "README.md",
            "a/RESULT.json",
            "a/RESULT.verified.json",
            "a/errata.json",
            "c/notes.txt",
            "c/deep/RESULT.json",
        ];
        let folder = folder_of(&files);
        let found = ResultsFolder::list(folder.path()).unwrap();
        let at = |name: &str| folder.path().join(name);
        assert_eq!(found.results, ["a/RESULT.json", "a/errata.json", "b.json"].map(at));
        assert_eq!((found.ceiling, found.errata), (Some(at("ceiling.json")), Some(at("errata.json"))));
    }

    #[test]
    fn a_folder_without_results_and_links_are_refused() {
        let no_result = folder_of(&["ceiling.json", "a/RESULT.verified.json"]);
        let refused = ResultsFolder::list(no_result.path());
        assert!(matches!(refused, Err(ReportError::NoResultsBelow { .. })), "{refused:?}");
        let with_link = folder_of(&["a/RESULT.json", "b/notes.txt"]);
        for name in ["b/RESULT.json", "a/RESULT.verified.json"] {
            assert_eq!(ResultsFolder::list(with_link.path()).unwrap().results.len(), 1);
            std::os::unix::fs::symlink("/etc/passwd", with_link.path().join(name)).unwrap();
            let refused = ResultsFolder::list(with_link.path());
            assert!(matches!(refused, Err(ReportError::NotAFile { .. })), "{refused:?}");
            std::fs::remove_file(with_link.path().join(name)).unwrap();
        }
        assert!(ResultsFolder::list(&with_link.path().join("none")).is_err());
    }
}
