//! Predicted materials on the surfaces of a world, in place of its own.
//!
//! Geometry, opacities, lights and surfaces without an atlas (glass) stay as they are in the world. The decisions along
//! a path depend on roughness and metallic but never on base colour, so predictions that differ in base colour alone
//! share their paths. Predictions of two pairs of roughness and metallic share paths too, at the price of some noise:
//! the directions come from both ([`Repaint::with_second`]).

use std::array::from_fn;
use std::ops::Range;

use glam::{Vec2, Vec3};
use mateval_dataset::material::PrincipledFlavour;
use mateval_dataset::reference::{Surface, SurfaceIndex};
use mateval_dataset::{Camera, TriangleMesh};
use mateval_image::Texture;

use crate::accel::{prefetch, prefetch_line};
use crate::bsdf::{BlenderTables, Bsdf, Principled, eta_from_specular};
use crate::error::{RequestFault, TracerError};
use crate::path::{MOST_VARIANTS, MaterialSource, RenderSettings};
use crate::ray::{Hit, SurfaceHit};
use crate::render::Progress;
use crate::shared_centre::{Lighting, ViewsJob, ViewsRender};
use crate::world::World;

/// The maps of one surface: several base colours over one roughness and metallic. Values are clamped to 0..1 when
/// looked up.
#[derive(Clone, Debug)]
pub struct SurfaceMaps {
    /// One per prediction; lookups return linear values.
    pub base_colors: Vec<Texture>,
    pub scattering: Scattering,
}

/// The maps of one surface that decide in which directions light scatters.
#[derive(Clone, Debug)]
pub struct Scattering {
    /// Perceptual roughness, in the first channel.
    pub roughness: Texture,
    /// Metallic, in the first channel.
    pub metallic: Texture,
}

/// Predictions for the surfaces of a world.
#[derive(Debug)]
pub struct Repaint {
    /// One per surface; `None` keeps the world's own material.
    maps: Vec<Option<SurfaceMaps>>,
    second: Option<SecondScattering>,
    /// The atlas uvs of all triangles of the world, surface by surface.
    uvs: Vec<[Vec2; 3]>,
    predictions: usize,
    flavour: PrincipledFlavour,
    eta: f32,
    tables: BlenderTables,
}

/// Roughness and metallic of the predictions from number `from` on.
#[derive(Debug)]
struct SecondScattering {
    from: usize,
    /// One per surface; some where the surface has predicted maps.
    of_surface: Vec<Option<Scattering>>,
}

/// A world's surfaces with predicted materials. The variants are the predictions from `first` on.
#[derive(Clone, Copy)]
struct Painted<'w> {
    world: &'w World,
    repaint: &'w Repaint,
    first: usize,
}

/// The largest number of predictions that share one set of paths.
pub const MOST_PREDICTIONS_AT_ONCE: usize = MOST_VARIANTS;

/// Disney's `specular` of predictions, an index of refraction of 1.5.
pub const SPECULAR: f32 = 0.5;

impl Repaint {
    /// Predictions for `world`. Both `atlases` and `maps` hold one entry per surface; maps are looked up at the uvs of
    /// the atlases.
    ///
    /// Fails if the triangles of the atlases are not the world's, if the atlas of a surface with maps has no uv, or if
    /// surfaces have different numbers of base colours, or none.
    pub fn new(
        world: &World,
        atlases: &[TriangleMesh],
        maps: Vec<Option<SurfaceMaps>>,
        flavour: PrincipledFlavour,
    ) -> Result<Self, TracerError> {
        let predictions = check_maps(&world.scene().surfaces, atlases, &maps)?;
        let uvs = atlases.iter().flat_map(corner_uvs).collect();
        let eta = eta_from_specular(SPECULAR);
        Ok(Self { maps, second: None, uvs, predictions, flavour, eta, tables: BlenderTables::new(eta) })
    }

    /// The same, but predictions from number `from` on have the roughness and metallic of `of_surface`, which holds one
    /// entry per surface. Directions are sampled from both densities in equal parts, for all predictions.
    ///
    /// Fails unless exactly the surfaces with maps have an entry.
    pub fn with_second(self, from: usize, of_surface: Vec<Option<Scattering>>) -> Result<Self, TracerError> {
        let has_maps: Vec<bool> = self.maps.iter().map(Option::is_some).collect();
        if has_maps != of_surface.iter().map(Option::is_some).collect::<Vec<_>>() {
            return Err(RequestFault::SecondScattering.into());
        }
        Ok(Self { second: Some(SecondScattering { from, of_surface }), ..self })
    }

    /// The number of predictions.
    pub fn predictions(&self) -> usize {
        self.predictions
    }

    /// The base colours at `uv` of predictions `first..first + K`. Predictions beyond the last repeat it.
    fn base_colors<const K: usize>(&self, maps: &SurfaceMaps, first: usize, uv: Vec2) -> [Vec3; K] {
        from_fn(|k| {
            let which = (first + k).min(self.predictions - 1);
            let color = Vec3::from_array(maps.base_colors[which].sample(uv.to_array()));
            color.clamp(Vec3::ZERO, Vec3::ONE)
        })
    }

    /// The material of `base_color` with this scattering at `uv`.
    fn principled(&self, base_color: Vec3, scattering: &Scattering, uv: Vec2) -> Principled<'_> {
        let scalar = |texture: &Texture| texture.sample(uv.to_array())[0].clamp(0.0, 1.0);
        Principled {
            base_color,
            roughness: scalar(&scattering.roughness),
            metallic: scalar(&scattering.metallic),
            eta: self.eta,
            style: Principled::style(self.flavour, Some(&self.tables)),
        }
    }
}

