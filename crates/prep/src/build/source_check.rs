//! Whether the files that a recipe's scenes are made of exist, and are those that the recipe pins.

use std::path::{Path, PathBuf};

use mateval_scene::{SceneId, manifest};
use mateval_sources::below::relative_below;

use super::options::BuildOptions;
use crate::error::PrepError;
use crate::recipe::fault::{RecipeFault, RecipeSceneFault};
use crate::recipe::{Recipe, RecipeScene, SourcePath};

/// The folder that the recipe's paths are relative to.
pub(super) fn source_folder(options: &BuildOptions) -> PathBuf {
    // The parent of a file name alone is the empty path, which names no folder.
    let parent = options.recipe.parent().filter(|folder| !folder.as_os_str().is_empty());
    options.source.clone().unwrap_or_else(|| parent.unwrap_or(Path::new(".")).to_owned())
}

/// Makes the paths that the dataset records relative to `source`.
pub(super) fn make_relative(options: &BuildOptions, recipe: &mut Recipe, source: &Path) -> Result<(), PrepError> {
    let mut faults = Vec::new();
    for scene in &mut recipe.scenes {
        let id = scene.id.clone();
        for (key, path) in scene.recorded_paths() {
            match relative_below(path, source) {
                Ok(relative) => *path = relative,
                Err(source) => faults.push((id.clone(), RecipeSceneFault::OutsideSource { key, source })),
            }
        }
    }
    refuse_if_any(options, faults)
}

/// Fails where a scene of the recipe has a fault.
fn refuse_if_any(options: &BuildOptions, faults: Vec<(SceneId, RecipeSceneFault)>) -> Result<(), PrepError> {
    if faults.is_empty() {
        return Ok(());
    }
    let faults = faults.into_iter().map(|(scene, fault)| RecipeFault::Scene { scene, fault }).collect();
    Err(PrepError::Recipe { path: options.recipe.clone(), faults })
}

/// Fails before the first scene is made if any scene's sources are missing or differ from those that the recipe pins.
pub(super) fn check_sources(options: &BuildOptions, scenes: &[&RecipeScene], source: &Path) -> Result<(), PrepError> {
    refuse_if_any(options, faults_of_all(scenes, source, missing_sources))?;
    refuse_if_any(options, faults_of_all(scenes, source, changed_inputs))
}

/// The faults that `check` finds in the scenes.
fn faults_of_all(
    scenes: &[&RecipeScene],
    source: &Path,
    check: fn(&RecipeScene, &Path) -> Vec<RecipeSceneFault>,
) -> Vec<(SceneId, RecipeSceneFault)> {
    let mut all = Vec::new();
    for scene in scenes {
        all.extend(check(scene, source).into_iter().map(|fault| (scene.id.clone(), fault)));
    }
    all
}

fn missing_sources(scene: &RecipeScene, source: &Path) -> Vec<RecipeSceneFault> {
    let root = scene.root(source);
    let labels = scene.part_labels.values().map(|path| ("part_labels", root.join(path), true));
    let photo = scene.photo.iter().map(|path| ("photo", root.join(path), false));
    let paths =
        scene.source_paths().into_iter().map(|SourcePath { key, path, is_folder }| (key, source.join(path), is_folder));
    let fault = |(key, path, is_folder): (&'static str, PathBuf, bool)| {
        let exists = if is_folder { path.is_dir() } else { path.is_file() };
        let kind = if is_folder { "folder" } else { "file" };
        (!exists).then_some(RecipeSceneFault::MissingSource { key, kind, path })
    };
    paths.chain(labels).chain(photo).filter_map(fault).collect()
}

/// The pinned inputs that do not exist or have other bytes.
fn changed_inputs(scene: &RecipeScene, source: &Path) -> Vec<RecipeSceneFault> {
    let root = scene.root(source);
    let fault = |(file, pinned): (&String, &String)| {
        let (path, file) = (root.join(file), file.clone());
        if !path.is_file() {
            return Some(RecipeSceneFault::MissingInput { file });
        }
        match manifest::sha256_of_file(&path) {
            Ok(found) if found == *pinned => None,
            Ok(found) => Some(RecipeSceneFault::ChangedInput { file, found, pinned: pinned.clone() }),
            Err(source) => Some(RecipeSceneFault::UnreadableInput { file, source }),
        }
    };
    scene.inputs.iter().filter_map(fault).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_without_a_folder_lies_in_the_current_one() {
        let source = |recipe: &str| {
            source_folder(&BuildOptions {
                recipe: recipe.into(),
                source: None,
                out: "out".into(),
                scenes: Vec::new(),
                force: false,
                blender: None,
                atlas_cache: None,
            })
        };
        for (recipe, folder) in [("mini.toml", "."), ("recipes/mini.toml", "recipes"), ("/mini.toml", "/")] {
            assert_eq!(source(recipe), Path::new(folder));
            assert!(std::path::absolute(source(recipe)).is_ok());
        }
    }
}
