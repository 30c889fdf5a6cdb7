//! Unwraps meshes into uv atlases without overlaps.
//!
//! In: a shape, and its copies in a scene, each with a wanted size. Out: each copy with its atlas. Between: [`cache`] knows
//! the layouts of earlier builds; where it does not, uvunwrap cuts the shape into charts and packs them into a square. A
//! layout is apart from the shape's place in a scene, and is carried to the copies.

pub mod cache;

use glam::Vec2;
use mateval_scene::TriangleMesh;
use serde::{Deserialize, Serialize};
use uvunwrap::{Density, MeshInput, Options, Packing};

use cache::{AtlasCache, ShapeKey};

/// A mesh that is to be unwrapped.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    pub mesh: &'a TriangleMesh,
    pub size: SizeWish,
}

pub fn unwrap(mesh: &TriangleMesh, size: SizeWish) -> Result<Unwrapped, AtlasError> {
    unwrap_copies(mesh, &[Wanted { mesh, size }], None).remove(0)
}

/// Unwraps copies of a shape: meshes with its triangles and the same lengths, which may stand anywhere. A layout is made
/// only where the cache does not hold it.
pub fn unwrap_copies(
    shape: &TriangleMesh,
    copies: &[Wanted<'_>],
    cache: Option<&AtlasCache>,
) -> Vec<Result<Unwrapped, AtlasError>> {
    let cache = cache.map(|cache| (cache, ShapeKey::of(shape)));
    let unwrap_copy = |copy: &Wanted<'_>| {
        let known = cache.as_ref().and_then(|(cache, key)| cache.read(key, copy.size, shape));
        let layout = known.unwrap_or_else(|| {
            let made = packed(shape, copy.size);
            if let Some((cache, key)) = &cache {
                cache.keep(key, copy.size, &made);
            }
            made
        })?;
        Ok(layout.unwrapped(copy.mesh))
    };
    copies.iter().map(unwrap_copy).collect()
}

/// Texels between two charts, at the final size of the atlas.
pub const GUTTER: u32 = 4;
/// Least and most texels a side of an atlas whose size is chosen.
pub const CHOSEN_SIZES: (u32, u32) = (256, 4096);
/// The share of a square that charts never exceed in practice; it decides only where the search for a size begins.
const MOST_COVERAGE: f64 = 0.9;

/// The largest number of texels a metre, in medians of the surface, that a triangle may have.
const MOST_STRETCH: f64 = 8.0;

/// The wanted size of an atlas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SizeWish {
    /// Texels a side. If the charts do not fit, the least power of two within [`CHOSEN_SIZES`] that they fit
    /// into.
    Fixed(u32),
    /// The least power of two within [`CHOSEN_SIZES`] at which a texel's side on the surface is at most this
    /// long, in metres; the largest one if none is fine enough.
    Texel(f64),
}

impl SizeWish {
    /// Whether an atlas of this size can have been made for the wish.
    pub(super) fn allows(self, size: u32) -> bool {
        let (least, most) = CHOSEN_SIZES;
        self == Self::Fixed(size) || (least..=most).contains(&size) && size.is_power_of_two()
    }

    /// The wish as text that no other wish has.
    pub(super) fn key(self) -> String {
        match self {
            Self::Fixed(size) => format!("{size} texels"),
            Self::Texel(texel_m) => format!("texels of {:016x}", texel_m.to_bits()),
        }
    }
}

/// Why a mesh has no atlas.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum AtlasError {
    #[error("no triangle has an area")]
    NoArea,
    #[error("its {charts} charts do not fit into {size}x{size} texels with gutters of {GUTTER}")]
    DoesNotFit { charts: u32, size: u32 },
    #[error("the mesh cannot be unwrapped: {0}")]
    Refused(String),
}

/// The mesh in an atlas of the wanted size.
pub(super) fn packed(mesh: &TriangleMesh, wish: SizeWish) -> Result<AtlasLayout, AtlasError> {
    let (least, most) = CHOSEN_SIZES;
    let area = mesh.area();
    if !(area > 0.0 && area.is_finite()) {
        return Err(AtlasError::NoArea);
    }
    let texel_m = match wish {
        SizeWish::Texel(texel_m) => texel_m,
        SizeWish::Fixed(size) => match pack(mesh, size) {
            Err(AtlasError::DoesNotFit { .. }) => f64::INFINITY,
            packed => return packed,
        },
    };
    // The search starts at the side of a square that the charts would fill up to `MOST_COVERAGE`.
    let mut size = ((area / MOST_COVERAGE).sqrt() / texel_m).clamp(f64::from(least), f64::from(most)) as u32;
    size = size.next_power_of_two();
    loop {
        match pack(mesh, size) {
            Ok(layout) if layout.texel_m(area) <= texel_m || size >= most => return Ok(layout),
            Err(AtlasError::DoesNotFit { .. }) if size < most => {}
            Ok(_) => {}
            Err(error) => return Err(error),
        }
        size *= 2;
    }
}

