//! A scene that Blender's own glTF exporter writes is the same scene again: the built-in room, as .glb and as .gltf
//! with files beside it.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, LazyLock};

use mateval_dataset::layout::SceneFolder;
use mateval_dataset::material::{Material, MaterialModel, ScalarInput};
use mateval_dataset::reference::{Emission, ReferenceScene, Surface};
use mateval_dataset::{Camera, SceneId, SceneLights, reference};
use mateval_image::transfer::srgb_from_linear;
use mateval_image::{Picture, Texture, Wrap, png_io};
use mateval_sources::gltf::{self, Limits};
use mateval_sources::source_scene::FileScene;
use mateval_testkit::kept_folder;
use mateval_tracer::{RenderSettings, World};
use serde_json::{Value, json};

use super::blender::blender;
use super::command::{build, run, verify};
use super::sample::unrendered;

/// The sample's room, whose materials are converted, without its environment: glTF has none.
fn room() -> ReferenceScene {
    let folder = SceneFolder::of(unrendered(), &SceneId::new("room").unwrap());
    let mut scene = reference::read(&folder).unwrap();
    scene.lights.retain(|light| matches!(light.emission, Emission::Area { .. }));
    scene
}

fn camera() -> Camera {
    let folder = SceneFolder::of(unrendered(), &SceneId::new("room").unwrap());
    let scene: mateval_dataset::dataset::SceneFile = mateval_dataset::json::read(&folder.scene_file()).unwrap();
    scene.views[0].camera
}

/// Power in watts, and the place of every lamp.
const POINT: (&str, f64, [f64; 3]) = ("bulb", 40.0, [1.0, 2.0, 1.0]);
const SPOT: (&str, f64, [f64; 3]) = ("spot", 25.0, [3.0, 2.4, 2.0]);
const SUN_IRRADIANCE: f64 = 2.5;
/// The spot's whole opening angle; without blending the cone is hard.
const SPOT_ANGLE: f64 = 1.0;

/// Both files that Blender wrote; none without Blender.
static EXPORTED: LazyLock<Option<[PathBuf; 2]>> = LazyLock::new(|| {
    let (python, _turn) = blender()?;
    let folder = kept_folder("gltf");
    Some([("GLB", "room.glb"), ("GLTF_SEPARATE", "apart/room.gltf")].map(|(format, name)| {
        let out = folder.join(name);
        std::fs::create_dir_all(out.parent().unwrap()).unwrap();
        let job = folder.join(format!("{format}.json"));
        let text = job_of(&room(), &folder, format, &out).to_string();
        std::fs::write(&job, text).unwrap();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/blender_export.py");
        let done = Command::new(&python).arg(script).arg(&job).output().unwrap();
        assert!(done.status.success() && out.is_file(), "{}", String::from_utf8_lossy(&done.stderr));
        out
    }))
});

fn job_of(scene: &ReferenceScene, folder: &Path, format: &str, out: &Path) -> Value {
    let texture = |(at, texture): (usize, &Texture)| {
        let file = folder.join(format!("texture{at}.png"));
        let byte = |value: f32| (srgb_from_linear(value.clamp(0.0, 1.0)) * 255.0).round() as u8;
        let bytes = Picture::from_fn(texture.width(), texture.height(), |x, y| texture.texel(x, y).map(byte));
        png_io::write_rgb_bytes(&file, &bytes).unwrap();
        let wrap = match texture.wrap() {
            Wrap::Repeat => "repeat",
            Wrap::Clamp => "clamp",
            Wrap::Mirror => "mirror",
        };
        json!({ "file": file, "wrap": wrap })
    };
    let surface = |surface: &Surface| {
        let mesh = &surface.mesh;
        json!({
            "name": surface.name, "material": surface.material, "positions": mesh.positions, "normals": mesh.normals,
            "uvs": mesh.uvs, "triangles": mesh.triangles,
        })
    };
    let lamp = |(name, energy, position): (&str, f64, [f64; 3]), kind: &str| {
        json!({
            "name": name, "type": kind, "energy": energy, "position": position, "spot_size": SPOT_ANGLE, "spot_blend": 0.0,
        })
    };
    let sun = ("sun", SUN_IRRADIANCE, [0.0; 3]);
    json!({
        "surfaces": scene.surfaces.iter().map(surface).collect::<Vec<_>>(),
        "materials": scene.materials, "lights": scene.lights, "camera": camera(), "format": format, "out": out,
        "textures": scene.texture_list().iter().enumerate().map(texture).collect::<Vec<_>>(),
        "lamps": [lamp(POINT, "POINT"), lamp(SPOT, "SPOT"), lamp(sun, "SUN")],
    })
}

