//! CPU seconds of everything that scoring does beside tracing light, step by step, for one scene and one or several
//! submissions: `cargo bench --workspace --bench outside_tracing -- DATASET SCENE WEIGHTS SUBMISSION...`, where WEIGHTS is
//! the file with Alex' weights.
//!
//! The renders of a prediction are stood in for by the truth's own, with its halves exchanged and darkened: metrics of
//! light take the same time for any picture.
#![allow(clippy::print_stdout, clippy::unwrap_used)] // a table, of files that the caller names

use std::path::Path;

use cpu_time::ProcessTime;
use mateval_eval::alignment::{channel_scales, scaled};
use mateval_eval::material_pictures::{MaterialPictures, material_pictures};
use mateval_eval::measure::{Albedo, AlbedoReference, albedo_metrics, scalar_metrics};
use mateval_eval::noise_blocks::noise_blocks;
use mateval_eval::open_scene::{OpenScene, scored_views};
use mateval_eval::protocol::Protocol;
use mateval_eval::rendered_view::RenderedView;
use mateval_eval::rgb::{EncodedLight, LightReference, rgb_metrics};
use mateval_eval::shown_render::ViewGuide;
use mateval_eval::texture_space::texture_space;
use mateval_eval::truth::{RgbTruth, TrueLight, ViewTruth};
use mateval_image::{LinearRgb, Mask};
use mateval_metrics::{Lpips, Net};
use mateval_scene::dataset::SceneFile;
use mateval_scene::open::Dataset;
use mateval_scene::{Camera, SceneId};
use mateval_submission::atlas_meshes::AtlasMeshes;
use mateval_submission::prediction::{PredictedScene, read_scene};
use mateval_tracer::noise_filter::Surfaces;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let [dataset, scene, weights, submissions @ ..] = words.as_slice() else {
        println!("give DATASET SCENE WEIGHTS SUBMISSION...: nothing measured");
        return;
    };
    let dataset = Dataset::open(Path::new(dataset)).unwrap();
    let scene = dataset.scene(&SceneId::new(scene).unwrap()).unwrap();
    let lpips = Lpips::load(Net::Alex, Path::new(weights)).unwrap();
    let mut steps = Steps::default();
    let opened = steps.of("reading and hashing the scene, hierarchy", || {
        OpenScene::read(&dataset, scene, dataset.file.scored_renderer.as_ref()).unwrap()
    });
    let predictions: Vec<PredictedScene> = steps.of("reading and hashing the submissions", || {
        let atlases = AtlasMeshes::in_memory(&opened.atlases);
        submissions.iter().map(|path| read_scene(Path::new(path), scene, &atlases).unwrap()).collect()
    });
    score_materials(&mut steps, &dataset, scene, &opened, &predictions, &lpips);
    score_light(&mut steps, &dataset, scene, &opened, predictions.len(), &lpips);
    steps.print();
}

fn score_materials(
    steps: &mut Steps,
    dataset: &Dataset,
    scene: &SceneFile,
    opened: &OpenScene,
    predictions: &[PredictedScene],
    lpips: &Lpips,
) {
    let OpenScene { folder, world, atlases } = opened;
    for view in scored_views(dataset, scene).unwrap() {
        let truth = steps.of("reading the views' maps", || ViewTruth::read(folder, view).unwrap());
        let pictures = steps.of("material pictures", || material_pictures(world, atlases, &view.camera, predictions));
        let reference = steps.of("encoding of albedo", || AlbedoReference::new(truth.albedo.clone()));
        for protocol in protocols() {
            for picture in &pictures {
                let name = |what: &str| format!("{}: {what}", protocol.name);
                let albedos = steps.of("encoding of albedo", || {
                    let raw = &picture.base_color;
                    [raw.clone(), scaled(raw, channel_scales(raw, &truth.albedo, &truth.valid))].map(Albedo::new)
                });
                measure_materials(steps, &name, &protocol, &albedos, &reference, picture, &truth, lpips);
            }
        }
    }
    steps.of("texture space", || {
        texture_space(folder, scene, world, atlases, predictions, &|_| ()).unwrap();
    });
}

