//! Small scenes, one for each kind of material and light.

use glam::Vec3;
use mateval_dataset::material::{
    BumpMap, ColorInput, ConductorIor, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour,
    ScalarInput, TextureIndex, UvTransform,
};
use mateval_dataset::reference::{Emission, ReferenceScene, SourceTexture};
use mateval_dataset::{Camera, Intrinsics, TriangleMesh};
use mateval_image::{Texels, Texture, Wrap};

use super::mitsuba::{Case, all_agree};
use mateval_testkit::scenes::{Builder, grey, material, quad, sphere};

const WHITE: ColorInput = ColorInput::Constant([1.0; 3]);
const BROWN: ColorInput = ColorInput::Constant([0.8, 0.4, 0.1]);

/// Four balls of flat faces in a row over a grey floor, with a large lamp above them and dim light from all directions.
fn balls(name: &str, materials: [Material; 4]) -> Case {
    let mut builder = stage();
    for (k, material) in materials.into_iter().enumerate() {
        builder = builder.surface(ball(k), material);
    }
    case(name, builder.light(Emission::Constant { radiance: [0.3, 0.35, 0.4] }).scene())
}

/// The floor and the lamp.
fn stage() -> Builder {
    let floor = quad(Vec3::new(-6.0, -0.52, -6.0), Vec3::Z * 12.0, Vec3::X * 12.0);
    let lamp = quad(Vec3::new(-1.5, 2.0, -1.0), Vec3::X * 3.0, Vec3::Z * 2.0);
    Builder::default().surface(floor, grey(0.4)).surface(lamp, grey(0.2)).glowing([3.0, 2.8, 2.5])
}

fn ball(k: usize) -> TriangleMesh {
    let mut mesh = sphere(Vec3::new(-1.65 + 1.1 * k as f32, 0.0, 0.0), 0.5, 8);
    mesh.normals = None;
    mesh
}

fn case(name: &str, scene: ReferenceScene) -> Case {
    Case { name: name.to_owned(), scene, camera: view(), samples: 64 }
}

fn view() -> Camera {
    let intrinsics = Intrinsics::from_fov_x(64, 24, 0.75);
    let position = glam::DVec3::new(0.0, 1.2, 5.5);
    Camera::look_at(position, glam::DVec3::new(0.0, -0.05, 0.0), glam::DVec3::Y, intrinsics).unwrap()
}

fn facets(distribution: Distribution, alpha: f32) -> Option<Microfacets> {
    Some(Microfacets { distribution, alpha: ScalarInput::Constant(alpha) })
}

fn principled(roughness: f32, metallic: f32) -> Material {
    material(MaterialModel::Principled {
        base_color: BROWN,
        roughness: ScalarInput::Constant(roughness),
        metallic: ScalarInput::Constant(metallic),
        specular: 0.5,
        flavour: PrincipledFlavour::Mitsuba,
    })
}

fn conductor(ior: ConductorIor, microfacets: Option<Microfacets>) -> Material {
    let specular_reflectance = ColorInput::Constant([0.9, 1.0, 0.8]);
    material(MaterialModel::Conductor { ior, specular_reflectance, microfacets })
}

fn copper(microfacets: Option<Microfacets>) -> Material {
    conductor(ConductorIor::EtaK { eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.1] }, microfacets)
}

fn plastic(nonlinear: bool, eta: f32, microfacets: Option<Microfacets>) -> Material {
    let (diffuse_reflectance, specular_reflectance) = (BROWN, ColorInput::Constant([1.0, 0.9, 0.8]));
    material(MaterialModel::Plastic { eta, nonlinear, diffuse_reflectance, specular_reflectance, microfacets })
}

fn dielectric(eta: f32, microfacets: Option<Microfacets>) -> Material {
    let specular_transmittance = ColorInput::Constant([0.9, 1.0, 0.8]);
    material(MaterialModel::Dielectric { eta, specular_reflectance: WHITE, specular_transmittance, microfacets })
}

fn thin(eta: f32) -> Material {
    let (specular_reflectance, specular_transmittance) = (ColorInput::Constant([0.8, 0.9, 1.0]), WHITE);
    material(MaterialModel::ThinDielectric { eta, specular_reflectance, specular_transmittance })
}

