//! The paths that a survey was given: whether they exist, the folder that they become relative to, and the houses there.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_sources::below::{common_folder, relative_below};

use super::options::SurveyOptions;
use crate::error::PrepError;

/// The current folder.
const HERE: &str = ".";

/// Checks that everything that all houses need exists; otherwise each of them would report the same fault.
pub(super) fn check_folders(options: &SurveyOptions) -> Result<(), PrepError> {
    let source = options.source.as_deref().unwrap_or(Path::new(HERE));
    let folders = [Some(&options.models), options.textures.as_ref()].into_iter().flatten();
    let missing_folder = folders.map(|path| source.join(path)).find(|path| !path.is_dir());
    let files = options.cameras.iter().chain(&options.houses).map(|path| source.join(path));
    let missing = missing_folder.or_else(|| files.into_iter().find(|path| !path.exists()));
    missing.map_or(Ok(()), |path| Err(PrepError::MissingInput { path }))
}

/// The folder that all paths become relative to.
pub(super) fn source_folder(options: &SurveyOptions) -> Result<PathBuf, PrepError> {
    if let Some(source) = &options.source {
        return Ok(source.clone());
    }
    if given_paths(options).all(|path| relative_below(path, Path::new(HERE)).is_ok()) {
        return Ok(HERE.into());
    }
    common_folder(given_paths(options).map(PathBuf::as_path))
        .ok_or_else(|| PrepError::NoCommonFolder { path: options.models.clone() })
}

/// Every path that was given.
fn given_paths(options: &SurveyOptions) -> impl Iterator<Item = &PathBuf> {
    options.houses.iter().chain([&options.models]).chain(&options.textures).chain(&options.cameras)
}

/// The options with all paths relative to `source`. These paths are written to the survey and its recipe, and end up in
/// what is built from that.
pub(super) fn relative_to(source: &Path, options: &SurveyOptions) -> Result<SurveyOptions, PrepError> {
    let relative = |path: &PathBuf| {
        let chosen = options.source.is_none() && source != Path::new(HERE);
        let path = if chosen { std::path::absolute(path).map_err(PrepError::io("find", path))? } else { path.clone() };
        Ok::<_, PrepError>(relative_below(&path, source)?)
    };
    Ok(SurveyOptions {
        houses: options.houses.iter().map(relative).collect::<Result<_, _>>()?,
        models: relative(&options.models)?,
        textures: options.textures.as_ref().map(relative).transpose()?,
        cameras: options.cameras.as_ref().map(relative).transpose()?,
        ..options.clone()
    })
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
        let entries = std::fs::read_dir(&at).map_err(PrepError::io("list", &at))?;
        let mut names = Vec::new();
        for entry in entries {
            names.push(path.join(entry.map_err(PrepError::io("list", &at))?.file_name()));
        }
        names.retain(|name| name.extension().is_some_and(|e| e == "json"));
        names.sort();
        files.extend(names);
    }
    let mut seen = BTreeSet::new();
    files.retain(|file| seen.insert(source.join(file).canonicalize().ok().unwrap_or_else(|| file.clone())));
    if files.is_empty() { Err(PrepError::NoHouses { path: source.to_owned() }) } else { Ok(files) }
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
