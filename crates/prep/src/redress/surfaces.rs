//! What the surfaces of a scene are: how they are redressed, where in the room they are, and the classes of their parts.
//!
//! 3D-FRONT states roles and classes. Of other sources names are all that is known, in which words are looked for.

use std::collections::BTreeSet;

use mateval_dataset::Role;
use mateval_dataset::dataset::WeakReason;
use mateval_dataset::material::{ColorInput, Material, MaterialClass, MaterialModel, ScalarInput};
use mateval_dataset::reference::{Emission, ReferenceScene, Surface};
use mateval_image::Texture;
use mateval_image::transfer::linear_from_srgb;
use mateval_sources::front3d::class_named;
use mateval_sources::source_scene::InstanceOrigin;
use palette::convert::FromColorUnclamped;
use palette::{LinSrgb, Oklch};

/// What happens to a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Treatment {
    /// It stays as it is; if it has a base colour, that is no secret.
    Kept,
    /// Its own picture in other colours.
    Recolored(WeakReason),
    /// One drawn colour: a lamp, whose picture is that of its light.
    Plain,
    /// A drawn material for each of its parts.
    Dressed,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    Floor,
    Wall,
    Ceiling,
    /// Furniture and other objects.
    Thing,
}

/// Words of things whose picture is their point.
const PICTURES: &[&str] = &[
    "painting",
    "paintings",
    "picture",
    "pictures",
    "poster",
    "posters",
    "art",
    "artwork",
    "mural",
    "photo",
    "book",
    "books",
    "magazine",
    "plant",
    "plants",
    "flower",
    "flowers",
    "leaf",
    "leaves",
    "screen",
];

const RUGS: &[&str] = &["rug", "rugs", "carpet", "mat", "kilim", "doormat"];

/// Words of things that are usually of a class.
const THINGS: &[(MaterialClass, &[&str])] = &[
    (
        MaterialClass::Cloth,
        &[
            "sofa", "couch", "bed", "mattress", "blanket", "curtain", "curtains", "drape", "towel", "armchair", "pouf",
            "ottoman",
        ],
    ),
    (MaterialClass::CoarseCloth, RUGS),
    (
        MaterialClass::Wood,
        &[
            "parquet", "plank", "planks", "table", "desk", "shelf", "shelves", "chair", "stool", "cabinet", "drawer",
            "door", "frame", "dresser", "wardrobe", "bench", "stair", "stairs",
        ],
    ),
    (MaterialClass::Metal, &["tap", "faucet", "handle", "hinge", "radiator"]),
    (MaterialClass::Tile, &["vase", "bowl", "cup", "plate", "toilet", "bath", "bathtub", "basin", "pot"]),
];

/// Metallic from which on, and roughness up to which a surface is a mirror.
const MIRROR: (f32, f32) = (0.9, 0.1);

/// Standard deviation of a rug's luminance over its mean above which it has a motif.
const MOTIF: f64 = 0.15;

/// The surfaces that shine for whoever looks at them, such as lamps. Ceilings that light a room of 3D-FRONT do not.
pub(super) fn lamps(scene: &ReferenceScene, origins: &[InstanceOrigin]) -> BTreeSet<usize> {
    let mut found: BTreeSet<usize> =
        (0..origins.len()).filter(|at| origins[*at].role == (Role::LightFixture {})).collect();
    for light in scene.lights.iter().filter(|light| light.camera_visible) {
        if let Emission::Area { surfaces, .. } = &light.emission {
            found.extend(surfaces.iter().map(|surface| surface.0));
        }
    }
    found
}

/// How a surface is redressed. `textures` are the scene's.
pub(super) fn treatment(
    surface: &Surface,
    material: &Material,
    textures: &[Texture],
    origin: &InstanceOrigin,
    is_lamp: bool,
) -> Treatment {
    let is_mirror =
        material.constant_appearance().is_some_and(|seen| seen.metallic >= MIRROR.0 && seen.roughness <= MIRROR.1);
    if !material.has_appearance() || is_mirror {
        return Treatment::Kept;
    }
    if is_lamp {
        return Treatment::Plain;
    }
    if matches!(material.opacity, Some(ScalarInput::Texture { .. })) {
        return Treatment::Recolored(WeakReason::CutOut);
    }
    let words = words_of(&[&surface.name, &material.name, origin.category.as_deref().unwrap_or_default()]);
    let is_any = |all: &[&str]| words.iter().any(|word| all.contains(&word.as_str()));
    let is_motif = || picture_of(material).is_some_and(|texture| contrast(&textures[texture]) > MOTIF);
    let is_rug = || is_any(RUGS) && place(&surface.name, origin) == Place::Thing;
    if is_any(PICTURES) || is_rug() && is_motif() {
        return Treatment::Recolored(WeakReason::Motif);
    }
    Treatment::Dressed
}

