//! Tests of every lobe: samples follow their density (chi-square), energy, reciprocity, known values.

mod values;

use std::f32::consts::{PI, TAU};

use glam::Vec2;
use mateval_scene::material::{
    ColorInput, ConductorIor, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
};
use mateval_scene::reference::ReferenceScene;
use rayon::prelude::*;

use super::sample::LocalSample;
use super::*;
use crate::world::World;

const WHITE: ColorInput = ColorInput::Constant([1.0; 3]);

fn facets(distribution: Distribution, alpha: f32) -> Option<Microfacets> {
    Some(Microfacets { distribution, alpha: ScalarInput::Constant(alpha) })
}

fn principled(flavour: PrincipledFlavour, roughness: f32, metallic: f32) -> MaterialModel {
    MaterialModel::Principled {
        base_color: WHITE,
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

fn plastic(microfacets: Option<Microfacets>) -> MaterialModel {
    MaterialModel::Plastic {
        eta: 1.5,
        nonlinear: true,
        diffuse_reflectance: WHITE,
        specular_reflectance: WHITE,
        microfacets,
    }
}

fn dielectric(eta: f32, microfacets: Option<Microfacets>) -> MaterialModel {
    MaterialModel::Dielectric { eta, specular_reflectance: WHITE, specular_transmittance: WHITE, microfacets }
}

/// All models at several widths, in white.
fn models() -> Vec<MaterialModel> {
    let mut models = vec![
        diffuse(None),
        diffuse(Some(0.3)),
        conductor(None),
        plastic(None),
        dielectric(1.5, None),
        MaterialModel::ThinDielectric { eta: 1.5, specular_reflectance: WHITE, specular_transmittance: WHITE },
    ];
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for alpha in [0.05, 0.3, 0.8] {
            let facets = facets(distribution, alpha);
            models.extend([conductor(facets), plastic(facets), dielectric(1.5, facets), dielectric(0.8, facets)]);
        }
    }
    for flavour in [PrincipledFlavour::Blender, PrincipledFlavour::Mitsuba] {
        for roughness in [0.2, 0.5, 0.9] {
            models.extend([0.0, 0.5, 1.0].map(|metallic| principled(flavour, roughness, metallic)));
        }
    }
    models
}

/// Calls `look` with the lobe of `model`.
fn with_lobe<R>(model: &MaterialModel, look: impl FnOnce(&Lobe) -> R) -> R {
    let material = Material { name: String::new(), model: *model, two_sided: true, opacity: None, bump: None };
    let scene = ReferenceScene { materials: vec![material], ..Default::default() };
    let tables = MaterialTables::new(&scene, &[]).unwrap();
    look(&Lobe::at(&scene.materials[0], tables.of(0), &[], Vec2::ZERO))
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

/// Pearson's statistic over cells with at least 10 expected samples, with the rest pooled, and its degrees of freedom.
fn chi_square(lobe: &Lobe, wo: Vec3, expected: &[f64], count: u32) -> (f64, f64) {
    let mut found = vec![0.0_f64; expected.len()];
    let mut spread = 0_u32;
    for u in draws(count) {
        let Some(sample) = lobe.sample(wo, u) else { continue };
        if !sample.delta {
            found[cell(sample.wi)] += 1.0;
            spread += 1;
        }
    }
    let n = f64::from(count);
    let (mut statistic, mut freedom) = (0.0, 0.0);
    // Absorbed samples and delta samples count as one cell too.
    let mut pooled = [n - f64::from(spread), n * (1.0 - expected.iter().sum::<f64>())];
    for (found, expected) in found.iter().zip(expected) {
        if n * expected >= 10.0 {
            statistic += (found - n * expected).powi(2) / (n * expected);
            freedom += 1.0;
        } else {
            pooled = [pooled[0] + found, pooled[1] + n * expected];
        }
    }
    statistic += (pooled[0] - pooled[1]).powi(2) / pooled[1].max(10.0);
    (statistic, freedom)
}

/// Wilson and Hilferty's approximation: the statistic as a standard normal.
fn deviation((statistic, freedom): (f64, f64)) -> f64 {
    let k = freedom.max(1.0);
    ((statistic / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt()
}

#[test]
fn samples_follow_their_density() {
    let tests = |model: &MaterialModel| {
        with_lobe(model, |lobe| {
            let views = views(lobe);
            for &wo in &views {
                let expected = expected(lobe, wo);
                assert!(expected.iter().sum::<f64>() < 1.01, "{model:?} {wo} {}", expected.iter().sum::<f64>());
                let z = deviation(chi_square(lobe, wo, &expected, 20_000));
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
    let pairs = [
        (conductor(facets(Distribution::Ggx, 0.3)), conductor(facets(Distribution::Ggx, 0.33))),
        (conductor(facets(Distribution::Beckmann, 0.3)), conductor(facets(Distribution::Ggx, 0.3))),
        (dielectric(1.5, facets(Distribution::Ggx, 0.3)), dielectric(1.6, facets(Distribution::Ggx, 0.3))),
        (principled(PrincipledFlavour::Mitsuba, 0.5, 0.0), principled(PrincipledFlavour::Mitsuba, 0.5, 0.3)),
        (principled(PrincipledFlavour::Blender, 0.5, 0.0), principled(PrincipledFlavour::Blender, 0.5, 0.3)),
    ];
    for (sampled, described) in pairs {
        let expected = with_lobe(&described, |lobe| expected(lobe, wo));
        let z = with_lobe(&sampled, |lobe| deviation(chi_square(lobe, wo, &expected, 20_000)));
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
    let thin = MaterialModel::ThinDielectric { eta: 1.5, specular_reflectance: WHITE, specular_transmittance: WHITE };
    let lossless = [
        diffuse(None),
        conductor(None),
        plastic(None),
        thin,
        conductor(facets(Distribution::Ggx, 0.01)),
        principled(PrincipledFlavour::Blender, 0.1, 0.0),
        principled(PrincipledFlavour::Blender, 0.1, 1.0),
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
    use std::sync::Arc;

    use crate::ray::TriangleIndex;
    use crate::ray::TriangleRecord;
    use mateval_scene::TriangleMesh;
    use mateval_scene::reference::{MaterialIndex, Surface, SurfaceIndex};

    let mesh = TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        triangles: vec![[0, 1, 2]],
        ..Default::default()
    };
    let world = |two_sided: bool| {
        let model = principled(PrincipledFlavour::Mitsuba, 0.4, 0.2);
        let material = Material { name: String::new(), model, two_sided, opacity: None, bump: None };
        let surface = Surface { name: String::new(), mesh: mesh.clone(), material: MaterialIndex(0) };
        let scene = ReferenceScene { surfaces: vec![surface], materials: vec![material], ..Default::default() };
        World::new(Arc::new(scene)).unwrap()
    };
    let record = TriangleRecord::new(&mesh, TriangleIndex(0), 1.0);
    let hit = SurfaceHit::new(SurfaceIndex(0), TriangleIndex(0), &record, Vec3::splat(1.0 / 3.0));
    let (wo, wi) = (Vec3::new(0.0, 0.6, -0.8), Vec3::new(0.6, 0.0, -0.8));
    let mirrored = |w: Vec3| Vec3::new(w.x, w.y, -w.z);
    let (one, two) = (world(false), world(true));
    assert!(one.bsdf(&hit, wo).is_black());
    assert_eq!(one.bsdf(&hit, mirrored(wo)).evaluate(wi), (Vec3::ZERO, 0.0));
    let front = two.bsdf(&hit, mirrored(wo)).evaluate(mirrored(wi)).0;
    let back = two.bsdf(&hit, wo).evaluate(wi).0;
    assert!(front.x > 0.1 && (front - back).length() < 1e-6, "{front} {back}");
}
