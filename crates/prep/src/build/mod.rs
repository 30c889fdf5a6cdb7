//! Makes the dataset of a recipe scene by scene, each completely or not at all. A run that was killed is resumed.
//!
//! In the order of a build: `start` checks the sources and begins the folder, or resumes it. For each scene, `source`
//! reads the source and chooses the input camera, and `redress` gives it other materials if the recipe says so; `plan`
//! numbers instances and parts ([`parts`], [`labels`]), reads the `photo` if the scene has one and the colours that
//! were `measured` in it, checks the input camera against the photo (`poses`), converts the materials and places the
//! views (`wide_views`), and leaves every mesh as it is; `pictures` writes what each view shows, and `refusals` refuses
//! scenes that would become a wrong truth; [`materials`] unwraps every instance, which splits vertices at the borders
//! of charts and moves none, and bakes its material ([`baking`]); meshes and `scene.json` are written here. [`finish`]
//! makes the `twins` of rendered scenes and writes the files of the whole dataset, [`upgrade`] those of one of the
//! previous format. [`fault`] lists why a scene is refused.

pub mod baking;
pub mod fault;
pub mod finish;
pub mod labels;
pub mod materials;
mod measured;
pub mod parts;
mod photo;
mod pictures;
mod plan;
mod poses;
mod refusals;
mod source;
pub(crate) mod start;
pub(crate) mod twins;
pub mod upgrade;
mod wide_views;

use std::path::{Path, PathBuf};

use mateval_dataset::changes::SceneHashes;
use mateval_dataset::dataset::{Atlas, FORMAT, Instance, Licence, PartSet, SceneFile, SourceFile};
use mateval_dataset::glb::{self, GlbNode};
use mateval_dataset::layout::{BuildFolder, SceneFolder};
use mateval_dataset::material::MaterialClassesFile;
use mateval_dataset::reference::Surface;
use mateval_dataset::scene_cost::{self, Step, TimedStep};
use mateval_dataset::{DatasetError, Finding, InstanceId, Progress, Report, SceneId, TriangleMesh, json, reference};
use mateval_files::source_folder::relative_below;
use mateval_files::work_folder::{WorkFolder, make_folder, remove, remove_beside};
use mateval_sources::source_scene::LicenceText;

use crate::atlas::AtlasCache;
use crate::error::PrepError;
use crate::recipe::fault::RecipeSceneFault;
use crate::recipe::{self, Recipe, RecipeScene};
use crate::redress::{RedressKey, redress};
use crate::render::BlenderOptions;
use fault::{BuildFault, PinFault};
use finish::finish_build;
use materials::{AtlasSizes, InstanceAtlas, unwrap_and_bake};
use pictures::write_pictures;
use plan::{Plan, make_plan};
use refusals::{check_light, check_missing, check_unstated};
use source::{Baking, read_source};
pub use start::BuildOptions;
use start::{SceneMark, begin, check_sources, finished_scene, label_files, refuse_if_any, secret_of, settings_sha256};

#[derive(Clone, Debug, Default)]
pub struct BuildReport {
    pub findings: Vec<(SceneId, Vec<Finding>)>,
    /// Scenes that an earlier run had already made.
    pub resumed: Vec<SceneId>,
}

/// Makes the scenes, and finishes the dataset if they are all. `tool` is the name and version that the dataset records.
/// Several processes may make different scenes of one dataset at once.
pub fn build(options: &BuildOptions, tool: &str, progress: Progress<'_>) -> Result<BuildReport, PrepError> {
    let (written, text) = recipe::read(&options.recipe)?;
    let mut recipe = written.clone();
    let source = source_folder(options);
    make_relative(options, &mut recipe, &source)?;
    let scenes = chosen(options, &recipe)?;
    check_sources(options, &scenes, &source)?;
    begin(options, &written, &text, tool, &source)?;

    let mut report = BuildReport::default();
    for (at, entry) in scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {}", entry.id), at, scenes.len()));
        let _lease = BuildFolder::of(&options.out).lease_of_scene(&entry.id)?;
        let replaced = options.force && !options.scenes.is_empty();
        match finished_scene(&options.out, entry, &source).filter(|_| !replaced) {
            Some(_) => report.resumed.push(entry.id.clone()),
            None => {
                let settings = settings_sha256(&written, &entry.id, tool);
                scene_cost::forget(&options.out, &entry.id)?;
                let step = TimedStep { step: Step::Build, renderer: None, is_alone: true };
                scene_cost::timed(&options.out, &entry.id, &step, || {
                    make_scene(options, &recipe, entry, &source, settings, progress)
                })?;
            }
        }
        let file = SceneFile::read(&SceneFolder::of(&options.out, &entry.id))?;
        report.findings.push((entry.id.clone(), file.findings));
    }
    if options.scenes.is_empty() {
        finish_build(&options.out, tool, progress)?;
    }
    Ok(report)
}

