//! The exact area of each texel of an atlas that a triangle covers, by clipping the triangle to the texel's square.
//!
//! Counting the texels whose centre lies inside would be wrong: packers put the edges of charts on texel centres, so
//! that a chart of 2 by 5 texels holds 3 by 6 of them.

use glam::{DVec2, DVec3};
use mateval_scene::TriangleMesh;

use crate::polygon::Polygon;

/// The part of a triangle inside a texel's square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    /// The texel's column.
    pub(crate) column: usize,
    /// The triangle.
    pub(crate) triangle: usize,
    /// Texels, above 0 and at most 1.
    pub(crate) area: f64,
    /// Its centroid, in texels from the top left.
    pub(crate) centroid: DVec2,
}

/// The triangles of an atlas by the rows of texels that they reach.
pub(crate) struct Coverage {
    size: usize,
    /// In texels from the top left.
    corners: Vec<[DVec2; 3]>,
    rows: Vec<Vec<u32>>,
}

impl Coverage {
    /// For an atlas of `size` texels a side. A triangle without area in the atlas, a mesh without uv and anything
    /// outside the atlas cover nothing.
    pub(crate) fn new(atlas: &TriangleMesh, size: usize) -> Self {
        let uvs = atlas.uvs.as_deref().unwrap_or_default();
        let texel = |vertex: u32| {
            let uv = uvs[vertex as usize].as_dvec2();
            DVec2::new(uv.x, 1.0 - uv.y) * size as f64
        };
        let mapped = if uvs.is_empty() { &[] } else { atlas.triangles.as_slice() };
        let corners: Vec<[DVec2; 3]> = mapped.iter().map(|triangle| triangle.map(texel)).collect();
        let mut rows = vec![Vec::new(); size];
        for (triangle, corners) in corners.iter().enumerate().filter(|(_, corners)| twice_area(**corners) != 0.0) {
            for row in reached(corners.map(|corner| corner.y), size) {
                rows[row].push(triangle as u32);
            }
        }
        Self { size, corners, rows }
    }

    /// The triangle's area in texels.
    pub(crate) fn area(&self, triangle: usize) -> f64 {
        self.corners.get(triangle).map_or(0.0, |corners| twice_area(*corners).abs() / 2.0)
    }

    /// Barycentric weights of a place (in texels from the top left) with respect to a triangle that has an area.
    pub(crate) fn barycentrics(&self, triangle: usize, place: DVec2) -> DVec3 {
        let [a, b, c] = self.corners[triangle];
        let area = (b - a).perp_dot(c - a);
        let (second, third) = ((place - a).perp_dot(c - a) / area, (b - a).perp_dot(place - a) / area);
        DVec3::new(1.0 - second - third, second, third)
    }

    /// Calls `visit` with every part of the texels of row `y`, triangle by triangle.
    pub(crate) fn visit_row(&self, y: usize, mut visit: impl FnMut(Part)) {
        let (top, bottom) = (y as f64, y as f64 + 1.0);
        for triangle in self.rows[y].iter().map(|triangle| *triangle as usize) {
            let slab = Polygon::new(self.corners[triangle]).clipped(DVec2::Y, top).clipped(-DVec2::Y, -bottom);
            let whole = self.whole_columns(&slab, top, bottom);
            for column in reached(slab.corners().iter().map(|corner| corner.x), self.size) {
                let left = column as f64;
                if whole.contains(&column) {
                    visit(Part { column, triangle, area: 1.0, centroid: DVec2::new(left, top) + 0.5 });
                    continue;
                }
                let (area, centroid) = slab.clipped(DVec2::X, left).clipped(-DVec2::X, -(left + 1.0)).measured();
                if area > 0.0 {
                    // Rounding may put the centroid of a sliver beside the texel.
                    let centroid = centroid.clamp(DVec2::new(left, top), DVec2::new(left + 1.0, bottom));
                    visit(Part { column, triangle, area, centroid });
                }
            }
        }
    }

    /// The columns whose texel in the row is fully covered by the slab: those that lie inside it at both the top and
    /// the bottom.
    fn whole_columns(&self, slab: &Polygon, top: f64, bottom: f64) -> std::ops::Range<usize> {
        let (mut low, mut high) = (0.0_f64, self.size as f64);
        for line in [top, bottom] {
            let on_line = || slab.corners().iter().filter(|corner| corner.y == line).map(|corner| corner.x);
            low = low.max(on_line().fold(f64::INFINITY, f64::min));
            high = high.min(on_line().fold(f64::NEG_INFINITY, f64::max));
        }
        if low < high { low.ceil() as usize..high.floor() as usize } else { 0..0 }
    }
}

