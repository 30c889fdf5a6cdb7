//! The nodes of a scene: each mesh of a node becomes an instance for each of its materials, with its primitives as
//! parts, and the first camera that can be used becomes the scene's.

use std::collections::BTreeSet;

use glam::{DMat3, DMat4, DQuat, DVec3, Vec2, Vec3};
use gltf::Semantic;
use gltf::mesh::Mode;
use gltf::scene::Transform;
use mateval_dataset::TriangleMesh;
use mateval_dataset::camera::{Camera, Intrinsics};
use mateval_dataset::gltf_file::{GltfError, GltfFile, INSTANCING, first_numbers, indices, numbers};
use mateval_dataset::reference::{Emission, Surface, SurfaceIndex};
use mateval_files::source_folder::FileFault;
use mateval_files::untrusted::shortened;
use serde_json::Value;

use super::document::Limits;
use super::reader::{LEFT_OUT, Omission, ReadMaterial, Reader};
use crate::source_scene::{InstanceOrigin, shift_transform};
use crate::surface_mesh::{parts_of_labels, to_world};

/// Longer names are shortened, since a name may be copied to many instances.
const LONGEST_NAME: usize = 1024;

/// Columns of a picture whose size the recipe does not state; glTF states its shape alone.
const WIDTH: u32 = 480;
/// Width over height where the file does not state it.
const ASPECT: f64 = 16.0 / 9.0;
/// Least and most rows of such a picture.
const HEIGHTS: std::ops::RangeInclusive<f64> = 16.0..=8192.0;

/// Vertical fields of view in radians that a camera may have.
const FIELDS: std::ops::RangeInclusive<f64> = 1e-3..=3.1;
/// Farthest that a camera may stand from the origin along an axis, in metres: there, 64 bits are exact to 0.1
/// micrometres.
const FARTHEST_M: f64 = 1e9;

/// The primitives of a node that share a material, as one mesh.
struct Group {
    material: Option<usize>,
    read: ReadMaterial,
    /// As in `wood`, for the names of instances.
    name: String,
    mesh: TriangleMesh,
    /// For each triangle, the place of its primitive in the mesh of the file.
    labels: Vec<usize>,
    /// Whether colours of vertices, which are left out, change its base colour.
    is_painted: bool,
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

impl Reader<'_> {
    /// Adds all nodes of a scene, moved by `-shift`. Returns its first perspective camera, in the order of the tree.
    pub(super) fn nodes(&mut self, scene: &gltf::Scene<'_>, shift: DVec3) -> Option<Camera> {
        let (placed, faults) = placed_nodes(self.file, scene, shift);
        for (index, fault) in faults {
            let place = format!("/nodes/{index}");
            match fault {
                NodeFault::Repeated => {
                    let message = "the node is the child of two nodes, or of itself";
                    self.log.warn("not_a_tree", &place, message, "kept its first place");
                }
                NodeFault::Projection(row) => {
                    let message = format!("expected a matrix whose last row is 0 0 0 1, found {row:?}");
                    self.log.warn("bad_transform", &place, message, "left the node and its children out");
                }
            }
        }
        let mut camera = None;
        for PlacedNode { node, world_from_node, is_sound } in placed {
            let pointer = format!("/nodes/{}", node.index());
            if !is_sound {
                self.log.warn("bad_value", &pointer, "expected a rotation of length 1", "used no rotation");
            }
            self.node(&node, world_from_node, &pointer);
            camera = camera.or_else(|| self.camera(&node, world_from_node, &pointer));
        }
        camera
    }

