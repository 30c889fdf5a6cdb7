//! Energy of converted materials against their sources', and what a converted scene holds.

use mateval_image::{Texels, Texture, Wrap};
use mateval_scene::TriangleMesh;
use mateval_scene::material::{BumpMap, Distribution, TextureIndex, UvTransform};
use mateval_scene::reference::{LightGroup, SourceTexture, Surface};

use super::*;

const WHITE: ColorInput = ColorInput::Constant([1.0; 3]);

fn grey(value: f32) -> ColorInput {
    ColorInput::Constant([value; 3])
}

fn ggx(alpha: f32) -> Option<Microfacets> {
    (alpha > 0.0).then_some(Microfacets { distribution: Distribution::Ggx, alpha: ScalarInput::Constant(alpha) })
}

fn material(model: MaterialModel) -> Material {
    Material { name: "m".to_owned(), model, two_sided: false, opacity: None, bump: None }
}

fn plastic(eta: f32, nonlinear: bool, base: f32, alpha: f32) -> MaterialModel {
    let (diffuse_reflectance, microfacets) = (grey(base), ggx(alpha));
    MaterialModel::Plastic { eta, nonlinear, diffuse_reflectance, specular_reflectance: WHITE, microfacets }
}

fn conductor(ior: ConductorIor, tint: [f32; 3], alpha: f32) -> MaterialModel {
    let (specular_reflectance, microfacets) = (ColorInput::Constant(tint), ggx(alpha));
    MaterialModel::Conductor { ior, specular_reflectance, microfacets }
}

fn scene(materials: Vec<Material>, textures: Vec<SourceTexture>) -> ReferenceScene {
    ReferenceScene { materials, textures, ..ReferenceScene::default() }
}

fn converted(model: MaterialModel) -> MaterialModel {
    convert(scene(vec![material(model)], Vec::new()), "scene.xml").unwrap().scene.materials[0].model
}

/// The largest difference between the shares of uniform light that two models reflect.
fn off(a: &MaterialModel, b: &MaterialModel) -> f64 {
    let mut meter = ReflectanceMeter::default();
    let [a, b] = [a, b].map(|model| meter.uniform(model).unwrap());
    (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f64::max)
}

/// The scored model with the source's own colour and roughness, as without the rule.
fn unconverted(color: [f32; 3], alpha: f32, metallic: f32) -> MaterialModel {
    let numbers = [alpha.sqrt(), metallic].map(ScalarInput::Constant);
    scored_model(ColorInput::Constant(color), numbers[0], numbers[1])
}

/// Within a thousandth, over colour, width, index of refraction and both kinds of internal scattering. The twin, the base
/// colour without the rule, is off by up to a quarter.
#[test]
fn plastic_keeps_its_energy() {
    let mut worst_of_twin = 0.0_f64;
    let mut compared = 0;
    for eta in [1.4, 1.9] {
        for nonlinear in [false, true] {
            for alpha in [0.0, 0.05, 0.3] {
                for base in [0.2, 0.8] {
                    let source = plastic(eta, nonlinear, base, alpha);
                    let found = off(&source, &converted(source));
                    assert!(found < 1e-3, "eta {eta}, nonlinear {nonlinear}, alpha {alpha}, base {base}: {found}");
                    worst_of_twin = worst_of_twin.max(off(&source, &unconverted([base; 3], alpha, 0.0)));
                    compared += 1;
                }
            }
        }
    }
    assert_eq!(compared, 24);
    assert!(worst_of_twin > 0.2, "{worst_of_twin}");
}

/// A dark plastic with more reflection than the scored model's is brighter by a base; with less it keeps its textures.
#[test]
fn dark_plastic() {
    for eta in [1.3, 1.5, 1.9] {
        let bases: Vec<f32> = [0.0, 0.01, 0.02, 0.05]
            .map(|base| {
                let source = plastic(eta, true, base, 0.05);
                let model = converted(source);
                // At most what the facets reflect beyond the source's coat, 0.03 for an index of 1.3.
                assert!(off(&source, &model) < 0.035, "{eta} {base}");
                let MaterialModel::Principled { base_color: ColorInput::Constant([r, ..]), .. } = model else {
                    panic!()
                };
                r
            })
            .to_vec();
        assert!(bases.windows(2).all(|pair| pair[0] < pair[1]), "{eta}: {bases:?}");
    }
}

