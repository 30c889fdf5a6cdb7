//! Reads photos from untrusted PNG, JPEG, WebP, TIFF, BMP, Radiance HDR and OpenEXR files.

use std::path::Path;

pub use crate::color_profile::CameraExposure;
use crate::color_profile::{CHROMATICITY_TOLERANCE, Exif, Profile, REC709, is_cmyk_jpeg};
use crate::npy_io::NPY_SIGNATURE;
use crate::texture_io::{
    CMYK, Encoding, FewerBits, is_turned, photo_of_tiff, texture_and_alpha_of_bytes, transparent_share,
};
use crate::{ImageError, LinearRgb, Picture, Texels, Texture, Wrap};

/// A photo in linear light; alpha is dropped.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoFile {
    pixels: Texture,
    encoding: Encoding,
    transparent: f64,
    exposure: Option<CameraExposure>,
}

impl PhotoFile {
    /// Reads a photo from a file's bytes. `path` serves for errors only. Fails where a value is negative, NaN or
    /// infinite, and where the file asks to be turned or mirrored for display: its camera is that of the stored pixels.
    pub fn of_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, ImageError> {
        let invalid = |what: String| ImageError::invalid(path, what);
        if bytes.starts_with(NPY_SIGNATURE) {
            let what =
                "a NumPy array does not state whether it is sRGB or linear; expected PNG, JPEG, WebP, TIFF, BMP, Radiance HDR or OpenEXR".to_owned();
            return Err(ImageError::unsupported(path, what));
        }
        if is_turned(&bytes) {
            let what = "its EXIF data asks to turn or mirror it for display; expected a photo that is stored upright";
            return Err(invalid(what.to_owned()));
        }
        if let Some(what) = other_radiance(&bytes) {
            return Err(ImageError::Unsupported { path: path.to_owned(), what });
        }
        let profile = Profile::of(path, &bytes)?;
        let exposure = Exif::of(&bytes).exposure();
        if is_cmyk_jpeg(&bytes) {
            return Err(ImageError::unsupported(path, CMYK));
        }
        let (pixels, alpha) = if [b"II*\0", b"MM\0*"].iter().any(|start| bytes.starts_with(*start)) {
            photo_of_tiff(path, &bytes)?
        } else {
            texture_and_alpha_of_bytes(path, bytes, Encoding::Srgb, Wrap::Clamp)?
        };
        if let Some(words) = FewerBits::of(&pixels) {
            let FewerBits { bits, largest } = words;
            return Err(invalid(format!(
                "its 16-bit integers reach only {largest} of 65535, as those of {bits} bits do; expected 65535 for white; \
                 multiply them by 65535 / {}",
                words.full()
            )));
        }
        if profile.is_some() && matches!(pixels.texels(), Texels::Linear(_)) {
            let what = "its floating-point numbers have a colour profile, which is not applied to them; save the photo in \
                        linear Rec. 709 without a profile, or as 16-bit integers";
            return Err(ImageError::unsupported(path, what));
        }
        let transparent = alpha.map_or(0.0, |alpha| transparent_share(&alpha));
        if let Some(pixels) = profile.and_then(|profile| converted(&pixels, &profile)).transpose()? {
            return Ok(Self { pixels, encoding: Encoding::Srgb, transparent, exposure });
        }
        let mut encoding = Encoding::Srgb;
        if let Texels::Linear(values) = pixels.texels() {
            encoding = Encoding::Linear;
            if let Some(at) = values.iter().position(|rgb| !rgb.iter().all(|v| *v >= 0.0 && v.is_finite())) {
                let (x, y) = (at % pixels.width(), at / pixels.width());
                let what = format!("pixel ({x}, {y}) is {:?}; expected finite numbers of 0 or more", values[at]);
                return Err(invalid(what));
            }
        }
        Ok(Self { pixels, encoding, transparent, exposure })
    }

    /// How the file states its values: integers are sRGB or by a colour profile, floating-point numbers are linear.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// The exposure that the file's EXIF data states.
    pub fn exposure(&self) -> Option<CameraExposure> {
        self.exposure
    }

    /// The share of pixels whose alpha is below 1; their colours are used as they are stored.
    pub fn transparent_share(&self) -> f64 {
        self.transparent
    }

    pub fn width(&self) -> usize {
        self.pixels.width()
    }

    pub fn height(&self) -> usize {
        self.pixels.height()
    }

