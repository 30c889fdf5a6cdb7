//! Constant colours in every form that Mitsuba 0.5 to 3 documents: `<rgb>`, `<srgb>`, `<float>`, `<spectrum>` by pairs
//! of wavelength and value, by one value, from a file and by plugin, and `<blackbody>`.
//!
//! Spectra become linear Rec. 709 as in Mitsuba 3.9.1's RGB mode: the CIE 1931 observer sees a reflectance under D65,
//! and an emission as it is.

use mateval_files::source_folder::SourceFolder;
use mateval_files::untrusted::{shortened, without_mark};

use super::document::Element;
use super::reader::{at_most, number, number_within, numbers, out_of_range, triple, words, wrong_count};
use crate::open::Invalid;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColorUse {
    /// A share of light, from 0 to 1.
    Reflectance,
    Emission,
    Index,
}

/// First wavelength of the tables, in nanometres.
const FIRST_NM: f64 = 360.0;
/// Their step, in nanometres.
const STEP_NM: f64 = 5.0;
/// Their length: up to 830 nm.
const SAMPLES: usize = 95;
/// Mitsuba's number of places at which it sums a spectrum.
const STEPS: usize = 1000;
/// The largest reflectance that counts as 1 with noise.
pub(super) const MOST_REFLECTANCE: f64 = 1.001;
/// Most pairs of a spectrum.
const MOST_PAIRS: usize = 4096;

/// The integral of the CIE 1931 y curve over nanometres, by which Mitsuba divides when it turns spectra into colours.
pub(super) const CIE_Y_INTEGRAL: f64 = 106.856_980;

/// The CIE 1931 colour matching functions x, y and z of the 2 degree observer (CIE 015:2018, table 6), every 5 nm from
/// 360 nm on.
const OBSERVER: [[f64; SAMPLES]; 3] = [
    [
        1.299e-4, 2.321e-4, 4.149e-4, 7.416e-4, 0.001368, 0.002236, 0.004243, 0.00765, 0.01431, 0.02319, 0.04351,
        0.07763, 0.13438, 0.21477, 0.2839, 0.3285, 0.34828, 0.34806, 0.3362, 0.3187, 0.2908, 0.2511, 0.19536, 0.1421,
        0.09564, 0.05795, 0.03201, 0.0147, 0.0049, 0.0024, 0.0093, 0.0291, 0.06327, 0.1096, 0.1655, 0.22575, 0.2904,
        0.3597, 0.43345, 0.51205, 0.5945, 0.6784, 0.7621, 0.8425, 0.9163, 0.9786, 1.0263, 1.0567, 1.0622, 1.0456,
        1.0026, 0.9384, 0.85445, 0.7514, 0.6424, 0.5419, 0.4479, 0.3608, 0.2835, 0.2187, 0.1649, 0.1212, 0.0874,
        0.0636, 0.04677, 0.0329, 0.0227, 0.01584, 0.0113592, 0.00811092, 0.00579035, 0.00410946, 0.00289933,
        0.00204919, 0.00143997, 9.99949e-4, 6.90079e-4, 4.76021e-4, 3.32301e-4, 2.34826e-4, 1.6615e-4, 1.17413e-4,
        8.30753e-5, 5.87065e-5, 4.15099e-5, 2.93533e-5, 2.06738e-5, 1.45598e-5, 1.0254e-5, 7.2215e-6, 5.0859e-6,
        3.5817e-6, 2.5225e-6, 1.7765e-6, 1.2511e-6,
    ],
    [
        3.917e-6, 6.965e-6, 1.239e-5, 2.202e-5, 3.9e-5, 6.4e-5, 1.2e-4, 2.17e-4, 3.96e-4, 6.4e-4, 0.00121, 0.00218,
        0.004, 0.0073, 0.0116, 0.01684, 0.023, 0.0298, 0.038, 0.048, 0.06, 0.0739, 0.09098, 0.1126, 0.13902, 0.1693,
        0.20802, 0.2586, 0.323, 0.4073, 0.503, 0.6082, 0.71, 0.7932, 0.862, 0.91485, 0.954, 0.9803, 0.99495, 1.0,
        0.995, 0.9786, 0.952, 0.9154, 0.87, 0.8163, 0.757, 0.6949, 0.631, 0.5668, 0.503, 0.4412, 0.381, 0.321, 0.265,
        0.217, 0.175, 0.1382, 0.107, 0.0816, 0.061, 0.04458, 0.032, 0.0232, 0.017, 0.01192, 0.00821, 0.005723,
        0.004102, 0.002929, 0.002091, 0.001484, 0.001047, 7.4e-4, 5.2e-4, 3.611e-4, 2.492e-4, 1.719e-4, 1.2e-4,
        8.48e-5, 6e-5, 4.24e-5, 3e-5, 2.12e-5, 1.499e-5, 1.06e-5, 7.4657e-6, 5.2578e-6, 3.7029e-6, 2.6078e-6,
        1.8366e-6, 1.2934e-6, 9.109e-7, 6.415e-7, 4.518e-7,
    ],
    [
        6.061e-4, 0.001086, 0.001946, 0.003486, 0.00645, 0.01055, 0.02005, 0.03621, 0.06785, 0.1102, 0.2074, 0.3713,
        0.6456, 1.03905, 1.3856, 1.62296, 1.74706, 1.7826, 1.77211, 1.7441, 1.6692, 1.5281, 1.28764, 1.0419, 0.81295,
        0.6162, 0.46518, 0.3533, 0.272, 0.2123, 0.1582, 0.1117, 0.07825, 0.05725, 0.04216, 0.02984, 0.0203, 0.0134,
        0.00875, 0.00575, 0.0039, 0.00275, 0.0021, 0.0018, 0.00165, 0.0014, 0.0011, 0.001, 8e-4, 6e-4, 3.4e-4, 2.4e-4,
        1.9e-4, 1e-4, 5e-5, 3e-5, 2e-5, 1e-5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0,
    ],
];

