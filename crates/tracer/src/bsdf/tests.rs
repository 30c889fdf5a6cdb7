//! Tests of every lobe: samples follow their density (chi-square), energy, reciprocity, values and albedos of Mitsuba,
//! Blender and papers.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use mateval_dataset::material::{
    ColorInput, ConductorIor, Distribution, MaterialModel, Microfacets, PrincipledFlavour, TextureIndex, UvTransform,
};
use mateval_dataset::reference::{ReferenceScene, SurfaceIndex};
use mateval_image::{Texels, Wrap};
use mateval_testkit::scenes::{self, Builder, quad};
use mateval_testkit::statistics::counts_z;
use rayon::prelude::*;

use super::facets::LocalSample;
use super::*;
use crate::ray::{TriangleIndex, TriangleRecord};
use crate::world::World;

const WHITE: ColorInput = ColorInput::Constant([1.0; 3]);

fn facets(distribution: Distribution, alpha: f32) -> Option<Microfacets> {
    Some(Microfacets { distribution, alpha: ScalarInput::Constant(alpha) })
}

const BROWN: ColorInput = ColorInput::Constant([0.8, 0.4, 0.1]);

fn principled(base_color: ColorInput, flavour: PrincipledFlavour, roughness: f32, metallic: f32) -> MaterialModel {
    MaterialModel::Principled {
        base_color,
        roughness: ScalarInput::Constant(roughness),
        metallic: ScalarInput::Constant(metallic),
        specular: 0.5,
        flavour,
    }
}

fn diffuse(alpha: Option<f32>) -> MaterialModel {
    MaterialModel::Diffuse { reflectance: WHITE, alpha: alpha.map(ScalarInput::Constant) }
}

fn conductor(microfacets: Option<Microfacets>) -> MaterialModel {
    MaterialModel::Conductor { ior: ConductorIor::PerfectMirror, specular_reflectance: WHITE, microfacets }
}

fn plastic(diffuse_reflectance: ColorInput, nonlinear: bool, microfacets: Option<Microfacets>) -> MaterialModel {
    MaterialModel::Plastic { eta: 1.5, nonlinear, diffuse_reflectance, specular_reflectance: WHITE, microfacets }
}

fn dielectric(eta: f32, microfacets: Option<Microfacets>) -> MaterialModel {
    MaterialModel::Dielectric { eta, specular_reflectance: WHITE, specular_transmittance: WHITE, microfacets }
}

const THIN: MaterialModel =
    MaterialModel::ThinDielectric { eta: 1.5, specular_reflectance: WHITE, specular_transmittance: WHITE };

/// All models at several widths, in white.
fn models() -> Vec<MaterialModel> {
    let mut models = vec![
        diffuse(None),
        diffuse(Some(0.3)),
        conductor(None),
        plastic(WHITE, true, None),
        dielectric(1.5, None),
        THIN,
    ];
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for alpha in [0.05, 0.3, 0.8] {
            let facets = facets(distribution, alpha);
            models.extend([
                conductor(facets),
                plastic(WHITE, true, facets),
                dielectric(1.5, facets),
                dielectric(0.8, facets),
            ]);
        }
    }
    for flavour in [PrincipledFlavour::Blender, PrincipledFlavour::Mitsuba] {
        for roughness in [0.2, 0.5, 0.9] {
            models.extend([0.0, 0.5, 1.0].map(|metallic| principled(WHITE, flavour, roughness, metallic)));
        }
    }
    models
}

/// Calls `look` with the lobe of `model`.
fn with_lobe<R>(model: &MaterialModel, look: impl FnOnce(&Lobe) -> R) -> R {
    let material = scenes::material(*model);
    let scene = ReferenceScene { materials: vec![material.clone()], ..Default::default() };
    let tables = MaterialTables::new(&scene, &[]).unwrap();
    look(&Lobe::at(&material, tables.of(0), &[], Vec2::ZERO))
}

/// Views from above at 4 angles, and from below for lobes that transmit.
fn views(lobe: &Lobe) -> Vec<Vec3> {
    let from_above = [0.1_f32, 0.4, 0.8, 1.0];
    let mut views = from_above.map(|z| Vec3::new((1.0 - z * z).sqrt() * 0.6, (1.0 - z * z).sqrt() * 0.8, z)).to_vec();
    if lobe.transmits() {
        views.extend(views.clone().into_iter().map(|view| Vec3::new(view.x, view.y, -view.z)));
    }
    views
}

