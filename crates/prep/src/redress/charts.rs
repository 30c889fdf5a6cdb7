//! The parts of a surface laid out in one texture, in metres: each side of each part's box is a block of texels, in which
//! the part's material continues beyond the part's edges.

use std::collections::BTreeMap;

use glam::{DVec3, Vec2};
use mateval_dataset::{Camera, TriangleMesh};
use mateval_procedural::unfolding::{Chart, PartFrame, Triangle};

/// How far a pixel's content is from the camera, in metres, whose half is a texel.
const NEAR_M: f64 = 1.5;
/// The finest texels, in metres.
const FINEST_M: f64 = 0.0005;
/// The most texels of a texture, gutters and gaps between blocks included.
const MOST_TEXELS: f64 = 4e6;
/// The most texels of a block's side.
const MOST_SIDE: f64 = 8000.0;
/// Texels around a block, for bilinear lookups at its edges.
const GUTTER: f64 = 2.0;

/// What decides where the triangles of a surface go.
pub(super) struct Parts<'a> {
    /// The part of each triangle.
    pub(super) of_triangle: &'a [usize],
    /// Whether each part's material has one value everywhere, so that its triangles need one place of the texture.
    pub(super) is_constant: &'a [bool],
    /// Whether all parts lie in the frame of the whole surface, so that patterns continue across them.
    pub(super) is_one_frame: bool,
    /// Whether patterns stay upright; otherwise they run along the longest side.
    pub(super) is_upright: bool,
    /// The side of a texel, unless a surface needs too many of them.
    pub(super) texel_m: f64,
}

/// The side of a texel, two to a pixel of this camera on what is near.
pub(super) fn texel_of(camera: &Camera) -> f64 {
    (NEAR_M / camera.intrinsics.fx / 2.0).max(FINEST_M)
}

/// A rectangle of texels with the material of one part.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Block {
    pub(super) part: usize,
    /// Whether the grain runs along v.
    pub(super) is_turned: bool,
    /// Where the texture holds it: column and row of the upper left texel.
    pub(super) at: [usize; 2],
    /// Columns and rows.
    pub(super) size: [usize; 2],
    /// Place of the upper left corner of that texel on the unfolded part, in metres.
    corner: [f64; 2],
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    pub(super) blocks: Vec<Block>,
    /// Columns and rows of the texture.
    pub(super) size: [usize; 2],
    pub(super) texel_m: f64,
    /// The vertex of the source that each vertex is a copy of.
    vertices: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    uvs: Vec<Vec2>,
}

impl Block {
    /// The centre of a texel on the unfolded part, and the side of texels, in metres.
    pub(super) fn place(&self, column: usize, row: usize, texel_m: f64) -> [f64; 3] {
        let [u, v] = self.corner;
        [u + (column as f64 + 0.5) * texel_m, v - (row as f64 + 0.5) * texel_m, texel_m]
    }
}

impl Layout {
    pub(super) fn new(mesh: &TriangleMesh, parts: &Parts<'_>) -> Self {
        // The block of each triangle: its part and the side of the part's box.
        let corners: Vec<Triangle> =
            (0..mesh.triangles.len()).map(|at| mesh.corners(at).map(|corner| corner.as_dvec3())).collect();
        let frames = frames(&corners, parts);
        let key = |at: usize| {
            let part = parts.of_triangle[at];
            let frame = frames[part].filter(|_| !parts.is_constant[part]);
            frame.map_or((part, None), |frame| (part, Some(frame.chart(mesh.geometric_normal(at)))))
        };
        let keys: Vec<(usize, Option<Chart>)> = (0..corners.len()).map(key).collect();
        let place = |(part, chart): (usize, Option<Chart>), corner: DVec3| {
            chart.zip(frames[part]).map_or([0.0; 2], |(chart, frame)| frame.place(chart, corner))
        };
        // The extent of every block.
        let mut extents: BTreeMap<(usize, Option<Chart>), [[f64; 2]; 2]> = BTreeMap::new();
        for (key, corners) in keys.iter().zip(&corners) {
            let [least, most] = extents.entry(*key).or_insert([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]]);
            for at in corners.iter().map(|corner| place(*key, *corner)) {
                (0..2).for_each(|axis| least[axis] = least[axis].min(at[axis]));
                (0..2).for_each(|axis| most[axis] = most[axis].max(at[axis]));
            }
        }
        let texel_m = fitting(parts.texel_m, extents.values());
        let turned: Vec<bool> = (0..frames.len()).map(|part| is_turned(part, &frames, &corners, parts)).collect();
        let mut blocks: Vec<Block> =
            extents.iter().map(|(key, extent)| block(*key, *extent, texel_m, &turned)).collect();
        let size = pack(&mut blocks);
        // Vertices: one for each block that uses it.
        let number: BTreeMap<_, usize> = extents.keys().enumerate().map(|(at, key)| (*key, at)).collect();
        let (mut known, mut vertices, mut uvs) = (BTreeMap::new(), Vec::new(), Vec::new());
        let mut laid = |vertex: u32, key: (usize, Option<Chart>)| {
            let at = number[&key];
            *known.entry((vertex, at)).or_insert_with(|| {
                let [u, v] = place(key, mesh.positions[vertex as usize].as_dvec3());
                let Block { at: [column, row], corner, .. } = blocks[at];
                let x = column as f64 + (u - corner[0]) / texel_m;
                let y = row as f64 + (corner[1] - v) / texel_m;
                vertices.push(vertex);
                uvs.push(Vec2::new((x / size[0] as f64) as f32, (1.0 - y / size[1] as f64) as f32));
                vertices.len() as u32 - 1
            })
        };
        let all = mesh.triangles.iter().zip(&keys);
        let triangles = all.map(|(triangle, key)| triangle.map(|vertex| laid(vertex, *key))).collect();
        Self { blocks, size, texel_m, vertices, triangles, uvs }
    }

    /// The mesh with the layout's uv. It has the triangles of the layout's own mesh, and may stand elsewhere.
    pub(super) fn mesh(&self, mesh: &TriangleMesh) -> TriangleMesh {
        fn copied<T: Copy>(all: &[T], vertices: &[u32]) -> Vec<T> {
            vertices.iter().map(|vertex| all[*vertex as usize]).collect()
        }
        TriangleMesh {
            positions: copied(&mesh.positions, &self.vertices),
            normals: mesh.normals.as_ref().map(|normals| copied(normals, &self.vertices)),
            uvs: Some(self.uvs.clone()),
            triangles: self.triangles.clone(),
        }
    }
}

