//! Makes one scene of a recipe, from its source to its folder.

pub mod fault;
mod geometry;
mod materials;
mod photo;
mod plan;
mod plausible;
mod scene_file;
mod source;
mod turned_views;
pub(crate) mod view_pictures;
mod wide_views;

use std::path::Path;

use mateval_scene::dataset::FORMAT;
use mateval_scene::layout::SceneFolder;
use mateval_scene::material_class::MaterialClassesFile;
use mateval_scene::reference::Surface;
use mateval_scene::{Progress, Report, json, reference_io};
use mateval_sources::source_scene::LicenceText;

use crate::atlas::cache::AtlasCache;
use crate::error::PrepError;
use crate::recipe::{Recipe, RecipeScene};
use crate::render::BlenderOptions;
use fault::{PinFault, SceneFault, above_notes};
use materials::AtlasSizes;
use plan::Plan;
use source::Baking;

/// The facts about a finished scene that its folder does not hold.
#[derive(Clone, Debug)]
pub struct Built {
    /// The licence that came with it.
    pub licence: Option<LicenceText>,
    /// Files that were looked for but do not exist, with paths as in `scene.json`; sorted.
    pub absent: Vec<String>,
}

/// Makes the scene in `folder` from its source below `source`, which `blender` reads if it is a Blender file. Atlases are taken from the cache where it holds them.
pub fn build(
    recipe: &Recipe,
    entry: &RecipeScene,
    source: &Path,
    blender: Option<&BlenderOptions>,
    folder: &SceneFolder,
    cache: Option<&AtlasCache>,
    progress: Progress<'_>,
) -> Result<Built, PrepError> {
    // The source, with numbered instances and parts.
    progress(Report::step("read the source", 0, 1));
    let read = source::read(recipe, entry, source, &Baking { blender, folder: folder.path(), progress })?;
    let licence = read.licence.clone();
    let missing = plausible::missing(entry, &read.missing, &entry.root(source), &read.file, &read.findings);
    let missing = missing.map_err(PrepError::scene(&entry.id))?;
    let (mut plan, absent) = plan::plan(recipe, entry, source, read)?;
    plan.findings.extend(missing);
    check_inputs(entry, &plan.files)?;
    make_folders(folder, &plan)?;

    // Views and atlases. Only instances with an appearance can have an atlas.
    let has_appearance = |surface: &Surface| plan.scene.materials[surface.material.0].has_appearance();
    let expected: Vec<bool> = plan.scene.surfaces.iter().map(has_appearance).collect();
    let mut seen = view_pictures::write(&plan, folder, &expected, progress)?.or_refuse(&entry.id, &plan)?;
    let unstated = plausible::unstated(entry, &plan, &seen).map_err(PrepError::scene(&entry.id))?;
    plan.findings.extend(unstated);
    if !plausible::is_lit(&plan)? {
        let findings = above_notes(&[plan.findings.as_slice(), &seen.findings].concat());
        return Err(PrepError::scene(&entry.id)(SceneFault::NoLight { lights: plan.scene.lights.len(), findings }));
    }
    let sizes = AtlasSizes { fixed: entry.atlas_size.or(recipe.atlas_size), nearest: &seen.nearest };
    let atlases = materials::write(&mut plan, folder, &sizes, cache, progress)?;
    let scored: Vec<bool> = atlases.iter().map(|atlas| atlas.unwrapped.is_some()).collect();
    if scored != expected {
        // An instance without an atlas cannot be scored, so its pixels must not be valid.
        seen = view_pictures::write(&plan, folder, &scored, progress)?.or_refuse(&entry.id, &plan)?;
    }
    plan.findings.extend(seen.findings);
    if let Some(photo) = &plan.photo {
        photo.write(folder, &plan.views[0], entry.exposure)?;
    }
    for (view, unseen_share) in plan.views.iter_mut().zip(seen.unseen_shares) {
        view.wide.iter_mut().for_each(|wide| wide.unseen_share = unseen_share);
    }
    // The remaining files.
    geometry::write(&plan, folder, &atlases)?;
    reference_io::write(folder, &plan.scene)?;
    if let Some(source) = &plan.source_materials {
        reference_io::write_source_materials(folder, source)?;
    }
    if let Some(parts) = plan.classes.take() {
        let file = MaterialClassesFile { format: FORMAT.to_owned(), parts };
        json::write(&folder.material_classes(), &file)?;
    }
    scene_file::write(plan, recipe, entry, &atlases, folder)?;
    Ok(Built { licence, absent })
}

/// Fails if the recipe pins files and any file that was read or pinned differs.
fn check_inputs(entry: &RecipeScene, files: &[(String, String)]) -> Result<(), PrepError> {
    if entry.inputs.is_empty() {
        return Ok(());
    }
    let differs = |(path, sha256): &(String, String)| match entry.inputs.get(path) {
        Some(pinned) if pinned == sha256 => None,
        Some(pinned) => Some(PinFault::Changed { file: path.clone(), found: sha256.clone(), pinned: pinned.clone() }),
        None => Some(PinFault::Unlisted { file: path.clone() }),
    };
    let mut faults: Vec<PinFault> = files.iter().filter_map(differs).collect();
    let read = |path: &String| files.iter().any(|file| file.0 == *path);
    let unread = entry.inputs.keys().filter(|path| !read(path));
    faults.extend(unread.map(|path| PinFault::Unread { file: path.clone() }));
    if faults.is_empty() {
        return Ok(());
    }
    Err(PrepError::scene(&entry.id)(SceneFault::Pins { faults }))
}

fn make_folders(folder: &SceneFolder, plan: &Plan) -> Result<(), PrepError> {
    let views = plan.views.iter().flat_map(|view| [folder.view(&view.id), folder.truth_view(&view.id)]);
    let geometry = folder.path().join("geometry");
    for path in views.chain([geometry]) {
        std::fs::create_dir_all(&path).map_err(PrepError::io("make", path))?;
    }
    Ok(())
}