/// The folder that the recipe's paths are relative to.
fn source_folder(options: &BuildOptions) -> PathBuf {
    // The parent of a file name alone is the empty path, which names no folder.
    let parent = options.recipe.parent().filter(|folder| !folder.as_os_str().is_empty());
    options.source.clone().unwrap_or_else(|| parent.unwrap_or(Path::new(".")).to_owned())
}

/// Makes the paths that the dataset records relative to `source`.
fn make_relative(options: &BuildOptions, recipe: &mut Recipe, source: &Path) -> Result<(), PrepError> {
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

/// The recipe's scenes that are to be made.
fn chosen<'a>(options: &BuildOptions, recipe: &'a Recipe) -> Result<Vec<&'a RecipeScene>, PrepError> {
    let known = || recipe.scenes.iter().map(|entry| entry.id.clone());
    let unknown: Vec<SceneId> = options.scenes.iter().filter(|id| known().all(|k| k != **id)).cloned().collect();
    if !unknown.is_empty() {
        let dataset = options.recipe.clone();
        return Err(DatasetError::UnknownScenes { dataset, unknown, known: known().collect() }.into());
    }
    let is_chosen = |entry: &&RecipeScene| options.scenes.is_empty() || options.scenes.contains(&entry.id);
    Ok(recipe.scenes.iter().filter(is_chosen).collect())
}

fn make_scene(
    options: &BuildOptions,
    recipe: &Recipe,
    entry: &RecipeScene,
    source: &Path,
    settings_sha256: String,
    progress: Progress<'_>,
) -> Result<(), PrepError> {
    let build = BuildFolder::of(&options.out);
    let folder = SceneFolder::of(&options.out, &entry.id);
    let mark = build.mark(&entry.id);
    // The mark belongs to the scene that is about to be replaced.
    remove(&mark)?;
    build.note_change(&entry.id)?;
    // What a lost host left: this process holds the scene's lease.
    remove_beside(folder.path())?;
    let work = WorkFolder::start(folder.path())?;
    let labels = label_files(entry, source);
    let cache = options.atlas_cache.as_deref().map(AtlasCache::new);
    let at = SceneFolder::at(work.path().to_owned());
    let secret = secret_of(entry, source, &options.out).map_err(RecipeSceneFault::from);
    let secret = secret.map_err(PrepError::scene(&entry.id))?;
    let making = Making { recipe, entry, source, blender: options.blender.as_ref(), secret: secret.as_ref() };
    let (licence, absent) = build_scene(&making, &at, cache.as_ref(), progress)?;
    let licence = licence.map(|licence| Licence { scene: entry.id.clone(), file: licence.file, text: licence.text });
    let secret = secret.as_ref().map(RedressKey::fingerprint);
    let made = SceneMark { settings_sha256, licence, secret, absent, labels };
    // Its twins show what it was.
    twins::remove_others(&options.out, std::slice::from_ref(&entry.id), &[])?;
    work.finish()?;
    remove(&build.left_out(&entry.id))?;
    SceneHashes::empty(&options.out, &entry.id).update()?;
    // The mark is written last, since a scene without its mark is made again.
    let marks = mark.parent().unwrap_or(&mark);
    make_folder(marks)?;
    Ok(json::write(&mark, &made)?)
}

/// What a scene is made of.
struct Making<'a> {
    recipe: &'a Recipe,
    entry: &'a RecipeScene,
    /// The folder that the recipe's paths are relative to.
    source: &'a Path,
    /// Reads the source if it is a Blender file.
    blender: Option<&'a BlenderOptions>,
    /// Redresses the scene.
    secret: Option<&'a RedressKey>,
}