fn diffuse(reflectance: ColorInput) -> Material {
    material(MaterialModel::Diffuse { reflectance, alpha: None })
}

#[test]
fn opaque_materials() {
    use Distribution::{Beckmann, Ggx};
    let rough = |distribution: Distribution| [0.03, 0.1, 0.3, 0.7].map(|alpha| facets(distribution, alpha));
    let one_sided = Material { two_sided: false, ..diffuse(BROWN) };
    let mirror = conductor(ConductorIor::PerfectMirror, None);
    all_agree(vec![
        balls("diffuse, one-sided, mirror, copper", [diffuse(BROWN), one_sided, mirror, copper(None)]),
        balls("rough conductor, GGX", rough(Ggx).map(copper)),
        balls("rough conductor, Beckmann", rough(Beckmann).map(copper)),
        balls("plastic", [(true, 1.5), (false, 1.5), (true, 1.9), (false, 1.2)].map(|(n, eta)| plastic(n, eta, None))),
        balls("rough plastic, GGX", rough(Ggx).map(|facets| plastic(true, 1.5, facets))),
        balls("rough plastic, GGX, linear", rough(Ggx).map(|facets| plastic(false, 1.9, facets))),
        balls("rough plastic, Beckmann", rough(Beckmann).map(|facets| plastic(true, 1.5, facets))),
        balls("principled, metallic 0", [0.1, 0.3, 0.6, 1.0].map(|roughness| principled(roughness, 0.0))),
        balls("principled, metallic 0.5", [0.1, 0.3, 0.6, 1.0].map(|roughness| principled(roughness, 0.5))),
        balls("principled, metallic 1", [0.1, 0.3, 0.6, 1.0].map(|roughness| principled(roughness, 1.0))),
    ]);
}

#[test]
fn transparent_materials() {
    use Distribution::{Beckmann, Ggx};
    let rough = |distribution: Distribution| [0.05, 0.15, 0.3, 0.7].map(|alpha| facets(distribution, alpha));
    let covered = |opacity: f32| Material { opacity: Some(ScalarInput::Constant(opacity)), ..diffuse(BROWN) };
    all_agree(vec![
        balls("dielectric, thin", [dielectric(1.5, None), dielectric(1.2, None), thin(1.5), thin(2.0)]),
        balls("rough dielectric, GGX", rough(Ggx).map(|facets| dielectric(1.5, facets))),
        balls("rough dielectric, Beckmann", rough(Beckmann).map(|facets| dielectric(1.5, facets))),
        balls("rough dielectric from inside", rough(Ggx).map(|facets| dielectric(0.7, facets))),
        balls("mask", [0.0, 0.3, 0.7, 1.0].map(covered)),
    ]);
}

/// Four upright, tilted squares in a row in front of the same floor, with uv from 0 to 1 and the given textures.
fn squares(name: &str, textures: Vec<Texture>, materials: [Material; 4]) -> Case {
    let mut builder = stage();
    for (k, material) in materials.into_iter().enumerate() {
        let corner = Vec3::new(-2.1 + 1.1 * k as f32, -0.4, 0.3);
        builder = builder.surface(quad(corner, Vec3::new(0.9, 0.0, 0.1), Vec3::new(0.1, 0.8, -0.5)), material);
    }
    let mut scene = builder.light(Emission::Constant { radiance: [0.3, 0.35, 0.4] }).scene();
    let source = |texture| SourceTexture { name: String::new(), sha256: None, texture };
    scene.textures = textures.into_iter().map(source).collect();
    case(name, scene)
}

/// Texels without a pattern.
fn texels(width: usize, height: usize) -> Vec<[u8; 3]> {
    (0..width * height).map(|k| [40 + 53 * k % 199, 40 + 71 * k % 211, 30 + 97 * k % 223].map(|v| v as u8)).collect()
}

fn texture(wrap: Wrap) -> Texture {
    Texture::new(5, 4, Texels::Srgb8(texels(5, 4)), wrap).unwrap()
}

fn shifted(scale: f32) -> UvTransform {
    UvTransform([[1.7 * scale, 0.4, -0.3], [-0.2, 1.3 * scale, 0.6]])
}

fn textured(index: usize, uv: UvTransform) -> ColorInput {
    ColorInput::Texture { texture: TextureIndex(index), uv }
}

