//! Decides the class of material of a model, of its groups, and of architecture, from what the data states.

use mateval_scene::material_class::MaterialClass;

use super::class_table::class_named;

/// The class of a model: that of its `material` in `model_info.json`, or else a usual one of its super-category, which
/// is our choice.
pub(super) fn of_model(material: Option<&str>, super_category: &str) -> MaterialClass {
    material.and_then(class_named).unwrap_or(match super_category {
        "Sofa" | "Bed" | "Pier/Stool" => MaterialClass::Cloth,
        "Chair" | "Table" => MaterialClass::Wood,
        "Cabinet/Shelf/Desk" => MaterialClass::Board,
        _ => MaterialClass::Plastic,
    })
}

/// The class of a model's group: that of its name, or else the model's.
pub(super) fn of_group(name: &str, model: MaterialClass) -> MaterialClass {
    class_named(name).unwrap_or(model)
}

/// The class of a mesh of the architecture: that of its material's content type, or else a usual one of its type and
/// room, which is our choice: floors are of wood, or of tiles where they become wet; fittings are lacquered; all else
/// is painted.
pub(super) fn of_architecture(content: Option<&str>, kind: &str, room: &str) -> MaterialClass {
    const WET: [&str; 3] = ["bathroom", "kitchen", "balcony"];
    const FITTINGS: [&str; 9] =
        ["baseboard", "door", "window", "cabinet", "pocket", "hole", "furniture", "wainscot", "lightband"];
    let (kind, room) = (kind.to_lowercase(), room.to_lowercase());
    let is_any = |text: &str, words: &[&str]| words.iter().any(|word| text.contains(word));
    content.and_then(class_named).unwrap_or(match () {
        () if kind.contains("floor") && is_any(&room, &WET) => MaterialClass::Tile,
        () if kind.contains("floor") => MaterialClass::Wood,
        () if is_any(&kind, &FITTINGS) => MaterialClass::Lacquer,
        () => MaterialClass::Paint,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_data_states_counts_before_what_is_usual() {
        assert_eq!(of_model(Some("Metal"), "Sofa"), MaterialClass::Metal);
        assert_eq!(of_model(Some("Others"), "Sofa"), MaterialClass::Cloth);
        assert_eq!(of_model(None, "Lighting"), MaterialClass::Plastic);
        assert_eq!(of_group("glass_002", MaterialClass::Wood), MaterialClass::Glass);
        assert_eq!(of_group("solid_002", MaterialClass::Wood), MaterialClass::Wood);
        assert_eq!(of_architecture(Some("material carpet"), "Floor", "Bathroom"), MaterialClass::CoarseCloth);
        assert_eq!(of_architecture(Some("material"), "Floor", "MasterBathroom"), MaterialClass::Tile);
        assert_eq!(of_architecture(None, "Floor", "MasterBedroom"), MaterialClass::Wood);
        assert_eq!(of_architecture(None, "Baseboard", "MasterBedroom"), MaterialClass::Lacquer);
        assert_eq!(of_architecture(None, "WallInner", "MasterBedroom"), MaterialClass::Paint);
    }
}
