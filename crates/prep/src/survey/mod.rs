//! Searches houses for rooms that could become scenes, and chooses scenes among them.
//!
//! In: houses, models, textures, rules. Out: a folder with [`SurveyFile`], which lists every room, why it was
//! rejected or which cameras it offers; thumbnails; an HTML page to pick from; and a recipe that pins the SHA-256 of
//! every input. Rooms and cameras depend on the houses and the seed alone, whether all houses are searched at once, by
//! a run that was resumed, or by several processes.
//!
//! Between: here the houses are found. `house` searches each of them or takes what an earlier run has found there:
//! [`rules`] state what a room must be like, [`intersect`] measures furniture that stands in other furniture,
//! `candidates` places cameras and looks through them. [`selection`] chooses scenes, and `output` writes the survey.

mod candidates;
mod house;
pub mod intersect;
mod output;
pub mod rules;
pub mod selection;
mod survey_file;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_dataset::{Progress, Report};
use mateval_files::FileError;
use mateval_files::source_folder::{common_folder, relative_below, slashed};

use crate::error::PrepError;
use crate::recipe::Redress;
use crate::redress::RedressKey;
use house::{HouseName, HouseSearch, SurveyFolder};
use output::merge;
pub use rules::SurveyOptions;
pub use survey_file::{
    CandidateCamera, Choice, ChosenType, IntersectingPair, Selection, SurveyFile, SurveyedHouse, SurveyedRoom,
    TargetedMean,
};

#[derive(Clone, Debug)]
pub struct Surveyed {
    /// What was written as `survey.json`; absent if only some houses were to be searched.
    pub file: Option<SurveyFile>,
    /// The folder that its paths, and those of its recipe, are relative to.
    pub source: PathBuf,
    /// Number of houses that are done, by this run or an earlier one.
    pub houses: usize,
    /// Number of houses that an earlier run had searched.
    pub kept: usize,
}

/// Searches the houses and, unless only some of them were to be searched, writes the survey, its page and its recipe.
/// Houses that an earlier run has searched with the same settings and files are kept. A house that cannot be read is
/// recorded in the survey and does not stop it.
pub fn survey(options: &SurveyOptions, tool: &str, progress: Progress<'_>) -> Result<Surveyed, PrepError> {
    check_folders(options)?;
    let source = source_folder(options)?;
    if let Some(Redress { key, materials }) = &options.redress {
        RedressKey::open(key, materials.as_deref(), &[&source, &options.out])?;
    }
    let options = &relative_to(&source, options)?;
    let houses = house_files(options, &source)?;
    let wanted = chosen(&houses, &options.only)?;
    let folder = SurveyFolder::begin(&options.out, options.force)?;
    let is_whole = options.only.is_empty();
    let whole = is_whole.then(|| folder.lease_of_whole()).transpose()?;
    let mut search = HouseSearch::new(options, &source, &folder, tool);
    let mut kept = 0;
    if is_whole {
        folder.reopen(options.force)?;
    }
    for (at, house) in wanted.iter().enumerate() {
        progress(Report::part(&format!("house {}", house.display()), at, wanted.len()));
        kept += usize::from(if is_whole { search.find(house)? } else { search_apart(&mut search, house)? });
    }
    let file = whole.map(|_lease| merge(options, &folder, &houses, tool)).transpose()?;
    Ok(Surveyed { file, source, houses: wanted.len(), kept })
}

/// Searches one house while other processes may search others. Returns whether an earlier run has.
fn search_apart(search: &mut HouseSearch<'_>, house: &Path) -> Result<bool, PrepError> {
    let _lease = search.folder.lease_of_house(&HouseName::new(&slashed(house)))?;
    search.folder.reopen(search.options.force)?;
    search.find(house)
}

const HERE: &str = ".";

/// Checks that everything that all houses need exists; otherwise each of them would report the same fault.
fn check_folders(options: &SurveyOptions) -> Result<(), PrepError> {
    let source = options.source.as_deref().unwrap_or(Path::new(HERE));
    let folders = [Some(&options.models), options.textures.as_ref()].into_iter().flatten();
    let missing_folder = folders.map(|path| source.join(path)).find(|path| !path.is_dir());
    let files = options.cameras.iter().chain(&options.houses).map(|path| source.join(path));
    let missing = missing_folder.or_else(|| files.into_iter().find(|path| !path.exists()));
    let why = "does not exist; correct the path, or name its folder with --source";
    missing.map_or(Ok(()), |path| Err(PrepError::unusable(path, why)))
}

