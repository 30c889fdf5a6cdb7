//! The materials of floors, walls and fittings, and their entries in the data's `material` list.

use serde_json::{Value, json};

use super::json_number::number;
use super::textures::ArchitectureTexture;
use super::uids;

/// A material of the architecture.
pub(super) struct ArchitectureMaterial {
    /// The name by which meshes refer to it.
    pub(super) name: &'static str,
    /// The name of its texture; without one it shows its colour.
    texture: Option<&'static str>,
    /// sRGB bytes.
    color: [u8; 3],
    /// The data's `contentType`: a constant word and the finish.
    content: [&'static str; 2],
}

const WHITE: [u8; 3] = [255; 3];

/// Every material. Those of the third room come last, and [`super::faults`] changes them by their position.
pub(super) const ALL: [ArchitectureMaterial; 13] = [
    pictured("floor", "planks", ["material", "flooring - hardwood"]),
    pictured("wallpaper", "wallpaper", ["material", "wallpaper"]),
    pictured("bedroom_wallpaper", "stripes", ["material", "wallpaper"]),
    pictured("panel", "panel", ["material", "wood"]),
    pictured("door", "door_wood", ["material", "wood"]),
    plain("ceiling", [246, 244, 238], ["material", "paint"]),
    plain("trim", [238, 236, 230], ["material", "paint"]),
    plain("outer_wall", [206, 198, 184], ["material", "paint"]),
    plain("light_band", [255, 244, 214], ["material", "emissive"]),
    pictured("library_floor", "tiles", ["material", "tiles"]),
    ArchitectureMaterial { color: [188, 202, 208], ..pictured("library_wall", "wallpaper", ["material", "paint"]) },
    ArchitectureMaterial { color: [150, 118, 92], ..pictured("cabinet", "door_wood", ["material", "wood"]) },
    plain("library_trim", [222, 216, 204], ["material", "paint"]),
];

const fn pictured(name: &'static str, texture: &'static str, content: [&'static str; 2]) -> ArchitectureMaterial {
    ArchitectureMaterial { name, texture: Some(texture), color: WHITE, content }
}

const fn plain(name: &'static str, color: [u8; 3], content: [&'static str; 2]) -> ArchitectureMaterial {
    ArchitectureMaterial { name, texture: None, color, content }
}

/// The id of a material, made of its position in the list and shaped as the data's.
pub(super) fn uid(name: &str) -> String {
    let place = ALL.iter().position(|material| material.name == name);
    format!("101000000003/{:05}", place.expect("meshes name materials of the list"))
}

/// The material's entry in the data's list.
pub(super) fn json(material: &ArchitectureMaterial, textures: &[ArchitectureTexture]) -> Value {
    let [r, g, b] = material.color;
    let mut entry = json!({
        "uid": uid(material.name), "aid": [], "jid": "local", "texture": "", "normaltexture": "",
        "color": [r, g, b, 255], "seamWidth": 0, "useColor": material.texture.is_none(), "contentType": material.content,
    });
    if let Some(texture) = material.texture {
        let texture = textures.iter().find(|known| known.name == texture).expect("materials name pictures of the list");
        entry["jid"] = uids::texture(texture.number).into();
        let matrix = texture.stored.uv_transform(texture.tile).map(number);
        entry["UVTransform"] = matrix.to_vec().into();
        entry["normalUVTransform"] = matrix.to_vec().into();
    }
    entry
}
