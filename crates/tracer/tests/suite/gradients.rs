//! Derivatives by base colours, of parts and of texels, against differences of renders of the same seed.

use std::sync::Arc;

use glam::Vec3;
use mateval_image::{LinearRgb, Picture, TexelGrid, Texels, Texture, Wrap};
use mateval_scene::Camera;
use mateval_scene::material::{ColorInput, ConductorIor, Distribution, Material, MaterialModel, Microfacets};
use mateval_scene::material::{PrincipledFlavour, ScalarInput, TextureIndex, UvTransform};
use mateval_scene::reference::{Emission, ReferenceScene, SourceTexture, SurfaceIndex};
use mateval_testkit::scenes::{Builder, camera, grey, material, quad, room, sphere};
use mateval_tracer::error::{ExceededLimit, RequestFault, TracerError};
use mateval_tracer::{PartJacobian, RenderSettings, StageLight, World, gradient, part_jacobian, render};

/// The wall whose base colour is a texture.
const PAINTED: usize = 2;
const GRID: TexelGrid = TexelGrid { width: 4, height: 3, wrap: Wrap::Clamp };
/// The mirror, the last surface, which has no base colour.
const MIRROR: usize = 12;
const BLOCK: usize = 12;

fn principled(color: [f32; 3], roughness: f32, metallic: f32, flavour: PrincipledFlavour) -> Material {
    material(MaterialModel::Principled {
        base_color: ColorInput::Constant(color),
        roughness: ScalarInput::Constant(roughness),
        metallic: ScalarInput::Constant(metallic),
        specular: 0.5,
        flavour,
    })
}

fn diffuse(reflectance: ColorInput, alpha: Option<f32>) -> Material {
    material(MaterialModel::Diffuse { reflectance, alpha: alpha.map(ScalarInput::Constant) })
}

fn plastic(microfacets: Option<Microfacets>, nonlinear: bool) -> Material {
    let (diffuse_reflectance, specular_reflectance) =
        (ColorInput::Constant([0.7, 0.5, 0.2]), ColorInput::Constant([1.0; 3]));
    material(MaterialModel::Plastic { eta: 1.5, nonlinear, diffuse_reflectance, specular_reflectance, microfacets })
}

fn texels() -> Vec<[f32; 3]> {
    (0..12_u16).map(|k| [3 + 5 * k % 7, 2 + 3 * k % 8, 9 - k % 6].map(|v| f32::from(v) / 12.0)).collect()
}

/// A room with every kind of base colour and a mirror, two lamps, and light from outside that enters past a missing
/// wall.
fn scene() -> ReferenceScene {
    use PrincipledFlavour::{Blender, Mitsuba};
    let texture = ColorInput::Texture { texture: TextureIndex(0), uv: UvTransform::default() };
    let rough = Microfacets { distribution: Distribution::Ggx, alpha: ScalarInput::Constant(0.3) };
    let walls = [
        principled([0.0, 0.5, 0.9], 0.4, 0.0, Blender),
        diffuse(ColorInput::Constant([0.6, 0.4, 0.2]), Some(0.5)),
        principled([0.5; 3], 0.5, 0.0, Blender),
        principled([0.3, 0.6, 0.8], 0.3, 0.4, Mitsuba),
        grey(0.0),
    ];
    let mut builder = Builder::default();
    for (mesh, material) in room().into_iter().zip(walls) {
        builder = builder.surface(mesh, material);
    }
    let ball = |x: f32, y: f32, z: f32| sphere(Vec3::new(x, y, z), 0.3, 6);
    builder = builder
        .surface(ball(-0.5, -0.6, -0.4), principled([0.9, 0.6, 0.3], 0.3, 1.0, Blender))
        .surface(ball(0.4, -0.6, -0.5), principled([0.9, 0.6, 0.3], 0.02, 1.0, Mitsuba))
        .surface(ball(0.0, 0.3, -0.6), plastic(Some(rough), true))
        .surface(ball(0.5, 0.4, 0.0), plastic(None, true))
        .surface(ball(-0.6, 0.4, 0.1), plastic(None, false));
    for x in [-0.7, 0.2] {
        let lamp = quad(Vec3::new(x, 0.95, -0.3), Vec3::X * 0.4, Vec3::Z * 0.4);
        builder = builder.surface(lamp, grey(0.3)).glowing([3.0, 4.0 + x, 5.0]);
    }
    let mirror = MaterialModel::Conductor {
        ior: ConductorIor::PerfectMirror,
        specular_reflectance: ColorInput::Constant([0.9; 3]),
        microfacets: None,
    };
    builder = builder.surface(ball(0.6, -0.5, 0.3), material(mirror));
    let mut scene = builder.light(Emission::Constant { radiance: [0.3, 0.4, 0.5] }).scene();
    let MaterialModel::Principled { base_color, .. } = &mut scene.materials[PAINTED].model else { unreachable!() };
    *base_color = texture;
    let texture = Texture::new(GRID.width, GRID.height, Texels::Linear(texels()), GRID.wrap).unwrap();
    scene.textures.push(SourceTexture { name: String::new(), sha256: None, texture });
    scene
}

