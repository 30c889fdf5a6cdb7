//! The texels of a map that lookups can reach: those in the bilinear footprint of a place that a triangle of the atlas
//! covers. All others may hold anything.
//!
//! A place reads the texels whose centres are less than one texel away in both directions. A texel is therefore reached
//! if the square of two texels around its centre meets a triangle, however thin that is. Places beside the picture read
//! its border, as lookups do.

use glam::DVec2;
use mateval_scene::TriangleMesh;

use crate::polygon::Polygon;
use crate::texel_set::TexelSet;

/// By how much that square is larger on each side, in texels, for coordinates of up to 1; in proportion beyond. Lookups
/// round to single precision: in the largest map they are off by up to a thousandth of a texel.
pub const REACH_MARGIN: f64 = 1.0 / 64.0;

/// Where a coordinate is at least this, every texel counts as reached: lookups read coordinates beyond 1e9 as 0.
const LARGE_UV: f32 = 1e8;

/// The texels of a map of this size that lookups through the atlas can reach, or more. All of them where the atlas has no
/// uv or a uv that is not finite.
pub(crate) fn reached(atlas: &TriangleMesh, width: usize, height: usize) -> TexelSet {
    let Some(uvs) = &atlas.uvs else { return TexelSet::all(width, height) };
    let mut reach = TexelSet::none(width, height);
    for triangle in &atlas.triangles {
        let corners = triangle.map(|vertex| uvs[vertex as usize]);
        // Written so that NaN is large.
        if !corners.iter().all(|uv| uv.abs().max_element() < LARGE_UV && uv.is_finite()) {
            return TexelSet::all(width, height);
        }
        let largest = corners.iter().fold(1.0, |largest: f32, uv| largest.max(uv.abs().max_element()));
        let scale = DVec2::new(width as f64, height as f64);
        let corners = corners.map(|uv| DVec2::new(f64::from(uv.x), 1.0 - f64::from(uv.y)) * scale);
        add(&mut reach, corners, 1.0 + REACH_MARGIN * f64::from(largest));
    }
    reach
}

/// Adds the texels whose centre is at most `far` from the triangle in both directions. Corners are in texels from the top
/// left.
fn add(reach: &mut TexelSet, corners: [DVec2; 3], far: f64) {
    let (width, height) = (reach.width(), reach.height());
    for y in near(corners.iter().map(|corner| corner.y), far, height) {
        // Everything above the picture reads its first row, everything below its last.
        let top = if y == 0 { f64::NEG_INFINITY } else { y as f64 + 0.5 - far };
        let bottom = if y + 1 == height { f64::INFINITY } else { y as f64 + 0.5 + far };
        // The part within reach of the row is convex, so the columns that it reaches are consecutive.
        let part = Polygon::new(corners).clipped(DVec2::Y, top).clipped(-DVec2::Y, -bottom);
        if part.corners().is_empty() {
            continue;
        }
        let columns = near(part.corners().iter().map(|corner| corner.x), far, width);
        reach.add_run(y * width + columns.start()..y * width + columns.end() + 1);
    }
}

