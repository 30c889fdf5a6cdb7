//! BSDFs. Any nesting of wrappers (`twosided`, `mask`, `bumpmap`) around one model becomes one material. The innermost
//! one scatters light, with Mitsuba's defaults for absent parameters and the indices of refraction that Mitsuba knows
//! by name.

use mateval_dataset::material::{
    BumpMap, ConductorIor, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
    StatedParameters,
};
use mateval_dataset::reference::MaterialIndex;
use mateval_files::untrusted::shortened;

use super::color::ColorUse;
use super::document::Element;
use super::reader::{COLORS, Parameters, Reader, number_within};

/// The deepest nesting of wrappers. A deeper one is taken for a cycle of references.
const MOST_WRAPPERS: usize = 16;

/// Nothing but the emission, which belongs to the shape.
const UNSTATED: StatedParameters =
    StatedParameters { base_color: false, roughness: false, metallic: false, emission: true };

/// Parameters that the base colour follows from, over all models. The empty name is that of a reference without a name.
const BASE_COLOR: [&str; 9] = [
    "",
    "reflectance",
    "diffuse_reflectance",
    "base_color",
    "specular_reflectance",
    "specular_transmittance",
    "eta",
    "k",
    "material",
];
/// Parameters that the roughness follows from.
const ROUGHNESS: [&str; 4] = ["alpha", "alpha_u", "alpha_v", "roughness"];

/// A material and which of its parameters the scene states.
struct ReadMaterial {
    material: Material,
    stated: StatedParameters,
    /// Whether only one BSDF is used of a wrapper that holds or weighs several.
    is_one_of_several: bool,
}

/// Mitsuba's lower bound of alpha.
const LEAST_ALPHA: f32 = 1e-4;

impl<'a> Reader<'a> {
    /// The material of the BSDF `element`, which is made at its first use. Without an id it is named after `owner`, the
    /// shape.
    pub(super) fn material(&mut self, element: &'a Element, owner: &str) -> MaterialIndex {
        if let Some(known) = self.materials.get(&element.serial) {
            return *known;
        }
        let material = self.flat_material(element, owner);
        let index = self.add_material(material);
        self.materials.insert(element.serial, index);
        index
    }

    /// The material of a shape without a BSDF. As in Mitsuba, it is diffuse grey, or black where the shape emits.
    pub(super) fn default_material(&mut self, owner: &str, emits: bool) -> MaterialIndex {
        let model = MaterialModel::grey(if emits { 0.0 } else { 0.5 });
        let material = Material { two_sided: false, ..Material::new(owner, model) };
        // A lamp without a BSDF reflects nothing.
        let stated = if emits { StatedParameters::default() } else { UNSTATED };
        self.add_material(ReadMaterial { material, stated, is_one_of_several: false })
    }

    /// A copy of a material whose stated parameters are those that `states` returns for the original's.
    pub(super) fn stating_less(
        &mut self,
        MaterialIndex(of): MaterialIndex,
        states: impl Fn(StatedParameters) -> StatedParameters,
    ) -> MaterialIndex {
        let material = self.scene.materials[of].clone();
        let stated = states(self.stated[of]);
        self.add_material(ReadMaterial { material, stated, is_one_of_several: false })
    }

    fn add_material(&mut self, read: ReadMaterial) -> MaterialIndex {
        self.stated.push(read.stated);
        self.scene.add_material(read.material)
    }

    fn flat_material(&mut self, outer: &'a Element, owner: &str) -> ReadMaterial {
        let material = Material { two_sided: false, ..Material::new(owner, MaterialModel::grey(0.5)) };
        let mut read = ReadMaterial { material, stated: UNSTATED, is_one_of_several: false };
        let mut named = false;
        let mut element = outer;
        for _ in 0..MOST_WRAPPERS {
            // The outermost id names the material.
            if let (Some(id), false) = (element.attribute("id"), named) {
                (read.material.name, named) = (id.to_owned(), true);
            }
            // One layer is read, then the BSDF within it.
            let place =
                if named { format!("bsdf '{}'", shortened(&read.material.name)) } else { place_of(element, owner) };
            let mut from = self.parameters(element, place);
            let inner = self.unwrap_layer(element, &mut from, &mut read);
            from.finish(&mut self.log);
            match inner {
                Some(inner) => element = inner,
                None => {
                    read.stated.base_color &= !read.is_one_of_several;
                    return read;
                }
            }
        }
        let message = format!("more than {MOST_WRAPPERS} nested BSDFs");
        self.log.warn("nested_too_deep", &place_of(outer, owner), message, "used diffuse grey 0.5");
        read
    }