/// The relative power of the illuminant D65 (CIE 015:2018, table 5) at the same wavelengths, scaled so that a surface
/// which reflects everything has luminance 1.
const D65: [f64; SAMPLES] = [
    0.471106, 0.498636, 0.526166, 0.515491, 0.504816, 0.528416, 0.552016, 0.693973, 0.83593, 0.880027, 0.924125,
    0.933953, 0.94378, 0.90969, 0.875602, 0.967435, 1.05927, 1.12059, 1.18193, 1.18599, 1.19005, 1.17514, 1.16024,
    1.16561, 1.17097, 1.13505, 1.09913, 1.10187, 1.10461, 1.09678, 1.08894, 1.07372, 1.05851, 1.07315, 1.0878, 1.07121,
    1.05462, 1.05281, 1.051, 1.03056, 1.01013, 0.991613, 0.973098, 0.970339, 0.967581, 0.931709, 0.895838, 0.902507,
    0.909177, 0.907121, 0.905065, 0.895467, 0.885869, 0.863594, 0.841321, 0.843395, 0.845469, 0.826921, 0.808373,
    0.809321, 0.81027, 0.82069, 0.831111, 0.81094, 0.79077, 0.747522, 0.704274, 0.713809, 0.723343, 0.737181, 0.75102,
    0.686649, 0.622279, 0.664106, 0.705934, 0.732204, 0.758474, 0.70042, 0.642367, 0.555625, 0.468883, 0.571851,
    0.67482, 0.657533, 0.640247, 0.6449, 0.649552, 0.625046, 0.60054, 0.562696, 0.524852, 0.552538, 0.580223, 0.594728,
    0.609233,
];

/// The linear Rec. 709 colour of an element. `major_version` is that of the scene. A file is read from `folder`.
pub(super) fn constant_color(
    element: &Element,
    usage: ColorUse,
    major_version: u32,
    folder: &mut SourceFolder,
) -> Result<[f64; 3], Invalid> {
    let text = element.attribute("value").unwrap_or("").trim();
    match element.tag.as_str() {
        "float" | "integer" => Ok([number(text)?; 3]),
        "rgb" if text.starts_with('#') => hex(text),
        "rgb" => triple(text),
        "srgb" if text.starts_with('#') => hex(text),
        "srgb" => Ok(triple(text)?.map(linear)),
        "blackbody" if usage == ColorUse::Reflectance => Err(Invalid::new(NOT_A_REFLECTANCE)),
        "blackbody" => {
            let kelvin = element.attribute("temperature").unwrap_or("").trim().trim_end_matches(['k', 'K']);
            let scale = element.attribute("scale").map_or(Ok(1.0), number)?;
            Ok(of_black_body(number_within(kelvin, 1.0, 1e6)?).map(|v| v * scale))
        }
        "spectrum" => spectrum(element, text, usage, major_version, folder),
        other => Err(not_a_color(other)),
    }
}

