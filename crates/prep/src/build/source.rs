//! Reads a recipe's scene from its source, and chooses the input camera.

use std::ffi::OsStr;
use std::path::Path;

use glam::DVec3;
use mateval_dataset::camera::{Camera, Intrinsics};
use mateval_dataset::dataset::View;
use mateval_dataset::ids::quoted;
use mateval_dataset::layout::INPUT;
use mateval_dataset::material::StatedParameters;
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{Finding, Progress, Report, Severity, SourceKind, ViewId};
use mateval_files::FileError;
use mateval_files::source_folder::SourceFolder;
use mateval_sources::blend::{BakeFault, bake};
use mateval_sources::capture::{self, Capture, CaptureFiles};
use mateval_sources::front3d::camera_sampler::RoomSampler;
use mateval_sources::front3d::{self, FurnishedHouse, HouseFiles};
use mateval_sources::source_scene::{FileScene, InstanceOrigin, Missing, SourceScene};
use mateval_sources::{bitterli, gltf};
use mateval_tracer::World;

use super::fault::{BuildFault, above_notes};
use super::photo::{pinhole, read_captured};
use crate::error::PrepError;
use crate::recipe::fault::RecipeSceneFault;
use crate::recipe::{
    CapturedRoom, Front3dRoom, GivenCamera, RESOLUTION, Recipe, RecipeCamera, RecipeScene, RecipeSource,
};
use crate::render::BlenderOptions;

/// Width and height in pixels where neither the recipe nor a glTF with a camera states them.
const DEFAULT_SIZE: [u32; 2] = [480, 270];

/// Texels of baked textures, in metres: half a pixel of 320 columns at 1.5 m.
const BAKED_TEXEL_M: f64 = 0.002;

/// A larger share of the valid pixels of the input view without a stated base colour refuses the scene.
pub(super) const MOST_UNSTATED: f64 = 0.05;

/// How a Blender file is read.
pub(super) struct Baking<'a> {
    /// Absent if no Blender was found.
    pub(super) blender: Option<&'a BlenderOptions>,
    /// A folder for what is removed afterwards.
    pub(super) folder: &'a Path,
    pub(super) progress: Progress<'a>,
}

/// Reads the scene; paths are relative to `root`.
pub(super) fn read_source(
    recipe: &Recipe,
    entry: &RecipeScene,
    root: &Path,
    baking: &Baking<'_>,
) -> Result<SourceScene, PrepError> {
    match entry.source().map_err(PrepError::scene(&entry.id))? {
        RecipeSource::Bitterli(xml) => bitterli_scene(recipe, entry, root, xml),
        RecipeSource::Front3d(room) => front3d_scene(recipe, entry, root, room),
        RecipeSource::Gltf(file) => gltf_scene(recipe, entry, &root.join(file), file),
        RecipeSource::Blend(file) => blend_scene(recipe, entry, root, file, baking),
        RecipeSource::Capture(room) => captured_scene(recipe, entry, root, room),
    }
}

/// The place of the recipe's own camera, if it states one.
fn given_place(entry: &RecipeScene) -> Option<DVec3> {
    match &entry.camera {
        Some(RecipeCamera::Given(given)) => Some(DVec3::from_array(given.position)),
        _ => None,
    }
}

/// Whether a parameter is stated for all but a small share of the surfaces' area.
fn states(scene: &ReferenceScene, origins: &[InstanceOrigin], stated: fn(&StatedParameters) -> bool) -> bool {
    let (mut all, mut unstated) = (0.0, 0.0);
    for (surface, origin) in scene.surfaces.iter().zip(origins) {
        if scene.materials[surface.material.0].has_appearance() {
            let area = surface.mesh.area();
            all += area;
            unstated += if stated(&origin.stated) { 0.0 } else { area };
        }
    }
    unstated <= MOST_UNSTATED * all
}

fn bitterli_scene(recipe: &Recipe, entry: &RecipeScene, root: &Path, xml: &Path) -> Result<SourceScene, PrepError> {
    let read = bitterli::read(&root.join(xml), given_place(entry), &bitterli::Limits::default())?;
    let camera = bitterli_camera(recipe, entry, &read).map_err(PrepError::scene(&entry.id))?;
    let folder = xml.parent().and_then(Path::file_name);
    Ok(scene_of_file(read, SourceKind::Bitterli, folder, entry, xml, camera))
}

