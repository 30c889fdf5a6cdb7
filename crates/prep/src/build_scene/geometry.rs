//! The meshes of a scene as glTF: instances and, of the same triangles, parts.

use mateval_scene::glb::{self, GlbNode};
use mateval_scene::layout::SceneFolder;
use mateval_scene::{SceneError, TriangleMesh};

use super::Plan;
use super::materials::InstanceAtlas;

/// Writes `instances.glb` and `parts.glb`.
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
    let mut parts = Vec::new();
    for (instance, mesh) in plan.instances.iter().zip(&meshes) {
        for (at, part) in instance.parts.iter().enumerate() {
            let mesh = part_mesh(mesh, |triangle| instance.part_of_triangle[triangle] == at);
            parts.push(GlbNode { name: part.id.to_string(), mesh });
        }
    }
    glb::write(&folder.parts(), &parts)?;
    let instances: Vec<GlbNode> = plan
        .instances
        .iter()
        .zip(meshes)
        .map(|(instance, mesh)| GlbNode { name: instance.id.to_string(), mesh })
        .collect();
    glb::write(&folder.instances(), &instances)
}

/// The triangles that belong, in their order, with the vertices that they use.
fn part_mesh(mesh: &TriangleMesh, belongs: impl Fn(usize) -> bool) -> TriangleMesh {
    let mut new_place = vec![u32::MAX; mesh.positions.len()];
    let mut used = Vec::new();
    let mut triangles = Vec::new();
    for triangle in (0..mesh.triangles.len()).filter(|triangle| belongs(*triangle)) {
        triangles.push(mesh.triangles[triangle].map(|vertex| {
            let place = &mut new_place[vertex as usize];
            if *place == u32::MAX {
                *place = used.len() as u32;
                used.push(vertex as usize);
            }
            *place
        }));
    }
    TriangleMesh {
        positions: used.iter().map(|vertex| mesh.positions[*vertex]).collect(),
        normals: mesh.normals.as_ref().map(|all| used.iter().map(|vertex| all[*vertex]).collect()),
        uvs: mesh.uvs.as_ref().map(|all| used.iter().map(|vertex| all[*vertex]).collect()),
        triangles,
    }
}
