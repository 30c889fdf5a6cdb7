//! Writes the meshes of a scene as glTF: the instances, and the same triangles as parts.

use mateval_scene::glb::{self, GlbNode};
use mateval_scene::layout::SceneFolder;
use mateval_scene::{SceneError, TriangleMesh};

use super::materials::InstanceAtlas;
use super::plan::Plan;

/// Writes `instances.glb` and, for each set of parts, its `parts.glb`.
pub(super) fn write(plan: &Plan, folder: &SceneFolder, atlases: &[InstanceAtlas]) -> Result<(), SceneError> {
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
