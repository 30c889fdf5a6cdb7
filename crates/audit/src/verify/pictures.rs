//! The pictures of every view against meshes, ids and each other.

use std::path::Path;

use mateval_image::{LinearRgb, Mask, Normal, Picture, exr_io, png_io};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder, part_picture};
use mateval_tracer::World;
use rayon::prelude::*;

use mateval_prep::faults::Faults;
use mateval_prep::scene_meshes::Meshes;
use mateval_prep::views::{SeenTriangle, ViewPixel, ViewScene};

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
    /// One a set of parts.
    parts: Vec<Picture<u16>>,
    valid: Mask,
    unobserved: Option<Mask>,
}

pub(super) fn check(folder: &SceneFolder, scene: &SceneFile, meshes: &Meshes, world: &World, faults: &mut Faults) {
    let instances: Vec<u16> = scene.instances.iter().map(|instance| instance.index.0.get()).collect();
    let parts = part_sets(scene, meshes);
    let scored: Vec<bool> = scene.instances.iter().map(|instance| instance.atlas.is_some()).collect();
    let made_anew = ViewScene::new(world.scene(), world, &instances, &scored);
    for view in &scene.views {
        let Some(pictures) = read(folder, scene, view, faults) else { continue };
        let at = |file: &str| format!("views/{}/{file}", view.id);
        check_ids(scene, &pictures, &at, faults);
        check_masks(scene, &pictures, &at, faults);
        check_normals(&pictures, &at, faults);
        let truth = if folder.truth().is_dir() { check_truth(folder, view, &pictures, faults) } else { None };
        let expected = Expected { scene: &made_anew, parts: &parts };
        check_against_meshes(&expected, [view, &scene.views[0]], &pictures, truth.as_ref(), &at, faults);
    }
}

fn read(folder: &SceneFolder, scene: &SceneFile, view: &View, faults: &mut Faults) -> Option<ViewPictures> {
    let shown = folder.view(&view.id);
    let at = |file: &str| format!("views/{}/{file}", view.id);
    let is_input = view.id.as_str() == INPUT;
    let depth = faults.read(&at("depth.exr"), exr_io::read_scalar(&shown.join("depth.exr")));
    let normal = faults.read(&at("normal.exr"), exr_io::read_normal(&shown.join("normal.exr")));
    let instance = faults.read(&at("instance.png"), png_io::read_ids(&shown.join("instance.png")));
    let parts: Vec<_> = scene
        .all_part_sets()
        .map(|(set, _)| part_picture(set))
        .map(|file| faults.read(&at(&file), png_io::read_ids(&shown.join(&file))))
        .collect();
    let valid = faults.read(&at("valid.png"), png_io::read_mask(&shown.join("valid.png")));
    let unobserved = match is_input {
        true => None,
        false => Some(faults.read(&at("unobserved.png"), png_io::read_mask(&shown.join("unobserved.png")))?),
    };
    let parts = parts.into_iter().collect::<Option<_>>()?;
    let (instance, valid) = (instance?, valid?);
    let pictures = ViewPictures { depth: depth?, normal: normal?, instance, parts, valid, unobserved };
    has_size(&pictures, scene, view, &at, faults).then_some(pictures)
}

fn has_size(
    pictures: &ViewPictures,
    scene: &SceneFile,
    view: &View,
    at: &dyn Fn(&str) -> String,
    faults: &mut Faults,
) -> bool {
    let expected = (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize);
    let mut sizes = vec![
        ("depth.exr", (pictures.depth.width(), pictures.depth.height())),
        ("normal.exr", (pictures.normal.width(), pictures.normal.height())),
        ("instance.png", (pictures.instance.width(), pictures.instance.height())),
        ("valid.png", (pictures.valid.width(), pictures.valid.height())),
    ];
    let files: Vec<String> = scene.all_part_sets().map(|(set, _)| part_picture(set)).collect();
    for (file, part) in files.iter().zip(&pictures.parts) {
        sizes.push((file, (part.width(), part.height())));
    }
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
    let (instance, depth) = (pictures.instance.pixels(), pictures.depth.pixels());
    let instances = scene.instances.len();
    first_of(faults, "bad_id", &at("instance.png"), size, &format!("an id must be 0 to {instances}"), |p| {
        usize::from(instance[p]) > instances
    });
    for ((set, parts), picture) in scene.all_part_sets().zip(&pictures.parts) {
        let (file, part, count) = (at(&part_picture(set)), picture.pixels(), parts.len());
        first_of(faults, "bad_id", &file, size, &format!("an id must be 0 to {count}"), |p| {
            usize::from(part[p]) > count
        });
        first_of(faults, "bad_id", &file, size, "a part must be one of the pixel's instance", |p| {
            let of_part = usize::from(part[p]).checked_sub(1).and_then(|place| parts.get(place)).map(|p| &p.instance);
            let of_pixel =
                usize::from(instance[p]).checked_sub(1).and_then(|place| scene.instances.get(place)).map(|i| &i.id);
            of_part != of_pixel
        });
    }
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

fn check_normals(pictures: &ViewPictures, at: &dyn Fn(&str) -> String, faults: &mut Faults) {
    let size = (pictures.depth.width(), pictures.depth.height());
    let (instance, normal) = (pictures.instance.pixels(), pictures.normal.pixels());
    let rule = "a normal must be of unit length where there is an instance, else 0";
    first_of(faults, "bad_normal", &at("normal.exr"), size, rule, |p| {
        let expected = if instance[p] == 0 { 0.0 } else { 1.0 };
        (glam::Vec3::from_array(normal[p].0).length() - expected).abs() > NORMAL_SLACK
    });
}

/// A view made anew at a grid of pixels must be what the pictures hold.
fn check_against_meshes(
    expected: &Expected<'_>,
    [view, input]: [&View; 2],
    pictures: &ViewPictures,
    truth: Option<&TruthAlbedo>,
    at: &dyn Fn(&str) -> String,
    faults: &mut Faults,
) {
    let (width, height) = (pictures.depth.width(), pictures.depth.height());
    let places: Vec<(usize, usize)> = (STRIDE / 2..height)
        .step_by(STRIDE)
        .flat_map(|y| (STRIDE / 2..width).step_by(STRIDE).map(move |x| (x, y)))
        .collect();
    let pixel = |(x, y): &(usize, usize)| expected.scene.pixel(&view.camera, &input.camera, *x, *y);
    let pixels: Vec<ViewPixel> = places.par_iter().map(pixel).collect();
    let mut tell = |count: usize, file: String, what: &str| {
        if count as f64 > STRAYS * places.len() as f64 {
            let message = format!("{count} of {} {what} are not what the camera sees of the meshes", places.len());
            faults.add("not_reprojected", &file, "", message);
        }
    };
    let strays: Vec<[bool; NAMES.len()]> =
        pixels.iter().zip(&places).map(|(pixel, (x, y))| strays(pixel, pictures, truth, *x, *y)).collect();
    for (which, (file, what)) in NAMES.into_iter().enumerate() {
        let file = if which < GEOMETRY { at(file) } else { format!("ground_truth/{}", at(file)) };
        tell(strays.iter().filter(|stray| stray[which]).count(), file, what);
    }
    for ((file, values), picture) in expected.parts.iter().zip(&pictures.parts) {
        let differs = |(pixel, (x, y)): &(&ViewPixel, &(usize, usize))| {
            SeenTriangle::value_in(pixel.triangle, values) != picture.get(*x, *y)
        };
        tell(pixels.iter().zip(&places).filter(differs).count(), at(file), "part ids");
    }
}

/// What the pictures are held against.
struct Expected<'a> {
    scene: &'a ViewScene<'a>,
    /// The file of each set of parts, and its value for every triangle of every instance.
    parts: &'a [(String, Vec<Vec<u16>>)],
}

