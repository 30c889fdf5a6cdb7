//! Looks through houses for rooms that could be scenes: a page to pick from, a recipe, and why the others were rejected.
//!
//! In: houses, models, textures, rules, lists. Out: [`SurveyFile`] with every room, and beside it thumbnails, an HTML
//! page and a recipe that pins the SHA-256 of everything it is made of. Rooms and cameras depend on houses and seed alone.
//!
//! Between: [`rules`] say what a room must be like, [`intersect`] finds furniture in furniture, `candidates` finds cameras
//! and looks through them, `recipe_text` and `page` write.

mod candidates;
pub mod intersect;
mod page;
mod recipe_text;
pub mod rules;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use mateval_image::png_io::write_rgb_bytes;
use mateval_image::store::write_whole;
use mateval_scene::work_folder::{WorkFolder, check_free};
use mateval_scene::{Progress, json};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::build::{RECIPE, holds_only};
use crate::error::PrepError;
use candidates::HouseSurvey;
use mateval_scene::FindingCount;
use mateval_sources::below::{common_folder, relative_below};
use mateval_sources::front3d::{self, HouseFiles};
use rules::{Rejection, RejectionLists, SelectionRules};

/// The word for this version of the file.
pub const SURVEY_FORMAT: &str = "mateval-survey/1";

/// Its place in the output's folder.
pub const SURVEY: &str = "survey.json";

/// Other names in it.
const PAGE: &str = "index.html";
const THUMBNAILS: &str = "thumbnails";

/// What to look through, and how.
#[derive(Clone, Debug)]
pub struct SurveyOptions {
    /// Folder that all paths are relative to, as in a recipe. Where there is none it is the current one or, if a path is
    /// absolute, the one that all of them have in common.
    pub source: Option<PathBuf>,
    /// Houses, or folders of houses.
    pub houses: Vec<PathBuf>,
    /// 3D-FUTURE's folder.
    pub models: PathBuf,
    /// The layout's textures.
    pub textures: Option<PathBuf>,
    /// Designers' cameras beside the houses.
    pub cameras: Option<PathBuf>,
    /// What a room must be like.
    pub rules: SelectionRules,
    /// What is known to be bad.
    pub lists: RejectionLists,
    /// Of the cameras.
    pub seed: u64,
    /// Cameras drawn a room.
    pub cameras_per_room: u32,
    /// Pictures of the scenes.
    pub resolution: [u32; 2],
    /// Of drawn cameras, degrees.
    pub fov_y_deg: f64,
    /// The output's folder.
    pub out: PathBuf,
    /// Replace a survey that is there.
    pub force: bool,
}

/// `survey.json`: every room that was looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurveyFile {
    /// Always `mateval-survey/1`.
    pub format: String,
    /// What made it, as in `mateval 0.1.0`.
    pub tool: String,
    /// Of the cameras.
    pub seed: u64,
    /// Houses in the order of their files.
    pub houses: Vec<SurveyedHouse>,
}

/// A house.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurveyedHouse {
    /// Its file, relative to the source's folder.
    pub file: String,
    /// Its uid; null where it could not be read.
    pub uid: Option<String>,
    /// Why it could not be read; null where it could.
    pub error: Option<String>,
    /// What was wrong with it, by severity and code.
    pub findings: Vec<FindingCount>,
    /// Its rooms, in the file's order.
    pub rooms: Vec<SurveyedRoom>,
}

/// A room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurveyedRoom {
    /// Its instanceid.
    pub room: String,
    /// Its type.
    pub room_type: String,
    /// Pieces of furniture placed.
    pub objects: usize,
    /// Different super-categories of them.
    pub super_categories: usize,
    /// Sides of its floor's box, metres; zeros without a floor.
    pub size_m: [f64; 2],
    /// Pairs of pieces that stand in each other; not looked for in a room of more than `max_objects`.
    pub intersecting: Vec<[String; 2]>,
    /// Valid pieces without their model or texture.
    pub missing: usize,
    /// Why it is not offered as a scene; empty where it is.
    pub rejections: Vec<Rejection>,
    /// Cameras to choose from, the best score first.
    pub cameras: Vec<CandidateCamera>,
}

