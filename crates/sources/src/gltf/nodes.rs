//! The nodes of a scene: each mesh of a node becomes an instance for each of its materials, with its primitives as
//! parts.

use std::collections::BTreeSet;

use glam::{DMat4, DQuat, DVec3};
use gltf::scene::Transform;
use mateval_scene::TriangleMesh;
use mateval_scene::camera::Camera;
use mateval_scene::findings::shortened;
use mateval_scene::gltf_accessor::numbers;
use mateval_scene::gltf_error::GltfError;
use mateval_scene::gltf_file::INSTANCING;
use mateval_scene::reference::{Emission, Surface, SurfaceIndex};
use serde_json::Value;

use super::camera::perspective;
use super::error::PrimitiveFault;
use super::meshes::flat_shaded;
use super::omitted::{LEFT_OUT, Omission};
use super::read_material::ReadMaterial;
use super::reader::Reader;
use crate::parts::parts_of_labels;
use crate::shift;
use crate::source_scene::InstanceOrigin;
use crate::surface_mesh::to_world;

/// Longer names are shortened, since a name may be copied to many instances.
const LONGEST_NAME: usize = 1024;

/// The primitives of a node that share a material, as one mesh.
struct Group {
    material: Option<usize>,
    read: ReadMaterial,
    /// As in `wood`, for the names of instances.
    name: String,
    mesh: TriangleMesh,
    /// For each triangle, the place of its primitive in the mesh of the file.
    labels: Vec<usize>,
}

