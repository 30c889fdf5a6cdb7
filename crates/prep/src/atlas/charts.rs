//! Cuts a mesh into charts by xatlas, and packs them into squares.

use glam::Vec2;
use mateval_scene::TriangleMesh;
use xatlas_rs_v2::{ChartOptions, IndexData, MeshData, MeshDecl, PackOptions, Xatlas};

use super::error::AtlasError;
use super::layout::AtlasLayout;
use super::scale_search::{OVERFLOW_STEP, Packed, Search};
use super::size::{CHOSEN_SIZES, GUTTER, SizeWish};

/// The longest side of a mesh as xatlas sees it. xatlas drops faces with an area below 1e-7 and edges below a length, so
/// every mesh is scaled to this length first.
const XATLAS_LENGTH: f32 = 1000.0;
/// How often packing is tried before it fails, or before the densest one that fits is taken.
const MAX_PACKS: u32 = 24;
/// The share of the square that the charts fill in the first packing into a size that was asked for. Packings that are too
/// large take longest.
const FIRST_FILL: f64 = 0.35;
/// Least texels that a chart takes: one, and half a gutter around it.
const LEAST_TEXELS: f64 = 21.0;

/// The charts of a mesh.
pub(super) struct Charts<'a> {
    atlas: Xatlas<'a>,
    mesh: &'a TriangleMesh,
    /// The side of a square with the mesh's area, in xatlas' units.
    side: f64,
    /// xatlas' units in a metre.
    scale: f64,
}

