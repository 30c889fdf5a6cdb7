//! The colour space that a photo's file states: an ICC profile, or the chunks gAMA, cHRM and cICP of a PNG.
//!
//! Telephones store photos in Display P3. A profile of three primaries and three curves is applied; any other is refused by
//! its name, since taking it for sRGB would change every colour.

use std::io::Cursor;
use std::path::Path;

use image::{ImageDecoder as _, ImageReader};
use moxcms::{ColorProfile, DataColorSpace, LocalizableString, ProfileText, ToneReprCurve, Xyzd};

use crate::ImageError;

/// Linear Rec. 709 from XYZ under D50, as ICC profiles have it: the inverse of the columns of the sRGB profile (ICC,
/// "sRGB.icc", Bradford-adapted).
const REC709_FROM_D50: [[f64; 3]; 3] = [
    [3.133_856_1, -1.616_866_7, -0.490_614_6],
    [-0.978_768_4, 1.916_141_5, 0.033_454_0],
    [0.071_945_3, -0.228_991_4, 1.405_242_7],
];
/// sRGB's primaries and white, as cHRM states them.
const REC709: [f64; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];
/// Profiles within this of sRGB are sRGB: the difference of a third of a byte.
const SAME: f64 = 1.5e-3;

/// The curves and primaries of a profile, unless they are those of sRGB.
pub(crate) struct Profile {
    curves: [ToneReprCurve; 3],
    /// Rows: linear Rec. 709 from the profile's linear colour.
    rec709_from_linear: [[f64; 3]; 3],
}

impl Profile {
    /// The profile that a file states; none for sRGB and for a file without any. Fails where it can neither be applied nor
    /// taken for sRGB.
    pub(crate) fn of(path: &Path, bytes: &[u8]) -> Result<Option<Self>, ImageError> {
        let unsupported = |what: String| ImageError::Unsupported { path: path.to_owned(), what };
        let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().ok();
        let profile = reader.and_then(|reader| reader.into_decoder().ok()?.icc_profile().ok().flatten());
        if let Some(icc) = profile {
            let refused = |name: &str| {
                let what = format!("its colour profile is '{name}', which is not read; convert the photo to sRGB");
                unsupported(what)
            };
            let parsed = ColorProfile::new_from_slice(&icc).map_err(|_| refused("(damaged)"))?;
            let name = name_of(&parsed);
            return Self::of_icc(&parsed).ok_or_else(|| refused(&name)).map(|found| found.filter(|p| !p.is_srgb()));
        }
        check_png(bytes).map_err(unsupported).map(|()| None)
    }

    /// None where the profile is not of primaries and curves; inside, none where it has the identity.
    fn of_icc(profile: &ColorProfile) -> Option<Option<Self>> {
        if profile.color_space == DataColorSpace::Gray {
            // The curve of a grey photo is nearly always that of sRGB or a power of 2.2, and its colour is grey.
            return Some(None);
        }
        let curves = [profile.red_trc.clone()?, profile.green_trc.clone()?, profile.blue_trc.clone()?];
        let columns = [profile.red_colorant, profile.green_colorant, profile.blue_colorant];
        if profile.color_space != DataColorSpace::Rgb || profile.pcs != DataColorSpace::Xyz {
            return None;
        }
        let row = |row: [f64; 3]| columns.map(|Xyzd { x, y, z }| row[0] * x + row[1] * y + row[2] * z);
        let matrix = REC709_FROM_D50.map(row);
        matrix.iter().flatten().all(|v| v.is_finite()).then_some(Some(Self { curves, rec709_from_linear: matrix }))
    }

    /// Whether every colour stays as sRGB has it, within [`SAME`].
    fn is_srgb(&self) -> bool {
        let identity = |r: usize, c: usize| if r == c { 1.0 } else { 0.0 };
        let is_identity = |(r, c): (usize, usize)| (self.rec709_from_linear[r][c] - identity(r, c)).abs() < SAME;
        let srgb = |stored: f64| f64::from(crate::transfer::linear_from_srgb(stored as f32));
        let is_curve = |curve: &ToneReprCurve| {
            (0..=32).map(|at| f64::from(at) / 32.0).all(|stored| (evaluated(curve, stored) - srgb(stored)).abs() < SAME)
        };
        (0..3).flat_map(|r| (0..3).map(move |c| (r, c))).all(is_identity) && self.curves.iter().all(is_curve)
    }

    /// The linear Rec. 709 colour of a stored one, 0 to 1. Colours outside of Rec. 709 are clamped at 0.
    pub(crate) fn linear(&self, stored: [f64; 3]) -> [f32; 3] {
        let own: [f64; 3] = std::array::from_fn(|channel| evaluated(&self.curves[channel], stored[channel]));
        self.rec709_from_linear.map(|row| row.iter().zip(own).map(|(a, b)| a * b).sum::<f64>().max(0.0) as f32)
    }
}

