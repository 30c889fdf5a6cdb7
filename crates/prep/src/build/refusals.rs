//! Refuses scenes that would be built into a wrong truth.
//!
//! These are scenes in which much of the source is missing, base colours are not stated, or no light reaches the picture.
//! The recipe may allow the first two.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use mateval_dataset::camera::{Camera, Intrinsics};
use mateval_dataset::{Finding, Severity};
use mateval_sources::source_scene::Missing;
use mateval_tracer::{LightBasis, RenderSettings, World, render_views};

use super::fault::{BuildFault, above_notes};
use super::pictures::Seen;
use super::plan::Plan;
use super::source::MOST_UNSTATED;
use crate::error::PrepError;
use crate::recipe::RecipeScene;

/// A larger share of missing files or pieces is a warning.
const FEW_MISSING: f64 = 0.05;
/// A larger share of missing files or pieces refuses the scene.
const MOST_MISSING: f64 = 0.2;
/// Most names in a message.
const MOST_NAMES: usize = 5;
/// Largest number of pixels of a side of the picture in which light is looked for.
const LIGHT_PIXELS: f64 = 48.0;
/// Samples a pixel in which light is looked for: first few, then many.
const LIGHT_SAMPLES: [u32; 2] = [4, 128];
/// Where the brightest pixel times the exposure is smaller, every byte of the picture is 0, with a margin of ten for what the
/// coarse picture misses.
const LEAST_LIGHT: f64 = 1.5e-5;
/// Most missing files that are looked for elsewhere.
const MOST_LOOKED_FOR: usize = 8;
/// Most folders that are searched for a missing file.
const MOST_FOLDERS: usize = 2000;

/// The finding about missing files, if any are missing. Fails where too many are.
pub(super) fn check_missing(
    entry: &RecipeScene,
    missing: &Missing,
    root: &Path,
    file: &str,
    findings: &[Finding],
) -> Result<Option<Finding>, BuildFault> {
    let Some(example) = missing.files.first() else { return Ok(None) };
    let (count, wanted) = (missing.files.len(), missing.wanted.max(1));
    let share = count as f64 / wanted as f64;
    // The first names may be those of shapes, which have no file of their own.
    let mut elsewhere = missing.files.iter().take(MOST_LOOKED_FOR).map(|file| elsewhere(entry, root, file));
    let elsewhere = elsewhere.find(|found| !found.is_empty()).unwrap_or_default();
    let message = format!("{count} of {wanted} {} are missing, such as '{example}'{elsewhere}", missing.what);
    if share > MOST_MISSING && !entry.allow_missing {
        let allowed = "missing, unless the recipe's scene has `allow_missing = true`";
        return Err(BuildFault::TooMuch { message, most: MOST_MISSING, allowed, findings: above_notes(findings) });
    }
    Ok(Some(Finding::new(
        if share > FEW_MISSING { Severity::Warning } else { Severity::Note },
        "missing_share",
        file,
        "",
        message,
        "made the scene without them",
    )))
}

/// Where a missing file was found instead, as a sentence's end; empty if nowhere.
fn elsewhere(entry: &RecipeScene, root: &Path, missing: &str) -> String {
    let models = entry.front3d.as_ref().map(|room| room.models.as_path());
    if let Some(folder) = folder_of(root, missing, models) {
        let shown = folder.display();
        return match models {
            Some(_) => format!("; '{shown}' holds such files: name that folder"),
            None => format!("; '{shown}' holds such files: move them to where the scene names them"),
        };
    }
    if let Some(found) = by_other_case(root, missing) {
        return format!("; '{found}' exists: its name differs in upper and lower case alone, so rename it");
    }
    let plain = missing.replace("%20", " ");
    if plain != missing && root.join(&plain).is_file() {
        return format!("; '{plain}' exists: names are not percent-encoded here");
    }
    // A main file that was moved down, away from its files. The folder above is looked at only if it holds the very path.
    let above = root.parent().filter(|above| models.is_none() && above.join(missing).is_file());
    above.map_or(String::new(), |above| {
        format!(
            "; '{}' holds such files, but lies outside of the scene's folder: move the scene's main file there",
            above.display()
        )
    })
}

