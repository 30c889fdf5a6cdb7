//! Measures how well planted radiances are recovered from a noisy photo of a real room, by samples of the light basis.
//!
//! `cargo bench --workspace --bench planted_fit -- DATASET SCENE SUBMISSION`. Radiances of 0.5 to 3.5, different for
//! every light and channel, are planted on the light stage of a 3D-FRONT room, or on the own emitters of another scene.
//! The photo is rendered with one seed and the basis with another, both with the submission's materials, so that only
//! noise affects the fit. For each light the bench prints its share of the photo, the noise of the averaged squares
//! between photo and basis, and the radiances that were found.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a bench prints

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use mateval_eval::light_rules::{LightRules, Track};
use mateval_eval::truth::ViewTruth;
use mateval_light::light_fit::{fit_lights, pooled};
use mateval_light::light_stage;
use mateval_scene::material::PrincipledFlavour;
use mateval_scene::{SceneId, SceneLights, glb, open::Dataset, reference_io};
use mateval_submission::prediction::read_scene;
use mateval_tracer::{
    Coat, LightBasis, LightGroups, Lighting, RenderSettings, Repaint, StageLight, World, render_repainted,
};

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let [dataset, scene, submission] = words.as_slice() else {
        println!("give DATASET SCENE SUBMISSION");
        return;
    };
    let dataset = Dataset::open(Path::new(dataset)).unwrap();
    let id = SceneId::new(scene).unwrap();
    let scene = dataset.scenes.iter().find(|scene| scene.id == id).unwrap();
    let folder = dataset.folder(&id);
    let own = World::new(Arc::new(reference_io::read(&folder).unwrap())).unwrap();
    let atlases: Vec<_> = glb::read(&folder.instances()).unwrap().into_iter().map(|node| node.mesh).collect();
    let rules = LightRules::new(vec![Track::Fitted], PrincipledFlavour::Blender);
    let world = match scene.lights {
        SceneLights::Own => own,
        SceneLights::Stage => {
            let lights = light_stage::scene_lights(&rules.stage, scene, &own);
            let quads: Vec<StageLight> = lights.into_iter().map(|named| named.light).collect();
            own.on_stage(&quads).unwrap()
        }
    };
    let predicted = read_scene(Path::new(submission), scene);
    let coats = predicted.materials.iter().map(|material| {
        material.as_ref().map(|material| Coat {
            base_colors: vec![material.base_color.clone()],
            roughness: material.roughness.clone(),
            metallic: material.metallic.clone(),
        })
    });
    let repaint = Repaint::new(&world, &atlases, coats.collect(), PrincipledFlavour::Blender).unwrap();
    let view = &scene.views[0];
    let valid = ViewTruth::read(&folder, view).unwrap().valid;
    let groups = LightGroups::apart(world.emitters().groups());
    let basis = |samples: u32, seed: u64| -> LightBasis {
        let settings = RenderSettings { samples, ..Default::default() };
        let light = Lighting::Apart(&groups);
        let quiet = |_: usize, _: usize| ();
        let done = render_repainted(&world, &repaint, 0..1, &[view.camera], light, &settings, &[seed], &quiet);
        done.unwrap().remove(0).views.remove(0).halves.remove(0).basis
    };
    let weights: Vec<[f64; 3]> = (0..world.emitters().groups()).map(planted).collect();
    println!("{} lights", weights.len());
    let photo = basis(64, 99);
    let photo_of_lights = photo.weighted(&weights).unwrap();
    for samples in [16, 32, 64] {
        let start = Instant::now();
        let basis = basis(samples, 7);
        let seconds = start.elapsed().as_secs_f64();
        let fit = fit_lights(&rules.fit, &basis, &photo_of_lights, Some(&valid)).unwrap();
        let (errors, shares) = (errors(&fit.weights, &weights), shares(&basis, &weights));
        println!(
            "basis {samples} ({seconds:.1} s): median {:.3}, by share of the photo's light {:.3}",
            median(&mut errors.clone()),
            errors.iter().zip(&shares).map(|(error, share)| error * share).sum::<f64>() / shares.iter().sum::<f64>(),
        );
        for light in 0..weights.len() {
            let share = (0..3).map(|c| shares[3 * light + c]).sum::<f64>() / shares.iter().sum::<f64>();
            let pair = [&basis, &photo].map(|basis| pooled(&rules.fit, &basis.pictures()[light], Some(&valid)));
            println!(
                "  light {light}: share {share:.3}, noise of its squares {:.4}, found {:.3?}, planted {:.3?}",
                noise(&pair[0][1], &pair[1][1]),
                fit.weights[light],
                weights[light],
            );
        }
    }
}

/// Root mean square of the difference of two pictures of squares, divided by the mean of the second.
fn noise(a: &[f64], b: &[f64]) -> f64 {
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / a.len() as f64).sqrt() / (b.iter().sum::<f64>() / b.len() as f64)
}

fn planted(light: usize) -> [f64; 3] {
    [0, 1, 2].map(|c| 0.5 + 3.0 * ((light * 7 + c * 5) % 11) as f64 / 10.0)
}

/// Values for every light and channel.
fn errors(found: &[[f64; 3]], planted: &[[f64; 3]]) -> Vec<f64> {
    found.iter().flatten().zip(planted.iter().flatten()).map(|(found, planted)| (found / planted - 1.0).abs()).collect()
}

/// The contribution of each light and channel to the photo.
fn shares(basis: &LightBasis, weights: &[[f64; 3]]) -> Vec<f64> {
    let sum = |at: usize, c: usize| {
        let pixels = basis.pictures()[at].pixels();
        weights[at][c] * pixels.iter().map(|pixel| f64::from(pixel.0[c])).sum::<f64>()
    };
    (0..weights.len()).flat_map(|at| [0, 1, 2].map(|c| sum(at, c))).collect()
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