fn draws(count: u32) -> impl Iterator<Item = [f32; 3]> {
    // Independent numbers: stratified ones would make a chi-square test too lenient.
    (0..count).map(|k| [0, 1, 2].map(|stream| crate::sampling::unit_hash(k, 77 + stream)))
}

const ROWS: usize = 16;
const COLUMNS: usize = 16;

/// The cell of the sphere, by cosine and azimuth, that contains `w`.
fn cell(w: Vec3) -> usize {
    let row = ((w.z + 1.0) * 0.5 * ROWS as f32).min(ROWS as f32 - 1.0) as usize;
    let phi = libm::atan2f(w.y, w.x) / TAU + 0.5;
    row * COLUMNS + ((phi * COLUMNS as f32) as usize).min(COLUMNS - 1)
}

/// The density integrated over each cell, in f64. The grid is finest where rows of cells meet, since peaks are
/// narrowest at the poles and at the horizon.
fn expected(lobe: &Lobe, wo: Vec3) -> Vec<f64> {
    const FINE: usize = 96;
    let mut cells = vec![0.0_f64; ROWS * COLUMNS];
    let area = f64::from(4.0 * PI) / (ROWS * COLUMNS * FINE * FINE) as f64;
    let azimuth = |column: usize| ((column as f32 + 0.5) / (COLUMNS * FINE) as f32 - 0.5) * TAU;
    let azimuths: Vec<(f32, f32)> = (0..COLUMNS * FINE).map(|column| libm::sincosf(azimuth(column))).collect();
    for row in 0..ROWS * FINE {
        let t = ((row % FINE) as f32 + 0.5) / FINE as f32;
        let within = t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
        let stretch = 30.0 * t * t * (1.0 - t) * (1.0 - t);
        let z = ((row / FINE) as f32 + within) / ROWS as f32 * 2.0 - 1.0;
        let flat = (1.0 - z * z).max(0.0).sqrt();
        for (column, (sin, cos)) in azimuths.iter().enumerate() {
            let density = lobe.density(wo, Vec3::new(flat * cos, flat * sin, z));
            cells[row / FINE * COLUMNS + column / FINE] += f64::from(density * stretch) * area;
        }
    }
    cells
}

/// The deviation of samples from `expected`, as a standard normal. Absorbed samples and delta samples are in no cell.
fn deviation(lobe: &Lobe, wo: Vec3, expected: &[f64]) -> f64 {
    const COUNT: u32 = 20_000;
    let mut found = vec![0.0_f64; expected.len()];
    for sample in draws(COUNT).filter_map(|u| lobe.sample(wo, u)).filter(|sample| !sample.delta) {
        found[cell(sample.wi)] += 1.0;
    }
    counts_z(&found, expected, COUNT)
}

#[test]
fn samples_follow_their_density() {
    let tests = |model: &MaterialModel| {
        with_lobe(model, |lobe| {
            let views = views(lobe);
            for &wo in &views {
                let expected = expected(lobe, wo);
                assert!(expected.iter().sum::<f64>() < 1.01, "{model:?} {wo} {}", expected.iter().sum::<f64>());
                let z = deviation(lobe, wo, &expected);
                assert!(z < 5.0, "{model:?} from {wo}: {z:.1} deviations");
            }
            views.len()
        })
    };
    let tests: usize = models().par_iter().map(tests).sum();
    assert!(tests > 180, "{tests}");
}

/// The twin: a density for another width, index or metallic is rejected.
#[test]
fn samples_of_another_density_are_found_out() {
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let white = |flavour, metallic| principled(WHITE, flavour, 0.5, metallic);
    let pairs = [
        (conductor(facets(Distribution::Ggx, 0.3)), conductor(facets(Distribution::Ggx, 0.33))),
        (conductor(facets(Distribution::Beckmann, 0.3)), conductor(facets(Distribution::Ggx, 0.3))),
        (dielectric(1.5, facets(Distribution::Ggx, 0.3)), dielectric(1.6, facets(Distribution::Ggx, 0.3))),
        (white(PrincipledFlavour::Mitsuba, 0.0), white(PrincipledFlavour::Mitsuba, 0.3)),
        (white(PrincipledFlavour::Blender, 0.0), white(PrincipledFlavour::Blender, 0.3)),
    ];
    for (sampled, described) in pairs {
        let expected = with_lobe(&described, |lobe| expected(lobe, wo));
        let z = with_lobe(&sampled, |lobe| deviation(lobe, wo, &expected));
        assert!(z > 5.0, "{sampled:?} passes for {described:?}: {z:.1}");
    }
}