/// The texture of the base colour, if it has one.
fn picture_of(material: &Material) -> Option<usize> {
    let color = match &material.model {
        MaterialModel::Diffuse { reflectance, .. } => reflectance,
        MaterialModel::Plastic { diffuse_reflectance, .. } => diffuse_reflectance,
        MaterialModel::Principled { base_color, .. } => base_color,
        _ => return None,
    };
    match color {
        ColorInput::Texture { texture, .. } => Some(texture.0),
        ColorInput::Constant(_) => None,
    }
}

/// Standard deviation of the luminance over its mean.
fn contrast(texture: &Texture) -> f64 {
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for rgb in texture.linear_texels() {
        let luminance = f64::from(0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]);
        (count, sum, squares) = (count + 1.0, sum + luminance, squares + luminance * luminance);
    }
    let mean = sum / f64::max(count, 1.0);
    (squares / f64::max(count, 1.0) - mean * mean).max(0.0).sqrt() / mean.max(1e-6)
}

/// Where in the room a surface is.
pub(super) fn place(name: &str, origin: &InstanceOrigin) -> Place {
    let words = words_of(&[origin.role.architecture_kind().unwrap_or(name)]);
    let is = |word: &str| words.iter().any(|other| other.trim_end_matches('s') == word);
    match &origin.role {
        Role::Furniture {} | Role::LightFixture {} => Place::Thing,
        _ if is("lamp") || is("light") || is("clock") => Place::Thing,
        _ if is("floor") => Place::Floor,
        _ if is("ceiling") => Place::Ceiling,
        _ if is("wall") => Place::Wall,
        _ => Place::Thing,
    }
}

/// The class of a part: what the source states, or else what names say of it.
pub(super) fn class_of(origin: &InstanceOrigin, part: usize, name: &str, material: &Material) -> MaterialClass {
    if let Some(classes) = &origin.class_of_part {
        // Of a part that consists of several classes the first is as good as any.
        let stated = classes.get(part).copied().flatten().or_else(|| classes.iter().copied().flatten().next());
        let class = stated.unwrap_or(MaterialClass::Plastic);
        // A single hard class covers the bed with its bedding, and the bedding is most of what shows.
        let is_bed = origin.super_category.as_deref() == Some("Bed");
        let is_all_hard = classes.iter().flatten().all(|class| is_hard(*class));
        return if is_bed && is_all_hard && is_hard(class) { MaterialClass::Cloth } else { class };
    }
    let words = words_of(&[name, &material.name]);
    let usual = || THINGS.iter().find(|(_, things)| words.iter().any(|word| things.contains(&word.as_str())));
    let is_metallic = || {
        matches!(material.model, MaterialModel::Conductor { .. })
            || matches!(material.model, MaterialModel::Principled { metallic: ScalarInput::Constant(m), .. } if m >= 0.5)
    };
    class_named(&material.name)
        .or_else(|| is_metallic().then_some(MaterialClass::Metal))
        .or_else(|| class_named(name))
        .or_else(|| usual().map(|(class, _)| *class))
        .unwrap_or(match place(name, origin) {
            Place::Floor => MaterialClass::Wood,
            Place::Wall | Place::Ceiling => MaterialClass::Paint,
            Place::Thing => MaterialClass::Plastic,
        })
}

fn is_hard(class: MaterialClass) -> bool {
    use MaterialClass as Is;
    matches!(class, Is::Wood | Is::Board | Is::Stone | Is::Metal | Is::Wicker | Is::Tile)
}

