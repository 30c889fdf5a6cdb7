//! Values of every lobe compared with Mitsuba's, those of Oren and Nayar with their paper; albedos compared with
//! Blender's.

use mateval_scene::material::ConductorIor;

use super::*;

const BROWN: ColorInput = ColorInput::Constant([0.8, 0.4, 0.1]);

fn copper(distribution: Distribution) -> MaterialModel {
    let ior = ConductorIor::EtaK { eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.1] };
    MaterialModel::Conductor { ior, specular_reflectance: WHITE, microfacets: facets(distribution, 0.3) }
}

fn brown_plastic(nonlinear: bool, microfacets: Option<Microfacets>) -> MaterialModel {
    MaterialModel::Plastic { eta: 1.5, nonlinear, diffuse_reflectance: BROWN, specular_reflectance: WHITE, microfacets }
}

fn brown_principled(roughness: f32, metallic: f32, flavour: PrincipledFlavour) -> MaterialModel {
    MaterialModel::Principled {
        base_color: BROWN,
        roughness: ScalarInput::Constant(roughness),
        metallic: ScalarInput::Constant(metallic),
        specular: 0.5,
        flavour,
    }
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

#[track_caller]
fn agrees(model: &MaterialModel, wo: (f32, f32), wi: (f32, f32), expected: [f32; 3]) {
    assert!(is_close(model, wo, wi, expected), "{model:?} {wo:?} {wi:?}, expected {expected:?}");
}

/// Values with the cosine, from Mitsuba 3.9.1's `eval` (scalar_rgb).
#[test]
fn values_are_mitsubas() {
    // conductor_ggx
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.744_212, 0.482_017, 0.394_615]),
        ((0.3, 1.0), (0.5, -1.5), [0.109_506, 0.072_303_7, 0.060_868_2]),
        ((0.95, 0.5), (0.2, 0.7), [0.014_501_2, 0.009_382_2, 0.007_648_38]),
    ] {
        agrees(&copper(Distribution::Ggx), wo, wi, expected);
    }
    // conductor_beckmann
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.900_913, 0.58351, 0.477_706]),
        ((0.3, 1.0), (0.5, -1.5), [0.018_546_6, 0.012_245_7, 0.010_308_9]),
        ((0.95, 0.5), (0.2, 0.7), [3.68514e-06, 2.38426e-06, 1.94366e-06]),
    ] {
        agrees(&copper(Distribution::Beckmann), wo, wi, expected);
    }
    // plastic
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.137_574, 0.047_216_5, 0.009_556_53]),
        ((0.3, 1.0), (0.5, -1.5), [0.078_142_4, 0.026_819_1, 0.005_428_13]),
        ((0.95, 0.5), (0.2, 0.7), [0.027_486_5, 0.009_433_58, 0.001_909_34]),
    ] {
        agrees(&brown_plastic(true, None), wo, wi, expected);
    }
    // plastic_linear
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.178_302, 0.089_151_2, 0.022_287_8]),
        ((0.3, 1.0), (0.5, -1.5), [0.101_276, 0.050_638_1, 0.012_659_5]),
        ((0.95, 0.5), (0.2, 0.7), [0.035_623_8, 0.017_811_9, 0.004_452_97]),
    ] {
        agrees(&brown_plastic(false, None), wo, wi, expected);
    }
    // roughplastic_ggx
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.139_518, 0.077_634, 0.045_282_7]),
        ((0.3, 1.0), (0.5, -1.5), [0.071_949_8, 0.035_144_3, 0.015_903_5]),
        ((0.95, 0.5), (0.2, 0.7), [0.025_478, 0.010_584_5, 0.002_798_57]),
    ] {
        agrees(&brown_plastic(true, facets(Distribution::Ggx, 0.3)), wo, wi, expected);
    }
    // roughplastic_beckmann
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.222_538, 0.135_164, 0.097_927_4]),
        ((0.3, 1.0), (0.5, -1.5), [0.076_312, 0.026_604_7, 0.005_420_46]),
        ((0.95, 0.5), (0.2, 0.7), [0.027_575_4, 0.009_613_64, 0.001_958_69]),
    ] {
        agrees(&brown_plastic(true, facets(Distribution::Beckmann, 0.1)), wo, wi, expected);
    }
    // roughdielectric
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.036_288_4, 0.036_288_4, 0.036_288_4]),
        ((0.3, 1.0), (0.5, -1.5), [0.010_554_2, 0.010_554_2, 0.010_554_2]),
        ((0.95, 0.5), (0.2, 0.7), [0.000_633_948, 0.000_633_948, 0.000_633_948]),
        ((0.8, 0.0), (-0.75, 3.0), [0.269_743, 0.269_743, 0.269_743]),
        ((-0.9, 0.4), (0.85, -2.6), [8.10793, 8.10793, 8.10793]),
        ((-0.9, 0.4), (-0.8, -2.6), [0.046_830_5, 0.046_830_5, 0.046_830_5]),
    ] {
        agrees(&dielectric(1.5, facets(Distribution::Ggx, 0.3)), wo, wi, expected);
    }
    // principled_a
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.224_465, 0.135_321, 0.068_462_2]),
        ((0.3, 1.0), (0.5, -1.5), [0.129_422, 0.068_985_6, 0.023_658_3]),
        ((0.95, 0.5), (0.2, 0.7), [0.055_511_1, 0.028_002_6, 0.007_371_26]),
    ] {
        agrees(&brown_principled(0.5, 0.0, PrincipledFlavour::Mitsuba), wo, wi, expected);
    }
    // principled_b
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.819_088, 0.41922, 0.119_318]),
        ((0.3, 1.0), (0.5, -1.5), [0.045_661_6, 0.023_263_4, 0.006_464_74]),
        ((0.95, 0.5), (0.2, 0.7), [0.016_197_7, 0.008_111_8, 0.002_047_37]),
    ] {
        agrees(&brown_principled(0.3, 0.7, PrincipledFlavour::Mitsuba), wo, wi, expected);
    }
    // principled_c
    for (wo, wi, expected) in [
        ((0.8, 0.0), (0.7, 2.9), [0.095_670_5, 0.047_886_6, 0.012_048_7]),
        ((0.3, 1.0), (0.5, -1.5), [0.091_349_9, 0.047_552_5, 0.014_704_5]),
        ((0.95, 0.5), (0.2, 0.7), [0.023_638_2, 0.011_819_8, 0.002_956_02]),
    ] {
        agrees(&brown_principled(0.9, 1.0, PrincipledFlavour::Mitsuba), wo, wi, expected);
    }
}