impl<'w, const K: usize> MaterialSource<'w, K> for Painted<'w> {
    fn prefetch(self, hit: &Hit) {
        prefetch(&self.repaint.uvs[hit.global as usize]);
    }

    /// Returns the uv in the atlas.
    fn prefetch_texels(self, hit: &Hit, place: &SurfaceHit) -> Vec2 {
        let [a, b, c] = self.repaint.uvs[hit.global as usize];
        let uv = a * hit.barycentrics.x + b * hit.barycentrics.y + c * hit.barycentrics.z;
        if let Some(maps) = &self.repaint.maps[place.surface.0] {
            let colors = maps.base_colors[self.first..].iter().take(K);
            let Scattering { roughness, metallic } = &maps.scattering;
            for texture in colors.chain([roughness, metallic]) {
                texture.addresses(uv.to_array()).into_iter().for_each(prefetch_line);
            }
        }
        uv
    }

    fn bsdf(self, place: &SurfaceHit, uv: Vec2, wo: Vec3, _: u32) -> Bsdf<'w, K> {
        let Some(maps) = &self.repaint.maps[place.surface.0] else { return self.world.bsdf(place, wo) };
        let base_colors = self.repaint.base_colors(maps, self.first, uv);
        let principled = |scattering| self.repaint.principled(base_colors[0], scattering, uv);
        let second = self.repaint.second.as_ref().and_then(|second| {
            let scattering = second.of_surface[place.surface.0].as_ref()?;
            Some((principled(scattering), second.from.saturating_sub(self.first)))
        });
        Bsdf::of_principled(principled(&maps.scattering), second, &base_colors, place, wo)
    }
}

/// [`crate::render_views`] with predictions in place of the world's own materials. Returns one render for each
/// prediction.
///
/// Up to eight predictions share their paths. The bytes of each render are the same as if its prediction were rendered
/// alone, or with the same second scattering alone. Fails as [`crate::render_views`] does, if `repaint` was made for
/// another world, or if mixes do not match predictions and lights.
pub fn render_repainted(
    world: &World,
    repaint: &Repaint,
    cameras: &[Camera],
    lighting: Lighting<'_>,
    settings: &RenderSettings,
    seeds: &[u64],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<ViewsRender>, TracerError> {
    // Check everything before the first path.
    let (found, expected) = (repaint.maps.len(), world.scene().surfaces.len());
    if found != expected {
        return Err(RequestFault::OtherWorld { found, expected }.into());
    }
    let job = |Range { start: first, end }: Range<usize>| {
        let (materials, variants) = (Painted { world, repaint, first }, end - first);
        ViewsJob { world, materials, first, variants, lighting, cameras, settings, seeds }
    };
    let planes = job(0..0).planes(repaint.predictions)?;
    // Render the predictions in rounds that share their paths.
    let starts = (0..repaint.predictions).step_by(MOST_VARIANTS);
    let rounds: Vec<_> = starts.map(|start| start..repaint.predictions.min(start + MOST_VARIANTS)).collect();
    let progress = Progress::new(job(0..0).tiles(&planes) * rounds.len(), progress);
    let mut renders = Vec::new();
    for round in rounds {
        let variants = round.len();
        let job = job(round);
        renders.extend(match variants {
            1 => job.render::<1>(&planes, &progress),
            2 => job.render::<2>(&planes, &progress),
            3 | 4 => job.render::<4>(&planes, &progress),
            _ => job.render::<8>(&planes, &progress),
        });
    }
    Ok(renders)
}

/// Checks the arguments of [`Repaint::new`] and returns the number of predictions.
fn check_maps(
    surfaces: &[Surface],
    atlases: &[TriangleMesh],
    maps: &[Option<SurfaceMaps>],
) -> Result<usize, RequestFault> {
    if atlases.len() != surfaces.len() || maps.len() != surfaces.len() {
        let (atlases, maps) = (atlases.len(), maps.len());
        return Err(RequestFault::SurfaceCount { atlases, maps, surfaces: surfaces.len() });
    }
    let colors = maps.iter().flatten().map(|maps| maps.base_colors.len());
    let predictions = colors.max().unwrap_or(1).max(1);
    for (index, ((surface, atlas), maps)) in surfaces.iter().zip(atlases).zip(maps).enumerate() {
        let (index, name) = (SurfaceIndex(index), || surface.name.clone());
        let (found, expected) = (atlas.triangles.len(), surface.mesh.triangles.len());
        if found != expected {
            return Err(RequestFault::AtlasTriangles { surface: index, name: name(), found, expected });
        }
        let Some(maps) = maps else { continue };
        let (found, expected) = (maps.base_colors.len(), predictions);
        if found != expected {
            return Err(RequestFault::BaseColorCount { surface: index, name: name(), found, expected });
        }
        if !has_uvs(atlas) {
            return Err(RequestFault::AtlasUv { surface: index, name: name() });
        }
    }
    Ok(predictions)
}

fn has_uvs(mesh: &TriangleMesh) -> bool {
    let sound = |uvs: &Vec<Vec2>| uvs.len() == mesh.positions.len() && uvs.iter().all(|uv| uv.is_finite());
    mesh.uvs.as_ref().is_some_and(sound)
}

fn corner_uvs(mesh: &TriangleMesh) -> Vec<[Vec2; 3]> {
    let uvs = mesh.uvs.as_ref().filter(|_| has_uvs(mesh));
    let corners = |triangle: &[u32; 3]| uvs.map_or([Vec2::ZERO; 3], |uvs| triangle.map(|v| uvs[v as usize]));
    mesh.triangles.iter().map(corners).collect()
}
