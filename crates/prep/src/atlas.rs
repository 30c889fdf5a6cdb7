//! Unwraps a mesh into a uv atlas without overlaps, by xatlas.

use glam::Vec2;
use mateval_scene::TriangleMesh;
use xatlas_rs_v2::{AddMeshError, ChartOptions, IndexData, MeshData, MeshDecl, PackOptions, Xatlas};

/// Texels between two charts, at the final size of the atlas.
pub const GUTTER: u32 = 4;
/// Least and most texels a side of an atlas whose size is chosen.
pub const CHOSEN_SIZES: (u32, u32) = (256, 4096);

/// The longest side of a mesh as xatlas sees it. xatlas drops faces with an area below 1e-7 and edges below a length, so
/// every mesh is scaled to this length first.
const XATLAS_LENGTH: f32 = 1000.0;
/// How often packing is tried at a smaller scale before it fails.
const MAX_PACKS: u32 = 24;
/// The factor on the scale after a packing that overflowed, since xatlas does not report by how much it overflowed.
const OVERFLOW_STEP: f64 = 0.7;

/// The wanted size of an atlas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SizeWish {
    /// Texels a side.
    Fixed(u32),
    /// The least power of two within [`CHOSEN_SIZES`] at which a texel's side on the surface is at most this long, in metres.
    Texel(f64),
}

/// A mesh with its atlas.
#[derive(Clone, Debug)]
pub struct Unwrapped {
    /// The same triangles in the same order. Vertices are split at the borders of charts; `uvs` are those of the atlas.
    pub mesh: TriangleMesh,
    /// Texels a side.
    pub size: u32,
    /// Number of charts.
    pub charts: u32,
    /// Share of the square that triangles cover, 0 to 1.
    pub coverage: f64,
    /// Length of a texel's side on the surface in metres, averaged over the area.
    pub texel_m: f64,
    /// Number of triangles that xatlas left out since their area is negligible. All three corners of each lie on one point of
    /// another chart.
    pub unmapped: usize,
}

/// Why a mesh has no atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AtlasError {
    /// No triangle has an area.
    #[error("no triangle has an area")]
    NoArea,
    /// xatlas refused the mesh.
    #[error("xatlas refused the mesh: {}", reason_of(*.0))]
    Refused(Refusal),
    /// xatlas returned another number of meshes.
    #[error("xatlas returned {found} meshes, expected one")]
    Meshes {
        /// The number of meshes.
        found: usize,
    },
    /// xatlas returned the triangles in another order.
    #[error("xatlas returned the triangles in another order")]
    Reordered,
    /// Too many charts for the size.
    #[error("its {charts} charts do not fit into {size}x{size} texels with gutters of {GUTTER}")]
    DoesNotFit {
        /// Charts.
        charts: u32,
        /// Texels a side.
        size: u32,
    },
}

/// Why xatlas refuses a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// xatlas states no reason.
    Unspecified,
    /// A triangle has a corner that does not exist.
    IndexOutOfRange,
    /// A face has fewer than three corners.
    FaceVertexCount,
    /// The number of corners is not a multiple of three.
    IndexCount,
}

fn reason_of(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::Unspecified => "it states no reason",
        Refusal::IndexOutOfRange => "a triangle has a corner that does not exist",
        Refusal::FaceVertexCount => "a face has fewer than three corners",
        Refusal::IndexCount => "the number of corners is not a multiple of three",
    }
}

impl From<AddMeshError> for AtlasError {
    fn from(error: AddMeshError) -> Self {
        Self::Refused(match error {
            AddMeshError::Error => Refusal::Unspecified,
            AddMeshError::IndexOutOfRange => Refusal::IndexOutOfRange,
            AddMeshError::InvalidFaceVertexCount => Refusal::FaceVertexCount,
            AddMeshError::InvalidIndexCount => Refusal::IndexCount,
        })
    }
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
    atlas.add_mesh(&decl)?;
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
            // Packing may have been coarser than wanted.
            while unwrapped.texel_m > texel_m && size < CHOSEN_SIZES.1 {
                size *= 2;
                pack_into(&mut atlas, 1.0 / (texel_m * f64::from(scale)), side, size)?;
                unwrapped = read_back(&atlas, mesh, size)?;
            }
            Ok(unwrapped)
        }
    }
}

