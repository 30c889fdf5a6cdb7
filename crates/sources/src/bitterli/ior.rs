//! Indices of refraction that Mitsuba knows by name.

use mateval_scene::material::ConductorIor;

/// Dielectrics at 589.3 nm (the names of Mitsuba's documentation; values as there, from the usual reference tables).
const DIELECTRICS: [(&str, f64); 24] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
    ("glass", 1.5),
];

/// The index of refraction of the dielectric `name`; none where it is unknown.
pub(super) fn dielectric(name: &str) -> Option<f64> {
    let name = name.trim().to_ascii_lowercase();
    DIELECTRICS.iter().find(|(known, _)| *known == name).map(|(_, index)| *index)
}

/// Metals: linear Rec. 709 eta and k, which Mitsuba 3.9.1 integrates in its RGB mode from the measured spectra of its
/// `data/ior` (Palik's handbook and the SOPRA database). Bitterli's own exports carry the same values to four digits.
const METALS: [(&str, [f32; 3], [f32; 3]); 16] = [
    ("ag", [0.155276, 0.116728, 0.138388], [4.82835, 3.12222, 2.1469]),
    ("al", [1.6575, 0.880405, 0.521244], [9.22381, 6.2695, 4.837]),
    ("au", [0.143036, 0.375307, 1.44205], [3.983, 2.38556, 1.60336]),
    ("be", [4.18501, 3.18503, 2.78406], [3.83547, 3.01012, 2.86899]),
    ("cr", [4.36967, 2.91651, 1.6549], [5.20655, 4.23131, 3.7547]),
    ("cu", [0.201005, 0.92375, 1.10222], [3.91326, 2.45305, 2.14209]),
    ("hg", [2.39894, 1.44003, 0.90957], [6.32759, 4.37192, 3.42176]),
    ("ir", [3.0863, 2.08219, 1.61791], [5.59215, 4.06709, 3.26731]),
    ("li", [0.265791, 0.195618, 0.220949], [3.54015, 2.31112, 1.66861]),
    ("mo", [4.48397, 3.52513, 2.77631], [4.11144, 3.42083, 3.15061]),
    ("nb", [3.42007, 2.79009, 2.39563], [3.44139, 2.73767, 2.57975]),
    ("ni_palik", [2.3673, 1.66337, 1.46708], [4.49881, 3.05015, 2.34544]),
    ("rh", [2.58579, 1.86022, 1.55426], [6.78226, 4.70299, 3.97607]),
    ("ta", [2.06272, 2.39294, 2.62793], [2.40836, 1.74149, 1.94703]),
    ("tin", [1.64845, 1.15052, 1.37982], [3.36833, 1.9435, 1.10207]),
    ("w", [4.37082, 3.30025, 2.99841], [3.50064, 2.60487, 2.27323]),
];

/// The conductor `name`, where `none` names a perfect mirror. None where the name is unknown.
pub(super) fn conductor(name: &str) -> Option<ConductorIor> {
    let name = name.trim().to_ascii_lowercase();
    if name == "none" {
        return Some(ConductorIor::PerfectMirror);
    }
    let (_, eta, k) = METALS.iter().find(|(known, ..)| *known == name)?;
    Some(ConductorIor::EtaK { eta: *eta, k: *k })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mitsuba 3.9.1 prints 1.48959 for plastic (polypropylene over air) and 1.50418 for glass (bk7 over air).
    #[test]
    fn ratios_as_mitsuba_prints_them() {
        let ratio = |inside, outside| dielectric(inside).unwrap() / dielectric(outside).unwrap();
        assert!((ratio("polypropylene", "air") - 1.48959).abs() < 1e-5);
        assert!((ratio("BK7", "air") - 1.50418).abs() < 1e-5);
        assert!(dielectric("unobtainium").is_none());
    }

    /// Gold is yellow: ((eta-1)^2 + k^2) / ((eta+1)^2 + k^2), computed by hand. Silver is grey.
    #[test]
    fn metals_have_their_colours() {
        let gold = conductor("Au").unwrap().reflectance_at_normal();
        for (found, expected) in gold.into_iter().zip([0.9667, 0.8020, 0.3241]) {
            assert!((found - expected).abs() < 1e-3, "{gold:?}");
        }
        assert!(conductor("Ag").unwrap().reflectance_at_normal()[2] > 0.85);
        assert!(conductor("unobtainium").is_none());
    }
}
