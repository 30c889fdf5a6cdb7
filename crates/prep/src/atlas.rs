//! One overlap-free uv atlas a mesh, by xatlas.

use glam::Vec2;
use mateval_scene::TriangleMesh;
use xatlas_rs_v2::{ChartOptions, IndexData, MeshData, MeshDecl, PackOptions, Xatlas};

/// Texels between two charts, at the atlas's own size.
pub const GUTTER: u32 = 4;
/// Least and most texels a side of an atlas whose size is chosen.
pub const CHOSEN_SIZES: (u32, u32) = (256, 4096);

/// xatlas drops faces below an area of 1e-7 and edges below a length; a mesh is made this long for it.
const XATLAS_LENGTH: f32 = 1000.0;
/// Times that packing is tried at a smaller scale before giving up.
const MAX_PACKS: u32 = 24;
/// How much coarser packing is tried where it is not known by how much it was too fine.
const OVERFLOW_STEP: f64 = 0.7;

/// How large an atlas shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SizeWish {
    /// Texels a side.
    Fixed(u32),
    /// The least power of two within [`CHOSEN_SIZES`] at which a texel's side is at most so many metres on the surface.
    Texel(f64),
}

/// A mesh with its atlas.
#[derive(Clone, Debug)]
pub struct Unwrapped {
    /// The same triangles in the same order, vertices split where charts part; `uvs` are the atlas's.
    pub mesh: TriangleMesh,
    /// Texels a side.
    pub size: u32,
    /// Charts.
    pub charts: u32,
    /// Share of the square that triangles cover, 0 to 1.
    pub coverage: f64,
    /// Length of a texel's side on the surface in metres, on the average over area.
    pub texel_m: f64,
    /// Triangles that xatlas left out (no area to speak of); all three corners lie on one point of another chart.
    pub unmapped: usize,
}

/// Why a mesh has no atlas.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AtlasError {
    /// No triangle of it has an area.
    #[error("no triangle has an area")]
    NoArea,
    /// xatlas did not take the mesh.
    #[error("xatlas refused the mesh: {0}")]
    Refused(String),
    /// Too many charts for the size.
    #[error("its {charts} charts do not fit into {size}x{size} texels with gutters of {GUTTER}")]
    DoesNotFit {
        /// Charts.
        charts: u32,
        /// Texels a side.
        size: u32,
    },
}

/// Cuts the mesh into charts and packs them.
pub fn unwrap(mesh: &TriangleMesh, wish: SizeWish) -> Result<Unwrapped, AtlasError> {
    let (positions, scale) = scaled_positions(mesh)?;
    let decl = MeshDecl {
        vertex_position_data: MeshData::Contiguous(&positions),
        index_data: Some(IndexData::U32(mesh.triangles.as_flattened())),
        ..MeshDecl::default()
    };
    let mut atlas = Xatlas::new();
    atlas.add_mesh(&decl).map_err(|error| AtlasError::Refused(format!("{error:?}")))?;
    atlas.compute_charts(&ChartOptions::default());
    let side = mesh.area().sqrt() * f64::from(scale);
    match wish {
        SizeWish::Fixed(size) => {
            pack_into(&mut atlas, f64::from(size) / f64::from(XATLAS_LENGTH), side, size)?;
            read_back(&atlas, mesh, size)
        }
        SizeWish::Texel(texel_m) => {
            let mut size = pack_at_least(&mut atlas, 1.0 / (texel_m * f64::from(scale)), side)?;
            let mut unwrapped = read_back(&atlas, mesh, size)?;
            // Packing may have had to go coarser than was asked for.
            while unwrapped.texel_m > texel_m && size < CHOSEN_SIZES.1 {
                size *= 2;
                pack_into(&mut atlas, 1.0 / (texel_m * f64::from(scale)), side, size)?;
                unwrapped = read_back(&atlas, mesh, size)?;
            }
            Ok(unwrapped)
        }
    }
}

