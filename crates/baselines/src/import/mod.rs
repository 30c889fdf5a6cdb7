//! Imports the output of methods that do not write the dataset's atlases: textured glTF or OBJ meshes with their own
//! texture coordinates, or one material per part. Each place of an instance takes the material of the nearest place of
//! such a mesh, the donor.
//!
//! `files` finds the files, and reads one material per part; `gltf_donor` and `obj_donor` read meshes as a `donor`;
//! `frame` moves it to the dataset's world space, by a similarity; `rebake` finds the nearest place and fills the
//! atlases; `scene_files` decides which file describes an instance. The report states how much of each surface was found.

mod donor;
mod files;
mod frame;
mod gltf_donor;
mod obj_donor;
mod rebake;
mod report;
mod scene_files;

use std::path::Path;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::{InstanceId, Progress, Report};

use crate::error::BaselineError;
use crate::estimate::Values;
use crate::geometry::SceneGeometry;
use crate::lift::{Texel, mean};
use crate::maps::Maps;
use crate::submission::{self, Method};
use files::ImportFolder;
pub use files::{FlatMaterial, FlatMaterials};
use rebake::Rebaked;
pub use report::{IMPORT_FORMAT, ImportReport, ImportTotals, ImportedFrame, ImportedInstance, ImportedScene};
pub use scene_files::ImportOptions;
use scene_files::{ImportedAtlas, SceneFiles};

/// Writes a submission. An instance takes its material from the first of `<scene>/<instance>.glb|gltf|obj`,
/// `<scene>.glb|gltf|obj` and `<scene>.json` that describes it; without any it has no maps. Fails where the folder has
/// no file for any scene, or where a scene's files are too far from all its instances.
pub fn write(
    dataset: &Dataset,
    folder: &Path,
    out: &Path,
    force: bool,
    method: &Method,
    options: &ImportOptions,
    progress: Progress<'_>,
) -> Result<ImportReport, BaselineError> {
    let files = ImportFolder::new(folder);
    if !dataset.scenes.iter().any(|scene| has_files(&files, scene)) {
        let found = files.unused(&dataset.scenes);
        let found = found.first().map_or(String::new(), |name| format!("; it holds '{name}'"));
        let why = format!(
            "holds no file for any scene of the dataset; expected <scene>/<instance>.glb, <scene>.glb (or .gltf, .obj) or \
             <scene>.json{found}"
        );
        return Err(BaselineError::unusable(folder, why));
    }
    let mut scenes = Vec::new();
    submission::write_scenes(dataset, out, force, method, progress, |scene, out| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let files_of_scene = SceneFiles::read(&files, &geometry, options)?;
        let with_atlas = geometry.with_atlas();
        let mut instances = Vec::new();
        for (done, &at) in with_atlas.iter().enumerate() {
            progress(Report::step(&format!("{} import", scene.id), done, with_atlas.len()));
            let id = &scene.instances[at].id;
            instances.push(match files_of_scene.instance(&geometry, at)? {
                Some(imported) => written(imported, id, &out.join(id.as_str()))?,
                None => undescribed(id),
            });
        }
        progress(Report::step(&format!("{} import", scene.id), with_atlas.len(), with_atlas.len()));
        let written = instances.iter().filter(|instance| instance.has_maps()).count();
        if has_files(&files, scene) && written == 0 {
            return Err(nothing_found(folder, scene, &instances, options.max_distance_m));
        }
        scenes.push(ImportedScene { scene: scene.id.clone(), instances });
        Ok(written)
    })?;
    let (format, max_distance_m) = (IMPORT_FORMAT.to_owned(), options.max_distance_m);
    Ok(ImportReport { format, max_distance_m, unused: files.unused(&dataset.scenes), scenes })
}

fn undescribed(instance: &InstanceId) -> ImportedInstance {
    ImportedInstance {
        instance: instance.clone(),
        file: None,
        own_file: false,
        frame: None,
        texels: 0,
        texels_without: 0,
        nearest_m: None,
        mean_distance_m: None,
        max_distance_m: None,
        mean: None,
        unstated: Vec::new(),
        faces_without_uv: 0,
    }
}

fn nothing_found(
    folder: &Path,
    scene: &SceneFile,
    instances: &[ImportedInstance],
    max_distance_m: f64,
) -> BaselineError {
    let (folder, scene) = (folder.display(), &scene.id);
    let nearest_m = instances.iter().filter_map(|instance| instance.nearest_m).reduce(f64::min);
    let Some(nearest_m) = nearest_m else {
        return BaselineError::Unusable(format!(
            "'{folder}': the files for scene '{scene}' hold no triangles and name no part or instance; expected meshes, \
             or the ids of scene.json"
        ));
    };
    let best_residual_m = instances.iter().filter_map(|instance| match instance.frame {
        Some(ImportedFrame::Unexplained { best_residual_m, .. }) => best_residual_m,
        _ => None,
    });
    let best = match best_residual_m.reduce(f64::min) {
        Some(residual_m) => format!("the best leaves {residual_m:.4} m (root mean square)"),
        None => "no box has the right proportions".to_owned(),
    };
    BaselineError::Unusable(format!(
        "'{folder}': no mesh for scene '{scene}' lies within {max_distance_m} m of any instance, the nearest \
         {nearest_m:.3} m away; expected meshes in the dataset's world space (metres, +Y up), as in \
         geometry/instances.glb, or moved from it by a scale, a turn and a shift; tried equal triangles, and the boxes of \
         both meshes in 48 orders of axes: {best}"
    ))
}

fn has_files(files: &ImportFolder, scene: &SceneFile) -> bool {
    let of_instance = || scene.instances.iter().any(|i| files.mesh_of_instance(&scene.id, &i.id).is_some());
    files.mesh_of_scene(&scene.id).is_some() || files.materials_of_scene(&scene.id).is_some() || of_instance()
}

/// Writes the maps of an instance, unless no texel found a place of the donor.
fn written(imported: ImportedAtlas, instance: &InstanceId, folder: &Path) -> Result<ImportedInstance, BaselineError> {
    let Rebaked { atlas, distances, nearest_m } = imported.rebaked;
    let texels = atlas.texels.pixels();
    let found = distances.count > 0;
    let report = ImportedInstance {
        file: Some(imported.file),
        own_file: imported.own_file,
        frame: imported.frame.map(|frame| frame.report),
        texels: texels.iter().filter(|texel| **texel != Texel::Unused).count(),
        texels_without: texels.iter().filter(|texel| **texel == Texel::Unseen).count(),
        nearest_m,
        mean_distance_m: found.then(|| distances.sum / distances.count as f64),
        max_distance_m: found.then_some(distances.max),
        mean: mean_of(texels),
        unstated: imported.unstated,
        faces_without_uv: imported.faces_without_uv,
        ..undescribed(instance)
    };
    if report.has_maps() {
        Maps::of_atlas(&atlas, imported.given).write(folder)?;
    }
    Ok(report)
}

/// The mean of the texels that found a place; none without any.
fn mean_of(texels: &[Texel]) -> Option<FlatMaterial> {
    let seen: Vec<Values> = texels.iter().filter_map(|texel| texel.seen()).collect();
    let [r, g, b, roughness, metallic] = mean(&seen)?;
    Some(FlatMaterial { base_color: [r, g, b], roughness: Some(roughness), metallic: Some(metallic) })
}
