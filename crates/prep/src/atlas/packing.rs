//! Cuts a mesh into charts and packs them into a square, by uvunwrap.
//!
//! The result is a layout: where the triangles of a shape lie in its atlas, apart from the shape's place in a scene.

use glam::Vec2;
use mateval_dataset::TriangleMesh;
use serde::{Deserialize, Serialize};
use uvunwrap::{Density, MeshInput, Options, Packing};

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
    /// Texels a side. If the charts do not fit, the least power of two within `CHOSEN_SIZES` that they fit
    /// into.
    Fixed(u32),
    /// The least power of two within `CHOSEN_SIZES` at which a texel's side on the surface is at most this
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

/// Moves vertices without a chart, those of triangles whose area is negligible, to the first vertex that has one.
/// Counts the triangles whose corners are at one point.
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

/// The charts of a shape, packed into a square. It holds for every mesh with the same triangles whose sides have the
/// same lengths, wherever it stands.
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
    pub(super) source_vertices: Vec<u32>,
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
    /// Number of triangles without a chart, since their area is negligible. All three corners of each lie on one point
    /// of another chart.
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