/// The mean weight of samples, which is the fraction of light scattered; the largest channel.
fn albedo(lobe: &Lobe, wo: Vec3) -> f64 {
    f64::from(color_albedo(lobe, wo).max_element())
}

fn color_albedo(lobe: &Lobe, wo: Vec3) -> Vec3 {
    let count = 40_000;
    let weight = |k: u32| {
        let [a, b, c, _] = sobol_burley::sample_4d(k, 0, 11);
        lobe.sample(wo, [a, b, c]).map_or(Vec3::ZERO, |sample| sample.weight).as_dvec3()
    };
    ((0..count).map(weight).sum::<glam::DVec3>() / f64::from(count)).as_vec3()
}

/// Weights equal value over density.
#[test]
fn weights_are_value_over_density() {
    let mut samples = 0;
    for model in models() {
        with_lobe(&model, |lobe| {
            for wo in views(lobe) {
                for u in draws(200) {
                    let Some(sample) = lobe.sample(wo, u).filter(|sample| !sample.delta) else { continue };
                    let (value, density) = (lobe.eval(wo, sample.wi), lobe.density(wo, sample.wi));
                    let off = (sample.weight - value / density).abs().max_element();
                    assert!(off <= 1e-4 * sample.weight.max_element(), "{model:?} {wo} {:?}", sample);
                    assert!((sample.wi.length() - 1.0).abs() < 1e-5);
                    samples += 1;
                }
            }
        });
    }
    assert!(samples > 30_000, "{samples}");
}

/// White materials scatter no more light than they receive. Exceptions, as their models have them: radiance grows
/// inside glass by the square of the index, Mitsuba's principled adds a specular lobe to a full diffuse one, Blender's
/// is interpolated between few cosines, and the formulas of Oren-Nayar and of rough plastic are fits that exceed one
/// slightly.
#[test]
fn no_more_light_leaves_than_came() {
    for model in models() {
        with_lobe(&model, |lobe| {
            for wo in views(lobe) {
                let limit = match &model {
                    MaterialModel::Dielectric { eta, .. } if wo.z > 0.0 => (1.0 / (eta * eta)).max(1.0),
                    MaterialModel::Dielectric { eta, .. } => (eta * eta).max(1.0),
                    MaterialModel::Principled { flavour: PrincipledFlavour::Mitsuba, .. } => 2.2,
                    MaterialModel::Principled { flavour: PrincipledFlavour::Blender, .. } => 1.006,
                    MaterialModel::Diffuse { alpha: Some(_), .. } => 1.05,
                    MaterialModel::Plastic { microfacets: Some(_), .. } => 1.03,
                    _ => 1.0,
                };
                let albedo = albedo(lobe, wo);
                assert!(albedo < f64::from(limit) + 0.004, "{model:?} from {wo}: {albedo}");
            }
        });
    }
}

/// White models that are smooth or matt lose nothing at any angle.
#[test]
fn lossless_models_lose_nothing() {
    let lossless = [
        diffuse(None),
        conductor(None),
        plastic(WHITE, true, None),
        THIN,
        conductor(facets(Distribution::Ggx, 0.01)),
        principled(WHITE, PrincipledFlavour::Blender, 0.1, 0.0),
        principled(WHITE, PrincipledFlavour::Blender, 0.1, 1.0),
    ];
    for model in lossless {
        with_lobe(&model, |lobe| {
            for wo in views(lobe).into_iter().filter(|wo| wo.z > 0.2) {
                let albedo = albedo(lobe, wo);
                assert!((albedo - 1.0).abs() < 0.01, "{model:?} from {wo}: {albedo}");
            }
        });
    }
    // The twin: a loss of 2 % is rejected.
    let darker = MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.98; 3]), alpha: None };
    assert!(with_lobe(&darker, |lobe| albedo(lobe, Vec3::Z)) < 0.99);
}