    /// Reads one layer into `material`. Returns the BSDF within it, or none for the innermost.
    fn unwrap_layer(
        &mut self,
        element: &'a Element,
        from: &mut Parameters<'a>,
        read: &mut ReadMaterial,
    ) -> Option<&'a Element> {
        let material = &mut read.material;
        match element.kind() {
            "twosided" => material.two_sided = true,
            "mask" => {
                let opacity = self.opacity(from, "opacity");
                self.set_opacity(material, opacity, &from.place);
            }
            "bumpmap" | "bump" => self.bump(from, material),
            "null" => {
                self.set_opacity(material, Some(ScalarInput::Constant(0.0)), &from.place);
                read.stated = StatedParameters::default();
                return None;
            }
            "normalmap" | "blendbsdf" | "mixturebsdf" | "coating" | "roughcoating" => {
                // The base colour of a blend is that of neither.
                read.is_one_of_several |= matches!(element.kind(), "blendbsdf" | "mixturebsdf");
                self.report_unsupported_wrapper(element, from);
            }
            kind => {
                let names = base_color_of(kind);
                let is_default = !names.is_empty() && !names.iter().any(|name| from.contains(name));
                material.model = self.model(element, from);
                read.stated = stated(kind);
                // What could not be read states nothing.
                read.stated.base_color &= !from.is_replaced(&BASE_COLOR);
                read.stated.roughness &= !from.is_replaced(&ROUGHNESS);
                read.stated.metallic &= !from.is_replaced(&["metallic"]);
                // Nor does a colour of an unknown name, which may be misspelt.
                let is_misspelt = from.has_untaken(&COLORS) || (is_default && from.has_untaken(&["float", "string"]));
                read.stated.base_color &= !is_misspelt;
                return None;
            }
        }
        let (child, count) = self.only_child(from);
        read.is_one_of_several |= count > 1;
        child
    }

    fn set_opacity(&mut self, material: &mut Material, opacity: Option<ScalarInput>, place: &str) {
        if material.opacity.is_some() {
            self.log.warn("unsupported", place, "a mask within a mask", "used the outer one");
        } else {
            material.opacity = opacity;
        }
    }

    /// Reads a bump map. Mitsuba displaces the surface by `scale` times the texture's luminance, in scene units.
    fn bump(&mut self, from: &mut Parameters<'a>, material: &mut Material) {
        let scale = from.number("scale", &mut self.log).unwrap_or(1.0) as f32;
        let textures = from.objects("texture");
        let Some(texture) = textures.first() else {
            self.log.warn("missing_child", &from.place, "a bumpmap without texture", "left the bumps out");
            return;
        };
        let height = self.scalar_texture(texture, &from.place, false);
        if material.bump.is_some() {
            self.log.warn("unsupported", &from.place, "a bumpmap within a bumpmap", "used the outer one");
        } else {
            material.bump = height.map(|height| BumpMap { height, scale });
        }
    }

    fn report_unsupported_wrapper(&mut self, element: &Element, from: &mut Parameters<'a>) {
        let message = format!("line {}: the bsdf '{}' is not supported", element.line, element.kind());
        self.log.warn("unsupported", &from.place, message, "used the first bsdf in it");
        from.objects("texture");
        from.ignore(&["weight", "weights", "sigma_a", "thickness", "alpha", "int_ior", "ext_ior", "distribution"]);
    }

    /// The first BSDF in a wrapper, and their count.
    fn only_child(&mut self, from: &mut Parameters<'a>) -> (Option<&'a Element>, usize) {
        let children = from.objects("bsdf");
        match children.len() {
            0 => self.log.warn(
                "missing_child",
                &from.place,
                "expected a bsdf inside the element, found none",
                "used diffuse grey 0.5",
            ),
            1 => {}
            more => {
                let message = format!("{more} bsdfs inside the element");
                self.log.warn("unsupported", &from.place, message, "used the first one everywhere");
            }
        }
        (children.first().copied(), children.len())
    }

    /// The model of `element`, which is not a wrapper.
    fn model(&mut self, element: &'a Element, from: &mut Parameters<'a>) -> MaterialModel {
        match element.kind() {
            "diffuse" => MaterialModel::Diffuse { reflectance: self.color(from, "reflectance", 0.5), alpha: None },
            "roughdiffuse" => {
                from.ignore(&["use_fast_approx"]);
                let alpha = Some(self.scalar(from, "alpha", 0.2));
                MaterialModel::Diffuse { reflectance: self.color(from, "reflectance", 0.5), alpha }
            }
            kind @ ("conductor" | "roughconductor") => MaterialModel::Conductor {
                ior: self.conductor_ior(from),
                specular_reflectance: self.color(from, "specular_reflectance", 1.0),
                microfacets: (kind == "roughconductor").then(|| self.microfacets(from)),
            },
            kind @ ("plastic" | "roughplastic") => MaterialModel::Plastic {
                eta: self.relative_index(from, "polypropylene"),
                nonlinear: from.boolean("nonlinear", false, &mut self.log),
                diffuse_reflectance: self.color(from, "diffuse_reflectance", 0.5),
                specular_reflectance: self.color(from, "specular_reflectance", 1.0),
                microfacets: (kind == "roughplastic").then(|| self.microfacets(from)),
            },
            kind @ ("dielectric" | "roughdielectric") => MaterialModel::Dielectric {
                eta: self.relative_index(from, "bk7"),
                specular_reflectance: self.color(from, "specular_reflectance", 1.0),
                specular_transmittance: self.color(from, "specular_transmittance", 1.0),
                microfacets: (kind == "roughdielectric").then(|| self.microfacets(from)),
            },
            "thindielectric" => MaterialModel::ThinDielectric {
                eta: self.relative_index(from, "bk7"),
                specular_reflectance: self.color(from, "specular_reflectance", 1.0),
                specular_transmittance: self.color(from, "specular_transmittance", 1.0),
            },
            "principled" => self.principled(from),
            _ => {
                let message = format!("line {}: the bsdf '{}' is not known", element.line, shortened(element.kind()));
                self.log.warn("unknown_plugin", &from.place, message, "used diffuse grey 0.5");
                from.take_all();
                MaterialModel::grey(0.5)
            }
        }
    }

    /// The default is copper in Mitsuba 0.x and a perfect mirror in Mitsuba 3. `ext_eta` divides eta and k.
    fn conductor_ior(&mut self, from: &mut Parameters<'a>) -> ConductorIor {
        // Given numbers take precedence over the name of a material.
        let outside = self.index(from, "ext_eta").unwrap_or(1.0) as f32;
        let mut constant = |name: &str| {
            let element = from.take(&[name])?;
            let constant = self.constant(element, &from.place, ColorUse::Index);
            if constant.is_none() {
                from.mark_replaced(name);
            }
            constant
        };
        let (eta, k) = (constant("eta"), constant("k"));
        let material = from.string("material");
        let ior = match (eta, k) {
            (None, None) => self.named_conductor(from, material),
            (eta, k) => ConductorIor::EtaK { eta: eta.unwrap_or([0.0; 3]), k: k.unwrap_or([1.0; 3]) },
        };
        match ior {
            ConductorIor::EtaK { eta, k } => {
                ConductorIor::EtaK { eta: eta.map(|v| v / outside), k: k.map(|v| v / outside) }
            }
            mirror => mirror,
        }
    }

    fn named_conductor(&mut self, from: &mut Parameters<'a>, name: Option<&str>) -> ConductorIor {
        let name = name.unwrap_or(if self.major_version == 0 { "Cu" } else { "none" });
        conductor(name).unwrap_or_else(|| {
            let message = format!("the conductor '{}' is not known", shortened(name));
            self.log.warn("unknown_material", &from.place, message, "used a perfect mirror");
            from.mark_replaced("material");
            ConductorIor::PerfectMirror
        })
    }

    /// The index of refraction inside divided by that outside.
    fn relative_index(&mut self, from: &mut Parameters<'a>, inside: &str) -> f32 {
        let named = |name| dielectric(name).unwrap_or(1.0);
        let inside = self.index(from, "int_ior").unwrap_or_else(|| named(inside));
        let outside = self.index(from, "ext_ior").unwrap_or_else(|| named("air"));
        (inside / outside) as f32
    }

    /// Takes an index of refraction, given as a number or a name.
    fn index(&mut self, from: &mut Parameters<'a>, name: &str) -> Option<f64> {
        let index = |text: &str| dielectric(text).map_or_else(|| number_within(text, 0.01, 100.0), Ok);
        from.value(name, index, &mut self.log)
    }

    fn microfacets(&mut self, from: &mut Parameters<'a>) -> Microfacets {
        from.ignore(&["sample_visible"]);
        let distribution = match from.string("distribution").unwrap_or("beckmann") {
            "ggx" => Distribution::Ggx,
            "beckmann" => Distribution::Beckmann,
            other => {
                let message = format!("the distribution '{}' is not supported", shortened(other));
                self.log.warn("unsupported", &from.place, message, "used beckmann");
                Distribution::Beckmann
            }
        };
        let alpha = match self.anisotropic_alpha(from) {
            Some(alpha) => ScalarInput::Constant(alpha),
            None => self.scalar(from, "alpha", 0.1),
        };
        let alpha = match alpha {
            ScalarInput::Constant(alpha) => ScalarInput::Constant(alpha.max(LEAST_ALPHA)),
            texture => texture,
        };
        Microfacets { distribution, alpha }
    }

    /// The geometric mean of `alpha_u` and `alpha_v`, where both are given.
    fn anisotropic_alpha(&mut self, from: &mut Parameters<'a>) -> Option<f32> {
        let mut along = |name| from.number_within(name, 0.0, 1.0, &mut self.log);
        let (u, v) = (along("alpha_u"), along("alpha_v"));
        let (u, v) = (u.or(v)?, v.or(u)?);
        if u != v {
            let message = format!("alpha_u {u} and alpha_v {v} differ");
            self.log.warn("unsupported", &from.place, message, "used their geometric mean");
        }
        Some((u * v).sqrt() as f32)
    }

    fn principled(&mut self, from: &mut Parameters<'a>) -> MaterialModel {
        let specular = match from.number_within("eta", 1.0, 100.0, &mut self.log) {
            // Disney's definition: F0 = 0.08 specular.
            Some(eta) => ((eta - 1.0) / (eta + 1.0)).powi(2) / 0.08,
            None => from.number_within("specular", 0.0, 1.0, &mut self.log).unwrap_or(0.5),
        };
        let extras = [
            "anisotropic",
            "spec_tint",
            "sheen",
            "sheen_tint",
            "flatness",
            "clearcoat",
            "clearcoat_gloss",
            "spec_trans",
        ];
        for name in extras {
            let value = self.scalar(from, name, 0.0);
            if value != ScalarInput::Constant(0.0) {
                let message = format!("'{name}' of principled is not supported");
                self.log.warn("unsupported", &from.place, message, "used 0");
            }
        }
        from.ignore(&["main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate"]);
        MaterialModel::Principled {
            base_color: self.color(from, "base_color", 0.5),
            roughness: self.scalar(from, "roughness", 0.5),
            metallic: self.scalar(from, "metallic", 0.0),
            specular: specular as f32,
            flavour: PrincipledFlavour::Mitsuba,
        }
    }
}

