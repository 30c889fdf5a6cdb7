//! Reads textures from untrusted PNG, JPEG, BMP, Radiance HDR and OpenEXR files.

use std::io::Cursor;
use std::path::Path;

use image::{ColorType, DynamicImage, ImageDecoder as _, ImageReader};

use crate::limits::{check_size, read_file};
use crate::{ImageError, Texels, Texture, Wrap, exr_io};

/// How the integers of a file encode colours. Float files (EXR, HDR) are always linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// With the sRGB curve.
    Srgb,
    /// Linearly.
    Linear,
}

/// Reads a texture; alpha is dropped. Every value must be finite. The first bytes decide the format, not the name.
pub fn read_texture(path: &Path, encoding: Encoding, wrap: Wrap) -> Result<Texture, ImageError> {
    let (picture, _) = read_with_alpha(path, encoding, wrap)?;
    Ok(picture)
}

/// Reads a texture from a file's bytes, of any format but OpenEXR. `path` serves for errors only.
pub fn texture_of_bytes(path: &Path, bytes: Vec<u8>, encoding: Encoding, wrap: Wrap) -> Result<Texture, ImageError> {
    let decoded = decode(path, bytes)?;
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    Texture::new(width, height, color_texels(path, decoded, encoding)?, wrap)
}

/// Reads a picture's alpha channel as a texture of scalars; none for a picture without alpha.
pub fn read_alpha(path: &Path, wrap: Wrap) -> Result<Option<Texture>, ImageError> {
    let (_, alpha) = read_with_alpha(path, Encoding::Linear, wrap)?;
    Ok(alpha)
}

/// Reads the values of a picture's file, 0 to 1 for one of bytes, and its alpha channel, if it has one.
pub fn read_texture_and_alpha(path: &Path, wrap: Wrap) -> Result<(Texture, Option<Texture>), ImageError> {
    read_with_alpha(path, Encoding::Linear, wrap)
}

fn read_with_alpha(path: &Path, encoding: Encoding, wrap: Wrap) -> Result<(Texture, Option<Texture>), ImageError> {
    let bytes = read_file(path)?;
    if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        let picture = exr_io::read_linear(path)?;
        let texels = Texels::Linear(picture.pixels().iter().map(|p| p.0).collect());
        return Ok((Texture::new(picture.width(), picture.height(), texels, wrap)?, None));
    }
    let decoded = decode(path, bytes)?;
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let alpha = decoded.color().has_alpha().then(|| alpha_texels(&decoded));
    let texels = color_texels(path, decoded, encoding)?;
    let alpha = alpha.map(|texels| Texture::new(width, height, texels, wrap)).transpose()?;
    Ok((Texture::new(width, height, texels, wrap)?, alpha))
}

fn decode(path: &Path, bytes: Vec<u8>) -> Result<DynamicImage, ImageError> {
    let invalid = |error: image::ImageError| ImageError::Invalid {
        path: path.to_owned(),
        what: format!("not a valid picture: {error}"),
    };
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|source| ImageError::Io {
        action: "read",
        path: path.to_owned(),
        source,
    })?;
    if reader.format().is_none() {
        let what = "not a known picture format; expected PNG, JPEG, BMP, Radiance HDR or OpenEXR".to_owned();
        return Err(ImageError::Unsupported { path: path.to_owned(), what });
    }
    let decoder = reader.into_decoder().map_err(invalid)?;
    let (width, height) = decoder.dimensions();
    check_size(path, u64::from(width), u64::from(height))?;
    DynamicImage::from_decoder(decoder).map_err(invalid)
}

fn alpha_texels(decoded: &DynamicImage) -> Texels {
    Texels::Grey8(decoded.to_rgba8().pixels().map(|p| p.0[3]).collect())
}

fn color_texels(path: &Path, decoded: DynamicImage, encoding: Encoding) -> Result<Texels, ImageError> {
    let texels = match decoded.color() {
        ColorType::Rgb32F | ColorType::Rgba32F => Texels::Linear(decoded.into_rgb32f().pixels().map(|p| p.0).collect()),
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
            let words = decoded.into_rgb16();
            match encoding {
                Encoding::Srgb => Texels::Srgb16(words.pixels().map(|p| p.0).collect()),
                Encoding::Linear => {
                    Texels::Linear(words.pixels().map(|p| p.0.map(|word| f32::from(word) / 65535.0)).collect())
                }
            }
        }
        ColorType::L8 | ColorType::La8 if encoding == Encoding::Linear => {
            Texels::Grey8(decoded.into_luma8().into_raw())
        }
        _ => {
            let bytes = decoded.into_rgb8().pixels().map(|p| p.0).collect();
            if encoding == Encoding::Srgb { Texels::Srgb8(bytes) } else { Texels::Linear8(bytes) }
        }
    };
    if let Texels::Linear(values) = &texels
        && !values.iter().flatten().all(|v| v.is_finite())
    {
        let what = "a texel is NaN or infinite; expected finite numbers".to_owned();
        return Err(ImageError::Invalid { path: path.to_owned(), what });
    }
    Ok(texels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Picture, png_io};

    #[test]
    fn encodings_differ_and_grey_stays_small() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        png_io::write_rgb_bytes(&path, &Picture::filled(2, 2, [188; 3])).unwrap();
        let read = |encoding| read_texture(&path, encoding, Wrap::Repeat).unwrap().sample([0.5, 0.5])[0];
        assert!((read(Encoding::Srgb) - 0.5).abs() < 0.005);
        assert!((read(Encoding::Linear) - 188.0 / 255.0).abs() < 1e-6);
        png_io::write_grey_bytes(&path, &Picture::filled(2, 2, 51)).unwrap();
        let grey = read_texture(&path, Encoding::Linear, Wrap::Repeat).unwrap();
        assert_eq!(grey.texels(), &Texels::Grey8(vec![51; 4]));
        assert!(read_alpha(&path, Wrap::Repeat).unwrap().is_none());
    }

    #[test]
    fn rubbish_is_an_error_that_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rubbish.png");
        for bytes in [&b""[..], b"not a picture", b"\x89PNG\r\n\x1a\n", b"#?RADIANCE\n", b"\x76\x2f\x31\x01"] {
            std::fs::write(&path, bytes).unwrap();
            let error = read_texture(&path, Encoding::Srgb, Wrap::Repeat).unwrap_err();
            assert!(error.to_string().contains("rubbish.png"), "{error}");
        }
    }
}
