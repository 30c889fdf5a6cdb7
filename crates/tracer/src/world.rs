//! A scene prepared for tracing.

use std::sync::Arc;

use glam::{DVec2, Vec2, Vec3};
use mateval_dataset::material::{CUT_OUT_BELOW_OPACITY, FRACTIONAL_OPACITY, Lookup, Material};
use mateval_dataset::reference::{ReferenceScene, Surface, SurfaceIndex};
use mateval_dataset::{Camera, Intrinsics, TriangleMesh};
use mateval_image::Texture;
use rayon::prelude::*;

use crate::accel::{Accel, move_to_huge_pages, on_huge_pages, prefetch, prefetch_line};
use crate::bsdf::{Bsdf, MaterialTables};
use crate::emitter::{Emitters, StageLight, escape_share};
use crate::error::{ElementFault, SurfaceFault, TracerError};
use crate::ray::{Hit, Ray, SurfaceHit, TriangleIndex, TriangleRecord};
use crate::sampling::unit_hash;

/// A scene with its hierarchy, emitters and material tables.
#[derive(Clone, Debug)]
pub struct World {
    scene: Arc<ReferenceScene>,
    textures: Vec<Texture>,
    accel: Arc<Accel>,
    emitters: Emitters,
    tables: Arc<MaterialTables>,
    /// Whether any material has an opacity.
    masked: bool,
    /// The records of all triangles, surface by surface.
    records: Arc<Vec<TriangleRecord>>,
    /// For each material, its texture lookups.
    lookups: Arc<Vec<Vec<Lookup>>>,
}

/// Textures with fewer bytes stay on small pages: huge pages would save little and cost more.
const SMALL_TEXTURE: usize = 1 << 16;

/// Rows and columns of the rays that find what a camera sees, for [`World::with_group_shares`].
pub const PROBES: u32 = 32;

impl World {
    /// Checks the scene and builds the hierarchy over all surfaces.
    ///
    /// Fails if an index names nothing, if a vertex array has the wrong length, or if a number is not finite.
    pub fn new(scene: Arc<ReferenceScene>) -> Result<Self, TracerError> {
        let accel = Arc::new(Accel::build(&meshes(&scene))?);
        Self::assemble(scene, accel)
    }

    /// A world of the same triangles with other materials, uvs, normals or lights. It shares `accel`.
    ///
    /// Fails as [`Self::new`] does, and if `accel` was built from other triangles.
    pub fn sharing(scene: Arc<ReferenceScene>, accel: Arc<Accel>) -> Result<Self, TracerError> {
        accel.check_triangles(&meshes(&scene))?;
        Self::assemble(scene, accel)
    }

    fn assemble(scene: Arc<ReferenceScene>, accel: Arc<Accel>) -> Result<Self, TracerError> {
        // Check surfaces; materials and lights are checked when their tables are built.
        for (index, surface) in scene.surfaces.iter().enumerate() {
            let located =
                |fault| ElementFault::Surface { surface: SurfaceIndex(index), name: Some(surface.name.clone()), fault };
            check_surface(surface, scene.materials.len()).map_err(located)?;
        }
        let textures = scene.texture_list();
        // Rays read large textures and triangle records at random: keep them on huge pages.
        let texels = textures.iter().map(Texture::bytes);
        texels.filter(|bytes| bytes.len() >= SMALL_TEXTURE).for_each(move_to_huge_pages);
        let size = accel.size;
        let records: Vec<TriangleRecord> = meshes(&scene)
            .into_par_iter()
            .flat_map_iter(|mesh| {
                (0..mesh.triangles.len()).map(move |triangle| TriangleRecord::new(mesh, TriangleIndex(triangle), size))
            })
            .collect();
        let world = Self {
            records: Arc::new(on_huge_pages(records)),
            lookups: Arc::new(scene.materials.iter().map(Material::lookups).collect()),
            emitters: Emitters::new(&scene, &textures, size)?,
            tables: Arc::new(MaterialTables::new(&scene, &textures)?),
            masked: scene.materials.iter().any(|material| material.opacity.is_some()),
            textures,
            scene,
            accel,
        };
        Ok(world.with_shared_samples())
    }

    /// Divides light samples between lamps and sky by how much of the sky reaches the places that lamps light.
    fn with_shared_samples(mut self) -> Self {
        if self.emitters.are_near_and_distant() {
            let escaping = escape_share(&self.emitters, |from, direction| self.first_behind_glass(from, direction));
            self.emitters.share_between(escaping);
        }
        self
    }

