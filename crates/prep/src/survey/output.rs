//! Puts the survey together from what was found in each house, and writes it with its page and its recipe.
//!
//! The page is there to pick rooms from. The recipe holds the best camera of each room, and the SHA-256 of every file
//! that the scene is made of.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::SourceFile;
use mateval_dataset::ids::unused_name;
use mateval_dataset::json;
use mateval_files::source_folder::slashed;
use mateval_files::whole::write_whole;
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::house::{HouseName, HousePart, SurveyFolder};
use super::rules::SurveyOptions;
use super::selection::{rank, select};
use super::survey_file::{CandidateCamera, SURVEY, SURVEY_FORMAT, SurveyFile, SurveyedHouse};
use crate::error::PrepError;
use crate::recipe::{RECIPE, Redress};

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
        camera_rules: options.camera_rules.to_string(),
        selection: None,
        houses: Vec::new(),
    };
    let mut taken = BTreeSet::new();
    for house in houses {
        let part: HousePart = json::read(&folder.part(&HouseName::new(&slashed(house))))?;
        file.houses.push(named(part, options, &mut taken, &mut texts));
    }
    rank(&mut file.houses);
    file.selection = options.goal.map(|goal| select(&mut file.houses, &goal));
    let names: Vec<HouseName> = houses.iter().map(|house| HouseName::new(&slashed(house))).collect();
    folder.keep_only(&names)?;
    write_whole(&folder.file(RECIPE), texts.of_best(&file).as_bytes())?;
    write_whole(&folder.file(PAGE), page(&file, &texts).as_bytes())?;
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
            // The names of several rooms may be shortened to the same id.
            camera.scene = unused_name(&camera.scene, '-', taken);
            let text = scene_text(options, &house.file, &room.room, camera);
            texts.scenes.insert(camera.scene.clone(), text);
        }
    }
    if house.error.is_none() {
        texts.inputs.insert(house.file.clone(), inputs_text(&files));
    }
    house
}

/// Pieces of recipes, from which the page joins a recipe of whatever is picked.
#[derive(Debug, Default, Serialize)]
struct RecipeTexts {
    /// The lines before the first scene.
    head: String,
    /// The text of each scene without its inputs, by the scene's id.
    scenes: BTreeMap<String, String>,
    /// The inputs of each house's scenes, by the house's file.
    inputs: BTreeMap<String, String>,
}

impl RecipeTexts {
    /// The texts of a survey that has found nothing yet.
    fn new(options: &SurveyOptions) -> Self {
        Self { head: head_text(options), ..Default::default() }
    }

    /// The recipe of the best camera of every room that is offered, or of those that were chosen, each with the reason.
    fn of_best(&self, survey: &SurveyFile) -> String {
        let mut text = self.head.clone();
        for house in &survey.houses {
            for room in &house.rooms {
                let is_in = survey.selection.is_none() || room.choice.as_ref().is_some_and(|c| c.place.is_some());
                let Some(camera) = room.cameras.first().filter(|_| is_in) else { continue };
                let reason = room.choice.as_ref().map(|choice| format!("\n# {}", choice.reason)).unwrap_or_default();
                text.push_str(&reason);
                text.push_str(&self.scenes[&camera.scene]);
                text.push_str(&self.inputs[&house.file]);
            }
        }
        text
    }
}

/// The lines before the first scene.
fn head_text(options: &SurveyOptions) -> String {
    let [width, height] = options.resolution;
    let remark = "# Paths are relative to the folder that was surveyed: name it with --source.\n";
    let rules = options.camera_rules;
    format!("{remark}name = \"picked\"\nresolution = [{width}, {height}]\ncamera_rules = \"{rules}\"\n")
}

/// A scene without its inputs, which follow it.
fn scene_text(options: &SurveyOptions, house: &str, room: &str, camera: &CandidateCamera) -> String {
    let shown = |path: &Path| quoted(&slashed(path));
    let mut keys = format!("house = {}, room = {}, models = {}", quoted(house), quoted(room), shown(&options.models));
    for (key, path) in [("textures", &options.textures), ("cameras", &options.cameras)] {
        if let Some(path) = path {
            // Writing to a String cannot fail.
            let _ = write!(keys, ", {key} = {}", shown(path));
        }
    }
    let CandidateCamera { scene, position, target, fov_y_deg, origin, .. } = camera;
    let redress = options.redress.as_ref().map(|Redress { key, materials }| {
        let materials = materials.as_ref().map(|folder| format!(", materials = {}", shown(folder)));
        format!("redress = {{ key = {}{} }}\n", shown(key), materials.unwrap_or_default())
    });
    let redress = redress.unwrap_or_default();
    format!(
        "\n[[scene]]\nid = {}\nfront3d = {{ {keys} }}\n{redress}# {origin}\n\
         camera = {{ position = {position:?}, target = {target:?}, fov_y_deg = {fov_y_deg:?} }}\n",
        quoted(scene)
    )
}

/// The files of a house and their SHA-256, which are the same for each of its rooms.
fn inputs_text(files: &[SourceFile]) -> String {
    files.iter().fold("[scene.inputs]\n".to_owned(), |mut text, SourceFile { path, sha256 }| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{} = \"{sha256}\"", quoted(path));
        text
    })
}

/// The text as a TOML basic string on one line, which is valid as a key and as a value.
fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => quoted.push_str(&format!("\\u{:04X}", c as u32)),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

const TEMPLATE: &str = include_str!("page.j2");
const PICK: &str = include_str!("pick.js");

/// HTML that shows every candidate with its thumbnail and lists every rejected room with its reasons. A short script on
/// the page joins the ticked candidates into a recipe at its end.
fn page(survey: &SurveyFile, texts: &RecipeTexts) -> String {
    let values = context! { title => "Rooms to pick from", survey => Serde(survey), texts => Serde(texts) };
    mateval_pages::single(TEMPLATE, values, PICK)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_file_name_is_a_key_that_reads_back() {
        for name in ["a/b.json", "Bob's \"flat\".json", "a\\b\n\u{7f}", "客厅"] {
            let table: toml::Table = toml::from_str(&format!("{} = 1", quoted(name))).unwrap();
            assert_eq!(table.keys().collect::<Vec<_>>(), [name]);
        }
    }
}
