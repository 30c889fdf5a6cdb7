//! The pictures of every view against meshes, ids and each other.

use glam::DVec2;
use mateval_image::{Mask, Normal, Picture, exr_io, png_io};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_tracer::World;
use mateval_tracer::aov::hit_through;
use rayon::prelude::*;

use super::Faults;
use super::geometry::Meshes;

/// Every so many-th column and row is traced again; prime, so that no pattern of the picture hides between.
const STRIDE: usize = 7;
/// Share of its depth by which a pixel may miss its mesh: half a step of an f32 and what the ray's own rounding adds.
const DEPTH_SLACK: f64 = 1e-5;
/// Share of traced pixels that may differ in ids or depth (rays that graze an edge on another machine).
const STRAYS: f64 = 0.002;
/// How far a normal's length may be from one: half floats.
const NORMAL_SLACK: f32 = 2e-3;

/// A view's pictures, all of one size.
struct ViewPictures {
    depth: Picture<f32>,
    normal: Picture<Normal>,
    instance: Picture<u16>,
    part: Picture<u16>,
    valid: Mask,
    unobserved: Option<Mask>,
}

pub(super) fn check(folder: &SceneFolder, scene: &SceneFile, meshes: &Meshes, world: &World, faults: &mut Faults) {
    for view in &scene.views {
        let Some(pictures) = read(folder, view, faults) else { continue };
        let at = |file: &str| format!("views/{}/{file}", view.id);
        check_ids(scene, &pictures, &at, faults);
        check_masks(scene, &pictures, &at, faults);
        check_normals(&pictures, view, &at, faults);
        check_against_meshes(scene, meshes, world, view, &pictures, &at, faults);
        if folder.truth().is_dir() {
            check_truth(folder, view, &pictures, faults);
        }
    }
}

fn read(folder: &SceneFolder, view: &View, faults: &mut Faults) -> Option<ViewPictures> {
    let shown = folder.view(&view.id);
    let at = |file: &str| format!("views/{}/{file}", view.id);
    let is_input = view.id.as_str() == INPUT;
    let depth = faults.read(&at("depth.exr"), exr_io::read_scalar(&shown.join("depth.exr")));
    let normal = faults.read(&at("normal.exr"), exr_io::read_normal(&shown.join("normal.exr")));
    let instance = faults.read(&at("instance.png"), png_io::read_ids(&shown.join("instance.png")));
    let part = faults.read(&at("part.png"), png_io::read_ids(&shown.join("part.png")));
    let valid = faults.read(&at("valid.png"), png_io::read_mask(&shown.join("valid.png")));
    let unobserved = match is_input {
        true => None,
        false => Some(faults.read(&at("unobserved.png"), png_io::read_mask(&shown.join("unobserved.png")))?),
    };
    let pictures =
        ViewPictures { depth: depth?, normal: normal?, instance: instance?, part: part?, valid: valid?, unobserved };
    has_size(&pictures, view, &at, faults).then_some(pictures)
}

fn has_size(pictures: &ViewPictures, view: &View, at: &dyn Fn(&str) -> String, faults: &mut Faults) -> bool {
    let expected = (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize);
    let mut sizes = vec![
        ("depth.exr", (pictures.depth.width(), pictures.depth.height())),
        ("normal.exr", (pictures.normal.width(), pictures.normal.height())),
        ("instance.png", (pictures.instance.width(), pictures.instance.height())),
        ("part.png", (pictures.part.width(), pictures.part.height())),
        ("valid.png", (pictures.valid.width(), pictures.valid.height())),
    ];
    sizes.extend(pictures.unobserved.as_ref().map(|mask| ("unobserved.png", (mask.width(), mask.height()))));
    let before = faults.all.len();
    for (file, size) in sizes {
        if size != expected {
            let message = format!("{}x{} pixels, its camera has {}x{}", size.0, size.1, expected.0, expected.1);
            faults.add("wrong_size", &at(file), "", message);
        }
    }
    faults.all.len() == before
}

