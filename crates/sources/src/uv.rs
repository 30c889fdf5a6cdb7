//! Texture coordinates that are absent, NaN at a corner of a face, or too large for 32 bits.
//!
//! A texture has no place for a face without them. Mitsuba uses barycentric coordinates ([`barycentric`]); for all other
//! sources the mean of the texture stands for it ([`resolve`]), so that no face takes the colour of an arbitrary texel.

use std::collections::BTreeMap;

use glam::{DVec2, Vec2};
use mateval_dataset::TriangleMesh;
use mateval_dataset::material::TextureIndex;
use mateval_dataset::reference::{
    Emission, LightGroup, MaterialIndex, ReferenceScene, SourceTexture, Surface, SurfaceIndex,
};
use mateval_files::untrusted::shortened;
use mateval_image::{Texels, Texture};

use crate::log::Log;
use crate::source_scene::InstanceOrigin;

/// The triangles that have no texture coordinates.
fn triangles_without(mesh: &TriangleMesh) -> Vec<bool> {
    let Some(uvs) = &mesh.uvs else { return vec![true; mesh.triangles.len()] };
    mesh.triangles.iter().map(|triangle| triangle.iter().any(|vertex| !uvs[*vertex as usize].is_finite())).collect()
}

/// The mesh with barycentric texture coordinates on faces without any, as Mitsuba 3.9.1 looks them up: (0, 0), (1, 0)
/// and (0, 1) at the corners, with v downwards. Returns the number of those faces.
pub(crate) fn barycentric(mesh: &mut TriangleMesh) -> usize {
    let without = triangles_without(mesh);
    let count = without.iter().filter(|is_without| **is_without).count();
    if count == 0 {
        return 0;
    }
    let mut uvs = mesh.uvs.take().unwrap_or_else(|| vec![Vec2::NAN; mesh.positions.len()]);
    for triangle in (0..without.len()).filter(|triangle| without[*triangle]) {
        // Each face needs corners of its own.
        mesh.triangles[triangle] = mesh.triangles[triangle].map(|vertex| mesh.copy_vertex(vertex));
        uvs.extend([Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::ZERO]);
    }
    mesh.uvs = Some(uvs);
    // The old corners of these faces may be used no more.
    *mesh = mesh.picked(|_| true);
    count
}

/// Gives the mean of its textures to every face that has textures and no texture coordinates. Where only some faces of
/// a surface have none, they become a surface of their own at the end of the list; the indices of the surfaces that
/// were split are returned in their order. Afterwards all texture coordinates are finite.
pub(crate) fn resolve(scene: &mut ReferenceScene, origins: &mut Vec<InstanceOrigin>, log: &mut Log) -> Vec<usize> {
    let (mut means, mut split) = (Means::default(), Vec::new());
    for at in 0..scene.surfaces.len() {
        let surface = &scene.surfaces[at];
        let is_textured = !scene.materials[surface.material.0].lookups().is_empty() || emission_of(scene, at).is_some();
        let without = if is_textured { triangles_without(&surface.mesh) } else { Vec::new() };
        let count = without.iter().filter(|is_without| **is_without).count();
        if count > 0 {
            let name = shortened(&surface.name);
            let message = format!("{count} of {} faces of '{name}' have no texture coordinates", without.len());
            log.warn("no_uv", "", message, "used the mean of the texture for them");
            if count == without.len() {
                means.flatten(scene, at);
            } else {
                means.split(scene, origins, at, &without);
                split.push(at);
            }
        }
        for uv in scene.surfaces[at].mesh.uvs.iter_mut().flatten().filter(|uv| !uv.is_finite()) {
            *uv = Vec2::ZERO;
        }
    }
    split
}

/// Beyond this many texels, neighbouring 32-bit numbers show a texture as blocks.
const MOST_STEP_TEXELS: f64 = 0.5;

/// Reports surfaces whose texture coordinates are so large that neighbouring numbers of 32 bits are texels apart.
pub(crate) fn report_coarse(scene: &ReferenceScene, log: &mut Log) {
    for surface in &scene.surfaces {
        let uvs = surface.mesh.uvs.as_deref().unwrap_or_default();
        let steps = scene.materials[surface.material.0].lookups().into_iter().map(|lookup| {
            let texture = &scene.textures[lookup.texture.0].texture;
            let moved = |uv: &Vec2| uv.abs().max(lookup.uv.apply(*uv).abs()).as_dvec2();
            let largest = uvs.iter().map(moved).fold(DVec2::ZERO, DVec2::max);
            let texels = largest * DVec2::new(texture.width() as f64, texture.height() as f64);
            (largest.max_element(), texels.max_element() * f64::from(f32::EPSILON))
        });
        let worst = steps.max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((largest, step)) = worst.filter(|(_, step)| *step > MOST_STEP_TEXELS) {
            let name = shortened(&surface.name);
            let message = format!(
                "texture coordinates of '{name}' reach {largest:.0}, where 32-bit numbers are up to {step:.1} texels apart"
            );
            log.warn("coarse_uv", "", message, "used them as they are; move them by whole tiles");
        }
    }
}

