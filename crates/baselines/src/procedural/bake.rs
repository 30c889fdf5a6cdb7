//! Bakes the materials of parts into the atlases of their instances.

use glam::{DVec2, DVec3};
use mateval_dataset::TriangleMesh;
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_image::{Mask, Picture};
use rayon::prelude::*;

use super::materials::{SceneMaterials, completed};
use crate::error::BaselineError;
use crate::estimate::{Estimate, GivenMaps, Values};
use crate::geometry::{SceneGeometry, SeenPixels};
use crate::lift::{PartialAtlas, Texel, lift, place_of, texel_size_m};
use crate::maps::Maps;

/// Texels that are evaluated together.
const TEXELS: usize = 4096;

pub struct Baked {
    /// The maps, with filled gutters.
    pub maps: Maps,
    /// Whether the input view shows each texel; absent if seen texels are not kept.
    pub seen: Option<Mask>,
}

/// Bakes every instance that has an atlas, to the dataset's own size, and calls `each` with its place in the scene.
/// With `keep_seen` texels that the input view shows hold the estimate.
pub(super) fn bake_all(
    materials: &SceneMaterials<'_>,
    geometry: &SceneGeometry<'_>,
    estimate: &Estimate,
    seen: &SeenPixels,
    keep_seen: bool,
    mut each: impl FnMut(usize, Baked) -> Result<(), BaselineError>,
) -> Result<(), BaselineError> {
    let given = materials.given;
    for (at, instance) in geometry.scene.instances.iter().enumerate() {
        let Some(atlas) = &instance.atlas else { continue };
        let size = atlas.size as usize;
        let mut known = match keep_seen {
            true => lift(geometry, seen, estimate, at, size),
            false => {
                let atlas = UvAtlas::new(geometry.mesh(at), size);
                let unknown = |x, y| atlas.owner(x, y).map_or(Texel::Unused, |_| Texel::Unseen);
                PartialAtlas { texels: Picture::from_fn(size, size, unknown), atlas }
            }
        };
        let seen = keep_seen.then(|| known.texels.map(|texel| texel.seen().is_some()));
        known.texels =
            known.texels.map(|texel| texel.seen().map_or(texel, |values| Texel::Seen(completed(values, given))));
        materials.fill_unseen(geometry.mesh(at), materials.triangles.of(at), &mut known);
        // A graph has a roughness and a metallic of its own.
        let has_graph = materials.has_graph(at);
        let roughness = given.roughness || has_graph;
        let maps = GivenMaps { base_color: true, roughness, metallic: given.metallic || has_graph };
        each(at, Baked { maps: Maps::of_atlas(&known, maps), seen })?;
    }
    Ok(())
}

impl SceneMaterials<'_> {
    /// Gives all texels that are `Unseen` the material of their part. `parts` holds the part of each of the mesh's
    /// triangles. Texels of no part stay as they are.
    fn fill_unseen(&self, mesh: &TriangleMesh, parts: &[Option<usize>], known: &mut PartialAtlas) {
        let atlas = &known.atlas;
        let size = atlas.size();
        let mut of_part: Vec<Vec<(usize, usize)>> = vec![Vec::new(); self.of_part.len()];
        for (at, texel) in known.texels.pixels().iter().enumerate() {
            let Some((triangle, _)) = atlas.owner(at % size, at / size) else { continue };
            if let (Texel::Unseen, Some(part)) = (texel, parts[triangle]) {
                of_part[part].push((at, triangle));
            }
        }
        for (part, texels) in of_part.into_iter().enumerate() {
            let values: Vec<Vec<Values>> =
                texels.par_chunks(TEXELS).map(|texels| self.values(part, atlas, mesh, texels)).collect();
            for ((at, _), values) in texels.into_iter().zip(values.into_iter().flatten()) {
                known.texels.pixels_mut()[at] = Texel::Seen(values);
            }
        }
    }

    /// The material of a part at texels, each given by its place in the atlas and its triangle.
    fn values(&self, part: usize, atlas: &UvAtlas, mesh: &TriangleMesh, texels: &[(usize, usize)]) -> Vec<Values> {
        let material = &self.of_part[part];
        let size = atlas.size();
        let position = |&(at, triangle): &(usize, usize)| {
            let centre = DVec2::new((at % size) as f64 + 0.5, (at / size) as f64 + 0.5);
            place_of(atlas, mesh, triangle, centre)
        };
        let positions: Vec<DVec3> = texels.iter().map(position).collect();
        let mut values = match (material.frame, &material.graph) {
            (Some(frame), Some(_)) => {
                let place = |(&(_, triangle), position): (&(usize, usize), &DVec3)| {
                    let [u, v] = frame.place(frame.chart(mesh.geometric_normal(triangle)), *position);
                    [u, v, texel_size_m(atlas, mesh, triangle)]
                };
                material.at(&texels.iter().zip(&positions).map(place).collect::<Vec<_>>(), self.given)
            }
            _ => vec![material.values; texels.len()],
        };
        if let Some(residuals) = self.residuals.as_ref().map(|all| &all[part]) {
            for (values, position) in values.iter_mut().zip(positions) {
                let residual = residuals.at(position);
                values.iter_mut().zip(residual).for_each(|(value, more)| *value = (*value + more).clamp(0.0, 1.0));
            }
        }
        values
    }
}
