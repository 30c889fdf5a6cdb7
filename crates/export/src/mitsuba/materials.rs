//! Writes materials as Mitsuba's BSDF plugins, and their textures: files of their texels, and the parameters of their
//! lookup.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::material::{
    ColorInput, ConductorIor, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
    UvTransform,
};
use mateval_image::exr_io::{self, Precision};
use mateval_image::{ImageError, LinearRgb, Picture, Texels, Texture, Wrap, png_io};

use super::xml::{Element, Remarks};

/// The material as a plugin. `remarks` receives what Mitsuba cannot express.
pub(super) fn bsdf(
    material: &Material,
    place: &str,
    files: &mut TextureFiles<'_>,
    remarks: &mut Remarks,
) -> Result<Element, ImageError> {
    let mut writer = Writer { place, files, remarks };
    let inner = writer.model(&material.model)?;
    let transmits = !material.has_appearance();
    let inner = if material.two_sided && !transmits { Element::plugin("bsdf", "twosided").child(inner) } else { inner };
    let inner = match &material.bump {
        // A constant height bends no normals.
        Some(bump) if matches!(bump.height, ScalarInput::Texture { .. }) => {
            // Mitsuba's softened terminator and its correction of bent normals are newer than the source scenes.
            let around = Element::plugin("bsdf", "bumpmap")
                .float("scale", bump.scale)
                .boolean("use_shadowing_function", false)
                .boolean("flip_invalid_normals", false);
            writer.files.scalar(around, "height", &bump.height)?.child(inner)
        }
        _ => inner,
    };
    match &material.opacity {
        Some(opacity) => {
            let text = "Mitsuba counts passing through the surface as a scattering";
            writer.remarks.note(
                "mask_counts",
                place,
                text,
                "wrote it; paths through many such surfaces end earlier in Mitsuba",
            );
            Ok(writer.files.scalar(Element::plugin("bsdf", "mask"), "opacity", opacity)?.child(inner))
        }
        None => Ok(inner),
    }
}

struct Writer<'w, 'f> {
    place: &'w str,
    files: &'w mut TextureFiles<'f>,
    remarks: &'w mut Remarks,
}

impl Writer<'_, '_> {
    fn model(&mut self, model: &MaterialModel) -> Result<Element, ImageError> {
        match model {
            MaterialModel::Diffuse { reflectance, alpha } => {
                if alpha.is_some() {
                    self.warn("oren_nayar", "Mitsuba 3 has no rough diffuse surface", "wrote a smooth diffuse one");
                }
                self.color(Element::plugin("bsdf", "diffuse"), "reflectance", reflectance)
            }
            MaterialModel::Conductor { ior, specular_reflectance, microfacets } => {
                let name = if microfacets.is_some() { "roughconductor" } else { "conductor" };
                let bsdf = conductor_ior(Element::plugin("bsdf", name), ior);
                let bsdf = self.color(bsdf, "specular_reflectance", specular_reflectance)?;
                self.microfacets(bsdf, microfacets, true)
            }
            MaterialModel::Plastic { eta, nonlinear, diffuse_reflectance, specular_reflectance, microfacets } => {
                let name = if microfacets.is_some() { "roughplastic" } else { "plastic" };
                let bsdf = indices(Element::plugin("bsdf", name), *eta).boolean("nonlinear", *nonlinear);
                let bsdf = self.color(bsdf, "diffuse_reflectance", diffuse_reflectance)?;
                let bsdf = self.color(bsdf, "specular_reflectance", specular_reflectance)?;
                self.microfacets(bsdf, microfacets, false)
            }
            MaterialModel::Dielectric { eta, specular_reflectance, specular_transmittance, microfacets } => {
                let name = if microfacets.is_some() { "roughdielectric" } else { "dielectric" };
                let bsdf = indices(Element::plugin("bsdf", name), *eta);
                let bsdf = self.color(bsdf, "specular_reflectance", specular_reflectance)?;
                let bsdf = self.color(bsdf, "specular_transmittance", specular_transmittance)?;
                self.microfacets(bsdf, microfacets, true)
            }
            MaterialModel::ThinDielectric { eta, specular_reflectance, specular_transmittance } => {
                let bsdf = indices(Element::plugin("bsdf", "thindielectric"), *eta);
                let bsdf = self.color(bsdf, "specular_reflectance", specular_reflectance)?;
                self.color(bsdf, "specular_transmittance", specular_transmittance)
            }
            MaterialModel::Principled { base_color, roughness, metallic, specular, flavour } => {
                self.principled(*specular, *flavour);
                let bsdf = Element::plugin("bsdf", "principled").float("specular", *specular);
                let bsdf = self.color(bsdf, "base_color", base_color)?;
                let bsdf = self.files.scalar(bsdf, "roughness", roughness)?;
                self.files.scalar(bsdf, "metallic", metallic)
            }
            #[allow(
                unreachable_patterns,
                reason = "every model is written today; a new one must not need a change here"
            )]
            _ => {
                self.warn("unknown_material", "the export does not know this material", "wrote a grey diffuse one");
                Ok(Element::plugin("bsdf", "diffuse").rgb("reflectance", [0.5; 3]))
            }
        }
    }

    fn principled(&mut self, specular: f32, flavour: PrincipledFlavour) {
        if flavour == PrincipledFlavour::Blender {
            self.warn("blender_principled", "Mitsuba's `principled` is not Blender's", "wrote Mitsuba's");
        }
        if specular <= 0.0 || specular > 1.0 {
            let message = format!("specular is {specular}; Mitsuba takes numbers above 0 and up to 1");
            self.warn("specular", &message, "wrote it as it is");
        }
    }

    fn color(&mut self, bsdf: Element, name: &'static str, input: &ColorInput) -> Result<Element, ImageError> {
        let ColorInput::Constant(rgb) = input else { return self.files.color(bsdf, name, input) };
        let clamped = rgb.map(|v| v.clamp(0.0, 1.0));
        if clamped != *rgb {
            let message = format!("{name} is {rgb:?}; Mitsuba takes numbers from 0 to 1");
            self.warn("color_range", &message, "clamped it to that range");
        }
        Ok(bsdf.rgb(name, clamped))
    }

    fn microfacets(
        &mut self,
        bsdf: Element,
        microfacets: &Option<Microfacets>,
        takes_texture: bool,
    ) -> Result<Element, ImageError> {
        let Some(Microfacets { distribution, alpha }) = microfacets else { return Ok(bsdf) };
        let bsdf = bsdf.string(
            "distribution",
            match distribution {
                Distribution::Ggx => "ggx",
                Distribution::Beckmann => "beckmann",
            },
        );
        match alpha {
            ScalarInput::Texture { texture, channel, .. } if !takes_texture => {
                let message = "Mitsuba's `roughplastic` takes no texture as its alpha";
                self.warn("alpha_texture", message, "wrote the mean of the texture");
                Ok(bsdf.float("alpha", self.files.textures[texture.0].mean()[*channel] as f32))
            }
            alpha => self.files.scalar(bsdf, "alpha", alpha),
        }
    }

    fn warn(&mut self, code: &str, message: &str, action: &str) {
        self.remarks.warn(code, self.place, message, action);
    }
}

