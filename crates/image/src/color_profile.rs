//! The colour space that a photo's file states, by an ICC profile, by the chunks gAMA, cHRM and cICP of a PNG, or by
//! EXIF data; and the exposure that EXIF data states.
//!
//! Telephones store photos in Display P3. A profile of three primaries and three curves, or of one curve for grey, is
//! applied; any other is refused by its name, since taking it for sRGB would change every colour. So is one that is
//! damaged.

use std::fmt;
use std::io::Cursor;
use std::path::Path;

use image::{ImageDecoder as _, ImageReader};
use moxcms::{ColorProfile, DataColorSpace, LocalizableString, ProfileText, ToneReprCurve, Xyzd};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ImageError;
use crate::png_io::PngHeader;

/// Linear Rec. 709 from XYZ under D50, as ICC profiles have it: the inverse of the columns of the sRGB profile (ICC,
/// "sRGB.icc", Bradford-adapted).
const REC709_FROM_D50: [[f64; 3]; 3] = [
    [3.133_856_1, -1.616_866_7, -0.490_614_6],
    [-0.978_768_4, 1.916_141_5, 0.033_454_0],
    [0.071_945_3, -0.228_991_4, 1.405_242_7],
];
/// sRGB's primaries and white, as cHRM states them.
pub(crate) const REC709: [f64; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];
/// The largest difference of a chromaticity that counts as rounding.
pub(crate) const CHROMATICITY_TOLERANCE: f64 = 0.01;
/// Profiles within this of sRGB are sRGB: the difference of a third of a byte.
const SAME: f64 = 1.5e-3;
const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// The white of a profile is adapted to that of the space in between, so it is that of Rec. 709 up to rounding.
const MOST_OFF_WHITE: f32 = 0.05;
/// The widest spaces in use have entries of up to 2.6 (ACES 2065-1) from Rec. 709; that of XYZ itself has 3.02.
const LARGEST_ENTRY: f64 = 4.0;
/// Below it the primaries lie on a line, nearly.
const LEAST_DETERMINANT: f64 = 0.01;
pub(crate) const UNREADABLE: &str = "cannot be read; remove it from the file or save the photo as sRGB";

/// The curves and primaries of a profile, unless they are those of sRGB.
pub(crate) struct Profile {
    curves: [ToneReprCurve; 3],
    /// Rows: linear Rec. 709 from the profile's linear colour.
    rec709_from_linear: [[f64; 3]; 3],
}

impl Profile {
    /// The profile that a file states; none for sRGB and for a file without any. Fails where it can neither be applied
    /// nor taken for sRGB.
    pub(crate) fn of(path: &Path, bytes: &[u8]) -> Result<Option<Self>, ImageError> {
        let unsupported = |what: String| ImageError::unsupported(path, what);
        let unreadable = || unsupported(format!("its colour profile {UNREADABLE}"));
        let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().ok();
        let Some(mut decoder) = reader.and_then(|reader| reader.into_decoder().ok()) else {
            // Whoever reads the pixels reports what cannot be decoded.
            return Ok(None);
        };
        let png = png_info(bytes);
        // cICP goes before iCCP, and that before sRGB, gAMA and cHRM (PNG, third edition, section 4.3).
        if let Some(info) = &png
            && is_srgb_by_cicp(bytes, info).map_err(unsupported)?
        {
            return Ok(None);
        }
        let Some(icc) = decoder.icc_profile().map_err(|_| unreadable())? else {
            // The decoders skip a profile that is damaged.
            if states_icc(bytes) {
                return Err(unreadable());
            }
            if let Some(space) = Exif::of(bytes).color_space() {
                return Err(unsupported(format!(
                    "its EXIF data states {space}, and it has no colour profile; convert the photo to sRGB"
                )));
            }
            return png.map_or(Ok(()), |info| check_png(&info)).map_err(unsupported).map(|()| None);
        };
        let parsed = ColorProfile::new_from_slice(&icc).map_err(|_| unreadable())?;
        let refused = || {
            let name = name_of(&parsed);
            unsupported(format!("its colour profile is '{name}', which is not read; convert the photo to sRGB"))
        };
        Self::of_icc(&parsed).ok_or_else(refused).map(|found| Some(found).filter(|profile| !profile.is_srgb()))
    }

