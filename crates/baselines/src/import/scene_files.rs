//! The files that describe a scene: a mesh of the whole scene, meshes of single instances, or one material per part;
//! and an instance's atlas from the first of them that describes it.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use mateval_dataset::PartSetId;
use mateval_dataset::material::MaterialParameter;

use super::donor::Donor;
use super::files::{ImportFolder, read_flat_materials};
use super::frame::{Frame, Located, preferred_order};
use super::rebake::{Correspondence, Distances, Rebaked, rebake};
use crate::error::BaselineError;
use crate::estimate::GivenMaps;
use crate::geometry::{SceneGeometry, parts_of};
use crate::maps::PartColors;

#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// Largest distance, in metres, between a place of an instance and the place of the donor whose material it takes.
    pub max_distance_m: f64,
    /// The part set that `<scene>.json` names parts of; `None` stands for the parts of the source.
    pub part_set: Option<PartSetId>,
}

/// The files that describe a scene.
pub(super) struct SceneFiles<'a> {
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
pub(super) struct ImportedAtlas {
    pub(super) file: String,
    /// Whether the file describes this instance alone.
    pub(super) own_file: bool,
    /// None without a donor.
    pub(super) frame: Option<Frame>,
    pub(super) rebaked: Rebaked,
    pub(super) given: GivenMaps,
    /// What the file's materials do not state.
    pub(super) unstated: Vec<MaterialParameter>,
    pub(super) faces_without_uv: usize,
}

impl<'a> SceneFiles<'a> {
    pub(super) fn read(
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
    pub(super) fn instance(
        &self,
        geometry: &SceneGeometry<'_>,
        at: usize,
    ) -> Result<Option<ImportedAtlas>, BaselineError> {
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
            if rebaked.rebaked.distances.count > 0 {
                return Ok(Some(rebaked));
            }
            if self.parts.is_none() {
                return Ok(rebaked.rebaked.nearest_m.is_some().then_some(rebaked));
            }
        }
        Ok(self.parts.as_ref().and_then(|(file, colors, given)| {
            let atlas = colors.paint(geometry, at, size);
            let is_described = atlas.texels.pixels().iter().any(|texel| texel.seen().is_some());
            is_described.then(|| ImportedAtlas {
                file: file.clone(),
                own_file: false,
                frame: None,
                rebaked: Rebaked { atlas, distances: Distances::default(), nearest_m: None },
                given: *given,
                unstated: Vec::new(),
                faces_without_uv: 0,
            })
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
        ImportedAtlas {
            file,
            own_file: false,
            frame: Some(frame),
            rebaked: rebake(geometry, at, size, donor, correspondence, self.options.max_distance_m),
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
        let targets = geometry.with_atlas().into_iter().filter(belongs).map(|at| geometry.mesh(at));
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
    for at in geometry.with_atlas() {
        let Some(file) = files.mesh_of_instance(&geometry.scene.id, &geometry.scene.instances[at].id) else { continue };
        let donor = files.read_mesh(&file, DVec3::from(geometry.scene.source.shift_m))?;
        let triangles = (0..donor.triangles.len()).map(|triangle| donor.corners(triangle));
        let found = Located::new([geometry.mesh(at)].into_iter(), triangles, max_distance_m);
        located.insert(at, (file, found));
    }
    let preferred = preferred_order(located.values().map(|(_, located)| located));
    Ok(located.into_iter().map(|(at, (file, located))| (at, (file, located.frame(preferred)))).collect())
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
