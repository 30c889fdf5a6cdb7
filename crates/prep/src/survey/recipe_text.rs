//! The rooms that are picked, as text of a recipe: a camera, and the SHA-256 of every file that the scene is made of.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use mateval_scene::dataset::SourceFile;
use serde::Serialize;

use super::options::SurveyOptions;
use super::survey_file::{CandidateCamera, SurveyFile};

/// Pieces of recipes, from which the page joins a recipe of whatever is picked.
#[derive(Debug, Default, Serialize)]
pub(super) struct RecipeTexts {
    /// The lines before the first scene.
    pub(super) head: String,
    /// The text of each scene without its inputs, by the scene's id.
    pub(super) scenes: BTreeMap<String, String>,
    /// The inputs of each house's scenes, by the house's file.
    pub(super) inputs: BTreeMap<String, String>,
}

impl RecipeTexts {
    /// The texts of a survey that has found nothing yet.
    pub(super) fn new(options: &SurveyOptions) -> Self {
        Self { head: head(options), ..Default::default() }
    }

    /// The recipe of the best camera of every room that is offered, or of those that were chosen, each with the reason.
    pub(super) fn of_best(&self, survey: &SurveyFile) -> String {
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
fn head(options: &SurveyOptions) -> String {
    let [width, height] = options.resolution;
    let remark = "# Paths are relative to the folder that was surveyed: name it with --source.\n";
    let rules = options.camera_rules;
    format!("{remark}name = \"picked\"\nresolution = [{width}, {height}]\ncamera_rules = \"{rules}\"\n")
}

/// A scene without its inputs, which follow it.
pub(super) fn scene(options: &SurveyOptions, house: &str, room: &str, camera: &CandidateCamera) -> String {
    let shown = |path: &Path| quoted(&path.to_string_lossy().replace('\\', "/"));
    let mut keys = format!("house = {}, room = {}, models = {}", quoted(house), quoted(room), shown(&options.models));
    for (key, path) in [("textures", &options.textures), ("cameras", &options.cameras)] {
        if let Some(path) = path {
            // Writing to a String cannot fail.
            let _ = write!(keys, ", {key} = {}", shown(path));
        }
    }
    let CandidateCamera { scene, position, target, fov_y_deg, origin, .. } = camera;
    format!(
        "\n[[scene]]\nid = {}\nfront3d = {{ {keys} }}\n# {origin}\n\
         camera = {{ position = {position:?}, target = {target:?}, fov_y_deg = {fov_y_deg:?} }}\n",
        quoted(scene)
    )
}

/// The files of a house and their SHA-256, which are the same for each of its rooms.
pub(super) fn inputs(files: &[SourceFile]) -> String {
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