    /// The same, lit by stage lights too, whose light groups follow the scene's own. The world has no stage lights yet.
    /// Fails as [`Self::on_stage`] does.
    pub fn with_stage(self, stage: &[StageLight]) -> Result<Self, TracerError> {
        let emitters = self.emitters.with_stage(stage)?;
        Ok(Self { emitters, ..self }.with_shared_samples())
    }

    /// The same surfaces and materials, lit only by stage lights: the scene's own lamps no longer emit. Light group k
    /// is `stage[k]`. Fails if a light has no triangles, or a number is not finite.
    pub fn on_stage(&self, stage: &[StageLight]) -> Result<Self, TracerError> {
        let emitters = Emitters::on_stage(stage, self.scene.surfaces.len(), self.accel.size)?;
        Ok(Self { emitters, ..self.clone() })
    }

    /// The same world, whose light samples are divided among the light groups' surfaces in proportion to `shares`, one
    /// for each group, on average over what `camera` sees. Lamps that are nearer to a point are still sampled more
    /// often there. The expectation of every picture is unchanged; groups with larger shares have less noise. Emitters
    /// at infinity keep their share of the samples. The world has no stage lights.
    pub fn with_group_shares(&self, camera: &Camera, shares: &[f64]) -> Self {
        let Intrinsics { width, height, .. } = camera.intrinsics;
        let probe = |at: u32, pixels: u32| f64::from(pixels) * (f64::from(at) + 0.5) / f64::from(PROBES);
        let grid = (0..PROBES).flat_map(|y| (0..PROBES).map(move |x| DVec2::new(probe(x, width), probe(y, height))));
        let origin = camera.position().as_vec3();
        let rays: Vec<Ray> = grid.map(|pixel| Ray::endless(origin, camera.direction(pixel).as_vec3())).collect();
        let mut hits = Vec::new();
        self.first_hits(&rays, &mut hits);
        let points: Vec<Vec3> = hits.iter().flatten().map(|hit| self.surface_hit(hit).position).collect();
        let emitters = self.emitters.with_group_shares(&points, shares);
        Self { emitters, ..self.clone() }
    }

    pub fn scene(&self) -> &ReferenceScene {
        &self.scene
    }

    /// The hierarchy, for queries that skip surfaces and for [`Self::sharing`].
    pub fn accel(&self) -> &Arc<Accel> {
        &self.accel
    }

    pub fn textures(&self) -> &[Texture] {
        &self.textures
    }

    pub fn emitters(&self) -> &Emitters {
        &self.emitters
    }

    /// The nearest hit on a surface whose opacity there is at least one half.
    pub fn first_hit(&self, ray: &Ray) -> Option<Hit> {
        if !self.masked {
            return self.accel.closest(ray);
        }
        self.accel.closest_where(ray, |hit| self.opacity(hit) >= CUT_OUT_BELOW_OPACITY)
    }

    /// [`Self::first_hit`] of many rays at once, which is faster than one by one: `hits[k]` belongs to `rays[k]`.
    pub fn first_hits(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        if self.masked {
            self.accel.closest_many_where(rays, |_, hit| self.opacity(hit) >= CUT_OUT_BELOW_OPACITY, hits);
        } else {
            self.accel.closest_many(rays, hits);
        }
    }

    /// The first surface along a direction that is not glass.
    fn first_behind_glass(&self, from: &SurfaceHit, direction: Vec3) -> Option<SurfaceHit> {
        /// The largest number of panes in a row that are looked through. Glass behind them counts as any surface.
        const MOST_PANES: usize = 16;
        let mut met = self.surface_hit(&self.first_hit(&from.spawn(direction))?);
        for _ in 0..MOST_PANES {
            if self.material_of(met.surface).has_appearance() {
                break;
            }
            met = self.surface_hit(&self.first_hit(&met.spawn(direction))?);
        }
        Some(met)
    }

    /// Whether the nearest surface that is not wholly transparent is not wholly opaque either.
    pub(crate) fn meets_fractional_opacity(&self, ray: &Ray) -> bool {
        if !self.masked {
            return false;
        }
        let hit = self.accel.closest_where(ray, |hit| self.opacity(hit) >= *FRACTIONAL_OPACITY.start());
        hit.is_some_and(|hit| FRACTIONAL_OPACITY.contains(&self.opacity(&hit)))
    }

    /// The nearest hits of many rays; `hits[k]` belongs to `rays[k]`. A surface of opacity o is hit with probability o,
    /// drawn from `salt(k)`: the same ray, salt and scene give the same hit. Prefetches what shading reads of the
    /// triangles.
    pub(crate) fn closest_many(&self, rays: &[Ray], salt: impl Fn(usize) -> u32, hits: &mut Vec<Option<Hit>>) {
        if self.masked {
            let met = |which, hit: &Hit| self.opacity(hit) >= opacity_draw(salt(which), hit);
            self.accel.closest_many_where(rays, met, hits);
        } else {
            self.accel.closest_many(rays, hits);
        }
        for hit in hits.iter().flatten() {
            prefetch(&self.records[hit.global as usize]);
        }
    }