    /// The photo in another size: each pixel is the mean of what it covers, in linear light. With the photo's own size,
    /// its values.
    pub fn resized(&self, width: usize, height: usize) -> Picture<LinearRgb> {
        let (columns, rows) = (covered(self.width(), width), covered(self.height(), height));
        Picture::from_fn(width, height, |x, y| {
            let mut mean = [0.0; 3];
            for &(row, of_row) in &rows[y] {
                for &(column, of_column) in &columns[x] {
                    let texel = self.pixels.texel(column, row);
                    mean.iter_mut().zip(texel).for_each(|(mean, v)| *mean += of_row * of_column * f64::from(v));
                }
            }
            LinearRgb(mean.map(|v| v as f32))
        })
    }
}

/// The most places a side, in a pixel of a resampled photo, whose mean is the pixel.
const MOST_PLACES: usize = 8;

impl PhotoFile {
    /// The photo as another camera at its place takes it: `place` is where the photo shows a point of the new picture,
    /// both in pixels from the upper left corner. Each pixel is the mean of bilinear lookups, about one for each pixel
    /// of the photo. Beyond the photo its edge continues.
    pub fn resampled(&self, width: usize, height: usize, place: impl Fn([f64; 2]) -> [f64; 2]) -> Picture<LinearRgb> {
        let ratio = (self.width() as f64 / width as f64).max(self.height() as f64 / height as f64);
        let places = (ratio.ceil() as usize).clamp(1, MOST_PLACES);
        let step = |at: usize, part: usize| at as f64 + (part as f64 + 0.5) / places as f64;
        let (columns, rows) = (self.width() as f64, self.height() as f64);
        Picture::from_fn(width, height, |x, y| {
            let mut mean = [0.0; 3];
            for part in 0..places * places {
                let [column, row] = place([step(x, part % places), step(y, part / places)]);
                let texel = self.pixels.sample([(column / columns) as f32, (1.0 - row / rows) as f32]);
                mean.iter_mut().zip(texel).for_each(|(mean, v)| *mean += f64::from(v) / (places * places) as f64);
            }
            LinearRgb(mean.map(|v| v as f32))
        })
    }
}

/// What the header of a Radiance HDR states of its numbers that makes them other than linear Rec. 709 (Ward, "Radiance
/// file formats"); none for other files. Of several exposures and corrections the product counts.
fn other_radiance(bytes: &[u8]) -> Option<String> {
    let header = bytes.strip_prefix(b"#?").map(|rest| &rest[..rest.len().min(MOST_HEADER)])?;
    let end = header.windows(2).position(|two| two == b"\n\n").unwrap_or(header.len());
    let header = String::from_utf8_lossy(&header[..end]);
    let stated = |key: &str| {
        let lines = header.lines().filter_map(|line| line.strip_prefix(key)?.trim_start().strip_prefix('='));
        let numbers = |text: &str| text.split_whitespace().map_while(|word| word.parse().ok()).collect::<Vec<f64>>();
        lines.map(numbers).collect::<Vec<_>>()
    };
    // What is no number differs.
    let differs = |found: f64, expected: f64, by: f64| (found - expected).abs() > by || found.is_nan();
    let exposure: f64 = stated("EXPOSURE").iter().flatten().product();
    if differs(exposure, 1.0, 1e-3) {
        return Some(format!(
            "its header states EXPOSURE={exposure}, by which its numbers were multiplied; divide them"
        ));
    }
    let corrected = |channel: usize| stated("COLORCORR").iter().filter_map(|all| all.get(channel)).product::<f64>();
    if (0..3).any(|channel| differs(corrected(channel), 1.0, 1e-3)) {
        let factors = [0, 1, 2].map(corrected);
        return Some(format!(
            "its header states COLORCORR={factors:?}, by which its colours were multiplied; divide them"
        ));
    }
    let primaries = stated("PRIMARIES").into_iter().next_back()?;
    let is_rec709 =
        primaries.len() == 8 && !primaries.iter().zip(REC709).any(|(a, b)| differs(*a, b, CHROMATICITY_TOLERANCE));
    (!is_rec709).then(|| format!("its header states PRIMARIES={primaries:?}; convert its colours to Rec. 709"))
}

/// The longest header of a Radiance HDR that is looked at, in bytes.
const MOST_HEADER: usize = 1 << 16;

