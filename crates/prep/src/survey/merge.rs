//! Puts the survey together from what was found in each house.

use std::collections::BTreeSet;
use std::path::PathBuf;

use mateval_image::store::write_whole;
use mateval_scene::json;

use super::house_part::{HousePart, shown};
use super::options::SurveyOptions;
use super::recipe_text::{self, RecipeTexts};
use super::survey_file::{SURVEY, SURVEY_FORMAT, SurveyFile, SurveyedHouse};
use super::survey_folder::{HouseName, SurveyFolder};
use super::{page, selection};
use crate::error::PrepError;
use crate::recipe::RECIPE;

/// The name of the page in the survey's folder.
const PAGE: &str = "index.html";

/// Writes the survey of all houses, each of which was searched; `survey.json` comes last. For the holder of the lease.
pub(super) fn merge(
    options: &SurveyOptions,
    folder: &SurveyFolder,
    houses: &[PathBuf],
    tool: &str,
) -> Result<SurveyFile, PrepError> {
    let mut texts = RecipeTexts::new(options);
    let mut file = SurveyFile {
        format: SURVEY_FORMAT.to_owned(),
        tool: tool.to_owned(),
        seed: options.seed,
        camera_rules: options.camera_rules.name().to_owned(),
        selection: None,
        houses: Vec::new(),
    };
    let mut taken = BTreeSet::new();
    for house in houses {
        let part: HousePart = json::read(&folder.part(&HouseName::new(&shown(house))))?;
        file.houses.push(named(part, options, &mut taken, &mut texts));
    }
    selection::rank(&mut file.houses);
    file.selection = options.goal.map(|goal| selection::select(&mut file.houses, &goal));
    let names: Vec<HouseName> = houses.iter().map(|house| HouseName::new(&shown(house))).collect();
    folder.keep_only(&names)?;
    write_whole(&folder.file(RECIPE), texts.of_best(&file).as_bytes())?;
    write_whole(&folder.file(PAGE), page::page(&file, &texts).as_bytes())?;
    json::write(&folder.file(SURVEY), &file)?;
    Ok(file)
}

/// The house with ids that no other scene has, whose texts are added to `texts`.
fn named(
    part: HousePart,
    options: &SurveyOptions,
    taken: &mut BTreeSet<String>,
    texts: &mut RecipeTexts,
) -> SurveyedHouse {
    let HousePart { mut house, files, .. } = part;
    for room in &mut house.rooms {
        for camera in &mut room.cameras {
            camera.scene = free_id(&camera.scene, taken);
            let text = recipe_text::scene(options, &house.file, &room.room, camera);
            texts.scenes.insert(camera.scene.clone(), text);
        }
    }
    if house.error.is_none() {
        texts.inputs.insert(house.file.clone(), recipe_text::inputs(&files));
    }
    house
}

/// The id, with a number appended where it is taken: the names of several rooms may be shortened to the same id.
fn free_id(id: &str, taken: &mut BTreeSet<String>) -> String {
    let numbered = (2..).map(|number| format!("{id}-{number}"));
    let free = std::iter::once(id.to_owned()).chain(numbered).find(|id| !taken.contains(id));
    let free = free.expect("ids are finitely many");
    taken.insert(free.clone());
    free
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_id_is_unique() {
        let mut taken = BTreeSet::new();
        let ids = ["a", "a", "b", "a", "a-2"].map(|id| free_id(id, &mut taken));
        assert_eq!(ids, ["a", "a-2", "b", "a-3", "a-2-2"]);
    }
}