#[allow(clippy::too_many_arguments)] // what it measures, and with what
fn measure_materials(
    steps: &mut Steps,
    name: &dyn Fn(&str) -> String,
    protocol: &Protocol,
    albedos: &[Albedo; 2],
    reference: &AlbedoReference,
    picture: &MaterialPictures,
    truth: &ViewTruth,
    lpips: &Lpips,
) {
    for mask in masks(truth) {
        for albedo in albedos {
            steps.of(&name("albedo without LPIPS"), || {
                albedo_metrics(protocol, None, albedo, reference, &mask).unwrap();
            });
            steps.of(&name("albedo with LPIPS"), || {
                albedo_metrics(protocol, Some(lpips), albedo, reference, &mask).unwrap();
            });
        }
        steps.of(&name("roughness and metallic"), || {
            scalar_metrics(protocol, &picture.roughness, &truth.roughness, &mask).unwrap();
            scalar_metrics(protocol, &picture.metallic, &truth.metallic, &mask).unwrap();
        });
    }
}

/// The metrics of one picture of light of every view, as many times as there are submissions.
fn score_light(
    steps: &mut Steps,
    dataset: &Dataset,
    scene: &SceneFile,
    opened: &OpenScene,
    submissions: usize,
    lpips: &Lpips,
) {
    let Some(renderer) = dataset.file.scored_renderer.as_ref() else { return };
    let views = scored_views(dataset, scene).unwrap();
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    for protocol in protocols() {
        let name = |what: &str| format!("{}: {what}", protocol.name);
        let blocks = noise_blocks(&protocol.light.noise, &cameras);
        for (view, blocks) in views.iter().zip(&blocks) {
            let truth = ViewTruth::read(&opened.folder, view).unwrap();
            let light =
                steps.of("reading the views' light", || RgbTruth::read(&opened.folder, renderer, view).unwrap());
            let stored = TrueLight::new(&light, scene.exposure);
            let reference = steps
                .of(&name("a light's reference"), || LightReference::new(&protocol, Some(lpips), &stored).unwrap());
            let [a, b] = &light.halves;
            let darker = [b, a].map(|half| half.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| 0.9 * v))));
            let [a, b] = &darker;
            let rendered = RenderedView::plain([a, a, b, b], scene.exposure);
            let (shown, ratio) = (light.shown.clone(), truth.albedo.map(|_| LinearRgb([0.9; 3])));
            let surfaces = Surfaces {
                base_color: &truth.albedo,
                instances: &truth.instances,
                normals: &truth.normals,
                valid: &truth.valid,
            };
            let guide = ViewGuide { truth: &shown, ratio: &ratio, surfaces };
            for _ in 0..submissions {
                let seen =
                    steps.of(&name("a light's encoding"), || EncodedLight::of_prediction(&rendered, &guide).unwrap());
                for mask in masks(&truth) {
                    for (what, lpips) in [("light without LPIPS", None), ("light with LPIPS", Some(lpips))] {
                        steps.of(&name(what), || {
                            rgb_metrics(&protocol, lpips, &seen, None, &reference, &mask, blocks).unwrap();
                        });
                    }
                }
            }
        }
    }
}

fn protocols() -> Vec<Protocol> {
    Protocol::NAMES.iter().map(|name| Protocol::named(name).unwrap()).collect()
}

/// The masks of a view's regions.
fn masks(truth: &ViewTruth) -> Vec<Mask> {
    let both = |a: &Mask, b: &Mask| Mask::from_fn(a.width(), a.height(), |x, y| a.get(x, y) && b.get(x, y));
    let mut masks = vec![truth.valid.clone()];
    masks.extend(truth.unobserved.clone());
    if let Some(specular) = &truth.specular {
        masks.push(specular.clone());
        masks.extend(truth.unobserved.as_ref().map(|unobserved| both(unobserved, specular)));
    }
    masks
}

/// CPU seconds of all threads by step, in the order of the first calls.
#[derive(Default)]
struct Steps(Vec<(String, f64)>);

impl Steps {
    fn of<T>(&mut self, name: &str, step: impl FnOnce() -> T) -> T {
        let start = ProcessTime::now();
        let found = step();
        let seconds = start.elapsed().as_secs_f64();
        match self.0.iter_mut().find(|(known, _)| known == name) {
            Some((_, sum)) => *sum += seconds,
            None => self.0.push((name.to_owned(), seconds)),
        }
        found
    }

    fn print(&self) {
        self.0.iter().for_each(|(name, seconds)| println!("{seconds:8.3} s  {name}"));
    }
}