/// Makes the scene in `folder`. Atlases are taken from the cache where it holds them. Returns what the folder does not
/// hold: the licence that came with the source, and the files that were looked for but do not exist, with paths as in
/// `scene.json`; sorted.
fn build_scene(
    making: &Making<'_>,
    folder: &SceneFolder,
    cache: Option<&AtlasCache>,
    progress: Progress<'_>,
) -> Result<(Option<LicenceText>, Vec<String>), PrepError> {
    let Making { recipe, entry, source, blender, secret } = *making;
    // The source, with numbered instances and parts.
    progress(Report::step("read the source", 0, 1));
    let mut read = read_source(recipe, entry, source, &Baking { blender, folder: folder.path(), progress })?;
    let licence = read.read.licence.clone();
    let missing = check_missing(entry, &read.read.missing, &entry.root(source), &read.file, &read.read.findings);
    let missing = missing.map_err(PrepError::scene(&entry.id))?;
    progress(Report::step("redress", 0, 1));
    let weak = secret.map(|secret| redress(&mut read, &entry.id, secret)).transpose()?;
    let (mut plan, absent) = make_plan(recipe, entry, source, read)?;
    plan.findings.extend(missing);
    if let Some(weak) = weak {
        let ids: Vec<InstanceId> = plan.instances.iter().map(|instance| instance.id.clone()).collect();
        plan.findings.extend(weak.findings(&plan.file, &ids));
        plan.redressed = Some(weak.listed(&ids));
    }
    check_inputs(entry, &plan.source.files)?;
    make_folders(folder, &plan)?;

    // Views and atlases. Only instances with an appearance can have an atlas.
    let has_appearance = |surface: &Surface| plan.scene.materials[surface.material.0].has_appearance();
    let expected: Vec<bool> = plan.scene.surfaces.iter().map(has_appearance).collect();
    let mut seen = write_pictures(&plan, folder, &expected, progress)?.or_refuse(&entry.id, &plan)?;
    let unstated = check_unstated(entry, &plan, &seen).map_err(PrepError::scene(&entry.id))?;
    plan.findings.extend(unstated);
    check_light(entry, &plan, &seen)?;
    let sizes = AtlasSizes { fixed: entry.atlas_size.or(recipe.atlas_size), nearest: &seen.nearest };
    let atlases = unwrap_and_bake(&mut plan, folder, &sizes, cache, progress)?;
    let scored: Vec<bool> = atlases.iter().map(|atlas| atlas.unwrapped.is_some()).collect();
    if scored != expected {
        // An instance without an atlas cannot be scored, so its pixels must not be valid.
        seen = write_pictures(&plan, folder, &scored, progress)?.or_refuse(&entry.id, &plan)?;
    }
    plan.findings.extend(seen.findings);
    if let Some(photo) = &plan.photo {
        photo.write(folder, &plan.views[0], entry.exposure)?;
    }
    plan.novel_photos.iter().try_for_each(|(view, photo)| photo.write_truth(folder, view))?;
    if let Some(measured) = plan.measured.take() {
        plan.findings.extend(measured.write(&entry.id, folder, &plan.views[0])?);
    }
    for (view, unseen_share) in plan.views.iter_mut().zip(seen.unseen_shares) {
        view.wide.iter_mut().for_each(|wide| wide.unseen_share = unseen_share);
    }
    // The remaining files.
    write_meshes(&plan, folder, &atlases)?;
    reference::write(folder, &plan.scene)?;
    if let Some(source) = &plan.source_materials {
        reference::write_source_materials(folder, source)?;
    }
    if let Some(parts) = plan.classes.take() {
        let file = MaterialClassesFile { format: FORMAT.to_owned(), parts };
        json::write(&folder.material_classes(), &file)?;
    }
    write_scene_file(plan, recipe, entry, &atlases, folder)?;
    Ok((licence, absent))
}

