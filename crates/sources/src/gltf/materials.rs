//! Materials: metallic-roughness as Blender's principled, specular-glossiness converted to it
//! (`KHR_materials_pbrSpecularGlossiness`, which writers used before 2021), glass by `KHR_materials_transmission`,
//! alpha modes, emission.

use gltf::material::{AlphaMode, PbrSpecularGlossiness};
use mateval_dataset::material::{
    ColorInput, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput, StatedParameters,
};
use mateval_dataset::reference::{EmissionMap, SourceTexture};
use mateval_dataset::specular_glossiness::{SpecularGlossiness, SpecularTextures, textures};
use mateval_files::untrusted::shortened;
use mateval_image::texture_io::Encoding;

use super::reader::{Glow, LEFT_OUT, Omission, ReadMaterial, Reader};
use super::textures::{Lookup, grey, wraps};

/// The index of refraction of `KHR_materials_ior` where the file states none.
const DEFAULT_IOR: f32 = 1.5;
/// Disney's `specular` is the reflectance at normal incidence over this; an index of 1.5 gives 0.5.
const MOST_REFLECTANCE: f32 = 0.08;
/// From this share of transmitted light on a material is glass.
const GLASS: f32 = 0.5;
/// Factors this far outside of 0 to 1 are rounding.
const ROUNDING: f32 = 0.001;

/// The lookups of a material's textures. All are looked up at the uv set of the first; the mean stands for a texture at
/// another set, since a mesh has one uv.
struct Lookups<'a> {
    /// Of the base colour, or the diffuse colour.
    base_color: Option<Lookup<'a>>,
    /// Of metallic and roughness, or specular colour and glossiness.
    metallic_roughness: Option<Lookup<'a>>,
    emissive: Option<Lookup<'a>>,
}

impl<'a> Lookups<'a> {
    fn new(material: &gltf::Material<'a>) -> Self {
        let emissive = material.emissive_texture().map(|info| Lookup::new(&info));
        if let Some(specular) = material.pbr_specular_glossiness() {
            return Self {
                base_color: specular.diffuse_texture().map(|info| Lookup::new(&info)),
                metallic_roughness: specular.specular_glossiness_texture().map(|info| Lookup::new(&info)),
                emissive,
            };
        }
        let pbr = material.pbr_metallic_roughness();
        Self {
            base_color: pbr.base_color_texture().map(|info| Lookup::new(&info)),
            metallic_roughness: pbr.metallic_roughness_texture().map(|info| Lookup::new(&info)),
            emissive,
        }
    }

    /// The uv set of the material; absent if it has no texture.
    fn set(&self) -> Option<u32> {
        let first = self.base_color.as_ref().or(self.metallic_roughness.as_ref()).or(self.emissive.as_ref());
        first.map(|lookup| lookup.set)
    }
}

/// Whether the base colour of a material can be another than black.
fn shows_color(material: &gltf::Material<'_>) -> bool {
    let [red, green, blue, _] = match material.pbr_specular_glossiness() {
        Some(extension) => extension.diffuse_factor(),
        None => material.pbr_metallic_roughness().base_color_factor(),
    };
    [red, green, blue] != [0.0; 3]
}

