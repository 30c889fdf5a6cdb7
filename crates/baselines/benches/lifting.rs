//! Measures the steps of `baseline nn`, and compares its nearest-point search with scipy's cKDTree.
//!
//! `cargo bench -p mateval-baselines --bench lifting -- DATASET [PYTHON]` lifts the ground truth of every scene to
//! atlases of 1024 x 1024 texels and prints wall-clock seconds. With a Python that has scipy, the largest filling step
//! is done by both programs in turn.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark prints")]

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use glam::{DVec2, DVec3};
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::fill::{FillRule, SeenCloud};
use mateval_baselines::geometry::{SceneGeometry, SeenPoint};
use mateval_baselines::lift::{PartialAtlas, Texel, lift, place_of};
use mateval_baselines::maps::Maps;
use mateval_baselines::nn::{self, NnOptions, seen_pixels};
use mateval_dataset::TriangleMesh;
use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use rayon::prelude::*;

const SIZE: usize = 1024;
const ROUNDS: usize = 3;
const STAGES: [&str; 6] = ["geometry and estimate", "what pixels show", "lifting", "trees", "filling", "files"];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let Some(dataset) = words.first() else {
        println!("usage: cargo bench -p mateval-baselines --bench lifting -- DATASET");
        return;
    };
    let dataset = Dataset::open(&PathBuf::from(dataset)).unwrap();
    let mut largest: Option<Step> = None;
    for scene in &dataset.scenes {
        let mut whole = 0.0;
        timed(&mut whole, || whole_room(&dataset, scene));
        println!("{}: {whole:.2} s for {} instances; the steps one after the other:", scene.id, scene.instances.len());
        let (seconds, step) = room(&dataset, scene);
        STAGES.iter().zip(seconds).for_each(|(stage, seconds)| println!("  {seconds:>7.2} s {stage}"));
        largest = largest.into_iter().chain(step).max_by_key(|step| step.unseen());
    }
    match (words.get(1), largest) {
        (Some(python), Some(step)) => against_scipy(&step, Path::new(python)),
        _ => println!("SKIPPED: the comparison with scipy; expected a Python that has scipy"),
    }
}

/// The input of the filling step of one instance.
struct Step {
    points: Vec<SeenPoint>,
    known: PartialAtlas,
    mesh: TriangleMesh,
}

impl Step {
    fn unseen(&self) -> usize {
        self.known.texels.pixels().iter().filter(|texel| **texel == Texel::Unseen).count()
    }

    fn cloud(&self) -> SeenCloud {
        let numbered = self.points.iter().enumerate().map(|(at, point)| (*point, [at as f32; 5]));
        SeenCloud::new(FillRule::default(), numbered)
    }
}

fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let since = Instant::now();
    let made = work();
    *seconds += since.elapsed().as_secs_f64();
    made
}

/// Lifts a scene as `baseline nn` does.
fn whole_room(dataset: &Dataset, scene: &SceneFile) {
    let folder = tempfile::tempdir().unwrap();
    let options = NnOptions { atlas_size: Some(SIZE as u32), ..NnOptions::default() };
    nn::write_scene(dataset, scene, folder.path(), &EstimateSource::Truth, &options, &|_| ()).unwrap();
}