    fn camera(&mut self, node: &gltf::Node<'_>, world_from_node: DMat4, pointer: &str) -> Option<Camera> {
        let camera = node.camera()?;
        let found = perspective(&camera, world_from_node);
        if let gltf::camera::Projection::Perspective(lens) = camera.projection()
            && !FIELDS.contains(&f64::from(lens.yfov()))
        {
            let message = format!(
                "expected a yfov of {} to {} radians, found {}; degrees must be converted",
                FIELDS.start(),
                FIELDS.end(),
                lens.yfov()
            );
            self.log.warn("bad_value", &format!("/cameras/{}", camera.index()), message, "left the camera out");
            return None;
        }
        if found.is_none() {
            let feature = "cameras that are not perspective, or have no sound direction or place";
            self.omit(Omission::Visible, feature, LEFT_OUT, pointer);
            return None;
        }
        self.aspect = stated_aspect(&camera);
        if self.aspect.is_none() {
            // The size of whatever shows it decides then (glTF 2.0, section 5.13.3), which a file does not know.
            let message = "the camera states no width over height above 0";
            let action = format!("used 16 to 9, {WIDTH}x270 pixels, unless the recipe states a resolution");
            self.log.note("no_aspect_ratio", &format!("/cameras/{}", camera.index()), message, action);
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

    /// The transforms of `EXT_mesh_gpu_instancing`, at least one. Absent attributes have the format's defaults: no
    /// motion.
    fn instances(&self, extension: &Value) -> Result<Vec<DMat4>, GltfError> {
        let attribute = |key: &str| {
            let index = extension.pointer(&format!("/attributes/{key}")).and_then(Value::as_u64);
            index.and_then(|index| self.file.document.accessors().nth(index as usize))
        };
        let all = ["TRANSLATION", "ROTATION", "SCALE"].map(attribute);
        let count = all.iter().flatten().map(gltf::Accessor::count).max().unwrap_or(0);
        if count == 0 {
            return Err(GltfError("expected TRANSLATION, ROTATION or SCALE of one instance or more".to_owned()));
        }
        if all.iter().flatten().any(|accessor| accessor.count() != count) {
            return Err(GltfError("expected as many entries of TRANSLATION, ROTATION and SCALE".to_owned()));
        }
        if count > self.limits.primitives {
            return Err(GltfError(format!("expected at most {} instances, found {count}", self.limits.primitives)));
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
            if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
                self.omit(Omission::Slight, "points and lines", LEFT_OUT, &pointer);
                continue;
            }
            match self.primitive(&primitive, read.uv_set, &pointer) {
                Ok(mesh) => {
                    let at = groups.iter().position(|group| group.material == material.index());
                    let at = at.unwrap_or_else(|| {
                        let name = self.scene.materials[read.index.0].name.clone();
                        let (mesh, labels) = (TriangleMesh::default(), Vec::new());
                        groups.push(Group { material: material.index(), read, name, mesh, labels, is_painted: false });
                        groups.len() - 1
                    });
                    groups[at].add(&mesh, primitive.index());
                    groups[at].is_painted |= self.is_painted(&primitive);
                }
                Err(fault) => self.log.warn(fault.code, &pointer, fault.message, "left the primitive out"),
            }
        }
        groups
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
        let mut stated = group.read.stated;
        stated.base_color &= !group.is_painted;
        self.origins.push(InstanceOrigin { part_of_triangle, stated, ..InstanceOrigin::default() });
    }

    /// Whether the vertices of a primitive have other colours than white, which multiply the base colour.
    fn is_painted(&self, primitive: &gltf::Primitive<'_>) -> bool {
        let vertices = primitive.get(&Semantic::Positions).map_or(0, |positions| positions.count());
        // More colours than vertices, which were counted, belong to no vertex.
        let colors = primitive.get(&Semantic::Colors(0)).filter(|colors| colors.count() <= vertices);
        let colors = colors.and_then(|colors| first_numbers::<3>(&colors, self.buffers).ok());
        colors.is_some_and(|colors| colors.iter().any(|rgb| *rgb != [1.0; 3]))
    }

    /// The triangles of a primitive, with the texture coordinates of one set. Counts them before they are read.
    fn primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        uv_set: Option<u32>,
        pointer: &str,
    ) -> Result<TriangleMesh, FileFault> {
        let bad = |GltfError(message)| FileFault { code: "bad_mesh", message };
        let missing = || bad(GltfError("expected POSITION".to_owned()));
        let positions = primitive.get(&Semantic::Positions).ok_or_else(missing)?;
        let corner_numbers = primitive.indices();
        let corners = corner_numbers.as_ref().map_or(positions.count(), gltf::Accessor::count);
        self.count(positions.count(), corners, primitive.mode())?;
        self.report_omitted_attributes(primitive, pointer);
        // Counts are compared before anything is read, so that what is read is bounded by what was counted.
        let mut same = |semantic: Semantic, what: &str| {
            let accessor = primitive.get(&semantic)?;
            let (expected, found) = (positions.count(), accessor.count());
            if expected == found {
                return Some(accessor);
            }
            let message = format!("{what} has {found} entries, POSITION {expected}");
            self.log.warn("bad_attribute", pointer, message, "treated it as absent");
            None
        };
        let normals = same(Semantic::Normals, "NORMAL");
        let uvs = same(Semantic::TexCoords(uv_set.unwrap_or(0)), "TEXCOORD");
        let positions =
            numbers::<3>(&positions, self.buffers).map_err(bad)?.into_iter().map(Vec3::from_array).collect();
        let normals = normals.map(|accessor| numbers::<3>(&accessor, self.buffers)).transpose().map_err(bad)?;
        let uvs = uvs.map(|accessor| numbers::<2>(&accessor, self.buffers)).transpose().map_err(bad)?;
        let mesh = TriangleMesh {
            positions,
            normals: normals.map(|all| all.into_iter().map(Vec3::from_array).collect()),
            // v upwards.
            uvs: uvs.map(|all| all.into_iter().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect()),
            triangles: Vec::new(),
        };
        let vertices = mesh.positions.len();
        let numbers = match corner_numbers {
            Some(accessor) => indices(&accessor, self.buffers).map_err(bad)?,
            None => (0..vertices as u32).collect(),
        };
        let listed = listed(numbers, primitive.mode());
        let (all, rest) = listed.as_chunks::<3>();
        let sound = |triangle: &&[u32; 3]| triangle.iter().all(|vertex| (*vertex as usize) < vertices);
        let triangles: Vec<[u32; 3]> = all.iter().filter(sound).copied().collect();
        let bad = all.len() - triangles.len() + usize::from(!rest.is_empty());
        if bad > 0 {
            let message = format!("{bad} of {} triangles name vertices that do not exist, or too few", all.len());
            self.log.warn("bad_indices", pointer, message, "left them out");
        }
        Ok(TriangleMesh { triangles, ..mesh })
    }

