//! Colour and number parameters: constants, or bitmaps read from files.

use std::path::Path;

use mateval_dataset::material::{ColorInput, ScalarInput, TextureIndex, UvTransform};
use mateval_dataset::reference::SourceTexture;
use mateval_files::source_folder::FileFault;
use mateval_files::untrusted::shortened;
use mateval_image::texture_io::{Encoding, read_alpha, texture_and_alpha_of_bytes};
use mateval_image::{Texels, Texture, Wrap};

use super::color::{ColorUse, MOST_REFLECTANCE, constant_color};
use super::document::Element;
use super::reader::{Aspect, Parameters, Reader};
use crate::source_scene::{other_range, picture_fault, report_turned};

/// Linear mid-grey, which replaces a texture that cannot be read. (Mitsuba refuses such a scene.)
const MISSING: [f32; 3] = [0.5; 3];

/// A `<texture type="bitmap">` whose file has not been read.
struct Bitmap {
    file: String,
    linear: bool,
    wrap: Wrap,
    uv: UvTransform,
    channel: Option<char>,
    /// Whether all its parameters could be used as they are.
    is_exact: bool,
    place: String,
    line: usize,
}

impl<'a> Reader<'a> {
    /// Takes the colour `name`, linear Rec. 709. The default is grey.
    pub(super) fn color(&mut self, from: &mut Parameters<'a>, name: &str, default: f32) -> ColorInput {
        let Some(element) = from.take(&[name]) else { return ColorInput::Constant([default; 3]) };
        if element.tag != "texture" {
            let constant = self.constant(element, &from.place, ColorUse::Reflectance);
            if constant.is_none() {
                from.mark_replaced(name);
            }
            return ColorInput::Constant(constant.unwrap_or([default; 3]));
        }
        let color = self.color_bitmap(element, from, name);
        if let ColorInput::Texture { texture, .. } = &color
            && let Some(message) = other_range(&self.scene.textures[texture.0].texture)
        {
            let message = format!("line {}: '{}': {message}", element.line, shortened(name));
            self.log.warn("out_of_range", &from.place, message, "used it as it is; it does not count as stated");
            from.mark_replaced(name);
        }
        color
    }

    /// The bitmap `element`, which is the parameter `name`, as a colour. One that cannot be read is reported and
    /// becomes mid-grey.
    pub(super) fn color_bitmap(&mut self, element: &'a Element, from: &mut Parameters<'a>, name: &str) -> ColorInput {
        let read = self.bitmap(element, &from.place).and_then(|bitmap| {
            if bitmap.channel.is_some() {
                let message = format!("line {}: one channel of a bitmap as a colour", element.line);
                self.log.warn("unsupported", &from.place, message, "used all its channels");
            }
            let texture = self.texture(&bitmap, Aspect::Color)?;
            let is_exact = bitmap.is_exact && bitmap.channel.is_none();
            Some((ColorInput::Texture { texture, uv: bitmap.uv }, is_exact))
        });
        let (color, is_exact) = read.unwrap_or((ColorInput::Constant(MISSING), false));
        if !is_exact {
            from.mark_replaced(name);
        }
        color
    }

    /// Takes the number `name` from 0 to 1. As in Mitsuba, the luminance of a colour counts.
    pub(super) fn scalar(&mut self, from: &mut Parameters<'a>, name: &str, default: f32) -> ScalarInput {
        let Some(element) = from.take(&[name]) else { return ScalarInput::Constant(default) };
        if element.tag != "texture" {
            let constant = self.constant(element, &from.place, ColorUse::Reflectance);
            if constant.is_none() {
                from.mark_replaced(name);
            }
            return ScalarInput::Constant(constant.map_or(default, luminance));
        }
        self.scalar_texture(element, &from.place, false).unwrap_or_else(|| {
            from.mark_replaced(name);
            ScalarInput::Constant(default)
        })
    }