/// The mesh in an atlas of this size, as finely as its charts fit. Triangles that would take far more texels than their
/// area calls for are cut out and placed on one point: a single degenerate one can fill an atlas.
fn pack(mesh: &TriangleMesh, size: u32) -> Result<AtlasLayout, AtlasError> {
    let layout = pack_kept(mesh, size, |_| true)?;
    let stretched = stretched(mesh, &layout);
    if !stretched.contains(&true) {
        return Ok(layout);
    }
    let mut kept = pack_kept(mesh, size, |triangle| !stretched[triangle])?;
    // The others return to their places in the list.
    let point = kept.uvs.first().copied().unwrap_or([0.0, 1.0]);
    let mut triangles = std::mem::take(&mut kept.triangles).into_iter();
    for (triangle, is_cut) in mesh.triangles.iter().zip(&stretched) {
        let placed = if *is_cut {
            triangle.map(|vertex| {
                kept.source_vertices.push(vertex);
                kept.uvs.push(point);
                kept.uvs.len() as u32 - 1
            })
        } else {
            // As many were packed as were kept.
            triangles.next().unwrap_or_default()
        };
        kept.triangles.push(placed);
    }
    kept.unmapped += stretched.iter().filter(|is_cut| **is_cut).count();
    Ok(kept)
}

/// For each triangle, whether it takes more than a texel and over [`MOST_STRETCH`] times as many texels a metre as the
/// median of the surface.
fn stretched(mesh: &TriangleMesh, layout: &AtlasLayout) -> Vec<bool> {
    let texels = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| layout.uvs[vertex as usize].map(f64::from));
        let twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        twice.abs() / 2.0 * f64::from(layout.size) * f64::from(layout.size)
    };
    let area = |triangle: usize| {
        let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).length() / 2.0
    };
    let all: Vec<(f64, f64)> = layout.triangles.iter().enumerate().map(|(at, t)| (texels(t), area(at))).collect();
    // Squares of texels a metre; the median by area, so that many tiny triangles do not count more than a large one.
    let mut densities: Vec<(f64, f64)> =
        all.iter().filter(|(_, area)| *area > 0.0).map(|(texels, area)| (texels / area, *area)).collect();
    densities.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = densities.iter().map(|(_, area)| area).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    let median = densities.iter().find(|(_, area)| {
        sum += area;
        sum >= half
    });
    let Some((median, _)) = median else { return vec![false; all.len()] };
    let most = median * MOST_STRETCH * MOST_STRETCH;
    all.iter().map(|(texels, area)| *texels > 1.0 && *texels > most * area).collect()
}

