//! Submissions scored on one scene.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::{Lpips, MetricError, NoiseFreeMse, psnr_mean_error};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::submission::Map;
use mateval_scene::{Camera, Progress, RendererId, TriangleMesh};
use mateval_tracer::World;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::alignment::{channel_scales, scaled};
use crate::error::EvalError;
use crate::instance_errors::InstanceErrors;
use crate::light_rules::{NoiseRules, Track};
use crate::material_pictures::{MaterialPictures, material_pictures};
use crate::measure::{Measured, albedo_metrics, scalar_metrics};
use crate::noise_blocks::noise_blocks;
use crate::predicted_light::{FittedRadiances, LitPicture, LitScene, PredictedLight, predicted_light};
use crate::prediction::PredictedScene;
use crate::protocol::{AlbedoSpace, Protocol};
use crate::relit::lightings;
use crate::result::{
    InstancePixelErrors, InstanceTexelErrors, NoiseState, PictureValue, PsnrNoise, Region, TexelErrors, views,
};
use crate::rgb::{EncodedLight, LightReference, RgbMeasured, rgb_metrics};
use crate::texture_space::{InstanceTexels, TexelSums, texture_space};
use crate::truth::{RgbTruth, ViewTruth, intersection};

/// What one submission got in one scene under one protocol.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneScore {
    pub(crate) pictures: Vec<PictureValue>,
    pub(crate) texels: Vec<InstanceTexelErrors>,
    pub(crate) instances: Vec<InstancePixelErrors>,
    pub(crate) noise: BTreeMap<String, PsnrNoise>,
    pub(crate) fit: Option<FittedRadiances>,
}

/// A scene, its predictions and the rules.
pub(crate) struct SceneOrder<'a> {
    pub(crate) scene: &'a SceneFile,
    pub(crate) folder: &'a SceneFolder,
    pub(crate) world: &'a World,
    pub(crate) atlases: &'a [TriangleMesh],
    /// Those that are scored.
    pub(crate) views: Vec<&'a View>,
    pub(crate) predictions: &'a [PredictedScene],
    pub(crate) protocols: &'a [Protocol],
    pub(crate) lpips: Option<&'a Lpips>,
    /// Whose renders light is compared with; none leaves light out.
    pub(crate) renderer: Option<&'a RendererId>,
    pub(crate) progress: Progress<'a>,
}

/// A region of a view's pixels and what its pictures' names end with.
struct MaskedRegion {
    region: Region,
    suffix: &'static str,
    mask: Mask,
}

/// Scores on the way, of one submission and protocol.
#[derive(Default)]
struct Sheet {
    score: SceneScore,
    errors: InstanceErrors,
}

/// By submission, then by protocol.
pub(crate) fn score_scene(order: &SceneOrder<'_>) -> Result<Vec<Vec<SceneScore>>, EvalError> {
    let truths = order.views.iter().map(|view| ViewTruth::read(order.folder, view)).collect::<Result<Vec<_>, _>>()?;
    let blank = || order.protocols.iter().map(|_| Sheet::default()).collect();
    let mut sheets: Vec<Vec<Sheet>> = order.predictions.iter().map(|_| blank()).collect();
    order.materials(&truths, &mut sheets)?;
    order.texels(&mut sheets)?;
    if let Some(renderer) = order.renderer {
        for at in 0..order.protocols.len() {
            order.light(renderer, &truths, at, &mut sheets)?;
        }
    }
    let finish = |sheet: Sheet| SceneScore { instances: sheet.errors.finish(order.scene), ..sheet.score };
    Ok(sheets.into_iter().map(|sheets| sheets.into_iter().map(finish).collect()).collect())
}