/// Matt surfaces are exact above twice the facets' 2 %, and no colour below is off by more than those.
#[test]
fn diffuse_keeps_its_energy() {
    for alpha in [None, Some(0.4)] {
        for value in [0.0, 0.01, 0.03, 0.05, 0.2, 0.5, 0.8, 1.0] {
            let source = MaterialModel::Diffuse { reflectance: grey(value), alpha: alpha.map(ScalarInput::Constant) };
            let found = off(&source, &converted(source));
            let bound = if value < 0.05 { 0.0225 } else { 1e-3 };
            assert!(found < bound, "{alpha:?} {value}: {found}");
        }
    }
    // The twin: the reflectance itself as the base colour.
    let source = MaterialModel::Diffuse { reflectance: grey(0.2), alpha: None };
    assert!(off(&source, &unconverted([0.2; 3], 1.0, 0.0)) > 0.015);
}

/// Coloured metals of all widths are exact. The twin, F0 as the base colour, is 2 % too bright for smooth chromium, since
/// Schlick's curve rises where the metal's falls, and much more for a rough one, whose facets Mitsuba lets lose light.
#[test]
fn conductors_keep_their_energy() {
    let copper = ConductorIor::EtaK { eta: [0.2004, 0.9240, 1.1022], k: [3.9129, 2.4528, 2.1421] };
    let chromium = ConductorIor::EtaK { eta: [4.369, 2.917, 1.655], k: [5.206, 4.231, 3.755] };
    for ior in [copper, chromium, ConductorIor::PerfectMirror] {
        for alpha in [0.0, 0.01, 0.1, 0.3] {
            for tint in [[1.0; 3], [0.9, 0.5, 0.2]] {
                let source = conductor(ior, tint, alpha);
                let found = off(&source, &converted(source));
                assert!(found < 1e-3, "{ior:?} {alpha} {tint:?}: {found}");
            }
        }
    }
    let f0 = chromium.reflectance_at_normal();
    let twin = |alpha| off(&conductor(chromium, [1.0; 3], alpha), &unconverted(f0, alpha, 1.0));
    assert!(twin(0.0) > 0.02 && twin(0.3) > 0.08, "{} {}", twin(0.0), twin(0.3));
}

/// Mitsuba 3.9.1's own materials in uniform light (65,536 samples of each `bsdf.sample`, by a script of its Python package):
/// a smooth and a rough plastic of index 1.5, smooth and rough chromium. The converted materials reflect the same.
#[test]
fn converted_materials_reflect_what_mitsubas_do() {
    let base = ColorInput::Constant([0.2, 0.5, 0.8]);
    let coated = |alpha: f32| {
        let (eta, nonlinear, microfacets) = (1.5, true, ggx(alpha));
        MaterialModel::Plastic { eta, nonlinear, diffuse_reflectance: base, specular_reflectance: WHITE, microfacets }
    };
    let chromium = ConductorIor::EtaK { eta: [4.369, 2.917, 1.655], k: [5.206, 4.231, 3.755] };
    let mut meter = ReflectanceMeter::default();
    for (source, expected) in [
        (coated(0.0), [0.17462, 0.35274, 0.65291]),
        (coated(0.2), [0.14644, 0.30937, 0.55009]),
        (conductor(chromium, [1.0; 3], 0.0), [0.66485, 0.63380, 0.67866]),
        (conductor(chromium, [1.0; 3], 0.25), [0.59116, 0.56032, 0.59696]),
    ] {
        let found = meter.uniform(&converted(source)).unwrap();
        let worst = (0..3).map(|c| (found[c] - expected[c]).abs()).fold(0.0, f64::max);
        assert!(worst < 2.5e-3, "{source:?}: {found:?}, expected {expected:?}");
    }
}

/// A conductor of eta 0 reflects everything, whatever its k.
#[test]
fn a_conductor_without_a_real_index_is_a_mirror() {
    for k in [1.0, 0.3] {
        let source = conductor(ConductorIor::EtaK { eta: [0.0; 3], k: [k; 3] }, [1.0; 3], 0.0);
        let MaterialModel::Principled { base_color: ColorInput::Constant(rgb), roughness, metallic, .. } =
            converted(source)
        else {
            panic!()
        };
        assert!(rgb.iter().all(|v| (0.999..=1.0).contains(v)), "{rgb:?}");
        assert_eq!([roughness, metallic], [0.0, 1.0].map(ScalarInput::Constant));
    }
}

fn texture(name: &str, texels: Texels) -> SourceTexture {
    let texture = Texture::new(2, 2, texels, Wrap::Mirror).unwrap();
    SourceTexture { name: name.to_owned(), sha256: Some("0a".repeat(32)), texture }
}

fn lookup(texture: usize) -> ColorInput {
    ColorInput::Texture { texture: TextureIndex(texture), uv: UvTransform([[2.0, 0.0, 0.1], [0.0, -1.0, 0.2]]) }
}

