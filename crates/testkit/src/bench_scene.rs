//! Reads the shared scenes `bench/room` (17,562 triangles) and `bench/dense` (864,036 triangles), made for this
//! project.

use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};
use mateval_dataset::material::{
    ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput, TextureIndex, UvTransform,
};
use mateval_dataset::reference::{
    Emission, LightGroup, MaterialIndex, ReferenceScene, SourceTexture, Surface, SurfaceIndex,
};
use mateval_dataset::{Camera, Intrinsics, TriangleMesh};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Picture, Wrap};
use serde_json::Value;

use crate::shared_data;

/// The folder of `bench/<name>`; absent if the shared data are missing.
pub fn folder(name: &str) -> Option<PathBuf> {
    let scene = shared_data(&format!("bench/{name}/scene.json"))?;
    scene.parent().map(Path::to_owned)
}

/// Mitsuba's picture of a scene with 512 x 512 pixels (NumPy's format, version 1, little-endian floats): `path`,
/// max_depth 8, 64 samples.
pub fn reference(folder: &Path) -> Picture<LinearRgb> {
    const SIZE: usize = 512;
    let bytes = std::fs::read(folder.join("mi_principled_d8_64spp.npy")).unwrap();
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let floats: Vec<f32> = bytes[start..].as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    let pixels = floats.as_chunks::<3>().0.iter().map(|rgb| LinearRgb(*rgb)).collect();
    Picture::new(SIZE, SIZE, pixels).unwrap()
}

/// The scene, with Mitsuba's flavour of `principled`, two-sided surfaces and one-sided lamps, as its references were
/// made; and its camera with `size` x `size` pixels.
pub fn read(folder: &Path, size: u32) -> (ReferenceScene, Camera) {
    let json: Value = serde_json::from_slice(&std::fs::read(folder.join("scene.json")).unwrap()).unwrap();
    let mut scene = ReferenceScene::default();
    let all_in_one = folder.join("dense.ply");
    let mut rest = all_in_one.is_file().then(|| read_ply(&all_in_one));
    for part in json["parts"].as_array().unwrap() {
        let mesh = match &mut rest {
            Some(mesh) => split_off(mesh, part["triangles"].as_u64().unwrap() as usize),
            None => read_ply(&folder.join(part["ply"].as_str().unwrap())),
        };
        add_part(&mut scene, folder, part, mesh);
    }
    let triangles = scene.surfaces.iter().map(|s| s.mesh.triangles.len()).sum::<usize>();
    assert_eq!(triangles as u64, json["triangles"].as_u64().unwrap());
    let rows: [[f64; 4]; 4] = serde_json::from_value(json["camera"]["camera_to_world"].clone()).unwrap();
    let fov = json["camera"]["fov_x_deg"].as_f64().unwrap().to_radians();
    (scene, Camera { world_from_camera: rows, intrinsics: Intrinsics::from_fov_x(size, size, fov) })
}

fn add_part(scene: &mut ReferenceScene, folder: &Path, part: &Value, mesh: TriangleMesh) {
    let name = part["name"].as_str().unwrap().to_owned();
    let material = MaterialIndex(scene.materials.len());
    let base_color = base_color(scene, folder, part);
    scene.materials.push(Material {
        name: name.clone(),
        model: MaterialModel::Principled {
            base_color,
            roughness: ScalarInput::Constant(part["roughness"].as_f64().unwrap() as f32),
            metallic: ScalarInput::Constant(part["metallic"].as_f64().unwrap() as f32),
            specular: 0.5,
            flavour: PrincipledFlavour::Mitsuba,
        },
        two_sided: true,
        opacity: None,
        bump: None,
    });
    let radiance = rgb(&part["emission"]);
    if radiance.iter().any(|&v| v > 0.0) {
        let surfaces = vec![SurfaceIndex(scene.surfaces.len())];
        let emission = Emission::Area { surfaces, radiance, map: None, two_sided: false };
        scene.lights.push(LightGroup { name: name.clone(), emission, camera_visible: true });
    }
    scene.surfaces.push(Surface { name, mesh, material });
}

fn base_color(scene: &mut ReferenceScene, folder: &Path, part: &Value) -> ColorInput {
    let Some(file) = part["texture"].as_str() else { return ColorInput::Constant(rgb(&part["base_color"])) };
    let known = scene.textures.iter().position(|texture| texture.name == file);
    let index = known.unwrap_or_else(|| {
        let texture = read_texture(&folder.join(file), Encoding::Srgb, Wrap::Repeat).unwrap();
        scene.textures.push(SourceTexture { name: file.to_owned(), sha256: None, texture });
        scene.textures.len() - 1
    });
    ColorInput::Texture { texture: TextureIndex(index), uv: UvTransform::default() }
}

fn rgb(value: &Value) -> [f32; 3] {
    serde_json::from_value(value.clone()).unwrap()
}

/// Removes the first `count` triangles from `mesh` and returns them with the vertices that only they use.
fn split_off(mesh: &mut TriangleMesh, count: usize) -> TriangleMesh {
    let triangles: Vec<[u32; 3]> = mesh.triangles.drain(..count).collect();
    let used = || triangles.iter().flatten().copied();
    let (first, last) = (used().min().unwrap(), used().max().unwrap());
    let range = first as usize..last as usize + 1;
    TriangleMesh {
        positions: mesh.positions[range.clone()].to_vec(),
        normals: mesh.normals.as_ref().map(|all| all[range.clone()].to_vec()),
        uvs: mesh.uvs.as_ref().map(|all| all[range].to_vec()),
        triangles: triangles.iter().map(|t| t.map(|vertex| vertex - first)).collect(),
    }
}

/// Reads a binary PLY file with floats x y z nx ny nz u v and triangles, as in these scenes.
fn read_ply(path: &Path) -> TriangleMesh {
    let bytes = std::fs::read(path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let count = |word: &str| -> usize {
        header.lines().find_map(|line| line.strip_prefix(word)).unwrap().trim().parse().unwrap()
    };
    let (vertices, faces) = (count("element vertex"), count("element face"));
    let properties = header.lines().filter(|line| line.starts_with("property float")).count();
    assert!([6, 8, 5].contains(&properties), "{header}");
    let has_normals = header.contains("property float nx");
    let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let mut mesh = TriangleMesh::default();
    let (mut normals, mut uvs) = (Vec::new(), Vec::new());
    for vertex in 0..vertices {
        let values: Vec<f32> = (0..properties).map(|k| float(end + 4 * (vertex * properties + k))).collect();
        mesh.positions.push(Vec3::from_slice(&values));
        if has_normals {
            normals.push(Vec3::from_slice(&values[3..]));
        }
        uvs.push(Vec2::from_slice(&values[properties - 2..]));
    }
    let faces_start = end + 4 * vertices * properties;
    for face in 0..faces {
        let at = faces_start + 13 * face;
        assert_eq!(bytes[at], 3);
        let index = |k: usize| u32::from_le_bytes(bytes[at + 1 + 4 * k..at + 5 + 4 * k].try_into().unwrap());
        mesh.triangles.push([index(0), index(1), index(2)]);
    }
    mesh.normals = has_normals.then_some(normals);
    mesh.uvs = Some(uvs);
    mesh
}