fn indices(bsdf: Element, eta: f32) -> Element {
    bsdf.float("int_ior", eta).float("ext_ior", 1.0_f32)
}

fn conductor_ior(bsdf: Element, ior: &ConductorIor) -> Element {
    match ior {
        ConductorIor::PerfectMirror => bsdf.string("material", "none"),
        ConductorIor::EtaK { eta, k } => bsdf.rgb("eta", *eta).rgb("k", *k),
    }
}

/// The textures of a scene. Each is written to disk when it is first used.
pub(super) struct TextureFiles<'a> {
    folder: &'a Path,
    textures: &'a [Texture],
    /// The file of each texture and channel that was written; the channel is none for colours.
    written: BTreeMap<(usize, Option<usize>), String>,
}

impl<'a> TextureFiles<'a> {
    pub(super) fn new(folder: &'a Path, textures: &'a [Texture]) -> Self {
        Self { folder, textures, written: BTreeMap::new() }
    }

    /// `parent` with the colour as its parameter `name`.
    pub(super) fn color(
        &mut self,
        parent: Element,
        name: &'static str,
        input: &ColorInput,
    ) -> Result<Element, ImageError> {
        Ok(match input {
            ColorInput::Constant(rgb) => parent.rgb(name, *rgb),
            ColorInput::Texture { texture, uv } => parent.child(self.bitmap(name, texture.0, None, uv)?),
        })
    }

    /// `parent` with the number as its parameter `name`.
    pub(super) fn scalar(
        &mut self,
        parent: Element,
        name: &'static str,
        input: &ScalarInput,
    ) -> Result<Element, ImageError> {
        Ok(match input {
            ScalarInput::Constant(value) => parent.float(name, *value),
            ScalarInput::Texture { texture, channel, uv } => {
                parent.child(self.bitmap(name, texture.0, Some(*channel), uv)?)
            }
        })
    }

    fn bitmap(
        &mut self,
        name: &'static str,
        index: usize,
        channel: Option<usize>,
        uv: &UvTransform,
    ) -> Result<Element, ImageError> {
        let file = match self.written.get(&(index, channel)) {
            Some(file) => file.clone(),
            None => {
                let file = write_texture(self.folder, &self.textures[index], index, channel)?;
                self.written.insert((index, channel), file.clone());
                file
            }
        };
        Ok(bitmap(name, file, channel.is_some(), self.textures[index].wrap(), uv))
    }
}

