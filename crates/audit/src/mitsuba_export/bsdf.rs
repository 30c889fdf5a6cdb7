//! Writes materials as Mitsuba's BSDF plugins.

use mateval_image::ImageError;
use mateval_scene::material::{
    ColorInput, ConductorIor, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
};

use super::element::Element;
use super::remarks::Remarks;
use super::texture::TextureFiles;

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
                Ok(bsdf.float("alpha", self.files.mean(texture.0, *channel)))
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