fn number(texture: usize, channel: usize) -> ScalarInput {
    ScalarInput::Texture { texture: TextureIndex(texture), channel, uv: UvTransform::default() }
}

/// Each texel of a textured plastic is converted as a constant of its colour; wrapping, uv, opacity, glass, lights and the
/// name of the file stay; bumps and one-sidedness go. The source's materials are kept as they were.
#[test]
fn a_scene_with_textures() {
    let bytes = [[10, 200, 90], [255, 0, 30], [128, 64, 1], [77, 78, 79]];
    let textures = vec![
        texture("unused.png", Texels::Grey8(vec![1; 4])),
        texture("wood.jpg", Texels::Srgb8(bytes.to_vec())),
        texture("leaf.png", Texels::Grey8(vec![0, 255, 255, 0])),
        texture("bump.png", Texels::Grey8(vec![0, 9, 9, 0])),
        texture("width.exr", Texels::Grey(vec![0.04, 0.09, 0.16, 0.25])),
        texture("lamp.exr", Texels::Linear(vec![[7.0; 3]; 4])),
    ];
    let MaterialModel::Plastic { eta, nonlinear, specular_reflectance, .. } = plastic(1.5, true, 0.0, 0.0) else {
        panic!()
    };
    let wood = Material {
        opacity: Some(number(2, 1)),
        bump: Some(BumpMap { height: number(3, 0), scale: 0.01 }),
        ..material(MaterialModel::Plastic {
            eta,
            nonlinear,
            specular_reflectance,
            diffuse_reflectance: lookup(1),
            microfacets: ggx(0.04),
        })
    };
    let brushed = material(MaterialModel::Conductor {
        ior: ConductorIor::PerfectMirror,
        specular_reflectance: lookup(1),
        microfacets: Some(Microfacets { distribution: Distribution::Ggx, alpha: number(4, 2) }),
    });
    let glass = material(MaterialModel::ThinDielectric {
        eta: 1.5,
        specular_reflectance: WHITE,
        specular_transmittance: lookup(1),
    });
    let lamp = Emission::Environment { texture: TextureIndex(5), scale: 1.0, world_from_environment: [[0.0; 3]; 3] };
    let lights = vec![LightGroup { name: "l".to_owned(), emission: lamp, camera_visible: true }];
    let surfaces = vec![Surface { name: "s".to_owned(), mesh: TriangleMesh::default(), material: MaterialIndex(0) }];
    let source = ReferenceScene {
        surfaces: surfaces.clone(),
        lights,
        ..scene(vec![wood.clone(), brushed.clone(), glass.clone(), wood.clone()], textures)
    };
    let Conversion { scene: found, source: kept, findings } = convert(source.clone(), "scene.xml").unwrap();

    assert!(found.materials.iter().all(is_scored_model));
    assert_eq!((found.surfaces, found.materials.len()), (surfaces, 4));
    assert_eq!(found.materials[0], found.materials[3]);
    let MaterialModel::Principled { base_color: ColorInput::Texture { texture, uv }, .. } = found.materials[0].model
    else {
        panic!()
    };
    assert_eq!(uv, UvTransform([[2.0, 0.0, 0.1], [0.0, -1.0, 0.2]]));
    let wood_map = &found.textures[texture.0];
    assert_eq!((wood_map.name.as_str(), wood_map.texture.wrap()), ("wood.jpg", Wrap::Mirror));
    for at in 0..4 {
        let (x, y) = (at % 2, at / 2);
        for c in 0..3 {
            let color = source.textures[1].texture.texel(x, y)[c];
            let MaterialModel::Principled { base_color: ColorInput::Constant([expected, ..]), .. } =
                converted(plastic(1.5, true, color, 0.04))
            else {
                panic!()
            };
            let found = wood_map.texture.texel(x, y)[c];
            let [found, expected] = [found, expected].map(mateval_image::transfer::srgb_from_linear);
            assert!((found - expected).abs() <= 0.51 / 255.0, "{at} {c}: {found} {expected}");
        }
    }
    let MaterialModel::Principled { roughness: ScalarInput::Texture { texture, channel, .. }, .. } =
        found.materials[1].model
    else {
        panic!()
    };
    assert_eq!((found.textures[texture.0].texture.texel(1, 1), channel), ([0.5; 3], 0));
    assert_eq!(findings.iter().map(|f| f.code.as_str()).collect::<Vec<_>>(), ["converted_by_mean"]);
    let MaterialModel::ThinDielectric { specular_transmittance: ColorInput::Texture { texture, .. }, .. } =
        found.materials[2].model
    else {
        panic!()
    };
    assert_eq!(found.textures[texture.0], source.textures[1]);
    let Emission::Environment { texture, .. } = found.lights[0].emission else { panic!() };
    assert_eq!(found.textures[texture.0], source.textures[5]);
    assert!(!found.textures.iter().any(|t| ["unused.png", "bump.png"].contains(&t.name.as_str())));

    // The source's materials show the same texels as before, in any scene that they are put into.
    let kept = kept.unwrap();
    assert!(!kept.textures.iter().any(|t| ["unused.png", "lamp.exr"].contains(&t.name.as_str())));
    let shown = ReferenceScene { materials: Vec::new(), surfaces: Vec::new(), ..found };
    let again = kept.in_scene(&shown);
    for (before, after) in source.materials.iter().zip(&again.materials) {
        let (before, after) = (before.lookups(), after.lookups());
        let pairs = before.iter().zip(&after);
        assert!(pairs.clone().count() >= 1);
        for (before, after) in pairs {
            assert_eq!(source.textures[before.texture.0], again.textures[after.texture.0]);
            assert_eq!((before.channel, before.uv), (after.channel, after.uv));
        }
    }
}

