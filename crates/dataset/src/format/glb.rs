//! Reads and writes geometry as binary glTF: one node with one mesh a name, in world space, all of one plain material.
//!
//! glTF counts v from the top of a picture and [`TriangleMesh`] from the bottom; this module converts.

use std::borrow::Cow;
use std::path::Path;

use glam::{Vec2, Vec3};
use gltf_json as json;
use json::validation::{Checked, USize64};
use mateval_files::FileError;
use mateval_files::whole::write_whole;

use crate::DatasetError;
use crate::gltf_file::{GltfError, indices, numbers, triangles};
use crate::mesh::TriangleMesh;

/// Largest file that is read, in bytes.
const MAX_GLB_BYTES: u64 = 4 << 30;

#[derive(Clone, Debug, PartialEq)]
pub struct GlbNode {
    pub name: String,
    /// World space; at least one triangle.
    pub mesh: TriangleMesh,
}

/// Writes the nodes in their order. The same nodes give the same bytes.
pub fn write(path: &Path, nodes: &[GlbNode]) -> Result<(), DatasetError> {
    let bytes: u64 =
        nodes.iter().map(|node| 32 * node.mesh.positions.len() as u64 + 12 * node.mesh.triangles.len() as u64).sum();
    if bytes > MAX_GLB_BYTES - (64 << 20) {
        let what = format!("{bytes} bytes of geometry; a .glb holds at most 4 GiB; split the scene");
        return Err(DatasetError::Unsupported { path: path.to_owned(), what });
    }
    let mut file = Writer::default();
    file.root.push(plain_material());
    for node in nodes {
        file.add_node(node);
    }
    write_whole(path, &file.finish())?;
    Ok(())
}

/// Grey paint, seen from both sides. It says nothing about the surface; but trimesh drops the uv of what has no
/// material.
fn plain_material() -> json::Material {
    json::Material {
        name: Some("plain".to_owned()),
        double_sided: true,
        pbr_metallic_roughness: json::material::PbrMetallicRoughness {
            base_color_factor: json::material::PbrBaseColorFactor([0.5, 0.5, 0.5, 1.0]),
            metallic_factor: json::material::StrengthFactor(0.0),
            ..Default::default()
        },
        ..Default::default()
    }
}

#[derive(Default)]
struct Writer {
    root: json::Root,
    blob: Vec<u8>,
}

impl Writer {
    fn add_node(&mut self, node: &GlbNode) {
        let mesh = &node.mesh;
        let mut attributes = std::collections::BTreeMap::new();
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(Vec3::to_array).collect();
        let accessor = self.add_floats(&positions, json::accessor::Type::Vec3, true);
        attributes.insert(Checked::Valid(json::mesh::Semantic::Positions), accessor);
        if let Some(normals) = &mesh.normals {
            let normals: Vec<[f32; 3]> = normals.iter().map(Vec3::to_array).collect();
            let accessor = self.add_floats(&normals, json::accessor::Type::Vec3, false);
            attributes.insert(Checked::Valid(json::mesh::Semantic::Normals), accessor);
        }
        if let Some(uvs) = &mesh.uvs {
            let uvs: Vec<[f32; 2]> = uvs.iter().map(|uv| [uv.x, 1.0 - uv.y]).collect();
            let accessor = self.add_floats(&uvs, json::accessor::Type::Vec2, false);
            attributes.insert(Checked::Valid(json::mesh::Semantic::TexCoords(0)), accessor);
        }
        let indices = self.add_indices(mesh.triangles.as_flattened());
        let primitive = json::mesh::Primitive {
            attributes: attributes.into_iter().collect(),
            extensions: None,
            extras: None,
            indices: Some(indices),
            material: Some(json::Index::new(0)),
            mode: Checked::Valid(json::mesh::Mode::Triangles),
            targets: None,
        };
        let mesh = self.root.push(json::Mesh {
            extensions: None,
            extras: None,
            name: Some(node.name.clone()),
            primitives: vec![primitive],
            weights: None,
        });
        self.root.push(json::Node { mesh: Some(mesh), name: Some(node.name.clone()), ..Default::default() });
    }

