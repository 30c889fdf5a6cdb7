//! The light of a photo split at the first surface: its parts make the picture again.

use std::sync::{Arc, LazyLock};

use glam::DVec2;
use mateval_dataset::material::PrincipledFlavour;
use mateval_dataset::reference::{Emission, ReferenceScene, SurfaceIndex};
use mateval_dataset::{Camera, Intrinsics};
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_testkit::scenes::{Builder, box_camera, box_quad, box_room, material, principled};
use mateval_tracer::aov::hit_through;
use mateval_tracer::{AssumedSurfaces, PhotoCache, RenderSettings, SplitLight, World, render, split_light};

const COLOR: f32 = 0.6;
const ROUGHNESS: f32 = 0.4;
/// Six walls, then the lamps.
const SURFACES: usize = 8;

/// A room of one colour with two lamps that the camera does not see.
fn room() -> ReferenceScene {
    let lamp = |x| box_quad([x, 2.3, 1.0], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6]);
    let mut scene = box_room(vec![lamp(0.5), lamp(3.0)]);
    scene.materials[0] = material(principled([COLOR; 3], ROUGHNESS, 0.0, PrincipledFlavour::Blender));
    let light = |surface: usize, radiance: f32| {
        let surfaces = vec![SurfaceIndex(surface)];
        Emission::Area { surfaces, radiance: [radiance; 3], map: None, two_sided: true }
    };
    Builder::from(scene).light(light(6, 4.0)).light(light(7, 9.0)).scene()
}

fn view() -> Camera {
    Camera { intrinsics: Intrinsics::from_fov_x(32, 18, 60_f64.to_radians()), ..box_camera() }
}

fn settings(samples: u32) -> RenderSettings {
    RenderSettings { samples, ..RenderSettings::default() }
}

fn photo(world: &World) -> Picture<LinearRgb> {
    render(world, &view(), &settings(1024), &|_, _| ()).unwrap().picture
}

/// The room and its photo, which is rendered once for all tests.
static ROOM: LazyLock<(World, Picture<LinearRgb>)> = LazyLock::new(|| {
    let world = World::new(Arc::new(room())).unwrap();
    let photo = photo(&world);
    (world, photo)
});

/// The pixels that show no lamp.
fn walls(world: &World) -> Mask {
    Mask::from_fn(32, 18, |x, y| {
        let hit = hit_through(world, &view(), DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        hit.is_some_and(|hit| hit.surface.0 < 6)
    })
}

/// The light of all pixels, if later surfaces have this color and the photo is the cache where `cached`.
fn split_as(world: &World, photo: &Picture<LinearRgb>, cached: &Mask, color: f32, samples: u32) -> SplitLight {
    let camera = view();
    let cache = PhotoCache::new(world, &camera, photo, cached).unwrap();
    let assumed = AssumedSurfaces { colors: &[[color; 3]; SURFACES], roughnesses: &[ROUGHNESS; SURFACES] };
    split_light(world, &cache, &photo.map(|_| true), assumed, &settings(samples), &|_, _| ()).unwrap()
}

fn split(world: &World, photo: &Picture<LinearRgb>, cached: &Mask, samples: u32) -> SplitLight {
    split_as(world, photo, cached, COLOR, samples)
}

/// Base colour times the diffuse part plus gloss, over the photo: its mean, and the root mean square deviation of
/// blocks of 4x4 pixels.
fn ratio(split: &SplitLight, photo: &Picture<LinearRgb>) -> [f64; 2] {
    let ones = vec![[1.0; 3]; split.diffuse.pictures().len()];
    let (diffuse, gloss) = (split.diffuse.weighted(&ones).unwrap(), split.gloss.weighted(&ones).unwrap());
    let mut ratios = Vec::new();
    for (y, x) in (0..16).step_by(4).flat_map(|y| (0..32).step_by(4).map(move |x| (y, x))) {
        let (mut made, mut shown) = (0.0, 0.0);
        for (dy, dx) in (0..4).flat_map(|dy| (0..4).map(move |dx| (dy, dx))) {
            let at = |picture: &Picture<LinearRgb>| picture.get(x + dx, y + dy).luminance();
            made += f64::from(COLOR) * at(&diffuse) + at(&gloss);
            shown += at(photo);
        }
        ratios.push(made / shown);
    }
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    let square = ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>() / ratios.len() as f64;
    [mean, square.sqrt()]
}

/// With true colours the parts make the photo again, whether light that has scattered elsewhere is traced or read from
/// the photo. A twin with the colours of later surfaces halved does not.
#[test]
fn the_parts_make_the_photo_again() {
    let (world, photo) = &*ROOM;
    let nothing = photo.map(|_| false);
    let [mean, deviation] = ratio(&split(world, photo, &nothing, 256), photo);
    assert!((mean - 1.0).abs() < 0.01 && deviation < 0.04, "traced: {mean} {deviation}");
    let [mean, deviation] = ratio(&split(world, photo, &walls(world), 256), photo);
    assert!((mean - 1.0).abs() < 0.03 && deviation < 0.05, "cached: {mean} {deviation}");

    let darker = split_as(world, photo, &nothing, 0.5 * COLOR, 64);
    assert!(ratio(&darker, photo)[0] < 0.9, "the twin passes");
}

/// Light that the photo holds is booked apart: lamps have less of it, and the photo's own picture is not black.
#[test]
fn light_of_the_photo_is_a_picture_of_its_own() {
    let (world, photo) = &*ROOM;
    let sum = |split: &SplitLight, picture: usize| -> f64 {
        split.diffuse.pictures()[picture].pixels().iter().map(|pixel| pixel.luminance()).sum()
    };
    let traced = split(world, photo, &photo.map(|_| false), 16);
    let cached = split(world, photo, &walls(world), 16);
    assert_eq!(traced.diffuse.pictures().len(), 3);
    assert!(sum(&traced, 2) == 0.0 && sum(&cached, 2) > 0.0);
    for lamp in 0..2 {
        assert!(sum(&cached, lamp) < sum(&traced, lamp), "lamp {lamp}");
    }
}

#[test]
fn threads_do_not_change_the_bytes() {
    let (world, photo) = &*ROOM;
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| split(world, photo, &photo.map(|_| true), 4))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn what_does_not_fit_the_world_is_refused() {
    let world = World::new(Arc::new(room())).unwrap();
    let camera = view();
    let small = Picture::filled(8, 8, LinearRgb::default());
    let found = PhotoCache::new(&world, &camera, &small, &small.map(|_| true)).unwrap_err().to_string();
    assert!(found.contains("a picture of 8x8, expected 32x18"), "{found}");
    let photo = Picture::filled(32, 18, LinearRgb::default());
    let all = photo.map(|_| true);
    let cache = PhotoCache::new(&world, &camera, &photo, &all).unwrap();
    let assumed = AssumedSurfaces { colors: &[[COLOR; 3]; SURFACES], roughnesses: &[ROUGHNESS; SURFACES - 1] };
    let found = split_light(&world, &cache, &all, assumed, &settings(1), &|_, _| ()).unwrap_err().to_string();
    assert!(found.contains("for 7 surfaces in a world of 8"), "{found}");
}