    /// Takes the opacity `name`: the alpha channel of a picture whose alpha is not 1 everywhere, else its luminance.
    ///
    /// Mitsuba always takes the luminance and ignores alpha, which makes the white background of a cut-out leaf opaque
    /// and the leaf half transparent. The scenes were converted from a renderer that takes alpha.
    pub(super) fn opacity(&mut self, from: &mut Parameters<'a>, name: &str) -> Option<ScalarInput> {
        let Some(element) = from.take(&[name]) else { return Some(ScalarInput::Constant(0.5)) };
        if element.tag != "texture" {
            return self
                .constant(element, &from.place, ColorUse::Reflectance)
                .map(|rgb| ScalarInput::Constant(luminance(rgb)));
        }
        self.scalar_texture(element, &from.place, true)
    }

    /// A number from a texture: its alpha where `prefer_alpha` holds and that is not 1 everywhere, else its luminance.
    /// None where it cannot be read.
    pub(super) fn scalar_texture(
        &mut self,
        element: &'a Element,
        place: &str,
        prefer_alpha: bool,
    ) -> Option<ScalarInput> {
        let bitmap = self.bitmap(element, place)?;
        let (aspect, channel) = match bitmap.channel {
            Some('a') => (Aspect::Alpha, 0),
            Some(letter) => (Aspect::Color, "rgb".find(letter).unwrap_or(0)),
            None if prefer_alpha && self.has_transparency(&bitmap) => (Aspect::Alpha, 0),
            None => (Aspect::Luminance, 0),
        };
        if aspect == Aspect::Alpha && bitmap.channel.is_none() {
            let message = format!("opacity from '{}', whose alpha is not 1 everywhere", shortened(&bitmap.file));
            self.log.note("opacity_from_alpha", place, message, "used alpha; Mitsuba uses the luminance");
        }
        let texture = self.texture(&bitmap, aspect)?;
        Some(ScalarInput::Texture { texture, channel, uv: bitmap.uv })
    }

    /// The constant colour of an element ([`constant_color`]). Anything else is reported and gives none.
    pub(super) fn constant(&mut self, element: &Element, place: &str, usage: ColorUse) -> Option<[f32; 3]> {
        match constant_color(element, usage, self.major_version, &mut self.source) {
            Ok(rgb) => self.bounded(rgb, element, place, usage),
            Err(error) => {
                let message = format!("line {}: '{}': {error}", element.line, shortened(element.name()));
                self.log.warn("bad_value", place, message, "used the default");
                None
            }
        }
    }

    /// The colour in its range. As in Mitsuba, a reflectance outside of it is refused, save for noise.
    fn bounded(&mut self, rgb: [f64; 3], element: &Element, place: &str, usage: ColorUse) -> Option<[f32; 3]> {
        let is_reflectance = usage == ColorUse::Reflectance;
        let most = if is_reflectance { 1.0 } else { 1e9 };
        let is_refused = is_reflectance && rgb.iter().any(|v| *v < 0.0 || *v > MOST_REFLECTANCE);
        if rgb.iter().any(|v| *v < 0.0 || *v > most) {
            let message = format!("line {}: '{}': expected 0 to {most}, found {rgb:?}", element.line, element.name());
            let action = if is_refused { "used the default" } else { "clamped" };
            self.log.warn("out_of_range", place, message, action);
        }
        (!is_refused).then(|| rgb.map(|v| v.clamp(0.0, most) as f32))
    }

    fn bitmap(&mut self, element: &'a Element, place: &str) -> Option<Bitmap> {
        if element.kind() != "bitmap" {
            let message = format!("line {}: the texture '{}' is not known", element.line, shortened(element.kind()));
            self.log.warn("unknown_plugin", place, message, "used mid-grey, or the default of a number");
            return None;
        }
        let mut from = self.parameters(element, place.to_owned());
        let name = from.string("filename").unwrap_or("");
        let file = match self.file(name) {
            Ok(file) => file,
            Err(fault) => {
                self.report_file(name, place, element.line, &fault, TEXTURE_LEFT_OUT);
                return None;
            }
        };
        let linear = self.is_linear(&mut from, element);
        let wrap = self.wrap(&mut from, element);
        self.check_filter(&mut from, element);
        let uv = self.uv_transform(&mut from);
        let channel = from.string("channel").and_then(|text| {
            let letter = text.trim().to_ascii_lowercase().chars().next().filter(|letter| "rgba".contains(*letter));
            if letter.is_none() {
                let message = format!("line {}: the channel '{}' is not known", element.line, shortened(text));
                self.log.warn("bad_value", place, message, "used all channels");
                from.mark_replaced("channel");
            }
            letter
        });
        from.ignore(&["cache", "max_anisotropy", "format", "accel"]);
        let is_exact = !from.is_any_replaced();
        from.finish(&mut self.log);
        Some(Bitmap { file, linear, wrap, uv, channel, is_exact, place: place.to_owned(), line: element.line })
    }