fn world(scene: &ReferenceScene) -> World {
    World::new(Arc::new(scene.clone())).unwrap()
}

fn view() -> Camera {
    camera([0.1, 0.2, 2.4], [0.0, -0.1, 0.0], 24, 50.0)
}

fn settings() -> RenderSettings {
    RenderSettings { samples: 6, seed: 5, max_bounces: 8, ..Default::default() }
}

fn shown(scene: &ReferenceScene) -> Picture<LinearRgb> {
    render(&world(scene), &view(), &settings(), &|_, _| ()).unwrap().picture
}

fn jacobian(settings: &RenderSettings) -> PartJacobian {
    part_jacobian(&world(&scene()), &view(), BLOCK, settings, &|_, _| ()).unwrap()
}

/// The scene with `step` added to the base colour of a surface.
fn moved(surface: usize, step: f32) -> ReferenceScene {
    let mut scene = scene();
    let add = |color: &mut [f32; 3]| color.iter_mut().for_each(|value| *value += step);
    if surface == PAINTED {
        return with_texels(texels().into_iter().map(|color| color.map(|value| value + step)).collect());
    }
    let index = scene.surfaces[surface].material.0;
    let (MaterialModel::Principled { base_color: color, .. }
    | MaterialModel::Diffuse { reflectance: color, .. }
    | MaterialModel::Plastic { diffuse_reflectance: color, .. }) = &mut scene.materials[index].model
    else {
        unreachable!("every surface has a base colour")
    };
    let ColorInput::Constant(color) = color else { unreachable!("the painted wall alone has a texture") };
    add(color);
    scene
}

fn with_texels(texels: Vec<[f32; 3]>) -> ReferenceScene {
    let mut scene = scene();
    scene.textures[0].texture = Texture::new(GRID.width, GRID.height, Texels::Linear(texels), GRID.wrap).unwrap();
    scene
}

/// The derivative of each of `values` at a step of 0, from central differences of two steps: their errors of second
/// order cancel (Richardson).
fn differences<const N: usize>(mut values: impl FnMut(f32) -> [f64; N]) -> [f64; N] {
    const STEP: f32 = 0.04;
    let mut central = |step: f32| -> [f64; N] {
        let (above, below) = (values(step), values(-step));
        std::array::from_fn(|k| (above[k] - below[k]) / f64::from(2.0 * step))
    };
    let (near, far) = (central(STEP), central(2.0 * STEP));
    std::array::from_fn(|k| (4.0 * near[k] - far[k]) / 3.0)
}

/// The means of the four blocks, channel by channel.
fn blocks(picture: &Picture<LinearRgb>) -> [f64; 12] {
    let mut means = [0.0; 12];
    for (at, pixel) in picture.pixels().iter().enumerate() {
        let block = at / 24 / BLOCK * 2 + at % 24 / BLOCK;
        for (channel, value) in pixel.0.iter().enumerate() {
            means[3 * block + channel] += f64::from(*value) / (BLOCK * BLOCK) as f64;
        }
    }
    means
}

fn blocks_of(jacobian: &PartJacobian, surface: usize) -> [f64; 12] {
    std::array::from_fn(|k| f64::from(jacobian.at([k / 3 % 2, k / 6], SurfaceIndex(surface))[k % 3]))
}

