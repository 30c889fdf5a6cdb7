//! Cuts a mesh into charts and packs them into a square, by uvunwrap.

use serde::{Deserialize, Serialize};
use uvunwrap::{Density, MeshInput, Options, Packing};

use mateval_scene::TriangleMesh;

use super::layout::AtlasLayout;

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
    /// No triangle has an area.
    #[error("no triangle has an area")]
    NoArea,
    /// Too many charts for the size.
    #[error("its {charts} charts do not fit into {size}x{size} texels with gutters of {GUTTER}")]
    DoesNotFit { charts: u32, size: u32 },
    /// The mesh is damaged.
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
