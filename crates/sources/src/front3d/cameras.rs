//! Designers' cameras: of the house's JSON, and of a file beside it (`camera_data.json` of the data's owner).

use serde_json::Value;

use super::document;
use super::furnish::{HouseFiles, shown_path};
use super::house::{DesignerCamera, House};
use super::house_reader::designer_camera;
use super::limits::Limits;
use crate::SourceError;
use crate::log::Log;

/// All cameras of a house.
pub(super) struct Cameras {
    /// Sorted by number.
    pub(super) all: Vec<DesignerCamera>,
    /// The file beside, and its hash.
    pub(super) hash: Option<(String, String)>,
}

/// Those of the file beside where there is one, else those of the JSON.
pub(super) fn all(house: &House, files: &HouseFiles, limits: &Limits, log: &mut Log) -> Result<Cameras, SourceError> {
    let Some(beside) = &files.cameras else { return Ok(Cameras { all: house.cameras.clone(), hash: None }) };
    let path = files.root.join(beside);
    let (folder, _, bytes) = crate::source_scene::open(&path, limits.json_bytes, limits.json_bytes)?;
    let invalid = |what: String| SourceError::Invalid { path: path.clone(), what };
    let tree = document::parse(&bytes, limits).map_err(invalid)?;
    let all = of_house(&tree, &house.uid);
    if all.is_empty() {
        let message = format!("it has no camera of the house '{}'", house.uid);
        log.push(mateval_scene::Severity::Note, "no_camera", &shown_path(beside), "", message, "used the house's own");
    }
    let hash = folder.into_files().hashes.into_iter().next().map(|(_, hash)| (shown_path(beside), hash));
    Ok(Cameras { all: if all.is_empty() { house.cameras.clone() } else { all }, hash })
}

/// Entries `<uid>_<number>.jpg` with `camera`: pos, target, fov.
fn of_house(tree: &Value, uid: &str) -> Vec<DesignerCamera> {
    let entries = tree.as_object().into_iter().flatten();
    let mut all: Vec<DesignerCamera> = entries
        .filter_map(|(key, entry)| {
            let number = key.strip_prefix(uid)?.strip_prefix('_')?.split('.').next()?.parse().ok()?;
            designer_camera(entry.get("camera")?, number)
        })
        .collect();
    all.sort_by_key(|camera| camera.number);
    all
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn cameras_of_the_house_by_number() {
        let camera = |x: f64| json!({"camera": {"pos": [x, 1, 0], "target": [0, 1, 0], "fov": 60}});
        let tree = json!({"u_10.jpg": camera(10.0), "u_2.jpg": camera(2.0), "v_1.jpg": camera(1.0), "u_x.jpg": camera(3.0),
            "u_3.jpg": {"camera": {"pos": [1, 1], "target": [0, 1, 0], "fov": 60}}});
        let numbers: Vec<usize> = of_house(&tree, "u").iter().map(|camera| camera.number).collect();
        assert_eq!(numbers, [2, 10]);
    }
}