    /// The profile's primaries and curves; absent if it has others, or impossible ones.
    fn of_icc(profile: &ColorProfile) -> Option<Self> {
        if profile.pcs != DataColorSpace::Xyz {
            return None;
        }
        let found = match profile.color_space {
            DataColorSpace::Gray => {
                let curve = profile.gray_trc.clone()?;
                Self { curves: [curve.clone(), curve.clone(), curve], rec709_from_linear: IDENTITY }
            }
            DataColorSpace::Rgb => {
                let curves = [profile.red_trc.clone()?, profile.green_trc.clone()?, profile.blue_trc.clone()?];
                let columns = [profile.red_colorant, profile.green_colorant, profile.blue_colorant];
                let row = |row: [f64; 3]| columns.map(|Xyzd { x, y, z }| row[0] * x + row[1] * y + row[2] * z);
                Self { curves, rec709_from_linear: REC709_FROM_D50.map(row) }
            }
            _ => return None,
        };
        found.is_plausible().then_some(found)
    }

    /// Whether white is white, colours differ, and no number is beyond those of real profiles.
    fn is_plausible(&self) -> bool {
        let is_white = self.linear([1.0; 3]).iter().all(|v| (v - 1.0).abs() < MOST_OFF_WHITE);
        let is_finite = |curve: &ToneReprCurve| (0..=32).all(|at| evaluated(curve, f64::from(at) / 32.0).is_finite());
        let [[a, b, c], [d, e, f], [g, h, i]] = self.rec709_from_linear;
        let determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
        is_white
            && self.curves.iter().all(is_finite)
            && self.rec709_from_linear.iter().flatten().all(|v| v.abs() <= LARGEST_ENTRY)
            && determinant.abs() >= LEAST_DETERMINANT
    }

    /// Whether every colour stays as sRGB has it, within [`SAME`].
    fn is_srgb(&self) -> bool {
        let is_identity = |(r, c): (usize, usize)| (self.rec709_from_linear[r][c] - IDENTITY[r][c]).abs() < SAME;
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

/// The settings of a camera that decide how much light a photo collects.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraExposure {
    /// The exposure time, in seconds.
    pub time_s: f64,
    /// The sensitivity, as in ISO 100.
    pub iso: f64,
    /// The focal length divided by the aperture, as in f/2.8.
    pub f_number: f64,
}

impl CameraExposure {
    /// What the radiance of a surface is multiplied by, up to a factor of the camera (ISO 2720).
    pub fn factor(&self) -> f64 {
        self.time_s * self.iso / (self.f_number * self.f_number)
    }

    /// What a camera can be set to: the least and the largest time, sensitivity and f-number.
    pub const RANGES: [(f64, f64); 3] = [(1e-6, 1e4), (1.0, 1e7), (0.5, 256.0)];

    pub fn is_sound(&self) -> bool {
        let values = [self.time_s, self.iso, self.f_number];
        values.iter().zip(Self::RANGES).all(|(value, (least, most))| (least..=most).contains(value))
    }
}

impl fmt::Display for CameraExposure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} s at ISO {} and f/{}", self.time_s, self.iso, self.f_number)
    }
}

/// The EXIF data of a file (Exif 3.0): a TIFF without pixels. Empty where the file has none.
pub(crate) struct Exif(Vec<u8>);