/// Light and viewer may be exchanged, except for Blender's layering, and for glass only up to the square of the index.
/// The twin: glass without that square is rejected.
#[test]
fn reciprocity() {
    let mut pairs = 0;
    for model in models() {
        if matches!(model, MaterialModel::Principled { flavour: PrincipledFlavour::Blender, .. }) {
            continue;
        }
        let gain = match &model {
            MaterialModel::Dielectric { eta, .. } => eta * eta,
            _ => 1.0,
        };
        let (count, worst) = worst_exchange(&model, gain);
        assert!(worst <= 2e-3, "{model:?}: {worst}");
        pairs += count;
    }
    assert!(pairs > 5000, "{pairs}");
    assert!(worst_exchange(&dielectric(1.5, facets(Distribution::Ggx, 0.3)), 1.0).1 > 0.3);
}

/// The number of sampled pairs of directions, and the largest relative change of the value when they are exchanged.
/// `gain` is the factor by which radiance grows on its way down through the surface.
fn worst_exchange(model: &MaterialModel, gain: f32) -> (u32, f32) {
    with_lobe(model, |lobe| {
        let (mut pairs, mut worst) = (0, 0.0_f32);
        for u in draws(400) {
            let view = crate::sampling::sphere([u[0], u[1]]);
            let wo = if lobe.transmits() { view } else { view.abs() };
            let drawn = lobe.sample(wo, [u[2], u[0], u[1]]).filter(|sample| !sample.delta);
            let Some(LocalSample { wi, .. }) = drawn else { continue };
            let scale = match wo.z * wi.z < 0.0 {
                true if wo.z > 0.0 => gain,
                true => 1.0 / gain,
                false => 1.0,
            };
            let there = lobe.eval(wo, wi).x / wi.z.abs() * scale;
            let back = lobe.eval(wi, wo).x / wo.z.abs();
            worst = worst.max((there - back).abs() / there.max(back));
            pairs += 1;
        }
        (pairs, worst)
    })
}

/// Smooth glass reflects everything from inside beyond the critical angle, and transmits 96 % at normal incidence.
#[test]
fn glass_reflects_as_fresnel_says() {
    with_lobe(&dielectric(1.5, None), |lobe| {
        let inside = Vec3::new(0.8, 0.0, -0.6);
        assert!(draws(500).all(|u| lobe.sample(inside, u).unwrap().wi.z < 0.0));
        let through = draws(20_000).filter(|u| lobe.sample(Vec3::Z, *u).unwrap().wi.z < 0.0).count();
        assert!((through as f64 / 20_000.0 - 0.96).abs() < 0.005, "{through}");
        let bent = draws(500).map(|u| lobe.sample(Vec3::new(0.6, 0.0, 0.8), u).unwrap().wi).find(|wi| wi.z < 0.0);
        assert!((bent.unwrap().x + 0.4).abs() < 1e-6, "Snell's law");
    });
}

/// An opaque material that is not two-sided is black from behind; a two-sided one looks the same from both sides.
#[test]
fn sides() {
    let mesh = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    let world = |two_sided: bool| {
        let material =
            Material { two_sided, ..scenes::material(principled(WHITE, PrincipledFlavour::Mitsuba, 0.4, 0.2)) };
        World::new(Arc::new(Builder::default().surface(mesh.clone(), material).scene())).unwrap()
    };
    let record = TriangleRecord::new(&mesh, TriangleIndex(0), 1.0);
    let hit = SurfaceHit::new(SurfaceIndex(0), TriangleIndex(0), &record, Vec3::splat(1.0 / 3.0));
    let (wo, wi) = (Vec3::new(0.0, 0.6, -0.8), Vec3::new(0.6, 0.0, -0.8));
    let mirrored = |w: Vec3| Vec3::new(w.x, w.y, -w.z);
    let (one, two) = (world(false), world(true));
    let value = |world: &World, wo, wi| world.bsdf::<1>(&hit, wo).evaluate(wi, BsdfPart::All).0[0];
    assert!(one.bsdf::<1>(&hit, wo).is_black());
    assert_eq!(value(&one, mirrored(wo), wi), Vec3::ZERO);
    let (front, back) = (value(&two, mirrored(wo), mirrored(wi)), value(&two, wo, wi));
    assert!(front.x > 0.1 && (front - back).length() < 1e-6, "{front} {back}");
}

