//! Track `relit`: weights follow the rule, and the truth agrees with a render under lights of those radiances.

use std::sync::Arc;

use mateval_eval::relit::{RelitLighting, light_of, lightings};
use mateval_eval::truth::{RgbTruth, TrueLight, ViewTruth};
use mateval_image::{LinearRgb, Picture};
use mateval_scene::RendererId;
use mateval_scene::dataset::SceneFile;
use mateval_scene::reference::{Emission, ReferenceScene};
use mateval_scene::reference_io;
use mateval_tracer::{LightGroups, RenderSettings, World, render_views};

use super::sample::{dataset, hasty};

fn renderer() -> RendererId {
    RendererId::new("builtin").unwrap()
}

/// For a scene of the sample, the truth's input view under each group alone, and the lightings.
fn groups_and_lightings(scene: &SceneFile) -> (Vec<Picture<LinearRgb>>, Vec<RelitLighting>) {
    let folder = dataset().folder(&scene.id);
    let count = reference_io::read(&folder).unwrap().lights.len();
    let view = &scene.views[0];
    let group = |group| RgbTruth::shown_of_group(&folder, &renderer(), view, group).unwrap();
    let groups: Vec<_> = (0..count).map(group).collect();
    let valid = ViewTruth::read(&folder, view).unwrap().valid;
    let light: Vec<[f64; 3]> = groups.iter().map(|picture| light_of(picture, &valid)).collect();
    let lightings = lightings(&hasty().light.relit, &light);
    (groups, lightings)
}

/// Groups alternate in the order of their summed luminance over valid pixels; alone_1 is the brightest; those under 5 % of
/// the light take no turn.
#[test]
fn weights_follow_the_rule() {
    let rules = hasty().light.relit;
    for (id, groups) in [("living", 4), ("room", 3)] {
        let scene = dataset().scenes.iter().find(|scene| scene.id.as_str() == id).unwrap();
        let (pictures, lightings) = groups_and_lightings(scene);
        assert_eq!(pictures.len(), groups);
        let light = luminances(scene, &pictures);
        let mut order: Vec<usize> = (0..groups).filter(|&k| light[k] > 0.05 * light.iter().sum::<f64>()).collect();
        order.sort_by(|a, b| light[*b].total_cmp(&light[*a]));
        assert!(order.len() >= 2, "{id}: {light:?}");
        let names: Vec<String> = lightings.iter().map(|lighting| lighting.name.to_string()).collect();
        let alone = (1..=order.len().min(3)).map(|place| format!("alone_{place}"));
        assert_eq!(names, std::iter::once("warm_cool".to_owned()).chain(alone).collect::<Vec<_>>(), "{id}");
        // Exposure scales all weights of a lighting alike.
        let scale = lightings[0].weights[order[0]][0] / rules.warm[0];
        for (place, group) in order.iter().copied().enumerate() {
            let turn = if place % 2 == 0 { rules.warm } else { rules.cool };
            for (weight, expected) in lightings[0].weights[group].iter().zip(turn) {
                assert!((weight / scale - expected).abs() < 1e-12, "{id}, group {group}");
            }
        }
        for (place, group) in order.into_iter().enumerate().take(3) {
            let weights = &lightings[1 + place].weights;
            let lit: Vec<usize> = (0..groups).filter(|&k| weights[k] != [0.0; 3]).collect();
            assert_eq!(lit, [group], "{id}, place {place}");
            assert!((weights[group][1] - light.iter().sum::<f64>() / light[group]).abs() < 1e-6, "{id}: {weights:?}");
        }
    }
}

/// The luminance (Rec. 709) of valid pixels under each group.
fn luminances(scene: &SceneFile, groups: &[Picture<LinearRgb>]) -> Vec<f64> {
    let valid = ViewTruth::read(&dataset().folder(&scene.id), &scene.views[0]).unwrap().valid;
    let luminance = |picture: &Picture<LinearRgb>| -> f64 {
        let lit = picture.pixels().iter().zip(valid.pixels()).filter(|(_, valid)| **valid);
        lit.map(|(pixel, _)| pixel.luminance()).sum()
    };
    groups.iter().map(luminance).collect()
}

/// Scene, lighting and, for the twin, another lighting.
const CASES: [[&str; 3]; 3] =
    [["living", "warm_cool", "alone_1"], ["living", "alone_2", "alone_1"], ["room", "alone_2", "alone_1"]];