/// A camera to choose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CandidateCamera {
    /// The scene's id in the recipe.
    pub scene: String,
    /// `seed 3`, or `designer 5`.
    pub origin: String,
    /// Metres.
    pub position: [f64; 3],
    /// A point in the middle of the picture, metres.
    pub target: [f64; 3],
    /// Vertical field of view, degrees.
    pub fov_y_deg: f64,
    /// BlenderProc's coverage score of the input view.
    pub score: f64,
    /// Metres to the nearest thing in the input view.
    pub nearest_m: f64,
    /// Share of the five views' pixels that see the outside.
    pub outside: f64,
    /// Pieces of furniture that the input view sees.
    pub seen_objects: usize,
    /// Its picture, relative to this file.
    pub thumbnail: String,
}

/// What a survey gave.
#[derive(Clone, Debug)]
pub struct Surveyed {
    /// What was written as `survey.json`.
    pub file: SurveyFile,
    /// The folder that its paths, and its recipe's, are relative to.
    pub source: PathBuf,
}

/// Looks through all houses and writes survey, page, thumbnails and recipe. A house that cannot be read is told in the
/// survey and does not stop it.
pub fn survey(options: &SurveyOptions, tool: &str, progress: Progress<'_>) -> Result<Surveyed, PrepError> {
    check_folders(options)?;
    let source = source_folder(options)?;
    let options = &below(options, &source)?;
    let houses = house_files(options, &source)?;
    check_free(&options.out, options.force, "--out")?;
    if options.out.exists() && !is_only_a_survey(&options.out) {
        let what =
            "is there and is no survey, or holds more than one: it is not replaced; choose another --out".to_owned();
        return Err(PrepError::Output { path: options.out.clone(), what });
    }
    let work = WorkFolder::start(&options.out)?;
    let thumbnails = work.path().join(THUMBNAILS);
    std::fs::create_dir_all(&thumbnails).map_err(PrepError::io("make", &thumbnails))?;
    let mut file =
        SurveyFile { format: SURVEY_FORMAT.to_owned(), tool: tool.to_owned(), seed: options.seed, houses: Vec::new() };
    let mut texts = RecipeTexts { head: recipe_text::head(options), ..Default::default() };
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

/// Whether a folder holds a survey and nothing that a survey does not make.
fn is_only_a_survey(out: &Path) -> bool {
    let Ok(file) = json::read::<SurveyFile>(&out.join(SURVEY)) else { return false };
    let rooms = file.houses.iter().flat_map(|house| &house.rooms);
    let pictures: Vec<&str> = rooms
        .flat_map(|room| &room.cameras)
        .filter_map(|camera| camera.thumbnail.strip_prefix("thumbnails/"))
        .collect();
    file.format == SURVEY_FORMAT
        && holds_only(out, &[SURVEY, RECIPE, PAGE, THUMBNAILS])
        && holds_only(&out.join(THUMBNAILS), &pictures)
}

/// Pieces of recipes, for whatever is picked.
#[derive(Debug, Default, Serialize)]
struct RecipeTexts {
    head: String,
    /// Ids of scenes.
    #[serde(skip)]
    taken: BTreeSet<String>,
    /// By scene.
    scenes: BTreeMap<String, String>,
    /// By the house's file.
    inputs: BTreeMap<String, String>,
}

impl RecipeTexts {
    /// The best camera of every room that is offered.
    fn of_best(&self, survey: &SurveyFile) -> String {
        let mut text = self.head.clone();
        for house in &survey.houses {
            for camera in house.rooms.iter().filter_map(|room| room.cameras.first()) {
                text.push_str(&self.scenes[&camera.scene]);
                text.push_str(&self.inputs[&house.file]);
            }
        }
        text
    }
}

fn survey_house(
    options: &SurveyOptions,
    [source, house]: [&Path; 2],
    out: &Path,
    texts: &mut RecipeTexts,
) -> Result<SurveyedHouse, PrepError> {
    let files = HouseFiles {
        root: source.to_owned(),
        house: house.to_owned(),
        models: options.models.clone(),
        textures: options.textures.clone(),
        cameras: options.cameras.clone(),
        blenderproc_compat: false,
    };
    let shown = house.to_string_lossy().replace('\\', "/");
    let looked = front3d::furnish(&files, &front3d::Limits::default())
        .map_err(PrepError::from)
        .and_then(|furnished| Ok((candidates::look_through(options, &furnished, &mut texts.taken)?, furnished)));
    let (HouseSurvey { rooms, pictures }, furnished) = match looked {
        Ok(looked) => looked,
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

/// The current folder.
const HERE: &str = ".";

/// Every path that was named.
fn named_paths(options: &SurveyOptions) -> impl Iterator<Item = &PathBuf> {
    options.houses.iter().chain([&options.models]).chain(&options.textures).chain(&options.cameras)
}

/// The folder that all paths shall be relative to.
fn source_folder(options: &SurveyOptions) -> Result<PathBuf, PrepError> {
    if let Some(source) = &options.source {
        return Ok(source.clone());
    }
    if named_paths(options).all(|path| relative_below(path, Path::new(HERE)).is_ok()) {
        return Ok(HERE.into());
    }
    common_folder(named_paths(options).map(PathBuf::as_path)).ok_or_else(|| {
        let what = "has no folder in common with the other paths; put them into one, and name it with --source";
        PrepError::Output { path: options.models.clone(), what: what.to_owned() }
    })
}

/// The same with all paths relative to `source`: they end in the survey, in its recipe and in what is built from that.
fn below(options: &SurveyOptions, source: &Path) -> Result<SurveyOptions, PrepError> {
    let place = |path: &PathBuf| {
        let chosen = options.source.is_none() && source != Path::new(HERE);
        let path = if chosen { std::path::absolute(path).map_err(PrepError::io("find", path))? } else { path.clone() };
        relative_below(&path, source).map_err(|what| PrepError::Output {
            path: path.clone(),
            what: format!("cannot be told in a recipe: {what}; name the folder that holds all with --source"),
        })
    };
    Ok(SurveyOptions {
        houses: options.houses.iter().map(place).collect::<Result<_, _>>()?,
        models: place(&options.models)?,
        textures: options.textures.as_ref().map(place).transpose()?,
        cameras: options.cameras.as_ref().map(place).transpose()?,
        ..options.clone()
    })
}

/// What all houses need must be there: else each of them would have the same fault.
fn check_folders(options: &SurveyOptions) -> Result<(), PrepError> {
    let source = options.source.as_deref().unwrap_or(Path::new(HERE));
    let folders = [Some(&options.models), options.textures.as_ref()].into_iter().flatten();
    let missing_folder = folders.map(|path| source.join(path)).find(|path| !path.is_dir());
    let files = options.cameras.iter().chain(&options.houses).map(|path| source.join(path));
    let missing = missing_folder.or_else(|| files.into_iter().find(|path| !path.exists()));
    match missing {
        Some(path) => Err(PrepError::Output { path, what: "is not there; mend the path, or name --source".to_owned() }),
        None => Ok(()),
    }
}

/// The files, and all JSON files of the folders, each once, sorted by folder; relative to the source's folder.
fn house_files(options: &SurveyOptions, source: &Path) -> Result<Vec<PathBuf>, PrepError> {
    let mut files = Vec::new();
    for path in &options.houses {
        let at = source.join(path);
        if !at.is_dir() {
            files.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(&at).map_err(PrepError::io("list", &at))?;
        let names = entries.flatten().map(|entry| path.join(entry.file_name()));
        let mut names: Vec<PathBuf> = names.filter(|name| name.extension().is_some_and(|e| e == "json")).collect();
        names.sort();
        files.extend(names);
    }
    let mut seen = BTreeSet::new();
    files.retain(|file| seen.insert(source.join(file).canonicalize().ok().unwrap_or_else(|| file.clone())));
    if files.is_empty() {
        let what = "holds no house: expected JSON files of 3D-FRONT".to_owned();
        return Err(PrepError::Output { path: source.to_owned(), what });
    }
    Ok(files)
}
