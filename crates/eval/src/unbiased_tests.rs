//! Corrected light against plain renders of 4,096 samples: companions take noise away, and move no expectation.
//!
//! The input view shows a mirror, rough metal, glass, the sky and a lamp; one of its true materials is made black. Each
//! small block of pixels is compared with its own standard error, so that a bias shows wherever it is.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::layout::SceneFolder;
use mateval_scene::open::Dataset;
use mateval_scene::{RendererId, Report};
use mateval_submission::prediction::{PredictedScene, one_texel, scattering_key};
use mateval_testkit::kept_folder::{copy_folder, kept_folder};
use mateval_testkit::sample_dataset::dataset;
use mateval_testkit::statistics::Renders;

use crate::companion_store::{CompanionStore, MadeIn};
use crate::companions::Companions;
use crate::light_pass::LightPass;
use crate::light_rules::{LightRules, Track};
use crate::lit_scene::{LitScene, Photo};
use crate::material_pictures::material_pictures;
use crate::noise_blocks::noise_blocks;
use crate::open_scene::{OpenScene, scored_views};
use crate::predicted_light::predicted_light;
use crate::protocol::Protocol;
use crate::truth::{RgbTruth, TrueLight, ViewTruth};
use crate::view_set::ViewSet;

/// Independent estimates of each kind.
const SEEDS: usize = 16;

/// Samples per half of each corrected estimate.
const CORRECTED_SAMPLES: u32 = 32;

/// Samples per half of each plain render: 16 of two halves have 4,096 samples.
const PLAIN_SAMPLES: u32 = 128;

/// Only the input view.
const VIEWS: usize = 1;

/// Side of a block, in pixels.
const BLOCK: usize = 4;

/// The room, with what both kinds of estimates need.
struct Room {
    opened: OpenScene,
    truths: Vec<ViewTruth>,
    lights: Vec<RgbTruth>,
    /// The truth as the dataset holds it, and with one instance made black.
    companions: [Companions; 2],
    dataset: &'static Dataset,
}

impl Room {
    fn new() -> Self {
        let dataset = dataset();
        let scene = &dataset.scenes[1];
        let opened = OpenScene::read(dataset, scene, None).unwrap();
        let views = &scored_views(dataset, scene).unwrap()[..VIEWS];
        let renderer: &RendererId = dataset.file.scored_renderer.as_ref().unwrap();
        let mut truths: Vec<ViewTruth> =
            views.iter().map(|view| ViewTruth::read(&opened.folder, view).unwrap()).collect();
        let lights = views.iter().map(|view| RgbTruth::read(&opened.folder, renderer, view).unwrap()).collect();
        for shown in ["mirror", "window_glass", "lamp_shade"] {
            let index = scene.instances.iter().find(|instance| instance.id.as_str() == shown).unwrap().index.0.get();
            assert!(truths[0].instances.pixels().contains(&index), "{shown}");
        }
        let copy = kept_folder("unbiased").join("room");
        copy_folder(opened.folder.path(), &copy);
        let black = scene
            .instances
            .iter()
            .find(|instance| instance.atlas.is_some() && is_small(instance.index.0.get(), &truths[0]));
        let black = black.expect("some instance is small in the picture");
        let path = SceneFolder::at(copy.clone()).truth_material(&black.id).join("base_color.png");
        let size = black.atlas.as_ref().map_or(0, |atlas| atlas.size as usize);
        png_io::write_rgb_words(&path, &Picture::filled(size, size, [0; 3])).unwrap();
        let companions = [opened.folder.clone(), SceneFolder::at(copy)]
            .map(|folder| Companions::read(&folder, scene, &opened.world, &truths[0].instances).unwrap());
        for truth in &mut truths {
            truth.albedo = Picture::from_fn(truth.albedo.width(), truth.albedo.height(), |x, y| {
                let is_black = truth.instances.get(x, y) == black.index.0.get();
                if is_black { LinearRgb([0.0; 3]) } else { truth.albedo.get(x, y) }
            });
        }
        Self { opened, truths, lights, companions, dataset }
    }

    /// The truth with a sixth of the atlases black and a sixth at 0.6; with roughness of its own if wanted.
    fn prediction(&self, own_scattering: bool) -> PredictedScene {
        let mut prediction = self.companions[0].truth.clone();
        for (at, material) in prediction.materials.iter_mut().enumerate() {
            let Some(material) = material else { continue };
            if at % 6 == 1 {
                material.base_color = one_texel(0.0);
            } else if at % 6 == 4 {
                material.base_color = one_texel(0.6);
            }
            if own_scattering {
                material.roughness = one_texel(0.3 + 0.1 * (at % 5) as f32);
            }
        }
        prediction.scattering_key = scattering_key(&prediction.materials);
        prediction
    }

