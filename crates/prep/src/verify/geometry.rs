//! Meshes against `scene.json`, parts against instances, both against the reference; baked materials against atlases.

use mateval_image::Wrap;
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_scene::dataset::SceneFile;
use mateval_scene::glb::{self, GlbNode};
use mateval_scene::layout::{SceneFolder, parts_file};
use mateval_scene::material::{ColorInput, Material, MaterialModel};
use mateval_scene::reference::{MaterialIndex, ReferenceScene, Surface};
use mateval_scene::submission::Map;

use super::Faults;

const INSTANCES: &str = "geometry/instances.glb";

/// The meshes of a scene: one an instance, one a part.
pub(super) struct Meshes {
    pub(super) instances: Vec<GlbNode>,
    /// For every set of parts and every instance the place in the set of each of its triangles.
    pub(super) part_sets: Vec<Vec<Vec<usize>>>,
}

/// None where the meshes do not fit `scene.json`, so that nothing can be held against them.
pub(super) fn check(folder: &SceneFolder, scene: &SceneFile, faults: &mut Faults) -> Option<Meshes> {
    let instances = faults.read(INSTANCES, glb::read(&folder.instances()))?;
    let known = scene.instances.iter().map(|instance| (instance.id.as_str(), instance.triangles));
    let mut fits = same_nodes(INSTANCES, &instances, known, faults);
    let mut nodes_of_sets = Vec::new();
    for (set, parts) in scene.all_part_sets() {
        let file = parts_file(set);
        let nodes = faults.read(&file, glb::read(&folder.parts(set)))?;
        let known = parts.iter().map(|part| (part.id.as_str(), part.triangles));
        fits &= same_nodes(&file, &nodes, known, faults);
        nodes_of_sets.push(nodes);
    }
    if !fits {
        return None;
    }
    for (instance, node) in scene.instances.iter().zip(&instances) {
        check_uv(instance.atlas.is_some(), node, faults);
    }
    let mut part_sets = Vec::new();
    for ((set, parts), nodes) in scene.all_part_sets().zip(&nodes_of_sets) {
        let owned = scene.instances.iter().map(|instance| {
            let is_own = |part: &usize| parts[*part].instance == instance.id;
            (0..parts.len()).filter(is_own).collect::<Vec<_>>()
        });
        part_sets.push(parts_of_triangles(&instances, owned, nodes, &parts_file(set), faults)?);
    }
    Some(Meshes { instances, part_sets })
}

/// The nodes have the ids and numbers of triangles that `scene.json` tells, in its order.
fn same_nodes<'a>(
    file: &str,
    nodes: &[GlbNode],
    known: impl ExactSizeIterator<Item = (&'a str, usize)>,
    faults: &mut Faults,
) -> bool {
    let before = faults.all.len();
    if nodes.len() != known.len() {
        faults.add("wrong_nodes", file, "", format!("{} nodes, scene.json tells of {}", nodes.len(), known.len()));
    }
    for (node, (id, triangles)) in nodes.iter().zip(known) {
        if node.name != id || node.mesh.triangles.len() != triangles {
            let found = format!("'{}' of {} triangles", node.name, node.mesh.triangles.len());
            faults.add("wrong_nodes", file, format!("node '{id}'"), format!("found {found}, expected {triangles}"));
        }
    }
    faults.all.len() == before
}

fn check_uv(has_atlas: bool, node: &GlbNode, faults: &mut Faults) {
    let place = format!("node '{}'", node.name);
    match (&node.mesh.uvs, has_atlas) {
        (None, false) => {}
        (None, true) => faults.add("bad_uv", INSTANCES, place, "it has an atlas but no TEXCOORD_0"),
        (Some(_), false) => faults.add("bad_uv", INSTANCES, place, "it has TEXCOORD_0 but no atlas"),
        (Some(uvs), true) => {
            if let Some(at) = uvs.iter().position(|uv| uv.min_element() < 0.0 || uv.max_element() > 1.0) {
                faults.add("bad_uv", INSTANCES, place, format!("vertex {at} has uv {}, expected 0 to 1", uvs[at]));
            }
        }
    }
}