    fn add_floats<const N: usize>(
        &mut self,
        values: &[[f32; N]],
        kind: json::accessor::Type,
        with_bounds: bool,
    ) -> json::Index<json::Accessor> {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.add_view(&bytes, json::buffer::Target::ArrayBuffer);
        let bound = |pick: fn(f32, f32) -> f32| {
            let start = values.first().copied().unwrap_or([0.0; N]);
            let all = values.iter().fold(start, |a, b| std::array::from_fn(|c| pick(a[c], b[c])));
            json::Value::from(all.to_vec())
        };
        self.root.push(json::Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            component_type: Checked::Valid(json::accessor::GenericComponentType(json::accessor::ComponentType::F32)),
            count: USize64::from(values.len()),
            extensions: None,
            extras: None,
            max: with_bounds.then(|| bound(f32::max)),
            min: with_bounds.then(|| bound(f32::min)),
            name: None,
            normalized: false,
            sparse: None,
            type_: Checked::Valid(kind),
        })
    }

    fn add_indices(&mut self, indices: &[u32]) -> json::Index<json::Accessor> {
        let bytes: Vec<u8> = indices.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.add_view(&bytes, json::buffer::Target::ElementArrayBuffer);
        self.root.push(json::Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            component_type: Checked::Valid(json::accessor::GenericComponentType(json::accessor::ComponentType::U32)),
            count: USize64::from(indices.len()),
            extensions: None,
            extras: None,
            max: None,
            min: None,
            name: None,
            normalized: false,
            sparse: None,
            type_: Checked::Valid(json::accessor::Type::Scalar),
        })
    }

    fn add_view(&mut self, bytes: &[u8], target: json::buffer::Target) -> json::Index<json::buffer::View> {
        let offset = self.blob.len();
        self.blob.extend_from_slice(bytes);
        self.root.push(json::buffer::View {
            buffer: json::Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(offset)),
            byte_stride: None,
            extensions: None,
            extras: None,
            name: None,
            target: Some(Checked::Valid(target)),
        })
    }

    fn finish(mut self) -> Vec<u8> {
        self.root.push(json::Buffer {
            byte_length: USize64::from(self.blob.len()),
            extensions: None,
            extras: None,
            name: None,
            uri: None,
        });
        let nodes = (0..self.root.nodes.len() as u32).map(json::Index::new).collect();
        let scene = self.root.push(json::Scene { extensions: None, extras: None, name: None, nodes });
        self.root.scene = Some(scene);
        let mut text = serde_json::to_vec(&self.root).expect("glTF's own types can be written as JSON");
        text.resize(text.len().next_multiple_of(4), b' ');
        self.blob.resize(self.blob.len().next_multiple_of(4), 0);
        let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
        let glb = gltf::binary::Glb { header, json: Cow::Owned(text), bin: Some(Cow::Owned(self.blob)) };
        glb.to_vec().expect("`write` has checked that it stays below 4 GiB")
    }
}

/// Reads every node that has a mesh, in the file's order. Fails where positions or uv are not finite or an index is out
/// of range.
pub fn read(path: &Path) -> Result<Vec<GlbNode>, DatasetError> {
    let length = std::fs::metadata(path).map_err(FileError::io("read", path))?.len();
    if length > MAX_GLB_BYTES {
        return Err(invalid(path, "", format!("{length} bytes; expected at most {MAX_GLB_BYTES}")));
    }
    let bytes = std::fs::read(path).map_err(FileError::io("read", path))?;
    let file = crate::gltf_file::parse(&bytes).map_err(|error| invalid(path, "", error.to_string()))?;
    let blob = [file.blob.as_deref().unwrap_or_default()];
    file.document
        .nodes()
        .filter_map(|node| Some((node.clone(), node.mesh()?)))
        .map(|(node, mesh)| {
            let name = node.name().unwrap_or_default().to_owned();
            read_mesh(&mesh, &blob)
                .map(|mesh| GlbNode { name: name.clone(), mesh })
                .map_err(|error| invalid(path, &name, error.to_string()))
        })
        .collect()
}