impl Reader<'_> {
    /// Adds all nodes of a scene, moved by `-shift`. Returns its first perspective camera, in the order of the tree.
    pub(super) fn nodes(&mut self, scene: &gltf::Scene<'_>, shift: DVec3) -> Option<Camera> {
        let mut camera = None;
        let mut visited = BTreeSet::new();
        let root = shift::transform(shift);
        let mut open: Vec<(gltf::Node<'_>, DMat4)> = scene.nodes().map(|node| (node, root)).collect();
        open.reverse();
        while let Some((node, world_from_parent)) = open.pop() {
            let pointer = format!("/nodes/{}", node.index());
            // A node has one parent. One that is reached twice may be part of a circle.
            if !visited.insert(node.index()) {
                let message = "the node is the child of two nodes, or of itself";
                self.log.warn("not_a_tree", &pointer, message, "kept its first place");
                continue;
            }
            let (parent_from_node, is_sound) = parent_from_node(&node);
            if !is_sound {
                self.log.warn("bad_value", &pointer, "expected a rotation of length 1", "used no rotation");
            }
            let world_from_node = world_from_parent * parent_from_node;
            self.node(&node, world_from_node, &pointer);
            camera = camera.or_else(|| self.camera(&node, world_from_node, &pointer));
            let first = open.len();
            open.extend(node.children().map(|child| (child, world_from_node)));
            open[first..].reverse();
        }
        camera
    }

    fn camera(&mut self, node: &gltf::Node<'_>, world_from_node: DMat4, pointer: &str) -> Option<Camera> {
        let camera = node.camera()?;
        let found = perspective(&camera, world_from_node);
        if found.is_none() {
            let feature = "cameras that are not perspective, or have no sound direction, angle or place";
            self.omit(Omission::Visible, feature, LEFT_OUT, pointer);
        }
        found
    }

    fn node(&mut self, node: &gltf::Node<'_>, world_from_node: DMat4, pointer: &str) {
        let others = node.extensions().into_iter().flat_map(|map| map.keys());
        self.omit_extensions(others.filter(|name| *name != INSTANCING), pointer);
        if node.skin().is_some() {
            self.omit(Omission::Visible, "skins", "showed the mesh without its bones", pointer);
        }
        let name = node_name(node);
        if let Some(light) = node.light() {
            self.punctual(&light, world_from_node, &name, pointer);
        }
        let Some(mesh) = node.mesh() else { return };
        match node.extension_value(INSTANCING) {
            None => self.mesh(&mesh, &name, world_from_node, pointer),
            Some(extension) => {
                let copies = match self.instances(extension) {
                    Ok(copies) => copies,
                    Err(fault) => {
                        let message = format!("{INSTANCING}: {fault}");
                        return self.log.warn("bad_instances", pointer, message, "left all instances out");
                    }
                };
                for (number, node_from_copy) in copies.into_iter().enumerate() {
                    let name = format!("{name} {}", number + 1);
                    self.mesh(&mesh, &name, world_from_node * node_from_copy, pointer);
                }
            }
        }
    }

    /// The transforms of `EXT_mesh_gpu_instancing`, at least one. Absent attributes have the format's defaults: no motion.
    fn instances(&self, extension: &Value) -> Result<Vec<DMat4>, GltfError> {
        let attribute = |key: &str| {
            let index = extension.pointer(&format!("/attributes/{key}")).and_then(Value::as_u64);
            index.and_then(|index| self.file.document.accessors().nth(index as usize))
        };
        let all = ["TRANSLATION", "ROTATION", "SCALE"].map(attribute);
        let count = all.iter().flatten().map(gltf::Accessor::count).max().unwrap_or(0);
        if count == 0 {
            return Err(GltfError::Missing { attribute: "TRANSLATION, ROTATION or SCALE of one instance or more" });
        }
        if all.iter().flatten().any(|accessor| accessor.count() != count) {
            return Err(GltfError::CountsDiffer);
        }
        if count > self.limits.primitives {
            let accessor = all.iter().flatten().map(gltf::Accessor::index).next().unwrap_or(0);
            return Err(GltfError::AccessorTooLarge { accessor, most: self.limits.primitives });
        }
        let [translation, rotation, scale] = all;
        let translation = translation.map(|accessor| numbers::<3>(&accessor, self.buffers)).transpose()?;
        let rotation = rotation.map(|accessor| numbers::<4>(&accessor, self.buffers)).transpose()?;
        let scale = scale.map(|accessor| numbers::<3>(&accessor, self.buffers)).transpose()?;
        let copy = |at: usize| {
            let translation = translation.as_ref().map_or([0.0; 3], |all| all[at]);
            let rotation = rotation.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |all| all[at]);
            placed(translation, rotation, scale.as_ref().map_or([1.0; 3], |all| all[at])).0
        };
        Ok((0..count).map(copy).collect())
    }

    /// Adds the instances of a mesh at one place.
    fn mesh(&mut self, mesh: &gltf::Mesh<'_>, name: &str, world_from_node: DMat4, pointer: &str) {
        let groups = self.groups(mesh);
        if groups.len() > 1 {
            let action = "made one instance for each of its materials";
            self.omit(Omission::Slight, "nodes of several materials as one instance", action, pointer);
        }
        let is_only = groups.len() == 1;
        for group in groups {
            let name = if is_only { name.to_owned() } else { format!("{name} {}", group.name) };
            self.instance(name, group, world_from_node, pointer);
        }
    }

    /// The mesh's primitives by material, in the order in which the materials first appear.
    fn groups(&mut self, mesh: &gltf::Mesh<'_>) -> Vec<Group> {
        let mut groups: Vec<Group> = Vec::new();
        for primitive in mesh.primitives() {
            let pointer = format!("/meshes/{}/primitives/{}", mesh.index(), primitive.index());
            if self.primitives >= self.limits.primitives {
                let feature = format!("primitives beyond {}", self.limits.primitives);
                self.omit(Omission::Visible, &feature, LEFT_OUT, &pointer);
                break;
            }
            self.primitives += 1;
            let material = primitive.material();
            let read = self.material(&material);
            match self.primitive(&primitive, read.uv_set, &pointer) {
                Ok(mesh) => {
                    let at = groups.iter().position(|group| group.material == material.index());
                    let at = at.unwrap_or_else(|| {
                        let name = self.scene.materials[read.index.0].name.clone();
                        let (mesh, labels) = (TriangleMesh::default(), Vec::new());
                        groups.push(Group { material: material.index(), read, name, mesh, labels });
                        groups.len() - 1
                    });
                    groups[at].add(&mesh, primitive.index());
                }
                Err(fault) => self.report_primitive(&fault, &pointer),
            }
        }
        groups
    }

    fn report_primitive(&mut self, fault: &PrimitiveFault, pointer: &str) {
        if let PrimitiveFault::NotASurface = fault {
            return self.omit(Omission::Slight, "points and lines", LEFT_OUT, pointer);
        }
        self.log.warn(fault.code(), pointer, fault.to_string(), "left the primitive out");
    }

    /// Adds an instance, and its light if its material emits.
    fn instance(&mut self, name: String, group: Group, world_from_node: DMat4, pointer: &str) {
        let (before, labels) = (group.mesh.triangles.len(), group.labels);
        let (mesh, repairs) = to_world(group.mesh, world_from_node, false);
        repairs.report(pointer, &mesh, &mut self.log);
        if mesh.triangles.is_empty() {
            self.log.warn("empty_mesh", pointer, "expected triangles, found none", "left the mesh out");
            return;
        }
        // One primitive alone is split into its connected components, as a shape of any other source.
        let is_whole = mesh.triangles.len() == before;
        let has_parts = is_whole && labels.iter().any(|label| *label != labels[0]);
        let part_of_triangle = has_parts.then(|| parts_of_labels(&mesh, &labels));
        let surface = SurfaceIndex(self.scene.surfaces.len());
        if let Some(glow) = group.read.glow {
            let (surfaces, radiance, two_sided) = (vec![surface], glow.radiance, glow.two_sided);
            let emission = Emission::Area { surfaces, radiance, map: glow.map, two_sided };
            self.add_light(&name, emission, true, pointer);
        }
        self.scene.surfaces.push(Surface { name, mesh, material: group.read.index });
        self.origins.push(InstanceOrigin { part_of_triangle, stated: group.read.stated, ..InstanceOrigin::default() });
    }
}