fn channel(index: usize, channel: usize, uv: UvTransform) -> ScalarInput {
    ScalarInput::Texture { texture: TextureIndex(index), channel, uv }
}

fn color_textures() -> Case {
    let words = texels(5, 4).iter().map(|rgb| rgb.map(|v| u16::from(v) * 256 + 77)).collect();
    let floats = texels(5, 4).iter().map(|rgb| rgb.map(|v| f32::from(v) / 300.0)).collect();
    let textures = vec![
        texture(Wrap::Repeat),
        Texture::new(5, 4, Texels::Srgb16(words), Wrap::Clamp).unwrap(),
        Texture::new(5, 4, Texels::Linear(floats), Wrap::Mirror).unwrap(),
        Texture::new(5, 4, Texels::Linear8(texels(5, 4)), Wrap::Repeat).unwrap(),
    ];
    let uvs = [UvTransform::default(), shifted(1.0), shifted(2.0), shifted(-1.5)];
    squares("colour textures", textures, [0, 1, 2, 3].map(|k| diffuse(textured(k, uvs[k]))))
}

fn scalar_textures() -> Case {
    let greys = texels(5, 4).iter().map(|rgb| rgb[0]).collect();
    let floats = texels(5, 4).iter().map(|rgb| 0.05 + f32::from(rgb[1]) / 400.0).collect();
    let textures = vec![
        texture(Wrap::Repeat),
        Texture::new(5, 4, Texels::Grey8(greys), Wrap::Clamp).unwrap(),
        Texture::new(5, 4, Texels::Grey(floats), Wrap::Mirror).unwrap(),
        Texture::new(5, 4, Texels::Linear8(texels(5, 4)), Wrap::Repeat).unwrap(),
    ];
    let facets = |alpha: ScalarInput| Some(Microfacets { distribution: Distribution::Ggx, alpha });
    let of_principled = material(MaterialModel::Principled {
        base_color: textured(0, shifted(1.0)),
        roughness: channel(1, 0, shifted(1.0)),
        metallic: channel(3, 2, shifted(-1.0)),
        specular: 0.8,
        flavour: PrincipledFlavour::Mitsuba,
    });
    let masked = Material { opacity: Some(channel(3, 1, shifted(0.7))), ..diffuse(textured(0, shifted(0.5))) };
    let materials = [
        of_principled,
        copper(facets(channel(2, 0, shifted(1.0)))),
        masked,
        dielectric(1.5, facets(channel(2, 0, shifted(0.7)))),
    ];
    squares("number textures, mask", textures, materials)
}

/// Slopes of up to a quarter. With three times this slope some bent normals point away from the viewer: our tracer
/// turns them back, Mitsuba renders them black, and pictures differ by 0.2 %.
fn bumps() -> Case {
    let greys = texels(5, 4).iter().map(|rgb| f32::from(rgb[2]) / 255.0).collect();
    let textures = vec![Texture::new(5, 4, Texels::Grey(greys), Wrap::Repeat).unwrap()];
    let bumped = |material: Material, uv: UvTransform, scale: f32| Material {
        bump: Some(BumpMap { height: channel(0, 0, uv), scale }),
        ..material
    };
    let materials = [
        bumped(diffuse(BROWN), UvTransform::default(), 0.05),
        bumped(principled(0.4, 0.3), shifted(0.6), -0.035),
        bumped(copper(facets(Distribution::Ggx, 0.4)), shifted(-0.6), 0.02),
        bumped(plastic(true, 1.5, facets(Distribution::Ggx, 0.3)), UvTransform::default(), 0.04),
    ];
    squares("bump", textures, materials)
}

#[test]
fn textures() {
    all_agree(vec![color_textures(), scalar_textures()]);
}

#[test]
fn bumped_surfaces() {
    all_agree(vec![bumps()]);
}

/// Balls with interpolated normals. They test the shading frame at the silhouette, where the normal of a front-facing
/// facet points away from the viewer.
#[test]
fn smooth_normals() {
    let smooth = |rings: u32, materials: [Material; 4]| {
        let mut builder = stage();
        for (k, material) in materials.into_iter().enumerate() {
            builder = builder.surface(sphere(Vec3::new(-1.65 + 1.1 * k as f32, 0.0, 0.0), 0.5, rings), material);
        }
        let scene = builder.light(Emission::Constant { radiance: [0.3, 0.35, 0.4] }).scene();
        case(&format!("smooth normals, {rings} rings"), scene)
    };
    let materials =
        || [diffuse(BROWN), copper(facets(Distribution::Ggx, 0.2)), principled(0.4, 0.0), dielectric(1.5, None)];
    all_agree(vec![smooth(64, materials()), smooth(16, materials())]);
}

