//! Whole exports: the files written, the findings, and that names of the source are harmless.

use glam::{DVec3, Vec2, Vec3};
use mateval_image::{LinearRgb, Texels, Wrap, exr_io};
use mateval_scene::material::{
    ColorInput, Distribution, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput, TextureIndex, UvTransform,
};
use mateval_scene::reference::{Emission, EmissionMap, LightGroup, MaterialIndex, SourceTexture, SurfaceIndex};
use mateval_scene::{Intrinsics, Severity, TriangleMesh};

use super::*;

const GREY: ColorInput = ColorInput::Constant([0.5; 3]);

fn square(normals: bool) -> TriangleMesh {
    TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
        normals: normals.then(|| vec![Vec3::Z; 4]),
        uvs: Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

fn material(model: MaterialModel) -> Material {
    Material { name: "m".to_owned(), model, two_sided: true, opacity: None, bump: None }
}

/// One square of each material, one texture.
fn scene(materials: Vec<Material>) -> ReferenceScene {
    let texels = Texels::Grey8(vec![0, 51, 102, 255]);
    let texture = Texture::new(2, 2, texels, Wrap::Mirror).unwrap();
    let surface = |k: usize| Surface { name: "s".to_owned(), mesh: square(true), material: MaterialIndex(k) };
    ReferenceScene {
        surfaces: (0..materials.len()).map(surface).collect(),
        materials,
        textures: vec![SourceTexture { name: String::new(), sha256: None, texture }],
        lights: Vec::new(),
    }
}

fn diffuse() -> Material {
    material(MaterialModel::Diffuse { reflectance: GREY, alpha: None })
}

fn camera() -> Camera {
    Camera::look_at(DVec3::Z * 3.0, DVec3::ZERO, DVec3::Y, Intrinsics::from_fov_x(8, 6, 1.0)).unwrap()
}

/// The codes of an export's findings and the text of its `scene.xml`. Checks that every file that it refers to exists.
fn exported(scene: &ReferenceScene) -> (Vec<(Severity, String)>, String) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let findings = export(scene, &camera(), &RenderSettings::default(), &out).unwrap();
    let text = std::fs::read_to_string(out.join("scene.xml")).unwrap();
    let document = roxmltree::Document::parse(&text).unwrap();
    for node in document.descendants().filter(|node| node.attribute("name") == Some("filename")) {
        let file = node.attribute("value").unwrap();
        assert!(!file.contains("..") && !file.starts_with('/') && out.join(file).is_file(), "{file}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    (findings.into_iter().map(|finding| (finding.severity, finding.code)).collect(), text)
}

fn warnings(scene: &ReferenceScene) -> Vec<String> {
    let warnings = exported(scene).0.into_iter().filter(|(severity, _)| *severity == Severity::Warning);
    warnings.map(|(_, code)| code).collect()
}

fn light(emission: Emission) -> LightGroup {
    LightGroup { name: "l".to_owned(), emission, camera_visible: true }
}

fn area(two_sided: bool) -> LightGroup {
    light(Emission::Area { surfaces: vec![SurfaceIndex(0)], radiance: [2.0; 3], map: None, two_sided })
}

fn textured() -> ScalarInput {
    ScalarInput::Texture { texture: TextureIndex(0), channel: 1, uv: Default::default() }
}

fn rough_plastic(alpha: ScalarInput) -> Material {
    material(MaterialModel::Plastic {
        eta: 1.5,
        nonlinear: true,
        diffuse_reflectance: GREY,
        specular_reflectance: GREY,
        microfacets: Some(Microfacets { distribution: Distribution::Ggx, alpha }),
    })
}

fn principled(flavour: PrincipledFlavour) -> Material {
    material(MaterialModel::Principled {
        base_color: GREY,
        roughness: textured(),
        metallic: ScalarInput::Constant(0.0),
        specular: 0.5,
        flavour,
    })
}

/// Everything that Mitsuba cannot express gives a warning; the twin that it can express gives none.
#[test]
fn what_mitsuba_cannot_express_is_a_warning() {
    let changed = |change: &dyn Fn(&mut ReferenceScene)| {
        let mut scene = scene(vec![diffuse()]);
        change(&mut scene);
        scene
    };
    let sky = || light(Emission::Constant { radiance: [1.0; 3] });
    let masked = || Material { opacity: Some(textured()), ..diffuse() };
    let hidden = || LightGroup { camera_visible: false, ..area(false) };
    let oren_nayar = MaterialModel::Diffuse { reflectance: GREY, alpha: Some(ScalarInput::Constant(0.3)) };
    let bright = MaterialModel::Diffuse { reflectance: ColorInput::Constant([1.5; 3]), alpha: None };
    let folded = || {
        let mut scene = mapped_lamp();
        scene.surfaces[0].mesh.uvs = Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::X]);
        scene
    };
    let cases: [(ReferenceScene, &[&str]); 14] = [
        (scene(vec![diffuse()]), &[]),
        (scene(vec![material(oren_nayar)]), &["oren_nayar"]),
        (scene(vec![material(bright)]), &["color_range"]),
        (scene(vec![principled(PrincipledFlavour::Mitsuba)]), &[]),
        (scene(vec![principled(PrincipledFlavour::Blender)]), &["blender_principled"]),
        (scene(vec![rough_plastic(ScalarInput::Constant(0.2))]), &[]),
        (scene(vec![rough_plastic(textured())]), &["alpha_texture"]),
        (changed(&|scene| scene.lights = vec![area(true), sky()]), &[]),
        (changed(&|scene| scene.lights = vec![hidden(), sky()]), &["camera_invisible"]),
        (changed(&|scene| scene.lights = vec![sky(), sky()]), &["second_environment"]),
        (changed(&|scene| scene.materials = vec![masked()]), &[]),
        (changed(&|scene| (scene.materials, scene.lights) = (vec![masked()], vec![area(false)])), &["masked_light"]),
        (mapped_lamp(), &[]),
        (folded(), &["folded_light"]),
    ];
    for (scene, expected) in cases {
        assert_eq!(warnings(&scene), expected, "{scene:?}");
    }
}

