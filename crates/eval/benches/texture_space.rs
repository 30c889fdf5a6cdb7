//! Measures the cost of the comparison in texture space, scene by scene:
//! `cargo bench --workspace --bench texture_space -- DATASET SUBMISSION...`.
#![allow(clippy::print_stdout, clippy::unwrap_used)] // a table, of files that the caller names

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use mateval_eval::texture_space::{InstanceTexels, TexelSums, compare, texture_space};
use mateval_eval::truth_material::TruthMaterial;
use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::open::Dataset;
use mateval_scene::reference::SurfaceIndex;
use mateval_scene::submission::Map;
use mateval_scene::{TriangleMesh, glb, reference_io};
use mateval_submission::atlas_meshes::AtlasMeshes;
use mateval_submission::prediction::read_scene;
use mateval_submission::texel_map::TexelMap;
use mateval_tracer::World;

fn main() {
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).filter(|word| word != "--bench").map(PathBuf::from).collect();
    let Some((root, submissions)) = paths.split_first() else {
        println!("no dataset named: nothing measured");
        return;
    };
    let dataset = Dataset::open(root).unwrap();
    for scene in &dataset.scenes {
        bench_scene(&dataset.folder(&scene.id), scene, submissions);
    }
}

fn bench_scene(folder: &SceneFolder, scene: &SceneFile, submissions: &[PathBuf]) {
    let world = World::new(Arc::new(reference_io::read(folder).unwrap())).unwrap();
    let atlases: Vec<TriangleMesh> =
        glb::read(&folder.instances()).unwrap().into_iter().map(|node| node.mesh).collect();
    let start = Instant::now();
    let meshes = AtlasMeshes::in_memory(&atlases);
    let predictions: Vec<_> = submissions.iter().map(|path| read_scene(path, scene, &meshes).unwrap()).collect();
    let read_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let compared = texture_space(folder, scene, &world, &atlases, &predictions, &|_| ()).unwrap();
    let all_s = start.elapsed().as_secs_f64();
    println!("{}: {all_s:.2} s for {} submissions, after {read_s:.2} s of reading them", scene.id, submissions.len());
    print_steps(folder, scene, &world, &atlases, &predictions);
    for (path, instances) in submissions.iter().zip(&compared) {
        print_sums(path, instances);
    }
}

/// Seconds of each step, one instance after the other.
fn print_steps(
    folder: &SceneFolder,
    scene: &SceneFile,
    world: &World,
    atlases: &[TriangleMesh],
    predictions: &[mateval_submission::prediction::PredictedScene],
) {
    let camera = &scene.view(INPUT).unwrap().camera;
    let (mut map_s, mut truth_s, mut compare_s) = (0.0, 0.0, 0.0);
    let (mut texels, mut off_centre, mut surface_m2, mut texel_m2) = (0_usize, 0_usize, 0.0, 0.0);
    for (at, instance) in scene.instances.iter().enumerate() {
        let Some(atlas) = &instance.atlas else { continue };
        let size = atlas.size as usize;
        let start = Instant::now();
        let map = TexelMap::new(world, SurfaceIndex(at), &atlases[at], size, camera);
        map_s += start.elapsed().as_secs_f64();
        let start = Instant::now();
        let truth = TruthMaterial::read(folder, &instance.id, size).unwrap();
        truth_s += start.elapsed().as_secs_f64();
        let start = Instant::now();
        for prediction in predictions {
            compare(&map, prediction.materials[at].as_ref().unwrap(), &truth);
        }
        compare_s += start.elapsed().as_secs_f64();
        surface_m2 += atlases[at].area();
        for texel in (0..size).flat_map(|y| map.row(y)) {
            texels += 1;
            texel_m2 += texel.area_m2;
            off_centre += usize::from(texel.off_centre.is_some());
        }
    }
    println!("  texel maps {map_s:.2} s, truth {truth_s:.2} s, compared {compare_s:.2} s");
    let [texels, off_centre] = [texels, off_centre].map(|count| count as f64 / 1e6);
    println!("  {texels:.2} million texels ({off_centre:.2} off centre) of {texel_m2:.3} m^2, on {surface_m2:.3} m^2");
}

fn print_sums(path: &std::path::Path, instances: &[InstanceTexels]) {
    for (word, part) in [("observed", 0), ("unobserved", 1)] {
        let mut sum = TexelSums::default();
        instances.iter().for_each(|texels| sum.add([&texels.observed, &texels.unobserved][part]));
        let db = Map::ALL.map(|map| sum.psnr(map).unwrap().map_or(f64::NAN, |psnr| psnr.db));
        println!("  {} {word}: {:.3} m^2, PSNR {db:.2?}", path.display(), sum.area_m2);
    }
}