/// The triangles that `is_kept` accepts in an atlas of this size.
///
/// Charts are folded into rows, which takes milliseconds for thousands of charts. Nesting them into each other's
/// concavities makes texels a tenth shorter and takes up to half a minute.
fn pack_kept(mesh: &TriangleMesh, size: u32, is_kept: impl Fn(usize) -> bool) -> Result<AtlasLayout, AtlasError> {
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|position| position.to_array()).collect();
    let kept = mesh.triangles.iter().enumerate().filter(|(at, _)| is_kept(*at));
    let triangles: Vec<[u32; 3]> = kept.map(|(_, triangle)| *triangle).collect();
    let input = MeshInput::new(&positions, triangles.as_flattened());
    let options = Options {
        density: Density::Auto { page_size: size },
        // Kept free around every chart, so that two charts are twice as far apart.
        padding: GUTTER / 2,
        packing: Packing::Fast,
        ..Options::default()
    };
    let does_not_fit = |charts| AtlasError::DoesNotFit { charts, size };
    let atlas = uvunwrap::generate(&[input], &options).map_err(|error| match error {
        uvunwrap::Error::ChartTooLarge { .. } | uvunwrap::Error::AtlasTooLarge { .. } => does_not_fit(1),
        error => AtlasError::Refused(error.to_string()),
    })?;
    if atlas.chart_count == 0 {
        return Err(AtlasError::NoArea);
    }
    if atlas.page_count > 1 {
        return Err(does_not_fit(atlas.chart_count));
    }
    let unwrapped = &atlas.meshes[0];
    // The page is cropped to its used rows. Ours is the whole square, with v upwards.
    let texels = [atlas.width as f32, atlas.height as f32].map(|side| side / size as f32);
    let mut layout = AtlasLayout {
        size,
        charts: atlas.chart_count,
        unmapped: 0,
        triangles: unwrapped.indices.as_chunks::<3>().0.to_vec(),
        source_vertices: unwrapped.vertices.iter().map(|vertex| vertex.xref).collect(),
        uvs: unwrapped
            .vertices
            .iter()
            .map(|vertex| [vertex.uv[0] * texels[0], 1.0 - vertex.uv[1] * texels[1]])
            .collect(),
    };
    let has_chart: Vec<bool> = unwrapped.vertices.iter().map(|vertex| vertex.chart.is_some()).collect();
    place_unmapped(&mut layout, &has_chart);
    Ok(layout)
}

/// Moves vertices without a chart, those of triangles whose area is negligible, to the first vertex that has one. Counts
/// the triangles whose corners are at one point.
fn place_unmapped(layout: &mut AtlasLayout, has_chart: &[bool]) {
    let first = has_chart.iter().position(|has| *has).map_or([0.0, 1.0], |vertex| layout.uvs[vertex]);
    for (vertex, _) in has_chart.iter().enumerate().filter(|(_, has)| !**has) {
        layout.uvs[vertex] = first;
    }
    let at_one_place = |triangle: &&[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| layout.uvs[vertex as usize]);
        a == b && b == c
    };
    layout.unmapped = layout.triangles.iter().filter(at_one_place).count();
}

/// The charts of a shape, packed into a square. It holds for every mesh with the same triangles whose sides have the same
/// lengths, wherever it stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct AtlasLayout {
    /// Texels a side.
    pub(super) size: u32,
    pub(super) charts: u32,
    /// Number of triangles without a chart, since their area is negligible.
    pub(super) unmapped: usize,
    /// The same triangles in the same order. Vertices are split at the borders of charts.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The shape's vertex of each vertex.
    source_vertices: Vec<u32>,
    /// The place of each vertex, 0 to 1, v upwards.
    pub(super) uvs: Vec<[f32; 2]>,
}

/// A mesh with its atlas.
#[derive(Clone, Debug)]
pub struct Unwrapped {
    /// The same triangles in the same order. Vertices are split at the borders of charts; `uvs` are those of the atlas.
    pub mesh: TriangleMesh,
    /// Texels a side.
    pub size: u32,
    pub charts: u32,
    /// Share of the square that triangles cover, 0 to 1.
    pub coverage: f64,
    /// Length of a texel's side on the surface in metres, averaged over the area.
    pub texel_m: f64,
    /// Number of triangles without a chart, since their area is negligible. All three corners of each lie on one point of
    /// another chart.
    pub unmapped: usize,
}

impl AtlasLayout {
    /// Whether the layout has the mesh's triangles in their order, and places each vertex in the square.
    pub(super) fn belongs_to(&self, mesh: &TriangleMesh) -> bool {
        let source = |vertex: u32| self.source_vertices.get(vertex as usize).copied();
        let is_same = |(own, of_mesh): (&[u32; 3], &[u32; 3])| own.map(source) == of_mesh.map(Some);
        self.uvs.len() == self.source_vertices.len()
            && self.uvs.iter().flatten().all(|value| (0.0..=1.0).contains(value))
            && self.triangles.len() == mesh.triangles.len()
            && self.triangles.iter().zip(&mesh.triangles).all(is_same)
    }