impl Reader<'_> {
    /// The material of a primitive, read when it is first used.
    pub(super) fn material(&mut self, material: &gltf::Material<'_>) -> ReadMaterial {
        if let Some(known) = self.materials.get(&material.index()) {
            return *known;
        }
        let pointer = material.index().map_or_else(|| "/materials".to_owned(), |index| format!("/materials/{index}"));
        self.report_omitted(material, &pointer);
        let lookups = Lookups::new(material);
        let model = self.model(material, &lookups, &pointer);
        let opacity = self.opacity(material, &lookups, &pointer);
        let glow = self.glow(material, &lookups, &pointer);
        let own_name = || material.index().map_or_else(|| "default".to_owned(), |index| format!("material {index}"));
        let name = material.name().map(shortened).unwrap_or_else(own_name);
        let stated = self.known(self.stated(material), material, &lookups, &pointer);
        let stated = self.in_range(stated, material, &pointer);
        if lookups.emissive.is_some() && glow.is_some() && !(stated.base_color && shows_color(material)) {
            let message = format!("'{name}' emits by a texture and has no base colour but black or a default");
            let action = "took it for a lamp; colours that were baked to emission belong in the base colour";
            self.log.warn("only_emission", &pointer, message, action);
        }
        let index = self.scene.add_material(Material { opacity, ..Material::new(name, model) });
        let read = ReadMaterial { index, uv_set: lookups.set(), stated, glow };
        self.materials.insert(material.index(), read);
        read
    }

    /// What the file states of a material. A primitive without a material has the format's default, which states
    /// nothing.
    fn stated(&self, material: &gltf::Material<'_>) -> StatedParameters {
        let nothing = StatedParameters { base_color: false, roughness: false, metallic: false, emission: false };
        material.index().and_then(|index| self.file.stated.get(index)).copied().unwrap_or(nothing)
    }

    /// What the file states of a material, without the parameters whose texture was not read: the value that stands for
    /// the texture is not the file's. Follows the reading of all textures of the material.
    fn known(
        &self,
        stated: StatedParameters,
        material: &gltf::Material<'_>,
        lookups: &Lookups<'_>,
        pointer: &str,
    ) -> StatedParameters {
        let is_unread = |lookup: &Option<Lookup<'_>>, keys: &[&str]| {
            let is_faulty = |lookup: &Lookup<'_>| self.faulty_images.contains(&lookup.texture.source().index());
            let names_no_picture = |key: &&str| self.without_picture.contains(format!("{pointer}/{key}").as_str());
            lookup.as_ref().is_some_and(is_faulty) || keys.iter().any(names_no_picture)
        };
        let emissive = is_unread(&lookups.emissive, &["emissiveTexture"]) && material.emissive_factor() != [0.0; 3];
        let emission = stated.emission && !emissive;
        if material.pbr_specular_glossiness().is_some() {
            let extension = "extensions/KHR_materials_pbrSpecularGlossiness";
            let key = |name: &str| format!("{extension}/{name}");
            let diffuse = is_unread(&lookups.base_color, &[&key("diffuseTexture")]);
            let specular = is_unread(&lookups.metallic_roughness, &[&key("specularGlossinessTexture")]);
            // The conversion makes base colour and metallic of both colours, and roughness of the glossiness alone.
            return StatedParameters {
                base_color: stated.base_color && !diffuse && !specular,
                roughness: stated.roughness && !specular,
                metallic: stated.metallic && !diffuse && !specular,
                emission,
            };
        }
        let pbr = material.pbr_metallic_roughness();
        let base_color = is_unread(&lookups.base_color, &["pbrMetallicRoughness/baseColorTexture"]);
        let numbers = is_unread(&lookups.metallic_roughness, &["pbrMetallicRoughness/metallicRoughnessTexture"]);
        // A factor of 0 is the value, whatever the texture holds.
        StatedParameters {
            base_color: stated.base_color && !base_color,
            roughness: stated.roughness && !(numbers && pbr.roughness_factor() != 0.0),
            metallic: stated.metallic && !(numbers && pbr.metallic_factor() != 0.0),
            emission,
        }
    }

    /// What the file states of a material, without the parameters whose factors lie outside of 0 to 1 by more than
    /// rounding, which is a finding.
    fn in_range(
        &mut self,
        mut stated: StatedParameters,
        material: &gltf::Material<'_>,
        pointer: &str,
    ) -> StatedParameters {
        let pbr = material.pbr_metallic_roughness();
        let color = |[red, green, blue, _]: [f32; 4]| vec![red, green, blue];
        let factors = match material.pbr_specular_glossiness() {
            Some(extension) => [
                ("diffuseFactor", color(extension.diffuse_factor())),
                ("specularFactor", extension.specular_factor().to_vec()),
                ("glossinessFactor", vec![extension.glossiness_factor()]),
            ],
            None => [
                ("baseColorFactor", color(pbr.base_color_factor())),
                ("metallicFactor", vec![pbr.metallic_factor()]),
                ("roughnessFactor", vec![pbr.roughness_factor()]),
            ],
        };
        for (name, values) in factors {
            if values.iter().all(|value| (-ROUNDING..=1.0 + ROUNDING).contains(value)) {
                continue;
            }
            let message = format!("{name}: expected 0 to 1, found {values:?}");
            self.log.warn("out_of_range", pointer, message, "clamped it; it does not count as stated");
            match name {
                "baseColorFactor" => stated.base_color = false,
                // The conversion makes both of both colours.
                "diffuseFactor" | "specularFactor" => (stated.base_color, stated.metallic) = (false, false),
                "metallicFactor" => stated.metallic = false,
                _ => stated.roughness = false,
            }
        }
        stated
    }

    fn model(&mut self, material: &gltf::Material<'_>, lookups: &Lookups<'_>, pointer: &str) -> MaterialModel {
        let (base_color, [roughness, metallic]) = match material.pbr_specular_glossiness() {
            Some(extension) => {
                let (diffuse, specular) = (lookups.base_color.as_ref(), lookups.metallic_roughness.as_ref());
                let states_specular = self.stated(material).metallic;
                self.specular_glossiness(&extension, states_specular, diffuse, specular, pointer)
            }
            None => self.metallic_roughness(material, lookups, pointer),
        };
        if let Some(glass) = self.glass(material, base_color, roughness, pointer) {
            return glass;
        }
        let specular = self.specular(material, pointer);
        MaterialModel::Principled { base_color, roughness, metallic, specular, flavour: PrincipledFlavour::Blender }
    }

    /// Base colour, roughness and metallic by the core of glTF.
    fn metallic_roughness(
        &mut self,
        material: &gltf::Material<'_>,
        lookups: &Lookups<'_>,
        pointer: &str,
    ) -> (ColorInput, [ScalarInput; 2]) {
        let pbr = material.pbr_metallic_roughness();
        let [red, green, blue, _] = pbr.base_color_factor().map(|factor| factor.clamp(0.0, 1.0));
        let base_color = match &lookups.base_color {
            Some(lookup) => self.color(lookup, [red, green, blue]),
            None => ColorInput::Constant([red, green, blue]),
        };
        let factors = [pbr.roughness_factor(), pbr.metallic_factor()].map(|factor| factor.clamp(0.0, 1.0));
        let numbers = match &lookups.metallic_roughness {
            Some(lookup) if Some(lookup.set) == lookups.set() => {
                [self.scalar(lookup, 1, factors[0]), self.scalar(lookup, 2, factors[1])]
            }
            Some(lookup) => {
                self.omit_set("metallic and roughness", pointer);
                let mean = self.mean(lookup, Encoding::Linear);
                [ScalarInput::Constant(factors[0] * mean[1]), ScalarInput::Constant(factors[1] * mean[2])]
            }
            None => factors.map(ScalarInput::Constant),
        };
        (base_color, numbers)
    }

    /// Disney's `specular` of the index of refraction; 0.5 where that is not representable.
    fn specular(&mut self, material: &gltf::Material<'_>, pointer: &str) -> f32 {
        let ior = material.ior().unwrap_or(DEFAULT_IOR);
        if ior == DEFAULT_IOR {
            return 0.5;
        }
        let share = (ior - 1.0) / (ior + 1.0);
        let specular = share * share / MOST_REFLECTANCE;
        if ior >= 1.0 && specular <= 1.0 {
            return specular;
        }
        self.omit(Omission::Visible, "an index of refraction outside of 1 to 1.79", "used 1.5", pointer);
        0.5
    }

    /// The glass of a material that transmits most light; none for any other material.
    fn glass(
        &mut self,
        material: &gltf::Material<'_>,
        color: ColorInput,
        roughness: ScalarInput,
        pointer: &str,
    ) -> Option<MaterialModel> {
        let transmission = material.transmission()?;
        let factor = transmission.transmission_factor();
        if factor == 0.0 {
            return None;
        }
        if factor < GLASS || transmission.transmission_texture().is_some() {
            self.omit(Omission::Visible, "transmission of a part of the light", "made it opaque", pointer);
            return None;
        }
        if factor < 1.0 {
            self.omit(Omission::Visible, "transmission of most of the light", "made it clear glass", pointer);
        }
        let (eta, white) = (material.ior().filter(|ior| *ior >= 1.0).unwrap_or(DEFAULT_IOR), [1.0; 3]);
        let specular_reflectance = ColorInput::Constant(white);
        let is_smooth = roughness == ScalarInput::Constant(0.0);
        // Without a thickness the surface is a thin sheet (KHR_materials_transmission).
        let volume = material.volume().filter(|volume| volume.thickness_factor() > 0.0);
        let Some(volume) = volume else {
            if !is_smooth {
                self.omit(Omission::Visible, "roughness of thin glass", "made it smooth", pointer);
            }
            return Some(MaterialModel::ThinDielectric { eta, specular_reflectance, specular_transmittance: color });
        };
        if volume.attenuation_color() != white {
            self.omit(Omission::Visible, "absorption inside glass", LEFT_OUT, pointer);
        }
        let microfacets = match roughness {
            ScalarInput::Constant(0.0) => None,
            ScalarInput::Constant(value) => {
                let alpha = ScalarInput::Constant(value * value);
                Some(Microfacets { distribution: Distribution::Ggx, alpha })
            }
            ScalarInput::Texture { .. } => {
                self.omit(Omission::Visible, "a texture of the roughness of glass", "made it smooth", pointer);
                None
            }
        };
        Some(MaterialModel::Dielectric { eta, specular_reflectance, specular_transmittance: color, microfacets })
    }

    /// The opacity of the alpha mode; absent if everything is opaque.
    fn opacity(&mut self, material: &gltf::Material<'_>, lookups: &Lookups<'_>, pointer: &str) -> Option<ScalarInput> {
        let factor = match material.pbr_specular_glossiness() {
            Some(specular) => specular.diffuse_factor()[3],
            None => material.pbr_metallic_roughness().base_color_factor()[3],
        };
        let cutoff = match material.alpha_mode() {
            AlphaMode::Opaque => return None,
            AlphaMode::Mask => Some(material.alpha_cutoff().unwrap_or(0.5)),
            AlphaMode::Blend => None,
        };
        let opacity = match &lookups.base_color {
            Some(lookup) => self.alpha(lookup, factor, cutoff),
            None => {
                let value = cutoff.map_or(factor, |cutoff| if factor >= cutoff { 1.0 } else { 0.0 });
                (value < 1.0).then_some(ScalarInput::Constant(value))
            }
        };
        if cutoff.is_some() && matches!(opacity, Some(ScalarInput::Texture { .. })) {
            let action = "cut out whole texels, and interpolated between them";
            self.omit(Omission::Slight, "masks that are cut out between texels", action, pointer);
        }
        opacity
    }

    /// The emission of a material. Emission of strength 1 is radiance 1, as Blender's exporter writes it.
    fn glow(&mut self, material: &gltf::Material<'_>, lookups: &Lookups<'_>, pointer: &str) -> Option<Glow> {
        let strength = material.emissive_strength().unwrap_or(1.0);
        let radiance = material.emissive_factor().map(|factor| factor * strength);
        if !radiance.iter().all(|value| (0.0..=1e9).contains(value)) {
            self.omit(Omission::Visible, "emission that is negative or above 1e9", LEFT_OUT, pointer);
            return None;
        }
        let two_sided = material.double_sided();
        let glow =
            |radiance: [f32; 3], map| radiance.iter().any(|v| *v > 0.0).then_some(Glow { radiance, map, two_sided });
        let Some(lookup) = lookups.emissive.as_ref().filter(|_| radiance != [0.0; 3]) else {
            return glow(radiance, None);
        };
        if Some(lookup.set) != lookups.set() {
            self.omit_set("emission", pointer);
            let mean = self.mean(lookup, Encoding::Srgb);
            return glow(std::array::from_fn(|channel| radiance[channel] * mean[channel]), None);
        }
        match self.color(lookup, [1.0; 3]) {
            ColorInput::Texture { texture, uv } => {
                // A texture that is black everywhere is no lamp.
                let is_lit = self.scene.textures[texture.0].texture.bytes().iter().any(|byte| *byte != 0);
                if is_lit { glow(radiance, Some(EmissionMap { texture, uv })) } else { None }
            }
            // A texture that cannot be read does not glow: what it lights is unknown.
            ColorInput::Constant(_) => None,
        }
    }

    fn omit_set(&mut self, what: &str, pointer: &str) {
        let feature = format!("a texture of {what} at another uv set than the material's first");
        self.omit(Omission::Visible, &feature, "used its mean", pointer);
    }

    /// Counts the parts of a material that the principled model does not have.
    fn report_omitted(&mut self, material: &gltf::Material<'_>, pointer: &str) {
        if material.normal_texture().is_some() {
            self.omit(Omission::Visible, "normal maps", LEFT_OUT, pointer);
        }
        if material.occlusion_texture().is_some() {
            self.omit(Omission::Slight, "occlusion maps, which path tracing does not need", LEFT_OUT, pointer);
        }
        if material.unlit() {
            let action = "let light fall on it as on any other";
            self.omit(
                Omission::Visible,
                "materials that show their colour without light (KHR_materials_unlit)",
                action,
                pointer,
            );
        }
        self.omit_extensions(material.extensions().into_iter().flat_map(|map| map.keys()), pointer);
    }

    /// Base colour, roughness and metallic of the material at `pointer`, whose textures are looked up as `diffuse` and
    /// `specular` state. `states_specular` is whether the file has a specular colour.
    fn specular_glossiness(
        &mut self,
        material: &PbrSpecularGlossiness<'_>,
        states_specular: bool,
        diffuse: Option<&Lookup<'_>>,
        specular: Option<&Lookup<'_>>,
        pointer: &str,
    ) -> (ColorInput, [ScalarInput; 2]) {
        let factors = SpecularGlossiness::of(material, states_specular);
        let constant = factors.converted();
        let numbers = [constant.roughness, constant.metallic].map(ScalarInput::Constant);
        let without_textures = (ColorInput::Constant(constant.base_color), numbers);
        self.omit(
            Omission::Slight,
            "specular-glossiness (KHR_materials_pbrSpecularGlossiness)",
            "converted it to base colour, roughness and metallic",
            pointer,
        );
        // Two textures are combined texel by texel, which needs one lookup.
        let same = |one: &Lookup<'_>, other: &Lookup<'_>| (one.set, one.uv) == (other.set, other.uv);
        if let (Some(one), Some(other)) = (diffuse, specular)
            && !same(one, other)
        {
            let feature = "a specular texture that is looked up elsewhere than the diffuse one";
            self.omit(Omission::Visible, feature, "looked it up where the diffuse one is", pointer);
        }
        let read = |reader: &mut Self, lookup: Option<&Lookup<'_>>| {
            let lookup = lookup?;
            let wrap = wraps(&lookup.texture)[0];
            reader.decoded(&lookup.texture.source(), Encoding::Srgb, wrap)
        };
        let (diffuse_texture, specular_texture) = (read(self, diffuse), read(self, specular));
        let Some(uv) = diffuse.or(specular).filter(|_| diffuse_texture.is_some() || specular_texture.is_some()) else {
            return without_textures;
        };
        let alpha = specular_texture.as_ref().and_then(|texture| texture.alpha.as_ref());
        let glossiness = alpha.and_then(|alpha| grey(alpha, |texel| texel[0]).ok());
        let from = SpecularTextures {
            diffuse: diffuse_texture.as_ref().map(|decoded| &decoded.color),
            specular: specular_texture.as_ref().map(|decoded| &decoded.color),
            glossiness: glossiness.as_ref(),
        };
        match textures(factors, from) {
            Ok([base, numbers]) => {
                let mut add = |name, texture| {
                    self.scene.add_texture(SourceTexture::computed(format!("{pointer} {name}"), texture))
                };
                let base = add("base colour", base);
                let numbers = add("roughness and metallic", numbers);
                let scalar = |channel| ScalarInput::Texture { texture: numbers, channel, uv: uv.uv };
                (ColorInput::Texture { texture: base, uv: uv.uv }, [scalar(1), scalar(2)])
            }
            Err(error) => {
                self.log.warn("bad_value", pointer, error.to_string(), "used the factors without textures");
                without_textures
            }
        }
    }
}