    /// Adds to the counts of vertices and triangles. Fails, without adding, where they would exceed the limits.
    fn count(&mut self, vertices: usize, corners: usize, mode: Mode) -> Result<(), FileFault> {
        let triangles = if mode == Mode::Triangles { corners / 3 } else { corners };
        let (all_vertices, all_triangles) =
            (self.vertices.saturating_add(vertices), self.triangles.saturating_add(triangles));
        if all_vertices > self.limits.vertices || all_triangles > self.limits.triangles {
            let Limits { triangles, vertices, .. } = self.limits;
            let message = format!("the scene has more than {triangles} triangles or {vertices} vertices");
            return Err(FileFault { code: "limit", message });
        }
        (self.vertices, self.triangles) = (all_vertices, all_triangles);
        Ok(())
    }

    fn report_omitted_attributes(&mut self, primitive: &gltf::Primitive<'_>, pointer: &str) {
        if primitive.get(&Semantic::Colors(0)).is_some() {
            self.omit(Omission::Visible, "colours of vertices (COLOR_0)", LEFT_OUT, pointer);
        }
        if primitive.morph_targets().next().is_some() {
            self.omit(Omission::Visible, "morph targets", "showed the mesh without them", pointer);
        }
    }
}

/// The largest deviation from the last row of an affine matrix that counts as noise.
const AFFINE_TOLERANCE: f64 = 1e-6;

/// The node's own transform, and whether its rotation could be normalised; without, it has none. Fails with the last row
/// of a matrix that is a projection.
fn parent_from_node(file: &GltfFile, node: &gltf::Node<'_>) -> Result<(DMat4, bool), [f64; 4]> {
    let (transform, is_sound) = match node.transform() {
        Transform::Matrix { matrix } => {
            let mut columns = matrix.map(|column| column.map(f64::from));
            let row = columns.map(|column| column[3]);
            if row.iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(found, wanted)| (found - wanted).abs() > AFFINE_TOLERANCE) {
                return Err(row);
            }
            columns.iter_mut().zip([0.0, 0.0, 0.0, 1.0]).for_each(|(column, exact)| column[3] = exact);
            (DMat4::from_cols_array_2d(&columns), true)
        }
        Transform::Decomposed { translation, rotation, scale } => placed(translation, rotation, scale),
    };
    Ok((file.exact(node, transform), is_sound))
}

/// The transform of a translation, a quaternion and a scale, and whether the quaternion could be normalised.
fn placed(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> (DMat4, bool) {
    let rotation = DQuat::from_array(rotation.map(f64::from));
    let (length, vector) = (rotation.length(), |values: [f32; 3]| DVec3::from_array(values.map(f64::from)));
    let is_sound = length > 1e-9 && length.is_finite();
    let rotation = if is_sound { rotation / length } else { DQuat::IDENTITY };
    (DMat4::from_scale_rotation_translation(vector(scale), rotation, vector(translation)), is_sound)
}

struct PlacedNode<'f> {
    node: gltf::Node<'f>,
    world_from_node: DMat4,
    /// Whether its rotation could be normalised; without, it has none.
    is_sound: bool,
}

/// Why a node is left out.
enum NodeFault {
    /// It is reached again: a node has one parent, so it may be part of a circle.
    Repeated,
    /// Its matrix is a projection, with this last row.
    Projection([f64; 4]),
}