fn read(path: &Path) -> FileScene {
    gltf::read(path, None, &Limits::default()).unwrap()
}

/// The surface of this name, and its index.
fn surface<'a>(scene: &'a ReferenceScene, name: &str) -> (usize, &'a Surface) {
    let found = scene.surfaces.iter().enumerate().find(|(_, surface)| surface.name == name);
    found.unwrap_or_else(|| panic!("no surface '{name}'"))
}

#[test]
fn instances_and_textures_come_back() {
    let Some(files) = &*EXPORTED else { return };
    let room = room();
    for read in files.iter().map(|file| read(file)) {
        assert_eq!(read.scene.surfaces.len(), room.surfaces.len() + 2, "the lamps are two more");
        for expected in &room.surfaces {
            let (_, found) = surface(&read.scene, &expected.name);
            same_triangles(found, expected);
            same_material((&read.scene, found), (&room, expected));
        }
        same_camera(&read.camera.unwrap());
        let warnings = read.findings.iter().filter(|finding| finding.severity != mateval_dataset::Severity::Note);
        let warnings: Vec<String> = warnings.map(|finding| finding.message.clone()).collect();
        assert_eq!(warnings, ["cones of spot lights: not represented"]);
    }
}

/// The corners of all triangles, in any order: Blender sorts its triangles.
fn same_triangles(found: &Surface, expected: &Surface) {
    let name = &expected.name;
    assert_eq!(found.mesh.triangles.len(), expected.mesh.triangles.len(), "{name}");
    assert!((found.mesh.area() / expected.mesh.area() - 1.0).abs() < 1e-5, "{name}");
    let uv = |surface: &Surface, vertex: u32| surface.mesh.uvs.as_ref().map(|uvs| uvs[vertex as usize]);
    for (index, (ours, theirs)) in found.mesh.triangles.iter().zip(&expected.mesh.triangles).enumerate() {
        for (one, other) in ours.iter().zip(theirs) {
            let places = [(found, one), (expected, other)].map(|(surface, at)| surface.mesh.positions[*at as usize]);
            assert!((places[0] - places[1]).length() < 1e-5, "{name}: triangle {index}");
            if let (Some(a), Some(b)) = (uv(found, *one), uv(expected, *other)) {
                assert!((a - b).length() < 1e-5, "{name}: uv of triangle {index}");
            }
        }
    }
}

/// Base colour within half a step of 8 bits, roughness and metallic exactly, at the centre of every triangle and the
/// texels.
fn same_material(found: (&ReferenceScene, &Surface), expected: (&ReferenceScene, &Surface)) {
    let [ours, theirs] = [found, expected].map(|(scene, surface)| &scene.materials[surface.material.0]);
    let name = &expected.1.name;
    assert_eq!(ours.opacity, None);
    let (MaterialModel::Principled { .. }, MaterialModel::Principled { .. }) = (&ours.model, &theirs.model) else {
        // The pane. Whether glass is two-sided has no meaning.
        assert_eq!(ours.model, theirs.model, "{name}");
        return;
    };
    assert_eq!(ours.two_sided, theirs.two_sided);
    let lists = [found, expected].map(|(scene, _)| scene.texture_list());
    for (ours, theirs) in texels(ours, &lists[0]).zip(texels(theirs, &lists[1])) {
        for channel in 0..3 {
            let step = 255.0 * (srgb_from_linear(ours[channel]) - srgb_from_linear(theirs[channel])).abs();
            assert!(step <= 0.501, "{name}: {step} steps");
        }
    }
    let numbers = |material: &Material| match material.model {
        MaterialModel::Principled { roughness, metallic, specular, .. } => (roughness, metallic, specular),
        _ => unreachable!("checked above"),
    };
    let ((r0, m0, s0), (r1, m1, s1)) = (numbers(ours), numbers(theirs));
    let near = |a: ScalarInput, b: ScalarInput| match (a, b) {
        (ScalarInput::Constant(a), ScalarInput::Constant(b)) => (a - b).abs() < 1e-6,
        _ => false,
    };
    assert!(near(r0, r1) && near(m0, m1) && s0 == s1, "{name}: {r0:?} {r1:?}, {m0:?} {m1:?}");
}

