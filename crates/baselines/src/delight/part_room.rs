//! A scene's parts as a room with possible lights, and the photo of it.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec2;
use mateval_image::exr_io::read_linear;
use mateval_image::{LinearRgb, Mask, Normal, Picture};
use mateval_light::candidates::{Candidate, add_candidates};
use mateval_light::light_stage::{NamedLight, scene_lights};
use mateval_light::rules::StageRules;
use mateval_scene::layout::SceneFolder;
use mateval_scene::material::{ColorInput, Material, MaterialModel};
use mateval_scene::reference::{MaterialIndex, ReferenceScene, Surface};
use mateval_scene::{Camera, SceneError, glb};
use mateval_tracer::aov::PixelHit;
use mateval_tracer::{World, aov};
use rayon::prelude::*;

use super::options::CandidateLights;
use crate::error::BaselineError;
use crate::geometry::SceneGeometry;

/// The pixel shows no part.
pub(super) const NO_PART: u16 = u16::MAX;

/// The least number of pixels that show that something glows, and how much: fewer may show edges alone.
const LEAST_PIXELS: usize = 20;

/// A room whose surfaces are the parts of its instances, without glass and with everything that may be a light, and its
/// photo.
pub(super) struct PartRoom {
    pub(super) world: World,
    /// The name of each light.
    pub(super) lights: Vec<String>,
    /// The radiance that the photo shows of each light, linear, before exposure.
    pub(super) shown: Vec<Option<[f64; 3]>>,
    pub(super) camera: Camera,
    /// Linear, before exposure.
    pub(super) photo: Picture<LinearRgb>,
    /// Valid pixels of a known part.
    pub(super) valid: Mask,
    /// The surface of each pixel's part, or [`NO_PART`].
    pub(super) parts: Picture<u16>,
    /// World-space normals, towards the camera.
    pub(super) normals: Picture<Normal>,
    /// The instance of each surface.
    pub(super) owners: Vec<usize>,
}

impl PartRoom {
    /// Reads the files that methods may see: geometry, `valid.png`, `part.png` and the photo.
    pub(super) fn read(geometry: &SceneGeometry<'_>, lights: CandidateLights) -> Result<Self, BaselineError> {
        let (scene, folder) = (geometry.scene, &geometry.folder);
        let photo = photo(geometry)?;
        let instance_at: BTreeMap<&str, usize> =
            scene.instances.iter().enumerate().map(|(at, instance)| (instance.id.as_str(), at)).collect();
        // Glass has no atlas; light passes it.
        let nodes = glb::read(&folder.parts(None))?;
        let unsupported = |what: &str| SceneError::Unsupported { path: folder.parts(None), what: what.to_owned() };
        if !nodes.iter().map(|node| node.name.as_str()).eq(scene.parts.iter().map(|part| part.id.as_str())) {
            return Err(unsupported("its nodes are not the parts of scene.json; run `mateval prep verify`").into());
        }
        let grey = Material {
            name: String::new(),
            model: MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None },
            two_sided: true,
            opacity: None,
            bump: None,
        };
        let mut room = ReferenceScene { materials: vec![grey], ..ReferenceScene::default() };
        let (mut owners, mut surface_of_part) = (Vec::new(), BTreeMap::new());
        for (part, node) in scene.parts.iter().zip(nodes) {
            let Some(&owner) = instance_at.get(part.instance.as_str()) else { continue };
            if scene.instances[owner].atlas.is_none() {
                continue;
            }
            let surface = u16::try_from(owners.len()).ok().filter(|surface| *surface != NO_PART);
            let surface = surface.ok_or_else(|| unsupported("it has more parts than part.png can hold"))?;
            surface_of_part.insert(part.index.0.get(), surface);
            owners.push(owner);
            room.surfaces.push(Surface { name: node.name, mesh: node.mesh, material: MaterialIndex(0) });
        }
        let candidates = match lights {
            CandidateLights::Room => add_candidates(&mut room, scene, &owners, &glowing(geometry)),
            CandidateLights::Stage => Vec::new(),
        };
        let mut names: Vec<String> = room.lights.iter().map(|light| light.name.clone()).collect();
        let world = World::new(Arc::new(room))?;
        // The stage is made for the world of instances.
        let stage: Vec<NamedLight> = scene_lights(&StageRules::default(), scene, &geometry.world);
        names.extend(stage.iter().map(|light| light.name.clone()));
        let stage: Vec<_> = stage.into_iter().map(|light| light.light).collect();
        let world = world.with_stage(&stage)?;
        let camera = geometry.view.camera;
        let parts = geometry.part_picture(None)?.map(|part| surface_of_part.get(&part).copied().unwrap_or(NO_PART));
        let valid =
            Mask::from_fn(photo.width(), photo.height(), |x, y| geometry.valid.get(x, y) && parts.get(x, y) != NO_PART);
        let hits = hits(&world, &camera);
        let normals = hits.map(|hit| Normal(hit.as_ref().map_or([0.0; 3], |hit| hit.normal.to_array())));
        let shows = |candidate: Candidate, x: usize, y: usize| match hits.get(x, y) {
            // Not through glass, which has pixels of its own.
            Some(hit) => {
                let owner = owners[hit.surface.0];
                let is_seen = geometry.instances.get(x, y) == scene.instances[owner].index.0.get();
                candidate == Candidate::Instance(owner) && is_seen && !geometry.valid.get(x, y)
            }
            None => {
                let towards = camera.direction(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
                candidate.is_seen_towards(towards.as_vec3().to_array())
            }
        };
        let mut shown: Vec<_> =
            candidates.into_iter().map(|candidate| mean(&photo, |x, y| shows(candidate, x, y))).collect();
        shown.resize(names.len(), None);
        Ok(Self { world, lights: names, shown, camera, photo, valid, parts, normals, owners })
    }
}