/// Compares pixels, tiles and the whole picture. The mean of t squared would be 8 / 6 for Gaussian noise; it is smaller
/// for tiles, which share paths, and because both renders are stratified.
#[test]
fn a_weighted_sum_is_a_render_under_those_lights() {
    for [id, name, other] in CASES {
        let scene = dataset().scenes.iter().find(|scene| scene.id.as_str() == id).unwrap();
        let (_, lightings) = groups_and_lightings(scene);
        let named = |name: &str| lightings.iter().find(|lighting| lighting.name.to_string() == name).unwrap();
        let fresh = fresh(scene, &lit(scene, named(name)).unwrap());
        let [pixels, tiles, whole] = compare(scene, named(name), &fresh);
        assert!(pixels < 1.7 && tiles < 2.0 && whole < 9.0, "{id} {name}: {pixels} {tiles} {whole}");
        let [pixels, tiles, whole] = compare(scene, named(other), &fresh);
        assert!(pixels > 10.0 && tiles > 100.0 && whole > 100.0, "the twin passes: {id} {pixels} {tiles} {whole}");
    }
}

/// The scene with its emitters' radiances multiplied by a lighting's weights; none where the scene cannot represent
/// this, because an environment map has one factor for all channels.
fn lit(scene: &SceneFile, lighting: &RelitLighting) -> Option<World> {
    let mut reference: ReferenceScene = reference_io::read(&dataset().folder(&scene.id)).unwrap();
    for (group, weight) in reference.lights.iter_mut().zip(&lighting.weights) {
        let weight = weight.map(|w| w as f32);
        match &mut group.emission {
            Emission::Area { radiance, .. } | Emission::Constant { radiance } => {
                *radiance = [0, 1, 2].map(|c| radiance[c] * weight[c]);
            }
            Emission::Environment { scale, .. } if weight == [weight[0]; 3] => *scale *= weight[0],
            Emission::Environment { .. } => return None,
        }
    }
    Some(World::new(Arc::new(reference)).unwrap())
}

const FRESH: usize = 8;

/// Means of Student's t squared over pixels and over tiles of 8 x 8, and t of the whole picture: between the truth
/// under a lighting (two halves) and fresh renders of `world` of as many samples as a half has. One variance is taken
/// for both, with 8 degrees of freedom, so that t squared has the mean 8 / 6.
fn compare(scene: &SceneFile, lighting: &RelitLighting, fresh: &[Picture<LinearRgb>]) -> [f64; 3] {
    let (view, folder) = (&scene.views[0], dataset().folder(&scene.id));
    let truth = TrueLight::relit(&folder, &renderer(), view, std::slice::from_ref(lighting), 1.0).unwrap().remove(0);
    [1, 8, 64].map(|side| {
        let of = |all: &[Picture<LinearRgb>]| all.iter().map(|picture| tiles(picture, side)).collect::<Vec<_>>();
        let (halves, fresh) = (of(&truth.halves()), of(fresh));
        let column = |all: &[Vec<f64>], at: usize| all.iter().map(|values| values[at]).collect::<Vec<_>>();
        let t = |at: usize| students_t(&column(&halves, at), &column(&fresh, at));
        let ts: Vec<f64> = (0..fresh[0].len()).filter_map(t).collect();
        ts.iter().map(|t| t * t).sum::<f64>() / ts.len() as f64
    })
}

/// Independent renders of the input view.
fn fresh(scene: &SceneFile, world: &World) -> Vec<Picture<LinearRgb>> {
    let seeds: Vec<u64> = (0..FRESH as u64).map(|seed| seed + 7_000_000).collect();
    let settings = RenderSettings { samples: 64, ..Default::default() };
    let groups = LightGroups::together(world.emitters().groups());
    let cameras = [scene.views[0].camera];
    let mut done = render_views(world, &cameras, &groups, &settings, &seeds, &|_, _| ()).unwrap();
    done.views.remove(0).halves.into_iter().map(|half| half.basis.sum()).collect()
}

/// Means over squares of `side` pixels, by channel.
fn tiles(picture: &Picture<LinearRgb>, side: usize) -> Vec<f64> {
    let (columns, rows) = (picture.width().div_ceil(side), picture.height().div_ceil(side));
    let mut sums = vec![0.0; 3 * columns * rows];
    for (at, pixel) in picture.pixels().iter().enumerate() {
        let tile = at / picture.width() / side * columns + at % picture.width() / side;
        (0..3).for_each(|c| sums[3 * tile + c] += f64::from(pixel.0[c]));
    }
    sums
}

/// None without variance.
fn students_t(a: &[f64], b: &[f64]) -> Option<f64> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let squares = |values: &[f64]| values.iter().map(|v| (v - mean(values)).powi(2)).sum::<f64>();
    let variance = (squares(a) + squares(b)) / (a.len() + b.len() - 2) as f64;
    let error = (variance * (1.0 / a.len() as f64 + 1.0 / b.len() as f64)).sqrt();
    (error > 0.0).then(|| (mean(a) - mean(b)) / error)
}