/// The first pixel that breaks a rule, and how many do, as one fault.
fn first_of(
    faults: &mut Faults,
    code: &str,
    file: &str,
    size: (usize, usize),
    rule: &str,
    breaks: impl Fn(usize) -> bool,
) {
    let (width, height) = size;
    let mut broken = (0..width * height).filter(|pixel| breaks(*pixel));
    if let Some(first) = broken.next() {
        let count = 1 + broken.count();
        let place = format!("pixel ({}, {})", first % width, first / width);
        faults.add(code, file, place, format!("{rule}; {count} pixels break this"));
    }
}

fn check_ids(scene: &SceneFile, pictures: &ViewPictures, at: &dyn Fn(&str) -> String, faults: &mut Faults) {
    let size = (pictures.depth.width(), pictures.depth.height());
    let (instance, part, depth) = (pictures.instance.pixels(), pictures.part.pixels(), pictures.depth.pixels());
    let instances = scene.instances.len();
    first_of(faults, "bad_id", &at("instance.png"), size, &format!("an id must be 0 to {instances}"), |p| {
        usize::from(instance[p]) > instances
    });
    let parts = scene.parts.len();
    first_of(faults, "bad_id", &at("part.png"), size, &format!("an id must be 0 to {parts}"), |p| {
        usize::from(part[p]) > parts
    });
    first_of(faults, "bad_id", &at("part.png"), size, "a part must be one of the pixel's instance", |p| {
        let of_part = usize::from(part[p]).checked_sub(1).and_then(|place| scene.parts.get(place)).map(|p| &p.instance);
        let of_pixel =
            usize::from(instance[p]).checked_sub(1).and_then(|place| scene.instances.get(place)).map(|i| &i.id);
        of_part != of_pixel
    });
    first_of(
        faults,
        "bad_depth",
        &at("depth.exr"),
        size,
        "depth must be above 0 where there is an instance, else 0",
        |p| {
            if instance[p] == 0 { depth[p] != 0.0 } else { depth[p] <= 0.0 }
        },
    );
}

fn check_masks(scene: &SceneFile, pictures: &ViewPictures, at: &dyn Fn(&str) -> String, faults: &mut Faults) {
    let size = (pictures.depth.width(), pictures.depth.height());
    let (instance, valid) = (pictures.instance.pixels(), pictures.valid.pixels());
    first_of(faults, "bad_mask", &at("valid.png"), size, "a valid pixel must show an instance with an atlas", |p| {
        let shown = usize::from(instance[p]).checked_sub(1).and_then(|place| scene.instances.get(place));
        valid[p] && shown.is_none_or(|instance| instance.atlas.is_none())
    });
    if let Some(unobserved) = &pictures.unobserved {
        let unobserved = unobserved.pixels();
        first_of(faults, "bad_mask", &at("unobserved.png"), size, "an unobserved pixel must be valid", |p| {
            unobserved[p] && !valid[p]
        });
    }
}

fn check_normals(pictures: &ViewPictures, view: &View, at: &dyn Fn(&str) -> String, faults: &mut Faults) {
    let (width, height) = (pictures.depth.width(), pictures.depth.height());
    let (instance, normal) = (pictures.instance.pixels(), pictures.normal.pixels());
    let length = |p: usize| glam::Vec3::from_array(normal[p].0).length();
    let rule = "a normal must be of unit length where there is an instance, else 0";
    first_of(faults, "bad_normal", &at("normal.exr"), (width, height), rule, |p| {
        let expected = if instance[p] == 0 { 0.0 } else { 1.0 };
        (length(p) - expected).abs() > NORMAL_SLACK
    });
    // A shading normal may lean away a little where the surface turns from the camera; half of all may not.
    let away = (0..width * height).filter(|p| {
        let direction = view.camera.direction(DVec2::new((p % width) as f64 + 0.5, (p / width) as f64 + 0.5));
        instance[*p] != 0 && glam::Vec3::from_array(normal[*p].0).as_dvec3().dot(direction) > 0.5
    });
    let count = away.count();
    if count as f64 > STRAYS * (width * height) as f64 {
        faults.add("bad_normal", &at("normal.exr"), "", format!("{count} normals point away from the camera"));
    }
}

