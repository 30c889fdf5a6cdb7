//! A pass: the pictures of predictions that come from one set of paths.

use std::borrow::Cow;

use mateval_image::{LinearRgb, Picture};
use mateval_scene::{Camera, Progress, Report};
use mateval_submission::prediction::{PredictedMaterial, PredictedScene};
use mateval_tracer::{
    Coat, LightGroups, LightMix, Lighting, Repaint, Scattering, ViewsRender, World, render_repainted,
};

use crate::companion_pictures::{Lightings, weighted};
use crate::companions::{COMPANION_SCALES, COMPANIONS, Companions};
use crate::error::EvalError;
use crate::light_rules::{LightRules, Track};
use crate::lit_scene::LitScene;
use crate::relit::LightingName;
use crate::seeds::seed;
use crate::view_set::PassName;

/// A set of lights, and the pictures that are made under them.
pub(crate) struct LightPass<'a> {
    /// Part of the seeds.
    pub(crate) name: &'static str,
    pub(crate) world: &'a World,
    /// The name of each light.
    pub(crate) lights: Vec<String>,
    pub(crate) on_stage: bool,
    /// How light samples are divided among the light groups; empty where solid angles alone decide.
    pub(crate) group_shares: Vec<f64>,
    pub(crate) pictures: PassPictures,
    lit: &'a LitScene<'a>,
    rules: &'a LightRules,
    progress: Progress<'a>,
}

/// The pictures of a pass.
pub(crate) enum PassPictures {
    /// Tracks and lightings whose weights are the same for every prediction.
    Fixed(Vec<(Track, Option<LightingName>)>),
    /// Two pictures of track `fitted`, under the weights that each of two streams of samples was fitted to.
    Fitted,
}

impl PassPictures {
    /// Track and lighting of each picture.
    pub(crate) fn names(&self) -> Vec<(Track, Option<LightingName>)> {
        match self {
            Self::Fixed(names) => names.clone(),
            Self::Fitted => vec![(Track::Fitted, None); 2],
        }
    }
}

impl<'a> LightPass<'a> {
    /// Pictures under the scene's own lights.
    pub(crate) fn of_own_lights(
        name: PassName,
        lit: &'a LitScene<'a>,
        rules: &'a LightRules,
        pictures: PassPictures,
        progress: Progress<'a>,
    ) -> Self {
        let lights = lit.world.scene().lights.iter().map(|light| light.name.clone()).collect();
        let name = lit.set.pass(name);
        Self {
            name,
            world: lit.world,
            lights,
            on_stage: false,
            group_shares: Vec::new(),
            pictures,
            lit,
            rules,
            progress,
        }
    }

    /// The picture under fitted lights of a stage, which are those of `world`.
    pub(crate) fn on_stage(
        world: &'a World,
        lights: Vec<String>,
        lit: &'a LitScene<'a>,
        rules: &'a LightRules,
        progress: Progress<'a>,
    ) -> Self {
        let name = lit.set.pass(PassName::Stage);
        Self {
            name,
            world,
            lights,
            on_stage: true,
            group_shares: Vec::new(),
            pictures: PassPictures::Fitted,
            lit,
            rules,
            progress,
        }
    }

    /// The same pass, whose paths are traced in `world`: the same scene, whose light samples are divided among the groups by
    /// `group_shares`.
    pub(crate) fn sampled_in(self, world: &'a World, group_shares: Vec<f64>) -> Self {
        Self { world, group_shares, ..self }
    }

    /// The weights of the lights under which converged pictures of the companions are kept: those of the pass's pictures, or
    /// each light alone where the weights are fitted for each prediction.
    pub(crate) fn companion_mixes(&self) -> Vec<LightMix> {
        let lights = self.lights.len();
        let mix = |(track, lighting): &(Track, Option<LightingName>)| match track {
            Track::Relit => {
                let relit = self.lit.lightings.iter().find(|relit| Some(relit.name) == *lighting);
                relit.expect("the pass was made of these lightings").weights.clone()
            }
            Track::True | Track::Fitted => vec![[1.0; 3]; lights],
        };
        let alone = |light: usize| (0..lights).map(|other| [f64::from(u8::from(other == light)); 3]).collect();
        match &self.pictures {
            PassPictures::Fixed(names) => names.iter().map(mix).collect(),
            PassPictures::Fitted => (0..lights).map(alone).collect(),
        }
    }

