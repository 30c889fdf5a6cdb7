//! Companions: materials near the truth's that travel along the paths of every prediction.
//!
//! Their converged pictures are known (`companion_pictures`), so what the paths of one render miss or exaggerate in a
//! companion's light is known too, and can be taken off the prediction's light (`control_variate`).

use std::collections::BTreeSet;

use mateval_image::{Picture, Texture};
use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::SceneFolder;
use mateval_scene::material::{MaterialModel, ScalarInput};
use mateval_scene::submission::GREY;
use mateval_submission::prediction::{PredictedMaterial, PredictedScene, one_texel, scattering_key};
use mateval_tracer::World;

use crate::error::EvalError;
use crate::truth_material::TruthMaterial;

/// The number of companions.
pub(crate) const COMPANIONS: usize = 3;

/// The letters of the companions: the truth's atlases, the same at half the base colour, and the truth's atlases where the
/// input view sees the instance with a flat grey elsewhere.
pub(crate) const COMPANION_LETTERS: [&str; COMPANIONS] = ["T", "S", "U"];

/// The factor of each companion's base colours.
pub(crate) const COMPANION_SCALES: [f32; COMPANIONS] = [1.0, 0.5, 1.0];

/// The companions of a scene. They share the truth's roughness and metallic.
pub(crate) struct Companions {
    /// The truth's atlases as a prediction.
    pub(crate) truth: PredictedScene,
    /// The base colours of each instance with an atlas, by companion.
    base_colors: Vec<Option<[Texture; COMPANIONS]>>,
}

impl Companions {
    /// Reads the truth's atlases. `seen` holds the instance of each pixel of the input view. Roughness and metallic that are
    /// constant in the source keep their exact value, which a byte could not hold.
    pub(crate) fn read(
        folder: &SceneFolder,
        scene: &SceneFile,
        world: &World,
        seen: &Picture<u16>,
    ) -> Result<Self, EvalError> {
        let seen: BTreeSet<u16> = seen.pixels().iter().copied().collect();
        let mut materials = Vec::new();
        let mut base_colors = Vec::new();
        for (instance, surface) in scene.instances.iter().zip(&world.scene().surfaces) {
            let Some(atlas) = &instance.atlas else {
                materials.push(None);
                base_colors.push(None);
                continue;
            };
            let TruthMaterial { base_color, roughness, metallic } =
                TruthMaterial::read(folder, &instance.id, atlas.size as usize)?;
            let (roughness, metallic) = match &world.scene().materials[surface.material.0].model {
                MaterialModel::Principled { roughness: r, metallic: m, .. } => {
                    (exact(*r, roughness), exact(*m, metallic))
                }
                _ => (roughness, metallic),
            };
            let elsewhere = if seen.contains(&instance.index.0.get()) { base_color.clone() } else { one_texel(GREY) };
            base_colors.push(Some([base_color.clone(), base_color.clone(), elsewhere]));
            materials.push(Some(PredictedMaterial { base_color, roughness, metallic }));
        }
        let scattering_key = scattering_key(&materials);
        let truth = PredictedScene { materials, scattering_key, findings: Vec::new(), files: Vec::new() };
        Ok(Self { truth, base_colors })
    }

    /// Whether a prediction has the truth's roughness and metallic, as far as its files can state them: a constant of the
    /// truth counts as met by the byte that is nearest to it (0.5 by 128 of 255). Such predictions are rendered with the
    /// truth's own.
    pub(crate) fn scatter_like(&self, prediction: &PredictedScene) -> bool {
        let pairs = prediction.materials.iter().zip(&self.truth.materials);
        prediction.scattering_key == self.truth.scattering_key
            || pairs.into_iter().all(|pair| match pair {
                (Some(p), Some(t)) => is_stored(&p.roughness, &t.roughness) && is_stored(&p.metallic, &t.metallic),
                (p, t) => p.is_none() && t.is_none(),
            })
    }

    /// The base colours of the companions on an instance with an atlas.
    pub(crate) fn base_colors(&self, instance: usize) -> Option<&[Texture; COMPANIONS]> {
        self.base_colors[instance].as_ref()
    }
}

/// Whether a map is what a file of bytes can state of the truth's.
fn is_stored(prediction: &Texture, truth: &Texture) -> bool {
    let sizes = [prediction, truth].map(|map| (map.width(), map.height()));
    match sizes {
        [(1, 1), (1, 1)] => (prediction.texel(0, 0)[0] - truth.texel(0, 0)[0]).abs() <= 0.501 / 255.0,
        [p, t] => p == t && prediction.bytes() == truth.bytes(),
    }
}

/// The source's constant as a texture, or the baked map.
fn exact(input: ScalarInput, baked: Texture) -> Texture {
    match input {
        ScalarInput::Constant(value) => one_texel(value),
        ScalarInput::Texture { .. } => baked,
    }
}