impl SceneOrder<'_> {
    /// Pictures of base colour, roughness and metallic.
    fn materials(&self, truths: &[ViewTruth], sheets: &mut [Vec<Sheet>]) -> Result<(), EvalError> {
        for (at, (view, truth)) in self.views.iter().zip(truths).enumerate() {
            (self.progress)(&format!("scene {}: materials", self.scene.id), at, self.views.len());
            let pictures = material_pictures(self.world, self.atlases, &view.camera, self.predictions);
            let regions = regions(truth);
            let jobs: Vec<(usize, usize)> =
                (0..sheets.len()).flat_map(|s| (0..self.protocols.len()).map(move |p| (s, p))).collect();
            let measured: Vec<_> = jobs
                .par_iter()
                .map(|&(s, p)| self.material_values(&self.protocols[p], view, &pictures[s], truth, &regions))
                .collect();
            for ((s, p), values) in jobs.into_iter().zip(measured) {
                let sheet = &mut sheets[s][p];
                sheet.score.pictures.extend(values?);
                self.material_errors(&self.protocols[p], view, &pictures[s], truth, &mut sheet.errors);
            }
        }
        Ok(())
    }

    /// All metrics of a view's albedo (raw and aligned, which keeps its picture's scale everywhere), roughness, metallic.
    fn material_values(
        &self,
        protocol: &Protocol,
        view: &View,
        predicted: &MaterialPictures,
        truth: &ViewTruth,
        regions: &[MaskedRegion],
    ) -> Result<Vec<PictureValue>, EvalError> {
        let aligned = aligned(predicted, truth);
        let mut values = Vec::new();
        for region in regions {
            for (name, picture) in [("albedo", &predicted.base_color), ("albedo_aligned", &aligned)] {
                let found = albedo_metrics(protocol, self.lpips, picture, &truth.albedo, &region.mask);
                values.extend(self.values(view, region, name, None, self.or_named(view, found)?));
            }
            let scalars = [
                ("roughness", &predicted.roughness, &truth.roughness),
                ("metallic", &predicted.metallic, &truth.metallic),
            ];
            for (name, picture, truth) in scalars {
                let found = scalar_metrics(protocol, picture, truth, &region.mask);
                values.extend(self.values(view, region, name, None, self.or_named(view, found)?));
            }
        }
        Ok(values)
    }

    fn material_errors(
        &self,
        protocol: &Protocol,
        view: &View,
        predicted: &MaterialPictures,
        truth: &ViewTruth,
        errors: &mut InstanceErrors,
    ) {
        let aligned = aligned(predicted, truth);
        for (name, picture) in [("albedo", &predicted.base_color), ("albedo_aligned", &aligned)] {
            let spaces = match protocol.albedo_space {
                AlbedoSpace::Linear => [picture.clone(), truth.albedo.clone()],
                AlbedoSpace::Srgb => [picture, &truth.albedo].map(|p| p.to_srgb().map(|SrgbRgb(v)| LinearRgb(v))),
            };
            let error = |k: usize| mean_square(spaces[0].pixels()[k].0, spaces[1].pixels()[k].0);
            errors.add(name, views(&view.id, Region::Valid), &truth.instances, &truth.valid, error);
            if let Some(unobserved) = &truth.unobserved {
                errors.add(name, "unobserved", &truth.instances, unobserved, error);
            }
        }
    }

    fn texels(&self, sheets: &mut [Vec<Sheet>]) -> Result<(), EvalError> {
        let found = texture_space(self.folder, self.scene, self.world, self.atlases, self.predictions, self.progress)?;
        for (sheets, instances) in sheets.iter_mut().zip(found) {
            let errors: Vec<InstanceTexelErrors> =
                instances.iter().map(|instance| texel_errors(self.scene, instance)).collect();
            for sheet in sheets {
                sheet.score.texels = errors.clone();
            }
        }
        Ok(())
    }

    /// Everything under the lights of protocol `at`.
    fn light(
        &self,
        renderer: &RendererId,
        truths: &[ViewTruth],
        at: usize,
        sheets: &mut [Vec<Sheet>],
    ) -> Result<(), EvalError> {
        let protocol = &self.protocols[at];
        let lit = self.lit_scene(renderer, truths, protocol)?;
        let cameras: Vec<Camera> = self.views.iter().map(|view| view.camera).collect();
        let bench = LightBench {
            order: self,
            protocol,
            truths,
            regions: truths.iter().map(regions).collect(),
            references: self.references(renderer, &lit, protocol)?,
            blocks: noise_blocks(&cameras, protocol.light.noise.block_pixels),
        };
        predicted_light(&lit, &protocol.light, self.predictions, self.progress, &mut |submission, light| {
            bench.measure(light, &mut sheets[submission][at])
        })
    }

    fn lit_scene<'a>(
        &'a self,
        renderer: &RendererId,
        truths: &'a [ViewTruth],
        protocol: &Protocol,
    ) -> Result<LitScene<'a>, EvalError> {
        let unsound =
            || EvalError::Invalid(format!("scene '{}' has no input view; run `mateval prep verify`", self.scene.id));
        let input = self.scene.view(INPUT).ok_or_else(unsound)?;
        let place = self.views.iter().position(|view| view.id == input.id).ok_or_else(|| {
            let what =
                format!("scene '{}': targets.json leaves out the input view, which light is fitted to", self.scene.id);
            EvalError::Invalid(what)
        })?;
        let light =
            self.views.iter().map(|view| RgbTruth::read(self.folder, renderer, view)).collect::<Result<Vec<_>, _>>()?;
        let valid = &truths[place].valid;
        let lightings = if protocol.light.tracks.contains(&Track::Relit) {
            let group = |group| Ok(RgbTruth::of_group(self.folder, renderer, input, group)?.shown);
            let groups = (0..self.world.emitters().groups()).map(group).collect::<Result<Vec<_>, EvalError>>()?;
            lightings(&protocol.light.relit, &groups, valid)
        } else {
            Vec::new()
        };
        Ok(LitScene {
            scene: self.scene,
            world: self.world,
            atlases: self.atlases,
            views: self.views.clone(),
            truths,
            input: (input, light[place].clone(), valid),
            light,
            lightings,
        })
    }

    /// What each light's pictures are compared with, by lighting (none is the scene's own) and view.
    fn references(
        &self,
        renderer: &RendererId,
        lit: &LitScene<'_>,
        protocol: &Protocol,
    ) -> Result<BTreeMap<Option<String>, Vec<LightReference>>, EvalError> {
        let reference = |view: &View, truth: &RgbTruth| {
            let found = LightReference::new(protocol, self.lpips, truth, self.scene.exposure);
            self.or_named(view, found)
        };
        let own: Vec<LightReference> =
            self.views.iter().zip(&lit.light).map(|(view, truth)| reference(view, truth)).collect::<Result<_, _>>()?;
        let mut references = BTreeMap::from([(None, own)]);
        for view in &self.views {
            let relit = RgbTruth::relit(self.folder, renderer, view, &lit.lightings)?;
            for (lighting, truth) in lit.lightings.iter().zip(&relit) {
                references.entry(Some(lighting.name.clone())).or_default().push(reference(view, truth)?);
            }
        }
        Ok(references)
    }

    fn values(
        &self,
        view: &View,
        region: &MaskedRegion,
        name: &str,
        lighting: Option<&String>,
        measured: Vec<Measured>,
    ) -> Vec<PictureValue> {
        let value = |measured: Measured| PictureValue {
            scene: self.scene.id.clone(),
            view: view.id.clone(),
            picture: format!("{name}{}", region.suffix),
            lighting: lighting.cloned(),
            region: region.region,
            metric: measured.metric,
            value: measured.value,
            exact: measured.exact,
            noise: measured.noise,
            count: measured.count,
        };
        measured.into_iter().map(value).collect()
    }

    fn or_named<T>(&self, view: &View, found: Result<T, MetricError>) -> Result<T, EvalError> {
        found.map_err(|source| EvalError::Metric {
            what: format!("scene '{}', view '{}'", self.scene.id, view.id),
            source,
        })
    }
}