impl Exif {
    pub(crate) fn of(bytes: &[u8]) -> Self {
        let stated = || {
            let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().ok()?;
            reader.into_decoder().ok()?.exif_metadata().ok()?
        };
        Self(match bytes {
            // A TIFF is EXIF data itself.
            [b'I', b'I', ..] | [b'M', b'M', ..] => bytes.to_vec(),
            _ => stated().unwrap_or_default(),
        })
    }

    fn number(&self, at: usize, length: usize) -> Option<usize> {
        let bytes = self.0.get(at..at.checked_add(length)?)?;
        let shifted = |sum: usize, byte: &u8| sum << 8 | usize::from(*byte);
        let is_little = self.0.starts_with(b"II");
        Some(if is_little { bytes.iter().rev().fold(0, shifted) } else { bytes.iter().fold(0, shifted) })
    }

    /// The offset of the value of an entry of the directory at an offset.
    fn value(&self, directory: usize, tag: u16) -> Option<usize> {
        let entries = (0..self.number(directory, 2)?).map(|entry| directory.saturating_add(2 + 12 * entry));
        entries.filter(|at| self.number(*at, 2) == Some(usize::from(tag))).map(|at| at.saturating_add(8)).next()
    }

    /// The offset of the directory of the camera's settings, the Exif IFD.
    fn directory(&self) -> Option<usize> {
        const EXIF: u16 = 0x8769;
        self.number(self.value(self.number(4, 4)?, EXIF)?, 4)
    }

    /// The colour space where it is not sRGB (section 4.6.6.1, and DCF 2.0, which marks Adobe RGB by the
    /// interoperability index R03).
    fn color_space(&self) -> Option<&'static str> {
        const COLOR_SPACE: u16 = 0xa001;
        const INTEROPERABILITY: u16 = 0xa005;
        const INDEX: u16 = 1;
        let directory = self.directory()?;
        let index = self.value(directory, INTEROPERABILITY).and_then(|at| self.value(self.number(at, 4)?, INDEX));
        let is_adobe = index.is_some_and(|at| self.0.get(at..).is_some_and(|rest| rest.starts_with(b"R03")));
        match self.value(directory, COLOR_SPACE).and_then(|at| self.number(at, 2)) {
            _ if is_adobe => Some("Adobe RGB"),
            Some(2) => Some("Adobe RGB"),
            Some(0xffff) => Some("colours that are not sRGB (ColorSpace 65535)"),
            _ => None,
        }
    }

    /// The exposure by the tags ExposureTime, PhotographicSensitivity and FNumber, if all are stated and sound.
    pub(crate) fn exposure(&self) -> Option<CameraExposure> {
        const EXPOSURE_TIME: u16 = 0x829a;
        const F_NUMBER: u16 = 0x829d;
        const SENSITIVITY: u16 = 0x8827;
        // The tag's value for a sensitivity that 16 bits do not hold.
        const BEYOND: usize = 65535;
        let directory = self.directory()?;
        let fraction = |tag: u16| {
            let at = self.number(self.value(directory, tag)?, 4)?;
            let [above, below] = [at, at.checked_add(4)?].map(|at| self.number(at, 4));
            Some(above? as f64 / below? as f64)
        };
        let iso = self.number(self.value(directory, SENSITIVITY)?, 2).filter(|iso| *iso != BEYOND)?;
        let found = CameraExposure { time_s: fraction(EXPOSURE_TIME)?, iso: iso as f64, f_number: fraction(F_NUMBER)? };
        found.is_sound().then_some(found)
    }
}

/// What a PNG states before its pixels; none for other files.
fn png_info(bytes: &[u8]) -> Option<png::Info<'static>> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_ignore_text_chunk(true);
    Some(decoder.read_info().ok()?.info().clone())
}