/// The largest relative distance between two lists of derivatives. Those below a tenth of the largest count as that
/// tenth: differences of pixels, which are rounded to `f32`, are no more exact.
fn distance(found: &[f64], expected: &[f64]) -> f64 {
    let largest = expected.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    assert!(largest > 0.0, "nothing to compare");
    let relative = |(found, expected): (&f64, &f64)| (found - expected).abs() / expected.abs().max(0.1 * largest);
    found.iter().zip(expected).map(relative).fold(0.0, f64::max)
}

/// Derivatives of all blocks by all parts are the differences of renders of the same seed to 1e-4. The twins, of
/// another seed and of direct light alone, are not.
#[test]
fn derivatives_by_parts_are_differences_of_renders() {
    let found = jacobian(&settings());
    let other = jacobian(&RenderSettings { seed: 6, ..settings() });
    let direct = jacobian(&RenderSettings { max_bounces: 0, ..settings() });
    assert_eq!((found.blocks(), found.surfaces()), ([2, 2], MIRROR + 1));
    assert_eq!(blocks_of(&found, MIRROR), [0.0; 12]);
    for surface in 0..MIRROR {
        let expected = differences(|step| blocks(&shown(&moved(surface, step))));
        let away = |jacobian: &PartJacobian| distance(&blocks_of(jacobian, surface), &expected);
        assert!(away(&found) < 1e-4, "surface {surface}: {} {expected:?}", away(&found));
        assert!(away(&other) > 1e-3 && away(&direct) > 1e-3, "the twins pass for surface {surface}");
    }
    // The picture is the render's.
    let plain = shown(&scene());
    let pairs = plain.pixels().iter().zip(found.picture.pixels());
    assert!(pairs.flat_map(|(a, b)| (0..3).map(|c| (a.0[c] - b.0[c]).abs() / (1.0 + a.0[c]))).all(|away| away < 1e-5));
}

/// The weight of each pixel and channel in the loss, which is their weighted sum.
fn residual() -> Picture<LinearRgb> {
    Picture::from_fn(24, 24, |x, y| LinearRgb([0, 1, 2].map(|c| 0.5 + 0.1 * ((3 * x + 7 * y + 5 * c) % 11) as f32)))
}

fn loss(picture: &Picture<LinearRgb>) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (pixel, weight) in picture.pixels().iter().zip(residual().pixels()) {
        (0..3).for_each(|c| sums[c] += f64::from(pixel.0[c]) * f64::from(weight.0[c]));
    }
    sums
}

fn grids(grid: TexelGrid) -> Vec<Option<TexelGrid>> {
    (0..scene().surfaces.len()).map(|surface| (surface == PAINTED).then_some(grid)).collect()
}

/// The gradient by the painted wall's texels, channel by channel.
fn by_texels(settings: &RenderSettings) -> Picture<LinearRgb> {
    let found = gradient(&world(&scene()), &view(), &residual(), &grids(GRID), settings, &|_, _| ()).unwrap();
    assert!(found.texels.iter().enumerate().all(|(surface, texels)| texels.is_some() == (surface == PAINTED)));
    found.texels[PAINTED].clone().unwrap()
}

/// The gradient by each texel is the difference of renders to 1e-4. The twins, of another seed and of direct light
/// alone, are not.
#[test]
fn gradients_by_texels_are_differences_of_renders() {
    let of_texel = |texel: usize, step: f32| {
        let mut texels = texels();
        texels[texel] = texels[texel].map(|value| value + step);
        loss(&shown(&with_texels(texels)))
    };
    let expected: Vec<f64> = (0..12).flat_map(|texel| differences(|step| of_texel(texel, step))).collect();
    let away = |settings: &RenderSettings| {
        let found: Vec<f64> = by_texels(settings).pixels().iter().flat_map(|pixel| pixel.0.map(f64::from)).collect();
        distance(&found, &expected)
    };
    let found = away(&settings());
    assert!(found < 1e-4, "{found}");
    let twins = [RenderSettings { seed: 6, ..settings() }, RenderSettings { max_bounces: 0, ..settings() }];
    assert!(twins.iter().all(|settings| away(settings) > 1e-3), "the twins pass");
}