/// Where pictures of light are measured.
struct LightBench<'a> {
    order: &'a SceneOrder<'a>,
    protocol: &'a Protocol,
    truths: &'a [ViewTruth],
    /// Of each view.
    regions: Vec<Vec<MaskedRegion>>,
    references: BTreeMap<Option<String>, Vec<LightReference>>,
    /// Of each view.
    blocks: Vec<Picture<u32>>,
}

impl LightBench<'_> {
    fn measure(&self, light: PredictedLight, sheet: &mut Sheet) -> Result<(), EvalError> {
        let PredictedLight { pictures, fit, samples } = light;
        for picture in &pictures {
            self.measure_picture(picture, samples, sheet)?;
        }
        if fit.is_some() {
            sheet.score.fit = fit;
        }
        Ok(())
    }

    fn measure_picture(&self, picture: &LitPicture, samples: u32, sheet: &mut Sheet) -> Result<(), EvalError> {
        let order = self.order;
        let name = picture.track.picture();
        let lights: Vec<EncodedLight> =
            picture.views.par_iter().map(|halves| EncodedLight::of_prediction(halves, order.scene.exposure)).collect();
        let references = &self.references[&picture.lighting];
        let jobs: Vec<(usize, &MaskedRegion)> = self
            .regions
            .iter()
            .enumerate()
            .flat_map(|(view, regions)| regions.iter().map(move |region| (view, region)))
            .collect();
        let measured: Vec<Result<RgbMeasured, MetricError>> = jobs
            .par_iter()
            .map(|&(view, region)| {
                let (light, reference, blocks) = (&lights[view], &references[view], &self.blocks[view]);
                rgb_metrics(self.protocol, order.lpips, light, reference, &region.mask, blocks)
            })
            .collect();
        let mut errors: BTreeMap<String, Vec<NoiseFreeMse>> = BTreeMap::new();
        for (&(view, region), measured) in jobs.iter().zip(measured) {
            let view = order.views[view];
            let RgbMeasured { values, mse } = order.or_named(view, measured)?;
            sheet.score.pictures.extend(order.values(view, region, name, picture.lighting.as_ref(), values));
            let key = format!("{name}{}.{}.psnr", region.suffix, views(&view.id, region.region));
            errors.entry(key).or_default().extend(mse);
        }
        if picture.track != Track::Relit {
            let noise = errors.into_iter().filter(|(_, views)| !views.is_empty());
            sheet
                .score
                .noise
                .extend(noise.map(|(key, views)| (key, psnr_noise(&self.protocol.light.noise, &views, samples))));
            self.add_errors(name, &lights, references, &mut sheet.errors);
        }
        Ok(())
    }

    fn add_errors(
        &self,
        name: &str,
        lights: &[EncodedLight],
        references: &[LightReference],
        errors: &mut InstanceErrors,
    ) {
        let pairs = lights.iter().zip(references);
        for ((view, truth), (light, reference)) in self.order.views.iter().zip(self.truths).zip(pairs) {
            let error = |k: usize| light.noise_free_square(reference, k);
            errors.add(name, views(&view.id, Region::Valid), &truth.instances, &truth.valid, error);
            if let Some(unobserved) = &truth.unobserved {
                errors.add(name, "unobserved", &truth.instances, unobserved, error);
            }
        }
    }
}