    /// Whether a file of integers is decoded as linear (`raw`, or a gamma of 1) instead of as sRGB. Files of floats are
    /// always linear.
    fn is_linear(&mut self, from: &mut Parameters<'a>, element: &Element) -> bool {
        let raw = from.boolean("raw", false, &mut self.log);
        let Some(gamma) = from.number("gamma", &mut self.log) else { return raw };
        if gamma != 1.0 && gamma != -1.0 {
            let message = format!("line {}: a bitmap with gamma {gamma}", element.line);
            self.log.note("gamma_approximated", &from.place, message, "decoded with the sRGB curve");
        }
        raw || gamma == 1.0
    }

    fn wrap(&mut self, from: &mut Parameters<'a>, element: &Element) -> Wrap {
        let mut found = [from.string("wrap_mode"), from.string("wrap_mode_u"), from.string("wrap_mode_v")];
        let both = found[0].take();
        let (u, v) = (found[1].or(both), found[2].or(both));
        if u != v {
            let message = format!("line {}: a bitmap wraps differently along u and v", element.line);
            self.log.warn("unsupported", &from.place, message, "used the mode of u for both");
            from.mark_replaced("wrap_mode_v");
        }
        match u.or(v).unwrap_or("repeat") {
            "repeat" => Wrap::Repeat,
            "clamp" => Wrap::Clamp,
            "mirror" => Wrap::Mirror,
            other => {
                let message = format!("line {}: wrap mode '{}' is not known", element.line, shortened(other));
                self.log.warn("bad_value", &from.place, message, "used repeat");
                from.mark_replaced("wrap_mode");
                Wrap::Repeat
            }
        }
    }

    fn check_filter(&mut self, from: &mut Parameters<'a>, element: &Element) {
        let filter = from.string("filter_type").unwrap_or("bilinear");
        if !matches!(filter, "bilinear" | "trilinear" | "ewa") {
            let message = format!("line {}: filter '{}'", element.line, shortened(filter));
            self.log.warn("unsupported", &from.place, message, "filtered bilinearly");
        }
    }

    /// Mitsuba's v grows downwards in the picture (it flips the vt of an OBJ on loading), MatEval's grows upwards, so
    /// each is 1 minus the other.
    fn uv_transform(&mut self, from: &mut Parameters<'a>) -> UvTransform {
        let m = from.transform("to_uv", &mut self.log);
        let number = |from: &mut Parameters<'a>, name, default, log: &mut _| from.number(name, log).unwrap_or(default);
        let scale = [number(from, "uscale", 1.0, &mut self.log), number(from, "vscale", 1.0, &mut self.log)];
        let offset = [number(from, "uoffset", 0.0, &mut self.log), number(from, "voffset", 0.0, &mut self.log)];
        let rows: [[f64; 3]; 2] = std::array::from_fn(|r| {
            let (x, y, shift) = (m.x_axis[r] * scale[r], m.y_axis[r] * scale[r], m.w_axis[r] * scale[r] + offset[r]);
            if r == 0 { [x, -y, y + shift] } else { [-x, y, 1.0 - y - shift] }
        });
        // Adding 0 turns the -0 of an absent shear into 0.
        UvTransform(rows.map(|row| row.map(|v| v as f32 + 0.0)))
    }

