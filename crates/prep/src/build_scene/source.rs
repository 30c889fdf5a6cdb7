//! A recipe's scene read from whatever it comes from, with its input camera.

use std::path::Path;

use glam::DVec3;
use mateval_scene::camera::{Camera, Intrinsics};
use mateval_scene::{SceneLights, SourceKind};

use super::views_of;
use crate::error::PrepError;
use crate::recipe::{Front3dRoom, GivenCamera, RESOLUTION, Recipe, RecipeCamera, RecipeScene, RecipeSource};
use mateval_sources::bitterli;
use mateval_sources::front3d::camera_sampler::{RoomSampler, SamplerRules};
use mateval_sources::front3d::{self, FurnishedHouse, HouseFiles};
use mateval_sources::source_scene::{InstanceOrigin, SourceScene};
use mateval_tracer::World;

/// Pictures of a room where the recipe names no size.
const DEFAULT_RESOLUTION: [u32; 2] = [480, 270];

/// Reads the scene; paths are relative to `root`.
pub(super) fn read(recipe: &Recipe, entry: &RecipeScene, root: &Path) -> Result<SourceScene, PrepError> {
    let fault = |what: String| PrepError::Scene { scene: entry.id.to_string(), what };
    match entry.source().map_err(fault)? {
        RecipeSource::Bitterli(xml) => bitterli_scene(recipe, entry, root, xml),
        RecipeSource::Front3d(room) => front3d_scene(recipe, entry, root, room),
    }
}

fn bitterli_scene(recipe: &Recipe, entry: &RecipeScene, root: &Path, xml: &Path) -> Result<SourceScene, PrepError> {
    let fault = |what: String| PrepError::Scene { scene: entry.id.to_string(), what };
    let read = bitterli::read(&root.join(xml), &bitterli::Limits::default())?;
    let folder = xml.parent().and_then(Path::file_name);
    Ok(SourceScene {
        kind: SourceKind::Bitterli,
        lights: SceneLights::Own,
        house: folder.map_or_else(|| entry.id.to_string(), |name| name.to_string_lossy().into_owned()),
        file: xml.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        origins: vec![InstanceOrigin::default(); read.scene.surfaces.len()],
        camera: camera_of_film(recipe, entry, &read.camera).map_err(fault)?,
        scene: read.scene,
        findings: read.findings,
        licence: read.licence,
        files: read.source_files,
        absent: read.absent_files,
    })
}

/// The source's camera or the recipe's, at the recipe's resolution: the horizontal field of view is kept.
fn camera_of_film(recipe: &Recipe, entry: &RecipeScene, source: &Camera) -> Result<Camera, String> {
    let old = source.intrinsics;
    let [width, height] = entry.resolution.or(recipe.resolution).unwrap_or([old.width, old.height]);
    if ![width, height].iter().all(|side| RESOLUTION.contains(side)) {
        return Err(format!(
            "the source's film is {width}x{height}; name a resolution of 16 to 8192 a side in the recipe"
        ));
    }
    if let Some(RecipeCamera::Given(given)) = &entry.camera {
        return given_camera(given, [width, height]);
    }
    let scale = f64::from(width) / f64::from(old.width);
    let intrinsics = Intrinsics {
        width,
        height,
        fx: old.fx * scale,
        fy: old.fy * scale,
        cx: old.cx * scale,
        cy: (old.cy - f64::from(old.height) / 2.0) * scale + f64::from(height) / 2.0,
    };
    Ok(Camera { intrinsics, ..*source })
}

fn given_camera(given: &GivenCamera, [width, height]: [u32; 2]) -> Result<Camera, String> {
    let GivenCamera { position, target, fov_y_deg } = *given;
    let intrinsics = Intrinsics::from_fov_y(width, height, fov_y_deg.to_radians());
    let camera = Camera::look_at(DVec3::from_array(position), DVec3::from_array(target), DVec3::Y, intrinsics);
    camera.ok_or_else(|| "camera: position and target must differ, and not only in height".to_owned())
}

fn front3d_scene(
    recipe: &Recipe,
    entry: &RecipeScene,
    root: &Path,
    room: &Front3dRoom,
) -> Result<SourceScene, PrepError> {
    let fault = |what: String| PrepError::Scene { scene: entry.id.to_string(), what };
    let house = front3d::furnish(&files(root, room), &front3d::Limits::default())?;
    let Some(number) = house.house.room(&room.room) else {
        let rooms: Vec<&str> = house.house.rooms.iter().map(|room| room.id.as_str()).collect();
        let what = format!("the house has no room '{}'; it has '{}'", room.room, rooms.join("', '"));
        return Err(fault(what));
    };
    // The camera sampler and the choice of what the views see share one world.
    let world = World::new(house.scene.clone())?;
    let camera = room_camera(recipe, entry, &house, &world, number).map_err(fault)?;
    let views: Vec<Camera> = views_of(recipe, camera).iter().map(|view| view.camera).collect();
    Ok(front3d::room_scene::room_scene(&house, &world, number, &views))
}

/// Where the files of a recipe's room are.
fn files(root: &Path, room: &Front3dRoom) -> HouseFiles {
    HouseFiles {
        root: root.to_owned(),
        house: room.house.clone(),
        models: room.models.clone(),
        textures: room.textures.clone(),
        cameras: room.cameras.clone(),
        blenderproc_compat: room.blenderproc_compat,
    }
}

fn room_camera(
    recipe: &Recipe,
    entry: &RecipeScene,
    house: &FurnishedHouse,
    world: &World,
    room: usize,
) -> Result<Camera, String> {
    let resolution = entry.resolution.or(recipe.resolution).unwrap_or(DEFAULT_RESOLUTION);
    match &entry.camera {
        None => Err("a room needs a camera, as in `camera = { seed = 1 }`".to_owned()),
        Some(RecipeCamera::Given(given)) => given_camera(given, resolution),
        Some(RecipeCamera::Designer(number)) => {
            let Some(camera) = house.cameras.iter().find(|camera| camera.number == *number) else {
                let numbers: Vec<String> = house.cameras.iter().map(|camera| camera.number.to_string()).collect();
                return Err(format!("there is no designer's camera {number}; there are {}", numbers.join(", ")));
            };
            let (position, target) = (camera.position.to_array(), camera.target.to_array());
            given_camera(&GivenCamera { position, target, fov_y_deg: camera.fov_y_deg }, resolution)
        }
        Some(RecipeCamera::Seed { seed, fov_y_deg }) => {
            let [width, height] = resolution;
            let intrinsics = Intrinsics::from_fov_y(width, height, fov_y_deg.to_radians());
            let turns: Vec<[f64; 2]> = recipe.views.iter().map(|view| [view.x_deg, view.y_deg]).collect();
            let rules = SamplerRules::default();
            let sampler = RoomSampler::new(house, world, room);
            let found = sampler.and_then(|sampler| sampler.sample(intrinsics, &turns, &rules, *seed));
            found.map(|found| found.camera).map_err(|error| error.to_string())
        }
    }
}