/// The photo's linear colours by its profile; none for linear numbers, which no profile describes.
fn converted(pixels: &Texture, profile: &Profile) -> Option<Result<Texture, ImageError>> {
    let texels = match pixels.texels() {
        Texels::Srgb8(bytes) => bytes.iter().map(|rgb| profile.linear(rgb.map(|v| f64::from(v) / 255.0))).collect(),
        Texels::Srgb16(words) => words.iter().map(|rgb| profile.linear(rgb.map(|v| f64::from(v) / 65535.0))).collect(),
        _ => return None,
    };
    Some(Texture::new(pixels.width(), pixels.height(), Texels::Linear(texels), pixels.wrap()))
}

/// The numbers of `from` that each of `to` covers when both span the same length, with their shares of it.
fn covered(from: usize, to: usize) -> Vec<Vec<(usize, f64)>> {
    let step = from as f64 / to as f64;
    let of = |at: usize| {
        let (first, last) = (at as f64 * step, (at as f64 + 1.0) * step);
        let share = |number: usize| (last.min(number as f64 + 1.0) - first.max(number as f64)) / step;
        let numbers = first as usize..(last.ceil() as usize).min(from);
        numbers.map(|number| (number, share(number))).filter(|(_, share)| *share > 0.0).collect()
    };
    (0..to).map(of).collect()
}

#[cfg(test)]
mod tests {
    use tiff::encoder::{TiffValue, colortype};

    use super::*;
    use crate::{exr_io, png_io};

    fn read(path: &Path) -> Result<PhotoFile, ImageError> {
        PhotoFile::of_bytes(path, std::fs::read(path).unwrap())
    }

    #[test]
    fn reducing_takes_means_in_linear_light() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let picture = Picture::from_fn(6, 4, |x, y| LinearRgb([x as f32, y as f32, 8.0]));
        exr_io::write_linear(&path, &picture, exr_io::Precision::Float).unwrap();
        let photo = read(&path).unwrap();
        assert_eq!(photo.encoding(), Encoding::Linear);
        assert_eq!(photo.resized(6, 4), picture);
        // Pixels of 1.5 by 2 texels: 0, half of 1; half of 1, 2; and so on.
        let reduced = photo.resized(4, 2);
        for (x, expected) in [1.0 / 3.0, 5.0 / 3.0, 10.0 / 3.0, 14.0 / 3.0].into_iter().enumerate() {
            for (y, row) in [0.5, 2.5].into_iter().enumerate() {
                let LinearRgb(found) = reduced.get(x, y);
                assert!([expected, row, 8.0].iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
            }
        }
    }

