//! Searches houses for rooms that could become scenes.
//!
//! In: houses, models, textures, rules, lists. Out: a folder with [`SurveyFile`], which lists every room, why it was
//! rejected or which cameras it offers; thumbnails; an HTML page to pick from; and a recipe that pins the SHA-256 of every
//! input. Rooms and cameras depend on the houses and the seed alone.
//!
//! Between: `paths` finds the houses, [`rules`] state what a room must be like, [`intersect`] finds furniture that stands in
//! other furniture, `candidates` places cameras and looks through them, `recipe_text` and `page` write.

mod camera_refusal;
mod candidates;
pub mod intersect;
mod options;
mod page;
mod paths;
mod recipe_text;
pub mod rules;
mod survey_file;

use std::path::{Path, PathBuf};

use mateval_image::png_io::write_rgb_bytes;
use mateval_image::store::write_whole;
use mateval_scene::work_folder::{WorkFolder, check_free};
use mateval_scene::{FindingCount, Progress, json};
use mateval_sources::front3d::{self, FurnishedHouse, HouseFiles};

use crate::build::{RECIPE, holds_only};
use crate::error::PrepError;
use candidates::HouseSurvey;
pub use options::SurveyOptions;
use recipe_text::RecipeTexts;
use survey_file::THUMBNAILS;
pub use survey_file::{CandidateCamera, SURVEY, SURVEY_FORMAT, SurveyFile, SurveyedHouse, SurveyedRoom};

/// The name of the page in the output's folder.
const PAGE: &str = "index.html";

/// The result of a survey.
#[derive(Clone, Debug)]
pub struct Surveyed {
    /// What was written as `survey.json`.
    pub file: SurveyFile,
    /// The folder that its paths, and those of its recipe, are relative to.
    pub source: PathBuf,
}

/// Searches all houses and writes the survey, its page, thumbnails and recipe. A house that cannot be read is recorded in
/// the survey and does not stop it.
pub fn survey(options: &SurveyOptions, tool: &str, progress: Progress<'_>) -> Result<Surveyed, PrepError> {
    paths::check_folders(options)?;
    let source = paths::source_folder(options)?;
    let options = &paths::relative_to(&source, options)?;
    let houses = paths::house_files(options, &source)?;
    check_free(&options.out, options.force, "--out")?;
    if options.out.exists() && !is_only_a_survey(&options.out) {
        return Err(PrepError::NotASurvey { path: options.out.clone() });
    }
    let work = WorkFolder::start(&options.out)?;
    let thumbnails = work.path().join(THUMBNAILS);
    std::fs::create_dir_all(&thumbnails).map_err(PrepError::io("make", &thumbnails))?;
    let mut file =
        SurveyFile { format: SURVEY_FORMAT.to_owned(), tool: tool.to_owned(), seed: options.seed, houses: Vec::new() };
    let mut texts = RecipeTexts::new(options);
    for (at, house) in houses.iter().enumerate() {
        progress(&format!("house {}", house.display()), at, houses.len());
        file.houses.push(survey_house(options, [&source, house], work.path(), &mut texts)?);
    }
    json::write(&work.path().join(SURVEY), &file)?;
    write_whole(&work.path().join(RECIPE), texts.of_best(&file).as_bytes())?;
    write_whole(&work.path().join(PAGE), page::page(&file, &texts).as_bytes())?;
    work.finish()?;
    Ok(Surveyed { file, source })
}

/// Whether a folder holds a survey and no other files.
fn is_only_a_survey(out: &Path) -> bool {
    let Ok(file) = json::read_format::<SurveyFile>(&out.join(SURVEY), SURVEY_FORMAT) else { return false };
    let rooms = file.houses.iter().flat_map(|house| &house.rooms);
    let pictures: Vec<&str> = rooms
        .flat_map(|room| &room.cameras)
        .filter_map(|camera| camera.thumbnail.strip_prefix("thumbnails/"))
        .collect();
    holds_only(out, &[SURVEY, RECIPE, PAGE, THUMBNAILS]) && holds_only(&out.join(THUMBNAILS), &pictures)
}

/// Searches one house; writes its thumbnails below `out` and adds its scenes to `texts`.
fn survey_house(
    options: &SurveyOptions,
    [source, house]: [&Path; 2],
    out: &Path,
    texts: &mut RecipeTexts,
) -> Result<SurveyedHouse, PrepError> {
    let shown = house.to_string_lossy().replace('\\', "/");
    let (HouseSurvey { rooms, pictures }, furnished) = match search(options, [source, house], texts) {
        Ok(found) => found,
        Err(error) => {
            let error = Some(error.to_string());
            return Ok(SurveyedHouse { file: shown, uid: None, error, findings: Vec::new(), rooms: Vec::new() });
        }
    };
    for (name, picture) in pictures {
        write_rgb_bytes(&out.join(name), &picture)?;
    }
    for room in &rooms {
        for camera in &room.cameras {
            let text = recipe_text::scene(options, &shown, &room.room, camera);
            texts.scenes.insert(camera.scene.clone(), text);
        }
    }
    texts.inputs.insert(shown.clone(), recipe_text::inputs(&furnished.files));
    Ok(SurveyedHouse {
        file: shown,
        uid: Some(furnished.house.uid.clone()),
        error: None,
        findings: FindingCount::of(furnished.findings.iter()),
        rooms,
    })
}

/// Reads a house and searches its rooms.
fn search(
    options: &SurveyOptions,
    [source, house]: [&Path; 2],
    texts: &mut RecipeTexts,
) -> Result<(HouseSurvey, FurnishedHouse), PrepError> {
    let files = HouseFiles {
        root: source.to_owned(),
        house: house.to_owned(),
        models: options.models.clone(),
        textures: options.textures.clone(),
        cameras: options.cameras.clone(),
        blenderproc_compat: false,
    };
    let furnished = front3d::furnish(&files, &front3d::Limits::default())?;
    let found = candidates::search_rooms(options, &furnished, &mut texts.taken)?;
    Ok((found, furnished))
}