    /// Share of the square that triangles cover, 0 to 1.
    pub(super) fn coverage(&self) -> f64 {
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|vertex| Vec2::from_array(self.uvs[vertex as usize]).as_dvec2());
            ((b - a).perp_dot(c - a) / 2.0).abs()
        };
        self.triangles.iter().map(area).sum()
    }

    /// Length of a texel's side on a mesh of this area, in metres.
    pub(super) fn texel_m(&self, area: f64) -> f64 {
        (area / (self.coverage() * f64::from(self.size) * f64::from(self.size))).sqrt()
    }

    /// The mesh, which has the shape's triangles, with this atlas.
    pub(super) fn unwrapped(&self, mesh: &TriangleMesh) -> Unwrapped {
        let pick = |from: &[glam::Vec3]| self.source_vertices.iter().map(|v| from[*v as usize]).collect::<Vec<_>>();
        Unwrapped {
            mesh: TriangleMesh {
                positions: pick(&mesh.positions),
                normals: mesh.normals.as_deref().map(pick),
                uvs: Some(self.uvs.iter().copied().map(Vec2::from_array).collect()),
                triangles: self.triangles.clone(),
            },
            size: self.size,
            charts: self.charts,
            coverage: self.coverage(),
            texel_m: self.texel_m(mesh.area()),
            unmapped: self.unmapped,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};
    use proptest::prelude::*;

    use super::*;

    /// A box of the given size with 12 triangles and shared vertices.
    pub(crate) fn cuboid(size: Vec3) -> TriangleMesh {
        let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) * size;
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        TriangleMesh {
            positions: (0..8).map(corner).collect(),
            normals: None,
            uvs: None,
            triangles: quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
        }
    }

    fn texels_of(unwrapped: &Unwrapped, triangle: usize) -> [Vec2; 3] {
        let uvs = unwrapped.mesh.uvs.as_ref().unwrap();
        unwrapped.mesh.triangles[triangle].map(|v| uvs[v as usize] * unwrapped.size as f32)
    }

    #[test]
    fn triangles_keep_their_order_and_place() {
        let mesh = cuboid(Vec3::new(1.0, 0.5, 0.25));
        let unwrapped = unwrap(&mesh, SizeWish::Fixed(256)).unwrap();
        for triangle in 0..12 {
            assert_eq!(unwrapped.mesh.corners(triangle), mesh.corners(triangle));
        }
        assert!(
            unwrapped.mesh.uvs.as_ref().unwrap().iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0)
        );
        assert_eq!(unwrapped.unmapped, 0);
    }

    #[test]
    fn a_chosen_size_is_fine_enough_and_no_finer_than_a_step() {
        let mesh = cuboid(Vec3::new(2.0, 1.0, 1.0));
        for texel_m in [0.05, 0.01, 0.002] {
            let unwrapped = unwrap(&mesh, SizeWish::Texel(texel_m)).unwrap();
            assert!(unwrapped.texel_m <= texel_m * 1.02, "{} for {texel_m}", unwrapped.texel_m);
            assert!(unwrapped.size == 256 || unwrapped.texel_m >= texel_m / 2.5, "{} for {texel_m}", unwrapped.texel_m);
        }
    }

    #[test]
    fn charts_keep_their_distance() {
        let unwrapped = unwrap(&cuboid(Vec3::ONE), SizeWish::Fixed(128)).unwrap();
        let charts = charts_by_uv(&unwrapped);
        let mut least = f32::INFINITY;
        for a in 0..12 {
            for b in 0..a {
                if charts[a] != charts[b] {
                    least = least.min(gap(texels_of(&unwrapped, a), texels_of(&unwrapped, b)));
                }
            }
        }
        assert!(least >= GUTTER as f32 - 0.01 && least.is_finite(), "{least} texels");
    }

    /// Triangles that share a split vertex share a chart.
    fn charts_by_uv(unwrapped: &Unwrapped) -> Vec<usize> {
        let mut chart: Vec<usize> = (0..12).collect();
        for _ in 0..12 {
            for a in 0..12 {
                for b in 0..12 {
                    if unwrapped.mesh.triangles[a].iter().any(|v| unwrapped.mesh.triangles[b].contains(v)) {
                        chart[a] = chart[a].min(chart[b]);
                    }
                }
            }
        }
        chart
    }

    /// The least distance between the edges of two triangles, by sampling.
    fn gap(a: [Vec2; 3], b: [Vec2; 3]) -> f32 {
        let points =
            |t: [Vec2; 3]| (0..3).flat_map(move |k| (0..=50).map(move |i| t[k].lerp(t[(k + 1) % 3], i as f32 / 50.0)));
        points(a).flat_map(|p| points(b).map(move |q| (p - q).length())).fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn degenerate_faces_are_counted_and_placed() {
        let mut mesh = cuboid(Vec3::ONE);
        mesh.triangles.push([0, 0, 1]);
        let unwrapped = unwrap(&mesh, SizeWish::Fixed(128)).unwrap();
        assert_eq!(unwrapped.unmapped, 1);
        let [a, b, c] = texels_of(&unwrapped, 12);
        assert!(a == b && b == c && unwrapped.coverage < 1.0);
        assert!(texels_of(&unwrapped, 12).iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 128.0));
    }

    #[test]
    fn meshes_without_area_are_refused() {
        let flat = TriangleMesh { positions: vec![Vec3::ZERO; 3], triangles: vec![[0, 1, 2]], ..Default::default() };
        assert_eq!(unwrap(&flat, SizeWish::Fixed(64)).unwrap_err(), AtlasError::NoArea);
        assert_eq!(unwrap(&TriangleMesh::default(), SizeWish::Fixed(64)).unwrap_err(), AtlasError::NoArea);
    }

    #[test]
    fn the_result_is_deterministic() {
        let unwrap_once = || unwrap(&cuboid(Vec3::new(1.0, 2.0, 3.0)), SizeWish::Texel(0.01)).unwrap();
        assert_eq!(unwrap_once().mesh, unwrap_once().mesh);
    }

    /// Charts are cut and packed for the shape, so that all copies have the same uv, and each stands in its own place.
    #[test]
    fn copies_share_their_layout() {
        let shape = cells(30, 0.4, 0.2);
        let moved = |angle: f32| {
            let positions = shape.positions.iter().map(|p| Quat::from_rotation_y(angle) * *p + Vec3::X).collect();
            TriangleMesh { positions, ..shape.clone() }
        };
        let copies = [moved(0.3), moved(1.2)];
        let [fixed, fine, coarse] = [SizeWish::Fixed(256), SizeWish::Texel(0.004), SizeWish::Texel(0.1)];
        let wanted =
            [(0, fixed), (1, fixed), (0, fine), (1, coarse)].map(|(at, size)| Wanted { mesh: &copies[at], size });
        let made: Vec<Unwrapped> = unwrap_copies(&shape, &wanted, None).into_iter().map(Result::unwrap).collect();
        assert_eq!(made[0].mesh.uvs, made[1].mesh.uvs);
        for (unwrapped, Wanted { mesh, .. }) in made.iter().zip(wanted) {
            assert!((0..mesh.triangles.len()).all(|at| unwrapped.mesh.corners(at) == mesh.corners(at)));
        }
        assert!(made[2].size > made[3].size, "each has the size that it asks for");
    }

    /// A sheet of cells, each separate from its neighbours and turned in another direction, so that each is a chart.
    fn cells(count: u32, length: f32, width: f32) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for at in 0..count {
            let (first, turn) = (4 * at, Quat::from_rotation_y(0.7 * at as f32));
            let corner = |x: f32, z: f32| turn * Vec3::new(x, 0.0, z) + Vec3::Y * (at as f32 * 0.1);
            mesh.positions.extend([corner(0.0, 0.0), corner(0.0, width), corner(length, width), corner(length, 0.0)]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        mesh
    }

    /// A band around the Y axis, open at both rims.
    fn hoop(corners: u32, height: f32) -> TriangleMesh {
        let angle = |at: u32| at as f32 / corners as f32 * std::f32::consts::TAU;
        let at = |at: u32, y: f32| Vec3::new(angle(at).cos(), y, angle(at).sin());
        TriangleMesh {
            positions: (0..corners).flat_map(|k| [at(k, 0.0), at(k, height)]).collect(),
            triangles: (0..corners)
                .map(|k| [2 * k, 2 * k + 1, 2 * ((k + 1) % corners), 2 * ((k + 1) % corners) + 1])
                .flat_map(|[a, b, c, d]| [[a, b, c], [c, b, d]])
                .collect(),
            ..Default::default()
        }
    }

    /// Triangles that intersect each other, some of them repeated, some with only one distinct corner.
    fn soup(corners: &[[f32; 3]], count: u32, size: Vec3) -> TriangleMesh {
        let corner = |at: u32| at.wrapping_mul(2_654_435_761).rotate_left(9) % corners.len() as u32;
        TriangleMesh {
            positions: corners.iter().map(|corner| Vec3::from_array(*corner) * size).collect(),
            triangles: (0..count).map(|at| [3 * at, 3 * at + 1, 3 * at + 2].map(corner)).collect(),
            ..Default::default()
        }
    }

    /// The wish of a camera close to a wall.
    #[test]
    fn a_wish_beyond_the_largest_atlas_gets_the_largest() {
        for mesh in [cuboid(Vec3::new(4.0, 2.6, 0.1)), cells(40, 1.0, 1.0), cells(200, 2.0, 0.01), hoop(64, 0.01)] {
            for texel_m in [1e-5, 1e-12] {
                let unwrapped = unwrap(&mesh, SizeWish::Texel(texel_m)).unwrap();
                assert_eq!(unwrapped.size, 4096);
                assert!(unwrapped.texel_m > texel_m);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        /// Every wish for every shape has a result in which each triangle has its place, or one of the expected errors.
        #[test]
        fn every_wish_has_an_answer(
            kind in 0..4,
            soup in prop::collection::vec([-1.0_f32..1.0, -1.0..1.0, -1.0..1.0], 3..60),
            count in 1_u32..120,
            sides in [-3.0_f32..2.0, -3.0_f32..2.0, -3.0_f32..2.0],
            wish in -13.0_f64..2.0,
            fixed in prop::option::of(64_u32..=2048),
        ) {
            let [x, y, z] = sides.map(|side| 10.0_f32.powf(side));
            let mesh = match kind {
                0 => cuboid(Vec3::new(x, y, z)),
                1 => cells(count, x, y),
                2 => hoop(count.max(3), y),
                _ => self::soup(&soup, count, Vec3::new(x, y, z)),
            };
            let wish = fixed.map_or(SizeWish::Texel(10.0_f64.powf(wish)), SizeWish::Fixed);
            match unwrap(&mesh, wish) {
                Ok(unwrapped) => {
                    let size = unwrapped.size;
                    prop_assert!(SizeWish::Fixed(size) == wish || (256..=4096).contains(&size));
                    let uvs = unwrapped.mesh.uvs.unwrap();
                    prop_assert!(uvs.iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0));
                    prop_assert!(unwrapped.coverage <= 1.0);
                }
                Err(AtlasError::DoesNotFit { .. } | AtlasError::NoArea) => {}
                Err(error) => prop_assert!(false, "{error}"),
            }
        }
    }

    /// A curved patch with a triangle of edges of 3.6, 4.7 and 8.3 cm and an area of 2.5e-10 m2 at one of its corners.
    #[test]
    fn a_nearly_degenerate_triangle_takes_no_texels() {
        const SIDE: u32 = 16;
        let mut mesh = TriangleMesh::default();
        for (row, column) in (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column))) {
            let [x, z] = [column, row].map(|at| 0.3 * (at as f32 / (SIDE - 1) as f32 - 0.5));
            mesh.positions.push(Vec3::new(x, 0.2 * (1.0 - 8.0 * (x * x + z * z)), z));
        }
        for (row, column) in (0..SIDE - 1).flat_map(|row| (0..SIDE - 1).map(move |column| (row, column))) {
            let corner = row * SIDE + column;
            mesh.triangles.push([corner, corner + SIDE, corner + 1]);
            mesh.triangles.push([corner + 1, corner + SIDE, corner + SIDE + 1]);
        }
        let sound = packed(&mesh, SizeWish::Fixed(256)).unwrap();
        let (first, place) = (mesh.positions.len() as u32, mesh.positions[0]);
        let along = Vec3::new(-0.6, 0.0, -0.8);
        mesh.positions.extend([place + 0.083 * along, place + 0.036 * along + Vec3::new(0.0, 6e-9, 0.0)]);
        mesh.triangles.push([0, first, first + 1]);
        let layout = packed(&mesh, SizeWish::Fixed(256)).unwrap();
        assert_eq!(layout.triangles.len(), mesh.triangles.len());
        let texels = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|vertex| layout.uvs[vertex as usize]);
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs() / 2.0 * 65536.0
        };
        assert!(texels(layout.triangles.last().unwrap()) < 2.0);
        let area = mesh.area();
        assert!((layout.texel_m(area) / sound.texel_m(area) - 1.0).abs() < 0.1);
        // Every triangle names its own vertices.
        for (placed, own) in layout.triangles.iter().zip(&mesh.triangles) {
            assert_eq!(placed.map(|vertex| layout.source_vertices[vertex as usize]), *own);
        }
    }
}