    /// Whether the file has an alpha channel that is not 1 everywhere.
    fn has_transparency(&mut self, bitmap: &Bitmap) -> bool {
        if let Some(known) = self.alphas.get(&bitmap.file) {
            return *known;
        }
        let path = self.source.path(&bitmap.file).ok();
        let alpha = path.and_then(|path| read_alpha(&path, bitmap.wrap).ok()).flatten();
        let transparent = alpha.is_some_and(|alpha| alpha.linear_texels().any(|value| value[0] != 1.0));
        self.alphas.insert(bitmap.file.clone(), transparent);
        transparent
    }

    /// Reads a texture, unless it has been read before. A fault of its file is reported once.
    fn texture(&mut self, bitmap: &Bitmap, aspect: Aspect) -> Option<TextureIndex> {
        let key = (bitmap.file.clone(), bitmap.linear, bitmap.wrap as u8, aspect);
        if let Some(known) = self.textures.get(&key) {
            return *known;
        }
        let index = match self.load(bitmap, aspect) {
            Ok(texture) => Some(self.add_texture(bitmap.file.clone(), texture)),
            Err(fault) => {
                self.report_file(&bitmap.file, &bitmap.place, bitmap.line, &fault, TEXTURE_LEFT_OUT);
                None
            }
        };
        self.textures.insert(key, index);
        index
    }

    /// Adds a texture to the scene. It carries the hash of the file `name`, if that was read.
    pub(super) fn add_texture(&mut self, name: String, texture: Texture) -> TextureIndex {
        let sha256 = self.source.hash(&name);
        self.scene.add_texture(SourceTexture { name, sha256, texture })
    }

    fn load(&mut self, bitmap: &Bitmap, aspect: Aspect) -> Result<Texture, FileFault> {
        let texture = self.read_picture(&bitmap.file, bitmap.linear, bitmap.wrap, aspect == Aspect::Alpha)?;
        if aspect == Aspect::Luminance { luminance_texture(&texture) } else { Ok(texture) }
    }

    /// Reads the picture `file` of the scene's folder.
    pub(super) fn read_picture(
        &mut self,
        file: &str,
        linear: bool,
        wrap: Wrap,
        alpha: bool,
    ) -> Result<Texture, FileFault> {
        let bytes = self.source.read(file)?;
        report_turned(&bytes, file, "", &mut self.log);
        let encoding = if linear || alpha { Encoding::Linear } else { Encoding::Srgb };
        let read = texture_and_alpha_of_bytes(Path::new(file), bytes, encoding, wrap);
        let texture = read.map(|(color, opacity)| if alpha { opacity } else { Some(color) });
        let texture = texture
            .map_err(|error| {
                // Without the folders of this machine.
                let FileFault { code, message } = picture_fault("unreadable_texture", &error);
                FileFault { code, message: format!("'{}': {message}", shortened(file)) }
            })?
            .ok_or_else(|| FileFault {
                code: "bad_value",
                message: format!("'{}' has no alpha channel", shortened(file)),
            })?;
        let total = self.texels.saturating_add(texture.width().saturating_mul(texture.height()));
        if total > self.limits.texels {
            let message = format!("all textures together have more than {} texels", self.limits.texels);
            return Err(FileFault { code: "limit", message });
        }
        self.texels = total;
        Ok(texture)
    }
}

const TEXTURE_LEFT_OUT: &str = "used linear mid-grey 0.5; as opacity or bump map, nothing";

/// The luminance of a linear colour by Mitsuba's own weights, which have more digits than those of Rec. 709.
fn luminance(rgb: [f32; 3]) -> f32 {
    if rgb[0] == rgb[1] && rgb[1] == rgb[2] {
        return rgb[0];
    }
    0.212671 * rgb[0] + 0.715160 * rgb[1] + 0.072169 * rgb[2]
}

fn luminance_texture(texture: &Texture) -> Result<Texture, FileFault> {
    if matches!(texture.texels(), Texels::Grey(_) | Texels::Grey8(_)) {
        return Ok(texture.clone());
    }
    let values = texture.linear_texels().map(luminance).collect();
    Texture::new(texture.width(), texture.height(), Texels::Grey(values), texture.wrap())
        .map_err(|error| FileFault { code: "unreadable_texture", message: error.to_string() })
}