/// The texture times `radiance`, as the parameter `radiance` of the lights of group `group`. It is written below
/// `folder` as floats and marked `raw`: Mitsuba cannot scale a texture, and takes that of a light for a reflectance
/// otherwise.
pub(super) fn radiance_map(
    folder: &Path,
    group: usize,
    texture: &Texture,
    uv: &UvTransform,
    radiance: [f32; 3],
) -> Result<Element, ImageError> {
    let (width, height) = (texture.width(), texture.height());
    let file = format!("textures/light_{group}.exr");
    // Mitsuba requires at least two columns and rows; repeating a single one does not change the lookup.
    let picture = Picture::from_fn(width.max(2), height.max(2), |x, y| {
        let texel = texture.texel(x % width, y % height);
        LinearRgb(std::array::from_fn(|c| radiance[c] * texel[c]))
    });
    exr_io::write_linear(&folder.join(&file), &picture, Precision::Float)?;
    Ok(bitmap("radiance", file, true, texture.wrap(), uv))
}

fn bitmap(name: &'static str, file: String, raw: bool, wrap: Wrap, uv: &UvTransform) -> Element {
    let wrap = match wrap {
        Wrap::Repeat => "repeat",
        Wrap::Clamp => "clamp",
        Wrap::Mirror => "mirror",
    };
    Element::plugin("texture", "bitmap")
        .named(name)
        .string("filename", file)
        .boolean("raw", raw)
        .string("filter_type", "bilinear")
        .string("wrap_mode", wrap)
        .matrix("to_uv", rows_downwards(uv))
}

/// The transform for Mitsuba, whose v grows downwards in the picture. That of the mesh grows upwards, so v' = 1 - v.
fn rows_downwards(uv: &UvTransform) -> [[f64; 4]; 4] {
    let [[a, b, c], [d, e, f]] = uv.0.map(|row| row.map(f64::from));
    [[a, b, 0.0, c], [-d, -e, 0.0, 1.0 - f], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
}

/// Writes a texture's colours, or one of its channels, so that Mitsuba reads exactly the same numbers: as bytes where
/// they are encoded as Mitsuba decodes them, otherwise as floats. Returns the file's path below `folder`.
fn write_texture(folder: &Path, texture: &Texture, index: usize, channel: Option<usize>) -> Result<String, ImageError> {
    let (width, height) = (texture.width(), texture.height());
    let stem = match channel {
        None => format!("textures/{index}"),
        Some(channel) => format!("textures/{index}_{}", ["red", "green", "blue"][channel]),
    };
    let (png, exr) = (format!("{stem}.png"), format!("{stem}.exr"));
    match (channel, texture.texels()) {
        (None, Texels::Srgb8(v)) => {
            png_io::write_rgb_bytes(&folder.join(&png), &Picture::new(width, height, v.clone())?)?;
            Ok(png)
        }
        (Some(_), Texels::Grey8(v)) => {
            png_io::write_grey_bytes(&folder.join(&png), &Picture::new(width, height, v.clone())?)?;
            Ok(png)
        }
        (Some(channel), Texels::Linear8(v)) => {
            let bytes = v.iter().map(|texel| texel[channel]).collect();
            png_io::write_grey_bytes(&folder.join(&png), &Picture::new(width, height, bytes)?)?;
            Ok(png)
        }
        (None, _) => {
            let picture = Picture::from_fn(width, height, |x, y| LinearRgb(texture.texel(x, y)));
            exr_io::write_linear(&folder.join(&exr), &picture, Precision::Float)?;
            Ok(exr)
        }
        (Some(channel), _) => {
            let picture = Picture::from_fn(width, height, |x, y| texture.texel(x, y)[channel]);
            exr_io::write_grey(&folder.join(&exr), &picture, Precision::Float)?;
            Ok(exr)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The transform maps uv of the mesh to the place that our lookup reads, measured from the picture's top.
    #[test]
    fn the_transform_leads_to_the_same_texel() {
        let uv = UvTransform([[2.0, 0.5, 0.25], [-0.5, 3.0, 0.75]]);
        let rows = rows_downwards(&uv);
        for at in [glam::Vec2::new(0.2, 0.9), glam::Vec2::new(-3.0, 0.1)] {
            let ours = uv.apply(at);
            let row = |r: [f64; 4]| r[0] * f64::from(at.x) + r[1] * f64::from(at.y) + r[3];
            assert!((row(rows[0]) - f64::from(ours.x)).abs() < 1e-6);
            assert!((row(rows[1]) - f64::from(1.0 - ours.y)).abs() < 1e-6);
        }
    }
}