fn copper(distribution: Distribution) -> MaterialModel {
    let ior = ConductorIor::EtaK { eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.1] };
    MaterialModel::Conductor { ior, specular_reflectance: WHITE, microfacets: facets(distribution, 0.3) }
}

/// `wo` and `wi` are (cosine, azimuth). The tolerance is larger for rough plastic, where both sides use tables of their
/// own, and for plastic, where Mitsuba uses a fit of the diffuse reflectance (0.1 % off) and we an integral.
fn is_close(model: &MaterialModel, wo: (f32, f32), wi: (f32, f32), expected: [f32; 3]) -> bool {
    let direction = |(z, phi): (f32, f32)| {
        let (sin, cos) = libm::sincosf(phi);
        (Vec2::new(cos, sin) * (1.0 - z * z).sqrt()).extend(z)
    };
    let tolerance = match model {
        MaterialModel::Plastic { microfacets: Some(_), .. } => 0.01,
        MaterialModel::Plastic { .. } => 2e-3,
        _ => 1e-3,
    };
    let found = with_lobe(model, |lobe| lobe.eval(direction(wo), direction(wi)));
    let off = ((found - Vec3::from_array(expected)) / Vec3::from_array(expected)).abs().max_element();
    off < tolerance
}

/// The viewer and the light of [`values_are_mitsubas`], each as cosine and azimuth.
const DIRECTIONS: [[(f32, f32); 2]; 3] =
    [[(0.8, 0.0), (0.7, 2.9)], [(0.3, 1.0), (0.5, -1.5)], [(0.95, 0.5), (0.2, 0.7)]];

/// Values with the cosine, from Mitsuba 3.9.1's `eval` (scalar_rgb). The twins, with a parameter off by 0.02 or another
/// `nonlinear`, do not have the first of them.
#[test]
fn values_are_mitsubas() {
    let (ggx, beckmann) = (Distribution::Ggx, Distribution::Beckmann);
    let plastic = |nonlinear, microfacets| plastic(BROWN, nonlinear, microfacets);
    let principled = |roughness, metallic| principled(BROWN, PrincipledFlavour::Mitsuba, roughness, metallic);
    let grey = |values: [f32; 3]| values.map(|value| [value; 3]);
    let frosted = dielectric(1.5, facets(ggx, 0.3));
    let cases = [
        (
            copper(ggx),
            None,
            [
                [0.744_212, 0.482_017, 0.394_615],
                [0.109_506, 0.072_303_7, 0.060_868_2],
                [0.014_501_2, 0.009_382_2, 0.007_648_38],
            ],
        ),
        (
            copper(beckmann),
            None,
            [
                [0.900_913, 0.58351, 0.477_706],
                [0.018_546_6, 0.012_245_7, 0.010_308_9],
                [3.68514e-06, 2.38426e-06, 1.94366e-06],
            ],
        ),
        (
            plastic(true, None),
            Some(plastic(false, None)),
            [
                [0.137_574, 0.047_216_5, 0.009_556_53],
                [0.078_142_4, 0.026_819_1, 0.005_428_13],
                [0.027_486_5, 0.009_433_58, 0.001_909_34],
            ],
        ),
        (
            plastic(false, None),
            None,
            [
                [0.178_302, 0.089_151_2, 0.022_287_8],
                [0.101_276, 0.050_638_1, 0.012_659_5],
                [0.035_623_8, 0.017_811_9, 0.004_452_97],
            ],
        ),
        (
            plastic(true, facets(ggx, 0.3)),
            Some(plastic(true, facets(ggx, 0.32))),
            [
                [0.139_518, 0.077_634, 0.045_282_7],
                [0.071_949_8, 0.035_144_3, 0.015_903_5],
                [0.025_478, 0.010_584_5, 0.002_798_57],
            ],
        ),
        (
            plastic(true, facets(beckmann, 0.1)),
            None,
            [
                [0.222_538, 0.135_164, 0.097_927_4],
                [0.076_312, 0.026_604_7, 0.005_420_46],
                [0.027_575_4, 0.009_613_64, 0.001_958_69],
            ],
        ),
        (frosted, Some(dielectric(1.52, facets(ggx, 0.3))), grey([0.036_288_4, 0.010_554_2, 0.000_633_948])),
        (
            principled(0.5, 0.0),
            Some(principled(0.52, 0.0)),
            [
                [0.224_465, 0.135_321, 0.068_462_2],
                [0.129_422, 0.068_985_6, 0.023_658_3],
                [0.055_511_1, 0.028_002_6, 0.007_371_26],
            ],
        ),
        (
            principled(0.3, 0.7),
            Some(principled(0.3, 0.72)),
            [
                [0.819_088, 0.41922, 0.119_318],
                [0.045_661_6, 0.023_263_4, 0.006_464_74],
                [0.016_197_7, 0.008_111_8, 0.002_047_37],
            ],
        ),
        (
            principled(0.9, 1.0),
            None,
            [
                [0.095_670_5, 0.047_886_6, 0.012_048_7],
                [0.091_349_9, 0.047_552_5, 0.014_704_5],
                [0.023_638_2, 0.011_819_8, 0.002_956_02],
            ],
        ),
    ];
    for (model, twin, values) in cases {
        for ([wo, wi], expected) in DIRECTIONS.into_iter().zip(values) {
            assert!(is_close(&model, wo, wi, expected), "{model:?} {wo:?} {wi:?}, expected {expected:?}");
        }
        let [wo, wi] = DIRECTIONS[0];
        assert!(twin.is_none_or(|twin| !is_close(&twin, wo, wi, values[0])), "the twin of {model:?} passes");
    }
    // Through the boundary, and from below.
    for (wo, wi, value) in [
        ((0.8, 0.0), (-0.75, 3.0), 0.269_743),
        ((-0.9, 0.4), (0.85, -2.6), 8.10793),
        ((-0.9, 0.4), (-0.8, -2.6), 0.046_830_5),
    ] {
        assert!(is_close(&frosted, wo, wi, [value; 3]), "{wo:?} {wi:?}");
    }
}

