//! Scenes as `render_blender.py` reads them, and the pictures that it writes.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use glam::Vec3;
use mateval_image::{LinearRgb, Picture, Wrap};
use mateval_scene::material::{ColorInput, MaterialModel, ScalarInput};
use mateval_scene::reference::{Emission, EmissionMap, ReferenceScene};
use mateval_scene::{Camera, TriangleMesh};
use serde_json::{Value, json};

use super::python;
use super::tiles::Tiles;

/// Pixels a side of every picture: what a tile's noise needs is samples, not more tiles.
pub const SIZE: usize = 48;
/// Renders of each picture, by either renderer.
pub const SEEDS: u64 = 4;
/// Blender's "max bounces", of every kind.
pub const BOUNCES: u32 = 16;

/// A scene, where it is seen from and how many samples a pixel and seed it gets.
pub struct Shot {
    pub name: String,
    pub scene: ReferenceScene,
    pub camera: Camera,
    pub samples: u32,
}

/// Blender's renders of all shots, one after the other.
pub fn render(shots: &[Shot]) -> Vec<Tiles> {
    // Blender uses every processor: two at once would only take more memory.
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock();
    let folder = tempfile::tempdir().unwrap();
    let result = folder.path().join("result.f32");
    let picture = |(index, shot): (usize, &Shot)| {
        let folder = folder.path().join(index.to_string());
        std::fs::create_dir(&folder).unwrap();
        picture_job(shot, &folder)
    };
    let pictures: Vec<Value> = shots.iter().enumerate().map(picture).collect();
    let path = folder.path().join("job.json");
    std::fs::write(&path, json!({ "result": result, "pictures": pictures }).to_string()).unwrap();
    python::run(python::Python::Blender, "render_blender.py", &path);
    let pictures = read_pictures(&result);
    assert_eq!(pictures.len(), shots.len() * SEEDS as usize);
    pictures.chunks(SEEDS as usize).map(Tiles::of).collect()
}

fn read_pictures(path: &Path) -> Vec<Picture<LinearRgb>> {
    let bytes = std::fs::read(path).unwrap();
    let numbers: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let picture = |numbers: &[f32]| {
        Picture::from_fn(SIZE, SIZE, |x, y| {
            let start = 3 * (y * SIZE + x);
            LinearRgb(numbers[start..start + 3].try_into().unwrap())
        })
    };
    numbers.chunks_exact(3 * SIZE * SIZE).map(picture).collect()
}

/// One picture of a job; meshes go to files in `folder`. Every surface has a material of its own, with its lamp in it.
fn picture_job(shot: &Shot, folder: &Path) -> Value {
    let scene = &shot.scene;
    let surfaces = || scene.surfaces.iter().enumerate();
    let mut materials: Vec<Value> =
        surfaces().map(|(_, surface)| material_job(&scene.materials[surface.material.0].model)).collect();
    let (mut world, mut maps) = ([0.0; 3], vec![None; scene.surfaces.len()]);
    for light in &scene.lights {
        match &light.emission {
            Emission::Area { surfaces, radiance, map, two_sided } => {
                assert!(two_sided, "Blender's lamps glow on both sides");
                for surface in surfaces {
                    maps[surface.0] = *map;
                    materials[surface.0]["map"] = json!(map.map(|map| map_job(
                        scene,
                        &map,
                        radiance,
                        &folder.join(format!("{}.texels", surface.0))
                    )));
                    materials[surface.0]["radiance"] = json!(radiance);
                    materials[surface.0]["camera_visible"] = json!(light.camera_visible);
                }
            }
            Emission::Constant { radiance } => world = *radiance,
            Emission::Environment { .. } => unreachable!("no scene here has a map"),
        }
    }
    json!({
        "materials": materials,
        "surfaces": surfaces().map(|(k, surface)| surface_job(&surface.mesh, k, maps[k], folder)).collect::<Vec<_>>(),
        "world": world,
        "camera": {
            "world_from_camera": shot.camera.world_from_camera,
            "fov_x": 2.0 * libm::atan(0.5 * SIZE as f64 / shot.camera.intrinsics.fx),
            "size": SIZE,
        },
        "samples": shot.samples,
        "seeds": (1..=SEEDS).collect::<Vec<_>>(),
        "bounces": BOUNCES,
    })
}

fn material_job(model: &MaterialModel) -> Value {
    match model {
        MaterialModel::Diffuse { reflectance: ColorInput::Constant(color), alpha: None } => {
            json!({ "base_color": color, "roughness": null, "radiance": null })
        }
        MaterialModel::Principled {
            base_color: ColorInput::Constant(color),
            roughness: ScalarInput::Constant(roughness),
            metallic: ScalarInput::Constant(metallic),
            specular,
            flavour: _,
        } => json!({
            "base_color": color,
            "roughness": roughness,
            "metallic": metallic,
            "specular": specular,
            "radiance": null,
        }),
        other => unreachable!("no scene here is made of {other:?}"),
    }
}

/// The radiance that a map gives, as a picture whose rows run from the bottom, in `path`.
fn map_job(scene: &ReferenceScene, map: &EmissionMap, radiance: &[f32; 3], path: &Path) -> Value {
    let texture = &scene.textures[map.texture.0].texture;
    let (width, height) = (texture.width(), texture.height());
    let texels = (0..width * height).flat_map(|k| {
        let [r, g, b] = texture.texel(k % width, height - 1 - k / width);
        [r * radiance[0], g * radiance[1], b * radiance[2], 1.0]
    });
    std::fs::write(path, texels.flat_map(f32::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    let extension = match texture.wrap() {
        Wrap::Repeat => "REPEAT",
        Wrap::Clamp => "EXTEND",
        Wrap::Mirror => "MIRROR",
    };
    json!({ "texels": path, "width": width, "height": height, "extension": extension })
}

/// uv are those of the map, if there is one: nothing else is looked up.
fn surface_job(mesh: &TriangleMesh, index: usize, map: Option<EmissionMap>, folder: &Path) -> Value {
    let write = |name: &str, bytes: Vec<u8>| -> PathBuf {
        let path = folder.join(format!("{index}.{name}"));
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let floats = |vectors: &[Vec3]| vectors.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes).collect();
    let uvs = |map: EmissionMap| {
        let uvs = mesh.uvs.as_ref().expect("a lamp with a map has uv");
        write("uvs", uvs.iter().flat_map(|uv| map.uv.apply(*uv).to_array()).flat_map(f32::to_le_bytes).collect())
    };
    let triangles = mesh.triangles.iter().flatten().flat_map(|corner| corner.to_le_bytes()).collect();
    json!({
        "material": index,
        "positions": write("positions", floats(&mesh.positions)),
        "normals": mesh.normals.as_ref().map(|normals| write("normals", floats(normals))),
        "uvs": map.map(uvs),
        "triangles": write("triangles", triangles),
    })
}