/// The parts of an instance hold its triangles in their order: each triangle is the next one of exactly one part. `owned`
/// tells each instance's places in `parts`.
fn parts_of_triangles(
    instances: &[GlbNode],
    owned: impl Iterator<Item = Vec<usize>>,
    parts: &[GlbNode],
    file: &str,
    faults: &mut Faults,
) -> Option<Vec<Vec<usize>>> {
    let mut used = vec![0_usize; parts.len()];
    let mut all = Vec::new();
    for (node, own) in instances.iter().zip(owned) {
        let mut of_triangles = Vec::with_capacity(node.mesh.triangles.len());
        for triangle in 0..node.mesh.triangles.len() {
            let corners = node.mesh.corners(triangle);
            let found = own.iter().copied().find(|part| {
                used[*part] < parts[*part].mesh.triangles.len() && parts[*part].mesh.corners(used[*part]) == corners
            });
            let Some(part) = found else {
                let message = format!("triangle {triangle} of '{}' is in none of its parts", node.name);
                faults.add("bad_parts", file, format!("node '{}'", node.name), message);
                return None;
            };
            used[part] += 1;
            of_triangles.push(part);
        }
        all.push(of_triangles);
    }
    Some(all)
}

/// Whether the reference has the same triangles, to the last bit; if not, that is a fault.
pub(super) fn is_reference(reference: &ReferenceScene, meshes: &Meshes, faults: &mut Faults) -> bool {
    let before = faults.all.len();
    const FILE: &str = "ground_truth/reference/geometry.glb";
    if reference.surfaces.len() != meshes.instances.len() {
        let message = format!("{} surfaces, {} instances", reference.surfaces.len(), meshes.instances.len());
        faults.add("wrong_nodes", FILE, "", message);
        return false;
    }
    for (surface, node) in reference.surfaces.iter().zip(&meshes.instances) {
        let (a, b) = (&surface.mesh, &node.mesh);
        let same = a.triangles.len() == b.triangles.len()
            && (0..a.triangles.len()).all(|triangle| a.corners(triangle) == b.corners(triangle));
        if !same {
            let message = "its triangles are not those of instances.glb";
            faults.add("wrong_geometry", FILE, format!("node '{}'", node.name), message);
        }
    }
    faults.all.len() == before
}

/// Every atlas has its three baked maps, of its size.
pub(super) fn check_materials(folder: &SceneFolder, scene: &SceneFile, faults: &mut Faults) {
    for instance in &scene.instances {
        let Some(atlas) = &instance.atlas else { continue };
        for map in Map::ALL {
            let file = format!("ground_truth/materials/{}/{}.png", instance.id, map.stem());
            let path = folder.truth_material(&instance.id).join(map.stem()).with_extension("png");
            let read = read_texture(&path, Encoding::Linear, Wrap::Clamp);
            let Some(picture) = faults.read(&file, read) else { continue };
            let size = atlas.size as usize;
            if (picture.width(), picture.height()) != (size, size) {
                let message = format!("{}x{} texels, expected {size}", picture.width(), picture.height());
                faults.add("wrong_size", &file, "", message);
            }
        }
    }
}

/// The instances as opaque surfaces: what can be held against pictures where the ground truth is withheld.
pub(super) fn opaque(meshes: &Meshes) -> ReferenceScene {
    let material = Material {
        name: String::new(),
        model: MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None },
        two_sided: true,
        opacity: None,
        bump: None,
    };
    let surface =
        |node: &GlbNode| Surface { name: node.name.clone(), mesh: node.mesh.clone(), material: MaterialIndex(0) };
    ReferenceScene {
        surfaces: meshes.instances.iter().map(surface).collect(),
        materials: vec![material],
        ..ReferenceScene::default()
    }
}