/// Base colours at the centres of a grid of 64 x 64.
fn texels<'a>(material: &'a Material, textures: &'a [Texture]) -> impl Iterator<Item = [f32; 3]> + 'a {
    let place = |at: u32| glam::Vec2::new((at % 64) as f32 + 0.5, (at / 64) as f32 + 0.5) / 64.0;
    (0..64 * 64).filter_map(move |at| Some(material.appearance(textures, place(at))?.base_color))
}

fn same_camera(found: &Camera) {
    let expected = camera();
    let (a, b) = (found.matrix().to_cols_array(), expected.matrix().to_cols_array());
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
    let fov = |camera: &Camera| f64::from(camera.intrinsics.height) / camera.intrinsics.fy;
    assert!((fov(found) / fov(&expected) - 1.0).abs() < 1e-4, "{} {}", fov(found), fov(&expected));
}

/// Radiance times area of each lamp of the room, and the power of Blender's own lamps, within 2 %.
#[test]
fn light_comes_back() {
    let Some([file, _]) = &*EXPORTED else { return };
    let (room, read) = (room(), read(file));
    assert_eq!((read.lights, read.scene.lights.len()), (SceneLights::Own, room.lights.len() + 3));
    let power = |scene: &ReferenceScene, name: &str| {
        let light = scene.lights.iter().find(|light| light.name == name).unwrap_or_else(|| panic!("no light '{name}'"));
        let Emission::Area { surfaces, radiance, map: None, two_sided } = &light.emission else { panic!("{light:?}") };
        let area: f64 = surfaces.iter().map(|surface| scene.surfaces[surface.0].mesh.area()).sum();
        (radiance.map(|value| std::f64::consts::PI * f64::from(value) * area), *two_sided)
    };
    let close = |found: [f64; 3], expected: [f64; 3]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 0.02), "{found:?} {expected:?}");
    };
    for light in &room.lights {
        let ((found, found_sides), (expected, sides)) = (power(&read.scene, &light.name), power(&room, &light.name));
        close(found, expected);
        assert_eq!(found_sides, sides, "{}", light.name);
    }
    close(power(&read.scene, POINT.0).0, [POINT.1; 3]);
    // Blender's spot is a point behind a cone: the share of the sphere that its cap covers.
    let cap = (1.0 - (SPOT_ANGLE / 2.0).cos()) / 2.0;
    close(power(&read.scene, SPOT.0).0, [SPOT.1 * cap; 3]);
    close(irradiance(&read.scene), [SUN_IRRADIANCE; 3]);
}

/// The irradiance of a surface that faces up, from the map of the sun.
fn irradiance(scene: &ReferenceScene) -> [f64; 3] {
    let map = scene.lights.iter().find_map(|light| match &light.emission {
        Emission::Environment { texture, .. } => Some(&scene.textures[texture.0].texture),
        _ => None,
    });
    let (map, pi) = (map.unwrap(), std::f64::consts::PI);
    let mut sum = [0.0; 3];
    for y in 0..map.height() {
        let [top, bottom] = [y, y + 1].map(|row| pi * row as f64 / map.height() as f64);
        let solid_angle = 2.0 * pi / map.width() as f64 * (top.cos() - bottom.cos());
        for x in 0..map.width() {
            let weight = solid_angle * ((top + bottom) / 2.0).cos().max(0.0);
            map.texel(x, y).iter().zip(&mut sum).for_each(|(value, sum)| *sum += f64::from(*value) * weight);
        }
    }
    sum
}