#[test]
fn colours_beyond_one_are_clipped_and_reported() {
    let model = MaterialModel::Diffuse { reflectance: ColorInput::Constant([2.0, 0.5, 0.5]), alpha: None };
    let found = convert(scene(vec![material(model)], Vec::new()), "scene.xml").unwrap();
    assert_eq!(found.findings[0].code, "base_color_clipped");
    assert!(is_scored_model(&found.scene.materials[0]));
    let float = texture("a.exr", Texels::Linear(vec![[0.5; 3], [0.5; 3], [1.5; 3], [0.5; 3]]));
    let model = scored_model(lookup(0), ScalarInput::Constant(1.5), ScalarInput::Constant(0.0));
    let source = Material { two_sided: true, ..material(model) };
    let found = convert(scene(vec![source], vec![float]), "scene.xml").unwrap();
    assert_eq!(found.findings[0].code, "base_color_clipped");
    assert_eq!(found.scene.textures[0].texture.texel(0, 1), [1.0; 3]);
}

/// Rooms of 3D-FRONT need no conversion and no second set of files. Their twins with a bump, one side, or another
/// `specular` do.
#[test]
fn the_scored_model_stays() {
    let numbers = [0.5, 0.0].map(ScalarInput::Constant);
    let own = Material { two_sided: true, ..material(scored_model(grey(0.4), numbers[0], numbers[1])) };
    let plain = scene(vec![own.clone()], Vec::new());
    let found = convert(plain.clone(), "house.json").unwrap();
    assert_eq!((found.scene, found.source), (plain, None));
    let MaterialModel::Principled { base_color, roughness, metallic, flavour, .. } = own.model else { panic!() };
    let shiny = MaterialModel::Principled { base_color, roughness, metallic, specular: 0.6, flavour };
    let mitsubas = MaterialModel::Principled {
        base_color,
        roughness,
        metallic,
        specular: SPECULAR,
        flavour: PrincipledFlavour::Mitsuba,
    };
    let bump = Some(BumpMap { height: ScalarInput::Constant(0.0), scale: 1.0 });
    for twin in [
        Material { two_sided: false, ..own.clone() },
        Material { bump, ..own.clone() },
        Material { model: shiny, ..own.clone() },
        Material { model: mitsubas, ..own.clone() },
    ] {
        let found = convert(scene(vec![twin], Vec::new()), "house.json").unwrap();
        assert_eq!(found.scene.materials, std::slice::from_ref(&own));
        assert!(found.source.is_some());
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let negative = plastic(-1.5, true, 0.5, 0.1);
    let error = convert(scene(vec![material(negative)], Vec::new()), "scene.xml").unwrap_err().to_string();
    assert!(error.contains("'m'"), "{error}");
    let dangling = MaterialModel::Diffuse { reflectance: lookup(3), alpha: None };
    let found = convert(scene(vec![material(dangling)], Vec::new()), "scene.xml").unwrap().scene;
    let surface = Surface {
        name: "s".to_owned(),
        mesh: TriangleMesh {
            positions: vec![glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y],
            triangles: vec![[0, 1, 2]],
            ..Default::default()
        },
        material: MaterialIndex(0),
    };
    let found = ReferenceScene { surfaces: vec![surface], ..found };
    assert!(mateval_tracer::World::new(std::sync::Arc::new(found)).is_err());
}
