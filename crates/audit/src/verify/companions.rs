//! Checks the pictures of companions that a dataset carries.

use std::path::Path;

use mateval_prep::faults::Faults;
use mateval_scene::companions_file::{COMPANIONS_FORMAT, COMPANIONS_JSON, CompanionsFile, light_inputs_sha256};
use mateval_scene::layout::SceneFolder;
use mateval_scene::{Finding, SceneId, Severity, json};

/// Warns of companions that were made from other files of the scene than the manifest lists. Scoring renders them again, so no
/// score is wrong, but every user pays for the rendering.
pub(super) fn check(root: &Path, folder: &SceneFolder, scene: &SceneId, faults: &mut Faults) {
    let Ok(passes) = std::fs::read_dir(folder.companions()) else { return };
    // A manifest that cannot be read has been reported.
    let Ok(inputs) = light_inputs_sha256(root, scene) else { return };
    let mut passes: Vec<String> =
        passes.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    passes.sort();
    for pass in passes {
        let path = folder.companions().join(&pass).join(COMPANIONS_JSON);
        if !path.is_file() {
            continue;
        }
        let read = json::read_format::<CompanionsFile>(&path, COMPANIONS_FORMAT);
        let (place, message) = match read {
            Ok(list) if list.inputs_sha256 == inputs => continue,
            Ok(_) => {
                let message = "the pictures were made from other files of the scene than the manifest lists";
                ("/inputs_sha256", message.to_owned())
            }
            Err(error) => ("", error.to_string()),
        };
        faults.all.push(Finding {
            severity: Severity::Warning,
            code: "stale_companions".to_owned(),
            file: format!("{}ground_truth/companions/{pass}/{COMPANIONS_JSON}", faults.prefix),
            place: place.to_owned(),
            message,
            action: format!(
                "run `mateval prep companions --scene {scene}`, then `mateval prep finish`; until then scoring renders them anew"
            ),
        });
    }
}
