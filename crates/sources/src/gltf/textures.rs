//! Textures: images of the file, decoded once for each use, with the factors of materials multiplied in, and how they
//! are looked up.

use std::path::Path;

use mateval_dataset::Severity;
use mateval_dataset::gltf_file::view_bytes;
use mateval_dataset::material::{ColorInput, ScalarInput, TextureIndex, UvTransform};
use mateval_dataset::reference::SourceTexture;
use mateval_files::source_folder::FileFault;
use mateval_files::untrusted::{hint, sha256_of_bytes, shortened};
use mateval_image::texture_io::{Encoding, texture_and_alpha_of_bytes};
use mateval_image::{ImageError, Texels, Texture, Wrap};

use super::document::read_uri;
use super::reader::{Aspect, Omission, Reader};
use crate::source_scene::{other_range, picture_fault, report_turned};

#[derive(Clone)]
pub(super) struct Lookup<'a> {
    pub(super) texture: gltf::Texture<'a>,
    /// The set of texture coordinates.
    pub(super) set: u32,
    /// The mapping from the surface's uv, with v upwards, to the texture's.
    pub(super) uv: UvTransform,
}

impl<'a> Lookup<'a> {
    /// The lookup of a material's texture, with its `KHR_texture_transform`.
    pub(super) fn new(info: &gltf::texture::Info<'a>) -> Self {
        let transform = info.texture_transform();
        let set = transform.as_ref().and_then(|transform| transform.tex_coord()).unwrap_or(info.tex_coord());
        Self { texture: info.texture(), set, uv: transform.map_or(UvTransform::default(), |t| upward(&t)) }
    }
}

/// The extension's matrix, translation * rotation * scale, for a v that grows upwards; glTF's grows downwards.
///
/// The rotation is counter-clockwise in the picture (KHR_texture_transform, section "Overview"). A transform that is
/// not finite maps everything to one point.
fn upward(transform: &gltf::texture::TextureTransform<'_>) -> UvTransform {
    let [offset_u, offset_v] = transform.offset().map(f64::from);
    let [scale_u, scale_v] = transform.scale().map(f64::from);
    let (sin, cos) = libm::sincos(f64::from(transform.rotation()));
    let downward = [[cos * scale_u, sin * scale_v, offset_u], [-sin * scale_u, cos * scale_v, offset_v]];
    let [[a, b, c], [d, e, f]] = downward;
    // v' = 1 - v on both sides.
    let rows = [[a, -b, b + c], [-d, e, 1.0 - e - f]];
    // Adding 0 turns the -0 of an absent rotation into 0.
    let rows = rows.map(|row| row.map(|value| value as f32 + 0.0));
    if rows.iter().flatten().all(|value| value.is_finite()) { UvTransform(rows) } else { UvTransform([[0.0; 3]; 2]) }
}

/// The modes in which a texture continues outside of 0..1; `(u, v)`.
pub(super) fn wraps(texture: &gltf::Texture<'_>) -> [Wrap; 2] {
    use gltf::texture::WrappingMode;
    let sampler = texture.sampler();
    [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
    })
}

/// Linear mid-grey, which replaces a colour that cannot be read.
const MISSING: f32 = 0.5;

/// The first bytes of the picture formats that glTF allows, and of WebP.
const SIGNATURES: [&[u8]; 3] = [b"\x89PNG", b"\xff\xd8\xff", b"RIFF"];

pub(super) struct Decoded {
    name: String,
    sha256: String,
    pub(super) color: Texture,
    pub(super) alpha: Option<Texture>,
}