/// Whether a part that is said to be of a hard class is green as leaves are: models state one class for a piece of
/// furniture with all that stands on it.
pub(super) fn is_leaf(class: MaterialClass, srgb: [f32; 3]) -> bool {
    let [red, green, blue] = srgb.map(|value| f64::from(linear_from_srgb(value)));
    let color = Oklch::from_color_unclamped(LinSrgb::new(red, green, blue));
    let hue = color.hue.into_positive_degrees();
    is_hard(class) && color.chroma > 0.033 && color.l < 0.65 && (100.0..165.0).contains(&hue)
}

/// The lower-case words of names, which are also divided where a capital follows a small letter.
fn words_of(names: &[&str]) -> Vec<String> {
    let mut words = vec![String::new()];
    for name in names {
        let mut was_small = false;
        for c in name.chars().chain([' ']) {
            if !c.is_alphabetic() || c.is_uppercase() && was_small {
                words.push(String::new());
            }
            was_small = c.is_lowercase();
            if let (true, Some(word)) = (c.is_alphabetic(), words.last_mut()) {
                word.extend(c.to_lowercase());
            }
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_words() {
        assert_eq!(
            words_of(&["wall_paper 2", "WallInner", "TV-Stand"]),
            ["wall", "paper", "wall", "inner", "tv", "stand"]
        );
    }

    /// The leaves of a plant on a stool and of one on a nightstand; green lacquer, wood and pale stone are none.
    #[test]
    fn leaves_are_no_wood() {
        let [leaf, dull] = [[60, 90, 30], [84, 94, 72]];
        let [wood, stone, shade] = [[150, 110, 70], [180, 190, 170], [90, 90, 88]];
        let is = |class, bytes: [u8; 3]| is_leaf(class, bytes.map(|byte| f32::from(byte) / 255.0));
        for class in [MaterialClass::Wood, MaterialClass::Stone] {
            assert!(is(class, leaf) && is(class, dull), "{class}");
            assert!(!is(class, wood) && !is(class, stone) && !is(class, shade), "{class}");
        }
        assert!(!is(MaterialClass::Lacquer, leaf) && !is(MaterialClass::Cloth, leaf));
    }

    /// A plywood bed had a blanket of wood.
    #[test]
    fn a_bed_is_of_cloth_if_the_model_states_a_hard_class() {
        let material = Material::new("m", MaterialModel::grey(0.5));
        let classes = |super_category: &str, stated: &[MaterialClass]| {
            let origin = InstanceOrigin {
                super_category: Some(super_category.to_owned()),
                class_of_part: Some(stated.iter().copied().map(Some).collect()),
                ..InstanceOrigin::default()
            };
            class_of(&origin, 0, "king-size-bed", &material)
        };
        assert_eq!(classes("Bed", &[MaterialClass::Wood]), MaterialClass::Cloth);
        assert_eq!(classes("Bed", &[MaterialClass::Leather]), MaterialClass::Leather);
        assert_eq!(classes("Bed", &[MaterialClass::Wood, MaterialClass::Cloth]), MaterialClass::Wood);
        assert_eq!(classes("Table", &[MaterialClass::Wood]), MaterialClass::Wood);
    }

    #[test]
    fn names_state_places_and_classes() {
        let origin = InstanceOrigin { role: Role::Other {}, ..InstanceOrigin::default() };
        let named = |name: &str, of: &str| {
            let material = Material::new(of, MaterialModel::grey(0.5));
            (place(name, &origin), class_of(&origin, 0, name, &material))
        };
        for (name, of, expected) in [
            ("floor", "planks", (Place::Floor, MaterialClass::Wood)),
            ("Floors_3", "m1", (Place::Floor, MaterialClass::Wood)),
            ("floor_lamp", "brass", (Place::Thing, MaterialClass::Metal)),
            ("wall_left", "m2", (Place::Wall, MaterialClass::Paint)),
            ("WallTiles", "m2", (Place::Wall, MaterialClass::Tile)),
            ("sofa", "m3", (Place::Thing, MaterialClass::Cloth)),
            ("sofa", "black leather", (Place::Thing, MaterialClass::Leather)),
            ("box", "red", (Place::Thing, MaterialClass::Plastic)),
        ] {
            assert_eq!(named(name, of), expected, "{name} of {of}");
        }
    }
}