/// Whether the chunk cICP of a PNG states sRGB; false without it. Fails where it states other colours or cannot be
/// read.
fn is_srgb_by_cicp(bytes: &[u8], info: &png::Info) -> Result<bool, String> {
    let Some(code) = info.coding_independent_code_points else {
        let is_damaged = PngHeader::of(bytes).is_ok_and(|header| header.has(b"cICP"));
        return if is_damaged { Err(format!("its chunk cICP {UNREADABLE}")) } else { Ok(false) };
    };
    let (primaries, transfer) = (code.color_primaries, code.transfer_function);
    let range = if code.is_video_full_range_image { "full" } else { "narrow" };
    // ITU-T H.273: primaries 1 are Rec. 709, transfer 13 is sRGB's. The matrix is always 0.
    match (primaries, transfer, range) {
        (1, 13, "full") => Ok(true),
        _ => Err(format!(
            "its chunk cICP states primaries {primaries}, transfer {transfer} and {range} range; convert the photo to sRGB"
        )),
    }
}

/// Whether a PNG or JPEG holds a colour profile, readable or not. False for other files.
fn states_icc(bytes: &[u8]) -> bool {
    PngHeader::of(bytes).is_ok_and(|header| header.has(b"iCCP")) || jpeg_states_icc(bytes)
}

/// Whether a JPEG holds a part of a colour profile: a segment APP2 of that name (ICC.1:2022, annex B.4).
fn jpeg_states_icc(bytes: &[u8]) -> bool {
    has_jpeg_segment(bytes, |marker, data| marker == 0xe2 && data.starts_with(b"ICC_PROFILE\0"))
}

/// Whether a JPEG has four components, which are amounts of ink: the start of its frame states their number behind
/// precision, height and width (ITU-T T.81, B.2.2).
pub(crate) fn is_cmyk_jpeg(bytes: &[u8]) -> bool {
    let is_frame = |marker| matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc);
    has_jpeg_segment(bytes, |marker, data| is_frame(marker) && data.get(5) == Some(&4))
}

/// Whether `is` holds for the marker and data of any segment before a JPEG's pixels.
fn has_jpeg_segment(bytes: &[u8], is: impl Fn(u8, &[u8]) -> bool) -> bool {
    let mut rest = bytes.strip_prefix(b"\xff\xd8").unwrap_or_default();
    while let [0xff, marker, after @ ..] = rest {
        match marker {
            // A byte that fills.
            0xff => rest = &rest[1..],
            // The pixels, or the end.
            0xda | 0xd9 => return false,
            _ => {
                let Some((length, _)) = after.split_first_chunk::<2>() else { return false };
                let length = usize::from(u16::from_be_bytes(*length));
                let Some(data) = after.get(2..length) else { return false };
                if is(*marker, data) {
                    return true;
                }
                rest = &after[length..];
            }
        }
    }
    false
}