const NOT_A_REFLECTANCE: &str = "expected a reflectance, found the emission of a black body";

fn not_a_color(found: &str) -> Invalid {
    Invalid(format!("expected a colour, found <{}>", shortened(found)))
}

fn linear(value: f64) -> f64 {
    f64::from(mateval_image::transfer::linear_from_srgb(value as f32))
}

/// `#rrggbb`, sRGB.
fn hex(text: &str) -> Result<[f64; 3], Invalid> {
    let refused = || Invalid(format!("expected # and six hexadecimal digits, found '{}'", shortened(text)));
    let digits =
        text.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_hexdigit()));
    let word = u32::from_str_radix(digits.ok_or_else(refused)?, 16).map_err(|_| refused())?;
    Ok([16, 8, 0].map(|shift| linear(f64::from(word >> shift & 255) / 255.0)))
}

fn spectrum(
    element: &Element,
    text: &str,
    usage: ColorUse,
    major_version: u32,
    folder: &mut SourceFolder,
) -> Result<[f64; 3], Invalid> {
    // By plugin, as in Mitsuba 2 and 3: by children, or by attributes of the same names.
    let child = |name: &str| {
        let found = element.children.iter().find(|child| child.name() == name);
        found.map_or_else(|| element.attribute(name), |child| child.attribute("value"))
    };
    let needed = |name: &'static str| child(name).ok_or_else(|| Invalid(format!("expected '{name}', found none")));
    match element.kind() {
        "" => {}
        "uniform" => return Ok([number(needed("value")?)?; 3]),
        "d65" => return Ok([child("scale").map_or(Ok(1.0), number)?; 3]),
        "blackbody" if usage == ColorUse::Reflectance => return Err(Invalid::new(NOT_A_REFLECTANCE)),
        "blackbody" => return Ok(of_black_body(number_within(needed("temperature")?, 1.0, 1e6)?)),
        "irregular" => {
            let (wavelengths, values) = (many(needed("wavelengths")?)?, many(needed("values")?)?);
            if wavelengths.len() != values.len() {
                return Err(wrong_count("as many values as wavelengths", values.len()));
            }
            return integrated(&wavelengths.into_iter().zip(values).collect::<Vec<_>>(), usage);
        }
        "regular" => {
            let (least, most) = (number(needed("wavelength_min")?)?, number(needed("wavelength_max")?)?);
            let values = many(needed("values")?)?;
            let last = values.len().saturating_sub(1).max(1) as f64;
            let pair = |(at, value): (usize, f64)| (least + (most - least) * at as f64 / last, value);
            return integrated(&values.into_iter().enumerate().map(pair).collect::<Vec<_>>(), usage);
        }
        other => return Err(not_a_color(other)),
    }
    // By pairs, in a file or in the text.
    if let Some(name) = element.attribute("filename") {
        let read = SourceFolder::relative(name).and_then(|name| folder.read(&name));
        let bytes = read.map_err(|fault| Invalid(fault.message))?;
        let text = String::from_utf8_lossy(without_mark(&bytes));
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or("").trim());
        let pair = |line: &str| match many(line)?[..] {
            [wavelength, value] => Ok((wavelength, value)),
            ref other => Err(wrong_count("2", other.len())),
        };
        return integrated(&at_most(MOST_PAIRS, lines.filter(|line| !line.is_empty()), pair)?, usage);
    }
    if text.contains(':') {
        let pair = |word: &str| {
            let refused = || Invalid(format!("expected wavelength:value, found '{}'", shortened(word)));
            let (wavelength, value) = word.split_once(':').ok_or_else(refused)?;
            Ok((number(wavelength)?, number(value)?))
        };
        return integrated(&at_most(MOST_PAIRS, words(text), pair)?, usage);
    }
    // One value is the same at all wavelengths, which Mitsuba 2 and 3 do not take for white where it emits.
    match numbers(text)?[..] {
        [one] if usage == ColorUse::Emission && major_version >= 2 => {
            integrated(&[(FIRST_NM, one), (FIRST_NM + STEP_NM * (SAMPLES - 1) as f64, one)], usage)
        }
        _ => triple(text),
    }
}

fn many(text: &str) -> Result<Vec<f64>, Invalid> {
    at_most(MOST_PAIRS, words(text), number)
}

