//! The atlas of an instance, as triangles over texels: which part of each texel a triangle covers, and which texels
//! lookups through the triangles can reach.

use std::sync::OnceLock;

use fixedbitset::FixedBitSet;
use glam::{DVec2, DVec3};
use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::{DatasetError, TriangleMesh, reference};

/// By how much the square of texels that a place reads is larger on each side, in texels, for coordinates of up to 1;
/// in proportion beyond. Lookups round to single precision: in the largest map they are off by up to a thousandth of a
/// texel.
pub const REACH_MARGIN: f64 = 1.0 / 64.0;

/// Where a coordinate is at least this, every texel counts as reached: lookups read coordinates beyond 1e9 as 0.
const LARGE_UV: f32 = 1e8;

/// The atlas meshes of one scene, one for each instance in the order of `scene.json`. Their uv say which texels of a
/// map are looked up. Only a map with bad texels needs them, so they are read when the first one asks.
pub struct AtlasMeshes<'a> {
    source: Source<'a>,
    read: OnceLock<Vec<TriangleMesh>>,
}

enum Source<'a> {
    Dataset(&'a Dataset, &'a SceneFile),
    Memory(&'a [TriangleMesh]),
}

impl<'a> AtlasMeshes<'a> {
    /// The meshes of a scene of a dataset, which are read when they are first asked for.
    pub fn on_demand(dataset: &'a Dataset, scene: &'a SceneFile) -> Self {
        Self { source: Source::Dataset(dataset, scene), read: OnceLock::new() }
    }

    pub fn in_memory(meshes: &'a [TriangleMesh]) -> Self {
        Self { source: Source::Memory(meshes), read: OnceLock::new() }
    }

    /// The mesh of an instance, by its place in `scene.json`; panics where there is no such instance. Fails where
    /// `instances.glb` cannot be read, differs from the manifest or does not fit `scene.json`.
    pub fn mesh(&self, instance: usize) -> Result<&TriangleMesh, DatasetError> {
        match self.source {
            Source::Memory(meshes) => Ok(&meshes[instance]),
            Source::Dataset(dataset, scene) => {
                if let Some(meshes) = self.read.get() {
                    return Ok(&meshes[instance]);
                }
                let meshes = read(dataset, scene)?;
                // Of two threads that read them at the same time the first wins; both have read the same.
                Ok(&self.read.get_or_init(|| meshes)[instance])
            }
        }
    }
}

fn read(dataset: &Dataset, scene: &SceneFile) -> Result<Vec<TriangleMesh>, DatasetError> {
    // They decide what a bad texel scores, so they must be those that the dataset's fingerprint covers.
    dataset.check_files(&scene.id, |file| file == "geometry/instances.glb")?;
    let instances = reference::read_plain(&dataset.folder(&scene.id), scene)?;
    Ok(instances.surfaces.into_iter().map(|surface| surface.mesh).collect())
}

/// The part of a triangle inside a texel's square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    pub(crate) column: usize,
    pub(crate) triangle: usize,
    /// Texels, above 0 and at most 1.
    pub(crate) area: f64,
    /// Its centroid, in texels from the top left.
    pub(crate) centroid: DVec2,
}

/// The triangles of an atlas by the rows of texels that they reach. It yields the exact area of each texel that a
/// triangle covers, by clipping the triangle to the texel's square.
///
/// Counting the texels whose centre lies inside would be wrong: packers put the edges of charts on texel centres, so
/// that a chart of 2 by 5 texels holds 3 by 6 of them.
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
            for row in spanned(corners.map(|corner| corner.y), size) {
                rows[row].push(triangle as u32);
            }
        }
        Self { size, corners, rows }
    }

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
            for column in spanned(slab.corners().iter().map(|corner| corner.x), self.size) {
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
fn spanned(along: impl IntoIterator<Item = f64>, size: usize) -> std::ops::Range<usize> {
    let (low, high) =
        along.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    let first = low.floor().clamp(0.0, size as f64) as usize;
    first..(high.ceil().clamp(0.0, size as f64) as usize).max(first)
}

/// The texels of a map of this size that lookups through the atlas can reach, or a few more: those in the bilinear
/// footprint of a place that a triangle covers. All others may hold anything. All of them where the atlas has no uv or
/// a uv that is not finite.
///
/// A place reads the texels whose centres are less than one texel away in both directions. A texel is therefore reached
/// if the square of two texels around its centre meets a triangle, however thin that is. Places beside the picture read
/// its border, as lookups do.
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
        add_near(&mut reach, corners, 1.0 + REACH_MARGIN * f64::from(largest));
    }
    reach
}

/// Adds the texels whose centre is at most `far` from the triangle in both directions. Corners are in texels from the
/// top left.
fn add_near(reach: &mut TexelSet, corners: [DVec2; 3], far: f64) {
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
        reach.texels.insert_range(y * width + columns.start()..y * width + columns.end() + 1);
    }
}

