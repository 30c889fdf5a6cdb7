//! Reads photos from untrusted PNG, JPEG, WebP, BMP, Radiance HDR and OpenEXR files.

use std::io::Cursor;
use std::path::Path;

use image::metadata::Orientation;
use image::{ImageDecoder as _, ImageReader};

use crate::color_profile::Profile;
use crate::npy_io::NPY_SIGNATURE;
use crate::texture_io::{Encoding, texture_and_alpha_of_bytes};
use crate::{ImageError, LinearRgb, Picture, Texels, Texture, Wrap};

/// A photo in linear light; alpha is dropped.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoFile {
    pixels: Texture,
    encoding: Encoding,
}

impl PhotoFile {
    /// Reads a photo from a file's bytes. `path` serves for errors only. Fails where a value is negative, NaN or
    /// infinite, and where the file asks to be turned or mirrored for display: its camera is that of the stored pixels.
    pub fn of_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, ImageError> {
        let invalid = |what: String| ImageError::invalid(path, what);
        if bytes.starts_with(NPY_SIGNATURE) {
            let what =
                "a NumPy array does not state whether it is sRGB or linear; expected PNG, JPEG, WebP, BMP, Radiance HDR or OpenEXR".to_owned();
            return Err(ImageError::unsupported(path, what));
        }
        if is_turned(&bytes) {
            let what = "its EXIF data asks to turn or mirror it for display; expected a photo that is stored upright";
            return Err(invalid(what.to_owned()));
        }
        let profile = Profile::of(path, &bytes)?;
        let (pixels, _) = texture_and_alpha_of_bytes(path, bytes, Encoding::Srgb, Wrap::Clamp)?;
        if let Some(pixels) = profile.and_then(|profile| converted(&pixels, &profile)).transpose()? {
            return Ok(Self { pixels, encoding: Encoding::Srgb });
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
        Ok(Self { pixels, encoding })
    }

    /// How the file states its values: integers are sRGB or by a colour profile, floating-point numbers are linear.
    pub fn encoding(&self) -> Encoding {
        self.encoding
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

/// Whether the file states that viewers should turn or mirror it. False for a file without such data.
fn is_turned(bytes: &[u8]) -> bool {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let decoder = reader.ok().and_then(|reader| reader.into_decoder().ok());
    let orientation = decoder.and_then(|mut decoder| decoder.orientation().ok());
    orientation.is_some_and(|orientation| orientation != Orientation::NoTransforms)
}

#[cfg(test)]
mod tests {
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
