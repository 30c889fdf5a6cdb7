//! Primitives of meshes as triangles in the space of their node.

use glam::{Vec2, Vec3};
use gltf::Semantic;
use gltf::mesh::Mode;
use mateval_scene::TriangleMesh;
use mateval_scene::gltf_accessor::{floats, floats_or_shares, indices, triangles};
use mateval_scene::gltf_error::GltfError;

use super::error::PrimitiveFault;
use super::omitted::{LEFT_OUT, Omission};
use super::reader::Reader;

impl Reader<'_> {
    /// The triangles of a primitive, with the texture coordinates of one set. Counts them before they are read.
    pub(super) fn primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        uv_set: Option<u32>,
        pointer: &str,
    ) -> Result<TriangleMesh, PrimitiveFault> {
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            return Err(PrimitiveFault::NotASurface);
        }
        let positions = primitive.get(&Semantic::Positions).ok_or(GltfError::Missing { attribute: "POSITION" })?;
        let numbers = primitive.indices();
        let corners = numbers.as_ref().map_or(positions.count(), gltf::Accessor::count);
        self.count(positions.count(), corners, primitive.mode())?;
        self.report_omitted_attributes(primitive, pointer);
        let normals = primitive.get(&Semantic::Normals);
        let uvs = self.uv_accessor(primitive, uv_set, pointer);
        // Counts are compared before anything is read, so that what is read is bounded by what was counted.
        let same = |other: &Option<gltf::Accessor<'_>>| {
            other.as_ref().is_none_or(|accessor| accessor.count() == positions.count())
        };
        if !same(&normals) || !same(&uvs) {
            return Err(GltfError::CountsDiffer.into());
        }
        let mesh = TriangleMesh {
            positions: self.vectors::<3, _>(&positions, Vec3::from_array)?,
            normals: normals.map(|accessor| self.vectors::<3, _>(&accessor, Vec3::from_array)).transpose()?,
            uvs: uvs.map(|accessor| self.uvs(&accessor)).transpose()?,
            triangles: Vec::new(),
        };
        let vertices = mesh.positions.len();
        let numbers = match numbers {
            Some(accessor) => indices(&accessor, self.buffer(&accessor)?)?,
            None => (0..vertices as u32).collect(),
        };
        Ok(TriangleMesh { triangles: triangles(listed(numbers, primitive.mode()), vertices)?, ..mesh })
    }

    /// Adds to the counts of vertices and triangles. Fails, without adding, where they would exceed the limits.
    fn count(&mut self, vertices: usize, corners: usize, mode: Mode) -> Result<(), PrimitiveFault> {
        let triangles = if mode == Mode::Triangles { corners / 3 } else { corners };
        let (all_vertices, all_triangles) =
            (self.vertices.saturating_add(vertices), self.triangles.saturating_add(triangles));
        if all_vertices > self.limits.vertices || all_triangles > self.limits.triangles {
            return Err(PrimitiveFault::TooLarge { triangles: self.limits.triangles, vertices: self.limits.vertices });
        }
        (self.vertices, self.triangles) = (all_vertices, all_triangles);
        Ok(())
    }

    fn buffer(&self, accessor: &gltf::Accessor<'_>) -> Result<&[u8], GltfError> {
        let view = accessor.view().ok_or(GltfError::Sparse)?;
        Ok(&self.buffers[view.buffer().index()])
    }

    fn vectors<const N: usize, V>(
        &self,
        accessor: &gltf::Accessor<'_>,
        from: impl Fn([f32; N]) -> V,
    ) -> Result<Vec<V>, GltfError> {
        Ok(floats::<N>(accessor, self.buffer(accessor)?)?.into_iter().map(from).collect())
    }

    /// The texture coordinates of a set. A material with textures on a primitive without them is reported.
    fn uv_accessor<'p>(
        &mut self,
        primitive: &gltf::Primitive<'p>,
        set: Option<u32>,
        pointer: &str,
    ) -> Option<gltf::Accessor<'p>> {
        let accessor = primitive.get(&Semantic::TexCoords(set.unwrap_or(0)));
        if accessor.is_none() && set.is_some() {
            let feature = "textures of a primitive without their texture coordinates";
            self.omit(Omission::Visible, feature, "looked them up at one point", pointer);
        }
        accessor
    }

    /// Texture coordinates with v upwards.
    fn uvs(&self, accessor: &gltf::Accessor<'_>) -> Result<Vec<Vec2>, GltfError> {
        let uvs = floats_or_shares::<2>(accessor, self.buffer(accessor)?)?;
        Ok(uvs.into_iter().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect())
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
pub(super) fn flat_shaded(mesh: &TriangleMesh) -> TriangleMesh {
    let corners: Vec<usize> = mesh.triangles.as_flattened().iter().map(|vertex| *vertex as usize).collect();
    let normal = |at: usize| mesh.geometric_normal(at / 3).as_vec3();
    TriangleMesh {
        positions: corners.iter().map(|vertex| mesh.positions[*vertex]).collect(),
        normals: Some((0..corners.len()).map(normal).collect()),
        uvs: mesh.uvs.as_ref().map(|uvs| corners.iter().map(|vertex| uvs[*vertex]).collect()),
        triangles: (0..mesh.triangles.len() as u32).map(|at| [3 * at, 3 * at + 1, 3 * at + 2]).collect(),
    }
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