/// The light group of a surface that emits by a texture.
fn emission_of(scene: &ReferenceScene, at: usize) -> Option<usize> {
    scene.lights.iter().position(|light| match &light.emission {
        Emission::Area { surfaces, map: Some(_), .. } => surfaces.contains(&SurfaceIndex(at)),
        _ => false,
    })
}

/// Materials and textures whose texels were replaced by their mean, by the originals.
#[derive(Default)]
struct Means {
    materials: BTreeMap<MaterialIndex, MaterialIndex>,
    textures: BTreeMap<TextureIndex, TextureIndex>,
}

impl Means {
    fn texture(&mut self, scene: &mut ReferenceScene, index: TextureIndex) -> TextureIndex {
        *self.textures.entry(index).or_insert_with(|| {
            let SourceTexture { name, texture, .. } = &scene.textures[index.0];
            let mean = texture.mean().map(|value| value as f32);
            let texels = match texture.texels() {
                Texels::Grey(_) => Texels::Grey(vec![mean[0]]),
                _ => Texels::Linear(vec![mean]),
            };
            // One texel of a sound texture is sound.
            let texture = Texture::new(1, 1, texels, texture.wrap()).unwrap_or_else(|_| texture.clone());
            scene.add_texture(SourceTexture::computed(format!("{name} (mean)"), texture))
        })
    }

    fn material(&mut self, scene: &mut ReferenceScene, index: MaterialIndex) -> MaterialIndex {
        if let Some(known) = self.materials.get(&index) {
            return *known;
        }
        let mut material = scene.materials[index.0].clone();
        // A plain height has no bumps.
        material.bump = None;
        for texture in material.texture_indices_mut() {
            *texture = self.texture(scene, *texture);
        }
        let flat = scene.add_material(material);
        self.materials.insert(index, flat);
        flat
    }

    fn flatten(&mut self, scene: &mut ReferenceScene, at: usize) {
        scene.surfaces[at].material = self.material(scene, scene.surfaces[at].material);
        scene.surfaces[at].mesh.uvs = None;
        if let Some(light) = emission_of(scene, at)
            && let Emission::Area { radiance, map, .. } = &mut scene.lights[light].emission
            && let Some(lost) = map.take()
        {
            let mean = scene.textures[lost.texture.0].texture.mean();
            *radiance = std::array::from_fn(|channel| radiance[channel] * mean[channel] as f32);
        }
    }

    /// Splits the faces `without` texture coordinates off as a plain surface.
    fn split(&mut self, scene: &mut ReferenceScene, origins: &mut Vec<InstanceOrigin>, at: usize, without: &[bool]) {
        let Surface { name, mesh, material } = scene.surfaces[at].clone();
        let new = SurfaceIndex(scene.surfaces.len());
        let name = format!("{name} without uv");
        scene.surfaces.push(Surface { name: name.clone(), mesh: mesh.picked(|triangle| without[triangle]), material });
        scene.surfaces[at].mesh = mesh.picked(|triangle| !without[triangle]);
        // Their parts. A copy of a model is no longer a copy.
        let picked = |parts: &Option<Vec<usize>>, wanted: bool| {
            let parts = parts.as_ref()?;
            Some(parts.iter().zip(without).filter(|(_, is)| **is == wanted).map(|(part, _)| *part).collect())
        };
        let old = origins[at].clone();
        let origin = |wanted| InstanceOrigin {
            part_of_triangle: picked(&old.part_of_triangle, wanted),
            shape: None,
            ..old.clone()
        };
        origins[at] = origin(false);
        origins.push(origin(true));
        // Its light.
        if let Some(light) = emission_of(scene, at) {
            let LightGroup { emission, camera_visible, .. } = scene.lights[light].clone();
            if let Emission::Area { radiance, map, two_sided, .. } = emission {
                let emission = Emission::Area { surfaces: vec![new], radiance, map, two_sided };
                scene.lights.push(LightGroup { name, emission, camera_visible });
            }
        }
        self.flatten(scene, new.0);
    }
}

