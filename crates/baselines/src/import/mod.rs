//! Imports the output of methods that do not write the dataset's atlases: textured glTF or OBJ meshes with their own
//! texture coordinates, or one material per part. Each place of an instance takes the material of the nearest place of
//! such a mesh, the donor.
//!
//! `files` finds the files, and reads one material per part; `gltf_donor` and `obj_donor` read meshes as a `donor`;
//! `frame` moves it to the dataset's world space, by a similarity; `rebake` finds the nearest place and fills the
//! atlases. The report states how much of each surface was found.

mod donor;
pub mod error;
mod files;
mod frame;
mod gltf_donor;
mod obj_donor;
mod rebake;
mod report;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::DVec3;
use mateval_dataset::dataset::SceneFile;
use mateval_dataset::material::MaterialParameter;
use mateval_dataset::open::Dataset;
use mateval_dataset::{InstanceId, PartSetId, Progress, Report};

use crate::error::BaselineError;
use crate::estimate::GivenMaps;
use crate::geometry::{SceneGeometry, parts_of};
use crate::lift::{PartialAtlas, Texel};
use crate::maps::{Maps, PartColors};
use crate::submission::{self, Method};
use donor::Donor;
pub use files::{FlatMaterial, FlatMaterials};
use files::{ImportFolder, read_flat_materials};
use frame::{Frame, Located, preferred_order};
use rebake::{Correspondence, Distances, rebake};
pub use report::{IMPORT_FORMAT, ImportReport, ImportTotals, ImportedFrame, ImportedInstance, ImportedScene};

#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// Largest distance, in metres, between a place of an instance and the place of the donor whose material it takes.
    pub max_distance_m: f64,
    /// The part set that `<scene>.json` names parts of; `None` stands for the parts of the source.
    pub part_set: Option<PartSetId>,
}

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
        return Err(BaselineError::NothingToImport(folder.to_owned()));
    }
    let scenes = RefCell::new(Vec::new());
    submission::write_scenes(dataset, out, force, method, progress, |scene, out| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let sources = Sources::read(&files, &geometry, options)?;
        let with_atlas = with_atlas(scene);
        let mut instances = Vec::new();
        for (done, &at) in with_atlas.iter().enumerate() {
            progress(Report::step(&format!("{} import", scene.id), done, with_atlas.len()));
            let id = &scene.instances[at].id;
            let imported = sources.instance(&geometry, at)?;
            instances.push(match imported {
                Some(imported) => imported.write(id, &out.join(id.as_str()))?,
                None => undescribed(id),
            });
        }
        progress(Report::step(&format!("{} import", scene.id), with_atlas.len(), with_atlas.len()));
        let written = instances.iter().filter(|instance| instance.has_maps()).count();
        if has_files(&files, scene) && written == 0 {
            return Err(nothing_found(folder, scene, &instances, options.max_distance_m));
        }
        scenes.borrow_mut().push(ImportedScene { scene: scene.id.clone(), instances });
        Ok(written)
    })?;
    let scenes = scenes.into_inner();
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
    let (folder, scene) = (folder.to_owned(), scene.id.to_string());
    let nearest_m = instances.iter().filter_map(|instance| instance.nearest_m).reduce(f64::min);
    let Some(nearest_m) = nearest_m else { return BaselineError::NothingNamed { folder, scene } };
    let best_residual_m = instances.iter().filter_map(|instance| match instance.frame {
        Some(ImportedFrame::Unexplained { best_residual_m, .. }) => best_residual_m,
        _ => None,
    });
    let best_residual_m = best_residual_m.reduce(f64::min);
    BaselineError::NothingNear { folder, scene, nearest_m, max_distance_m, best_residual_m }
}

fn has_files(files: &ImportFolder, scene: &SceneFile) -> bool {
    let of_instance = || scene.instances.iter().any(|i| files.mesh_of_instance(&scene.id, &i.id).is_some());
    files.mesh_of_scene(&scene.id).is_some() || files.materials_of_scene(&scene.id).is_some() || of_instance()
}

/// The files that describe a scene.
struct Sources<'a> {
    files: &'a ImportFolder,
    options: &'a ImportOptions,
    mesh: Option<SceneMesh>,
    /// The file of each instance that has its own, and the frame of that file's mesh, by the instance's index.
    frames: BTreeMap<usize, (String, Frame)>,
    /// The file of one material per part, its colours and the maps that it gives.
    parts: Option<(String, PartColors<'a>, GivenMaps)>,
}

/// A mesh of a whole scene.
struct SceneMesh {
    file: String,
    /// In the dataset's world space.
    donor: Donor,
    frame: Frame,
    /// For each instance that groups are named after, the triangles of those groups.
    named: BTreeMap<usize, Correspondence>,
    /// The triangles of groups that are named after no instance.
    others: Correspondence,
}