/// The nodes of a scene in the order of the tree, moved by `-shift`, and the indices of those that are left out.
fn placed_nodes<'f>(
    file: &GltfFile,
    scene: &gltf::Scene<'f>,
    shift: DVec3,
) -> (Vec<PlacedNode<'f>>, Vec<(usize, NodeFault)>) {
    let (mut placed, mut faults, mut visited) = (Vec::new(), Vec::new(), BTreeSet::new());
    let root = shift_transform(shift);
    let mut open: Vec<(gltf::Node<'f>, DMat4)> = scene.nodes().map(|node| (node, root)).collect();
    open.reverse();
    while let Some((node, world_from_parent)) = open.pop() {
        if !visited.insert(node.index()) {
            faults.push((node.index(), NodeFault::Repeated));
            continue;
        }
        let (parent_from_node, is_sound) = match parent_from_node(file, &node) {
            Ok(found) => found,
            Err(row) => {
                faults.push((node.index(), NodeFault::Projection(row)));
                continue;
            }
        };
        let world_from_node = world_from_parent * parent_from_node;
        let first = open.len();
        open.extend(node.children().map(|child| (child, world_from_node)));
        open[first..].reverse();
        placed.push(PlacedNode { node, world_from_node, is_sound });
    }
    (placed, faults)
}

/// The place of the scene's first camera that can be used, as [`Reader::nodes`] finds it.
pub(super) fn place_of_camera(file: &GltfFile, scene: &gltf::Scene<'_>) -> Option<DVec3> {
    let (placed, _) = placed_nodes(file, scene, DVec3::ZERO);
    placed.iter().find_map(|placed| Some(perspective(&placed.node.camera()?, placed.world_from_node)?.position()))
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

/// The corners of strips and fans as those of single triangles, with the same front (glTF 2.0, section 3.7.2.1).
fn listed(numbers: Vec<u32>, mode: Mode) -> Vec<u32> {
    let strip = |at: usize, corners: &[u32]| {
        if at.is_multiple_of(2) { [corners[0], corners[1], corners[2]] } else { [corners[1], corners[0], corners[2]] }
    };
    match mode {
        Mode::TriangleStrip => numbers.windows(3).enumerate().flat_map(|(at, corners)| strip(at, corners)).collect(),
        Mode::TriangleFan => {
            let rest = numbers.get(1..).unwrap_or_default();
            rest.windows(2).flat_map(|edge| [edge[0], edge[1], numbers[0]]).collect()
        }
        _ => numbers,
    }
}

/// The mesh with corners of its own for each triangle, and their flat normals.
fn flat_shaded(mesh: &TriangleMesh) -> TriangleMesh {
    let corners: Vec<usize> = mesh.triangles.as_flattened().iter().map(|vertex| *vertex as usize).collect();
    let normal = |at: usize| mesh.geometric_normal(at / 3).as_vec3();
    TriangleMesh {
        positions: corners.iter().map(|vertex| mesh.positions[*vertex]).collect(),
        normals: Some((0..corners.len()).map(normal).collect()),
        uvs: mesh.uvs.as_ref().map(|uvs| corners.iter().map(|vertex| uvs[*vertex]).collect()),
        triangles: (0..mesh.triangles.len() as u32).map(|at| [3 * at, 3 * at + 1, 3 * at + 2]).collect(),
    }
}

/// The node's camera; none for an orthographic one, one of an impossible field of view, one that a transform flattens,
/// and one too far away.
fn perspective(camera: &gltf::Camera<'_>, world_from_node: DMat4) -> Option<Camera> {
    let gltf::camera::Projection::Perspective(lens) = camera.projection() else { return None };
    let fov_y = f64::from(lens.yfov());
    if !FIELDS.contains(&fov_y) {
        return None;
    }
    let height = f64::from(WIDTH) / stated_aspect(camera).unwrap_or(ASPECT);
    let height = height.clamp(*HEIGHTS.start(), *HEIGHTS.end()).round() as u32;
    // A camera looks along its -Z with +Y up, as ours does. Scale and shear do not change what it sees.
    let linear = DMat3::from_mat4(world_from_node);
    let back = linear.z_axis.try_normalize()?;
    let right = linear.y_axis.cross(back).try_normalize()?;
    let rotation = DMat3::from_cols(right, back.cross(right), back);
    let position = world_from_node.w_axis.truncate();
    let is_near = position.abs().max_element() <= FARTHEST_M;
    is_near.then(|| Camera::from_rotation(rotation, position, Intrinsics::from_fov_y(WIDTH, height, fov_y)))
}

/// Width over height that a perspective camera states; none unless it is above 0.
fn stated_aspect(camera: &gltf::Camera<'_>) -> Option<f64> {
    let gltf::camera::Projection::Perspective(lens) = camera.projection() else { return None };
    lens.aspect_ratio().map(f64::from).filter(|aspect| *aspect > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_front() {
        assert_eq!(listed(vec![0, 1, 2, 3], Mode::TriangleStrip), [0, 1, 2, 2, 1, 3]);
        assert_eq!(listed(vec![0, 1, 2, 3], Mode::TriangleFan), [1, 2, 0, 2, 3, 0]);
        for mode in [Mode::TriangleStrip, Mode::TriangleFan] {
            assert!(listed(Vec::new(), mode).is_empty() && listed(vec![0, 1], mode).is_empty());
        }
    }
}