fn part_sets(scene: &SceneFile, meshes: &Meshes) -> Vec<(String, Vec<Vec<u16>>)> {
    let mut sets = Vec::new();
    for ((set, parts), of_triangles) in scene.all_part_sets().zip(&meshes.part_sets) {
        let value = |part: &usize| parts[*part].index.0.get();
        let values = of_triangles.iter().map(|instance| instance.iter().map(value).collect());
        sets.push((part_picture(set), values.collect()));
    }
    sets
}

/// The pictures that are made anew, parts apart: those of geometry, then those of the ground truth.
const NAMES: [(&str, &str); 6] = [
    ("instance.png", "instance ids"),
    ("depth.exr", "depths"),
    ("normal.exr", "normals"),
    ("valid.png", "valid marks"),
    ("unobserved.png", "unobserved marks"),
    ("albedo.exr", "albedos"),
];
/// How many of them are not of the ground truth.
const GEOMETRY: usize = 5;

/// Which of the pictures differ from the pixel made anew. What depends on materials is held against them only where the
/// ground truth is there.
fn strays(
    expected: &ViewPixel,
    pictures: &ViewPictures,
    truth: Option<&TruthAlbedo>,
    x: usize,
    y: usize,
) -> [bool; NAMES.len()] {
    let depth = pictures.depth.get(x, y);
    let normal = pictures.normal.get(x, y).0;
    let far = |a: [f32; 3], b: [f32; 3], slack: f32| a.iter().zip(b).any(|(a, b)| (a - b).abs() > slack);
    let materials = truth.is_some();
    let unobserved = pictures.unobserved.as_ref().is_some_and(|mask| mask.get(x, y) != expected.unobserved);
    [
        expected.instance != pictures.instance.get(x, y),
        f64::from((expected.depth - depth).abs()) > DEPTH_SLACK * f64::from(expected.depth.max(depth)),
        far(expected.normal, normal, NORMAL_SLACK),
        materials && expected.valid != pictures.valid.get(x, y),
        materials && unobserved,
        truth.is_some_and(|truth| far(expected.truth.albedo, truth.get(x, y).0, ALBEDO_SLACK)),
    ]
}

/// How far a channel of the albedo may be off.
const ALBEDO_SLACK: f32 = 1e-4;

type TruthAlbedo = Picture<LinearRgb>;

/// The truth's pictures are there, of the same size, in range; gives the albedo if it is.
fn check_truth(folder: &SceneFolder, view: &View, pictures: &ViewPictures, faults: &mut Faults) -> Option<TruthAlbedo> {
    let mut albedo = None;
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
        albedo = albedo.or(Some(picture));
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
    check_specular(&hidden.join("specular_region.png"), &at("specular_region.png"), pictures, faults);
    albedo
}

fn check_specular(path: &Path, file: &str, pictures: &ViewPictures, faults: &mut Faults) {
    let size = (pictures.depth.width(), pictures.depth.height());
    let Some(region) = faults.read(file, png_io::read_mask(path)) else { return };
    if !region.same_size(&pictures.valid) {
        faults.add("wrong_size", file, "", format!("expected {}x{} pixels", size.0, size.1));
        return;
    }
    first_of(faults, "bad_mask", file, size, "a specular pixel must be valid", |p| {
        region.pixels()[p] && !pictures.valid.pixels()[p]
    });
}
