//! The sun's radiance through the atmosphere, after Preetham, Shirley and Smits, "A practical analytic model for
//! daylight" (SIGGRAPH 1999), appendix 2; its water vapour and mixed gases, which matter beyond 690 nm, are left out.

/// The mean angular diameter of the sun in degrees, seen from the Earth.
pub(super) const SUN_DIAMETER_DEG: f64 = 0.5358;

/// The integral of the CIE 1931 y curve over nanometres, by which Mitsuba divides when it turns spectra into colours.
pub(super) const CIE_Y_INTEGRAL: f64 = 106.856_980;

/// The sun's effective temperature in kelvin.
const SUN_KELVIN: f64 = 5778.0;

/// Ozone absorption in 1/cm every 20 nm from 440 nm (Preetham's table 2).
const OZONE: [f64; 18] = [
    0.003, 0.009, 0.014, 0.021, 0.04, 0.063, 0.08, 0.103, 0.12, 0.115, 0.12, 0.09, 0.067, 0.048, 0.028, 0.018, 0.011,
    0.009,
];

/// Linear Rec. 709 radiance of the sun's disc `elevation` radians above the horizon, in Mitsuba's unit: W/(m^2 sr nm)
/// weighted by the CIE curves and divided by [`CIE_Y_INTEGRAL`]. Not negative.
pub(super) fn radiance(elevation: f64, turbidity: f64) -> [f64; 3] {
    let zenith_deg = 90.0 - elevation.max(0.0).to_degrees();
    // Kasten's relative optical mass.
    let mass = 1.0 / (libm::sin(elevation.max(0.0)) + 0.15 * libm::pow(93.885 - zenith_deg, -1.253)).max(1e-4);
    let mut xyz = [0.0; 3];
    for step in 0..=40 {
        let nanometres = 380.0 + 10.0 * f64::from(step);
        let value = black_body(nanometres, SUN_KELVIN) * transmittance(nanometres, mass, turbidity);
        xyz.iter_mut().zip(cie_1931(nanometres)).for_each(|(sum, weight)| *sum += value * weight * 10.0);
    }
    rec709_from_xyz(xyz.map(|v| v / CIE_Y_INTEGRAL)).map(|v| v.max(0.0))
}

/// Planck's law at a temperature in kelvin: W/(m^2 sr nm).
pub(super) fn black_body(nanometres: f64, kelvin: f64) -> f64 {
    const TWO_H_C2: f64 = 1.191_042_97e-16;
    const H_C_OVER_K: f64 = 0.014_387_769;
    let metres = nanometres * 1e-9;
    TWO_H_C2 / (libm::pow(metres, 5.0) * (libm::exp(H_C_OVER_K / (metres * kelvin)) - 1.0)) * 1e-9
}

fn transmittance(nanometres: f64, mass: f64, turbidity: f64) -> f64 {
    let micrometres = nanometres / 1000.0;
    let rayleigh = 0.008735 * libm::pow(micrometres, -4.08);
    let aerosol = (0.04608 * turbidity - 0.04586).max(0.0) * libm::pow(micrometres, -1.3);
    let ozone = 0.35 * ozone(nanometres);
    libm::exp(-mass * (rayleigh + aerosol + ozone))
}

fn ozone(nanometres: f64) -> f64 {
    let at = (nanometres - 440.0) / 20.0;
    if at < 0.0 || at >= (OZONE.len() - 1) as f64 {
        return 0.0;
    }
    let (lower, part) = (at.floor() as usize, at.fract());
    OZONE[lower] * (1.0 - part) + OZONE[lower + 1] * part
}

/// The CIE 1931 colour matching functions, after Wyman, Sloan and Shirley, "Simple analytic approximations to the CIE XYZ
/// color matching functions" (JCGT 2013).
fn cie_1931(nanometres: f64) -> [f64; 3] {
    let bump = |height: f64, centre: f64, below: f64, above: f64| {
        let t = (nanometres - centre) * if nanometres < centre { below } else { above };
        height * libm::exp(-0.5 * t * t)
    };
    [
        bump(0.362, 442.0, 0.0624, 0.0374) + bump(1.056, 599.8, 0.0264, 0.0323) - bump(0.065, 501.1, 0.0490, 0.0382),
        bump(0.821, 568.8, 0.0213, 0.0247) + bump(0.286, 530.9, 0.0613, 0.0322),
        bump(1.217, 437.0, 0.0845, 0.0278) + bump(0.681, 459.0, 0.0385, 0.0725),
    ]
}

/// The matrix of IEC 61966-2-1.
pub(super) fn rec709_from_xyz([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240_479 * x - 1.537_150 * y - 0.498_535 * z,
        -0.969_256 * x + 1.875_991 * y + 0.041_556 * z,
        0.055_648 * x - 0.204_043 * y + 1.057_311 * z,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The radiance at the centre of the disc in Mitsuba 3.9.1's `sunsky`, which uses a newer, measured sun.
    #[test]
    fn near_mitsubas_newer_model() {
        for (elevation, turbidity, expected) in [
            (30.0_f64, 3.0, [20274.0, 15950.0, 10618.0]),
            (60.0, 3.0, [21873.0, 18316.0, 14106.0]),
            (90.0, 2.0, [22524.0, 19106.0, 15102.0]),
            (45.0, 1.0, [22129.0, 18244.0, 13410.0]),
        ] {
            let found = radiance(elevation.to_radians(), turbidity);
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 0.4, "{elevation} {turbidity}: {found} {expected}");
            }
        }
    }

    #[test]
    fn the_sun_reddens_and_dims_towards_the_horizon() {
        let [high, low] = [60.0_f64, 5.0].map(|deg| radiance(deg.to_radians(), 3.0));
        assert!(low[1] < high[1] && low[2] / low[0] < high[2] / high[0]);
        for elevation in [-1.0, 0.0, f64::EPSILON, 1.0, 2.0] {
            for turbidity in [1.0, 10.0] {
                assert!(radiance(elevation, turbidity).iter().all(|v| v.is_finite() && *v >= 0.0));
            }
        }
    }

    #[test]
    fn curves_have_the_integral_that_spectra_are_divided_by() {
        let sum: f64 = (0..=400).map(|step| cie_1931(380.0 + f64::from(step))[1]).sum();
        assert!((sum / CIE_Y_INTEGRAL - 1.0).abs() < 0.01, "{sum}");
    }
}
