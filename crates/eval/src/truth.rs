//! The ground truth of a scene: its maps, read as a prediction's would be, and the pictures and masks of its views.

use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Mask, Normal, Picture, Texture, Wrap, exr_io, png_io};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::submission::Map;
use mateval_scene::{InstanceId, RendererId};
use mateval_submission::prediction::{PredictedMaterial, PredictedScene, one_texel, scattering_key};

use crate::error::EvalError;

/// A view's true maps and its masks.
pub struct ViewTruth {
    /// base_color, linear.
    pub albedo: Picture<LinearRgb>,
    /// Perceptual, 0 to 1.
    pub roughness: Picture<f32>,
    /// 0 to 1.
    pub metallic: Picture<f32>,
    /// The pixels that are scored.
    pub valid: Mask,
    /// Valid pixels that the input view does not see; none for the input view.
    pub unobserved: Option<Mask>,
    /// Valid pixels that are metal or smooth in truth; none if there are no such pixels.
    pub specular: Option<Mask>,
    /// Instance index of each pixel's centre, 0 for nothing.
    pub instances: Picture<u16>,
    /// Normal at each pixel's centre, in world space.
    pub normals: Picture<Normal>,
}

impl ViewTruth {
    /// Reads a view's maps and masks. Fails where one is missing, unreadable or not of the camera's size.
    pub fn read(folder: &SceneFolder, view: &View) -> Result<Self, EvalError> {
        let (shown, hidden) = (folder.view(&view.id), folder.truth_view(&view.id));
        let valid = png_io::read_mask(&shown.join("valid.png"))?;
        let is_input = view.id.as_str() == INPUT;
        let unobserved = (!is_input).then(|| png_io::read_mask(&shown.join("unobserved.png"))).transpose()?;
        let truth = Self {
            albedo: exr_io::read_linear(&hidden.join("albedo.exr"))?,
            roughness: exr_io::read_scalar(&hidden.join("roughness.exr"))?,
            metallic: exr_io::read_scalar(&hidden.join("metallic.exr"))?,
            specular: None,
            instances: png_io::read_ids(&shown.join("instance.png"))?,
            normals: exr_io::read_normal(&shown.join("normal.exr"))?,
            unobserved,
            valid,
        };
        let specular = png_io::read_mask(&hidden.join("specular_region.png"))?;
        let sizes = [
            size(&truth.albedo),
            size(&truth.roughness),
            size(&truth.metallic),
            size(&truth.valid),
            truth.unobserved.as_ref().map_or(size(&truth.valid), size),
            size(&truth.instances),
            size(&truth.normals),
            size(&specular),
        ];
        check_sizes(view, &sizes)?;
        let both = intersection(&specular, &truth.valid);
        Ok(Self { specular: both.pixels().contains(&true).then_some(both), ..truth })
    }
}

/// The picture of a view that the photo's renderer made, linear, before exposure.
pub fn photo_of_renderer(
    folder: &SceneFolder,
    renderer: &RendererId,
    view: &View,
) -> Result<Picture<LinearRgb>, EvalError> {
    let picture = exr_io::read_linear(&folder.render(renderer, &view.id).join("rgb.exr"))?;
    check_sizes(view, &[size(&picture)])?;
    Ok(picture)
}

/// The pixels where both masks are set. The masks have the same size.
fn intersection(a: &Mask, b: &Mask) -> Mask {
    Mask::from_fn(a.width(), a.height(), |x, y| a.get(x, y) && b.get(x, y))
}

fn size<T: Copy>(picture: &Picture<T>) -> (usize, usize) {
    (picture.width(), picture.height())
}

/// Fails where a picture is not of the camera's size.
pub(crate) fn check_sizes(view: &View, sizes: &[(usize, usize)]) -> Result<(), EvalError> {
    let expected = (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize);
    match sizes.iter().find(|found| **found != expected) {
        None => Ok(()),
        Some(found) => Err(EvalError::TruthPictureSize {
            view: view.id.clone(),
            expected: expected.into(),
            found: (*found).into(),
        }),
    }
}

/// A material's three maps as the dataset holds them: its source baked to the instance's atlas.
#[derive(Clone, Debug)]
pub struct TruthMaterial {
    /// Linear at lookup.
    pub base_color: Texture,
    /// Perceptual, 0 to 1.
    pub roughness: Texture,
    /// 0 to 1.
    pub metallic: Texture,
}

impl TruthMaterial {
    /// Reads `ground_truth/materials/<instance>/`, each map a PNG of `size` times `size` texels.
    ///
    /// Fails where a file is missing, unsound or of another size.
    pub fn read(folder: &SceneFolder, instance: &InstanceId, size: usize) -> Result<Self, EvalError> {
        let read = |map: Map| read_truth(folder, instance, map, size);
        let ((base_color, roughness), metallic) =
            rayon::join(|| rayon::join(|| read(Map::BaseColor), || read(Map::Roughness)), || read(Map::Metallic));
        Ok(Self { base_color: base_color?, roughness: roughness?, metallic: metallic? })
    }
}

fn read_truth(folder: &SceneFolder, instance: &InstanceId, map: Map, size: usize) -> Result<Texture, EvalError> {
    let encoding = if map == Map::BaseColor { Encoding::Srgb } else { Encoding::Linear };
    let png = folder.truth_material(instance).join(map.stem()).with_extension("png");
    let texture = read_texture(&png, encoding, Wrap::Clamp)?;
    if (texture.width(), texture.height()) == (size, size) {
        return Ok(texture.collapsed());
    }
    Err(EvalError::TruthMapSize { path: png, expected: size, found: [texture.width(), texture.height()] })
}

/// All true maps of a scene, with the texels that a submission of the same files would have.
pub(crate) fn true_maps(folder: &SceneFolder, scene: &SceneFile) -> Result<PredictedScene, EvalError> {
    // A submission's constant scalar is one float.
    let compact = |map: Texture| if map.width() == 1 { one_texel(map.texel(0, 0)[0]) } else { map };
    let mut materials = Vec::new();
    for instance in &scene.instances {
        materials.push(match &instance.atlas {
            None => None,
            Some(atlas) => {
                let TruthMaterial { base_color, roughness, metallic } =
                    TruthMaterial::read(folder, &instance.id, atlas.size as usize)?;
                Some(PredictedMaterial { base_color, roughness: compact(roughness), metallic: compact(metallic) })
            }
        });
    }
    let scattering_key = scattering_key(&materials);
    Ok(PredictedScene { materials, scattering_key, findings: Vec::new(), files: Vec::new() })
}
