//! A scene's parts as a room with the lights that may shine in it, and the photo of it.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec2;
use mateval_dataset::dataset::Instance;
use mateval_dataset::material::{ColorInput, Material, MaterialModel};
use mateval_dataset::reference::{MaterialIndex, ReferenceScene, Surface};
use mateval_dataset::{Camera, DatasetError, glb, word_enum};
use mateval_image::exr_io::read_linear;
use mateval_image::{LinearRgb, Mask, Normal, Picture};
use mateval_light::candidates::{Candidate, add_candidates, sky_extent_deg};
use mateval_light::light_stage::{FLASH, NamedLight, StageRules, flash_light, scene_lights};
use mateval_light::photo_pixels::PhotoRules;
use mateval_tracer::aov::PixelHit;
use mateval_tracer::{World, aov};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::error::BaselineError;
use crate::geometry::{SceneGeometry, photo_file};

word_enum! {
    CandidateLights, a "set of lights":
    /// What may glow in the room, the world around it, and the lights of a stage.
    Room = "room",
    /// The lights of a stage alone, as in PSDR-Room.
    Stage = "stage",
}

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
    /// The pixels of `valid` that light is fitted to. Clipped pixels of a photo from elsewhere are left out: they state
    /// only a lower bound of the radiance.
    pub(super) fitted: Mask,
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
        let scene = geometry.scene;
        let photo = photo(geometry)?;
        let PartSurfaces { mut room, owners, of_part } = PartSurfaces::read(geometry)?;
        // Add what may glow, and a stage, which is made for the world of instances. A flash may be the only light.
        let has_room_light = scene.flash.as_ref().is_none_or(|flash| !flash.only_light);
        let candidates = match lights {
            CandidateLights::Room if has_room_light => add_candidates(&mut room, scene, &owners, &glowing(geometry)),
            _ => Vec::new(),
        };
        let stage = scene_lights(&StageRules::default(), scene, &geometry.world);
        let names = room.lights.iter().map(|light| light.name.clone());
        let mut lights: Vec<PossibleLight> = names
            .zip(&candidates)
            .map(|(name, candidate)| PossibleLight::of_candidate(name, *candidate, &scene.instances))
            .collect();
        lights.extend(stage.iter().map(PossibleLight::of_stage));
        let mut stage: Vec<_> = stage.into_iter().map(|light| light.light).collect();
        let flash = scene.flash.as_ref().filter(|flash| flash.views.contains(&geometry.view.id));
        if let Some(flash) = flash {
            let source = LightSource::Flash { offset_m: flash.offset_m, is_known: flash.intensity.is_some() };
            lights.push(PossibleLight { name: FLASH.to_owned(), source });
            stage.push(flash_light(flash, &geometry.view.camera));
        }
        make_names_distinct(&mut lights);
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
        let mut shown: Vec<_> = (0..lights.len()).map(|light| mean_of_pixels(&photo, &emission, light)).collect();
        if let (Some(flash), Some(shown)) = (flash, shown.last_mut()) {
            *shown = flash.intensity;
        }
        let limit = PhotoRules::default().clipped_from / scene.clipping_exposure(&geometry.view.id);
        let is_clipped = |LinearRgb(rgb): LinearRgb| rgb.iter().any(|v| f64::from(*v) >= limit);
        let fitted = Mask::from_fn(width, height, |x, y| {
            valid.get(x, y) && (scene.photo.is_none() || !is_clipped(photo.get(x, y)))
        });
        Ok(Self { world, lights, shown, camera, photo, valid, fitted, parts, normals, owners })
    }
}

