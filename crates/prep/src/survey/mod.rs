//! Searches houses for rooms that could become scenes, and chooses scenes among them.
//!
//! In: houses, models, textures, rules, lists. Out: a folder with [`SurveyFile`], which lists every room, why it was
//! rejected or which cameras it offers; thumbnails; an HTML page to pick from; and a recipe that pins the SHA-256 of every
//! input. Rooms and cameras depend on the houses and the seed alone, whether all houses are searched at once, by a run that
//! was resumed, or by several processes.
//!
//! Between: `paths` finds the houses and `house_part` searches each of them or takes what an earlier run has found there:
//! [`rules`] state what a room must be like, [`intersect`] measures furniture that stands in other furniture as
//! `solid` bodies, `posed` and `candidates` place cameras and look through them. `survey_folder` holds what was found. Then
//! `merge` puts the survey together, [`selection`] chooses scenes, `recipe_text` and `page` write.

mod camera_refusal;
mod candidates;
mod house_part;
pub mod intersect;
mod intersecting_pair;
mod merge;
mod options;
mod page;
mod paths;
mod posed;
mod recipe_text;
pub mod rules;
pub mod selection;
#[cfg(test)]
mod shapes;
mod solid;
mod survey_file;
mod survey_folder;

use std::path::{Path, PathBuf};

use mateval_scene::{Progress, Report};

use crate::error::PrepError;
use house_part::{HouseSearch, shown};
pub use intersecting_pair::IntersectingPair;
pub use options::SurveyOptions;
pub use survey_file::{
    CandidateCamera, Choice, ChosenType, SURVEY, SURVEY_FORMAT, Selection, SurveyFile, SurveyedHouse, SurveyedRoom,
    TargetedMean,
};
use survey_folder::{HouseName, SurveyFolder};

/// The result of a survey.
#[derive(Clone, Debug)]
pub struct Surveyed {
    /// What was written as `survey.json`; none where only some houses were to be searched.
    pub file: Option<SurveyFile>,
    /// The folder that its paths, and those of its recipe, are relative to.
    pub source: PathBuf,
    /// Number of houses that are done, by this run or an earlier one.
    pub houses: usize,
    /// Number of houses that an earlier run had searched.
    pub kept: usize,
}

/// Searches the houses and, unless only some of them were to be searched, writes the survey, its page and its recipe. Houses
/// that an earlier run has searched with the same settings and files are kept. A house that cannot be read is recorded in
/// the survey and does not stop it.
pub fn survey(options: &SurveyOptions, tool: &str, progress: Progress<'_>) -> Result<Surveyed, PrepError> {
    paths::check_folders(options)?;
    let source = paths::source_folder(options)?;
    let options = &paths::relative_to(&source, options)?;
    let houses = paths::house_files(options, &source)?;
    let wanted = paths::chosen(&houses, &options.only)?;
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
    let file = whole.map(|_lease| merge::merge(options, &folder, &houses, tool)).transpose()?;
    Ok(Surveyed { file, source, houses: wanted.len(), kept })
}

/// Searches one house while other processes may search others. Returns whether an earlier run has.
fn search_apart(search: &mut HouseSearch<'_>, house: &Path) -> Result<bool, PrepError> {
    let _lease = search.folder.lease_of_house(&HouseName::new(&shown(house)))?;
    search.folder.reopen(search.options.force)?;
    search.find(house)
}