/// Both scenes, under the room's own lamps, give the same picture within 2 % of its mean.
#[test]
fn pictures_agree() {
    let Some([file, _]) = &*EXPORTED else { return };
    let (room, mut back) = (room(), read(file).scene);
    let names: Vec<String> = room.lights.iter().map(|light| light.name.clone()).collect();
    back.lights.retain(|light| names.contains(&light.name));
    let mean = |scene: ReferenceScene| {
        let world = World::new(Arc::new(scene)).unwrap();
        let settings = RenderSettings { samples: 16, ..Default::default() };
        let done = mateval_tracer::render(&world, &camera().resized(48, 36), &settings, &|_, _| ()).unwrap();
        let pixels = done.picture.pixels().iter();
        pixels
            .map(|pixel| pixel.0.map(f64::from))
            .fold([0.0; 3], |sum, p| [sum[0] + p[0], sum[1] + p[1], sum[2] + p[2]])
    };
    let (found, expected) = (mean(back), mean(room));
    assert!(found.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 0.02), "{found:?} {expected:?}");
}

/// One line of a recipe is all that it takes.
#[test]
fn a_recipe_builds_it() {
    let Some(files) = &*EXPORTED else { return };
    let folder = tempfile::tempdir().unwrap();
    for (number, file) in files.iter().enumerate() {
        let recipe = file.parent().unwrap().join(format!("recipe{number}.toml"));
        let name = file.file_name().unwrap().to_string_lossy();
        let head = "name = \"back\"\nresolution = [64, 48]\natlas_size = 64\nviews = []";
        std::fs::write(&recipe, format!("{head}\n[[scene]]\nid = \"room\"\ngltf = \"{name}\"\n")).unwrap();
        let dataset = folder.path().join(format!("dataset{number}"));
        run(&mut build(&recipe, &dataset)).ends_with(0);
        run(&mut verify(&dataset)).ends_with(0);
        let scene = super::sample::json(&dataset.join("scenes/room/scene.json"));
        assert_eq!(scene["source"]["kind"], "gltf");
        assert_eq!((&scene["source"]["house"], &scene["lights"]), (&json!("room"), &json!("own")));
    }
}

/// A triangle whose vertices are in the JSON, without a camera.
fn small() -> String {
    let floats = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let bytes: Vec<u8> = floats.iter().flat_map(|value| value.to_le_bytes()).collect();
    // 36 bytes are twelve groups of three, so that base64 needs no padding.
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits = bytes.chunks(3).flat_map(|three| {
        let word = three.iter().fold(0_usize, |word, byte| word << 8 | usize::from(*byte));
        [18, 12, 6, 0].map(|shift| char::from(DIGITS[word >> shift & 63]))
    });
    let uri = format!("data:;base64,{}", digits.collect::<String>());
    let accessor = json!({
        "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0],
    });
    json!({
        "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }], "accessors": [accessor],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }], "buffers": [{ "byteLength": 36, "uri": uri }],
    })
    .to_string()
}

/// Without a camera in the file or the recipe there is no scene; with the recipe's there is. A file that requires a
/// compression is refused by its name, and a missing buffer by its place.
#[test]
fn what_cannot_be_built_is_one_clear_error() {
    let folder = tempfile::tempdir().unwrap();
    let built = |text: &str, camera: &str, out: &str| {
        let scene = format!("[[scene]]\nid = \"a\"\ngltf = \"a.gltf\"\n{camera}");
        let recipe = folder.path().join("recipe.toml");
        std::fs::write(&recipe, format!("name = \"small\"\nresolution = [32, 24]\nviews = []\n{scene}\n")).unwrap();
        std::fs::write(folder.path().join("a.gltf"), text).unwrap();
        run(&mut build(&recipe, &folder.path().join(out)))
    };
    let camera = "allow_unstated = true\n\
        camera = { position = [0.3, 0.3, 2.0], target = [0.3, 0.3, 0.0], fov_y_deg = 40.0 }";
    let one = built(&small(), "", "none");
    assert!(one.stderr.contains("no perspective camera"), "{}", one.stderr);
    one.ends_with(2);
    built(&small(), camera, "small").ends_with(0);
    let compressed = small().replacen('{', "{\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],", 1);
    let refused = built(&compressed, camera, "draco");
    assert!(
        refused.stderr.contains("a.gltf") && refused.stderr.contains("'KHR_draco_mesh_compression'"),
        "{}",
        refused.stderr
    );
    refused.ends_with(2);
    let missing = built(&small().replace("data:;base64,", "none/"), camera, "missing");
    assert!(missing.stderr.contains("/buffers/0/uri"), "{}", missing.stderr);
    missing.ends_with(2);
}
