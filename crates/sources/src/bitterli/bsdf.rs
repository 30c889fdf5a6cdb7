//! BSDFs. Any nesting of wrappers (`twosided`, `mask`, `bumpmap`) around one model becomes one material.

use mateval_scene::material::{BumpMap, Material, MaterialModel, ScalarInput, StatedParameters};
use mateval_scene::reference::MaterialIndex;

use super::document::Element;
use super::parameters::{COLORS, Parameters};
use super::reader::Reader;
use mateval_scene::findings::shortened;

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
        let reflectance = if emits { 0.0 } else { 0.5 };
        let material = Material {
            name: owner.to_owned(),
            model: diffuse(reflectance),
            two_sided: false,
            opacity: None,
            bump: None,
        };
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
        self.scene.materials.push(read.material);
        self.stated.push(read.stated);
        MaterialIndex(self.scene.materials.len() - 1)
    }

    fn flat_material(&mut self, outer: &'a Element, owner: &str) -> ReadMaterial {
        let material =
            Material { name: owner.to_owned(), model: diffuse(0.5), two_sided: false, opacity: None, bump: None };
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
        let height = self.height(texture, &from.place);
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

    /// Reports an unknown model, which becomes diffuse grey.
    pub(super) fn unknown_model(&mut self, element: &Element, from: &mut Parameters<'a>) -> MaterialModel {
        let message = format!("line {}: the bsdf '{}' is not known", element.line, shortened(element.kind()));
        self.log.warn("unknown_plugin", &from.place, message, "used diffuse grey 0.5");
        from.take_all();
        diffuse(0.5)
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

fn diffuse(reflectance: f32) -> MaterialModel {
    let reflectance = mateval_scene::material::ColorInput::Constant([reflectance; 3]);
    MaterialModel::Diffuse { reflectance, alpha: None }
}

fn place_of(element: &Element, owner: &str) -> String {
    if element.attribute("id").is_some() { element.place() } else { format!("bsdf of '{}'", shortened(owner)) }
}