/// Fails if the recipe pins files and any file that was read or pinned differs.
fn check_inputs(entry: &RecipeScene, files: &[SourceFile]) -> Result<(), PrepError> {
    if entry.inputs.is_empty() {
        return Ok(());
    }
    let differs = |SourceFile { path, sha256 }: &SourceFile| match entry.inputs.get(path) {
        Some(pinned) if pinned == sha256 => None,
        Some(pinned) => Some(PinFault::Changed { file: path.clone(), found: sha256.clone(), pinned: pinned.clone() }),
        None => Some(PinFault::Unlisted { file: path.clone() }),
    };
    let mut faults: Vec<PinFault> = files.iter().filter_map(differs).collect();
    let read = |path: &String| files.iter().any(|file| file.path == *path);
    let unread = entry.inputs.keys().filter(|path| !read(path));
    faults.extend(unread.map(|path| PinFault::Unread { file: path.clone() }));
    if faults.is_empty() {
        return Ok(());
    }
    Err(PrepError::scene(&entry.id)(BuildFault::Pins { faults }))
}

fn make_folders(folder: &SceneFolder, plan: &Plan) -> Result<(), PrepError> {
    let views = plan.views.iter().flat_map(|view| [folder.view(&view.id), folder.truth_view(&view.id)]);
    let geometry = folder.path().join("geometry");
    for path in views.chain([geometry]) {
        make_folder(&path)?;
    }
    Ok(())
}

/// Writes `instances.glb` and, for each set of parts, its `parts.glb`.
fn write_meshes(plan: &Plan, folder: &SceneFolder, atlases: &[InstanceAtlas]) -> Result<(), DatasetError> {
    let meshes: Vec<TriangleMesh> = plan
        .scene
        .surfaces
        .iter()
        .zip(atlases)
        .map(|(surface, atlas)| match &atlas.unwrapped {
            Some(unwrapped) => unwrapped.mesh.clone(),
            None => TriangleMesh { uvs: None, ..surface.mesh.clone() },
        })
        .collect();
    for split in &plan.part_splits {
        let parts = split.meshes(&meshes).into_iter().map(|(id, mesh)| GlbNode { name: id.to_string(), mesh });
        glb::write(&folder.parts(split.id.as_ref()), &parts.collect::<Vec<_>>())?;
    }
    let instances: Vec<GlbNode> = plan
        .instances
        .iter()
        .zip(meshes)
        .map(|(instance, mesh)| GlbNode { name: instance.id.to_string(), mesh })
        .collect();
    glb::write(&folder.instances(), &instances)
}

fn write_scene_file(
    plan: Plan,
    recipe: &Recipe,
    entry: &RecipeScene,
    atlases: &[InstanceAtlas],
    folder: &SceneFolder,
) -> Result<(), PrepError> {
    let instances = plan.instances.iter().zip(&plan.scene.surfaces).zip(atlases).zip(&plan.origins);
    let instances = instances
        .map(|(((instance, surface), atlas), origin)| Instance {
            id: instance.id.clone(),
            index: instance.index,
            name: surface.name.clone(),
            role: instance.role.clone(),
            category: instance.category.clone(),
            super_category: instance.super_category.clone(),
            triangles: surface.mesh.triangles.len(),
            unstated: origin.stated.unstated(),
            atlas: atlas.unwrapped.as_ref().map(|unwrapped| Atlas {
                size: unwrapped.size,
                charts: unwrapped.charts,
                coverage: unwrapped.coverage,
                texel_m: unwrapped.texel_m,
                half_pixel_m: atlas.half_pixel_m,
            }),
        })
        .collect();
    let mut parts = Vec::new();
    let mut part_sets = Vec::new();
    for split in &plan.part_splits {
        match &split.id {
            None => parts = split.listed(&plan.instances),
            Some(id) => part_sets.push(PartSet { id: id.clone(), parts: split.listed(&plan.instances) }),
        }
    }
    let mut findings = plan.findings;
    findings.sort();
    let flash = entry.capture.as_ref().and_then(|room| room.flash_of(&plan.views));
    let file = SceneFile {
        format: FORMAT.to_owned(),
        id: entry.id.clone(),
        source: plan.source,
        lights: plan.lights,
        materials: recipe.materials,
        exposure: entry.exposure,
        photo: plan.photo.map(|photo| photo.listed),
        novel_photos: plan.novel_photos.into_iter().map(|(view, photo)| (view, photo.listed)).collect(),
        flash,
        redressed: plan.redressed,
        views: plan.views,
        instances,
        parts,
        part_sets,
        findings,
    };
    Ok(json::write(&folder.scene_file(), &file)?)
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