/// Retro-reflection. There pbrt's form of the model, A + B sin tan (Pharr et al., "Physically Based Rendering", third
/// edition, 8.4.1), is exact for direct light, and equation 31 of the paper gives the interreflection. A smooth surface
/// is Lambertian; a rough one is brighter towards a grazing light.
#[test]
fn oren_nayar_towards_the_light() {
    let value = |alpha: f32, cos: f32| {
        let w = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        with_lobe(&diffuse(Some(alpha)), |lobe| lobe.eval(w, w).x) * PI / cos
    };
    for cos in [1.0_f32, 0.8, 0.5, 0.2] {
        assert!((value(0.0, cos) - 1.0).abs() < 1e-6);
        for alpha in [0.2_f32, 0.5, 1.0] {
            let s2 = alpha * alpha / 2.0;
            let theta = libm::acosf(cos);
            let (a, b) = (1.0 - s2 / (2.0 * (s2 + 0.33)), 0.45 * s2 / (s2 + 0.09));
            let between = 0.17 * s2 / (s2 + 0.13) * (1.0 - (2.0 * theta / PI).powi(2));
            let expected = a + b * theta.sin() * theta.tan() + between;
            assert!((value(alpha, cos) - expected).abs() < 1e-4, "{alpha} {cos}: {} {expected}", value(alpha, cos));
        }
    }
    assert!(value(0.5, 0.2) > 1.3 && value(0.5, 1.0) < 1.0);
}

