//! Rooms whose base colours and lamps are known, photographed by the tracer with noise.

use std::sync::Arc;

use glam::Vec2;
use mateval_image::{LinearRgb, Mask, Normal, Picture, Texels, Texture, Wrap};
use mateval_scene::material::{
    ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput, TextureIndex, UvTransform,
};
use mateval_scene::reference::{Emission, LightGroup, MaterialIndex, ReferenceScene, SourceTexture, SurfaceIndex};
use mateval_scene::{Camera, Intrinsics, TriangleMesh, splitmix64};
use mateval_testkit::box_room;
use mateval_tracer::{PhotoCache, RenderSettings, World, aov, render, split_light};

use super::part_room::PartRoom;
use super::part_surfaces::NO_PART;
use super::surfaces::{Surfaces, settings};
use super::{DelightOptions, DelitPhoto, LightSource, PossibleLight, rounds};

const SIZE: [u32; 2] = [96, 54];
/// Lamps that bring less of the photo's light are not well known.
const LEAST_SHARE: f64 = 0.05;

/// Numbers in [0, 1) of a seed, one after the other.
struct Numbers(u64, u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.1 += 1;
        (splitmix64::number(self.0, self.1) >> 40) as f32 / (1 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }
}

/// A room with its photo and what it is made of.
struct Planted {
    room: PartRoom,
    truth: Picture<LinearRgb>,
    /// Of the lights of the room, in their order.
    radiances: Vec<[f32; 3]>,
}

/// A parallelogram with uvs in metres.
fn textured(corner: [f32; 3], u: [f32; 3], v: [f32; 3]) -> TriangleMesh {
    let length = |side: [f32; 3]| side.iter().map(|v| v * v).sum::<f32>().sqrt();
    let mut mesh = box_room::quad(corner, u, v);
    let [w, h] = [length(u), length(v)];
    mesh.uvs = Some(vec![Vec2::ZERO, Vec2::new(w, 0.0), Vec2::new(w, h), Vec2::new(0.0, h)]);
    mesh
}

/// A block on the floor: its top and the four sides, one surface each.
fn block(numbers: &mut Numbers) -> Vec<TriangleMesh> {
    let [w, h, d] = [numbers.between(0.4, 1.2), numbers.between(0.3, 1.0), numbers.between(0.4, 1.2)];
    let [x, z] = [numbers.between(0.2, 3.8 - w), numbers.between(0.3, 2.8)];
    vec![
        textured([x, h, z], [w, 0.0, 0.0], [0.0, 0.0, d]),
        textured([x, 0.0, z], [w, 0.0, 0.0], [0.0, h, 0.0]),
        textured([x, 0.0, z + d], [w, 0.0, 0.0], [0.0, h, 0.0]),
        textured([x, 0.0, z], [0.0, 0.0, d], [0.0, h, 0.0]),
        textured([x + w, 0.0, z], [0.0, 0.0, d], [0.0, h, 0.0]),
    ]
}

/// Tiles of 0.25 m about one colour, with a standard deviation of 20 %.
fn texture(numbers: &mut Numbers) -> Texture {
    let color = [0, 1, 2].map(|_| numbers.between(0.15, 0.75));
    let mut texel = || {
        let tone = (0..4).map(|_| numbers.between(-1.0, 1.0)).sum::<f32>() * 0.17;
        color.map(|v| (v * libm::expf(tone)).clamp(0.02, 0.95))
    };
    Texture::new(16, 16, Texels::Linear((0..256).map(|_| texel()).collect()), Wrap::Repeat).unwrap()
}

