//! Primitives of meshes as triangles in the space of their node.

use glam::{Vec2, Vec3};
use gltf::Semantic;
use gltf::mesh::Mode;
use mateval_scene::TriangleMesh;
use mateval_scene::gltf_accessor::{indices, numbers};
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
        let positions = numbers::<3>(&positions, self.buffers)?.into_iter().map(Vec3::from_array).collect();
        let normals = normals.map(|accessor| numbers::<3>(&accessor, self.buffers)).transpose()?;
        let uvs = uvs.map(|accessor| numbers::<2>(&accessor, self.buffers)).transpose()?;
        let mesh = TriangleMesh {
            positions,
            normals: normals.map(|all| all.into_iter().map(Vec3::from_array).collect()),
            // v upwards.
            uvs: uvs.map(|all| all.into_iter().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect()),
            triangles: Vec::new(),
        };
        let vertices = mesh.positions.len();
        let numbers = match corner_numbers {
            Some(accessor) => indices(&accessor, self.buffers)?,
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
