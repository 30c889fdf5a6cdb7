//! A scene's parts as a room with possible lights, and the photo of it.

use std::sync::Arc;

use glam::DVec2;
use mateval_image::exr_io::read_linear;
use mateval_image::{LinearRgb, Mask, Normal, Picture};
use mateval_light::candidates::{Candidate, add_candidates};
use mateval_light::light_stage::scene_lights;
use mateval_light::rules::StageRules;
use mateval_scene::layout::SceneFolder;
use mateval_scene::{Camera, SceneError};
use mateval_tracer::aov::PixelHit;
use mateval_tracer::{World, aov};
use rayon::prelude::*;

use super::options::CandidateLights;
use super::part_surfaces::{NO_PART, PartSurfaces};
use super::possible_light::{PossibleLight, make_names_distinct};
use crate::error::BaselineError;
use crate::geometry::SceneGeometry;

/// The least number of pixels that show that something glows, and how much: fewer may show edges alone.
const LEAST_PIXELS: usize = 20;

/// A room whose surfaces are the parts of its instances, without glass and with everything that may be a light, and its
/// photo.
pub(super) struct PartRoom {
    pub(super) world: World,
    /// In the order of the world's light groups.
    pub(super) lights: Vec<PossibleLight>,
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
    /// The light, by its place in `lights`, whose emission each pixel shows.
    pub(super) emission: Picture<Option<usize>>,
    /// The instance of each surface.
    pub(super) owners: Vec<usize>,
}

impl PartRoom {
    /// Reads the files that methods may see: geometry, `valid.png`, `part.png` and the photo.
    pub(super) fn read(geometry: &SceneGeometry<'_>, lights: CandidateLights) -> Result<Self, BaselineError> {
        let scene = geometry.scene;
        let photo = photo(geometry)?;
        let PartSurfaces { mut room, owners, of_part } = PartSurfaces::read(geometry)?;
        // Add what may glow, and a stage, which is made for the world of instances.
        let candidates = match lights {
            CandidateLights::Room => add_candidates(&mut room, scene, &owners, &glowing(geometry)),
            CandidateLights::Stage => Vec::new(),
        };
        let stage = scene_lights(&StageRules::default(), scene, &geometry.world);
        let names = room.lights.iter().map(|light| light.name.clone());
        let mut lights: Vec<PossibleLight> = names
            .zip(&candidates)
            .map(|(name, candidate)| PossibleLight::of_candidate(name, *candidate, &scene.instances))
            .collect();
        lights.extend(stage.iter().map(PossibleLight::of_stage));
        make_names_distinct(&mut lights);
        let stage: Vec<_> = stage.into_iter().map(|light| light.light).collect();
        let world = World::new(Arc::new(room))?.with_stage(&stage)?;
        // Find what each pixel shows.
        let parts = geometry.part_picture(None)?.map(|part| of_part.get(&part).copied().unwrap_or(NO_PART));
        let (width, height) = (photo.width(), photo.height());
        let valid = Mask::from_fn(width, height, |x, y| geometry.valid.get(x, y) && parts.get(x, y) != NO_PART);
        let camera = geometry.view.camera;
        let hits = hits(&world, &camera);
        let normals = hits.map(|hit| Normal(hit.as_ref().map_or([0.0; 3], |hit| hit.normal.to_array())));
        let emission = Picture::from_fn(width, height, |x, y| {
            let hit = hits.get(x, y);
            let owner = hit.as_ref().map(|hit| owners[hit.surface.0]);
            candidates.iter().position(|candidate| shows(geometry, *candidate, owner, [x, y]))
        });
        let shown = (0..lights.len()).map(|light| mean_of_pixels(&photo, &emission, light)).collect();
        Ok(Self { world, lights, shown, camera, photo, valid, parts, normals, emission, owners })
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
    if !photo.same_size(&geometry.valid) {
        let what = "it is not as large as scene.json says; run `mateval prep verify`".to_owned();
        return Err(SceneError::Unsupported { path, what }.into());
    }
    Ok(photo.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v.max(0.0)))))
}

/// Whether each instance glows: it has an atlas, so that it is not glass, and most of its pixels in the input view are
/// not valid.
fn glowing(geometry: &SceneGeometry<'_>) -> Vec<bool> {
    let instances = &geometry.scene.instances;
    let largest = instances.iter().map(|instance| instance.index.0.get()).max().unwrap_or(0);
    let mut counts = vec![[0_usize; 2]; usize::from(largest) + 1];
    for (instance, valid) in geometry.instances.pixels().iter().zip(geometry.valid.pixels()) {
        if let Some(count) = counts.get_mut(usize::from(*instance)) {
            count[usize::from(*valid)] += 1;
        }
    }
    let glows = |[invalid, valid]: [usize; 2]| invalid > valid && invalid >= LEAST_PIXELS;
    let counts = instances.iter().map(|instance| counts[usize::from(instance.index.0.get())]);
    instances.iter().zip(counts).map(|(instance, count)| instance.atlas.is_some() && glows(count)).collect()
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

/// Whether a pixel shows the emission of a candidate. `owner` is the instance that its centre meets, glass apart; none
/// for the world around.
fn shows(geometry: &SceneGeometry<'_>, candidate: Candidate, owner: Option<usize>, [x, y]: [usize; 2]) -> bool {
    let Some(owner) = owner else {
        let towards = geometry.view.camera.direction(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        return candidate.is_seen_towards(towards.as_vec3().to_array());
    };
    // Not through glass, which has pixels of its own.
    let is_seen = geometry.instances.get(x, y) == geometry.scene.instances[owner].index.0.get();
    candidate == Candidate::Instance(owner) && is_seen && !geometry.valid.get(x, y)
}

/// The mean of the pixels that show a light; none if there are too few.
fn mean_of_pixels(photo: &Picture<LinearRgb>, emission: &Picture<Option<usize>>, light: usize) -> Option<[f64; 3]> {
    let (mut sum, mut count) = ([0.0; 3], 0);
    for (pixel, _) in photo.pixels().iter().zip(emission.pixels()).filter(|(_, shown)| **shown == Some(light)) {
        sum.iter_mut().zip(pixel.0).for_each(|(sum, value)| *sum += f64::from(value));
        count += 1;
    }
    (count >= LEAST_PIXELS).then(|| sum.map(|v| v / count as f64))
}