/// A lamp that emits on both sides becomes two flat shapes, any other surface one. A texture that is used twice is written
/// once.
#[test]
fn shapes_and_files() {
    let mut scene = scene(vec![principled(PrincipledFlavour::Mitsuba), principled(PrincipledFlavour::Mitsuba)]);
    scene.lights = vec![area(true)];
    let (codes, text) = exported(&scene);
    let codes: Vec<&str> = codes.iter().map(|(_, code)| code.as_str()).collect();
    assert_eq!(codes, ["flat_light", "two_sided_light"]);
    assert_eq!((text.matches("<shape").count(), text.matches("<emitter").count()), (3, 2));
    assert_eq!(text.matches("textures/0_green.png").count(), 2);
    assert!(text.contains("<string name=\"wrap_mode\" value=\"mirror\"/>"));
    assert!(text.contains("<integer name=\"max_depth\" value=\"18\"/>"));
    assert_eq!(exported(&ReferenceScene::default()).0, []);
}

/// A scene with one lamp, whose radiance is (2, 3, 4) times the texture.
fn mapped_lamp() -> ReferenceScene {
    let mut scene = scene(vec![diffuse()]);
    let uv = UvTransform([[2.0, 0.0, 0.0], [0.0, 1.0, 0.25]]);
    let map = Some(EmissionMap { texture: TextureIndex(0), uv });
    let surfaces = vec![SurfaceIndex(0)];
    scene.lights = vec![light(Emission::Area { surfaces, radiance: [2.0, 3.0, 4.0], map, two_sided: false })];
    scene
}

