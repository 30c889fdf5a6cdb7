//! The room of the sample, rendered many times in quarters, with its own materials and with others to be compared with
//! them.
//!
//! All materials are rendered with every seed. Seeds form pairs: a prediction is compared with the truth of the other
//! seed of its pair, so that they share no noise, and pairs are independent of each other.

use std::ops::Range;
use std::sync::{Arc, LazyLock};

use mateval_eval::material_pictures::material_pictures;
use mateval_eval::noise_blocks::noise_blocks;
use mateval_eval::rgb::encode_noisy;
use mateval_eval::shown_render::{ViewGuide, shown_render};
use mateval_eval::truth::ViewTruth;
use mateval_image::{LinearRgb, Mask, Normal, Picture, SrgbRgb, Texels, Texture};
use mateval_metrics::{Halves, NoisyHalf, NoisyRender};
use mateval_scene::{Camera, Intrinsics, TriangleMesh, glb, reference_io};
use mateval_submission::atlas_meshes::AtlasMeshes;
use mateval_submission::prediction::{PredictedMaterial, read_scene};
use mateval_tracer::noise_filter::Surfaces;
use mateval_tracer::{Coat, LightGroups, Lighting, Repaint, ViewLight, World, render_repainted};

use super::sample::{dataset, hasty, write_truth};
use mateval_testkit::kept_folder::kept_folder;

/// The number of renders of everything.
pub const SEEDS: usize = 40;

/// The truth comes first, then the predictions: one far from it (about 18 dB) and one near (about 35 dB).
pub const OTHERS: [usize; 2] = [1, 2];

/// Factors of the truth's base colours.
const FACTORS: [[f32; 3]; 3] = [[1.0; 3], [0.6, 0.7, 0.8], [0.97, 0.95, 0.93]];

/// Samples a pixel of each half of the pictures that count as free of noise.
const MANY: u32 = 1024;

/// Size relative to the sample's pictures, so that thousands of samples take seconds.
const SCALE: f64 = 0.75;

/// The input view and two more.
const VIEWS: usize = 3;

/// Two independent renders of one view.
pub type Pair = [Picture<LinearRgb>; 2];

/// Four independent renders of one view: the quarters of two halves.
pub type Quarters = [Picture<LinearRgb>; 4];

/// The room under its own lights.
pub struct Room {
    cameras: Vec<Camera>,
    /// By view.
    pub valid: Vec<Mask>,
    /// By view.
    pub blocks: Vec<Picture<u32>>,
    world: World,
    repaint: Repaint,
    /// The true base colours of the input view.
    base_color: Picture<LinearRgb>,
    instances: Picture<u16>,
    normals: Picture<Normal>,
}

/// Renders of one number of samples.
pub struct Level {
    /// A pixel of each half.
    pub samples: u32,
    /// By prediction (the truth is the first), view and seed.
    pub renders: Vec<Vec<Vec<Quarters>>>,
}

pub static ROOM: LazyLock<Room> = LazyLock::new(Room::new);

/// 4, 16 and 64 samples.
pub static LEVELS: LazyLock<[Level; 3]> = LazyLock::new(|| [4, 16, 64].map(|samples| ROOM.level(samples)));

/// By prediction and view, with 2048 samples together. All predictions share one set of paths, so that their
/// differences have even less noise.
pub static EXACT: LazyLock<Vec<Vec<Quarters>>> = LazyLock::new(|| {
    let all = ROOM.pictures(0..FACTORS.len(), MANY / 2, 0..4);
    all.into_iter().map(|views| views.into_iter().map(|view| in_fours(view).remove(0)).collect()).collect()
});