/// Seconds of each stage, and the filling step of the instance with the most unseen texels.
fn room(dataset: &Dataset, scene: &SceneFile) -> ([f64; 6], Option<Step>) {
    let mut seconds = [0.0; 6];
    let folder = tempfile::tempdir().unwrap();
    let (geometry, estimate) = timed(&mut seconds[0], || {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene).unwrap();
        (geometry, EstimateSource::Truth.read(dataset, scene, &|_| ()).unwrap())
    });
    let (seen, points) = timed(&mut seconds[1], || {
        let seen = seen_pixels(&geometry, &estimate).unwrap();
        let points = seen.points(&geometry);
        (seen, points)
    });
    let mut largest: Option<Step> = None;
    for instance in (0..scene.instances.len()).filter(|at| scene.instances[*at].atlas.is_some()) {
        let mut known = timed(&mut seconds[2], || lift(&geometry, &seen, &estimate, instance, SIZE));
        let own: Vec<SeenPoint> = points.iter().filter(|point| point.instance == instance).copied().collect();
        let with_values = |point: &SeenPoint| (*point, estimate.at(point.pixel.0, point.pixel.1));
        let cloud = timed(&mut seconds[3], || SeenCloud::new(FillRule::default(), own.iter().map(with_values)));
        let mesh = geometry.mesh(instance).clone();
        let step = Step { points: own, known: copy(&known), mesh };
        if !cloud.is_empty() && largest.as_ref().is_none_or(|largest| step.unseen() > largest.unseen()) {
            largest = Some(step);
        }
        timed(&mut seconds[4], || fill(&cloud, &mut known, geometry.mesh(instance)));
        if !cloud.is_empty() {
            let folder = folder.path().join(scene.instances[instance].id.as_str());
            timed(&mut seconds[5], || Maps::of_atlas(&known, estimate.given_maps()).write(&folder).unwrap());
        }
    }
    (seconds, largest)
}

fn fill(cloud: &SeenCloud, known: &mut PartialAtlas, mesh: &TriangleMesh) {
    let atlas = &known.atlas;
    let rows = known.texels.pixels_mut().par_chunks_mut(SIZE).enumerate();
    rows.for_each(|(y, row)| cloud.fill_row(atlas, mesh, y, row));
}

fn copy(known: &PartialAtlas) -> PartialAtlas {
    PartialAtlas { atlas: known.atlas.clone(), texels: known.texels.clone() }
}

/// Does the same step with both programs in turn; the script prints the largest difference of their distances.
fn against_scipy(step: &Step, python: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let unseen = places(step);
    write(&folder.path().join("points"), &step.points.iter().map(|point| point.place).collect::<Vec<_>>());
    write(&folder.path().join("queries"), &unseen.iter().map(|(_, place)| *place).collect::<Vec<_>>());
    println!("one instance: {} points, {} unseen texels", step.points.len(), unseen.len());
    for _ in 0..ROUNDS {
        let (mut build, mut query) = (0.0, 0.0);
        let cloud = timed(&mut build, || step.cloud());
        let mut known = copy(&step.known);
        timed(&mut query, || fill(&cloud, &mut known, &step.mesh));
        let number = |texel: Texel| match texel {
            Texel::Seen(values) => values[0] as usize,
            Texel::Unused | Texel::Unseen => panic!("an unseen texel was not filled"),
        };
        let found = unseen
            .iter()
            .map(|(at, place)| DVec3::splat(step.points[number(known.texels.pixels()[*at])].place.distance(*place)));
        write(&folder.path().join("distances"), &found.collect::<Vec<_>>());
        println!("  ours:  {build:.3} s for the tree, {query:.3} s for all texels");
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/scipy_tree.py");
        let done = Command::new(python).arg(script).arg(folder.path()).output().unwrap();
        print!("{}{}", String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    }
}

/// The unseen texels of a step and the places of their centres.
fn places(step: &Step) -> Vec<(usize, DVec3)> {
    let of_texel = |at: usize| {
        let (x, y) = (at % SIZE, at / SIZE);
        let (triangle, _) = step.known.atlas.owner(x, y)?;
        let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let unseen = step.known.texels.get(x, y) == Texel::Unseen;
        unseen.then(|| (at, place_of(&step.known.atlas, &step.mesh, triangle, centre)))
    };
    (0..SIZE * SIZE).filter_map(of_texel).collect()
}

/// Writes three 64-bit floats per place.
fn write(path: &Path, places: &[DVec3]) {
    let mut file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
    places.iter().flat_map(|place| place.to_array()).for_each(|v| file.write_all(&v.to_le_bytes()).unwrap());
}