/// How sure the mean PSNR of some views is, and why.
fn psnr_noise(rules: &NoiseRules, views: &[NoiseFreeMse], samples: u32) -> PsnrNoise {
    let noise = psnr_mean_error(&views.iter().collect::<Vec<_>>());
    let state = match &noise {
        Some(noise) if noise.prediction <= rules.target_db && noise.reference <= rules.target_db => {
            NoiseState::Certified
        }
        Some(noise) if noise.prediction <= rules.target_db.max(rules.truth_share * noise.reference) => {
            NoiseState::LimitedByTruth
        }
        _ if samples >= rules.most_samples => NoiseState::SampleCap,
        _ => NoiseState::AboveTarget,
    };
    PsnrNoise {
        standard_error_db: noise.as_ref().map(|noise| noise.total),
        own_db: noise.as_ref().map(|noise| noise.prediction),
        truth_db: noise.as_ref().map(|noise| noise.reference),
        samples,
        state,
    }
}

/// The regions of a view that have values of their own.
fn regions(truth: &ViewTruth) -> Vec<MaskedRegion> {
    let mut regions = vec![MaskedRegion { region: Region::Valid, suffix: "", mask: truth.valid.clone() }];
    let unobserved = truth.unobserved.as_ref();
    regions.extend(unobserved.map(|mask| MaskedRegion { region: Region::Unobserved, suffix: "", mask: mask.clone() }));
    if let Some(specular) = &truth.specular {
        regions.push(MaskedRegion { region: Region::Valid, suffix: "_specular", mask: specular.clone() });
        regions.extend(unobserved.map(|mask| MaskedRegion {
            region: Region::Unobserved,
            suffix: "_specular",
            mask: intersection(mask, specular),
        }));
    }
    regions
}

fn aligned(predicted: &MaterialPictures, truth: &ViewTruth) -> Picture<LinearRgb> {
    scaled(&predicted.base_color, channel_scales(&predicted.base_color, &truth.albedo, &truth.valid))
}

fn mean_square(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum::<f64>() / 3.0
}

fn texel_errors(scene: &SceneFile, instance: &InstanceTexels) -> InstanceTexelErrors {
    let errors = |sums: &TexelSums| TexelErrors {
        area_m2: sums.area_m2,
        base_color_mse: sums.mse(Map::BaseColor),
        roughness_mse: sums.mse(Map::Roughness),
        metallic_mse: sums.mse(Map::Metallic),
    };
    InstanceTexelErrors {
        scene: scene.id.clone(),
        instance: instance.instance.clone(),
        observed: errors(&instance.observed),
        unobserved: errors(&instance.unobserved),
    }
}