/// The texels along an axis whose centre is at most `far` from the interval that the coordinates span; the nearest one
/// where that lies outside the picture.
fn near(along: impl Iterator<Item = f64>, far: f64, size: usize) -> std::ops::RangeInclusive<usize> {
    let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    let inside = |at: f64| at.clamp(0.0, (size - 1) as f64) as usize;
    inside((low - far - 0.5).ceil())..=inside((high + far - 0.5).floor())
}

/// A set of texels of a map, by their numbers row by row from the top left; one bit each: the largest map takes 2 MiB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TexelSet {
    width: usize,
    height: usize,
    pub(crate) texels: FixedBitSet,
}

impl TexelSet {
    pub(crate) fn none(width: usize, height: usize) -> Self {
        Self { width, height, texels: FixedBitSet::with_capacity(width * height) }
    }

    pub(crate) fn all(width: usize, height: usize) -> Self {
        let mut all = Self::none(width, height);
        all.texels.insert_range(..);
        all
    }

    pub(crate) fn width(&self) -> usize {
        self.width
    }

    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// The up to eight texels of the map around texel `at`, in order.
    pub(crate) fn neighbours(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.height);
        let (x, y) = (at % width, at / width);
        let around = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
        let rows = around(y, height);
        rows.flat_map(move |y| around(x, width).map(move |x| y * width + x)).filter(move |other| *other != at)
    }
}

/// A triangle clipped by at most four lines.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec2; 8],
    count: usize,
}

impl Polygon {
    fn new([a, b, c]: [DVec2; 3]) -> Self {
        let mut polygon = Self { corners: [DVec2::ZERO; 8], count: 0 };
        [a, b, c].into_iter().for_each(|corner| polygon.push(corner));
        polygon
    }

    /// Its corners in order; absent if everything was cut off.
    fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    fn push(&mut self, corner: DVec2) {
        self.corners[self.count] = corner;
        self.count += 1;
    }

    /// The part whose dot product with `axis` (along x or y, of either sign) is at least `least` (Sutherland and
    /// Hodgman, 1974). New corners lie exactly on the line.
    fn clipped(&self, axis: DVec2, least: f64) -> Self {
        let mut clipped = Self { corners: [DVec2::ZERO; 8], count: 0 };
        for (at, corner) in self.corners().iter().enumerate() {
            let next = self.corners[(at + 1) % self.count];
            let (height, next_height) = (corner.dot(axis) - least, next.dot(axis) - least);
            if height >= 0.0 {
                clipped.push(*corner);
            }
            if (height > 0.0 && next_height < 0.0) || (height < 0.0 && next_height > 0.0) {
                let cut = *corner + (next - *corner) * (height / (height - next_height));
                let on_line = axis * least;
                clipped.push(if axis.x == 0.0 { DVec2::new(cut.x, on_line.y) } else { DVec2::new(on_line.x, cut.y) });
            }
        }
        clipped
    }

    /// Area and centroid; no area for less than three corners.
    fn measured(&self) -> (f64, DVec2) {
        let Some((first, others)) = self.corners().split_first() else { return (0.0, DVec2::ZERO) };
        let (mut twice, mut moment) = (0.0, DVec2::ZERO);
        for pair in others.windows(2) {
            let (b, c) = (pair[0] - *first, pair[1] - *first);
            twice += b.perp_dot(c);
            moment += (b + c) * b.perp_dot(c);
        }
        if twice == 0.0 { (0.0, *first) } else { (twice.abs() / 2.0, *first + moment / (3.0 * twice)) }
    }
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

    /// A triangle inside four texels' centres reads these four; a point on a centre reads those around it, since a
    /// neighbour of weight zero is read too.
    #[test]
    fn a_footprint_is_at_least_two_by_two_texels() {
        let at = |x: f32, y: f32| Vec2::new(x / 16.0, 1.0 - y / 16.0);
        let texels = |corners: [Vec2; 3]| reached(&mesh(corners.into()), 16, 16).texels.ones().collect::<Vec<_>>();
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
        assert!((0..64 * 64).all(|at| reach.texels.contains(at) == expected(at % 64, at / 64)));
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
            let value = |at: usize| if reach.texels.contains(at) { 0.5 } else { f32::NAN };
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

    #[test]
    fn neighbours_end_at_the_border() {
        let set = TexelSet::none(4, 3);
        let around = |at: usize| set.neighbours(at).collect::<Vec<_>>();
        assert_eq!(around(0), [1, 4, 5]);
        assert_eq!(around(5), [0, 1, 2, 4, 6, 8, 9, 10]);
        assert_eq!(around(11), [6, 7, 10]);
        assert_eq!(TexelSet::none(1, 1).neighbours(0).count(), 0);
    }
}
