//! A pass: the pictures of predictions that come from one set of paths.

use mateval_scene::{Camera, Progress};
use mateval_submission::prediction::{PredictedMaterial, PredictedScene};
use mateval_tracer::{Coat, LightMix, Lighting, Repaint, Scattering, ViewsRender, World, render_repainted};

use crate::companions::{COMPANION_SCALES, Companions};
use crate::error::EvalError;
use crate::light_rules::{LightRules, Track};
use crate::lit_scene::LitScene;
use crate::relit::LightingName;
use crate::seeds::seed;

/// A set of lights, and the pictures that are made under them.
pub(crate) struct LightPass<'a> {
    /// Part of the seeds.
    pub(crate) name: &'static str,
    pub(crate) world: &'a World,
    /// The name of each light.
    pub(crate) lights: Vec<String>,
    pub(crate) on_stage: bool,
    pub(crate) pictures: PassPictures,
    lit: &'a LitScene<'a>,
    rules: &'a LightRules,
    progress: Progress<'a>,
}

/// The pictures of a pass.
pub(crate) enum PassPictures {
    /// Tracks and lightings whose weights are the same for every prediction.
    Fixed(Vec<(Track, Option<LightingName>)>),
    /// One picture, of track `fitted`.
    Fitted,
}

impl PassPictures {
    /// Track and lighting of each picture.
    pub(crate) fn names(&self) -> Vec<(Track, Option<LightingName>)> {
        match self {
            Self::Fixed(names) => names.clone(),
            Self::Fitted => vec![(Track::Fitted, None)],
        }
    }
}

impl<'a> LightPass<'a> {
    /// Pictures under the scene's own lights.
    pub(crate) fn of_own_lights(
        name: &'static str,
        lit: &'a LitScene<'a>,
        rules: &'a LightRules,
        pictures: PassPictures,
        progress: Progress<'a>,
    ) -> Self {
        let lights = lit.world.scene().lights.iter().map(|light| light.name.clone()).collect();
        Self { name, world: lit.world, lights, on_stage: false, pictures, lit, rules, progress }
    }

    /// The picture under fitted lights of a stage, which are those of `world`.
    pub(crate) fn on_stage(
        world: &'a World,
        lights: Vec<String>,
        lit: &'a LitScene<'a>,
        rules: &'a LightRules,
        progress: Progress<'a>,
    ) -> Self {
        Self { name: "stage", world, lights, on_stage: true, pictures: PassPictures::Fitted, lit, rules, progress }
    }

    /// The companions that travel with this pass's predictions. Their pictures are known under fixed lights; fitted lights
    /// differ between predictions.
    pub(crate) fn companions(&self) -> Option<&'a Companions> {
        match self.pictures {
            PassPictures::Fixed(_) => self.lit.companions,
            PassPictures::Fitted => None,
        }
    }

    /// The weights of the lights in each picture of a pass whose weights are fixed.
    pub(crate) fn fixed_mixes(&self) -> Vec<LightMix> {
        let mix = |(track, lighting): (Track, Option<LightingName>)| match track {
            Track::Relit => {
                let relit = self.lit.lightings.iter().find(|relit| Some(relit.name) == lighting);
                relit.expect("the pass was made of these lightings").weights.clone()
            }
            Track::True | Track::Fitted => vec![[1.0; 3]; self.lights.len()],
        };
        self.pictures.names().into_iter().map(mix).collect()
    }

    /// Renders one stream of `predictions`, each under its own `mixes`, and of the pass's companions under those of the
    /// first. `predictions` agree in roughness and metallic.
    pub(crate) fn trace(
        &self,
        predictions: &[&PredictedScene],
        mixes: &[Vec<LightMix>],
        cameras: &[Camera],
        samples: u32,
        stream: &str,
        what: &str,
    ) -> Result<Vec<ViewsRender>, EvalError> {
        let mut mixes = mixes.to_vec();
        let companions = self.companions();
        if companions.is_some() {
            mixes.extend(vec![mixes[0].clone(); COMPANION_SCALES.len()]);
        }
        let repaint = self.repaint(predictions, companions)?;
        self.render(&repaint, Lighting::Mixed(&mixes), cameras, samples, stream, what)
    }

    /// Renders one stream of `predictions` without companions.
    pub(crate) fn trace_alone(
        &self,
        predictions: &[&PredictedScene],
        lighting: Lighting<'_>,
        cameras: &[Camera],
        samples: u32,
        stream: &str,
        what: &str,
    ) -> Result<Vec<ViewsRender>, EvalError> {
        self.render(&self.repaint(predictions, None)?, lighting, cameras, samples, stream, what)
    }

    /// Renders one stream of the companions alone.
    pub(crate) fn trace_companions(
        &self,
        companions: &Companions,
        mixes: &[LightMix],
        samples: u32,
        stream: &str,
    ) -> Result<Vec<ViewsRender>, EvalError> {
        let repaint = self.repaint(&[], Some(companions))?;
        let mixes = vec![mixes.to_vec(); COMPANION_SCALES.len()];
        let what = format!("{} companions, {samples} samples, {stream}", self.name);
        self.render(&repaint, Lighting::Mixed(&mixes), &self.lit.cameras(), samples, stream, &what)
    }

    fn render(
        &self,
        repaint: &Repaint,
        lighting: Lighting<'_>,
        cameras: &[Camera],
        samples: u32,
        stream: &str,
        what: &str,
    ) -> Result<Vec<ViewsRender>, EvalError> {
        let what = format!("scene {}: {what}", self.lit.scene.id);
        let seeds = [seed(&self.lit.scene.id, self.name, stream)];
        let settings = self.rules.settings(samples);
        let shown = |done: usize, all: usize| (self.progress)(&what, done, all);
        let which = 0..repaint.predictions();
        Ok(render_repainted(self.world, repaint, which, cameras, lighting, &settings, &seeds, &shown)?)
    }

    /// The predictions, then the companions.
    fn repaint(&self, predictions: &[&PredictedScene], companions: Option<&Companions>) -> Result<Repaint, EvalError> {
        let truth = companions.map(|companions| &companions.truth);
        let scattering = predictions.first().copied().or(truth).expect("there is a prediction or a companion");
        let coat = |surface: usize| {
            let material = |prediction: &PredictedScene| prediction.materials[surface].clone();
            let PredictedMaterial { roughness, metallic, .. } = material(scattering)?;
            let of_predictions = predictions.iter().map(|prediction| Some(material(prediction)?.base_color));
            let mut base_colors: Vec<_> = of_predictions.collect::<Option<_>>()?;
            if let Some(companions) = companions {
                base_colors.extend(companions.base_colors(surface)?.iter().cloned());
            }
            Some(Coat { base_colors, roughness, metallic })
        };
        let coats: Vec<Option<Coat>> = (0..self.lit.atlases.len()).map(coat).collect();
        let mut repaint = Repaint::new(self.world, self.lit.atlases, coats, self.rules.flavour)?;
        if let Some(truth) = truth {
            let own = vec![1.0; predictions.len()];
            repaint = repaint.with_scales(own.into_iter().chain(COMPANION_SCALES).collect())?;
            if truth.scattering_key != scattering.scattering_key {
                let of_surface = truth.materials.iter().map(|material| {
                    let PredictedMaterial { roughness, metallic, .. } = material.clone()?;
                    Some(Scattering { roughness, metallic })
                });
                repaint = repaint.with_second(predictions.len(), of_surface.collect())?;
            }
        }
        Ok(repaint)
    }
}