/// The frame of each part; none for parts without an area.
fn frames(corners: &[Triangle], parts: &Parts<'_>) -> Vec<Option<PartFrame>> {
    // Any direction that is parallel to no usual surface decides which side of a box is its front.
    let viewer = DVec3::new(1e4, 2e4, 3e4);
    let frame = |corners: &[Triangle]| PartFrame::new(corners, viewer, DVec3::ZERO);
    let count = parts.is_constant.len();
    if parts.is_one_frame {
        return vec![frame(corners); count];
    }
    let mut of_parts = vec![Vec::new(); count];
    for (part, corners) in parts.of_triangle.iter().zip(corners) {
        of_parts[*part].push(*corners);
    }
    of_parts.iter().map(|corners| frame(corners)).collect()
}

/// Whether a part's grain runs along v: where its triangles, weighted by area, and its box are longer in v.
///
/// Triangles decide for legs that are one part, whose box is as wide as the table.
fn is_turned(part: usize, frames: &[Option<PartFrame>], corners: &[Triangle], parts: &Parts<'_>) -> bool {
    let Some(frame) = frames[part].filter(|_| !parts.is_upright && !parts.is_constant[part]) else { return false };
    let [width, height] = frame.front_size();
    let mut sides = [0.0; 2];
    for (_, [a, b, c]) in parts.of_triangle.iter().zip(corners).filter(|(of, _)| parts.is_one_frame || **of == part) {
        let normal = (*b - *a).cross(*c - *a);
        let chart = frame.chart(normal.normalize_or_zero());
        let [a, b, c] = [a, b, c].map(|corner| frame.place(chart, *corner));
        for (axis, side) in sides.iter_mut().enumerate() {
            let extent = a[axis].max(b[axis]).max(c[axis]) - a[axis].min(b[axis]).min(c[axis]);
            *side += normal.length() * extent;
        }
    }
    sides[1] * height.max(1e-9).sqrt() > sides[0] * width.max(1e-9).sqrt()
}

/// The side of a texel, or that with which all blocks fit where it is larger.
fn fitting<'a>(texel_m: f64, extents: impl Iterator<Item = &'a [[f64; 2]; 2]>) -> f64 {
    let sides = extents.map(|[least, most]| [most[0] - least[0], most[1] - least[1]]);
    let (area, longest) =
        sides.fold((0.0, 0.0), |(area, longest): (f64, f64), [u, v]| (area + u * v, longest.max(u).max(v)));
    texel_m.max((area / MOST_TEXELS).sqrt()).max(longest / MOST_SIDE)
}

fn block((part, _): (usize, Option<Chart>), [least, most]: [[f64; 2]; 2], texel_m: f64, turned: &[bool]) -> Block {
    let side = |axis: usize| ((most[axis] - least[axis]) / texel_m).ceil() as usize + 2 * GUTTER as usize + 1;
    let gutter = (GUTTER + 0.5) * texel_m;
    let corner = [least[0] - gutter, most[1] + gutter];
    Block { part, is_turned: turned[part], at: [0; 2], size: [side(0), side(1)], corner }
}