/// The parameters that each suffice to state a model's base colour; empty for glass.
fn base_color_of(kind: &str) -> &'static [&'static str] {
    match kind {
        "diffuse" | "roughdiffuse" => &["reflectance"],
        "plastic" | "roughplastic" => &["diffuse_reflectance"],
        "principled" => &["base_color"],
        "conductor" | "roughconductor" => &["material", "eta", "k"],
        _ => &[],
    }
}

/// Which parameters a model states. Mitsuba documents a default for every parameter of a kind, so that naming the kind
/// states them; a kind that is not known states nothing.
fn stated(kind: &str) -> StatedParameters {
    match kind {
        "diffuse" | "roughdiffuse" | "plastic" | "roughplastic" | "conductor" | "roughconductor" | "dielectric"
        | "roughdielectric" | "thindielectric" | "principled" => StatedParameters::default(),
        _ => UNSTATED,
    }
}

fn place_of(element: &Element, owner: &str) -> String {
    if element.attribute("id").is_some() { element.place() } else { format!("bsdf of '{}'", shortened(owner)) }
}

/// Dielectrics at 589.3 nm (the names of Mitsuba's documentation; values as there, from the usual reference tables).
const DIELECTRICS: [(&str, f64); 24] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
    ("glass", 1.5),
];