/// The floor with a box on it, grey, under `lights`.
fn lit(name: &str, textures: Vec<Texture>, lights: impl FnOnce(Builder) -> Builder) -> Case {
    let floor = quad(Vec3::new(-6.0, -0.52, -6.0), Vec3::Z * 12.0, Vec3::X * 12.0);
    let mut builder = Builder::default().surface(floor, grey(0.5)).surface(ball(1), principled(0.3, 0.8));
    // Its black side is visible too.
    let sheet = quad(Vec3::new(0.2, -0.5, -0.5), Vec3::new(0.3, 0.0, 0.9), Vec3::Y * 0.8);
    builder = builder.surface(sheet, Material { two_sided: false, ..grey(0.7) });
    let mut scene = lights(builder).scene();
    let source = |texture| SourceTexture { name: String::new(), sha256: None, texture };
    // A lamp's map is already in the list; an environment's would have to be the first, and no case has both.
    scene.textures.extend(textures.into_iter().map(source));
    case(name, scene)
}

fn environment(scale: f32) -> Emission {
    let (sin, cos) = libm::sincosf(0.7);
    let (sin_t, cos_t) = libm::sincosf(0.4);
    // A rotation about y, then one about x.
    let world_from_environment =
        [[cos, 0.0, sin], [sin_t * sin, cos_t, -sin_t * cos], [-cos_t * sin, sin_t, cos_t * cos]];
    Emission::Environment { texture: TextureIndex(0), scale, world_from_environment }
}

/// Varying dim texels, bright rows at the poles, and one texel that is far brighter.
fn sky() -> Texture {
    let value = |k: usize| match (k, k / 12) {
        (28, _) => [90.0, 80.0, 60.0],
        (_, 0) => [2.0, 1.0, 0.2 * (k % 12) as f32],
        (_, 5) => [0.1 * (k % 12) as f32, 1.0, 2.0],
        _ => [0.1, 0.2, 0.3 + 0.05 * (k % 7) as f32],
    };
    Texture::new(12, 6, Texels::Linear((0..72).map(value).collect()), Wrap::Repeat).unwrap()
}

#[test]
fn lights() {
    let panel = |y: f32, size: f32| {
        let corner = Vec3::new(-0.5 * size - 0.6, y, -0.5 * size);
        quad(corner, Vec3::X * size, Vec3::Z * size)
    };
    let glow = |builder: Builder, mesh: TriangleMesh, radiance: f32, two_sided: bool| {
        let mut scene = builder.surface(mesh, grey(0.3)).glowing([radiance, 0.9 * radiance, 0.7 * radiance]).scene();
        let Some(Emission::Area { two_sided: both, .. }) = scene.lights.last_mut().map(|group| &mut group.emission)
        else {
            unreachable!("a surface has just been made to glow")
        };
        *both = two_sided;
        Builder::from(scene)
    };
    let mapped = |builder: Builder, scale: f32| builder.mapped(texture(Wrap::Mirror), shifted(scale));
    let upright = || quad(Vec3::new(-1.5, -0.4, 0.4), Vec3::new(0.3, 0.0, -0.8), Vec3::Y * 0.7);
    let constant = || Emission::Constant { radiance: [0.5, 0.6, 0.8] };
    let globe = || sphere(Vec3::new(0.6, 0.9, 0.6), 0.2, 12);
    all_agree(vec![
        lit("area", vec![], |builder| glow(builder, panel(1.5, 1.0), 5.0, false)),
        lit("area, one side of a sheet", vec![], |builder| glow(builder, upright(), 5.0, false)),
        lit("area, both sides of a sheet", vec![], |builder| glow(builder, upright(), 5.0, true)),
        lit("area, as a point", vec![], |builder| glow(builder, panel(1.5, 0.02), 9000.0, false)),
        lit("area, a globe", vec![], |builder| glow(builder, globe(), 20.0, false)),
        lit("area, textured", vec![], |builder| mapped(glow(builder, panel(1.5, 1.0), 5.0, false), 1.0)),
        lit("area, textured, both sides", vec![], |builder| mapped(glow(builder, upright(), 5.0, true), -1.5)),
        lit("constant", vec![], |builder| builder.light(constant())),
        lit("environment", vec![sky()], |builder| builder.light(environment(0.8))),
        lit("all together", vec![sky()], |builder| {
            let builder = glow(glow(builder, panel(1.5, 1.0), 2.0, false), upright(), 2.0, true);
            glow(builder, globe(), 5.0, false).light(environment(0.4))
        }),
    ]);
}