/// The positions about the middle of the box, its longest side [`XATLAS_LENGTH`]; and the factor from metres.
fn scaled_positions(mesh: &TriangleMesh) -> Result<(Vec<f32>, f32), AtlasError> {
    let (low, high) = mesh
        .positions
        .iter()
        .fold((glam::Vec3::INFINITY, glam::Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let longest = (high - low).max_element();
    if !(longest > 0.0 && longest.is_finite() && mesh.area() > 0.0) {
        return Err(AtlasError::NoArea);
    }
    let (scale, middle) = (XATLAS_LENGTH / longest, (low + high) / 2.0);
    let positions = mesh.positions.iter().flat_map(|p| ((*p - middle) * scale).to_array()).collect();
    Ok((positions, scale))
}

/// Packs at `texels_per_unit` or finer into the least power of two that holds it; where even the largest does not, as
/// fine as fits. `side` is that of a square of the mesh's area, in units.
fn pack_at_least(atlas: &mut Xatlas<'_>, texels_per_unit: f64, side: f64) -> Result<u32, AtlasError> {
    let (least, most) = CHOSEN_SIZES;
    // Charts do not overlap: no more than the largest square's own area can fit.
    let density = texels_per_unit.min(f64::from(most) / side).min(density_bound(most, side));
    let mut size = ((side * density).ceil() as u32).clamp(least, most).next_power_of_two();
    let packed = loop {
        match pack(atlas, density, size)? {
            Packed::Side(packed) => break f64::from(packed),
            Packed::Overflow if size == most => break f64::from(most) / OVERFLOW_STEP,
            Packed::Overflow => size *= 2,
        }
    };
    let size = (packed.ceil() as u32).next_power_of_two().clamp(least, most);
    pack_into(atlas, density * f64::from(size) / packed, side, size)?;
    Ok(size)
}

/// Packs at `texels_per_unit`, or as little coarser as it takes, so that the atlas is no larger than `size`.
fn pack_into(atlas: &mut Xatlas<'_>, texels_per_unit: f64, side: f64, size: u32) -> Result<(), AtlasError> {
    let mut density = texels_per_unit.min(density_bound(size, side));
    for _ in 0..MAX_PACKS {
        match pack(atlas, density, size)? {
            Packed::Side(packed) if packed <= size => return Ok(()),
            Packed::Side(packed) => density *= (f64::from(size) / f64::from(packed)).min(0.99) * 0.995,
            Packed::Overflow => density *= OVERFLOW_STEP,
        }
    }
    Err(AtlasError::DoesNotFit { charts: atlas.chart_count(), size })
}

/// Texels a unit at which no mesh fits into `size` any more; finer, and xatlas would raster charts of any size.
fn density_bound(size: u32, side: f64) -> f64 {
    4.0 * f64::from(size) / f64::from(XATLAS_LENGTH).max(side)
}

/// What packing gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packed {
    /// The longer side in texels.
    Side(u32),
    /// More than the room that xatlas was given: at least a chart was made smaller, or is in another atlas.
    Overflow,
}

/// Packs into a room of four times `size`, at most twice the largest atlas.
///
/// Without a room xatlas lets its atlas grow, tries 4096 random places for each chart, and **aborts** where none is free:
/// of an atlas of 4096 texels, of which only the last rows and columns are, one time in fifty. With a room it makes a
/// chart that is too long smaller and begins another atlas where it finds no place, and so always comes to an end.
fn pack(atlas: &mut Xatlas<'_>, texels_per_unit: f64, size: u32) -> Result<Packed, AtlasError> {
    let room = (4 * size).min(2 * CHOSEN_SIZES.1);
    atlas.pack_charts(&PackOptions {
        padding: GUTTER,
        texels_per_unit: texels_per_unit as f32,
        resolution: room,
        bilinear: true,
        ..PackOptions::default()
    });
    if atlas.chart_count() == 0 {
        return Err(AtlasError::NoArea);
    }
    let meshes = atlas.meshes();
    let vertices = meshes.into_iter().flat_map(|mesh| mesh.vertex_array).filter(|vertex| vertex.atlas_index >= 0);
    let farthest = vertices.fold(0.0_f32, |farthest, vertex| farthest.max(vertex.uv[0]).max(vertex.uv[1]));
    // Charts end in the middle of a texel; less what is lost in rounding.
    let side = (farthest - 1e-3).ceil() as u32;
    Ok(if atlas.atlas_count() > 1 || side >= room { Packed::Overflow } else { Packed::Side(side) })
}

fn read_back(atlas: &Xatlas<'_>, mesh: &TriangleMesh, size: u32) -> Result<Unwrapped, AtlasError> {
    let packed = atlas.meshes();
    let [packed] = packed.as_slice() else {
        return Err(AtlasError::Refused(format!("{} meshes came back, expected one", packed.len())));
    };
    let mut triangles: Vec<[u32; 3]> = packed.index_array.as_chunks::<3>().0.to_vec();
    let mut source_vertices: Vec<u32> = packed.vertex_array.iter().map(|vertex| vertex.xref).collect();
    let same = triangles.len() == mesh.triangles.len()
        && triangles.iter().zip(&mesh.triangles).all(|(new, old)| new.map(|v| source_vertices[v as usize]) == *old);
    if !same {
        return Err(AtlasError::Refused("the triangles came back in another order".to_owned()));
    }
    let side = size as f32;
    let mapped: Vec<bool> = packed.vertex_array.iter().map(|vertex| vertex.atlas_index >= 0).collect();
    let mut uvs: Vec<Vec2> =
        packed.vertex_array.iter().map(|vertex| Vec2::new(vertex.uv[0] / side, 1.0 - vertex.uv[1] / side)).collect();
    let unmapped = place_unmapped(&mut triangles, &mut source_vertices, &mapped, &mut uvs);
    let pick = |from: &[glam::Vec3]| source_vertices.iter().map(|v| from[*v as usize]).collect::<Vec<_>>();
    let mesh = TriangleMesh {
        positions: pick(&mesh.positions),
        normals: mesh.normals.as_deref().map(pick),
        uvs: Some(uvs),
        triangles,
    };
    let coverage = uv_area(&mesh);
    let texel_m = (mesh.area() / (coverage * f64::from(size) * f64::from(size))).sqrt();
    Ok(Unwrapped { mesh, size, charts: atlas.chart_count(), coverage, texel_m, unmapped })
}

/// Gives triangles without a chart corners of their own, all three at one mapped place: that of one of their vertices,
/// else the first. Gives the number of such triangles.
fn place_unmapped(
    triangles: &mut [[u32; 3]],
    source_vertices: &mut Vec<u32>,
    mapped: &[bool],
    uvs: &mut Vec<Vec2>,
) -> usize {
    let mut uv_of_source = std::collections::HashMap::new();
    for vertex in (0..mapped.len()).filter(|vertex| mapped[*vertex]) {
        uv_of_source.entry(source_vertices[vertex]).or_insert(uvs[vertex]);
    }
    let first = mapped.iter().position(|mapped| *mapped).map_or(Vec2::ZERO, |vertex| uvs[vertex]);
    let mut count = 0;
    for triangle in triangles {
        if triangle.iter().all(|vertex| mapped[*vertex as usize]) {
            continue;
        }
        count += 1;
        let sources = triangle.map(|vertex| source_vertices[vertex as usize]);
        let known = sources.iter().find_map(|source| uv_of_source.get(source));
        let place = known.copied().unwrap_or(first);
        *triangle = sources.map(|source| {
            source_vertices.push(source);
            uvs.push(place);
            (uvs.len() - 1) as u32
        });
    }
    count
}

/// The sum of the triangles' areas in uv.
fn uv_area(mesh: &TriangleMesh) -> f64 {
    let uvs = mesh.uvs.as_deref().unwrap_or_default();
    mesh.triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|vertex| uvs[vertex as usize].as_dvec2());
            ((b - a).perp_dot(c - a) / 2.0).abs()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
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

    /// xatlas' own threads can miss their last wake-up and hang; `.cargo/config.toml` builds it without. Threads bear
    /// the name of the one that made them.
    #[cfg(target_os = "linux")]
    #[test]
    fn xatlas_has_no_threads_of_its_own() {
        let named = |name: &str| {
            let tasks = std::fs::read_dir("/proc/self/task").unwrap();
            let names = tasks.filter_map(|task| std::fs::read_to_string(task.unwrap().path().join("comm")).ok());
            names.filter(|found| found.trim() == name).count()
        };
        let count = move || {
            let atlas = Xatlas::new();
            let count = named("unwraps-alone");
            drop(atlas);
            count
        };
        let alone = std::thread::Builder::new().name("unwraps-alone".into()).spawn(count).unwrap();
        assert_eq!(alone.join().unwrap(), 1);
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
    fn nothing_to_unwrap_is_an_error() {
        let flat = TriangleMesh { positions: vec![Vec3::ZERO; 3], triangles: vec![[0, 1, 2]], ..Default::default() };
        assert_eq!(unwrap(&flat, SizeWish::Fixed(64)).unwrap_err(), AtlasError::NoArea);
        assert_eq!(unwrap(&TriangleMesh::default(), SizeWish::Fixed(64)).unwrap_err(), AtlasError::NoArea);
    }

    #[test]
    fn the_same_twice() {
        let unwrap_once = || unwrap(&cuboid(Vec3::new(1.0, 2.0, 3.0)), SizeWish::Texel(0.01)).unwrap();
        assert_eq!(unwrap_once().mesh, unwrap_once().mesh);
    }

    /// A sheet of cells, each apart from its neighbours and turned another way, so that it is a chart of its own.
    fn cells(count: u32, length: f32, width: f32) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for at in 0..count {
            let (first, turn) = (4 * at, glam::Quat::from_rotation_y(0.7 * at as f32));
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

    /// Triangles across each other, some more than once, some of a single corner.
    fn soup(corners: &[[f32; 3]], count: u32, size: Vec3) -> TriangleMesh {
        let corner = |at: u32| at.wrapping_mul(2_654_435_761).rotate_left(9) % corners.len() as u32;
        TriangleMesh {
            positions: corners.iter().map(|corner| Vec3::from_array(*corner) * size).collect(),
            triangles: (0..count).map(|at| [3 * at, 3 * at + 1, 3 * at + 2].map(corner)).collect(),
            ..Default::default()
        }
    }

    /// As a camera at a wall wishes it: xatlas once aborted the program.
    #[test]
    fn a_wish_that_no_atlas_grants_gets_the_largest() {
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

        /// Whatever is wished of whatever shape, there is an answer, on which everything has its place.
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
}
