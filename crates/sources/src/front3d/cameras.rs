//! Designers' cameras, from the house's JSON or from a file beside it (`camera_data.json` of the data's owner).

use serde_json::Value;

use super::document;
use super::house::{DesignerCamera, House};
use super::house_files::{HouseFiles, shown_path};
use super::house_reader::designer_camera;
use super::limits::Limits;
use crate::error::{InvalidSource, SourceError};
use crate::source_scene::Log;

/// The designers' cameras of a house.
pub(super) struct Cameras {
    /// The cameras, sorted by number.
    pub(super) all: Vec<DesignerCamera>,
    /// The path and the hash of the file beside the house, if it was read.
    pub(super) hash: Option<(String, String)>,
}

/// The cameras from the file beside the house. Without such a file, or where it has none for this house, those from the
/// house's JSON.
pub(super) fn all(house: &House, files: &HouseFiles, limits: &Limits, log: &mut Log) -> Result<Cameras, SourceError> {
    let Some(beside) = &files.cameras else { return Ok(Cameras { all: house.cameras.clone(), hash: None }) };
    let path = files.root.join(beside);
    let (folder, _, bytes) = crate::error::open(&path, limits.json_bytes, limits.json_bytes)?;
    let invalid = |error| SourceError::invalid(&path, InvalidSource::House(error));
    let tree = document::parse(&bytes, limits).map_err(invalid)?;
    let all = of_house(&tree, &house.uid);
    let all: Vec<DesignerCamera> = all.into_iter().map(|camera| camera.shifted(house.shift_m)).collect();
    if all.is_empty() {
        let message = format!("expected cameras of the house '{}', found none", house.uid);
        let action = "used the cameras in the house's JSON";
        log.push(mateval_scene::Severity::Note, "no_camera", &shown_path(beside), "", message, action);
    }
    let hash = folder.into_files().hashes.into_iter().next().map(|(_, hash)| (shown_path(beside), hash));
    Ok(Cameras { all: if all.is_empty() { house.cameras.clone() } else { all }, hash })
}

/// The cameras of the entries `<uid>_<number>.jpg`, sorted by number.
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
    fn only_cameras_of_the_house_sorted_by_number() {
        let camera = |x: f64| json!({"camera": {"pos": [x, 1, 0], "target": [0, 1, 0], "fov": 60}});
        let tree = json!({"u_10.jpg": camera(10.0), "u_2.jpg": camera(2.0), "v_1.jpg": camera(1.0), "u_x.jpg": camera(3.0),
            "u_3.jpg": {"camera": {"pos": [1, 1], "target": [0, 1, 0], "fov": 60}}});
        let numbers: Vec<usize> = of_house(&tree, "u").iter().map(|camera| camera.number).collect();
        assert_eq!(numbers, [2, 10]);
    }
}