impl Room {
    fn new() -> Self {
        let scene = dataset().scenes.iter().find(|scene| scene.id.as_str() == "room").unwrap();
        assert_eq!(scene.exposure, 1.0, "pictures are compared as they are");
        let folder = dataset().folder(&scene.id);
        let submission = kept_folder("noise").join("gt");
        write_truth(&submission);
        let world = World::new(Arc::new(reference_io::read(&folder).unwrap())).unwrap();
        let nodes = glb::read(&folder.instances()).unwrap();
        let atlases: Vec<TriangleMesh> = nodes.into_iter().map(|node| node.mesh).collect();
        let predicted = read_scene(&submission, scene, &AtlasMeshes::in_memory(&atlases)).unwrap();
        let coats = predicted.materials.iter().map(|material| material.as_ref().map(coat)).collect();
        let repaint = Repaint::new(&world, &atlases, coats, hasty().light.flavour).unwrap();
        let views = &scene.views[..VIEWS];
        let cameras: Vec<Camera> = views.iter().map(|view| smaller(&view.camera)).collect();
        let valid = views.iter().zip(&cameras).map(|(view, camera)| {
            let valid = ViewTruth::read(&folder, view).unwrap().valid;
            let place = |at: usize| ((at as f64 + 0.5) / SCALE) as usize;
            let k = camera.intrinsics;
            Mask::from_fn(k.width as usize, k.height as usize, |x, y| valid.get(place(x), place(y)))
        });
        let valid = valid.collect();
        let blocks = noise_blocks(&hasty().light.noise, &cameras);
        let base_color =
            material_pictures(&world, &atlases, &cameras[0], std::slice::from_ref(&predicted)).remove(0).base_color;
        let (truth, k) = (ViewTruth::read(&folder, &views[0]).unwrap(), cameras[0].intrinsics);
        let place = |at: usize| ((at as f64 + 0.5) / SCALE) as usize;
        let (width, height) = (k.width as usize, k.height as usize);
        let instances = Picture::from_fn(width, height, |x, y| truth.instances.get(place(x), place(y)));
        let normals = Picture::from_fn(width, height, |x, y| truth.normals.get(place(x), place(y)));
        Self { cameras, valid, blocks, world, repaint, base_color, instances, normals }
    }

    /// The input view of a prediction as it is shown, from its halves and the truth without noise.
    pub fn shown(&self, other: usize, halves: &Pair, truth: &Picture<LinearRgb>) -> Picture<LinearRgb> {
        let factor = FACTORS[other];
        let scaled = |LinearRgb(rgb): LinearRgb| LinearRgb([0, 1, 2].map(|c| rgb[c] * factor[c]));
        let base_color = self.base_color.map(scaled);
        let ratio = self.base_color.map(|_| LinearRgb(factor));
        let (instances, normals, valid) = (&self.instances, &self.normals, &self.valid[0]);
        let surfaces = Surfaces { base_color: &base_color, instances, normals, valid };
        shown_render([&halves[0], &halves[1]], &ViewGuide { truth, ratio: &ratio, surfaces })
    }

    /// The pictures of every seed, by prediction and view; one bounce gives enough noise.
    fn pictures(&self, which: Range<usize>, samples: u32, seeds: Range<u64>) -> Vec<Vec<Vec<Picture<LinearRgb>>>> {
        let mut settings = hasty().light.settings(samples);
        settings.max_bounces = 1;
        let seeds: Vec<u64> = seeds.map(|seed| (u64::from(samples) << 32) + seed).collect();
        let groups = LightGroups::together(self.world.emitters().groups());
        let (lighting, quiet) = (Lighting::Apart(&groups), |_: usize, _: usize| ());
        let done =
            render_repainted(&self.world, &self.repaint, which, &self.cameras, lighting, &settings, &seeds, &quiet);
        let view = |view: ViewLight| view.halves.into_iter().map(|half| half.basis.sum()).collect::<Vec<_>>();
        done.unwrap().into_iter().map(|render| render.views.into_iter().map(view).collect()).collect()
    }

    fn level(&self, samples: u32) -> Level {
        let all = self.pictures(0..FACTORS.len(), samples / 2, 0..4 * SEEDS as u64);
        Level { samples, renders: all.into_iter().map(|views| views.into_iter().map(in_fours).collect()).collect() }
    }
}