fn planted(seed: u64) -> Planted {
    let mut numbers = Numbers(seed, 0);
    let mut more: Vec<TriangleMesh> = (0..4).flat_map(|_| block(&mut numbers)).collect();
    let lamps: Vec<usize> = (0..3).map(|k| 6 + more.len() + k).collect();
    for _ in &lamps {
        let [x, z] = [numbers.between(0.5, 3.0), numbers.between(0.5, 5.0)];
        more.push(textured([x, 2.2, z], [0.4, 0.0, 0.0], [0.0, 0.0, 0.4]));
    }
    let mut scene = box_room::box_room(more);
    scene.materials.clear();
    for (k, surface) in scene.surfaces.iter_mut().enumerate() {
        let mesh = &surface.mesh;
        let [a, b, _, d] = [0, 1, 2, 3].map(|k| mesh.positions[k].to_array());
        let side = |to: [f32; 3]| [0, 1, 2].map(|axis| to[axis] - a[axis]);
        surface.mesh = textured(a, side(b), side(d));
        surface.material = MaterialIndex(k);
        let uv = UvTransform([[0.25, 0.0, 0.0], [0.0, 0.25, 0.0]]);
        scene.textures.push(SourceTexture { name: k.to_string(), sha256: None, texture: texture(&mut numbers) });
        let model = MaterialModel::Principled {
            base_color: ColorInput::Texture { texture: TextureIndex(k), uv },
            roughness: ScalarInput::Constant(0.5),
            metallic: ScalarInput::Constant(0.0),
            specular: 0.5,
            flavour: PrincipledFlavour::Blender,
        };
        scene.materials.push(Material { name: String::new(), model, two_sided: true, opacity: None, bump: None });
    }
    // Lamps differ in radiance, and less in colour.
    let radiance = |numbers: &mut Numbers| {
        let all = numbers.between(2.0, 8.0);
        [0, 1, 2].map(|_| all * numbers.between(0.8, 1.25))
    };
    let radiances: Vec<[f32; 3]> = lamps.iter().map(|_| radiance(&mut numbers)).collect();
    let lit = |radiance: &dyn Fn(usize) -> [f32; 3], camera_visible| {
        let light = |(k, lamp): (usize, &usize)| LightGroup {
            name: format!("lamp_{k}"),
            emission: Emission::Area {
                surfaces: vec![SurfaceIndex(*lamp)],
                radiance: radiance(k),
                map: None,
                two_sided: true,
            },
            camera_visible,
        };
        let lights = lamps.iter().enumerate().map(light).collect();
        World::new(Arc::new(ReferenceScene { lights, ..scene.clone() })).unwrap()
    };
    // Photograph the room as it is, with lamps that the camera sees.
    let intrinsics = Intrinsics::from_fov_x(SIZE[0], SIZE[1], 60_f64.to_radians());
    let camera = Camera { intrinsics, ..box_room::camera() };
    let settings = RenderSettings { samples: 64, seed, ..RenderSettings::default() };
    let photo = render(&lit(&|k| radiances[k], true), &camera, &settings, &|_, _| ()).unwrap().picture;
    let world = lit(&|_| [1.0; 3], false);
    let hit = |x: usize, y: usize| aov::hit_through(&world, &camera, aov::coarse_subpixels(x, y)[5]);
    let [width, height] = SIZE.map(|side| side as usize);
    let parts = Picture::from_fn(width, height, |x, y| hit(x, y).map_or(NO_PART, |hit| hit.surface.0 as u16));
    let normals = Picture::from_fn(width, height, |x, y| Normal(hit(x, y).unwrap().normal.to_array()));
    let valid = Mask::from_fn(width, height, |x, y| !lamps.contains(&usize::from(parts.get(x, y))));
    let truth = Picture::from_fn(width, height, |x, y| LinearRgb(mean_color(&scene, &world, &camera, x, y)));
    let light = |k: usize| PossibleLight {
        name: format!("lamp_{k}"),
        source: LightSource::Instance { instance: lamps[k].to_string() },
    };
    let lights = (0..lamps.len()).map(light).collect();
    let owners = (0..scene.surfaces.len()).collect();
    Planted {
        room: PartRoom {
            world,
            shown: vec![None; 3],
            lights,
            camera,
            emission: photo.map(|_| None),
            photo,
            valid,
            parts,
            normals,
            owners,
        },
        truth,
        radiances,
    }
}

fn mean_color(scene: &ReferenceScene, world: &World, camera: &Camera, x: usize, y: usize) -> [f32; 3] {
    let colors = aov::coarse_subpixels(x, y).map(|place| {
        let hit = aov::hit_through(world, camera, place).unwrap();
        let mesh = &scene.surfaces[hit.surface.0].mesh;
        let uv = hit.interpolate(&mesh.triangles, mesh.uvs.as_ref().unwrap()) * 0.25;
        scene.textures[hit.surface.0].texture.sample(uv.to_array())
    });
    [0, 1, 2].map(|c| colors.iter().map(|color| color[c]).sum::<f32>() / colors.len() as f32)
}

fn delit(planted: &Planted) -> DelitPhoto {
    rounds::run(&planted.room, &DelightOptions { samples: [4, 4, 16], ..DelightOptions::default() }, &|_| ()).unwrap()
}

