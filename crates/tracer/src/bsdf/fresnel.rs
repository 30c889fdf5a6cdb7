//! Fresnel reflectance of smooth boundaries, for unpolarised light. Born and Wolf, "Principles of Optics", sections 1.5
//! and 14.2.

use glam::Vec3;
use mateval_scene::material::ConductorIor;

/// The reflectance of a dielectric boundary and the cosine of the refracted direction (0 under total reflection). `cos`
/// (0 to 1) is on the side of the incident light, `eta` is the index of the other side over that of this side.
pub(crate) fn dielectric(cos: f32, eta: f32) -> (f32, f32) {
    let sin2_beyond = (1.0 - cos * cos).max(0.0) / (eta * eta);
    if sin2_beyond >= 1.0 {
        return (1.0, 0.0);
    }
    let beyond = (1.0 - sin2_beyond).sqrt();
    let parallel = (eta * cos - beyond) / (eta * cos + beyond);
    let perpendicular = (cos - eta * beyond) / (cos + eta * beyond);
    // At grazing incidence on a boundary without contrast both quotients are 0 / 0; nothing is reflected there.
    let reflected = 0.5 * (parallel * parallel + perpendicular * perpendicular);
    (if reflected.is_nan() { 0.0 } else { reflected }, beyond)
}

/// The reflectance that [`dielectric`] returns, for light on the side of the lower index (`eta` of at least 1) and
/// `cos` above 0, with a single division. Cook and Torrance, "A Reflectance Model for Computer Graphics" (1982).
pub(crate) fn dielectric_from_thinner(cos: f32, eta: f32) -> f32 {
    let g = (eta * eta - 1.0 + cos * cos).sqrt();
    let (above, below) = (cos * (g + cos) - 1.0, cos * (g - cos) + 1.0);
    let quotient = (g - cos) / ((g + cos) * below);
    0.5 * quotient * quotient * (above * above + below * below)
}

/// The fraction of uniform light from one side that a smooth dielectric boundary reflects: 2 * integral of F(mu) mu
/// dmu.
pub(crate) fn diffuse_reflectance(eta: f32) -> f32 {
    const STEPS: u32 = 4096;
    let sum: f64 = (0..STEPS)
        .map(|step| {
            let mu = (f64::from(step) + 0.5) / f64::from(STEPS);
            f64::from(dielectric(mu as f32, eta).0) * mu
        })
        .sum();
    (2.0 * sum / f64::from(STEPS)) as f32
}

/// The reflectance of a conductor, per channel, for `cos` from 0 to 1.
pub(crate) fn conductor(cos: f32, ior: &ConductorIor) -> Vec3 {
    match ior {
        ConductorIor::PerfectMirror => Vec3::ONE,
        ConductorIor::EtaK { eta, k } => {
            Vec3::from_array(std::array::from_fn(|channel| conductor_channel(cos, eta[channel], k[channel])))
        }
    }
}

fn conductor_channel(cos: f32, eta: f32, k: f32) -> f32 {
    if eta == 0.0 {
        // Nothing enters. For k = 0, the limit, the quotients below are 0 / 0.
        return 1.0;
    }
    let (cos2, sin2) = (cos * cos, 1.0 - cos * cos);
    let difference = eta * eta - k * k - sin2;
    let sum = (difference * difference + 4.0 * eta * eta * k * k).sqrt();
    let a = (0.5 * (sum + difference)).max(0.0).sqrt();
    let perpendicular = (sum + cos2 - 2.0 * a * cos) / (sum + cos2 + 2.0 * a * cos);
    let (near, far) = (sum * cos2 + sin2 * sin2, 2.0 * a * cos * sin2);
    let parallel = perpendicular * (near - far) / (near + far);
    0.5 * (perpendicular + parallel)
}

/// (1 - cos)^5, the weight of Schlick's approximation (1994).
pub(crate) fn schlick_weight(cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    x * x * (x * x) * x
}

/// The index of refraction for Disney's `specular`, by F0 = 0.08 * specular. Blender's IOR level has the same meaning.
pub(crate) fn eta_from_specular(specular: f32) -> f32 {
    2.0 / (1.0 - (0.08 * specular.clamp(0.0, 1.0)).sqrt()) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // ((1.5 - 1) / (1.5 + 1))^2; and Brewster's angle, where only one polarisation is reflected.
        assert!((dielectric(1.0, 1.5).0 - 0.04).abs() < 1e-7);
        let brewster = 1.0 / (1.0_f32 + 1.5 * 1.5).sqrt();
        let expected = 0.5 * ((1.5_f32 * 1.5 - 1.0) / (1.5 * 1.5 + 1.0)).powi(2);
        assert!((dielectric(brewster, 1.5).0 - expected).abs() < 1e-6);
        // Total reflection beyond asin(1 / 1.5) = 41.8 degrees.
        assert_eq!(dielectric(0.7, 1.0 / 1.5), (1.0, 0.0));
        // Diffuse reflectance of eta 1.5: 0.0918 (Egan and Hilgeman 1973, table).
        assert!((diffuse_reflectance(1.5) - 0.0918).abs() < 2e-4, "{}", diffuse_reflectance(1.5));
    }

    #[test]
    fn one_division_is_enough() {
        for eta in [1.01, 1.5, 3.0] {
            for cos in [1e-3, 0.1, 0.5, 0.9, 1.0] {
                let (found, expected) = (dielectric_from_thinner(cos, eta), dielectric(cos, eta).0);
                assert!((found - expected).abs() < 2e-6, "{eta} {cos}: {found} {expected}");
            }
        }
    }

    /// The transmitted fraction is the same from both sides: (1 - R(1/eta)) * eta^2 = 1 - R(eta).
    #[test]
    fn diffuse_reflectance_inside_follows_from_outside() {
        for eta in [1.2_f32, 1.5, 2.4] {
            let (outside, inside) = (diffuse_reflectance(eta), diffuse_reflectance(1.0 / eta));
            assert!(((1.0 - inside) * eta * eta - (1.0 - outside)).abs() < 1e-3, "{eta}");
        }
    }

    #[test]
    fn a_conductor_without_absorption_is_a_dielectric() {
        let glass = ConductorIor::EtaK { eta: [1.5; 3], k: [0.0; 3] };
        for cos in [0.05, 0.3, 0.7, 1.0] {
            assert!((conductor(cos, &glass).x - dielectric(cos, 1.5).0).abs() < 1e-5, "{cos}");
        }
    }

    #[test]
    fn a_conductor_without_a_real_index_is_a_mirror() {
        for k in [0.0, 0.3, 1.0] {
            let ior = ConductorIor::EtaK { eta: [0.0; 3], k: [k; 3] };
            assert!([0.0, 0.3, 1.0].iter().all(|cos| conductor(*cos, &ior) == Vec3::ONE), "{k}");
        }
    }

    #[test]
    fn a_conductor_head_on_has_its_f0() {
        let copper = ConductorIor::EtaK { eta: [0.2004, 0.9240, 1.1022], k: [3.9129, 2.4528, 2.1421] };
        let found = conductor(1.0, &copper);
        assert!((found - Vec3::from_array(copper.reflectance_at_normal())).length() < 1e-5);
    }
}