    /// Renders one stream of `predictions` and the scene's companions, each under all `mixes`. `predictions` agree in
    /// roughness and metallic.
    pub(crate) fn trace(
        &self,
        predictions: &[&PredictedScene],
        mixes: &[LightMix],
        cameras: &[Camera],
        samples: u32,
        stream: &str,
        what: &str,
    ) -> Result<Vec<ViewsRender>, EvalError> {
        let repaint = self.repaint(predictions, self.lit.companions)?;
        let mixes = vec![mixes.to_vec(); repaint.predictions()];
        self.render(&repaint, Lighting::Mixed(&mixes), cameras, samples, stream, what)
    }

    /// Renders one stream of `predictions` and the scene's companions in one view, each under every light alone.
    pub(crate) fn trace_lights(
        &self,
        predictions: &[&PredictedScene],
        camera: &Camera,
        samples: u32,
        stream: &str,
        what: &str,
    ) -> Result<Vec<ViewsRender>, EvalError> {
        let repaint = self.repaint(predictions, self.lit.companions)?;
        let groups = LightGroups::apart(self.lights.len());
        self.render(&repaint, Lighting::Apart(&groups), std::slice::from_ref(camera), samples, stream, what)
    }

    /// Renders one stream of the companions alone, under the mixes of [`Self::companion_mixes`].
    pub(crate) fn trace_companions(
        &self,
        companions: &Companions,
        samples: u32,
        stream: &str,
    ) -> Result<Vec<ViewsRender>, EvalError> {
        let repaint = self.repaint(&[], Some(companions))?;
        let (mixes, groups) =
            (vec![self.companion_mixes(); COMPANION_SCALES.len()], LightGroups::apart(self.lights.len()));
        let lighting = match self.pictures {
            PassPictures::Fixed(_) => Lighting::Mixed(&mixes),
            PassPictures::Fitted => Lighting::Apart(&groups),
        };
        let what = format!("{} companions, {samples} samples, {stream}", self.name);
        self.render(&repaint, lighting, &self.lit.cameras(), samples, stream, &what)
    }

    /// The companions' converged pictures in picture number `picture` of the pass, whose lights have the weights `mix`, made
    /// of those that are kept.
    pub(crate) fn converged<'c>(
        &self,
        kept: &'c Lightings<Picture<LinearRgb>>,
        picture: usize,
        mix: &LightMix,
    ) -> Cow<'c, [Picture<LinearRgb>; COMPANIONS]> {
        match self.pictures {
            PassPictures::Fixed(_) => Cow::Borrowed(&kept[picture]),
            PassPictures::Fitted => Cow::Owned(weighted(kept, mix)),
        }
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
        let seeds = [seed(&self.rules.noise.seed, &self.lit.scene.id, self.name, stream)];
        let settings = self.rules.settings(samples);
        let shown = |done: usize, all: usize| (self.progress)(Report::step(&what, done, all));
        let which = 0..repaint.predictions();
        Ok(render_repainted(self.world, repaint, which, cameras, lighting, &settings, &seeds, &shown)?)
    }

    /// The predictions, then the companions.
    fn repaint(&self, predictions: &[&PredictedScene], companions: Option<&Companions>) -> Result<Repaint, EvalError> {
        let truth = companions.map(|companions| &companions.truth);
        let own = predictions.first().copied();
        let scatters_alike = own.is_none_or(|own| companions.is_some_and(|companions| companions.scatter_like(own)));
        let scattering = own.filter(|_| !scatters_alike).or(truth).expect("there is a prediction or a companion");
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
            if !scatters_alike {
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