/// The index of refraction of the dielectric `name`; absent if it is unknown.
fn dielectric(name: &str) -> Option<f64> {
    let name = name.trim().to_ascii_lowercase();
    DIELECTRICS.iter().find(|(known, _)| *known == name).map(|(_, index)| *index)
}

/// Metals: linear Rec. 709 eta and k, which Mitsuba 3.9.1 integrates in its RGB mode from the measured spectra of its
/// `data/ior` (Palik's handbook and the SOPRA database). Bitterli's own exports carry the same values to four digits.
const METALS: [(&str, [f32; 3], [f32; 3]); 16] = [
    ("ag", [0.155276, 0.116728, 0.138388], [4.82835, 3.12222, 2.1469]),
    ("al", [1.6575, 0.880405, 0.521244], [9.22381, 6.2695, 4.837]),
    ("au", [0.143036, 0.375307, 1.44205], [3.983, 2.38556, 1.60336]),
    ("be", [4.18501, 3.18503, 2.78406], [3.83547, 3.01012, 2.86899]),
    ("cr", [4.36967, 2.91651, 1.6549], [5.20655, 4.23131, 3.7547]),
    ("cu", [0.201005, 0.92375, 1.10222], [3.91326, 2.45305, 2.14209]),
    ("hg", [2.39894, 1.44003, 0.90957], [6.32759, 4.37192, 3.42176]),
    ("ir", [3.0863, 2.08219, 1.61791], [5.59215, 4.06709, 3.26731]),
    ("li", [0.265791, 0.195618, 0.220949], [3.54015, 2.31112, 1.66861]),
    ("mo", [4.48397, 3.52513, 2.77631], [4.11144, 3.42083, 3.15061]),
    ("nb", [3.42007, 2.79009, 2.39563], [3.44139, 2.73767, 2.57975]),
    ("ni_palik", [2.3673, 1.66337, 1.46708], [4.49881, 3.05015, 2.34544]),
    ("rh", [2.58579, 1.86022, 1.55426], [6.78226, 4.70299, 3.97607]),
    ("ta", [2.06272, 2.39294, 2.62793], [2.40836, 1.74149, 1.94703]),
    ("tin", [1.64845, 1.15052, 1.37982], [3.36833, 1.9435, 1.10207]),
    ("w", [4.37082, 3.30025, 2.99841], [3.50064, 2.60487, 2.27323]),
];