/// The photo as it was rendered: linear, before exposure, with radiances above 1. A denoiser may leave values below 0.
fn photo(geometry: &SceneGeometry<'_>) -> Result<Picture<LinearRgb>, BaselineError> {
    let folder: &SceneFolder = &geometry.folder;
    let path = folder.view(&geometry.view.id).join("rgb.exr");
    if !path.is_file() {
        return Err(BaselineError::NoPhoto(path));
    }
    let photo = read_linear(&path)?;
    if (photo.width(), photo.height()) != (geometry.valid.width(), geometry.valid.height()) {
        let what = "it is not as large as scene.json says; run `mateval prep verify`".to_owned();
        return Err(SceneError::Unsupported { path, what }.into());
    }
    Ok(photo.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v.max(0.0)))))
}

/// Whether each instance glows: it has an atlas, so that it is not glass, and most of its pixels in the input view are
/// not valid.
fn glowing(geometry: &SceneGeometry<'_>) -> Vec<bool> {
    let scene = geometry.scene;
    let mut counts: BTreeMap<u16, [usize; 2]> = BTreeMap::new();
    for (instance, valid) in geometry.instances.pixels().iter().zip(geometry.valid.pixels()) {
        counts.entry(*instance).or_default()[usize::from(*valid)] += 1;
    }
    let glows =
        |index: u16| counts.get(&index).is_some_and(|[invalid, valid]| invalid > valid && *invalid >= LEAST_PIXELS);
    scene.instances.iter().map(|instance| instance.atlas.is_some() && glows(instance.index.0.get())).collect()
}

/// What the centre of each pixel shows.
fn hits(world: &World, camera: &Camera) -> Picture<Option<PixelHit>> {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let hit = |k: usize| {
        let centre = DVec2::new((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
        aov::hit_through(world, camera, centre)
    };
    let hits: Vec<_> = (0..width * height).into_par_iter().map(hit).collect();
    Picture::from_fn(width, height, |x, y| hits[y * width + x])
}

/// The mean of these pixels; none if there are too few.
fn mean(photo: &Picture<LinearRgb>, which: impl Fn(usize, usize) -> bool) -> Option<[f64; 3]> {
    let pixels = (0..photo.height()).flat_map(|y| (0..photo.width()).map(move |x| (x, y)));
    let (mut sum, mut count) = ([0.0; 3], 0);
    for (x, y) in pixels.filter(|(x, y)| which(*x, *y)) {
        sum.iter_mut().zip(photo.get(x, y).0).for_each(|(sum, value)| *sum += f64::from(value));
        count += 1;
    }
    (count >= LEAST_PIXELS).then(|| sum.map(|v| v / count as f64))
}
