//! Picks as a recipe: a pose, and the SHA-256 of everything that the scene is made of.

use std::fmt::Write as _;
use std::path::Path;

use super::{CandidateCamera, SurveyOptions};

/// What stands before the scenes.
pub(super) fn head(options: &SurveyOptions) -> String {
    let [width, height] = options.resolution;
    let remark = "# Paths are relative to the folder that was surveyed: name it with --source.\n";
    format!("{remark}name = \"picked\"\nresolution = [{width}, {height}]\n")
}

/// One scene but for its inputs, which follow.
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

/// The files of a house and their SHA-256: the same for each of its rooms.
pub(super) fn inputs(files: &[(String, String)]) -> String {
    files.iter().fold("[scene.inputs]\n".to_owned(), |mut text, (file, sha256)| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{} = \"{sha256}\"", quoted(file));
        text
    })
}

/// As a TOML basic string on one line, which is a key as well as a value.
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
    fn any_file_name_is_a_key_and_comes_back() {
        for name in ["a/b.json", "Bob's \"flat\".json", "a\\b\n\u{7f}", "客厅"] {
            let table: toml::Table = toml::from_str(&format!("{} = 1", quoted(name))).unwrap();
            assert_eq!(table.keys().collect::<Vec<_>>(), [name]);
        }
    }
}