/// The scene of the `file` that the recipe names, seen from `camera`. The house is named after the scene without
/// `house`.
fn scene_of_file(
    read: FileScene,
    kind: SourceKind,
    house: Option<&OsStr>,
    entry: &RecipeScene,
    file: &Path,
    camera: Camera,
) -> SourceScene {
    SourceScene {
        kind,
        states_roughness: states(&read.scene, &read.origins, |stated| stated.roughness),
        states_metallic: states(&read.scene, &read.origins, |stated| stated.metallic),
        house: house.map_or_else(|| entry.id.to_string(), |name| name.to_string_lossy().into_owned()),
        file: file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        read,
        camera,
        captured: None,
        novel: Vec::new(),
        other_poses: Vec::new(),
    }
}

/// The scene of a captured room, seen by the camera of its input photo.
fn captured_scene(
    recipe: &Recipe,
    entry: &RecipeScene,
    root: &Path,
    room: &CapturedRoom,
) -> Result<SourceScene, PrepError> {
    let path = |path: &Path| path.to_string_lossy().into_owned();
    let files = CaptureFiles {
        root: root.to_owned(),
        mesh: path(&room.mesh),
        cameras: path(&room.cameras),
        photos: path(&room.photos),
        input: room.input.clone(),
        novel: room.novel.clone(),
        labels: room.labels.as_deref().map(path),
        scale: room.scale,
        up: DVec3::from_array(room.up),
        architecture: room.architecture.clone(),
    };
    let Capture { mut read, input: (photo, camera), novel, other_poses } = capture::read(&files)?;
    let fault = |fault| PrepError::scene(&entry.id)(BuildFault::Photo(fault));
    let (captured, file) = read_captured(root, &photo, camera.lens).map_err(fault)?;
    read.files.extend(file);
    let own_size = [captured.lens.width, captured.lens.height];
    let size = picture_size(recipe, entry, own_size).map_err(PrepError::scene(&entry.id))?;
    let intrinsics = pinhole(&captured, size).map_err(fault)?;
    let camera = Camera::from_rotation(camera.rotation, camera.position, intrinsics);
    // Photos of one room are in one folder, which names the house without `house`.
    let house = room.mesh.parent().and_then(Path::file_name);
    let scene = scene_of_file(read, SourceKind::Capture, house, entry, &room.mesh, camera);
    Ok(SourceScene { file: files.mesh, captured: Some(captured), novel, other_poses, ..scene })
}