/// The twin: values are rejected if a parameter is off by 0.02, or if `nonlinear` differs.
#[test]
fn values_slightly_off_are_found_out() {
    let (wo, wi) = ((0.8, 0.0), (0.7, 2.9));
    let off = [
        (brown_principled(0.52, 0.0, PrincipledFlavour::Mitsuba), [0.224_465, 0.135_321, 0.068_462_2]),
        (brown_principled(0.5, 0.02, PrincipledFlavour::Mitsuba), [0.224_465, 0.135_321, 0.068_462_2]),
        (dielectric(1.52, facets(Distribution::Ggx, 0.3)), [0.036_288_4; 3]),
        (brown_plastic(true, facets(Distribution::Ggx, 0.32)), [0.139_518, 0.077_634, 0.045_282_7]),
        (brown_plastic(false, None), [0.137_574, 0.047_216_5, 0.009_556_53]),
    ];
    for (model, expected) in off {
        assert!(!is_close(&model, wo, wi, expected), "{model:?}");
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
        let model = |r: f32, flavour| brown_principled(r, *metallic, flavour);
        let found = worst(model(*roughness, PrincipledFlavour::Blender), expected);
        let rougher = worst(model(roughness + 0.05, PrincipledFlavour::Blender), expected);
        let other = worst(model(*roughness, PrincipledFlavour::Mitsuba), expected);
        assert!(found < 1e-3, "{roughness} {metallic}: {found}");
        assert!(rougher > 2e-3 && other > 2e-3, "{roughness} {metallic}: {rougher} {other}");
    }
}