impl Group {
    /// Adds a primitive. Where only one of both meshes has normals, the other gets flat ones.
    fn add(&mut self, mesh: &TriangleMesh, label: usize) {
        self.labels.extend(std::iter::repeat_n(label, mesh.triangles.len()));
        match (self.mesh.normals.is_some(), mesh.normals.is_some()) {
            _ if self.mesh.positions.is_empty() => self.mesh = mesh.clone(),
            (true, false) => self.mesh.append(&flat_shaded(mesh)),
            (false, true) => {
                self.mesh = flat_shaded(&self.mesh);
                self.mesh.append(mesh);
            }
            _ => self.mesh.append(mesh),
        }
    }
}

/// The node's own transform, and whether its rotation could be normalised; without, it has none.
fn parent_from_node(node: &gltf::Node<'_>) -> (DMat4, bool) {
    let (translation, rotation, scale) = match node.transform() {
        Transform::Matrix { matrix } => {
            return (DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from))), true);
        }
        Transform::Decomposed { translation, rotation, scale } => (translation, rotation, scale),
    };
    placed(translation, rotation, scale)
}

/// The transform of a translation, a quaternion and a scale, and whether the quaternion could be normalised.
fn placed(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> (DMat4, bool) {
    let rotation = DQuat::from_array(rotation.map(f64::from));
    let (length, vector) = (rotation.length(), |values: [f32; 3]| DVec3::from_array(values.map(f64::from)));
    let is_sound = length > 1e-9 && length.is_finite();
    let rotation = if is_sound { rotation / length } else { DQuat::IDENTITY };
    (DMat4::from_scale_rotation_translation(vector(scale), rotation, vector(translation)), is_sound)
}

/// The place of the scene's first camera that can be used, as [`Reader::nodes`] finds it.
pub(super) fn place_of_camera(scene: &gltf::Scene<'_>) -> Option<DVec3> {
    let mut visited = BTreeSet::new();
    let mut open: Vec<(gltf::Node<'_>, DMat4)> = scene.nodes().map(|node| (node, DMat4::IDENTITY)).collect();
    open.reverse();
    while let Some((node, world_from_parent)) = open.pop() {
        if !visited.insert(node.index()) {
            continue;
        }
        let world_from_node = world_from_parent * parent_from_node(&node).0;
        if let Some(camera) = node.camera().and_then(|camera| perspective(&camera, world_from_node)) {
            return Some(camera.position());
        }
        let first = open.len();
        open.extend(node.children().map(|child| (child, world_from_node)));
        open[first..].reverse();
    }
    None
}

/// The node's name, else its mesh's, else its number.
fn node_name(node: &gltf::Node<'_>) -> String {
    let mesh = node.mesh();
    let name = node.name().or(mesh.as_ref().and_then(|mesh| mesh.name())).filter(|name| !name.is_empty());
    match name {
        Some(name) if name.len() <= LONGEST_NAME => name.to_owned(),
        Some(name) => shortened(name),
        None => format!("node {}", node.index()),
    }
}
