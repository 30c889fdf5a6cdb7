//! Predictions on the surfaces of a world, in place of its own materials.
//!
//! Geometry, opacities, lights and what has no atlas (glass) stay the world's. What a path decides depends on roughness
//! and metallic and on no base colour, so predictions that differ in base colour alone are followed by the same paths.

use std::array::from_fn;

use glam::{Vec2, Vec3};
use mateval_image::Texture;
use mateval_scene::TriangleMesh;
use mateval_scene::material::PrincipledFlavour;

use crate::accel::{Hit, prefetch, prefetch_line};
use crate::bsdf::{BlenderTables, Principled, eta_from_specular};
use crate::error::TracerError;
use crate::world::World;

/// One surface's atlas: several base colours over one roughness and metallic. Values are clipped to 0..1 when looked up.
#[derive(Clone, Debug)]
pub struct Coat {
    /// Linear at lookup, one a prediction.
    pub base_colors: Vec<Texture>,
    /// Perceptual; the first channel counts.
    pub roughness: Texture,
    /// The first channel counts.
    pub metallic: Texture,
}

/// Predictions for all surfaces of a world.
#[derive(Debug)]
pub struct Repaint {
    /// By surface; none keeps the world's own material.
    coats: Vec<Option<Coat>>,
    /// Of all triangles of the world, surface by surface.
    uvs: Vec<[Vec2; 3]>,
    predictions: usize,
    flavour: PrincipledFlavour,
    eta: f32,
    tables: BlenderTables,
}

/// What is painted at one place, for `K` base colours.
pub(crate) struct PaintAt<'a, const K: usize> {
    pub(crate) principled: Principled<'a>,
    pub(crate) base_colors: [Vec3; K],
}

/// Disney's `specular` of predictions: an index of refraction of 1.5.
const SPECULAR: f32 = 0.5;

impl Repaint {
    /// Paints `world` with `coats`, looked up by the uv of `atlases`; both one a surface.
    ///
    /// Fails where the atlases' triangles are not the world's, a painted mesh has no uv, coats hold different numbers of
    /// base colours, or none.
    pub fn new(
        world: &World,
        atlases: &[TriangleMesh],
        coats: Vec<Option<Coat>>,
        flavour: PrincipledFlavour,
    ) -> Result<Self, TracerError> {
        let surfaces = &world.scene().surfaces;
        let fits = atlases.len() == surfaces.len()
            && coats.len() == surfaces.len()
            && atlases.iter().zip(surfaces).all(|(mesh, s)| mesh.triangles.len() == s.mesh.triangles.len());
        if !fits {
            return Err(TracerError::Invalid("the atlases are not of the world's triangles".into()));
        }
        let predictions = coats.iter().flatten().map(|coat| coat.base_colors.len()).max().unwrap_or(1);
        if let Some(coat) = coats.iter().flatten().find(|coat| coat.base_colors.len() != predictions) {
            let found = coat.base_colors.len();
            return Err(TracerError::Invalid(format!("{found} base colours on one surface, {predictions} on another")));
        }
        if predictions == 0 {
            return Err(TracerError::Invalid("no base colours to paint with".into()));
        }
        let unmapped = coats.iter().zip(atlases).position(|(coat, mesh)| coat.is_some() && !has_uvs(mesh));
        if let Some(index) = unmapped {
            let name = &surfaces[index].name;
            return Err(TracerError::Invalid(format!("surface {index} '{name}': a coat for a mesh without sound uv")));
        }
        let uvs = atlases.iter().flat_map(corner_uvs).collect();
        let eta = eta_from_specular(SPECULAR);
        Ok(Self { coats, uvs, predictions, flavour, eta, tables: BlenderTables::new(eta) })
    }

    /// How many predictions there are.
    pub fn predictions(&self) -> usize {
        self.predictions
    }

    /// How many surfaces there are, painted or not.
    pub(crate) fn surfaces(&self) -> usize {
        self.coats.len()
    }

    /// Asks for the memory that [`Self::at`] reads first.
    pub(crate) fn prefetch(&self, hit: &Hit) {
        prefetch(&self.uvs[hit.global as usize]);
    }

    /// The place in the atlas of a hit.
    pub(crate) fn uv(&self, hit: &Hit) -> Vec2 {
        let [a, b, c] = self.uvs[hit.global as usize];
        a * hit.barycentrics.x + b * hit.barycentrics.y + c * hit.barycentrics.z
    }

    /// Asks for the texels that [`Self::at`] reads.
    pub(crate) fn prefetch_texels<const K: usize>(&self, first: usize, surface: usize, uv: Vec2) {
        let Some(coat) = &self.coats[surface] else { return };
        let colors = coat.base_colors[first..].iter().take(K);
        for texture in colors.chain([&coat.roughness, &coat.metallic]) {
            texture.addresses(uv.to_array()).into_iter().for_each(prefetch_line);
        }
    }

    /// What predictions `first..first + K` say of a place; those beyond the last say what the last does. None where the
    /// world's own material stays.
    pub(crate) fn at<const K: usize>(&self, first: usize, surface: usize, uv: Vec2) -> Option<PaintAt<'_, K>> {
        let coat = self.coats[surface].as_ref()?;
        let scalar = |texture: &Texture| texture.sample(uv.to_array())[0].clamp(0.0, 1.0);
        let base_colors = from_fn(|k| {
            let texture = &coat.base_colors[(first + k).min(self.predictions - 1)];
            Vec3::from_array(texture.sample(uv.to_array())).clamp(Vec3::ZERO, Vec3::ONE)
        });
        let principled = Principled {
            base_color: base_colors[0],
            roughness: scalar(&coat.roughness),
            metallic: scalar(&coat.metallic),
            eta: self.eta,
            style: Principled::style(self.flavour, Some(&self.tables)),
        };
        Some(PaintAt { principled, base_colors })
    }
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
