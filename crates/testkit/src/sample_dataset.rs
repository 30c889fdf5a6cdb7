//! The built-in sample as a tiny dataset with renders, and submissions for it.

use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

pub use mateval_baselines::bounds;
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::nn::{self, NnOptions};
use mateval_baselines::submission;
use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::reference::SurfaceIndex;
use mateval_dataset::submission::Map;
use mateval_dataset::{glb, reference};
use mateval_eval::light::reference::{ReferenceOptions, make_references};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{LinearRgb, Picture, Wrap, png_io};
use mateval_prep::build::finish::finish_again;
use mateval_prep::build::{BuildOptions, build};
use mateval_prep::render::{RenderOptions, render};
use mateval_submission::texel_map::TexelMap;
use mateval_tracer::World;

use crate::{copy_folder, kept_folder, want_twins};

/// In the recipe that the sample comes with: both sources. `room` keeps its own emitters in every track, `living` is
/// fitted by a light stage.
const HEAD: [&str; 2] = ["resolution = [320, 240]\n", "resolution = [64, 48]\natlas_size = 128\nsamples = 64\n"];

static DATASET: LazyLock<Dataset> = LazyLock::new(|| {
    let out = built();
    render(&out, &RenderOptions::default(), &|_| ()).unwrap();
    add_references(&out, 32);
    Dataset::open(&out).unwrap()
});

static PHOTOS: LazyLock<Dataset> = LazyLock::new(|| {
    let out = built_with_input_views();
    render(&out, &RenderOptions::default(), &|_| ()).unwrap();
    Dataset::open(&out).unwrap()
});

static HOUSES: LazyLock<Dataset> = LazyLock::new(|| {
    let source = kept_folder("houses").join("source");
    mateval_sample::write_houses(&source, 2, 0).unwrap();
    let out = build_source(&source, "views = []\n");
    render(&out, &RenderOptions { samples: Some(16), ..RenderOptions::default() }, &|_| ()).unwrap();
    Dataset::open(&out).unwrap()
});

static TWINS: LazyLock<Dataset> = LazyLock::new(|| {
    let root = kept_folder("twins").join("dataset");
    copy_folder(&dataset().root, &root);
    // The scenes are rendered: a recipe that asks for twins needs no more than to be finished again.
    want_twins(&root, "\"warm_cool\", \"alone_1\", \"alone_2\"");
    finish_again(&root, &|_| ()).unwrap();
    Dataset::open(&root).unwrap().with_twins()
});

/// The dataset with three twins of each scene, listed among the scenes; tests must not write to it.
pub fn twins() -> &'static Dataset {
    &TWINS
}

/// Two rooms of two other houses, which have input views alone, with photos of 16 samples a half. Tests must not write
/// to it.
pub fn houses() -> &'static Dataset {
    &HOUSES
}

/// Renders the scorer's references of a dataset.
pub fn add_references(root: &Path, samples: u32) {
    let options = ReferenceOptions { samples, scenes: Vec::new(), force: false };
    make_references(root, &options, &|_| ()).unwrap();
    finish_again(root, &|_| ()).unwrap();
}

/// Builds the dataset without renders.
pub fn built() -> PathBuf {
    build_in("dataset", "")
}

/// Builds the dataset without renders and with the input views alone.
pub fn built_with_input_views() -> PathBuf {
    build_in("input_views", "views = []\n")
}

/// Builds the dataset without renders and with one view from another place in each scene.
pub fn built_with_wide_views() -> PathBuf {
    build_in("wide_dataset", "wide = { count = 1, distance_m = [0.3, 0.3] }\n")
}

/// Builds the dataset in a kept folder of this name, with another line in the recipe.
fn build_in(name: &str, line: &str) -> PathBuf {
    let source = kept_folder(name).join("source");
    mateval_sample::write(&source).unwrap();
    build_source(&source, line)
}