    /// Of a photo whose values are its coordinates, each pixel of the other camera's picture is the place that it
    /// shows.
    #[test]
    fn resampling_looks_at_the_place_of_each_pixel() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let picture = Picture::from_fn(40, 30, |x, y| LinearRgb([x as f32 + 0.5, y as f32 + 0.5, 1.0]));
        exr_io::write_linear(&path, &picture, exr_io::Precision::Float).unwrap();
        let photo = read(&path).unwrap();
        let turned = |[x, y]: [f64; 2]| [20.0 + 0.6 * (x - 5.0) - 0.3 * y, 10.0 + 0.3 * (x - 5.0) + 0.6 * y];
        for (width, height) in [(10, 8), (40, 30)] {
            let scale = 10.0 / width as f64;
            let found = photo.resampled(width, height, |[x, y]| turned([x * scale, y * scale]));
            let (x, y) = (width / 2, height / 2);
            let expected = turned([(x as f64 + 0.5) * scale, (y as f64 + 0.5) * scale]);
            let LinearRgb(pixel) = found.get(x, y);
            assert!(
                (0..2).all(|axis| (f64::from(pixel[axis]) - expected[axis]).abs() < 1e-4),
                "{pixel:?} {expected:?}"
            );
        }
        let (same, whole) = (photo.resampled(40, 30, |place| place), photo.resized(40, 30));
        let off =
            |(a, b): (&LinearRgb, &LinearRgb)| (0..3).map(|axis| (a.0[axis] - b.0[axis]).abs()).fold(0.0, f32::max);
        assert!(same.pixels().iter().zip(whole.pixels()).map(off).all(|off| off < 1e-4));
    }

    #[test]
    fn numbers_that_are_not_linear_rec709_are_refused() {
        let hdr = |lines: &str| {
            let pixel = [128, 64, 32, 128];
            [format!("#?RADIANCE\n{lines}FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n").as_bytes(), &pixel.repeat(2)].concat()
        };
        let refused = |bytes: Vec<u8>| PhotoFile::of_bytes(Path::new("a"), bytes).err().map(|error| error.to_string());
        for (lines, word) in [
            ("EXPOSURE=2\n", "EXPOSURE=2"),
            ("EXPOSURE= 2\nEXPOSURE=3\n", "EXPOSURE=6"),
            ("COLORCORR=1 0.5 1\n", "COLORCORR"),
            ("PRIMARIES=0.68 0.32 0.265 0.69 0.15 0.06 0.3127 0.329\n", "PRIMARIES"),
            ("PRIMARIES=0.64\n", "PRIMARIES"),
        ] {
            assert!(refused(hdr(lines)).is_some_and(|error| error.contains(word)), "{lines}");
        }
        let rec709 = "PRIMARIES=0.64 0.33 0.30 0.60 0.15 0.06 0.3127 0.329\n";
        for lines in ["", "EXPOSURE=1.0\n", "EXPOSURE=2\nEXPOSURE=0.5\n", "COLORCORR= 1 1 1\n", rec709] {
            assert_eq!(refused(hdr(lines)), None, "{lines}");
        }
        // The same of OpenEXR.
        let write = |chromaticities: Option<[f32; 8]>| {
            use exr::meta::attribute::Chromaticities;
            use exr::prelude::{Image, SpecificChannels, Vec2, WritableImage as _};
            let pixel = |_: Vec2<usize>| (0.5_f32, 0.2_f32, 0.1_f32);
            let mut image = Image::from_channels((2, 1), SpecificChannels::rgb(pixel));
            image.attributes.chromaticities = chromaticities.map(|[a, b, c, d, e, f, g, h]| Chromaticities {
                red: Vec2(a, b),
                green: Vec2(c, d),
                blue: Vec2(e, f),
                white: Vec2(g, h),
            });
            let mut bytes = std::io::Cursor::new(Vec::new());
            image.write().to_buffered(&mut bytes).unwrap();
            bytes.into_inner()
        };
        let p3 = [0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329];
        assert!(refused(write(Some(p3))).is_some_and(|error| error.contains("chromaticities")));
        assert_eq!((refused(write(None)), refused(write(Some(REC709.map(|v| v as f32))))), (None, None));
    }

    #[test]
    fn integers_are_srgb() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        png_io::write_rgb_bytes(&path, &Picture::filled(2, 2, [188, 0, 255])).unwrap();
        let photo = read(&path).unwrap();
        let LinearRgb(found) = photo.resized(1, 1).get(0, 0);
        assert_eq!(photo.encoding(), Encoding::Srgb);
        assert!((found[0] - 0.5029).abs() < 1e-3 && found[1..] == [0.0, 1.0], "{found:?}");
    }

    #[test]
    fn integers_of_fewer_bits_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let write = |largest: u16| {
            png_io::write_rgb_words(&path, &Picture::from_fn(8, 2, |x, _| [largest / 8 * (x as u16 + 1), 3, 5]))
                .unwrap();
            read(&path)
        };
        for (largest, bits) in [(1016, "10 bits"), (4088, "12 bits"), (248, "8 bits")] {
            let refused = write(largest).unwrap_err().to_string();
            assert!(refused.contains(bits) && refused.contains("65535 / "), "{refused}");
        }
        // Twins: integers of the whole range, and a dark photo.
        assert!(write(65528).is_ok() && write(6000).is_ok());
    }

    /// A TIFF of 3x1 pixels with another tag, or none.
    fn tiff_of<C: colortype::ColorType>(pixels: &[C::Inner], tag: Option<(tiff::tags::Tag, u32)>) -> Vec<u8>
    where
        [C::Inner]: TiffValue,
    {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
        let mut picture = encoder.new_image::<C>(3, 1).unwrap();
        if let Some((tag, value)) = tag {
            picture.encoder().write_tag(tag, value).unwrap();
        }
        picture.write_data(pixels).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn a_tiff_has_the_values_of_a_png_and_a_cameras_raw_file_is_refused() {
        use tiff::tags::Tag;
        let read = |bytes| PhotoFile::of_bytes(Path::new("a.tif"), bytes);
        let words = [0, 9000, 65535, 1, 2, 3, 40000, 30000, 20000];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        png_io::write_rgb_words(
            &path,
            &Picture::from_fn(3, 1, |x, _| [words[3 * x], words[3 * x + 1], words[3 * x + 2]]),
        )
        .unwrap();
        let png = PhotoFile::of_bytes(&path, std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(read(tiff_of::<colortype::RGB16>(&words, None)).unwrap(), png);
        let floats = tiff_of::<colortype::RGB32Float>(&[0.5; 9], None);
        assert_eq!(read(floats).unwrap().encoding(), Encoding::Linear);
        for (tag, value) in [(Tag::SubIfd, 8), (Tag::Unknown(50706), 1), (Tag::NewSubfileType, 1)] {
            let error = read(tiff_of::<colortype::RGB16>(&words, Some((tag, value)))).unwrap_err().to_string();
            assert!(error.contains("raw file"), "{tag:?}: {error}");
        }
        // A mosaic of colour filters and linear raw; the twin is grey.
        for (photometric, is_raw) in [(32803, true), (34892, true), (1, false)] {
            let tag = (Tag::PhotometricInterpretation, photometric);
            let found = read(tiff_of::<colortype::Gray16>(&words[..3], Some(tag)));
            let error = found.err().map(|error| error.to_string());
            assert_eq!(error.is_some(), is_raw, "{photometric}: {error:?}");
            let names_it = error.is_none_or(|error| error.contains("raw file behind colour filters"));
            assert!(names_it, "{photometric}");
        }
        let damaged = read(tiff_of::<colortype::RGB16>(&words, Some((Tag::IccProfile, 7)))).unwrap_err().to_string();
        assert!(damaged.contains("colour profile"), "{damaged}");
        let turned = tiff_of::<colortype::RGB16>(&words, Some((Tag::Orientation, 6)));
        assert!(read(turned).unwrap_err().to_string().contains("stored upright"));
        let ink = read(tiff_of::<colortype::CMYK8>(&[9; 12], None)).unwrap_err().to_string();
        assert!(ink.contains("CMYK"), "{ink}");
        let whole = tiff_of::<colortype::RGB16>(&words, None);
        for length in 0..whole.len() {
            assert!(read(whole[..length].to_vec()).is_err(), "{length} bytes");
        }
    }

    /// Four components are CMYK. The twin has three.
    #[test]
    fn a_jpeg_in_ink_is_refused() {
        let of = |components| [&b"\xff\xd8\xff\xc0\0\x14\x08\0\x08\0\x08"[..], &[components], &[0; 12]].concat();
        assert!(is_cmyk_jpeg(&of(4)) && !is_cmyk_jpeg(&of(3)));
        let error = PhotoFile::of_bytes(Path::new("a.jpg"), of(4)).unwrap_err().to_string();
        assert!(error.contains("CMYK"), "{error}");
    }

    #[test]
    fn transparent_pixels_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        png_io::write_rgba_bytes(&path, &Picture::from_fn(4, 1, |x, _| [90, 90, 90, if x == 0 { 254 } else { 255 }]))
            .unwrap();
        assert_eq!(read(&path).unwrap().transparent_share(), 0.25);
        png_io::write_rgb_bytes(&path, &Picture::filled(2, 2, [90; 3])).unwrap();
        assert_eq!(read(&path).unwrap().transparent_share(), 0.0);
    }

    #[test]
    fn negative_and_non_finite_values_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        for bad in [-0.5, f32::NAN, f32::INFINITY] {
            let picture = Picture::from_fn(3, 2, |x, y| LinearRgb([if (x, y) == (2, 1) { bad } else { 1.0 }; 3]));
            exr_io::write_linear(&path, &picture, exr_io::Precision::Float).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains("a.exr") && error.contains("finite"), "{error}");
        }
    }

    /// A JPEG whose EXIF data states orientation 6 (turn by 90 degrees), as telephones write it.
    #[test]
    fn a_turned_photo_is_refused() {
        let mut jpeg = Vec::new();
        let encoder = image::codecs::jpeg::JpegEncoder::new(&mut jpeg);
        image::ImageEncoder::write_image(encoder, &[90; 16 * 8 * 3], 16, 8, image::ExtendedColorType::Rgb8).unwrap();
        assert!(PhotoFile::of_bytes(Path::new("a.jpg"), jpeg.clone()).is_ok());
        // APP1 with a little-endian TIFF header and one entry: tag 0x0112, type SHORT, count 1, value 6.
        let tiff = [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0".as_slice(), &[0; 4]].concat();
        let length = u16::try_from(2 + 6 + tiff.len()).unwrap().to_be_bytes();
        let segment = [&[0xff, 0xe1][..], &length, b"Exif\0\0", &tiff].concat();
        jpeg.splice(2..2, segment);
        let error = PhotoFile::of_bytes(Path::new("a.jpg"), jpeg).unwrap_err().to_string();
        assert!(error.contains("EXIF"), "{error}");
    }
}