    /// The view's mean of all quarters for every seed, exposed. `used` travel along the paths; `converged` are those whose
    /// converged pictures are made.
    fn renders(&self, prediction: &PredictedScene, samples: u32, used: Option<[&Companions; 2]>) -> Vec<Renders> {
        let scene = &self.dataset.scenes[1];
        let views = scored_views(self.dataset, scene).unwrap()[..VIEWS].to_vec();
        let predictions = std::slice::from_ref(prediction);
        let base_colors = vec![
            views
                .iter()
                .map(|view| {
                    let OpenScene { world, atlases, .. } = &self.opened;
                    material_pictures(world, atlases, &view.camera, predictions).remove(0).base_color
                })
                .collect(),
        ];
        let true_lights = self.lights.iter().map(|light| TrueLight::new(light, scene.exposure)).collect();
        let cameras: Vec<_> = views.iter().map(|view| view.camera).collect();
        let lit = LitScene {
            scene,
            world: &self.opened.world,
            atlases: &self.opened.atlases,
            views: views.clone(),
            set: ViewSet::Turned,
            truths: &self.truths,
            lights: BTreeMap::from([(None, true_lights)]),
            truth_samples: 0,
            blocks: noise_blocks(&rules("", samples).noise, &cameras),
            photo: Photo {
                view: views[0],
                place: 0,
                light: self.lights[0].shown.clone(),
                valid: &self.truths[0].valid,
                // Unequal, so that light samples are divided in another way than by solid angles.
                group_light: (0..self.opened.world.emitters().groups())
                    .map(|group| [libm::pow(20.0, group as f64); 3])
                    .collect(),
            },
            lightings: Vec::new(),
            companions: used.map(|[used, _]| used),
            base_colors: &base_colors,
        };
        let mut of_views: Vec<Vec<Picture<LinearRgb>>> = vec![Vec::new(); views.len()];
        for seed in 0..SEEDS {
            let rules = rules(&format!("{seed} {samples}"), samples);
            let quiet = |_: Report<'_>| ();
            let store = CompanionStore::new(self.opened.folder.companions(), MadeIn::ThisRun, String::new());
            let find = |pass: &LightPass<'_>, companions: &Companions| {
                let converged = used.map_or(companions, |[_, converged]| converged);
                store.find(&lit, &rules, pass, converged, &quiet)
            };
            predicted_light(&lit, &rules, predictions, &find, &quiet, &mut |_, light| {
                for (pictures, view) in of_views.iter_mut().zip(&light.pictures[0].views) {
                    let quarters = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(half, quarter)| view.quarter(half, quarter));
                    pictures.push(mean(&quarters));
                }
                Ok(())
            })
            .unwrap();
        }
        of_views.into_iter().map(|pictures| Renders::from_pictures(pictures.into_iter())).collect()
    }
}

fn rules(seed: &str, samples: u32) -> LightRules {
    let mut rules = LightRules { tracks: vec![Track::True], ..Protocol::named("mateval-2").unwrap().light };
    rules.noise.seed = seed.to_owned();
    (rules.noise.least_samples, rules.noise.most_samples) = (samples, samples);
    (rules.noise.least_companion_samples, rules.noise.most_companion_samples) = (32, 32);
    rules
}

/// Whether an instance fills between 1 and 10 % of a view.
fn is_small(index: u16, truth: &ViewTruth) -> bool {
    let pixels = truth.instances.pixels();
    let count = pixels.iter().filter(|&&pixel| pixel == index).count();
    (pixels.len() / 100..pixels.len() / 10).contains(&count)
}

fn mean(pictures: &[Picture<LinearRgb>]) -> Picture<LinearRgb> {
    Picture::from_fn(pictures[0].width(), pictures[0].height(), |x, y| {
        let values = pictures.iter().map(|picture| picture.get(x, y).0);
        LinearRgb(values.fold([0.0; 3], |sum, v| [0, 1, 2].map(|c| sum[c] + v[c] / pictures.len() as f32)))
    })
}

/// How far two sets of renders are apart.
#[derive(Debug)]
struct Distance {
    /// Root mean square, over blocks, of the difference in standard errors.
    rms_z: f64,
    /// The difference of the whole views' means, relative.
    relative: f64,
}

fn distance(corrected: &[Renders], plain: &[Renders]) -> Distance {
    // A standard error from few seeds gives Student's distribution, whose variance is that over this minus 2.
    let freedom = (SEEDS - 1) as f64;
    let (mut squares, mut blocks) = (0.0, 0);
    let mut means = [0.0; 2];
    for (corrected, plain) in corrected.iter().zip(plain) {
        let picture = &plain.pictures()[0];
        for y in (0..picture.height()).step_by(BLOCK) {
            for x in (0..picture.width()).step_by(BLOCK) {
                let [ours, theirs] = [corrected, plain].map(|renders| renders.region(x..x + BLOCK, y..y + BLOCK));
                // What emits as much in every pixel has no noise, and no z.
                if ours.error.hypot(theirs.error) < 1e-4 * theirs.mean {
                    assert!((ours.mean - theirs.mean).abs() < 1e-3 * theirs.mean, "{x} {y}: {ours:?} {theirs:?}");
                    continue;
                }
                squares += ours.z_against(&theirs).powi(2);
                blocks += 1;
            }
        }
        let [ours, theirs] = [corrected, plain].map(Renders::whole);
        means[0] += ours.mean;
        means[1] += theirs.mean;
    }
    Distance {
        rms_z: (squares / f64::from(blocks) * (freedom - 2.0) / freedom).sqrt(),
        relative: means[0] / means[1] - 1.0,
    }
}

#[test]
fn companions_move_no_expectation() {
    let room = Room::new();
    let [as_stored, black] = &room.companions;
    for own_scattering in [false, true] {
        let prediction = room.prediction(own_scattering);
        let plain = room.renders(&prediction, PLAIN_SAMPLES, None);
        let found = distance(&room.renders(&prediction, CORRECTED_SAMPLES, Some([black, black])), &plain);
        assert!((0.9..=1.1).contains(&found.rms_z) && found.relative.abs() < 1e-3, "{own_scattering}: {found:?}");
        if own_scattering {
            continue;
        }
        // The twin, whose converged pictures are those of other companions, must fail.
        let found = distance(&room.renders(&prediction, CORRECTED_SAMPLES, Some([black, as_stored])), &plain);
        assert!(found.rms_z > 1.1 && found.relative.abs() > 1e-3, "{found:?}");
    }
}