/// The colour of a spectrum of pairs of wavelength in nanometres and value, between which it is linear. It is 0
/// outside.
fn integrated(pairs: &[(f64, f64)], usage: ColorUse) -> Result<[f64; 3], Invalid> {
    if pairs.len() < 2 || pairs.windows(2).any(|two| two[0].0 >= two[1].0) {
        return Err(Invalid::new("expected two or more wavelengths, each above the one before"));
    }
    // A reflectance in percent, say, would be clamped to white below.
    let outside = pairs.iter().find(|(_, value)| !(0.0..=MOST_REFLECTANCE).contains(value));
    if let (ColorUse::Reflectance, Some((_, found))) = (usage, outside) {
        return Err(out_of_range(0.0, 1.0, *found));
    }
    let range = STEP_NM * (SAMPLES - 1) as f64;
    let mut xyz = [0.0; 3];
    for step in 0..STEPS {
        let nanometres = FIRST_NM + range * step as f64 / (STEPS - 1) as f64;
        let after = pairs.partition_point(|(wavelength, _)| *wavelength <= nanometres);
        let at_end = nanometres == pairs[pairs.len() - 1].0;
        let value = match (after, at_end) {
            (_, true) => pairs[pairs.len() - 1].1,
            (0, _) => continue,
            (after, _) if after == pairs.len() => continue,
            (after, _) => {
                let ((x0, y0), (x1, y1)) = (pairs[after - 1], pairs[after]);
                y0 + (y1 - y0) * (nanometres - x0) / (x1 - x0)
            }
        };
        let light = if usage == ColorUse::Emission { 1.0 } else { tabulated(nanometres, &D65) };
        for (sum, curve) in xyz.iter_mut().zip(&OBSERVER) {
            *sum += value * light * tabulated(nanometres, curve);
        }
    }
    let scale = range / (STEPS - 1) as f64 / CIE_Y_INTEGRAL;
    let rgb = rec709_from_xyz(xyz.map(|v| v * scale));
    // Colours that no display shows are clamped, as in Mitsuba.
    let most = if usage == ColorUse::Reflectance { 1.0 } else { f64::INFINITY };
    Ok(rgb.map(|v| v.clamp(0.0, most)))
}

/// A value of a table between its wavelengths.
fn tabulated(nanometres: f64, table: &[f64; SAMPLES]) -> f64 {
    let at = ((nanometres - FIRST_NM) / STEP_NM).clamp(0.0, (SAMPLES - 1) as f64);
    let lower = (at as usize).min(SAMPLES - 2);
    let part = at - lower as f64;
    table[lower] * (1.0 - part) + table[lower + 1] * part
}

/// The radiance of a black body in W/(m^2 sr nm), weighted by the observer.
fn of_black_body(kelvin: f64) -> [f64; 3] {
    let mut xyz = [0.0; 3];
    for at in 0..SAMPLES {
        let radiance = black_body(FIRST_NM + STEP_NM * at as f64, kelvin) * STEP_NM / CIE_Y_INTEGRAL;
        xyz.iter_mut().zip(&OBSERVER).for_each(|(sum, curve)| *sum += radiance * curve[at]);
    }
    rec709_from_xyz(xyz).map(|v| v.max(0.0))
}