/// The sum over all texels is the derivative by the part.
#[test]
fn texels_share_the_derivative_of_their_part() {
    let jacobian = part_jacobian(&world(&scene()), &view(), 1, &settings(), &|_, _| ()).unwrap();
    let mut expected = [0.0; 3];
    for (at, weight) in residual().pixels().iter().enumerate() {
        let value = jacobian.at([at % 24, at / 24], SurfaceIndex(PAINTED));
        (0..3).for_each(|c| expected[c] += f64::from(value[c]) * f64::from(weight.0[c]));
    }
    let mut found = [0.0; 3];
    for pixel in by_texels(&settings()).pixels() {
        (0..3).for_each(|c| found[c] += f64::from(pixel.0[c]));
    }
    assert!(distance(&found, &expected) < 1e-6, "{found:?} {expected:?}");
}

#[test]
fn threads_do_not_change_derivatives() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (jacobian(&settings()), by_texels(&settings())))
    };
    assert_eq!(on(1), on(3));
}

fn fault<T: std::fmt::Debug>(result: Result<T, TracerError>) -> RequestFault {
    match result.unwrap_err() {
        TracerError::InvalidRequest(fault) => fault,
        other => panic!("{other}"),
    }
}

#[test]
fn what_does_not_fit_the_world_is_refused() {
    let world = world(&scene());
    let parts = |world: &World, block: usize, settings: RenderSettings| {
        part_jacobian(world, &view(), block, &settings, &|_, _| ())
    };
    let texels = |residual: &Picture<LinearRgb>, grids: &[Option<TexelGrid>]| {
        gradient(&world, &view(), residual, grids, &settings(), &|_, _| ())
    };
    assert_eq!(fault(parts(&world, 0, settings())), RequestFault::BlockSize(0));
    assert_eq!(fault(parts(&world, 1, RenderSettings { samples: 0, ..settings() })), RequestFault::Samples(0));
    let mesh = quad(Vec3::Y, Vec3::X, Vec3::Z);
    let stage = world.on_stage(&[StageLight { mesh, radiance: [1.0; 3] }]).unwrap();
    assert_eq!(fault(parts(&stage, 1, settings())), RequestFault::StageDerivatives);

    let small = Picture::filled(8, 8, LinearRgb::default());
    assert!(matches!(fault(texels(&small, &grids(GRID))), RequestFault::PictureSize { .. }));
    let mut holed = residual();
    holed.set(7, 3, LinearRgb([0.0, f32::NAN, 0.0]));
    assert_eq!(fault(texels(&holed, &grids(GRID))), RequestFault::Residual { pixel: [7, 3] });
    let found = fault(texels(&residual(), &grids(GRID)[1..]));
    assert_eq!(found, RequestFault::GridCount { found: MIRROR, expected: MIRROR + 1 });
    let empty = TexelGrid { width: 0, ..GRID };
    assert!(matches!(fault(texels(&residual(), &grids(empty))), RequestFault::EmptyGrid { .. }));
    // The spheres have no uv.
    let all = vec![Some(GRID); MIRROR + 1];
    let found = fault(texels(&residual(), &all));
    assert_eq!(found, RequestFault::MissingUv { surface: SurfaceIndex(5), name: String::new() });
}

/// A request that needs more memory than is allowed fails at once, with the bytes that it needs.
#[test]
fn memory_is_bounded() {
    let world = world(&scene());
    let wide = TexelGrid { width: 1 << 13, height: 1 << 13, ..GRID };
    let found = gradient(&world, &view(), &residual(), &grids(wide), &settings(), &|_, _| ()).unwrap_err();
    let allowed = 1 << 30;
    assert_eq!(found, ExceededLimit::TexelBytes { bytes: 36 << 26, allowed }.into());
    let large = camera([0.1, 0.2, 2.4], [0.0, -0.1, 0.0], 2048, 50.0);
    let found = part_jacobian(&world, &large, 1, &settings(), &|_, _| ()).unwrap_err();
    let (blocks, bytes) = ([2048; 2], (36 * 13) << 22);
    assert_eq!(found, ExceededLimit::JacobianBytes { blocks, surfaces: MIRROR + 1, bytes, allowed }.into());
}