/// The folder that all paths become relative to.
pub(super) fn source_folder(options: &SurveyOptions) -> Result<PathBuf, PrepError> {
    if let Some(source) = &options.source {
        return Ok(source.clone());
    }
    if given_paths(options).all(|path| relative_below(path, Path::new(HERE)).is_ok()) {
        return Ok(HERE.into());
    }
    let why = "has no folder in common with the other paths; put them into one and name it with --source";
    common_folder(given_paths(options).map(PathBuf::as_path)).ok_or_else(|| PrepError::unusable(&options.models, why))
}

fn given_paths(options: &SurveyOptions) -> impl Iterator<Item = &PathBuf> {
    options.houses.iter().chain([&options.models]).chain(&options.textures).chain(&options.cameras)
}

/// The options with all paths relative to `source`. These paths are written to the survey and its recipe, and end up in
/// what is built from that.
fn relative_to(source: &Path, options: &SurveyOptions) -> Result<SurveyOptions, PrepError> {
    let relative = |path: &PathBuf| {
        let chosen = options.source.is_none() && source != Path::new(HERE);
        let path = if chosen { std::path::absolute(path).map_err(FileError::io("find", path))? } else { path.clone() };
        Ok::<_, PrepError>(relative_below(&path, source)?)
    };
    Ok(SurveyOptions {
        houses: options.houses.iter().map(relative).collect::<Result<_, _>>()?,
        models: relative(&options.models)?,
        textures: options.textures.as_ref().map(relative).transpose()?,
        cameras: options.cameras.as_ref().map(relative).transpose()?,
        // Key and materials lie outside of the source's folder.
        redress: options.redress.as_ref().map(absolute).transpose()?,
        ..options.clone()
    })
}

fn absolute(redress: &Redress) -> Result<Redress, PrepError> {
    let found = |path: &PathBuf| path.canonicalize().map_err(FileError::io("find", path));
    let materials = redress.materials.as_ref().map(found).transpose()?;
    Ok(Redress { key: found(&redress.key)?, materials })
}

/// The house files that were given, and all JSON files of the folders that were given: each once, sorted within its
/// folder, relative to the source's folder.
pub(super) fn house_files(options: &SurveyOptions, source: &Path) -> Result<Vec<PathBuf>, PrepError> {
    let mut files = Vec::new();
    for path in &options.houses {
        let at = source.join(path);
        if !at.is_dir() {
            files.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(&at).map_err(FileError::io("list", &at))?;
        let mut names = Vec::new();
        for entry in entries {
            names.push(path.join(entry.map_err(FileError::io("list", &at))?.file_name()));
        }
        names.retain(|name| name.extension().is_some_and(|e| e == "json"));
        names.sort();
        files.extend(names);
    }
    let mut seen = BTreeSet::new();
    files.retain(|file| seen.insert(source.join(file).canonicalize().ok().unwrap_or_else(|| file.clone())));
    match files.is_empty() {
        true => Err(PrepError::unusable(source, "contains no house; expected JSON files of 3D-FRONT")),
        false => Ok(files),
    }
}

/// The houses that `only` names, or all where it names none. Fails where a name is no house's.
pub(super) fn chosen(houses: &[PathBuf], only: &[String]) -> Result<Vec<PathBuf>, PrepError> {
    let is_named = |house: &Path, name: &str| {
        house == Path::new(name) || house.file_stem().is_some_and(|stem| stem.to_string_lossy() == name)
    };
    let is_unknown = |name: &&String| !houses.iter().any(|house| is_named(house, name));
    if let Some(unknown) = only.iter().find(is_unknown) {
        return Err(PrepError::UnknownHouse { name: unknown.clone(), houses: houses.len() });
    }
    let is_chosen = |house: &&PathBuf| only.is_empty() || only.iter().any(|name| is_named(house, name));
    Ok(houses.iter().filter(is_chosen).cloned().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn houses_are_named_by_path_or_stem() {
        let houses = ["a/x.json", "b/y.json"].map(PathBuf::from);
        let of = |only: &[&str]| chosen(&houses, &only.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
        assert_eq!(of(&[]).unwrap(), houses);
        assert_eq!(of(&["y"]).unwrap(), [PathBuf::from("b/y.json")]);
        assert_eq!(of(&["b/y.json", "x"]).unwrap(), houses);
        assert!(of(&["x", "z"]).unwrap_err().to_string().contains("'z'"));
    }
}
