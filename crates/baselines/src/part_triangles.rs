//! The part that each triangle of an instance belongs to.

use std::collections::HashMap;

use mateval_scene::dataset::Part;
use mateval_scene::{PartSetId, SceneError, TriangleMesh, glb};

use crate::error::BaselineError;
use crate::geometry::SceneGeometry;

/// The parts of a set, triangle by triangle.
pub struct PartTriangles<'a> {
    /// The parts, in the order of `scene.json`.
    pub parts: &'a [Part],
    /// For each part the index of its instance.
    pub owners: Vec<Option<usize>>,
    of_instance: Vec<Vec<Option<usize>>>,
}

/// The bits of a triangle's corners, which are the same in `instances.glb` and in the file of a part set.
type Corners = [[u32; 3]; 3];

impl<'a> PartTriangles<'a> {
    /// Reads the meshes of a part set; `None` stands for the parts of the source.
    pub fn read(geometry: &SceneGeometry<'a>, set: Option<&PartSetId>) -> Result<Self, BaselineError> {
        let parts = parts_of(geometry, set)?;
        let instances = &geometry.scene.instances;
        let place_of: HashMap<&str, usize> =
            instances.iter().enumerate().map(|(at, instance)| (instance.id.as_str(), at)).collect();
        let owners: Vec<Option<usize>> =
            parts.iter().map(|part| place_of.get(part.instance.as_str()).copied()).collect();
        let mut known: Vec<HashMap<Corners, usize>> = vec![HashMap::new(); instances.len()];
        for (part, node) in glb::read(&geometry.folder.parts(set))?.iter().enumerate().take(parts.len()) {
            let Some(owner) = owners[part] else { continue };
            let triangles = 0..node.mesh.triangles.len();
            known[owner].extend(triangles.map(|triangle| (corners(&node.mesh, triangle), part)));
        }
        let of_instance = known.iter().enumerate().map(|(at, known)| {
            let mesh = geometry.mesh(at);
            (0..mesh.triangles.len()).map(|triangle| known.get(&corners(mesh, triangle)).copied()).collect()
        });
        Ok(Self { parts, of_instance: of_instance.collect(), owners })
    }

    /// The index of the part of each triangle of an instance.
    pub fn of(&self, instance: usize) -> &[Option<usize>] {
        &self.of_instance[instance]
    }
}

fn corners(mesh: &TriangleMesh, triangle: usize) -> Corners {
    mesh.corners(triangle).map(|corner| corner.to_array().map(f32::to_bits))
}

/// The parts of a set; `None` stands for the parts of the source.
pub fn parts_of<'a>(geometry: &SceneGeometry<'a>, set: Option<&PartSetId>) -> Result<&'a [Part], BaselineError> {
    let found = geometry.scene.all_part_sets().find(|(id, _)| *id == set).map(|(_, parts)| parts);
    found.ok_or_else(|| {
        let what = format!("no part set '{}'; `part_labels` in a recipe makes one", set.map_or("", PartSetId::as_str));
        SceneError::Unsupported { path: geometry.folder.scene_file(), what }.into()
    })
}