    /// Whether each of many rays hits anything, with opacities drawn as in [`Self::closest_many`].
    pub(crate) fn occluded_many(&self, rays: &[Ray], salt: impl Fn(usize) -> u32, occluded: &mut Vec<bool>) {
        if self.masked {
            let met = |which, hit: &Hit| self.opacity(hit) >= opacity_draw(salt(which), hit);
            self.accel.occluded_many_where(rays, met, occluded);
        } else {
            self.accel.occluded_many(rays, occluded);
        }
    }

    /// Prefetches the texels that shading reads at `place`.
    pub(crate) fn prefetch_texels(&self, place: &SurfaceHit) {
        for lookup in &self.lookups[self.scene.surfaces[place.surface.0].material.0] {
            let texture = &self.textures[lookup.texture.0];
            texture.addresses(lookup.uv.apply(place.uv).to_array()).into_iter().for_each(prefetch_line);
        }
    }

    /// The opacity at a hit; 1 if the material has none.
    pub(crate) fn opacity(&self, hit: &Hit) -> f32 {
        match &self.material_of(hit.surface).opacity {
            None => 1.0,
            Some(opacity) => opacity.at(&self.textures, self.source_uv(hit)),
        }
    }

    /// The opacity at a place; 1 if the material has none.
    pub(crate) fn opacity_at(&self, place: &SurfaceHit) -> f32 {
        self.material_of(place.surface).opacity.map_or(1.0, |opacity| opacity.at(&self.textures, place.uv))
    }

    pub fn material_of(&self, surface: SurfaceIndex) -> &Material {
        &self.scene.materials[self.scene.surfaces[surface.0].material.0]
    }

    /// The surface's own uv at a hit; zero if it has none.
    fn source_uv(&self, hit: &Hit) -> Vec2 {
        let [a, b, c] = self.records[hit.global as usize].uvs;
        a * hit.barycentrics.x + b * hit.barycentrics.y + c * hit.barycentrics.z
    }

    /// The point on the surface at a hit.
    pub fn surface_hit(&self, hit: &Hit) -> SurfaceHit {
        SurfaceHit::new(hit.surface, hit.triangle, &self.records[hit.global as usize], hit.barycentrics)
    }

    /// The BSDF of the surface's own material at `hit`, seen from `wo`, the same for all `K` variants.
    pub(crate) fn bsdf<const K: usize>(&self, hit: &SurfaceHit, wo: Vec3) -> Bsdf<'_, K> {
        let surface = &self.scene.surfaces[hit.surface.0];
        let index = surface.material.0;
        let (material, table) = (&self.scene.materials[index], self.tables.of(index));
        Bsdf::of_material(material, table, &self.textures, &surface.mesh, hit, wo)
    }
}

fn meshes(scene: &ReferenceScene) -> Vec<&TriangleMesh> {
    scene.surfaces.iter().map(|surface| &surface.mesh).collect()
}

/// A number in (0, 1], a hash of salt and triangle, so that it does not depend on the order in which triangles are met.
fn opacity_draw(salt: u32, hit: &Hit) -> f32 {
    1.0 - unit_hash(salt, hit.global)
}

fn check_surface(surface: &Surface, materials: usize) -> Result<(), SurfaceFault> {
    let (mesh, material) = (&surface.mesh, surface.material.0);
    if material >= materials {
        return Err(SurfaceFault::MissingMaterial { material, count: materials });
    }
    let vertices = mesh.positions.len();
    if let Some(normals) = &mesh.normals {
        check_attribute("normals", normals, vertices, |normal| normal.is_finite())?;
    }
    match &mesh.uvs {
        Some(uvs) => check_attribute("uvs", uvs, vertices, |uv| uv.is_finite()),
        None => Ok(()),
    }
}

fn check_attribute<T>(
    attribute: &'static str,
    values: &[T],
    expected: usize,
    is_finite: impl Fn(&T) -> bool,
) -> Result<(), SurfaceFault> {
    if values.len() != expected {
        return Err(SurfaceFault::AttributeCount { attribute, found: values.len(), expected });
    }
    match values.iter().position(|value| !is_finite(value)) {
        Some(vertex) => Err(SurfaceFault::AttributeNotFinite { attribute, vertex }),
        None => Ok(()),
    }
}