fn twice_area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// The texels along an axis from the least to the largest of some coordinates.
fn reached(along: impl IntoIterator<Item = f64>, size: usize) -> std::ops::Range<usize> {
    let (low, high) =
        along.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    let first = low.floor().clamp(0.0, size as f64) as usize;
    first..(high.ceil().clamp(0.0, size as f64) as usize).max(first)
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use proptest::prelude::*;

    use super::*;

    fn mesh(uvs: Vec<Vec2>) -> TriangleMesh {
        let triangles = (0..uvs.len() as u32 / 3).map(|at| [3 * at, 3 * at + 1, 3 * at + 2]).collect();
        TriangleMesh { positions: vec![Vec3::ZERO; uvs.len()], normals: None, uvs: Some(uvs), triangles }
    }

    fn parts(coverage: &Coverage, size: usize) -> Vec<(usize, Part)> {
        let mut all = Vec::new();
        (0..size).for_each(|y| coverage.visit_row(y, |part| all.push((y, part))));
        all
    }

    /// A chart of two by five texels with its edges on texel centres: whole texels inside, halves along the edges,
    /// quarters in the corners, 3 by 6 texels together.
    #[test]
    fn a_chart_whose_edges_lie_on_centres() {
        let corner = |x: f32, y: f32| Vec2::new((2.5 + x) / 16.0, 1.0 - (3.5 + y) / 16.0);
        let [a, b, c, d] = [corner(0.0, 0.0), corner(2.0, 0.0), corner(2.0, 5.0), corner(0.0, 5.0)];
        let mut area = [[0.0; 16]; 16];
        for (y, part) in parts(&Coverage::new(&mesh(vec![a, b, c, a, c, d]), 16), 16) {
            area[y][part.column] += part.area;
        }
        let along = |at: usize, low: usize, high: usize| match at {
            at if at == low || at == high => 0.5,
            at if at > low && at < high => 1.0,
            _ => 0.0,
        };
        for (y, row) in area.iter().enumerate() {
            for (x, area) in row.iter().enumerate() {
                assert!((area - along(x, 2, 4) * along(y, 3, 8)).abs() < 1e-12, "({x}, {y}): {area}");
            }
        }
        assert_eq!(area.as_flattened().iter().filter(|area| **area > 0.0).count(), 18);
    }

    proptest! {
        /// Areas and moments of the parts add up to those of the triangle, and each part lies in its texel.
        #[test]
        fn parts_are_the_whole(uvs in prop::collection::vec((0.0_f32..=1.0, 0.0_f32..=1.0), 3), thin in any::<bool>()) {
            let mut uvs: Vec<Vec2> = uvs.into_iter().map(Vec2::from).collect();
            if thin {
                uvs[2] = uvs[0].lerp(uvs[1], 0.3) + Vec2::splat(1e-4).min(1.0 - uvs[0]);
            }
            let coverage = Coverage::new(&mesh(uvs), 24);
            let parts = parts(&coverage, 24);
            let area: f64 = parts.iter().map(|(_, part)| part.area).sum();
            prop_assert!((area - coverage.area(0)).abs() < 1e-9, "{} {}", area, coverage.area(0));
            let moment: DVec2 = parts.iter().map(|(_, part)| part.centroid * part.area).sum();
            let middle = coverage.corners[0].iter().sum::<DVec2>() / 3.0;
            prop_assert!((moment - middle * area).length() < 1e-6);
            for (y, part) in &parts {
                let corner = DVec2::new(part.column as f64, *y as f64);
                prop_assert!(part.area <= 1.0 + 1e-12);
                prop_assert!((part.centroid - corner - 0.5).abs().max_element() <= 0.5 + 1e-6);
            }
        }
    }

    #[test]
    fn extreme_uv_do_not_panic() {
        for extreme in [Vec2::splat(-3.0), Vec2::splat(1e9), Vec2::splat(-1e30), Vec2::splat(0.5)] {
            let coverage = Coverage::new(&mesh(vec![extreme, Vec2::new(0.2, 0.7), Vec2::new(0.9, 0.1)]), 8);
            assert!(parts(&coverage, 8).iter().all(|(_, part)| part.area <= 1.0 + 1e-9 && part.column < 8));
        }
        let plain = TriangleMesh { uvs: None, ..mesh(vec![Vec2::ZERO; 3]) };
        assert!(parts(&Coverage::new(&plain, 8), 8).is_empty());
        assert!(parts(&Coverage::new(&mesh(vec![Vec2::splat(0.4); 3]), 8), 8).is_empty());
    }
}