/// A plane under uniform radiance 1, seen at three cosines, rendered by Blender 4.5.15 (Cycles, 8192 samples in each of
/// 64 pixels, standard error at most 4e-5). The twins, with another roughness and with the other flavour, are off.
#[test]
fn albedos_are_blenders() {
    let truth = [
        (0.2, 0.0, [[0.89751, 0.68109, 0.51877], [0.83953, 0.52018, 0.28066], [0.80801, 0.42399, 0.13597]]),
        (0.5, 0.0, [[0.82681, 0.50014, 0.25513], [0.81775, 0.46238, 0.19586], [0.80744, 0.42238, 0.13359]]),
        (0.9, 0.0, [[0.81201, 0.44061, 0.16206], [0.80783, 0.42533, 0.13846], [0.80363, 0.41105, 0.11661]]),
        (0.35, 0.5, [[0.84461, 0.55213, 0.34109], [0.82140, 0.47421, 0.22133], [0.80256, 0.40975, 0.11699]]),
        (0.2, 1.0, [[0.88873, 0.67465, 0.52116], [0.83099, 0.49444, 0.24403], [0.79975, 0.39962, 0.09986]]),
        (0.5, 1.0, [[0.81229, 0.46175, 0.21822], [0.78758, 0.40318, 0.14616], [0.78619, 0.37984, 0.09269]]),
        (0.9, 1.0, [[0.75588, 0.36192, 0.11075], [0.70837, 0.30044, 0.07725], [0.65187, 0.23149, 0.04652]]),
    ];
    let worst = |model: MaterialModel, expected: &[[f32; 3]; 3]| {
        let off = |(cos, expected): (f32, &[f32; 3])| {
            let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let found = with_lobe(&model, |lobe| color_albedo(lobe, wo));
            (found - Vec3::from_array(*expected)).abs().max_element()
        };
        [0.1, 0.3, 1.0].into_iter().zip(expected).map(off).fold(0.0, f32::max)
    };
    for (roughness, metallic, expected) in &truth {
        let model = |r: f32, flavour| principled(BROWN, flavour, r, *metallic);
        let found = worst(model(*roughness, PrincipledFlavour::Blender), expected);
        let rougher = worst(model(roughness + 0.05, PrincipledFlavour::Blender), expected);
        let other = worst(model(*roughness, PrincipledFlavour::Mitsuba), expected);
        assert!(found < 1e-3, "{roughness} {metallic}: {found}");
        assert!(rougher > 2e-3 && other > 2e-3, "{roughness} {metallic}: {rougher} {other}");
    }
}

/// Heights rise by 1 m over the texture, which covers 2 m of a square: a slope of one half. If the texture is
/// repeated twice, the slope doubles; if it is turned by a quarter, the slope runs along v.
#[test]
fn a_ramp_tilts_the_normal_by_its_slope() {
    let ramp = (0..16 * 16).map(|k| (k % 16) as f32 / 16.0).collect();
    let textures = [Texture::new(16, 16, Texels::Grey(ramp), Wrap::Repeat).unwrap()];
    let mesh = TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::new(2.0, 2.0, 0.0)],
        normals: None,
        uvs: Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE]),
        triangles: vec![[0, 1, 2]],
    };
    let bent = |uv: [[f32; 3]; 2], scale: f32| {
        let height = ScalarInput::Texture { texture: TextureIndex(0), channel: 0, uv: UvTransform(uv) };
        let record = TriangleRecord::new(&mesh, TriangleIndex(0), 2.0);
        let weights = Vec3::new(0.45, 0.25, 0.3);
        let hit = SurfaceHit::new(SurfaceIndex(0), TriangleIndex(0), &record, weights);
        bumped_normal(&BumpMap { height, scale }, &textures, &mesh, &hit)
    };
    let straight = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let is = |found: Vec3, expected: Vec3| assert!((found - expected.normalize()).length() < 1e-5, "{found}");
    is(bent(straight, 1.0), Vec3::new(-0.5, 0.0, 1.0));
    is(bent(straight, -3.0), Vec3::new(1.5, 0.0, 1.0));
    is(bent([[2.0, 0.0, 0.2], [0.0, 1.0, 0.0]], 1.0), Vec3::new(-1.0, 0.0, 1.0));
    is(bent([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], 1.0), Vec3::new(0.0, -0.5, 1.0));
    is(bent(straight, 0.0), Vec3::Z);
}

/// The slope is that of the interpolated heights at the very point: zero between two equal texels, the whole step
/// between two that differ. A difference over a wider range would mix them.
#[test]
fn the_slope_jumps_at_texel_centres() {
    let textures = [Texture::new(4, 1, Texels::Grey(vec![0.0, 0.0, 1.0, 1.0]), Wrap::Clamp).unwrap()];
    let height = ScalarInput::Texture { texture: TextureIndex(0), channel: 0, uv: UvTransform::default() };
    let at = |u: f32| slope(&height, &textures, Vec2::new(u, 0.5)).x;
    for (u, expected) in [(0.2, 0.0), (0.36, 0.0), (0.39, 4.0), (0.61, 4.0), (0.64, 0.0), (0.05, 0.0)] {
        assert!((at(u) - expected).abs() < 1e-4, "{u}: {}", at(u));
    }
}