impl Level {
    /// A prediction of one seed and the truth of another, seed by seed.
    pub fn against(&self, other: usize, view: usize) -> impl Iterator<Item = (&Quarters, Pair)> {
        let truths = &self.renders[0][view];
        self.renders[other][view].iter().enumerate().map(|(seed, quarters)| (quarters, pair(&truths[seed ^ 1])))
    }
}

fn smaller(camera: &Camera) -> Camera {
    let k = camera.intrinsics;
    let side = |pixels: u32| (f64::from(pixels) * SCALE) as u32;
    let (width, height, [fx, fy, cx, cy]) =
        (side(k.width), side(k.height), [k.fx, k.fy, k.cx, k.cy].map(|v| v * SCALE));
    Camera { intrinsics: Intrinsics { width, height, fx, fy, cx, cy }, ..*camera }
}

fn coat(material: &PredictedMaterial) -> Coat {
    Coat {
        base_colors: FACTORS.map(|factor| scaled(&material.base_color, factor)).to_vec(),
        roughness: material.roughness.clone(),
        metallic: material.metallic.clone(),
    }
}

fn scaled(texture: &Texture, factor: [f32; 3]) -> Texture {
    let (width, height) = (texture.width(), texture.height());
    let scaled = |texel: [f32; 3]| [0, 1, 2].map(|c| texel[c] * factor[c]);
    let texels = (0..width * height).map(|at| scaled(texture.texel(at % width, at / width))).collect();
    Texture::new(width, height, Texels::Linear(texels), texture.wrap()).unwrap()
}

fn in_fours(pictures: Vec<Picture<LinearRgb>>) -> Vec<Quarters> {
    pictures.chunks(4).map(|four| [0, 1, 2, 3].map(|k| four[k].clone())).collect()
}

/// The two halves of four quarters.
pub fn pair(quarters: &Quarters) -> Pair {
    let [a1, a2, b1, b2] = quarters;
    [mean_of(&[a1.clone(), a2.clone()]), mean_of(&[b1.clone(), b2.clone()])]
}

/// The halves as metrics take them.
pub fn halves<P>(pair: &[Picture<P>; 2]) -> Halves<'_, P> {
    Halves { a: &pair[0], b: &pair[1] }
}

/// The quarters, encoded as scores are.
pub fn encoded(quarters: &Quarters) -> NoisyRender<SrgbRgb> {
    let [a1, a2, b1, b2] = quarters;
    let half = |quarters| NoisyHalf::encoded(quarters, encode_noisy).unwrap();
    NoisyRender { a: half([a1, a2]), b: half([b1, b2]), shared: None }
}

/// The quarters in linear light.
pub fn linear(quarters: &Quarters) -> NoisyRender<LinearRgb> {
    let half = |first: &Picture<LinearRgb>, second: &Picture<LinearRgb>| {
        let combined = |sign: f32| {
            Picture::from_fn(first.width(), first.height(), |x, y| {
                let (LinearRgb(a), LinearRgb(b)) = (first.get(x, y), second.get(x, y));
                LinearRgb([0, 1, 2].map(|c| 0.5 * (a[c] + sign * b[c])))
            })
        };
        NoisyHalf { estimate: combined(1.0), noise: combined(-1.0) }
    };
    let [a1, a2, b1, b2] = quarters;
    NoisyRender { a: half(a1, a2), b: half(b1, b2), shared: None }
}

/// The mean of both halves.
pub fn mean_of(pair: &Pair) -> Picture<LinearRgb> {
    Picture::from_fn(pair[0].width(), pair[0].height(), |x, y| {
        let [LinearRgb(a), LinearRgb(b)] = [0, 1].map(|half| pair[half].get(x, y));
        LinearRgb([0, 1, 2].map(|c| 0.5 * (a[c] + b[c])))
    })
}