/// Fails where a PNG states other colours than sRGB by its chunks gAMA and cHRM.
fn check_png(info: &png::Info) -> Result<(), String> {
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
    if let Some(found) =
        primaries.filter(|found| found.iter().zip(REC709).any(|(a, b)| (a - b).abs() > CHROMATICITY_TOLERANCE))
    {
        return Err(format!("its chunk cHRM states the primaries and white {found:?}; convert the photo to sRGB"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(profile: &ColorProfile) -> Option<Profile> {
        let bytes = profile.encode().unwrap();
        Profile::of_icc(&ColorProfile::new_from_slice(&bytes).unwrap())
    }

    /// A PNG of two black pixels with a profile and further chunks before its pixels.
    fn png_with(profile: Option<&ColorProfile>, color: png::ColorType, chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut info = png::Info::with_size(2, 1);
        (info.color_type, info.bit_depth) = (color, png::BitDepth::Eight);
        info.icc_profile = profile.map(|profile| profile.encode().unwrap().into());
        let mut bytes = Vec::new();
        let mut writer = png::Encoder::with_info(&mut bytes, info).unwrap().write_header().unwrap();
        for (name, data) in chunks {
            writer.write_chunk(png::chunk::ChunkType(**name), data).unwrap();
        }
        writer.write_image_data(&vec![0; 2 * color.samples()]).unwrap();
        writer.finish().unwrap();
        bytes
    }

    fn read(bytes: &[u8]) -> Result<Option<Profile>, String> {
        Profile::of(Path::new("a"), bytes).map_err(|error| error.to_string())
    }

    fn refusal(bytes: &[u8]) -> String {
        read(bytes).err().unwrap_or_default()
    }

    #[test]
    fn a_damaged_profile_is_refused() {
        let p3 = ColorProfile::new_display_p3();
        let sound = png_with(Some(&p3), png::ColorType::Rgb, &[]);
        assert!(read(&sound).unwrap().is_some());
        // Another byte in the compressed profile, which its checksum reveals.
        let mut changed = sound.clone();
        let at = sound.windows(4).position(|name| name == b"iCCP").unwrap();
        changed[at + 12] ^= 1;
        let mut files = vec![changed];
        // No zlib data, a start of such data, and a profile that is none: one stored block of no bytes.
        for data in
            [b"mine\0\0not even packed".as_slice(), b"mine\0\0\x78\x01", b"mine\0\0\x78\x01\x01\0\0\xff\xff\0\0\0\x01"]
        {
            files.push(png_with(None, png::ColorType::Rgb, &[(b"iCCP", data)]));
        }
        for file in files {
            let error = refusal(&file);
            assert!(error.contains("colour profile cannot be read") && error.contains("remove it"), "{error}");
        }
        // Its twin, without a profile.
        assert!(read(&png_with(None, png::ColorType::Rgb, &[])).unwrap().is_none());
    }

    /// EXIF data of a colour space and an interoperability index, in both byte orders.
    fn exif(space: u16, index: &[u8; 4], is_little: bool) -> Vec<u8> {
        let order = |bytes: Vec<u8>| if is_little { bytes } else { bytes.into_iter().rev().collect() };
        let [short, long] = [2, 4].map(|length| move |value: u32| order(value.to_le_bytes()[..length].to_vec()));
        let entry = |tag: u32, kind: u32, count: u32, value: Vec<u8>| {
            let mut bytes = [short(tag), short(kind), long(count), value].concat();
            bytes.resize(12, 0);
            bytes
        };
        let start = if is_little { b"II".to_vec() } else { b"MM".to_vec() };
        [
            [start, short(42), long(8)].concat(),
            [short(1), entry(0x8769, 4, 1, long(26)), long(0)].concat(),
            [short(2), entry(0xa001, 3, 1, short(u32::from(space))), entry(0xa005, 4, 1, long(56)), long(0)].concat(),
            [short(1), entry(1, 2, 4, index.to_vec()), long(0)].concat(),
        ]
        .concat()
    }

    #[test]
    fn adobe_rgb_by_exif_alone_is_refused() {
        for is_little in [true, false] {
            for (space, index, word) in [
                (0xffff, b"R03\0", "Adobe RGB"),
                (2, b"R98\0", "Adobe RGB"),
                (0xffff, b"R98\0", "not sRGB"),
                (1, b"R03\0", "Adobe RGB"),
            ] {
                let found = Exif(exif(space, index, is_little)).color_space();
                assert!(found.is_some_and(|found| found.contains(word)), "{space} {index:?}");
            }
            assert_eq!(Exif(exif(1, b"R98\0", is_little)).color_space(), None);
        }
        for bad in [b"".as_slice(), b"II", b"MM\0*\xff\xff\xff\xff", b"II*\0\x08\0\0\0\xff\xff"] {
            assert_eq!(Exif(bad.to_vec()).color_space(), None);
        }
        let mut jpeg = Vec::new();
        let mut encoder = image::codecs::jpeg::JpegEncoder::new(&mut jpeg);
        image::ImageEncoder::set_exif_metadata(&mut encoder, exif(0xffff, b"R03\0", true)).unwrap();
        image::ImageEncoder::write_image(encoder, &[90; 8 * 8 * 3], 8, 8, image::ExtendedColorType::Rgb8).unwrap();
        assert!(refusal(&jpeg).contains("Adobe RGB"), "{}", refusal(&jpeg));
    }

    /// 1/50 s at ISO 400 and f/2.8 in both byte orders, and from a JPEG; a part that is missing or 0 leaves none.
    #[test]
    fn an_exposure_is_read_from_exif_data() {
        let exif = |is_little: bool, time: [u32; 2], iso: u32, tags: u32| {
            let order = |bytes: Vec<u8>| if is_little { bytes } else { bytes.into_iter().rev().collect() };
            let [short, long] = [2, 4].map(|length| move |value: u32| order(value.to_le_bytes()[..length].to_vec()));
            let entry = |tag: u32, kind: u32, value: Vec<u8>| {
                let mut bytes = [short(tag), short(kind), long(1), value].concat();
                bytes.resize(12, 0);
                bytes
            };
            let start = if is_little { b"II".to_vec() } else { b"MM".to_vec() };
            let entries = [entry(0x829a, 5, long(68)), entry(0x829d, 5, long(76)), entry(0x8827, 3, short(iso))];
            [
                [start, short(42), long(8)].concat(),
                [short(1), entry(0x8769, 4, long(26)), long(0)].concat(),
                [short(tags), entries.concat(), long(0)].concat(),
                [long(time[0]), long(time[1]), long(28), long(10)].concat(),
            ]
            .concat()
        };
        let expected = Some(CameraExposure { time_s: 0.02, iso: 400.0, f_number: 2.8 });
        for is_little in [true, false] {
            let of = |time: [u32; 2], iso: u32, tags: u32| Exif(exif(is_little, time, iso, tags)).exposure();
            assert_eq!(of([1, 50], 400, 3), expected);
            for (time, iso, tags) in [([0, 50], 400, 3), ([1, 0], 400, 3), ([1, 50], 65535, 3), ([1, 50], 400, 2)] {
                assert_eq!(of(time, iso, tags), None, "{time:?} {iso} {tags}");
            }
            let whole = exif(is_little, [1, 50], 400, 3);
            for length in 0..whole.len() {
                assert_eq!(Exif(whole[..length].to_vec()).exposure(), None, "{length} bytes");
            }
        }
        let mut jpeg = Vec::new();
        let mut encoder = image::codecs::jpeg::JpegEncoder::new(&mut jpeg);
        image::ImageEncoder::set_exif_metadata(&mut encoder, exif(true, [1, 50], 400, 3)).unwrap();
        image::ImageEncoder::write_image(encoder, &[90; 8 * 8 * 3], 8, 8, image::ExtendedColorType::Rgb8).unwrap();
        let photo = crate::photo::PhotoFile::of_bytes(Path::new("a.jpg"), jpeg).unwrap();
        assert_eq!(photo.exposure(), expected);
    }

    #[test]
    fn a_jpeg_that_lacks_a_part_of_its_profile_is_refused() {
        let mut jpeg = Vec::new();
        let mut encoder = image::codecs::jpeg::JpegEncoder::new(&mut jpeg);
        let icc = ColorProfile::new_display_p3().encode().unwrap();
        image::ImageEncoder::set_icc_profile(&mut encoder, icc).unwrap();
        image::ImageEncoder::write_image(encoder, &[90; 8 * 8 * 3], 8, 8, image::ExtendedColorType::Rgb8).unwrap();
        assert!(read(&jpeg).unwrap().is_some());
        // The part's number and how many there are follow its name.
        let name = b"ICC_PROFILE\0";
        let at = jpeg.windows(name.len()).position(|part| part == name).unwrap() + name.len();
        assert_eq!(jpeg[at..at + 2], [1, 1]);
        jpeg[at + 1] = 2;
        assert!(refusal(&jpeg).contains("colour profile cannot be read"), "{}", refusal(&jpeg));
    }

    /// Gamma 1.0, the curve of sRGB, and one whose white is dark.
    #[test]
    fn the_curve_of_a_grey_profile_is_applied() {
        let grey = |curve: ToneReprCurve| {
            let mut grey = ColorProfile::new_gray_with_gamma(1.0);
            grey.gray_trc = Some(curve);
            png_with(Some(&grey), png::ColorType::Grayscale, &[])
        };
        let linear = read(&grey(ToneReprCurve::Lut(vec![256]))).unwrap().unwrap();
        assert!(linear.linear([0.25; 3]).iter().all(|v| (v - 0.25).abs() < 1e-6));
        let srgb = ToneReprCurve::Parametric(vec![2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045]);
        assert!(read(&grey(srgb)).unwrap().is_none());
        let error = refusal(&grey(ToneReprCurve::Lut(vec![0, 9000])));
        assert!(error.contains("'(without a name)', which is not read"), "{error}");
        // A curve of lightness.
        let mut lab = ColorProfile::new_gray_with_gamma(1.0);
        lab.pcs = DataColorSpace::Lab;
        assert!(Profile::of_icc(&lab).is_none());
    }

    #[test]
    fn the_chunk_cicp_goes_before_a_profile() {
        let (srgb, p3) = (ColorProfile::new_srgb(), ColorProfile::new_display_p3());
        let with =
            |profile: &ColorProfile, code: &[u8]| png_with(Some(profile), png::ColorType::Rgb, &[(b"cICP", code)]);
        assert!(read(&with(&p3, &[1, 13, 0, 1])).unwrap().is_none());
        // Rec. 2100 PQ, and sRGB in narrow range.
        for (code, words) in [([9, 16, 0, 1], "primaries 9"), ([1, 13, 0, 0], "narrow")] {
            let error = refusal(&with(&srgb, &code));
            assert!(error.contains(words), "{error}");
        }
        // Another byte, which the chunk's checksum reveals.
        let mut damaged = with(&srgb, &[1, 13, 0, 1]);
        let at = damaged.windows(4).position(|name| name == b"cICP").unwrap();
        damaged[at + 4] = 9;
        assert!(refusal(&damaged).contains("cICP cannot be read"), "{}", refusal(&damaged));
    }

    #[test]
    fn impossible_primaries_are_refused() {
        let scaled = |factors: [f64; 3]| {
            let mut p3 = ColorProfile::new_display_p3();
            let columns = [&mut p3.red_colorant, &mut p3.green_colorant, &mut p3.blue_colorant];
            for (column, factor) in columns.into_iter().zip(factors) {
                *column = Xyzd { x: column.x * factor, y: column.y * factor, z: column.z * factor };
            }
            profile(&p3)
        };
        assert!(scaled([1.0; 3]).is_some());
        for factors in [[1e-9; 3], [1000.0; 3], [1000.0, -1000.0, 1.0], [0.8; 3]] {
            assert!(scaled(factors).is_none(), "{factors:?}");
        }
        // White is white, but each primary is grey.
        let mut grey = ColorProfile::new_srgb();
        let third = Xyzd { x: 0.9642 / 3.0, y: 1.0 / 3.0, z: 0.8249 / 3.0 };
        (grey.red_colorant, grey.green_colorant, grey.blue_colorant) = (third, third, third);
        assert!(profile(&grey).is_none());
    }

    /// The spaces that photos are stored in.
    #[test]
    fn wide_spaces_are_read() {
        for wide in [ColorProfile::new_adobe_rgb(), ColorProfile::new_pro_photo_rgb(), ColorProfile::new_bt2020()] {
            assert!(!profile(&wide).unwrap().is_srgb());
        }
    }

    /// The primaries of Display P3 (SMPTE EG 432-1) under the curve of sRGB: its red is (1.2249, -0.0420, -0.0196) in
    /// Rec. 709, its white is white.
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