/// Cuts the mesh into charts and calls `work` with them.
pub(super) fn with_charts<T>(mesh: &TriangleMesh, work: impl FnOnce(&mut Charts<'_>) -> T) -> Result<T, AtlasError> {
    let (positions, scale) = scaled_positions(mesh)?;
    let decl = MeshDecl {
        vertex_position_data: MeshData::Contiguous(&positions),
        index_data: Some(IndexData::U32(mesh.triangles.as_flattened())),
        ..MeshDecl::default()
    };
    let mut atlas = Xatlas::new();
    atlas.add_mesh(&decl)?;
    atlas.compute_charts(&ChartOptions::default());
    let scale = f64::from(scale);
    Ok(work(&mut Charts { atlas, mesh, side: mesh.area().sqrt() * scale, scale }))
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

impl Charts<'_> {
    /// The charts in an atlas of the wanted size.
    pub(super) fn packed(&mut self, wish: SizeWish) -> Result<AtlasLayout, AtlasError> {
        match wish {
            SizeWish::Fixed(size) => match self.pack_finely(size) {
                Err(AtlasError::DoesNotFit { .. }) => self.pack_at_least(0.0),
                packed => packed,
            },
            SizeWish::Texel(texel_m) => {
                let texels_per_unit = 1.0 / (texel_m * self.scale);
                let mut layout = self.pack_at_least(texels_per_unit)?;
                // Packing may have been coarser than wanted.
                while layout.texel_m(self.mesh.area()) > texel_m && layout.size < CHOSEN_SIZES.1 {
                    layout = self.pack_into(texels_per_unit, 2 * layout.size)?;
                }
                Ok(layout)
            }
        }
    }

    /// Packs at `texels_per_unit` or finer into the smallest power of two that holds all charts, or as finely as possible into
    /// the largest one.
    fn pack_at_least(&mut self, texels_per_unit: f64) -> Result<AtlasLayout, AtlasError> {
        let (least, most) = CHOSEN_SIZES;
        // At a coarser scale only the number of charts and their gutters decide the size, and xatlas would choose one for 0.
        let coarsest = 1.0 / self.side;
        // Charts do not overlap, so their area is at most that of the largest square.
        let density = texels_per_unit.max(coarsest).min(f64::from(most) / self.side).min(self.density_bound(most));
        let mut size = ((self.side * density).ceil() as u32).clamp(least, most).next_power_of_two();
        let packed = loop {
            match self.pack(density, size)? {
                Packed::Side(packed) => break f64::from(packed.max(1)),
                Packed::Overflow if size == most => break f64::from(most) / OVERFLOW_STEP,
                Packed::Overflow => size *= 2,
            }
        };
        let size = (packed.ceil() as u32).next_power_of_two().clamp(least, most);
        self.pack_into(density * f64::from(size) / packed, size)
    }

    /// Packs into an atlas of `size` texels a side, at `texels_per_unit` or only as much coarser as needed.
    fn pack_into(&mut self, texels_per_unit: f64, size: u32) -> Result<AtlasLayout, AtlasError> {
        let mut density = texels_per_unit.min(self.density_bound(size));
        let mut search = Search::default();
        for _ in 0..MAX_PACKS {
            let packed = self.pack(density, size)?;
            if packed.fits(size) {
                return self.read_back(size);
            }
            match search.next(density, packed, f64::from(size)).filter(|_| !self.cannot_fit(size)) {
                Some(next) => density = next,
                None => break,
            }
        }
        Err(AtlasError::DoesNotFit { charts: self.atlas.chart_count(), size })
    }

    /// Packs into an atlas of `size` texels a side, about as finely as possible.
    fn pack_finely(&mut self, size: u32) -> Result<AtlasLayout, AtlasError> {
        let (wanted, bound) = (f64::from(size), self.density_bound(size));
        // A chart is rarely longer than the mesh.
        let mut density = (wanted * (FIRST_FILL.sqrt() / self.side).min(1.0 / f64::from(XATLAS_LENGTH))).min(bound);
        let (mut densest, mut search) = (None, Search::default());
        for _ in 0..MAX_PACKS {
            let packed = self.pack(density, size)?;
            if packed.fits(size) {
                densest = Some(self.read_back(size)?);
            }
            let next = search.next(density, packed, wanted).filter(|_| densest.is_some() || !self.cannot_fit(size));
            match next.filter(|_| density < bound) {
                Some(next) => density = next.min(bound),
                None => break,
            }
        }
        densest.ok_or(AtlasError::DoesNotFit { charts: self.atlas.chart_count(), size })
    }

    /// Texels a unit above which no mesh fits into `size`. At finer scales xatlas would rasterise charts of any size.
    fn density_bound(&self, size: u32) -> f64 {
        4.0 * f64::from(size) / f64::from(XATLAS_LENGTH).max(self.side)
    }

    /// Whether the charts and their gutters alone fill the square. Half a gutter may lie outside it.
    fn cannot_fit(&self, size: u32) -> bool {
        f64::from(self.atlas.chart_count()) * LEAST_TEXELS > f64::from(size + GUTTER).powi(2)
    }

    /// Packs into a square of four times `size`, and of at most twice the largest atlas.
    ///
    /// Without a given square, xatlas lets its atlas grow, tries 4096 random places for each chart and **aborts** if none is
    /// free. For an atlas of 4096 texels, in which only the last rows and columns are free, that happens one time in fifty.
    /// With a given square, xatlas shrinks a chart that is too long, begins another atlas if it finds no place, and therefore
    /// always terminates.
    fn pack(&mut self, texels_per_unit: f64, size: u32) -> Result<Packed, AtlasError> {
        let square = (4 * size).min(2 * CHOSEN_SIZES.1);
        self.atlas.pack_charts(&PackOptions {
            padding: GUTTER,
            texels_per_unit: texels_per_unit as f32,
            resolution: square,
            bilinear: true,
            ..PackOptions::default()
        });
        if self.atlas.chart_count() == 0 {
            return Err(AtlasError::NoArea);
        }
        let meshes = self.atlas.meshes();
        let vertices = meshes.into_iter().flat_map(|mesh| mesh.vertex_array).filter(|vertex| vertex.atlas_index >= 0);
        let farthest = vertices.fold(0.0_f32, |farthest, vertex| farthest.max(vertex.uv[0]).max(vertex.uv[1]));
        // Charts end in the middle of a texel; 1e-3 allows for rounding.
        let side = (farthest - 1e-3).ceil() as u32;
        Ok(if self.atlas.atlas_count() > 1 || side >= square { Packed::Overflow } else { Packed::Side(side) })
    }

    fn read_back(&self, size: u32) -> Result<AtlasLayout, AtlasError> {
        let packed = self.atlas.meshes();
        let [packed] = packed.as_slice() else {
            return Err(AtlasError::Meshes { found: packed.len() });
        };
        let mut layout = AtlasLayout {
            size,
            charts: self.atlas.chart_count(),
            unmapped: 0,
            triangles: packed.index_array.as_chunks::<3>().0.to_vec(),
            source_vertices: packed.vertex_array.iter().map(|vertex| vertex.xref).collect(),
            uvs: packed.vertex_array.iter().map(|vertex| uv(vertex.uv, size)).collect(),
        };
        if !layout.belongs_to(self.mesh) {
            return Err(AtlasError::Reordered);
        }
        let mapped: Vec<bool> = packed.vertex_array.iter().map(|vertex| vertex.atlas_index >= 0).collect();
        place_unmapped(&mut layout, &mapped);
        Ok(layout)
    }
}

/// From texels, v downwards, to 0..1, v upwards.
fn uv([x, y]: [f32; 2], size: u32) -> [f32; 2] {
    let side = size as f32;
    [x / side, 1.0 - y / side]
}

/// Adds corners for triangles without a chart, all three at one mapped place: that of one of their vertices, or else the
/// first mapped one.
fn place_unmapped(layout: &mut AtlasLayout, mapped: &[bool]) {
    let mut uv_of_source = std::collections::HashMap::new();
    for vertex in (0..mapped.len()).filter(|vertex| mapped[*vertex]) {
        uv_of_source.entry(layout.source_vertices[vertex]).or_insert(layout.uvs[vertex]);
    }
    let first = mapped.iter().position(|mapped| *mapped).map_or(Vec2::ZERO.to_array(), |vertex| layout.uvs[vertex]);
    for triangle in &mut layout.triangles {
        if triangle.iter().all(|vertex| mapped[*vertex as usize]) {
            continue;
        }
        layout.unmapped += 1;
        let sources = triangle.map(|vertex| layout.source_vertices[vertex as usize]);
        let place = sources.iter().find_map(|source| uv_of_source.get(source)).copied().unwrap_or(first);
        *triangle = sources.map(|source| {
            layout.source_vertices.push(source);
            layout.uvs.push(place);
            (layout.uvs.len() - 1) as u32
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The threads of xatlas can miss their last wake-up and hang, so `.cargo/config.toml` builds it without threads. A
    /// thread has the name of the thread that started it.
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
}