/// The conductor `name`, where `none` names a perfect mirror. None where the name is unknown.
fn conductor(name: &str) -> Option<ConductorIor> {
    let name = name.trim().to_ascii_lowercase();
    if name == "none" {
        return Some(ConductorIor::PerfectMirror);
    }
    let (_, eta, k) = METALS.iter().find(|(known, ..)| *known == name)?;
    Some(ConductorIor::EtaK { eta: *eta, k: *k })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mitsuba 3.9.1 prints 1.48959 for plastic (polypropylene over air) and 1.50418 for glass (bk7 over air).
    #[test]
    fn ratios_as_mitsuba_prints_them() {
        let ratio = |inside, outside| dielectric(inside).unwrap() / dielectric(outside).unwrap();
        assert!((ratio("polypropylene", "air") - 1.48959).abs() < 1e-5);
        assert!((ratio("BK7", "air") - 1.50418).abs() < 1e-5);
        assert!(dielectric("unobtainium").is_none());
    }

    /// Gold is yellow: ((eta-1)^2 + k^2) / ((eta+1)^2 + k^2), computed by hand. Silver is grey.
    #[test]
    fn metals_have_their_colours() {
        let gold = conductor("Au").unwrap().reflectance_at_normal();
        for (found, expected) in gold.into_iter().zip([0.9667, 0.8020, 0.3241]) {
            assert!((found - expected).abs() < 1e-3, "{gold:?}");
        }
        assert!(conductor("Ag").unwrap().reflectance_at_normal()[2] > 0.85);
        assert!(conductor("unobtainium").is_none());
    }
}