/// Planck's law at a temperature in kelvin: W/(m^2 sr nm).
pub(super) fn black_body(nanometres: f64, kelvin: f64) -> f64 {
    const TWO_H_C2: f64 = 1.191_042_97e-16;
    const H_C_OVER_K: f64 = 0.014_387_769;
    let metres = nanometres * 1e-9;
    TWO_H_C2 / (libm::pow(metres, 5.0) * (libm::exp(H_C_OVER_K / (metres * kelvin)) - 1.0)) * 1e-9
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
    use crate::bitterli::document::Document;
    use crate::log::Log;

    fn color(element: &str, usage: ColorUse) -> Result<[f64; 3], Invalid> {
        let folder = tempfile::tempdir().unwrap();
        let spectrum = "# nm value\n400 0.05\n500 0.05\n600 0.7\n700 0.7\n";
        std::fs::write(folder.path().join("a.spd"), spectrum).unwrap();
        std::fs::write(folder.path().join("marked.spd"), format!("\u{feff}{}", &spectrum[11..])).unwrap();
        let mut folder = SourceFolder::new(folder.path(), 1 << 20).unwrap();
        let mut log = Log::new("scene.xml".into(), 100);
        let document = Document::parse_text(&format!("<scene version='3.0.0'>{element}</scene>"), &mut log);
        constant_color(&document.unwrap().root.children[0], usage, 3, &mut folder)
    }

    fn assert_near(found: [f64; 3], expected: [f64; 3], what: &str) {
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-4), "{what}: {found:?} {expected:?}");
    }

    /// The values that Mitsuba 3.9.1 reads in its RGB mode.
    #[test]
    fn spectra_as_mitsuba() {
        let pairs = "400:0.05, 500:0.05, 600:0.7, 700:0.7";
        for (element, expected) in [
            (format!("<spectrum value='{pairs}'/>"), [0.853051, 0.314464, 0.004774]),
            (format!("<spectrum value='{}'/>", pairs.replace(',', "")), [0.853051, 0.314464, 0.004774]),
            ("<spectrum filename='a.spd'/>".to_owned(), [0.853051, 0.314464, 0.004774]),
            // The same after a byte order mark, and by plugin.
            ("<spectrum filename='marked.spd'/>".to_owned(), [0.853051, 0.314464, 0.004774]),
            (
                "<spectrum type='irregular' wavelengths='400, 500, 600, 700' values='0.05, 0.05, 0.7, 0.7'/>"
                    .to_owned(),
                [0.853051, 0.314464, 0.004774],
            ),
            ("<spectrum value='0.3'/>".to_owned(), [0.3; 3]),
            ("<spectrum value='450:1 451:1'/>".to_owned(), [0.001468, 0.0, 0.019584]),
            ("<spectrum value='360:0.5 830:0.5'/>".to_owned(), [0.499493, 0.499437, 0.499401]),
            ("<spectrum type='uniform'><float name='value' value='0.4'/></spectrum>".to_owned(), [0.4; 3]),
        ] {
            assert_near(color(&element, ColorUse::Reflectance).unwrap(), expected, &element);
        }
        for (element, expected) in [
            (format!("<spectrum value='{pairs}'/>"), [0.971916, 0.304049, 0.0]),
            ("<spectrum value='360:1 830:1'/>".to_owned(), [1.20488, 0.948228, 0.909267]),
            ("<spectrum type='d65'><float name='scale' value='2'/></spectrum>".to_owned(), [2.0; 3]),
        ] {
            assert_near(color(&element, ColorUse::Emission).unwrap(), expected, &element);
        }
        // Of one value, Mitsuba integrates the curves with another step.
        let one = color("<spectrum value='2'/>", ColorUse::Emission).unwrap();
        assert_near(one.map(|v| v / 10.0), [0.240959, 0.189658, 0.181783], "2");
    }

    /// Planckian colours by CIE 015: the chromaticity of 6500 K is (0.3135, 0.3237).
    #[test]
    fn black_bodies() {
        let [red, green, blue] = color("<blackbody temperature='6500K' scale='1e-3'/>", ColorUse::Emission).unwrap();
        let xyz = [
            0.412453 * red + 0.357580 * green + 0.180423 * blue,
            0.212671 * red + 0.715160 * green + 0.072169 * blue,
            0.019334 * red + 0.119193 * green + 0.950227 * blue,
        ];
        let sum: f64 = xyz.iter().sum();
        assert!((xyz[0] / sum - 0.3135).abs() < 1e-3 && (xyz[1] / sum - 0.3237).abs() < 1e-3, "{xyz:?}");
    }

    #[test]
    fn hex_colours_are_srgb_and_others_are_refused() {
        let expected = [0.215861, 0.527115, 0.014444];
        for tag in ["srgb", "rgb"] {
            assert_near(color(&format!("<{tag} value='#80c020'/>"), ColorUse::Reflectance).unwrap(), expected, tag);
        }
        for bad in [
            "<srgb value='#80c0'/>",
            "<rgb value='#8c2'/>",
            "<rgb value='#80c020ff'/>",
            "<rgb value='0.4;0.1;0.2'/>",
            "<rgb/>",
            "<spectrum value='400:30 700:60'/>",
            "<spectrum value='400:-0.1 700:0.5'/>",
            "<blackbody temperature='6500'/>",
            "<spectrum type='blackbody'><float name='temperature' value='6500'/></spectrum>",
            "<srgb value='#+0c020'/>",
            "<spectrum value='400:1 500'/>",
            "<spectrum value='400:1'/>",
            "<spectrum value='500:1 400:1'/>",
            "<spectrum filename='none.spd'/>",
            "<spectrum type='tabulated'/>",
            "<blackbody temperature='-3'/>",
            "<string value='red'/>",
        ] {
            assert!(color(bad, ColorUse::Reflectance).is_err(), "{bad}");
        }
    }
}