/// A textured light becomes a bitmap of its radiance in floats, or a constant where all texels are equal.
#[test]
fn textured_lights() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    export(&mapped_lamp(), &camera(), &RenderSettings::default(), &out).unwrap();
    let text = std::fs::read_to_string(out.join("scene.xml")).unwrap();
    let emitter = &text[text.find("<emitter").unwrap()..text.find("</emitter>").unwrap()];
    for part in [
        "<texture type=\"bitmap\" name=\"radiance\">",
        "textures/light_0.exr",
        "<boolean name=\"raw\" value=\"true\"/>",
        "value=\"mirror\"",
        "value=\"2 0 0 0 0 -1 0 0.75 0 0 1 0 0 0 0 1\"",
    ] {
        assert!(emitter.contains(part), "{part}: {emitter}");
    }
    let picture = exr_io::read_linear(&out.join("textures/light_0.exr")).unwrap();
    let expected = [0.0, 0.2, 0.4, 1.0].map(|share| LinearRgb([2.0 * share, 3.0 * share, 4.0 * share]));
    for (found, expected) in picture.pixels().iter().zip(expected) {
        assert!((0..3).all(|c| (found.0[c] - expected.0[c]).abs() < 1e-6), "{found:?} {expected:?}");
    }

    let constant = |change: &dyn Fn(&mut ReferenceScene)| {
        let mut scene = mapped_lamp();
        change(&mut scene);
        assert_eq!(warnings(&scene), [""; 0]);
        exported(&scene).1
    };
    let set = |scene: &mut ReferenceScene, texels: Vec<u8>, side: usize| {
        scene.textures[0].texture = Texture::new(side, side, Texels::Grey8(texels), Wrap::Repeat).unwrap();
    };
    let half = constant(&|scene| set(scene, vec![51], 1));
    assert!(half.contains("<rgb name=\"radiance\" value=\"0.4 0.6 0.8\"/>"), "{half}");
    let black = constant(&|scene| set(scene, vec![0; 4], 2));
    assert!(black.contains("<rgb name=\"radiance\" value=\"0 0 0\"/>"), "{black}");
    // Looked up at uv (0, 0), that is at (0, 0.25): the lower left texel.
    let without_uv = constant(&|scene| scene.surfaces[0].mesh.uvs = None);
    assert!(without_uv.contains("<rgb name=\"radiance\" value=\"0.8 1.2 1.6\"/>"), "{without_uv}");
}

/// Names that try to leave a folder, an attribute or a comment, or to control a terminal.
#[test]
fn hostile_names_stay_comments() {
    let hostile =
        "../../etc/passwd --> <boom a=\"1\"/> <![CDATA[ &x; \u{1b}[31m\u{0}\n".to_owned() + &"long".repeat(9999);
    let mut scene = scene(vec![diffuse()]);
    scene.materials[0].name = hostile.clone();
    scene.surfaces[0].name = hostile.clone();
    scene.textures[0].name = hostile.clone();
    scene.lights = vec![LightGroup { name: hostile, ..area(false) }];
    let text = exported(&scene).1;
    let document = roxmltree::Document::parse(&text).unwrap();
    assert!(!text.contains("<boom") && !text.contains('\u{1b}') && text.len() < 5000, "{text}");
    assert_eq!(document.descendants().filter(|node| node.has_tag_name("boom")).count(), 0);
}

/// An existing folder is replaced as a whole. A folder that cannot be created is an error and leaves no files.
#[test]
fn the_folder_is_complete_or_does_not_exist() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("older"), "x").unwrap();
    export(&scene(vec![diffuse()]), &camera(), &RenderSettings::default(), &out).unwrap();
    assert!(out.join("scene.xml").is_file() && !out.join("older").exists());
    let file = folder.path().join("file");
    std::fs::write(&file, "x").unwrap();
    let below = file.join("out");
    assert!(export(&scene(vec![diffuse()]), &camera(), &RenderSettings::default(), &below).is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}