/// Rays through a grid of pixel centres must find the ids, the depth and the observed region that the pictures hold.
fn check_against_meshes(
    scene: &SceneFile,
    meshes: &Meshes,
    world: &World,
    view: &View,
    pictures: &ViewPictures,
    at: &dyn Fn(&str) -> String,
    faults: &mut Faults,
) {
    let (width, height) = (pictures.depth.width(), pictures.depth.height());
    let places: Vec<(usize, usize)> = (STRIDE / 2..height)
        .step_by(STRIDE)
        .flat_map(|y| (STRIDE / 2..width).step_by(STRIDE).map(move |x| (x, y)))
        .collect();
    let input = &scene.views[0].camera;
    let same_centre = input.position() == view.camera.position();
    let strays: Vec<[bool; 4]> = places
        .par_iter()
        .map(|(x, y)| {
            let pixel = DVec2::new(*x as f64 + 0.5, *y as f64 + 0.5);
            let hit = hit_through(world, &view.camera, pixel);
            let instance = hit.as_ref().map_or(0, |hit| scene.instances[hit.surface.0].index.0.get());
            let part = hit
                .as_ref()
                .map_or(0, |hit| scene.parts[meshes.part_of_triangle[hit.surface.0][hit.triangle]].index.0.get());
            let depth = hit.as_ref().map_or(0.0, |hit| hit.depth);
            let found = f64::from(pictures.depth.get(*x, *y));
            let in_input = same_centre
                && depth > 0.0
                && input.project(view.camera.unproject(pixel, depth)).is_some_and(|(place, _)| input.holds(place));
            let wrongly_unobserved = pictures.unobserved.as_ref().is_some_and(|mask| mask.get(*x, *y) && in_input);
            [
                instance != pictures.instance.get(*x, *y),
                part != pictures.part.get(*x, *y),
                (depth - found).abs() > DEPTH_SLACK * depth.max(found),
                wrongly_unobserved,
            ]
        })
        .collect();
    let names = [
        ("instance.png", "instance ids"),
        ("part.png", "part ids"),
        ("depth.exr", "depths"),
        ("unobserved.png", "unobserved marks"),
    ];
    for (which, (file, what)) in names.into_iter().enumerate() {
        let count = strays.iter().filter(|stray| stray[which]).count();
        if count as f64 > STRAYS * places.len() as f64 {
            let message = format!("{count} of {} {what} are not what the camera sees of the meshes", places.len());
            faults.add("not_reprojected", &at(file), "", message);
        }
    }
}

/// The truth's pictures are there, of the same size, in range.
fn check_truth(folder: &SceneFolder, view: &View, pictures: &ViewPictures, faults: &mut Faults) {
    let hidden = folder.truth_view(&view.id);
    let at = |file: &str| format!("ground_truth/views/{}/{file}", view.id);
    let size = (pictures.depth.width(), pictures.depth.height());
    for file in ["albedo.exr", "diffuse_albedo.exr"] {
        let Some(picture) = faults.read(&at(file), exr_io::read_linear(&hidden.join(file))) else { continue };
        if (picture.width(), picture.height()) != size {
            faults.add("wrong_size", &at(file), "", format!("expected {}x{} pixels", size.0, size.1));
            continue;
        }
        first_of(faults, "out_of_range", &at(file), size, "an albedo must not be negative", |p| {
            picture.pixels()[p].0.iter().any(|v| *v < 0.0)
        });
    }
    for file in ["roughness.exr", "metallic.exr"] {
        let Some(picture) = faults.read(&at(file), exr_io::read_scalar(&hidden.join(file))) else { continue };
        if (picture.width(), picture.height()) != size {
            faults.add("wrong_size", &at(file), "", format!("expected {}x{} pixels", size.0, size.1));
            continue;
        }
        first_of(faults, "out_of_range", &at(file), size, "expected 0 to 1", |p| {
            !(-1e-6..=1.0 + 1e-6).contains(&picture.pixels()[p])
        });
    }
    let Some(region) = faults.read(&at("specular_region.png"), png_io::read_mask(&hidden.join("specular_region.png")))
    else {
        return;
    };
    if !region.same_size(&pictures.valid) {
        faults.add("wrong_size", &at("specular_region.png"), "", format!("expected {}x{} pixels", size.0, size.1));
        return;
    }
    first_of(faults, "bad_mask", &at("specular_region.png"), size, "a specular pixel must be valid", |p| {
        region.pixels()[p] && !pictures.valid.pixels()[p]
    });
}