/// The value of a curve (ICC.1:2022, sections 10.6 and 10.18).
fn evaluated(curve: &ToneReprCurve, x: f64) -> f64 {
    match curve {
        ToneReprCurve::Lut(table) if table.is_empty() => x,
        // One entry is a power in steps of 1/256.
        ToneReprCurve::Lut(table) if table.len() == 1 => libm::pow(x, f64::from(table[0]) / 256.0),
        ToneReprCurve::Lut(table) => {
            let at = x.clamp(0.0, 1.0) * (table.len() - 1) as f64;
            let lower = (at as usize).min(table.len() - 2);
            let value = |index: usize| f64::from(table[index]) / 65535.0;
            value(lower) + (value(lower + 1) - value(lower)) * (at - lower as f64)
        }
        ToneReprCurve::Parametric(parameters) => {
            let p = |index: usize| f64::from(parameters[index]);
            let power = |base: f64| libm::pow(base.max(0.0), p(0));
            match parameters.len() {
                1 => power(x),
                3 => {
                    if x >= -p(2) / p(1) {
                        power(p(1) * x + p(2))
                    } else {
                        0.0
                    }
                }
                4 => {
                    if x >= -p(2) / p(1) {
                        power(p(1) * x + p(2)) + p(3)
                    } else {
                        p(3)
                    }
                }
                5 => {
                    if x >= p(4) {
                        power(p(1) * x + p(2))
                    } else {
                        p(3) * x
                    }
                }
                7 => {
                    if x >= p(4) {
                        power(p(1) * x + p(2)) + p(5)
                    } else {
                        p(3) * x + p(6)
                    }
                }
                _ => x,
            }
        }
    }
}

fn name_of(profile: &ColorProfile) -> String {
    let text = match &profile.description {
        Some(ProfileText::PlainString(text)) => text.clone(),
        Some(ProfileText::Localizable(all)) => {
            all.first().map(|text: &LocalizableString| text.value.clone()).unwrap_or_default()
        }
        Some(ProfileText::Description(text)) => text.ascii_string.clone(),
        None => String::new(),
    };
    let text: String = text.chars().filter(|c| !c.is_control()).take(60).collect();
    if text.is_empty() { "(without a name)".to_owned() } else { text }
}

/// Fails where a PNG states other colours than sRGB. Other files pass.
fn check_png(bytes: &[u8]) -> Result<(), String> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_ignore_text_chunk(true);
    let Ok(info) = decoder.read_header_info() else { return Ok(()) };
    // Those chunks follow the header.
    let _ = info;
    let Ok(reader) = decoder.read_info() else { return Ok(()) };
    let info = reader.info();
    if let Some(code) = info.coding_independent_code_points {
        let (primaries, transfer) = (code.color_primaries, code.transfer_function);
        // ITU-T H.273: primaries 1 are Rec. 709, transfer 13 is sRGB's.
        return if (primaries, transfer) == (1, 13) {
            Ok(())
        } else {
            Err(format!(
                "its chunk cICP states primaries {primaries} and transfer {transfer}; convert the photo to sRGB"
            ))
        };
    }
    if info.srgb.is_some() {
        return Ok(());
    }
    if let Some(gamma) =
        info.gama_chunk.map(|gamma| f64::from(gamma.into_value())).filter(|g| (g - 1.0 / 2.2).abs() > 0.01)
    {
        return Err(format!(
            "its chunk gAMA states a power of {gamma}, sRGB has about 0.45455; convert the photo to sRGB"
        ));
    }
    let primaries = info.chrm_chunk.map(|c| {
        [c.red.0, c.red.1, c.green.0, c.green.1, c.blue.0, c.blue.1, c.white.0, c.white.1]
            .map(|v| f64::from(v.into_value()))
    });
    if let Some(found) = primaries.filter(|found| found.iter().zip(REC709).any(|(a, b)| (a - b).abs() > 0.01)) {
        return Err(format!("its chunk cHRM states the primaries and white {found:?}; convert the photo to sRGB"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(profile: &ColorProfile) -> Option<Profile> {
        let bytes = profile.encode().unwrap();
        Profile::of_icc(&ColorProfile::new_from_slice(&bytes).unwrap()).unwrap()
    }

    /// The primaries of Display P3 (SMPTE EG 432-1) under the curve of sRGB: its red is (1.2249, -0.0420, -0.0196) in Rec.
    /// 709, its white is white.
    #[test]
    fn display_p3_is_converted() {
        let p3 = profile(&ColorProfile::new_display_p3()).unwrap();
        assert!(!p3.is_srgb());
        assert!((p3.linear([1.0, 0.0, 0.0])[0] - 1.2249).abs() < 2e-3);
        assert!(p3.linear([1.0; 3]).iter().all(|v| (v - 1.0).abs() < 1e-3));
        let srgb = profile(&ColorProfile::new_srgb()).unwrap();
        assert!(srgb.is_srgb());
    }

    #[test]
    fn curves_of_each_kind() {
        assert_eq!(evaluated(&ToneReprCurve::Lut(Vec::new()), 0.3), 0.3);
        assert!((evaluated(&ToneReprCurve::Lut(vec![512]), 0.5) - 0.25).abs() < 1e-9);
        assert!((evaluated(&ToneReprCurve::Lut(vec![0, 65535]), 0.3) - 0.3).abs() < 1e-9);
        let srgb = ToneReprCurve::Parametric(vec![2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045]);
        assert!((evaluated(&srgb, 0.5) - 0.214_041).abs() < 1e-5);
    }
}