/// Places the blocks in rows, the highest first. Returns columns and rows of the texture.
fn pack(blocks: &mut [Block]) -> [usize; 2] {
    let area: usize = blocks.iter().map(|block| block.size[0] * block.size[1]).sum();
    let widest = blocks.iter().map(|block| block.size[0]).max().unwrap_or(1);
    let width = widest.max((area as f64).sqrt().ceil() as usize);
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by_key(|at| std::cmp::Reverse(blocks[*at].size[1]));
    let (mut x, mut y, mut bottom) = (0, 0, 0);
    for at in order {
        let block = &mut blocks[at];
        if x + block.size[0] > width {
            (x, y) = (0, bottom);
        }
        block.at = [x, y];
        x += block.size[0];
        bottom = bottom.max(y + block.size[1]);
    }
    [width, bottom.max(1)]
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// A table: a top of 1.2 m x 0.8 m, two legs of 5 cm x 70 cm as one part, and a knob of one value.
    fn table() -> (TriangleMesh, Vec<usize>) {
        let mut mesh = TriangleMesh::default();
        let mut of_triangle = Vec::new();
        let mut quad = |part: usize, corner: Vec3, first: Vec3, second: Vec3| {
            let positions = vec![corner, corner + first, corner + first + second, corner + second];
            let triangles = vec![[0, 1, 2], [0, 2, 3]];
            mesh.append(&TriangleMesh { positions, triangles, ..TriangleMesh::default() });
            of_triangle.extend([part; 2]);
        };
        quad(0, Vec3::new(0.0, 0.7, 0.8), Vec3::X * 1.2, Vec3::Z * -0.8);
        quad(1, Vec3::ZERO, Vec3::X * 0.05, Vec3::Y * 0.7);
        quad(1, Vec3::X * 1.15, Vec3::X * 0.05, Vec3::Y * 0.7);
        quad(2, Vec3::new(0.6, 0.6, 0.0), Vec3::X * 0.02, Vec3::Y * 0.02);
        (mesh, of_triangle)
    }

    #[test]
    fn a_metre_has_as_many_texels_everywhere_and_blocks_do_not_overlap() {
        const TEXEL_M: f64 = 0.002;
        let (mesh, of_triangle) = table();
        let is_constant = [false, false, true];
        let parts = Parts {
            of_triangle: &of_triangle,
            is_constant: &is_constant,
            is_one_frame: false,
            is_upright: false,
            texel_m: TEXEL_M,
        };
        let layout = Layout::new(&mesh, &parts);
        let laid = layout.mesh(&mesh);
        let uvs = laid.uvs.as_ref().unwrap();
        let size = Vec2::new(layout.size[0] as f32, layout.size[1] as f32);
        for (at, part) in of_triangle.iter().enumerate() {
            assert_eq!(laid.corners(at), mesh.corners(at));
            let [a, b, _] = laid.triangles[at].map(|vertex| uvs[vertex as usize] * size);
            let [p, q, _] = laid.corners(at);
            let expected = if is_constant[*part] { 0.0 } else { p.distance(q) / TEXEL_M as f32 };
            assert!((a.distance(b) - expected).abs() < 0.02, "{at}: {} {expected}", a.distance(b));
        }
        let mut owners = vec![0; layout.size[0] * layout.size[1]];
        for Block { at: [x, y], size: [columns, rows], .. } in &layout.blocks {
            for row in *y..y + rows {
                owners[row * layout.size[0]..][*x..x + columns].iter_mut().for_each(|count| *count += 1);
            }
        }
        assert!(owners.iter().all(|count| *count <= 1));
        // The grain of the legs runs upwards though they are farther apart than high.
        let of_part = |part: usize| layout.blocks.iter().find(|block| block.part == part).unwrap();
        assert!(of_part(1).is_turned && !of_part(2).is_turned);
        // The texel that a corner's uv leads to has the corner's place.
        let pixel = uvs[laid.triangles[0][0] as usize] * size;
        let [x, y] = [f64::from(pixel.x), f64::from(size.y - pixel.y)];
        let block = of_part(0);
        let [u, v, _] = block.place(0, 0, TEXEL_M);
        let found = [u + (x - block.at[0] as f64 - 0.5) * TEXEL_M, v - (y - block.at[1] as f64 - 0.5) * TEXEL_M];
        let corners: Vec<Triangle> = (0..8).map(|at| mesh.corners(at).map(|corner| corner.as_dvec3())).collect();
        let frame = frames(&corners, &parts)[0].unwrap();
        let expected = frame.place(Chart::Front, mesh.positions[0].as_dvec3());
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?} {expected:?}");
    }

    #[test]
    fn a_hall_has_coarser_texels() {
        let extents = [[[0.0; 2], [100.0, 40.0]], [[0.0; 2], [1.0, 1.0]]];
        assert!(fitting(0.002, extents.iter()) > 0.03);
        assert_eq!(fitting(0.002, extents[1..].iter()), 0.002);
    }
}
