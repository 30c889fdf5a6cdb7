//! The faults of the house, at least one of each kind found in the data: a table of where they are, and the code that
//! plants those of the JSON in a sound house. Faults of the models' files are the `Quirk`s of `models`.

use serde_json::{Value, json};

use super::materials;
use super::uids;

/// The location of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the house's JSON.
    Json {
        /// JSON pointer (RFC 6901).
        pointer: &'static str,
    },
    /// In a file.
    File {
        /// Path relative to the house's folder.
        path: &'static str,
    },
}

/// A fault planted on purpose.
#[derive(Clone, Copy, Debug)]
pub struct Fault {
    /// A short name.
    pub name: &'static str,
    /// Its location.
    pub place: Place,
    /// A description.
    pub what: &'static str,
}

const fn json_fault(name: &'static str, pointer: &'static str, what: &'static str) -> Fault {
    Fault { name, place: Place::Json { pointer }, what }
}

const fn file_fault(name: &'static str, path: &'static str, what: &'static str) -> Fault {
    Fault { name, place: Place::File { path }, what }
}

/// The folder of a model by the last two digits of its id.
macro_rules! in_model {
    ($number:literal, $file:literal) => {
        concat!("3D-FUTURE-model/cc0f0000-5a3b-4e00-8000-0000000000", $number, "/", $file)
    };
}

/// Every fault. All are in the third room, except the normals of two walls and the `local` of the outer walls.
pub const FAULTS: [Fault; 46] = [
    json_fault("furniture_uid_repeated", "/furniture/33", "the uid of /furniture/21 again, with another model"),
    json_fault("category_chinese", "/furniture/17/category", "a category in Chinese, of a valid piece"),
    json_fault("category_missing", "/furniture/23", "no category"),
    json_fault("category_null", "/furniture/25/category", "null as category"),
    json_fault("model_folder_missing", "/furniture/27/jid", "a valid piece whose model has no folder"),
    json_fault("valid_false", "/furniture/28/valid", "a piece that is not valid, whose model has no folder"),
    json_fault(
        "valid_missing",
        "/furniture/29",
        "no key that states whether the piece is valid; its model has no folder",
    ),
    json_fault("material_jid_local", "/material/7/jid", "'local' instead of a texture's id: only the colour counts"),
    json_fault("material_texture_object", "/material/9/texture", "an object with an empty value, not a text"),
    json_fault(
        "material_normal_texture",
        "/material/9/normaltexture",
        "the address of a normal map that does not exist",
    ),
    json_fault("material_use_color", "/material/10/useColor", "true: the colour counts, not the texture"),
    json_fault("material_folder_missing", "/material/11/jid", "the id of a texture that has no folder"),
    json_fault(
        "material_jid_empty",
        "/material/12/jid",
        "an empty text instead of a texture's id: only the colour counts",
    ),
    json_fault("material_uid_repeated", "/material/13", "the uid of /material/0 again, in magenta"),
    json_fault("mesh_normals_not_unit", "/mesh/2/normal", "positions moved by one where normals should be"),
    json_fault("mesh_normals_not_unit", "/mesh/8/normal", "positions moved by one where normals should be"),
    json_fault("mesh_normals_not_unit", "/mesh/56/normal", "positions moved by one where normals should be"),
    json_fault("mesh_zero_area", "/mesh/52/faces", "two more triangles, both without area"),
    json_fault("mesh_uv_null", "/mesh/54/uv", "two nulls among the numbers"),
    json_fault("mesh_aid_text", "/mesh/57/aid", "a text instead of a list"),
    json_fault("mesh_normals_short", "/mesh/58/normal", "one normal too few"),
    json_fault("mesh_material_dangles", "/mesh/70/material", "a uid that no material has"),
    json_fault("mesh_index_out_of_range", "/mesh/71/faces", "one index of a vertex that does not exist"),
    json_fault("mesh_without_faces", "/mesh/72/faces", "vertices, but no faces"),
    json_fault("mesh_type_empty", "/mesh/73/type", "an empty text instead of a type"),
    json_fault("room_without_ceiling", "/scene/room/2", "none of its meshes is a ceiling"),
    json_fault("scale_uneven", "/scene/room/2/children/24/scale", "1.3 wide, 0.9 deep"),
    json_fault("rotation_not_unit", "/scene/room/2/children/27/rot", "a quaternion of length 1.58"),
    json_fault("pieces_intersect", "/scene/room/2/children/32/pos", "the piece intersects that of children/31"),
    json_fault("scale_mirrors", "/scene/room/2/children/33/scale", "-1 along x: a picture that reads backwards"),
    json_fault("scale_tiny", "/scene/room/2/children/34/scale", "a millionth"),
    json_fault("child_without_record", "/scene/room/2/children/41/ref", "a uid that no piece of furniture has"),
    file_fault("model_not_listed", "3D-FUTURE-model/model_info.json", "no entry for the model whose id ends in 21"),
    file_fault("texture_alpha_zero", in_model!("14", "texture.png"), "no texel has opacity"),
    file_fault("texture_truncated", in_model!("15", "texture.png"), "the second half of the file is missing"),
    file_fault("model_shadow", in_model!("16", "raw_model.obj"), "a group Shadow_001, six metres wide and flat"),
    file_fault("mtl_misleads", in_model!("17", "model.mtl"), "Kd 0 0 0, Tf 1 1 1, Ke 1 1 1"),
    file_fault("obj_quads", in_model!("18", "raw_model.obj"), "faces of four corners"),
    file_fault("obj_blanks", in_model!("18", "raw_model.obj"), "two blanks after v and f"),
    file_fault("obj_three_uvs", in_model!("18", "raw_model.obj"), "three numbers after vt, lines that end in CRLF"),
    file_fault("obj_without_materials", in_model!("18", "raw_model.obj"), "neither mtllib nor usemtl"),
    file_fault("texture_grey_alpha", in_model!("19", "texture.png"), "grey with opacity, not RGBA"),
    file_fault("model_centimetres", in_model!("20", "raw_model.obj"), "a hundred times too large"),
    file_fault("texture_missing", in_model!("21", "texture.png"), "no such file"),
    file_fault("model_drop_shadow", in_model!("22", "raw_model.obj"), "a painted shadow in a group like any other"),
    file_fault(
        "model_flat",
        in_model!("23", "raw_model.obj"),
        "a mat without thickness, which lies in the floor exactly",
    ),
];