/// The texels along an axis whose centre is at most `far` from the interval that the coordinates span; the nearest one
/// where that lies outside the picture.
fn near(along: impl Iterator<Item = f64>, far: f64, size: usize) -> std::ops::RangeInclusive<usize> {
    let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    let inside = |at: f64| at.clamp(0.0, (size - 1) as f64) as usize;
    inside((low - far - 0.5).ceil())..=inside((high + far - 0.5).floor())
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use mateval_image::{Texels, Texture, Wrap};
    use proptest::prelude::*;

    use super::*;

    fn mesh(uvs: Vec<Vec2>) -> TriangleMesh {
        let triangles = (0..uvs.len() as u32 / 3).map(|at| [3 * at, 3 * at + 1, 3 * at + 2]).collect();
        TriangleMesh { positions: vec![Vec3::ZERO; uvs.len()], normals: None, uvs: Some(uvs), triangles }
    }

    /// A triangle inside four texels' centres reads these four; a point on a centre reads those around it, since a
    /// neighbour of weight zero is read too.
    #[test]
    fn a_footprint_is_at_least_two_by_two_texels() {
        let at = |x: f32, y: f32| Vec2::new(x / 16.0, 1.0 - y / 16.0);
        let texels = |corners: [Vec2; 3]| reached(&mesh(corners.into()), 16, 16).iter().collect::<Vec<_>>();
        let inner = [at(3.7, 5.7), at(4.2, 5.8), at(4.0, 6.2)];
        assert_eq!(texels(inner), [5 * 16 + 3, 5 * 16 + 4, 6 * 16 + 3, 6 * 16 + 4]);
        let rows = |rows: std::ops::RangeInclusive<usize>| rows.flat_map(|y| [3, 4, 5].map(|x| y * 16 + x)).collect();
        let point: Vec<usize> = rows(5..=7);
        assert_eq!(texels([at(4.5, 6.5); 3]), point);
    }

    /// The gap between two charts is not reached, a sliver of no area is.
    #[test]
    fn only_what_lies_near_a_triangle_is_reached() {
        let corner = |x: f32, y: f32| Vec2::new(x / 64.0, 1.0 - y / 64.0);
        let square = |x: f32| {
            let [a, b, c, d] = [[x, 8.0], [x + 8.0, 8.0], [x + 8.0, 16.0], [x, 16.0]].map(|[x, y]| corner(x, y));
            [a, b, c, a, c, d]
        };
        let sliver = [corner(40.0, 40.2), corner(50.0, 40.2), corner(45.0, 40.2)];
        let uvs = [square(8.0).as_slice(), &square(24.0), &sliver].concat();
        let reach = reached(&mesh(uvs), 64, 64);
        let expected = |x: usize, y: usize| {
            let chart = (7..=16).contains(&y) && ((7..=16).contains(&x) || (23..=32).contains(&x));
            chart || ((39..=40).contains(&y) && (39..=50).contains(&x))
        };
        assert!((0..64 * 64).all(|at| reach.holds(at) == expected(at % 64, at / 64)));
    }

    #[test]
    fn without_usable_uv_everything_is_reached() {
        let plain = TriangleMesh { uvs: None, ..mesh(vec![Vec2::ZERO; 3]) };
        assert_eq!(reached(&plain, 8, 8), TexelSet::all(8, 8));
        for extreme in [f32::NAN, f32::INFINITY, -1e9, 1e30] {
            for uv in [Vec2::new(extreme, 0.5), Vec2::new(0.5, extreme)] {
                assert_eq!(reached(&mesh(vec![Vec2::ZERO, uv, Vec2::X]), 8, 8), TexelSet::all(8, 8), "{uv}");
            }
        }
        assert_eq!(reached(&mesh(Vec::new()), 8, 8), TexelSet::none(8, 8));
    }

    proptest! {
        /// No lookup at a place of a triangle notices the texels that are not reached, as the map's own lookups decide.
        #[test]
        fn lookups_read_reached_texels_only(
            uvs in prop::collection::vec((-0.3_f32..=1.3, -0.3_f32..=1.3), 3),
            kind in 0..4,
            size in 3_usize..40,
            weights in prop::collection::vec((0.0_f32..=1.0, 0.0_f32..=1.0), 60),
        ) {
            let mut uvs: Vec<Vec2> = uvs.into_iter().map(Vec2::from).collect();
            match kind {
                // A sliver, a point, and corners on texels' centres.
                0 => uvs[2] = uvs[0].lerp(uvs[1], 0.3),
                1 => uvs = vec![uvs[0]; 3],
                2 => uvs.iter_mut().for_each(|uv| *uv = ((*uv * size as f32).floor() + 0.5) / size as f32),
                _ => {}
            }
            let reach = reached(&mesh(uvs.clone()), size, size);
            let value = |at: usize| if reach.holds(at) { 0.5 } else { f32::NAN };
            let texels = Texels::Grey((0..size * size).map(value).collect());
            let texture = Texture::new(size, size, texels, Wrap::Clamp).unwrap();
            let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
            for (b, c) in corners.into_iter().chain(weights) {
                let (b, c) = if b + c > 1.0 { (1.0 - b, 1.0 - c) } else { (b, c) };
                let uv = uvs[0] * (1.0 - b - c) + uvs[1] * b + uvs[2] * c;
                prop_assert_eq!(texture.sample(uv.to_array()), [0.5; 3]);
            }
        }
    }
}