#[cfg(test)]
mod tests {
    use mateval_dataset::material::{ColorInput, Material, MaterialModel, UvTransform};
    use mateval_image::Wrap;

    use super::*;
    use crate::primitives::rectangle;

    /// A square of two triangles under a texture of two texels, 0 and 1.
    fn scene(uvs: Option<Vec<Vec2>>) -> (ReferenceScene, Vec<InstanceOrigin>) {
        let texture = Texture::new(2, 1, Texels::Linear(vec![[0.0; 3], [1.0; 3]]), Wrap::Repeat).unwrap();
        let reflectance = ColorInput::Texture { texture: TextureIndex(0), uv: UvTransform::default() };
        let material = Material::new("m", MaterialModel::Diffuse { reflectance, alpha: None });
        let scene = ReferenceScene {
            surfaces: vec![Surface {
                name: "square".to_owned(),
                mesh: TriangleMesh { uvs, ..rectangle() },
                material: MaterialIndex(0),
            }],
            materials: vec![material],
            textures: vec![SourceTexture::computed("t", texture)],
            ..ReferenceScene::default()
        };
        (scene, vec![InstanceOrigin::default()])
    }

    fn resolved(uvs: Option<Vec<Vec2>>) -> (ReferenceScene, usize) {
        let (mut scene, mut origins) = scene(uvs);
        let mut log = Log::new("a".to_owned(), 10);
        let split = resolve(&mut scene, &mut origins, &mut log);
        assert_eq!(split.len() + 1, scene.surfaces.len());
        assert_eq!(origins.len(), scene.surfaces.len());
        assert!(scene.surfaces.iter().flat_map(|s| s.mesh.uvs.iter().flatten()).all(|uv| uv.is_finite()));
        (scene, log.into_findings().len())
    }

    fn color(scene: &ReferenceScene, surface: usize) -> [f32; 3] {
        let material = &scene.materials[scene.surfaces[surface].material.0];
        material.appearance(&scene.texture_list(), Vec2::new(0.75, 0.5)).unwrap().base_color
    }

    #[test]
    fn the_mean_stands_for_what_has_no_place() {
        let (whole, findings) = resolved(None);
        assert_eq!((whole.surfaces.len(), color(&whole, 0), findings), (1, [0.5; 3], 1));
        let mut uvs = rectangle().uvs.unwrap();
        // A corner of the second triangle alone.
        let only_second = rectangle().triangles[1].iter().copied().find(|v| !rectangle().triangles[0].contains(v));
        uvs[only_second.unwrap() as usize] = Vec2::NAN;
        let (split, findings) = resolved(Some(uvs));
        assert_eq!((split.surfaces.len(), findings), (2, 1));
        assert_eq!((color(&split, 0), color(&split, 1)), ([1.0; 3], [0.5; 3]));
        assert_eq!(split.surfaces.iter().map(|s| s.mesh.triangles.len()).collect::<Vec<_>>(), [1, 1]);
        // Twin.
        let (sound, findings) = resolved(rectangle().uvs);
        assert_eq!((sound.surfaces.len(), color(&sound, 0), findings), (1, [1.0; 3], 0));
    }

    #[test]
    fn coordinates_that_are_texels_apart_are_found() {
        let found = |scale: f32| {
            let uvs = rectangle().uvs.unwrap().into_iter().map(|uv| uv * scale).collect();
            let mut log = Log::new("a".to_owned(), 10);
            report_coarse(&scene(Some(uvs)).0, &mut log);
            log.into_findings()
        };
        // Numbers of 1e8 are 8 apart, tiles of 2 texels.
        let far = found(1e8);
        assert!(far[0].code == "coarse_uv" && far[0].message.contains("reach 100000000"), "{far:?}");
        // Twin.
        assert!(found(1e5).is_empty());
    }

    /// Mitsuba 3.9.1 on an OBJ of one triangle without vt.
    #[test]
    fn barycentric_coordinates_as_mitsuba() {
        let mut mesh = TriangleMesh { uvs: None, ..rectangle() };
        assert_eq!(barycentric(&mut mesh), 2);
        assert_eq!((mesh.positions.len(), mesh.uvs.as_ref().map(Vec::len)), (6, Some(6)));
        let [a, b, c] = mesh.triangles[1].map(|vertex| mesh.uvs.as_ref().unwrap()[vertex as usize]);
        assert_eq!([a, b, c], [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::ZERO]);
        let mut sound = rectangle();
        assert_eq!((barycentric(&mut sound), sound), (0, rectangle()));
    }
}