/// The path of a file below `root` that differs from `missing` in upper and lower case alone.
fn by_other_case(root: &Path, missing: &str) -> Option<String> {
    let mut found: Vec<String> = Vec::new();
    for part in missing.split('/').filter(|part| !matches!(*part, "" | ".")) {
        let folder = found.iter().fold(root.to_owned(), |folder, part| folder.join(part));
        let names = std::fs::read_dir(folder).into_iter().flatten().flatten().take(MOST_FOLDERS);
        let names = names.filter_map(|entry| entry.file_name().into_string().ok());
        let mut same: Vec<String> = names.filter(|name| name.to_lowercase() == part.to_lowercase()).collect();
        same.sort_by_key(|name| (name != part, name.clone()));
        found.push(same.into_iter().next()?);
    }
    let found = found.join("/");
    (root.join(&found).is_file() && found != missing).then_some(found)
}

/// A folder below `root`, or `root` itself, in which the missing file exists: by its whole path, or else by its own
/// folder and name. A path of at most two parts is also found by its name, unless several folders hold such a name.
/// `models` is the folder of a 3D-FRONT room's models, which all have the same names in folders of their own. Absent if
/// the file is where it was looked for.
fn folder_of(root: &Path, missing: &str, models: Option<&Path>) -> Option<PathBuf> {
    let parts: Vec<&str> = missing.split('/').filter(|part| !matches!(*part, "" | "." | "..")).collect();
    if parts.is_empty() || root.join(missing).is_file() {
        return None;
    }
    let folders = folders_below(root);
    let holds = |folder: &Path, count: usize| folder.join(parts[parts.len() - count..].join("/")).is_file();
    let whole = [parts.len(), 2].into_iter().filter(|count| (2..=parts.len()).contains(count));
    let found = whole.into_iter().find_map(|count| folders.iter().find(|folder| holds(folder, count)).cloned());
    if found.is_some() || models.is_some() || parts.len() > 2 {
        // Files that exist in the folder that the recipe names are damaged.
        return found.filter(|folder| models.is_none_or(|models| *folder != root.join(models)));
    }
    let mut by_name = folders.iter().filter(|folder| holds(folder, 1));
    let only = by_name.next().filter(|_| by_name.next().is_none());
    only.cloned()
}

/// The folder and those up to three levels down, in a fixed order.
fn folders_below(root: &Path) -> Vec<PathBuf> {
    let mut folders = vec![root.to_owned()];
    let mut at = 0;
    while at < folders.len() && folders.len() < MOST_FOLDERS {
        let depth = folders[at].strip_prefix(root).map_or(0, |below| below.components().count());
        if depth < 3 {
            let entries = std::fs::read_dir(&folders[at]).into_iter().flatten().flatten();
            let below = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
            let mut below: Vec<PathBuf> = below.map(|entry| entry.path()).take(MOST_FOLDERS).collect();
            below.sort();
            folders.append(&mut below);
        }
        at += 1;
    }
    folders
}

/// The finding about base colours that are not stated, if any are. Fails where they cover too much of the picture.
pub(super) fn check_unstated(entry: &RecipeScene, plan: &Plan, seen: &Seen) -> Result<Option<Finding>, BuildFault> {
    if !plan.source.kind.states_materials() {
        return Ok(None);
    }
    let all: usize = seen.input_pixels.iter().sum();
    let is_unstated = |at: &usize| !plan.origins[*at].stated.base_color && seen.input_pixels[*at] > 0;
    let mut unstated: Vec<usize> = (0..plan.instances.len()).filter(is_unstated).collect();
    if unstated.is_empty() {
        return Ok(None);
    }
    unstated.sort_by_key(|at| std::cmp::Reverse(seen.input_pixels[*at]));
    let share = |count: usize| count as f64 / all.max(1) as f64;
    let names = unstated.iter().take(MOST_NAMES).map(|at| {
        let name = &plan.scene.materials[plan.scene.surfaces[*at].material.0].name;
        format!("'{}' ({:.1} %, material '{name}')", plan.instances[*at].id, 100.0 * share(seen.input_pixels[*at]))
    });
    let total = share(unstated.iter().map(|at| seen.input_pixels[*at]).sum());
    let message = format!(
        "{} instances state no base colour and cover {:.1} % of the scored pixels: {}",
        unstated.len(),
        100.0 * total,
        names.collect::<Vec<_>>().join(", ")
    );
    if total > MOST_UNSTATED && !entry.allow_unstated {
        let allowed = "unstated. Give the materials a colour or a texture (bake procedural ones); or, where the \
                       exporter leaves out a white that is meant, write `allow_unstated = true` for the scene in the \
                       recipe";
        let findings = above_notes(&plan.findings);
        return Err(BuildFault::TooMuch { message, most: MOST_UNSTATED, allowed, findings });
    }
    Ok(Some(Finding::new(
        Severity::Warning,
        "unstated_base_color",
        plan.file.clone(),
        "",
        message,
        "used the default of the format as their truth",
    )))
}

