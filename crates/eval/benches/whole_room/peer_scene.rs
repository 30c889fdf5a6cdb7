//! The submission as a scene that Mitsuba can represent: its maps on the surfaces, under the lights of either track.

use std::collections::BTreeMap;

use glam::Vec2;
use mateval_image::Texture;
use mateval_light::light_stage::NamedLight;
use mateval_scene::TriangleMesh;
use mateval_scene::material::{
    ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput, TextureIndex, UvTransform,
};
use mateval_scene::reference::{
    Emission, EmissionMap, LightGroup, MaterialIndex, ReferenceScene, SourceTexture, Surface, SurfaceIndex,
};
use mateval_submission::prediction::PredictedMaterial;

use crate::room::Room;

/// The scene under the reference's own emitters, with each group's radiance multiplied by its `weights`. Lamps that are
/// hidden from the camera reflect nothing: in our tracer all other rays see them like this, and Mitsuba cannot treat
/// camera rays differently.
pub fn under_own_lights(room: &Room, weights: Option<&[[f64; 3]]>) -> ReferenceScene {
    let mut scene = painted(room);
    for surface in room.hidden_lights() {
        scene.surfaces[surface] =
            Surface { material: black(&mut scene.materials), ..room.world.scene().surfaces[surface].clone() };
    }
    for (group, weights) in scene.lights.iter_mut().zip(weights.unwrap_or_default()) {
        let (Emission::Area { radiance, .. } | Emission::Constant { radiance }) = &mut group.emission else {
            panic!("'{}': a map of light has one weight for all channels in Mitsuba", group.name);
        };
        *radiance = std::array::from_fn(|c| radiance[c] * weights[c] as f32);
    }
    scene
}

/// The scene under a light stage: its quads are black surfaces that emit; the room's own lights do not emit.
pub fn on_stage(room: &Room, stage: &[NamedLight], radiances: &[[f64; 3]]) -> ReferenceScene {
    let mut scene = painted(room);
    scene.lights.clear();
    let material = black(&mut scene.materials);
    for (NamedLight { name, light }, radiance) in stage.iter().zip(radiances) {
        let surfaces = vec![SurfaceIndex(scene.surfaces.len())];
        scene.surfaces.push(Surface { name: name.clone(), mesh: light.mesh.clone(), material });
        let radiance = radiance.map(|v| v as f32);
        let emission = Emission::Area { surfaces, radiance, map: None, two_sided: false };
        scene.lights.push(LightGroup { name: name.clone(), emission, camera_visible: true });
    }
    scene
}

/// The room with the submission's materials, of Mitsuba's flavour. Surfaces without an atlas are unchanged, and so are
/// surfaces with opacities, which are looked up by their own uv.
fn painted(room: &Room) -> ReferenceScene {
    let mut scene = room.world.scene().clone();
    scene.lights = without_maps(&scene);
    for (index, predicted) in room.predicted.materials.iter().enumerate() {
        let own = &scene.materials[scene.surfaces[index].material.0];
        let Some(predicted) = predicted.as_ref().filter(|_| own.opacity.is_none()) else { continue };
        let material = Material {
            name: scene.surfaces[index].name.clone(),
            model: model(&mut scene.textures, predicted),
            two_sided: true,
            opacity: None,
            bump: None,
        };
        scene.surfaces[index].mesh = unwrapped(&scene.surfaces[index].mesh, &room.atlases[index]);
        scene.surfaces[index].material = MaterialIndex(scene.materials.len());
        scene.materials.push(material);
    }
    scene
}

/// The lights with the mean of their maps in place of the maps: Mitsuba samples points on a mapped light by uv, for
/// which the uv of lamps are not suitable.
pub fn without_maps(scene: &ReferenceScene) -> Vec<LightGroup> {
    let textures = scene.texture_list();
    let mut lights = scene.lights.clone();
    for group in &mut lights {
        if let Emission::Area { surfaces, radiance, map, .. } = &mut group.emission {
            let Some(map) = map.take() else { continue };
            let meshes = surfaces.iter().map(|surface| &scene.surfaces[surface.0].mesh);
            let mean = mean_of_map(&map, &textures, meshes);
            *radiance = std::array::from_fn(|c| radiance[c] * mean[c] as f32);
        }
    }
    lights
}

/// A mean over the meshes' area, looked up at the middle of each triangle.
fn mean_of_map<'a>(
    map: &EmissionMap,
    textures: &[Texture],
    meshes: impl Iterator<Item = &'a TriangleMesh>,
) -> [f64; 3] {
    let (mut sum, mut whole) = ([0.0; 3], 0.0);
    for mesh in meshes {
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(index).map(|corner| corner.as_dvec3());
            let area = (b - a).cross(c - a).length();
            let uvs = mesh.uvs.as_ref();
            let uv = uvs.map_or(Vec2::ZERO, |uvs| triangle.iter().map(|v| uvs[*v as usize]).sum::<Vec2>() / 3.0);
            let value = map.at(textures, uv);
            (0..3).for_each(|channel| sum[channel] += area * f64::from(value[channel]));
            whole += area;
        }
    }
    sum.map(|v| v / whole)
}

/// The surface's own vertices with the atlas's uv, without vertices shared between corners.
fn unwrapped(own: &TriangleMesh, atlas: &TriangleMesh) -> TriangleMesh {
    let corners = || own.triangles.iter().flatten().map(|vertex| *vertex as usize);
    let uvs = atlas.uvs.as_ref().unwrap();
    TriangleMesh {
        positions: corners().map(|vertex| own.positions[vertex]).collect(),
        normals: own.normals.as_ref().map(|normals| corners().map(|vertex| normals[vertex]).collect()),
        uvs: Some(atlas.triangles.iter().flatten().map(|vertex| uvs[*vertex as usize]).collect()),
        triangles: (0..own.triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
    }
}

fn model(textures: &mut Vec<SourceTexture>, predicted: &PredictedMaterial) -> MaterialModel {
    // Equal texels would otherwise be written to two files.
    let mut places = BTreeMap::new();
    let mut place = |texture: &Texture| {
        *places.entry(texture.bytes().as_ptr()).or_insert_with(|| {
            let name = format!("predicted_{}", textures.len());
            textures.push(SourceTexture { name, sha256: None, texture: texture.clone() });
            TextureIndex(textures.len() - 1)
        })
    };
    let uv = UvTransform::default();
    let mut scalar = |texture: &Texture| match flat(texture) {
        Some([value, ..]) => ScalarInput::Constant(value),
        None => ScalarInput::Texture { texture: place(texture), channel: 0, uv },
    };
    let (roughness, metallic) = (scalar(&predicted.roughness), scalar(&predicted.metallic));
    let base_color = match flat(&predicted.base_color) {
        Some(rgb) => ColorInput::Constant(rgb),
        None => ColorInput::Texture { texture: place(&predicted.base_color), uv },
    };
    MaterialModel::Principled { base_color, roughness, metallic, specular: 0.5, flavour: PrincipledFlavour::Mitsuba }
}

/// The texture's value if it is constant.
fn flat(texture: &Texture) -> Option<[f32; 3]> {
    (texture.width() * texture.height() == 1).then(|| texture.texel(0, 0))
}

fn black(materials: &mut Vec<Material>) -> MaterialIndex {
    let model = MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.0; 3]), alpha: None };
    materials.push(Material { name: "black".to_owned(), model, two_sided: true, opacity: None, bump: None });
    MaterialIndex(materials.len() - 1)
}