/// The photo as it was rendered: linear, before exposure, with radiances above 1. A denoiser may leave values below 0.
fn photo(geometry: &SceneGeometry<'_>) -> Result<Picture<LinearRgb>, BaselineError> {
    let path = photo_file(&geometry.folder, geometry.view)?;
    let photo = read_linear(&path)?;
    if !photo.same_size(&geometry.valid) {
        let what = "it is not as large as scene.json says; run `mateval prep verify`".to_owned();
        return Err(DatasetError::Unsupported { path, what }.into());
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

/// The pixel shows no part.
pub(super) const NO_PART: u16 = u16::MAX;

/// One surface for each part of an instance that has an atlas. Glass has none: light passes it.
pub(super) struct PartSurfaces {
    /// The surfaces, without lights.
    pub(super) room: ReferenceScene,
    /// The instance of each surface.
    pub(super) owners: Vec<usize>,
    /// The surface of each index in `part.png`.
    pub(super) of_part: BTreeMap<u16, u16>,
}

impl PartSurfaces {
    /// Reads `parts.glb`. Fails if its nodes are not the parts of `scene.json`.
    pub(super) fn read(geometry: &SceneGeometry<'_>) -> Result<Self, BaselineError> {
        let (scene, path) = (geometry.scene, geometry.folder.parts(None));
        let instance_at: BTreeMap<&str, usize> =
            scene.instances.iter().enumerate().map(|(at, instance)| (instance.id.as_str(), at)).collect();
        let nodes = glb::read(&path)?;
        let unsupported = |what: &str| DatasetError::Unsupported { path: path.clone(), what: what.to_owned() };
        if !nodes.iter().map(|node| node.name.as_str()).eq(scene.parts.iter().map(|part| part.id.as_str())) {
            return Err(unsupported("its nodes are not the parts of scene.json; run `mateval prep verify`").into());
        }
        let room = ReferenceScene { materials: vec![grey()], ..ReferenceScene::default() };
        let mut found = Self { room, owners: Vec::new(), of_part: BTreeMap::new() };
        for (part, node) in scene.parts.iter().zip(nodes) {
            let owner = instance_at.get(part.instance.as_str()).copied();
            let Some(owner) = owner.filter(|owner| scene.instances[*owner].atlas.is_some()) else { continue };
            let surface = u16::try_from(found.owners.len()).ok().filter(|surface| *surface != NO_PART);
            let surface = surface.ok_or_else(|| unsupported("it has more parts than part.png can hold"))?;
            found.of_part.insert(part.index.0.get(), surface);
            found.owners.push(owner);
            found.room.surfaces.push(Surface { name: node.name, mesh: node.mesh, material: MaterialIndex(0) });
        }
        Ok(found)
    }
}

/// A material that no path asks for: what is assumed of surfaces takes its place.
fn grey() -> Material {
    Material {
        name: String::new(),
        model: MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None },
        two_sided: true,
        opacity: None,
        bump: None,
    }
}

/// A light that may shine, of radiance 1.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PossibleLight {
    /// The id of the instance, `ceilings`, `world`, `world_<sector>`, or the name of the light of the stage; unique in
    /// its scene.
    pub name: String,
    /// What has the radiance.
    pub source: LightSource,
}

#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum LightSource {
    /// Both sides of all surfaces of an instance.
    Instance {
        /// The instance's id.
        instance: String,
    },
    /// Both sides of all ceilings.
    Ceilings {},
    /// The world around, alike in all directions.
    World {},
    /// The world around, in a range of directions.
    Sky {
        /// From and to: 0 is -Z, 90 is +X.
        azimuth_deg: [f32; 2],
        /// From and to: 90 is +Y, straight up.
        elevation_deg: [f32; 2],
    },
    /// The flash at the camera, which shines in all directions alike and blocks no light. Its radiance is its radiant
    /// intensity, in the unit of radiance times square metres.
    Flash {
        /// From the camera: to the right, up, and back from what it looks at.
        offset_m: [f64; 3],
        /// Whether the scene states its intensity, which is then kept but for a small tolerance.
        is_known: bool,
    },
    /// The front of a quad of the light stage. It casts no shadow, and surfaces reflect it diffusely alone.
    Quad {
        /// World space, anticlockwise as seen from the front.
        corners_m: Vec<[f32; 3]>,
    },
}

/// A light with the radiance that was fitted to it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedLight {
    #[serde(flatten)]
    pub light: PossibleLight,
    /// Linear Rec. 709, before the scene's exposure.
    pub radiance: [f64; 3],
}

impl PossibleLight {
    /// A candidate among the instances of a scene.
    fn of_candidate(name: String, candidate: Candidate, instances: &[Instance]) -> Self {
        let source = match candidate {
            Candidate::Instance(at) => LightSource::Instance { instance: instances[at].id.to_string() },
            Candidate::Ceilings => LightSource::Ceilings {},
            Candidate::World => LightSource::World {},
            Candidate::Sky(sector) => {
                let [azimuth_deg, elevation_deg] = sky_extent_deg(sector);
                LightSource::Sky { azimuth_deg, elevation_deg }
            }
        };
        Self { name, source }
    }

    fn of_stage(light: &NamedLight) -> Self {
        let mesh = &light.light.mesh;
        // The front is where the corners of the first triangle run anticlockwise.
        let order = if mesh.triangles[0] == [0, 1, 2] { [0, 1, 2, 3] } else { [0, 3, 2, 1] };
        let corners_m = order.map(|corner| mesh.positions[corner].to_array()).to_vec();
        Self { name: light.name.clone(), source: LightSource::Quad { corners_m } }
    }
}

/// Numbers the lights that share a name with an earlier one: an instance may be called `camera`, as is a light of the
/// stage. The second `camera` becomes `camera#2`, which no id can be.
fn make_names_distinct(lights: &mut [PossibleLight]) {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for light in lights {
        let count = counts.entry(light.name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            light.name = format!("{}#{count}", light.name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_distinct() {
        let light = |name: &str| PossibleLight { name: name.to_owned(), source: LightSource::World {} };
        let mut lights = ["camera", "world", "camera", "camera"].map(light);
        make_names_distinct(&mut lights);
        assert_eq!(lights.map(|light| light.name), ["camera", "world", "camera#2", "camera#3"]);
    }
}