impl Reader<'_> {
    /// A colour: a texture's times a linear factor. One that cannot be read is mid-grey times the factor.
    pub(super) fn color(&mut self, lookup: &Lookup<'_>, factor: [f32; 3]) -> ColorInput {
        if factor == [0.0; 3] {
            return ColorInput::Constant(factor);
        }
        match self.texture(&lookup.texture, Aspect::Color(factor.map(f32::to_bits))) {
            Some(texture) => ColorInput::Texture { texture, uv: lookup.uv },
            None => ColorInput::Constant(factor.map(|value| value * MISSING)),
        }
    }

    /// A number: one channel of a texture times a factor. One that cannot be read is the factor.
    pub(super) fn scalar(&mut self, lookup: &Lookup<'_>, channel: usize, factor: f32) -> ScalarInput {
        if factor == 0.0 {
            return ScalarInput::Constant(0.0);
        }
        let (aspect, channel) =
            if factor == 1.0 { (Aspect::Values, channel) } else { (Aspect::Channel(channel, factor.to_bits()), 0) };
        match self.texture(&lookup.texture, aspect) {
            Some(texture) => ScalarInput::Texture { texture, channel, uv: lookup.uv },
            None => ScalarInput::Constant(factor),
        }
    }

    /// The opacity: the alpha channel times a factor, and with `cutoff` 1 where that reaches it, else 0. None where the
    /// texture is opaque or cannot be read.
    pub(super) fn alpha(&mut self, lookup: &Lookup<'_>, factor: f32, cutoff: Option<f32>) -> Option<ScalarInput> {
        let aspect = match cutoff {
            Some(cutoff) => Aspect::Mask(factor.to_bits(), cutoff.to_bits()),
            None => Aspect::Alpha(factor.to_bits()),
        };
        let texture = self.texture(&lookup.texture, aspect)?;
        let values = &self.scene.textures[texture.0].texture;
        let first = values.texel(0, 0)[0];
        let is_even = (values.width(), values.height()) == (1, 1);
        match is_even {
            true if first == 1.0 => None,
            true => Some(ScalarInput::Constant(first)),
            false => Some(ScalarInput::Texture { texture, channel: 0, uv: lookup.uv }),
        }
    }

    /// The mean of a texture, as linear values or as sRGB colours; mid-grey where it cannot be read.
    pub(super) fn mean(&mut self, lookup: &Lookup<'_>, encoding: Encoding) -> [f32; 3] {
        let aspect = match encoding {
            Encoding::Srgb => Aspect::Color([1.0_f32.to_bits(); 3]),
            Encoding::Linear => Aspect::Values,
        };
        let texture = self.texture(&lookup.texture, aspect);
        texture.map_or([MISSING; 3], |at| self.scene.textures[at.0].texture.mean().map(|value| value as f32))
    }

    /// Reads a texture, unless it has been read before. A fault of its image is reported once.
    fn texture(&mut self, texture: &gltf::Texture<'_>, aspect: Aspect) -> Option<TextureIndex> {
        let [wrap, wrap_v] = wraps(texture);
        let image = texture.source();
        let key = (image.index(), wrap as u8, aspect);
        if let Some(known) = self.textures.get(&key) {
            return *known;
        }
        self.report_sampler(texture, wrap != wrap_v);
        let read = if self.faulty_images.contains(&image.index()) { None } else { self.load(&image, wrap, aspect) };
        self.textures.insert(key, read);
        read
    }

    fn report_sampler(&mut self, texture: &gltf::Texture<'_>, wraps_differ: bool) {
        let pointer = format!("/textures/{}", texture.index());
        if wraps_differ {
            let feature = "a texture that continues differently along v than along u";
            self.omit(Omission::Visible, feature, "used the mode of u for both", &pointer);
        }
        if texture.sampler().mag_filter() == Some(gltf::texture::MagFilter::Nearest) {
            self.omit(Omission::Slight, "textures without a filter", "filtered them bilinearly", &pointer);
        }
    }

    fn load(&mut self, image: &gltf::Image<'_>, wrap: Wrap, aspect: Aspect) -> Option<TextureIndex> {
        let encoding = if matches!(aspect, Aspect::Color(_)) { Encoding::Srgb } else { Encoding::Linear };
        let loaded = self.decode(image, encoding, wrap).and_then(|decoded| {
            let Decoded { name, sha256, color, alpha } = decoded;
            if let (Aspect::Color(_), Some(message)) = (aspect, other_range(&color)) {
                let pointer = format!("/images/{}", image.index());
                self.log.warn("out_of_range", &pointer, message, "used it as it is");
            }
            let texture = match aspect {
                Aspect::Color(bits) => scaled(color, bits.map(f32::from_bits)),
                Aspect::Values => Ok(color),
                Aspect::Channel(channel, bits) => {
                    let factor = f32::from_bits(bits);
                    grey(&color, |texel| texel[channel] * factor)
                }
                Aspect::Alpha(bits) => opacity(alpha, wrap, |alpha| alpha * f32::from_bits(bits)),
                Aspect::Mask(bits, cutoff) => {
                    let (factor, cutoff) = (f32::from_bits(bits), f32::from_bits(cutoff));
                    opacity(alpha, wrap, |alpha| if alpha * factor >= cutoff { 1.0 } else { 0.0 })
                }
            };
            let texture = texture.map_err(|error| picture_fault("bad_image", &error))?;
            Ok(SourceTexture { name, sha256: Some(sha256), texture })
        });
        match loaded {
            Ok(texture) => Some(self.scene.add_texture(texture)),
            Err(fault) => {
                self.report_image(image, fault);
                None
            }
        }
    }

    /// The decoded image; none, which is reported once, where it cannot be read.
    pub(super) fn decoded(&mut self, image: &gltf::Image<'_>, encoding: Encoding, wrap: Wrap) -> Option<Decoded> {
        if self.faulty_images.contains(&image.index()) {
            return None;
        }
        self.decode(image, encoding, wrap).map_err(|fault| self.report_image(image, fault)).ok()
    }

    fn report_image(&mut self, image: &gltf::Image<'_>, fault: FileFault) {
        self.faulty_images.insert(image.index());
        let file = self.log.file().to_owned();
        let pointer = format!("/images/{}", image.index());
        let action =
            "used linear mid-grey as colour, the factor as number, and no opacity; none of them counts as stated";
        self.log.push(Severity::Warning, fault.code, &file, &pointer, fault.message, action);
    }

    fn decode(&mut self, image: &gltf::Image<'_>, encoding: Encoding, wrap: Wrap) -> Result<Decoded, FileFault> {
        let limit = |most: usize| FileFault {
            code: "limit",
            message: format!("all textures together have more than {most} texels"),
        };
        if self.texels > self.limits.texels {
            return Err(limit(self.limits.texels));
        }
        let (bytes, file) = match image.source() {
            gltf::image::Source::Uri { uri, .. } => read_uri(uri, &mut self.source)?,
            gltf::image::Source::View { view, .. } => {
                let bytes = view_bytes(&view, self.buffers);
                let fault = |error| FileFault { code: "bad_image", message: format!("{error}") };
                (bytes.map_err(fault)?.to_vec(), None)
            }
        };
        if !SIGNATURES.iter().any(|signature| bytes.starts_with(signature)) {
            let message = format!("expected PNG, JPEG or WebP, found other bytes{}", hint(&bytes));
            return Err(FileFault { code: "bad_image", message });
        }
        let sha256 = sha256_of_bytes(&bytes);
        let own_name = || image.name().map(shortened).unwrap_or_else(|| format!("image {}", image.index()));
        let name = file.unwrap_or_else(own_name);
        report_turned(&bytes, &name, &format!("/images/{}", image.index()), &mut self.log);
        let read = texture_and_alpha_of_bytes(Path::new(&name), bytes, encoding, wrap);
        let (color, alpha) = read.map_err(|error| picture_fault("bad_image", &error))?;
        self.texels = self.texels.saturating_add(color.width() * color.height());
        if self.texels > self.limits.texels {
            return Err(limit(self.limits.texels));
        }
        Ok(Decoded { name, sha256, color, alpha })
    }
}

