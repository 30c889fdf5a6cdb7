//! Measures the cost of rendering eight submissions together and separately: submissions that differ only in base
//! colour share the same paths. It also measures the cost of five additional lightings: track `relit` consists of sums
//! over the same paths.
//!
//! `cargo bench --workspace --bench sharing -- DATASET SCENE SUBMISSION [SAMPLES [lightings]]`. The eight are the
//! submission's own maps, each with its own copy of the textures, so that none benefits from another's in the caches.
//! Runs alternate; only tracing is measured, in CPU seconds of all threads. With `lightings` after SAMPLES the eight
//! are left out.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a bench prints

use std::path::Path;
use std::sync::Arc;

use cpu_time::ProcessTime;
use mateval_image::Texture;
use mateval_scene::layout::SceneFolder;
use mateval_scene::material::PrincipledFlavour;
use mateval_scene::{Camera, SceneId, glb, open::Dataset, reference_io};
use mateval_submission::atlas_meshes::AtlasMeshes;
use mateval_submission::prediction::read_scene;
use mateval_tracer::{Coat, LightGroups, Lighting, RenderSettings, Repaint, World, render_repainted};

const SUBMISSIONS: usize = 8;
const RUNS: usize = 3;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let [dataset, scene, submission, rest @ ..] = words.as_slice() else {
        println!("give DATASET SCENE SUBMISSION [SAMPLES [lightings]]");
        return;
    };
    let samples = rest.first().map_or(16, |samples| samples.parse().unwrap());
    let dataset = Dataset::open(Path::new(dataset)).unwrap();
    let id = SceneId::new(scene).unwrap();
    let scene = dataset.scenes.iter().find(|scene| scene.id == id).unwrap();
    let folder: SceneFolder = dataset.folder(&id);
    let world = World::new(Arc::new(reference_io::read(&folder).unwrap())).unwrap();
    let atlases: Vec<_> = glb::read(&folder.instances()).unwrap().into_iter().map(|node| node.mesh).collect();
    let predicted = read_scene(Path::new(submission), scene, &AtlasMeshes::in_memory(&atlases)).unwrap();
    let coats = |count: usize| {
        let coat = |material: &mateval_submission::prediction::PredictedMaterial| Coat {
            base_colors: (0..count).map(|_| copied(&material.base_color)).collect(),
            roughness: material.roughness.clone(),
            metallic: material.metallic.clone(),
        };
        predicted.materials.iter().map(|material| material.as_ref().map(coat)).collect()
    };
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let groups = LightGroups::together(world.emitters().groups());
    let settings = RenderSettings { samples, ..Default::default() };
    let repaint = Repaint::new(&world, &atlases, coats(SUBMISSIONS), PrincipledFlavour::Blender).unwrap();
    let trace = |which: std::ops::Range<usize>| {
        let start = ProcessTime::now();
        let lighting = Lighting::Apart(&groups);
        render_repainted(&world, &repaint, which, &cameras, lighting, &settings, &[1, 2], &|_, _| ()).unwrap();
        start.elapsed().as_secs_f64()
    };
    let lights = world.emitters().groups();
    let mixed = |pictures: usize| {
        let start = ProcessTime::now();
        let mixes = vec![vec![vec![[0.7; 3]; lights]; pictures]; SUBMISSIONS];
        let lighting = Lighting::Mixed(&mixes);
        render_repainted(&world, &repaint, 0..1, &cameras, lighting, &settings, &[1, 2], &|_, _| ()).unwrap();
        start.elapsed().as_secs_f64()
    };
    let (mut together, mut apart, mut one, mut six) = (0.0, 0.0, 0.0, 0.0);
    let lightings_alone = rest.get(1).is_some_and(|word| word == "lightings");
    for _ in 0..RUNS {
        if !lightings_alone {
            together += trace(0..SUBMISSIONS);
            apart += (0..SUBMISSIONS).map(|one| trace(one..one + 1)).sum::<f64>();
        }
        one += mixed(1);
        six += mixed(6);
    }
    println!("CPU: one lighting {:.2} s, six {:.2} s: {:.3}", one / RUNS as f64, six / RUNS as f64, six / one);
    if lightings_alone {
        return;
    }
    println!("{SUBMISSIONS} together {:.2} s, apart {:.2} s", together / RUNS as f64, apart / RUNS as f64);
    println!("together over apart: {:.3}", together / apart);
}

/// A copy of the texels in other memory.
fn copied(texture: &Texture) -> Texture {
    Texture::new(texture.width(), texture.height(), texture.texels().clone(), texture.wrap()).unwrap()
}