/// An instance's atlas as the files describe it.
struct ImportedAtlas {
    file: String,
    /// Whether the file describes this instance alone.
    own_file: bool,
    /// None without a donor.
    frame: Option<Frame>,
    atlas: PartialAtlas,
    distances: Distances,
    /// Distance of the donor from the nearest texel, in metres; none without a donor.
    nearest_m: Option<f64>,
    given: GivenMaps,
    /// What the file's materials do not state.
    unstated: Vec<MaterialParameter>,
    faces_without_uv: usize,
}

impl ImportedAtlas {
    /// Writes the maps, unless no texel found a place of the donor.
    fn write(self, instance: &InstanceId, folder: &Path) -> Result<ImportedInstance, BaselineError> {
        let texels = self.atlas.texels.pixels();
        let mean_m = self.distances.sum / self.distances.count.max(1) as f64;
        let found = self.distances.count > 0;
        let report = ImportedInstance {
            file: Some(self.file),
            own_file: self.own_file,
            frame: self.frame.map(|frame| frame.report),
            texels: texels.iter().filter(|texel| **texel != Texel::Unused).count(),
            texels_without: texels.iter().filter(|texel| **texel == Texel::Unseen).count(),
            nearest_m: self.nearest_m,
            mean_distance_m: found.then_some(mean_m),
            max_distance_m: found.then_some(self.distances.max),
            mean: mean_of(texels),
            unstated: self.unstated,
            faces_without_uv: self.faces_without_uv,
            ..undescribed(instance)
        };
        if report.has_maps() {
            Maps::of_atlas(&self.atlas, self.given).write(folder)?;
        }
        Ok(report)
    }
}

/// The mean of the texels that found a place; none without any.
fn mean_of(texels: &[Texel]) -> Option<FlatMaterial> {
    let seen = || texels.iter().filter_map(|texel| if let Texel::Seen(values) = texel { Some(values) } else { None });
    let count = seen().count();
    let mean = |at: usize| (seen().map(|values| f64::from(values[at])).sum::<f64>() / count as f64) as f32;
    (count > 0).then(|| FlatMaterial {
        base_color: [mean(0), mean(1), mean(2)],
        roughness: Some(mean(3)),
        metallic: Some(mean(4)),
    })
}

impl<'a> Sources<'a> {
    fn read(
        files: &'a ImportFolder,
        geometry: &SceneGeometry<'a>,
        options: &'a ImportOptions,
    ) -> Result<Self, BaselineError> {
        let scene = &geometry.scene.id;
        let max_distance_m = options.max_distance_m;
        let mesh = files.mesh_of_scene(scene);
        let mesh = mesh.map(|file| SceneMesh::read(files, file, geometry, max_distance_m)).transpose()?;
        let frames = frames(files, geometry, max_distance_m)?;
        let parts = match files.materials_of_scene(scene) {
            Some(file) => {
                let (colors, given) =
                    read_flat_materials(&files.checked_path(&file)?, geometry, options.part_set.as_ref())?;
                Some((file, colors, given))
            }
            None => None,
        };
        Ok(Self { files, options, mesh, frames, parts })
    }

    /// The instance's atlas from the first file that describes it.
    fn instance(&self, geometry: &SceneGeometry<'_>, at: usize) -> Result<Option<ImportedAtlas>, BaselineError> {
        let instance = &geometry.scene.instances[at];
        let Some(atlas) = &instance.atlas else { return Ok(None) };
        let size = atlas.size as usize;
        if let Some((file, frame)) = self.frames.get(&at) {
            let mut donor = self.files.read_mesh(file, DVec3::from(geometry.scene.source.shift_m))?;
            frame.apply(&mut donor);
            let all = Correspondence::new(&donor, |_| true);
            let place = (file.clone(), frame.clone());
            let rebaked = self.rebaked(geometry, at, size, place, &donor, &all);
            return Ok(Some(ImportedAtlas { own_file: true, ..rebaked }));
        }
        if let Some(mesh) = &self.mesh {
            let own = mesh.named.get(&at).unwrap_or(&mesh.others);
            let place = (mesh.file.clone(), mesh.frame.clone());
            let rebaked = self.rebaked(geometry, at, size, place, &mesh.donor, own);
            // A mesh of the scene may leave instances out.
            if rebaked.distances.count > 0 {
                return Ok(Some(rebaked));
            }
            if self.parts.is_none() {
                return Ok(rebaked.nearest_m.is_some().then_some(rebaked));
            }
        }
        Ok(self.parts.as_ref().and_then(|(file, colors, given)| {
            let atlas = colors.paint(geometry, at, size);
            let is_described = atlas.texels.pixels().iter().any(|texel| matches!(texel, Texel::Seen(_)));
            let (file, distances) = (file.clone(), Distances::default());
            let atlas = ImportedAtlas {
                file,
                own_file: false,
                frame: None,
                atlas,
                distances,
                nearest_m: None,
                given: *given,
                unstated: Vec::new(),
                faces_without_uv: 0,
            };
            is_described.then_some(atlas)
        }))
    }