/// The positions about the centre of their box, scaled so that its longest side is [`XATLAS_LENGTH`], and the factor from
/// metres.
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

/// Packs at `texels_per_unit` or finer into the smallest power of two that holds all charts, or as finely as possible into
/// the largest one. `side` is the side of a square with the mesh's area, in units.
fn pack_at_least(atlas: &mut Xatlas<'_>, texels_per_unit: f64, side: f64) -> Result<u32, AtlasError> {
    let (least, most) = CHOSEN_SIZES;
    // Charts do not overlap, so their area is at most that of the largest square.
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

/// Packs into an atlas of at most `size`, at `texels_per_unit` or only as much coarser as needed.
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

/// Texels a unit above which no mesh fits into `size`. At finer scales xatlas would rasterise charts of any size.
fn density_bound(size: u32, side: f64) -> f64 {
    4.0 * f64::from(size) / f64::from(XATLAS_LENGTH).max(side)
}

/// The result of packing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packed {
    /// The longer side in texels.
    Side(u32),
    /// Larger than the square that xatlas was given: at least one chart was made smaller or is in another atlas.
    Overflow,
}

/// Packs into a square of four times `size`, and of at most twice the largest atlas.
///
/// Without a given square, xatlas lets its atlas grow, tries 4096 random places for each chart and **aborts** if none is
/// free. For an atlas of 4096 texels, in which only the last rows and columns are free, that happens one time in fifty.
/// With a given square, xatlas shrinks a chart that is too long, begins another atlas if it finds no place, and therefore
/// always terminates.
fn pack(atlas: &mut Xatlas<'_>, texels_per_unit: f64, size: u32) -> Result<Packed, AtlasError> {
    let square = (4 * size).min(2 * CHOSEN_SIZES.1);
    atlas.pack_charts(&PackOptions {
        padding: GUTTER,
        texels_per_unit: texels_per_unit as f32,
        resolution: square,
        bilinear: true,
        ..PackOptions::default()
    });
    if atlas.chart_count() == 0 {
        return Err(AtlasError::NoArea);
    }
    let meshes = atlas.meshes();
    let vertices = meshes.into_iter().flat_map(|mesh| mesh.vertex_array).filter(|vertex| vertex.atlas_index >= 0);
    let farthest = vertices.fold(0.0_f32, |farthest, vertex| farthest.max(vertex.uv[0]).max(vertex.uv[1]));
    // Charts end in the middle of a texel; 1e-3 allows for rounding.
    let side = (farthest - 1e-3).ceil() as u32;
    Ok(if atlas.atlas_count() > 1 || side >= square { Packed::Overflow } else { Packed::Side(side) })
}

fn read_back(atlas: &Xatlas<'_>, mesh: &TriangleMesh, size: u32) -> Result<Unwrapped, AtlasError> {
    let packed = atlas.meshes();
    let [packed] = packed.as_slice() else {
        return Err(AtlasError::Meshes { found: packed.len() });
    };
    let mut triangles: Vec<[u32; 3]> = packed.index_array.as_chunks::<3>().0.to_vec();
    let mut source_vertices: Vec<u32> = packed.vertex_array.iter().map(|vertex| vertex.xref).collect();
    let same = triangles.len() == mesh.triangles.len()
        && triangles.iter().zip(&mesh.triangles).all(|(new, old)| new.map(|v| source_vertices[v as usize]) == *old);
    if !same {
        return Err(AtlasError::Reordered);
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

/// Adds corners for triangles without a chart, all three at one mapped place: that of one of their vertices, or else the
/// first mapped one. Returns the number of such triangles.
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
mod tests;