/// Fails where too little light reaches the input view, whose picture would be black. A photo from elsewhere has its
/// own light.
pub(super) fn check_light(entry: &RecipeScene, plan: &Plan, seen: &Seen) -> Result<(), PrepError> {
    if plan.photo.is_some() {
        return Ok(());
    }
    let world = World::new(Arc::clone(&plan.scene))?;
    let camera = coarse(&plan.views[0].camera);
    for samples in LIGHT_SAMPLES {
        let settings = RenderSettings { samples, ..RenderSettings::default() };
        let render = render_views(&world, &[camera], &settings, &[0], &|_, _| {})?;
        let sums = render.views[0].by_seed.iter().map(LightBasis::sum);
        if sums
            .flat_map(|sum| sum.pixels().to_vec())
            .any(|pixel| pixel.0.iter().any(|value| entry.exposure * f64::from(*value) >= LEAST_LIGHT))
        {
            return Ok(());
        }
    }
    let findings = above_notes(&[plan.findings.as_slice(), &seen.findings].concat());
    Err(PrepError::scene(&entry.id)(BuildFault::NoLight { lights: plan.scene.lights.len(), findings }))
}

/// The camera with a small picture.
fn coarse(camera: &Camera) -> Camera {
    let k = camera.intrinsics;
    let scale = (LIGHT_PIXELS / f64::from(k.width.max(k.height))).min(1.0);
    let side = |pixels: u32| ((f64::from(pixels) * scale).round() as u32).max(1);
    let intrinsics = Intrinsics {
        width: side(k.width),
        height: side(k.height),
        fx: k.fx * scale,
        fy: k.fy * scale,
        cx: k.cx * scale,
        cy: k.cy * scale,
    };
    Camera { intrinsics, ..*camera }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with these files.
    fn folder_with(files: &[&str]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for file in files {
            let path = root.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        root
    }

    #[test]
    fn the_folder_that_holds_a_missing_file_is_found() {
        let root = folder_with(&["models/3D-FUTURE-model/chair-a/raw_model.obj"]);
        let models = Some(Path::new("models"));
        let found = |missing: &str| folder_of(root.path(), missing, models);
        let deep = Some(root.path().join("models/3D-FUTURE-model"));
        assert_eq!(found("models/chair-a/raw_model.obj"), deep);
        assert_eq!(found("chair-a/raw_model.obj"), deep);
        assert_eq!(found("models/chair-a/texture.png"), None);
        // Another model, whose files have the same names.
        assert_eq!(found("models/chair-b/raw_model.obj"), None);
        assert_eq!(found("chair-b/raw_model.obj"), None);
        // It is in the folder that the recipe names, so it is damaged.
        let named = Path::new("models/3D-FUTURE-model");
        assert_eq!(folder_of(root.path(), "chair-a/raw_model.obj", Some(named)), None);
    }

    #[test]
    fn where_a_missing_file_lies_is_said() {
        let root =
            folder_with(&["scene/Textures/Wood.PNG", "scene/deep/maps/a.png", "scene/my wood.png", "meshes/chair.obj"]);
        let entry: RecipeScene = toml::from_str("id = \"a\"\nbitterli = \"scene/scene.xml\"").unwrap();
        let said = |missing: &str| elsewhere(&entry, &root.path().join("scene"), missing);
        assert!(
            said("textures/wood.png").contains("'Textures/Wood.PNG' exists: its name differs in upper and lower case")
        );
        assert!(said("maps/a.png").contains("deep' holds such files: move them"));
        assert!(said("meshes/chair.obj").contains("move the scene's main file there"));
        assert!(said("my%20wood.png").contains("'my wood.png' exists"));
        assert_eq!(said("maps/b.png"), "");
    }

    #[test]
    fn a_file_is_found_by_its_name_in_one_folder() {
        let root = folder_with(&[
            "textures/t0.png",
            "m0.obj",
            "a/both.png",
            "b/both.png",
            "meshes/models/m1.obj",
            "old/m1.obj",
        ]);
        let found = |missing: &str| folder_of(root.path(), missing, None);
        assert_eq!(found("t0.png"), Some(root.path().join("textures")));
        assert_eq!(found("models/m0.obj"), Some(root.path().to_owned()));
        assert_eq!(found("../models/m1.obj"), Some(root.path().join("meshes")));
        assert_eq!(found("both.png"), None);
        assert_eq!(found("deep/models/m0.obj"), None);
        // It was looked for where it is.
        assert_eq!(found("textures/t0.png"), None);
        assert_eq!(found("m0.obj"), None);
        assert_eq!(found(""), None);
    }
}
