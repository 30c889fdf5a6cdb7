//! The true maps of a scene, read from the dataset as a prediction would be.

use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Texture, Wrap};
use mateval_scene::InstanceId;
use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::SceneFolder;
use mateval_scene::submission::Map;
use mateval_submission::prediction::{PredictedMaterial, PredictedScene, one_texel, scattering_key};

use crate::error::EvalError;

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