    /// The instance's atlas from the donor's triangles that belong to it. The donor counts as a mesh of the whole
    /// scene.
    fn rebaked(
        &self,
        geometry: &SceneGeometry<'_>,
        at: usize,
        size: usize,
        (file, frame): (String, Frame),
        donor: &Donor,
        correspondence: &Correspondence,
    ) -> ImportedAtlas {
        let rebaked = rebake(geometry, at, size, donor, correspondence, self.options.max_distance_m);
        let (atlas, distances, nearest_m) = (rebaked.atlas, rebaked.distances, rebaked.nearest_m);
        ImportedAtlas {
            file,
            own_file: false,
            frame: Some(frame),
            atlas,
            distances,
            nearest_m,
            given: donor.given_maps(),
            unstated: donor.unstated(),
            faces_without_uv: donor.without_uv,
        }
    }
}

impl SceneMesh {
    fn read(
        files: &ImportFolder,
        file: String,
        geometry: &SceneGeometry<'_>,
        max_distance_m: f64,
    ) -> Result<Self, BaselineError> {
        let mut donor = files.read_mesh(&file, DVec3::from(geometry.scene.source.shift_m))?;
        let owner_of_name = owners(geometry)?;
        let mut owner_of_triangle = vec![None; donor.triangles.len()];
        for group in &donor.groups {
            let owner = group.names.iter().find_map(|name| owner_of_name.get(name.as_str()));
            owner_of_triangle[group.triangles.clone()].fill(owner.copied());
        }
        let owners: BTreeSet<usize> = owner_of_triangle.iter().flatten().copied().collect();
        // Groups that are named after instances are compared with these, a mesh without such names with all instances.
        let belongs = |at: &usize| owners.is_empty() || owners.contains(at);
        let targets = with_atlas(geometry.scene).into_iter().filter(belongs).map(|at| geometry.mesh(at));
        let is_compared = |triangle: &usize| owners.is_empty() || owner_of_triangle[*triangle].is_some();
        let compared = (0..donor.triangles.len()).filter(is_compared).map(|triangle| donor.corners(triangle));
        let frame = Located::new(targets, compared, max_distance_m).frame(None);
        frame.apply(&mut donor);
        let correspondence =
            |owner: Option<usize>| Correspondence::new(&donor, |triangle| owner_of_triangle[triangle] == owner);
        let named = owners.into_iter().map(|owner| (owner, correspondence(Some(owner)))).collect();
        let others = correspondence(None);
        Ok(Self { file, donor, frame, named, others })
    }
}

/// The file of each instance that has its own, and the frame of that file's mesh, by the instance's index. The meshes
/// are read again when they are used, so that only one of them is in memory.
fn frames(
    files: &ImportFolder,
    geometry: &SceneGeometry<'_>,
    max_distance_m: f64,
) -> Result<BTreeMap<usize, (String, Frame)>, BaselineError> {
    let mut located = BTreeMap::new();
    for at in with_atlas(geometry.scene) {
        let Some(file) = files.mesh_of_instance(&geometry.scene.id, &geometry.scene.instances[at].id) else { continue };
        let donor = files.read_mesh(&file, DVec3::from(geometry.scene.source.shift_m))?;
        let triangles = (0..donor.triangles.len()).map(|triangle| donor.corners(triangle));
        let found = Located::new([geometry.mesh(at)].into_iter(), triangles, max_distance_m);
        located.insert(at, (file, found));
    }
    let preferred = preferred_order(located.values().map(|(_, located)| located));
    Ok(located.into_iter().map(|(at, (file, located))| (at, (file, located.frame(preferred)))).collect())
}

/// Indices of the instances that have an atlas.
fn with_atlas(scene: &SceneFile) -> Vec<usize> {
    (0..scene.instances.len()).filter(|at| scene.instances[*at].atlas.is_some()).collect()
}

/// Indices of instances by their own ids and by the ids of their parts in every part set.
fn owners<'a>(geometry: &SceneGeometry<'a>) -> Result<BTreeMap<&'a str, usize>, BaselineError> {
    let instances = geometry.scene.instances.iter().enumerate();
    let by_id: BTreeMap<&str, usize> = instances.map(|(at, instance)| (instance.id.as_str(), at)).collect();
    let mut all = by_id.clone();
    for (set, _) in geometry.scene.all_part_sets() {
        let parts = parts_of(geometry, set)?;
        let owned = parts.iter().filter_map(|part| Some((part.id.as_str(), *by_id.get(part.instance.as_str())?)));
        for (id, owner) in owned {
            all.entry(id).or_insert(owner);
        }
    }
    Ok(all)
}