/// Builds the dataset of a source's recipe, with another line in it, beside the source.
fn build_source(source: &Path, line: &str) -> PathBuf {
    let (recipe, out) = (source.join("recipe.toml"), source.with_file_name("dataset"));
    let whole = std::fs::read_to_string(&recipe).unwrap();
    assert!(whole.contains(HEAD[0]), "{whole}");
    std::fs::write(&recipe, whole.replace(HEAD[0], &format!("{}{line}", HEAD[1]))).unwrap();
    let options = BuildOptions {
        recipe,
        source: None,
        out: out.clone(),
        scenes: Vec::new(),
        force: false,
        blender: None,
        atlas_cache: None,
    };
    build(&options, "test", &|_| ()).unwrap();
    out
}

/// The dataset, with renders of 64 samples a half; tests must not write to it.
pub fn dataset() -> &'static Dataset {
    &DATASET
}

/// The dataset with the same photos, but without other views and without the scorer's references: enough for what looks
/// at photos and computes no score; tests must not write to it.
pub fn photos() -> &'static Dataset {
    &PHOTOS
}

/// Writes the submission `gt`.
pub fn write_truth(out: &Path) {
    bounds::write_truth(dataset(), out, false).unwrap();
}

/// Writes the baseline `grey`, whose roughness is the default.
pub fn write_grey(out: &Path) {
    bounds::write_grey(dataset(), out, false).unwrap();
}

/// Writes the truth of each photo lifted to the atlases of [`photos`], the rest by nearest neighbours.
pub fn write_nearest(out: &Path) {
    write_lifted(out, &EstimateSource::Truth);
}

/// Writes each photo itself, lifted to the atlases of [`photos`].
pub fn write_from_photo(out: &Path) {
    write_lifted(out, &EstimateSource::Input);
}

fn write_lifted(out: &Path, source: &EstimateSource) {
    nn::write(photos(), out, false, source, &NnOptions::default(), &|_| ()).unwrap();
}

/// Makes the base colour of a scene's atlases black where the input view of [`photos`] does not show them.
pub fn blacken_unobserved(scene: &SceneFile, folder: &Path) {
    let source = photos().folder(&scene.id);
    let world = World::new(Arc::new(reference::read(&source).unwrap())).unwrap();
    for (at, node) in glb::read(&source.instances()).unwrap().into_iter().enumerate() {
        let path = folder.join(&node.name).join("base_color.png");
        if !path.is_file() {
            continue;
        }
        let colors = png_io::read_rgb_bytes(&path).unwrap();
        let map = TexelMap::new(&world, SurfaceIndex(at), &node.mesh, colors.width(), &scene.views[0].camera);
        let mut filled = Picture::filled(colors.width(), colors.height(), [0; 3]);
        for y in 0..colors.height() {
            for texel in map.row(y).filter(|texel| texel.observed) {
                filled.set(texel.column, y, colors.get(texel.column, y));
            }
        }
        png_io::write_rgb_bytes(&path, &filled).unwrap();
    }
}

/// Writes `gt` with the base colour of every atlas (linear) changed.
pub fn write_changed(out: &Path, change: impl Fn(&Picture<LinearRgb>) -> Picture<LinearRgb>) {
    let method = submission::Method::new("changed", "");
    submission::write(dataset(), out, false, &method, |scene, instance, folder| {
        let truth = dataset().folder(&scene.id).truth_material(&instance.id);
        let file = |map: Map| Path::new(map.stem()).with_extension("png");
        for map in [Map::Roughness, Map::Metallic] {
            std::fs::copy(truth.join(file(map)), folder.join(file(map))).unwrap();
        }
        let texture = read_texture(&truth.join(file(Map::BaseColor)), Encoding::Srgb, Wrap::Clamp).unwrap();
        let texel = |x: usize, y: usize| LinearRgb(texture.texel(x, y));
        let changed = change(&Picture::from_fn(texture.width(), texture.height(), texel));
        let bytes = changed.map(|LinearRgb(rgb)| rgb.map(|v| byte_from_unit(srgb_from_linear(v))));
        png_io::write_rgb_bytes(&folder.join(file(Map::BaseColor)), &bytes).unwrap();
        Ok(())
    })
    .unwrap();
}