/// The texture times a linear factor; the texture itself where that is 1.
fn scaled(texture: Texture, factor: [f32; 3]) -> Result<Texture, ImageError> {
    if factor == [1.0; 3] {
        return Ok(texture);
    }
    let texels = texture.linear_texels().map(|texel| std::array::from_fn(|channel| texel[channel] * factor[channel]));
    Texture::new(texture.width(), texture.height(), Texels::Linear(texels.collect()), texture.wrap())
}

/// A texture of one number a texel.
pub(super) fn grey(texture: &Texture, value: impl Fn([f32; 3]) -> f32) -> Result<Texture, ImageError> {
    let texels = texture.linear_texels().map(value).collect();
    Texture::new(texture.width(), texture.height(), Texels::Grey(texels), texture.wrap())
}

/// The opacity of an alpha channel, which is 1 for a picture without one. A single texel where it is the same
/// everywhere.
fn opacity(alpha: Option<Texture>, wrap: Wrap, value: impl Fn(f32) -> f32) -> Result<Texture, ImageError> {
    match alpha {
        Some(alpha) => Ok(grey(&alpha, |texel| value(texel[0]))?.collapsed()),
        None => Texture::new(1, 1, Texels::Grey(vec![value(1.0)]), wrap),
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    fn of(transform: &str) -> UvTransform {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"images":[{{"uri":"a"}}],"textures":[{{"source":0}}],"materials":[
            {{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0,"extensions":{{"KHR_texture_transform":{transform}}}}}}}}}]}}"#
        );
        let file = mateval_dataset::gltf_file::parse(text.as_bytes()).unwrap().document;
        let info = file.materials().next().unwrap().pbr_metallic_roughness().base_color_texture().unwrap();
        Lookup::new(&info).uv
    }

    #[test]
    fn no_transform_is_the_identity() {
        assert_eq!(of("{}"), UvTransform::default());
    }

    /// The extension's example shader, by hand, at (0.25, 0.5) of glTF's coordinates.
    #[test]
    fn as_the_extension_defines_it() {
        let apply = |transform: &str| {
            let upward = of(transform).apply(Vec2::new(0.25, 1.0 - 0.5));
            Vec2::new(upward.x, 1.0 - upward.y)
        };
        assert_eq!(apply(r#"{"offset":[0.5,0.125],"scale":[2,3]}"#), Vec2::new(1.0, 1.625));
        // A quarter turn: matrix (0 1; -1 0) in glTF's coordinates.
        let turned = apply(r#"{"rotation":1.5707963267948966,"scale":[2,3]}"#);
        assert!((turned - Vec2::new(1.5, -0.5)).length() < 1e-6, "{turned}");
    }

    #[test]
    fn a_transform_that_overflows_is_one_point() {
        assert_eq!(of(r#"{"offset":[0,3e38],"scale":[1,3e38]}"#).apply(Vec2::ONE), Vec2::ZERO);
    }
}