/// The source's or the recipe's camera at the recipe's resolution. The source's horizontal field of view is kept.
fn bitterli_camera(recipe: &Recipe, entry: &RecipeScene, read: &FileScene) -> Result<Camera, BuildFault> {
    let source = read.camera.ok_or_else(|| no_camera(read))?;
    let old = source.intrinsics;
    let [width, height] = picture_size(recipe, entry, [old.width, old.height])?;
    if let Some(RecipeCamera::Given(given)) = &entry.camera {
        return given_camera(given, [width, height], read.shift_m);
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
    Ok(Camera { intrinsics, ..source })
}

/// The recipe's resolution, or else the source's. Fails where that is out of range.
fn picture_size(recipe: &Recipe, entry: &RecipeScene, own: [u32; 2]) -> Result<[u32; 2], BuildFault> {
    let [width, height] = entry.resolution.or(recipe.resolution).unwrap_or(own);
    if [width, height].iter().all(|side| RESOLUTION.contains(side)) {
        return Ok([width, height]);
    }
    let (least, most) = RESOLUTION.into_inner();
    Err(BuildFault::FilmSize { width, height, least, most })
}

/// The scene of the glTF at `path`, which the recipe names as `file`.
fn gltf_scene(recipe: &Recipe, entry: &RecipeScene, path: &Path, file: &Path) -> Result<SourceScene, PrepError> {
    let read = gltf::read(path, given_place(entry), &gltf::Limits::default())?;
    let camera = gltf_camera(recipe, entry, &read).map_err(PrepError::scene(&entry.id))?;
    let aspect = read.aspect.filter(|_| !matches!(entry.camera, Some(RecipeCamera::Given(_))));
    let mut scene = scene_of_file(read, SourceKind::Gltf, file.file_stem(), entry, file, camera);
    scene.read.findings.extend(aspect.and_then(|aspect| other_aspect(aspect, &camera, &scene.file)));
    scene.read.findings.sort();
    Ok(scene)
}

/// A note where the picture is half a row or more higher or lower than the aspect ratio of the file's camera asks for.
fn other_aspect(aspect: f64, camera: &Camera, file: &str) -> Option<Finding> {
    let [width, height] = [camera.intrinsics.width, camera.intrinsics.height];
    let rows = f64::from(width) / aspect;
    if (rows - f64::from(height)).abs() <= 0.5 + 1e-3 {
        return None;
    }
    let message =
        format!("the file's camera states {aspect:.4} for width over height, the picture has {width}x{height}");
    let more = if rows > f64::from(height) { "more" } else { "less" };
    let action = format!("kept the vertical field of view: the picture shows {more} at its sides");
    Some(Finding::new(Severity::Note, "other_aspect_ratio", file, "/cameras", message, action))
}

/// The scene of a Blender file: baked to a glTF, with the light from outside that glTF does not have.
fn blend_scene(
    recipe: &Recipe,
    entry: &RecipeScene,
    root: &Path,
    file: &Path,
    baking: &Baking<'_>,
) -> Result<SourceScene, PrepError> {
    let fault = |fault: BakeFault| PrepError::scene(&entry.id)(fault);
    let options = baking.blender.ok_or_else(|| fault(BakeFault::NoBlender))?;
    let out = baking.folder.join("baking");
    let mut show = |line: &str| {
        if let Some(step) = line.strip_prefix("mateval:") {
            (baking.progress)(Report::step(step.trim(), 0, 1));
        }
    };
    let path = root.join(file);
    let baked = bake(&options.program, &options.limits, &path, BAKED_TEXEL_M, &out, &mut show)?;
    let (glb, baked) = baked.map_err(fault)?;
    let mut scene = gltf_scene(recipe, entry, &glb, file)?;
    scene.kind = SourceKind::Blend;
    baked.complete(&mut scene.read, &out)?;
    // The files are those of the .blend, not of the glTF.
    scene.read.findings.extend(baked.findings.iter().map(|finding| finding.of_file(&scene.file)));
    scene.read.findings.sort();
    let mut folder =
        SourceFolder::new(path.parent().unwrap_or(root), u64::MAX - 1).map_err(FileError::io("open", root))?;
    for name in std::iter::once(&scene.file).chain(&baked.files) {
        folder.read(name).map_err(|fault| FileError::io("read", name)(std::io::Error::other(fault)))?;
    }
    (scene.read.files, scene.read.missing) = (folder.into_files(), Missing::default());
    std::fs::remove_dir_all(&out).map_err(FileError::io("remove", &out))?;
    Ok(scene)
}

/// The recipe's or the file's camera at the recipe's resolution. The vertical field of view is kept.
fn gltf_camera(recipe: &Recipe, entry: &RecipeScene, read: &FileScene) -> Result<Camera, BuildFault> {
    let own_size = read.camera.map_or(DEFAULT_SIZE, |camera| [camera.intrinsics.width, camera.intrinsics.height]);
    let [width, height] = picture_size(recipe, entry, own_size)?;
    if let Some(RecipeCamera::Given(given)) = &entry.camera {
        return given_camera(given, [width, height], read.shift_m);
    }
    let camera = read.camera.ok_or_else(|| no_camera(read))?;
    let focal = camera.intrinsics.fy * f64::from(height) / f64::from(camera.intrinsics.height);
    let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
    Ok(Camera { intrinsics: Intrinsics { width, height, fx: focal, fy: focal, cx, cy }, ..camera })
}

fn no_camera(read: &FileScene) -> BuildFault {
    BuildFault::NoCameraInFile { findings: above_notes(&read.findings) }
}

/// A camera of the recipe, whose places are those of the source, in a scene from which `shift_m` was subtracted.
fn given_camera(given: &GivenCamera, [width, height]: [u32; 2], shift_m: DVec3) -> Result<Camera, BuildFault> {
    let GivenCamera { position, target, fov_y_deg } = *given;
    let intrinsics = Intrinsics::from_fov_y(width, height, fov_y_deg.to_radians());
    let [position, target] = [position, target].map(|place| DVec3::from_array(place) - shift_m);
    let camera = Camera::look_at(position, target, DVec3::Y, intrinsics);
    camera.ok_or(BuildFault::CameraDirection)
}

fn front3d_scene(
    recipe: &Recipe,
    entry: &RecipeScene,
    root: &Path,
    room: &Front3dRoom,
) -> Result<SourceScene, PrepError> {
    let house = front3d::furnish(&house_files(root, room, entry.redress.is_some()), &front3d::Limits::default())?;
    let Some(number) = house.house.room(&room.room) else {
        let rooms: Vec<&str> = house.house.rooms.iter().map(|room| room.id.as_str()).collect();
        let (wanted, known) = (format!("room '{}'", room.room), quoted(&rooms));
        return Err(PrepError::scene(&entry.id)(BuildFault::NotInHouse { wanted, known }));
    };
    // The camera sampler and the choice of surfaces that the views see share one world. The choice keeps or leaves out
    // whole surfaces.
    let world = World::new(house.scene.clone())?;
    let camera = room_camera(recipe, entry, &house, &world, number).map_err(PrepError::scene(&entry.id))?;
    let views: Vec<Camera> = views_of(recipe, camera).iter().map(|view| view.camera).collect();
    Ok(front3d::room_scene::room_scene(&house, &world, number, &views))
}

/// The paths of the files of a recipe's room.
fn house_files(root: &Path, room: &Front3dRoom, is_redressed: bool) -> HouseFiles {
    HouseFiles {
        root: root.to_owned(),
        house: room.house.clone(),
        models: room.models.clone(),
        textures: room.textures.clone(),
        cameras: room.cameras.clone(),
        blenderproc_compat: room.blenderproc_compat,
        appearance: room.appearance_rule(is_redressed),
    }
}

fn room_camera(
    recipe: &Recipe,
    entry: &RecipeScene,
    house: &FurnishedHouse,
    world: &World,
    room: usize,
) -> Result<Camera, BuildFault> {
    let resolution = entry.resolution.or(recipe.resolution).unwrap_or(recipe.camera_rules.resolution());
    match &entry.camera {
        None => Err(RecipeSceneFault::NoCamera.into()),
        Some(RecipeCamera::Given(given)) => given_camera(given, resolution, house.shift_m),
        Some(RecipeCamera::Designer(number)) => {
            let Some(camera) = house.cameras.iter().find(|camera| camera.number == *number) else {
                let known: Vec<String> = house.cameras.iter().map(|camera| camera.number.to_string()).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                return Err(BuildFault::NotInHouse { wanted: format!("designer's camera {number}"), known });
            };
            let (position, target) = (camera.position.to_array(), camera.target.to_array());
            given_camera(&GivenCamera { position, target, fov_y_deg: camera.fov_y_deg }, resolution, DVec3::ZERO)
        }
        Some(RecipeCamera::Seed { seed, fov_y_deg }) => {
            let [width, height] = resolution;
            let fov_y_deg = fov_y_deg.unwrap_or(recipe.camera_rules.fov_y_deg());
            let intrinsics = Intrinsics::from_fov_y(width, height, fov_y_deg.to_radians());
            let turns: Vec<[f64; 2]> = recipe.views.iter().map(|view| [view.x_deg, view.y_deg]).collect();
            let rules = recipe.camera_rules.sampler_rules();
            let sampler = RoomSampler::new(house, world, room);
            let found = sampler.and_then(|sampler| sampler.sample(intrinsics, &turns, &rules, *seed));
            Ok(found?.camera)
        }
    }
}

/// The view of a camera that is not turned from another.
pub(super) fn placed_view(id: &str, camera: Camera) -> View {
    View { id: ViewId::new(id).expect("our own ids are ids"), x_deg: 0.0, y_deg: 0.0, camera, wide: None }
}

/// The input view, then the novel views: the input camera, turned by each of the recipe's offsets.
pub(super) fn views_of(recipe: &Recipe, camera: Camera) -> Vec<View> {
    let input = placed_view(INPUT, camera);
    let turned = recipe.views.iter().map(|offset| View {
        id: offset.id.clone(),
        x_deg: offset.x_deg,
        y_deg: offset.y_deg,
        camera: camera.turned(offset.x_deg, offset.y_deg),
        wide: None,
    });
    std::iter::once(input).chain(turned).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn a_picture_of_other_proportions_than_the_cameras_is_noted() {
        let noted = |aspect: f64, width: u32, height: u32| {
            let intrinsics = Intrinsics::from_fov_y(width, height, 1.0);
            let camera = Camera::look_at(DVec3::ZERO, DVec3::Z, DVec3::Y, intrinsics).unwrap();
            other_aspect(aspect, &camera, "a.glb").map(|finding| finding.action)
        };
        assert!(noted(1.5, 480, 270).is_some_and(|action| action.contains("shows more")));
        assert!(noted(1.5, 320, 240).is_some_and(|action| action.contains("shows less")));
        // Twins: the stated proportions, exactly and rounded to whole rows.
        for (aspect, width, height) in [(1.5, 480, 320), (16.0 / 9.0, 480, 270), (2.39, 480, 201), (1.777, 480, 270)] {
            assert_eq!(noted(aspect, width, height), None, "{aspect}");
        }
    }
}