/// A glossy floor with the reflection of a narrow upright lamp, whose width depends on the roughness, and a grey wall
/// beside it.
fn glossy(roughness: f32) -> Case {
    let floor = quad(Vec3::new(-6.0, -0.52, -6.0), Vec3::Z * 12.0, Vec3::X * 12.0);
    let lamp = quad(Vec3::new(-0.9, -0.5, -1.5), Vec3::X * 0.2, Vec3::Y * 1.4);
    let wall = quad(Vec3::new(0.4, -0.52, -1.6), Vec3::X * 2.0, Vec3::Y * 1.6);
    let builder = Builder::default().surface(floor, principled(roughness, 1.0)).surface(wall, grey(0.5));
    let builder = builder.surface(lamp, grey(0.2)).glowing([20.0; 3]);
    let scene = builder.light(Emission::Constant { radiance: [0.6, 0.7, 0.8] }).scene();
    case(&format!("roughness {roughness}"), scene)
}

/// Roughness off by 0.02 and albedo off by 1 % are detected in comparison with Mitsuba's pictures of the right scene.
#[test]
fn small_faults_are_detected() {
    let values = [0.1, 0.3, 0.5];
    let rendered = all_agree(values.map(glossy).to_vec());
    for (case, roughness) in rendered.iter().zip(values) {
        for wrong in [roughness - 0.02, roughness + 0.02] {
            let detected = case.detects(&format!("roughness {wrong:.2}"), |scene| {
                scene.materials[0] = principled(wrong, 1.0);
            });
            assert!(detected, "{wrong} passes for {roughness}");
        }
    }
    let case = &rendered[1];
    let detected = case.detects("base color 1 % more", |scene| {
        if let MaterialModel::Principled { base_color, .. } = &mut scene.materials[0].model {
            *base_color = ColorInput::Constant([0.808, 0.404, 0.101]);
        }
    });
    assert!(detected, "base color");
    assert!(case.detects("albedo of the wall 1 % more", |scene| scene.materials[1] = grey(0.505)), "albedo");
}

/// A light off by 1 % is detected, for each kind of light.
#[test]
fn slightly_wrong_lights_are_detected() {
    let panel = || quad(Vec3::new(-1.1, 1.5, -0.5), Vec3::X, Vec3::Z);
    let lamp =
        |radiance: f32| lit("lamp", vec![], |builder| builder.surface(panel(), grey(0.3)).glowing([radiance; 3])).scene;
    let world = |radiance: f32| {
        lit("constant", vec![], |builder| builder.light(Emission::Constant { radiance: [radiance; 3] })).scene
    };
    let mapped = |radiance: f32| {
        let glowing = |builder: Builder| builder.surface(panel(), grey(0.3)).glowing([radiance; 3]);
        lit("mapped lamp", vec![], |builder| glowing(builder).mapped(texture(Wrap::Repeat), shifted(1.0))).scene
    };
    let map = |scale: f32| lit("map", vec![sky()], |builder| builder.light(environment(scale))).scene;
    let pairs = [
        ("lamp", lamp(5.0), lamp(5.05)),
        ("mapped lamp", mapped(8.0), mapped(8.08)),
        ("world", world(0.5), world(0.505)),
        ("map", map(0.8), map(0.808)),
    ];
    let rendered = all_agree(pairs.iter().map(|(name, right, _)| case(name, right.clone())).collect());
    for (case, (name, _, wrong)) in rendered.iter().zip(pairs) {
        assert!(case.detects(&format!("{name} 1 % more"), |scene| *scene = wrong), "{name}");
    }
}