/// PSNR over valid pixels of sRGB values, each channel at the linear scale that fits the truth best.
fn aligned_psnr(found: &Picture<LinearRgb>, planted: &Planted) -> f64 {
    let valid = planted.room.valid.pixels();
    let pairs = || found.pixels().iter().zip(planted.truth.pixels()).zip(valid).filter(|(_, valid)| **valid);
    let scales = [0, 1, 2].map(|c| {
        let product: f64 = pairs().map(|((p, gt), _)| f64::from(p.0[c] * gt.0[c])).sum();
        product / pairs().map(|((p, _), _)| f64::from(p.0[c] * p.0[c])).sum::<f64>()
    });
    let shown = |color: LinearRgb, scales: [f64; 3]| {
        let scaled = [0, 1, 2].map(|c| ((f64::from(color.0[c]) * scales[c]) as f32).clamp(0.0, 1.0));
        Picture::filled(1, 1, LinearRgb(scaled)).to_srgb().get(0, 0).0
    };
    let errors = pairs().flat_map(|((p, gt), _)| {
        let (p, gt) = (shown(*p, scales), shown(*gt, [1.0; 3]));
        [0, 1, 2].map(|c| f64::from(p[c] - gt[c]).powi(2))
    });
    let errors: Vec<f64> = errors.collect();
    -10.0 * (errors.iter().sum::<f64>() / errors.len() as f64).log10()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn gain(found: &DelitPhoto, planted: &Planted) -> f64 {
    aligned_psnr(&found.base_color, planted) - aligned_psnr(&planted.room.photo, planted)
}

/// The share of each lamp in the light of the photo, if all surfaces were grey.
fn shares(planted: &Planted) -> Vec<f64> {
    let room = &planted.room;
    let nothing = room.valid.map(|_| false);
    let cache = PhotoCache::new(&room.world, &room.camera, &room.photo, &nothing).unwrap();
    let surfaces = Surfaces::unknown(room.owners.len());
    let split = split_light(&room.world, &cache, &room.valid, surfaces.assumed(), &settings(8, 0), &|_, _| ()).unwrap();
    let brought = |(picture, radiance): (&Picture<LinearRgb>, &[f32; 3])| {
        f64::from(radiance.iter().sum::<f32>()) * picture.pixels().iter().map(|pixel| pixel.luminance()).sum::<f64>()
    };
    let brought: Vec<f64> = split.diffuse.pictures().iter().zip(&planted.radiances).map(brought).collect();
    brought.iter().map(|one| one / brought.iter().sum::<f64>()).collect()
}

/// The base colour is at least 8 dB nearer to the truth than the photo is (the median), and no part is taken for a
/// mirror. Radiances are less certain: lamps trade light with one another, and with the colours of what the photo does
/// not show.
#[test]
fn planted_rooms_are_delit() {
    let (mut gains, mut errors) = (Vec::new(), Vec::new());
    for seed in 0..12 {
        let planted = planted(seed);
        let found = delit(&planted);
        gains.push(gain(&found, &planted));
        let shares = shares(&planted);
        for (k, radiance) in planted.radiances.iter().enumerate().filter(|(k, _)| shares[*k] >= LEAST_SHARE) {
            let ratios = [0, 1, 2].map(|c| found.lights[k].radiance[c] / f64::from(radiance[c]));
            errors.push((ratios.iter().sum::<f64>() / 3.0 - 1.0).abs());
        }
        assert!(found.metallic.pixels().iter().all(|metallic| *metallic == 0.0), "a false mirror in room {seed}");
    }
    assert!(median(gains.clone()) >= 8.0, "{gains:?}");
    assert!(median(errors.clone()) <= 0.4, "{errors:?}");
}

/// Lamps that the photo shows are taken as they are shown; the base colour is then no worse than with fitted ones.
#[test]
fn shown_radiances_are_kept() {
    let mut planted = planted(1);
    let fitted = gain(&delit(&planted), &planted);
    planted.room.shown = planted.radiances.iter().map(|radiance| Some(radiance.map(f64::from))).collect();
    let found = delit(&planted);
    for (k, radiance) in planted.radiances.iter().enumerate() {
        let found = &found.lights[k].radiance;
        let near = found.iter().zip(radiance).all(|(found, shown)| (found / f64::from(*shown) - 1.0).abs() < 0.1);
        assert!(near, "lamp {k}: {found:?} {radiance:?}");
    }
    let known = gain(&found, &planted);
    assert!(known >= fitted - 0.3, "{known} {fitted}");
}

/// A photo that shows no light, one that is far too bright, and one of which only the brightest values are known.
#[test]
fn bad_photos_give_finite_colours() {
    let mut room = planted(2).room;
    let sound = room.photo.clone();
    let photos: [(&str, &dyn Fn(f32) -> f32); 3] =
        [("black", &|_| 0.0), ("exposed a thousandfold", &|v| 1000.0 * v), ("clipped", &|v| v.min(0.2))];
    for (what, change) in photos {
        room.photo = sound.map(|LinearRgb(rgb)| LinearRgb(rgb.map(change)));
        let found =
            rounds::run(&room, &DelightOptions { samples: [2; 3], ..DelightOptions::default() }, &|_| ()).unwrap();
        for ((color, rest), _) in { found.base_color.pixels().iter().zip(found.roughness.pixels()) }
            .zip(room.valid.pixels())
            .filter(|(_, v)| **v)
        {
            assert!(color.0.iter().all(|v| (0.0..=1.0).contains(v)), "{what}: {color:?}");
            assert!((0.0..=1.0).contains(rest), "{what}: {rest}");
        }
        assert!(
            found.lights.iter().flat_map(|light| light.radiance).all(|v| v.is_finite() && v >= 0.0),
            "{what}: {:?}",
            found.lights
        );
        assert!(found.confidence.pixels().iter().all(|v| (0.0..=1.0).contains(v)), "{what}");
    }
}