fn read_mesh(mesh: &gltf::Mesh<'_>, buffers: &[&[u8]]) -> Result<TriangleMesh, GltfError> {
    let mut primitives = mesh.primitives();
    let (Some(primitive), None) = (primitives.next(), primitives.next()) else {
        return Err(GltfError(format!("expected one primitive per mesh, found {}", mesh.primitives().count())));
    };
    let accessor = |semantic: gltf::Semantic| primitive.get(&semantic);
    let missing = |what: &str| GltfError(format!("expected {what}"));
    let positions = accessor(gltf::Semantic::Positions).ok_or_else(|| missing("POSITION"))?;
    let positions: Vec<Vec3> = finite::<3>(&positions, buffers)?.into_iter().map(Vec3::from_array).collect();
    let normals = accessor(gltf::Semantic::Normals).map(|a| finite::<3>(&a, buffers)).transpose()?;
    let uvs = accessor(gltf::Semantic::TexCoords(0)).map(|a| finite::<2>(&a, buffers)).transpose()?;
    let accessor = primitive.indices().ok_or_else(|| missing("indices"))?;
    let triangles = triangles(indices(&accessor, buffers)?, positions.len())?;
    let same_count = |count: Option<usize>| count.is_none_or(|count| count == positions.len());
    if !same_count(normals.as_ref().map(Vec::len)) || !same_count(uvs.as_ref().map(Vec::len)) {
        return Err(missing("as many entries of NORMAL and TEXCOORD_0 as of POSITION"));
    }
    Ok(TriangleMesh {
        positions,
        normals: normals.map(|all| all.into_iter().map(Vec3::from_array).collect()),
        uvs: uvs.map(|all| all.into_iter().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect()),
        triangles,
    })
}

/// The entries of an accessor, which must be finite.
fn finite<const N: usize>(accessor: &gltf::Accessor<'_>, buffers: &[&[u8]]) -> Result<Vec<[f32; N]>, GltfError> {
    let values = numbers::<N>(accessor, buffers)?;
    match values.iter().position(|value| !value.iter().all(|v| v.is_finite())) {
        None => Ok(values),
        Some(entry) => Err(GltfError(format!("accessor {}: entry {entry} is not finite", accessor.index()))),
    }
}

fn invalid(path: &Path, node: &str, message: String) -> DatasetError {
    let place = if node.is_empty() { String::new() } else { format!("node '{node}'") };
    DatasetError::invalid(path, "bad_geometry", place, message, "fetch or build the dataset again")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nodes() -> Vec<GlbNode> {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.1, 1.0 / 3.0, -7.5)],
            normals: Some(vec![Vec3::Z; 4]),
            uvs: Some(vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::new(0.25, 0.75)]),
            triangles: vec![[0, 1, 2], [2, 1, 3]],
        };
        let plain = TriangleMesh { normals: None, uvs: None, ..mesh.clone() };
        vec![GlbNode { name: "a".to_owned(), mesh }, GlbNode { name: "b".to_owned(), mesh: plain }]
    }

    #[test]
    fn round_trip_and_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.glb", "b.glb"].map(|name| folder.path().join(name));
        write(&a, &nodes()).unwrap();
        write(&b, &nodes()).unwrap();
        assert_eq!(read(&a).unwrap(), nodes());
        assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
    }

    /// Readers that look for a material first find one, of no texture.
    #[test]
    fn every_primitive_has_the_plain_material() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        write(&path, &nodes()).unwrap();
        let file = gltf::Gltf::open(&path).unwrap();
        let primitives: Vec<_> = file.meshes().flat_map(|mesh| mesh.primitives()).collect();
        assert_eq!((primitives.len(), file.materials().len()), (2, 1));
        for primitive in primitives {
            assert_eq!(primitive.material().name(), Some("plain"));
            assert!(primitive.material().pbr_metallic_roughness().base_color_texture().is_none());
        }
    }

    #[test]
    fn faults_are_errors_that_name_the_node() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        let mut bad = nodes();
        bad[1].mesh.triangles[0][1] = 9;
        write(&path, &bad).unwrap();
        let text = read(&path).unwrap_err().to_string();
        assert!(text.contains("node 'b'") && text.contains("is 9, expected less than 4"), "{text}");
    }

    #[test]
    fn any_truncation_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        write(&path, &nodes()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(read(&path).is_err(), "{length} of {}", bytes.len());
        }
    }
}
