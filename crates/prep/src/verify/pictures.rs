//! Checks the pictures of every view against the meshes, the ids of `scene.json` and each other.

use std::path::Path;

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::{INPUT, SceneFolder, part_picture};
use mateval_image::{LinearRgb, Mask, Normal, Picture, exr_io, png_io};
use mateval_tracer::World;
use rayon::prelude::*;

use crate::scene_meshes::{Faults, Meshes};
use crate::views::{SeenTriangle, ViewPixel, ViewScene};

/// Distance between the columns and rows that are traced again. It is prime, so that no regular pattern escapes the
/// check.
const STRIDE: usize = 7;
/// Largest relative error of a depth: half a unit in the last place of an f32, and the rounding of the ray.
const DEPTH_SLACK: f64 = 1e-5;
/// Share of the traced pixels that may differ, since rays that graze an edge may differ between machines.
const STRAYS: f64 = 0.002;
/// Largest deviation of a normal's length from 1, and of its components: normals are stored as half floats.
const NORMAL_SLACK: f32 = 2e-3;

/// The pictures of a view, all of the same size.
struct ViewPictures {
    depth: Picture<f32>,
    normal: Picture<Normal>,
    instance: Picture<u16>,
    /// One picture per set of parts.
    parts: Vec<Picture<u16>>,
    valid: Mask,
    unobserved: Option<Mask>,
}

/// Checks the pictures of every view of the scene.
pub(super) fn check(folder: &SceneFolder, scene: &SceneFile, meshes: &Meshes, world: &World, faults: &mut Faults) {
    let instances: Vec<u16> = scene.instances.iter().map(|instance| instance.index.0.get()).collect();
    let parts = meshes.part_values(scene);
    let scored: Vec<bool> = scene.instances.iter().map(|instance| instance.atlas.is_some()).collect();
    let retraced = ViewScene::new(world.scene(), world, &instances, &scored);
    for view in &scene.views {
        let Some(pictures) = read(folder, scene, view, faults) else { continue };
        let at = |file: &str| format!("views/{}/{file}", view.id);
        check_ids(scene, &pictures, &at, faults);
        check_masks(scene, &pictures, &at, faults);
        check_normals(&pictures, &at, faults);
        let truth = if folder.truth().is_dir() { check_truth(folder, view, &pictures, faults) } else { None };
        let expected = Expected { scene: &retraced, parts: &parts };
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
            let message = format!("{}x{} pixels, but its camera has {}x{}", size.0, size.1, expected.0, expected.1);
            faults.add("wrong_size", &at(file), "", message);
        }
    }
    faults.all.len() == before
}

/// Reports the pixels that break a rule as one fault, which names the first of them and their number.
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
    first_of(faults, "bad_id", &at("instance.png"), size, &format!("an instance id must be 0 to {instances}"), |p| {
        usize::from(instance[p]) > instances
    });
    for ((set, parts), picture) in scene.all_part_sets().zip(&pictures.parts) {
        let (file, part, count) = (at(&part_picture(set)), picture.pixels(), parts.len());
        first_of(faults, "bad_id", &file, size, &format!("a part id must be 0 to {count}"), |p| {
            usize::from(part[p]) > count
        });
        first_of(faults, "bad_id", &file, size, "a part must belong to the instance of its pixel", |p| {
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
        "a depth must be above 0 where the pixel shows an instance, and 0 elsewhere",
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
    let rule = "a normal must have unit length where the pixel shows an instance, and be 0 elsewhere";
    first_of(faults, "bad_normal", &at("normal.exr"), size, rule, |p| {
        let expected = if instance[p] == 0 { 0.0 } else { 1.0 };
        (glam::Vec3::from_array(normal[p].0).length() - expected).abs() > NORMAL_SLACK
    });
}

/// Traces a grid of the view's pixels again and compares them with the pictures.
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
    let mut report = |count: usize, file: String, what: &str| {
        if count as f64 > STRAYS * places.len() as f64 {
            let message = format!("{count} of {} {what} differ from what the camera sees of the meshes", places.len());
            faults.add("not_reprojected", &file, "", message);
        }
    };
    let strays: Vec<[bool; NAMES.len()]> =
        pixels.iter().zip(&places).map(|(pixel, (x, y))| strays(pixel, pictures, truth, *x, *y)).collect();
    for (which, (file, what)) in NAMES.into_iter().enumerate() {
        let file = if which < GEOMETRY { at(file) } else { format!("ground_truth/{}", at(file)) };
        report(strays.iter().filter(|stray| stray[which]).count(), file, what);
    }
    for ((file, values), picture) in expected.parts.iter().zip(&pictures.parts) {
        let differs = |(pixel, (x, y)): &(&ViewPixel, &(usize, usize))| {
            SeenTriangle::value_in(pixel.triangle, values) != picture.get(*x, *y)
        };
        report(pixels.iter().zip(&places).filter(differs).count(), at(file), "part ids");
    }
}

/// What the pictures are compared with.
struct Expected<'a> {
    scene: &'a ViewScene<'a>,
    /// For each set of parts its file, and the part's value for every triangle of every instance.
    parts: &'a [(String, Vec<Vec<u16>>)],
}

/// The pictures that are traced again, except those of parts: first those of geometry, then those of the ground truth.
const NAMES: [(&str, &str); 6] = [
    ("instance.png", "instance ids"),
    ("depth.exr", "depths"),
    ("normal.exr", "normals"),
    ("valid.png", "marks of valid pixels"),
    ("unobserved.png", "marks of unobserved pixels"),
    ("albedo.exr", "albedos"),
];
/// The number of pictures of geometry among them.
const GEOMETRY: usize = 5;

/// Which of the pictures differ from the pixel traced again. Those that depend on materials are compared only where the
/// ground truth exists.
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

/// Largest error of a channel of the albedo.
const ALBEDO_SLACK: f32 = 1e-4;

type TruthAlbedo = Picture<LinearRgb>;

/// Checks that the pictures of the ground truth exist, have the same size and are in range. Returns the albedo where it
/// could be read.
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