/// Plants the faults of the JSON, except those that the lists of pieces and rooms already contain.
pub(super) fn plant(house: &mut Value) {
    for fault in FAULTS {
        if let Place::Json { pointer } = fault.place {
            plant_one(house, fault.name, pointer);
        }
    }
}

fn plant_one(house: &mut Value, name: &str, pointer: &str) {
    let push = |house: &mut Value, key: &str, entry: Value| {
        house[key].as_array_mut().expect("the house has these lists").push(entry);
    };
    match name {
        // Faults that add or remove an entry.
        "furniture_uid_repeated" => {
            let mut again = house["furniture"][21].clone();
            again["jid"] = house["furniture"][20]["jid"].clone();
            push(house, "furniture", again);
        }
        "material_uid_repeated" => {
            let mut again = house["material"][0].clone();
            again["color"] = json!([255, 0, 255, 255]);
            again["jid"] = "local".into();
            push(house, "material", again);
        }
        "child_without_record" => {
            let children = house["scene"]["room"][2]["children"].as_array_mut().expect("rooms have children");
            let mut child = children[24].clone();
            child["ref"] = "9999/model".into();
            child["instanceid"] = "furniture/199".into();
            children.push(child);
        }
        "category_missing" => {
            let record = house.pointer_mut(pointer).and_then(Value::as_object_mut);
            record.expect("the table's pointers resolve in the house").remove("category");
        }
        // Faults that change a value in its place.
        _ => {
            let normals = pointer.strip_suffix("/normal").and_then(|mesh| house.pointer(mesh)).map(shifted_positions);
            let place = house.pointer_mut(pointer).expect("the table's pointers resolve in the house");
            spoil(place, name, normals);
        }
    }
}

/// A mesh's positions moved by one along z, which some walls of the data have as normals.
fn shifted_positions(mesh: &Value) -> Value {
    let moved = |(place, value): (usize, &Value)| {
        let value = value.as_f64().expect("positions are numbers");
        super::json_number::number(if place % 3 == 2 { value - 1.0 } else { value })
    };
    mesh["xyz"].as_array().into_iter().flatten().enumerate().map(moved).collect()
}

/// Replaces a value by a faulty one. `name` is the fault's.
fn spoil(value: &mut Value, name: &str, normals: Option<Value>) {
    let spoilt = match name {
        "category_chinese" => json!("抽屉柜"),
        "category_null" => Value::Null,
        "material_texture_object" => json!({"value": ""}),
        "material_normal_texture" => json!("https://example.invalid/normal.png"),
        "material_use_color" => json!(true),
        "material_folder_missing" => uids::texture(900).into(),
        "material_jid_empty" | "mesh_type_empty" => json!(""),
        "mesh_normals_not_unit" => normals.expect("the pointer names normals"),
        "mesh_aid_text" => json!("101000000005"),
        "mesh_material_dangles" => format!("{}9", materials::uid("cabinet")).into(),
        "mesh_without_faces" => json!([]),
        "scale_uneven" => json!([1.3, 1, 0.9]),
        "rotation_not_unit" => json!([0, 0.5, 0, 1.5]),
        "pieces_intersect" => json!([4.95, 0, 7.5]),
        "scale_mirrors" => json!([-1, 1, 1]),
        "scale_tiny" => json!([1e-6, 1e-6, 1e-6]),
        _ => return spoil_list(value, name),
    };
    *value = spoilt;
}

/// Changes some numbers of a list. Does nothing for faults that the sound house already contains.
fn spoil_list(value: &mut Value, name: &str) {
    let Some(list) = value.as_array_mut() else { return };
    match name {
        "mesh_uv_null" => list[..2].fill(Value::Null),
        "mesh_index_out_of_range" => list[5] = json!(999),
        // One triangle names a vertex twice, the other has two vertices at one position.
        "mesh_zero_area" => list.extend([0, 0, 1, 2, 3, 4].map(Value::from)),
        "mesh_normals_short" => list.truncate(list.len() - 3),
        _ => {}
    }
}

/// The text of `FAULTS.txt`.
pub(super) fn text() -> String {
    let mut text = String::from(
        "What is wrong with this house, on purpose: one of each kind that 3D-FRONT and 3D-FUTURE show.\n\
         Places are JSON pointers into the house's file, or files.\n\n",
    );
    for Fault { name, place, what } in FAULTS {
        let (Place::Json { pointer: place } | Place::File { path: place }) = place;
        text.push_str(&format!("{name}\n    {place}\n    {what}\n"));
    }
    text
}
