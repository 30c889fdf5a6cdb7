//! The faults, at least one of each kind found in the data: a table of where they are, and the code that plants them in
//! the JSON and in the files of sound rooms.

use std::path::Path;

use mateval_image::Picture;
use mateval_image::png_io::{write_grey_alpha_bytes, write_rgba_bytes};
use mateval_sample::house::files::number;
use mateval_sample::house::layout::House;
use mateval_sample::house::materials::swatch_picture;
use serde_json::{Value, json};

/// The location of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    Json {
        /// JSON pointer (RFC 6901).
        pointer: &'static str,
    },
    File {
        /// Path relative to the house's folder.
        path: &'static str,
    },
}

#[derive(Clone, Copy, Debug)]
pub struct Fault {
    pub name: &'static str,
    pub place: Place,
    pub description: &'static str,
}

const fn in_json(name: &'static str, pointer: &'static str, description: &'static str) -> Fault {
    Fault { name, place: Place::Json { pointer }, description }
}

const fn in_file(name: &'static str, path: &'static str, description: &'static str) -> Fault {
    Fault { name, place: Place::File { path }, description }
}

/// The folder of a model by the last two digits of its id.
macro_rules! in_model {
    ($number:literal, $file:literal) => {
        concat!("3D-FUTURE-model/cc0f0000-5a3b-4e00-8000-0000000000", $number, "/", $file)
    };
}

/// Every fault. All are in the third room, except the normals of two walls and the `local` of the outer walls.
pub const FAULTS: [Fault; 46] = [
    in_json("furniture_uid_repeated", "/furniture/33", "the uid of /furniture/21 again, with another model"),
    in_json("category_chinese", "/furniture/17/category", "a category in Chinese, of a valid piece"),
    in_json("category_missing", "/furniture/23", "no category"),
    in_json("category_null", "/furniture/25/category", "null as category"),
    in_json("model_folder_missing", "/furniture/27/jid", "a valid piece whose model has no folder"),
    in_json("valid_false", "/furniture/28/valid", "a piece that is not valid, whose model has no folder"),
    in_json("valid_missing", "/furniture/29", "no key that states whether the piece is valid; its model has no folder"),
    in_json("material_jid_local", "/material/7/jid", "'local' instead of a texture's id: only the colour counts"),
    in_json("material_texture_object", "/material/9/texture", "an object with an empty value, not a text"),
    in_json("material_normal_texture", "/material/9/normaltexture", "the address of a normal map that does not exist"),
    in_json("material_use_color", "/material/10/useColor", "true: the colour counts, not the texture"),
    in_json("material_folder_missing", "/material/11/jid", "the id of a texture that has no folder"),
    in_json(
        "material_jid_empty",
        "/material/12/jid",
        "an empty text instead of a texture's id: only the colour counts",
    ),
    in_json("material_uid_repeated", "/material/13", "the uid of /material/0 again, in magenta"),
    in_json("mesh_normals_not_unit", "/mesh/2/normal", "positions moved by one where normals should be"),
    in_json("mesh_normals_not_unit", "/mesh/8/normal", "positions moved by one where normals should be"),
    in_json("mesh_normals_not_unit", "/mesh/56/normal", "positions moved by one where normals should be"),
    in_json("mesh_zero_area", "/mesh/52/faces", "two more triangles, both without area"),
    in_json("mesh_uv_null", "/mesh/54/uv", "two nulls among the numbers"),
    in_json("mesh_aid_text", "/mesh/57/aid", "a text instead of a list"),
    in_json("mesh_normals_short", "/mesh/58/normal", "one normal too few"),
    in_json("mesh_material_dangles", "/mesh/70/material", "a uid that no material has"),
    in_json("mesh_index_out_of_range", "/mesh/71/faces", "one index of a vertex that does not exist"),
    in_json("mesh_without_faces", "/mesh/72/faces", "vertices, but no faces"),
    in_json("mesh_type_empty", "/mesh/73/type", "an empty text instead of a type"),
    in_json("room_without_ceiling", "/scene/room/2", "none of its meshes is a ceiling"),
    in_json("scale_uneven", "/scene/room/2/children/24/scale", "1.3 wide, 0.9 deep"),
    in_json("rotation_not_unit", "/scene/room/2/children/27/rot", "a quaternion of length 1.58"),
    in_json("pieces_intersect", "/scene/room/2/children/32/pos", "the piece intersects that of children/31"),
    in_json("scale_mirrors", "/scene/room/2/children/33/scale", "-1 along x: a picture that reads backwards"),
    in_json("scale_tiny", "/scene/room/2/children/34/scale", "a millionth"),
    in_json("child_without_record", "/scene/room/2/children/41/ref", "a uid that no piece of furniture has"),
    in_file("model_not_listed", "3D-FUTURE-model/model_info.json", "no entry for the model whose id ends in 21"),
    in_file("texture_alpha_zero", in_model!("14", "texture.png"), "no texel has opacity"),
    in_file("texture_truncated", in_model!("15", "texture.png"), "the second half of the file is missing"),
    in_file("model_shadow", in_model!("16", "raw_model.obj"), "a group Shadow_001, six metres wide and flat"),
    in_file("mtl_misleads", in_model!("17", "model.mtl"), "Kd 0 0 0, Tf 1 1 1, Ke 1 1 1"),
    in_file("obj_quads", in_model!("18", "raw_model.obj"), "faces of four corners"),
    in_file("obj_blanks", in_model!("18", "raw_model.obj"), "two blanks after v and f"),
    in_file("obj_three_uvs", in_model!("18", "raw_model.obj"), "three numbers after vt, lines that end in CRLF"),
    in_file("obj_without_materials", in_model!("18", "raw_model.obj"), "neither mtllib nor usemtl"),
    in_file("texture_grey_alpha", in_model!("19", "texture.png"), "grey with opacity, not RGBA"),
    in_file("model_centimetres", in_model!("20", "raw_model.obj"), "a hundred times too large"),
    in_file("texture_missing", in_model!("21", "texture.png"), "no such file"),
    in_file("model_drop_shadow", in_model!("22", "raw_model.obj"), "a painted shadow in a group like any other"),
    in_file("model_flat", in_model!("23", "raw_model.obj"), "a mat without thickness, which lies in the floor exactly"),
];

/// Plants the faults of the JSON.
pub(super) fn plant(house: &mut Value) {
    for fault in FAULTS {
        if let Place::Json { pointer } = fault.place {
            plant_in_json(house, fault.name, pointer);
        }
    }
}

fn plant_in_json(house: &mut Value, name: &str, pointer: &str) {
    fn list<'a>(house: &'a mut Value, pointer: &str) -> &'a mut Vec<Value> {
        house.pointer_mut(pointer).unwrap().as_array_mut().unwrap()
    }
    let remove = |house: &mut Value, key: &str| {
        house.pointer_mut(pointer).unwrap().as_object_mut().unwrap().remove(key).unwrap();
    };
    let before = house.pointer(pointer).cloned();
    match name {
        "furniture_uid_repeated" => {
            let mut again = house["furniture"][21].clone();
            again["jid"] = house["furniture"][20]["jid"].clone();
            list(house, "/furniture").push(again);
        }
        "material_uid_repeated" => {
            let mut again = house["material"][0].clone();
            again["color"] = json!([255, 0, 255, 255]);
            again["jid"] = "local".into();
            list(house, "/material").push(again);
        }
        "child_without_record" => {
            let children = list(house, "/scene/room/2/children");
            let mut child = children[24].clone();
            child["ref"] = "9999/model".into();
            child["instanceid"] = "furniture/199".into();
            children.push(child);
        }
        "category_missing" => remove(house, "category"),
        "valid_missing" => remove(house, "valid"),
        // Its model is not in the library in any case.
        "model_folder_missing" => house["furniture"][27]["valid"] = true.into(),
        "mesh_normals_not_unit" => {
            let mesh = &house.pointer(pointer.strip_suffix("/normal").unwrap()).unwrap();
            let moved = shifted_positions(mesh);
            *list(house, pointer) = moved;
        }
        "mesh_normals_short" => {
            let normals = list(house, pointer);
            normals.truncate(normals.len() - 3);
        }
        "mesh_uv_null" => list(house, pointer)[..2].fill(Value::Null),
        "mesh_index_out_of_range" => list(house, pointer)[5] = json!(999),
        // One triangle names a vertex twice, the other has two vertices at one position.
        "mesh_zero_area" => list(house, pointer).extend([0, 0, 1, 2, 3, 4].map(Value::from)),
        // Sound houses have these too.
        "valid_false" | "material_jid_local" | "room_without_ceiling" => return,
        _ => *house.pointer_mut(pointer).unwrap() = faulty_value(name),
    }
    assert!(name == "model_folder_missing" || house.pointer(pointer) != before.as_ref(), "{name} changes nothing");
}

/// A mesh's positions moved by one along z, which some walls of the data have as normals.
fn shifted_positions(mesh: &Value) -> Vec<Value> {
    let moved = |(place, value): (usize, &Value)| {
        let value = value.as_f64().unwrap();
        number(if place % 3 == 2 { value - 1.0 } else { value })
    };
    mesh["xyz"].as_array().unwrap().iter().enumerate().map(moved).collect()
}

/// The value that replaces a sound one.
fn faulty_value(name: &str) -> Value {
    match name {
        "category_chinese" => json!("抽屉柜"),
        "category_null" => Value::Null,
        "material_texture_object" => json!({"value": ""}),
        "material_normal_texture" => json!("https://example.invalid/normal.png"),
        "material_use_color" => json!(true),
        "material_folder_missing" => json!("cc0a0000-5a3b-4e00-8000-000000000900"),
        "material_jid_empty" | "mesh_type_empty" => json!(""),
        "mesh_aid_text" => json!("101000000005"),
        "mesh_material_dangles" => json!("101000000003/000119"),
        "mesh_without_faces" => json!([]),
        "scale_uneven" => json!([1.3, 1, 0.9]),
        "rotation_not_unit" => json!([0, 0.5, 0, 1.5]),
        "pieces_intersect" => json!([4.95, 0, 7.5]),
        "scale_mirrors" => json!([-1, 1, 1]),
        "scale_tiny" => json!([1e-6, 1e-6, 1e-6]),
        _ => panic!("no code plants the fault {name}"),
    }
}

/// Damages the files of models below `root`, which are sound. Textures that were not written stay missing.
pub(super) fn damage_files(house: &House, root: &Path) {
    for fault in FAULTS {
        let Place::File { path } = fault.place else { continue };
        let path = root.join(path);
        let texture = path.with_file_name("texture.png");
        match fault.name {
            "model_drop_shadow" | "texture_alpha_zero" | "texture_grey_alpha" | "texture_missing"
            | "texture_truncated" => {
                if texture.exists() {
                    damage_texture(house, fault.name, &texture);
                }
            }
            _ => {
                let text = std::fs::read_to_string(&path).unwrap();
                let damaged = damaged_text(fault.name, &text);
                assert!(fault.name == "model_flat" || damaged != text, "{} changes nothing", fault.name);
                std::fs::write(&path, damaged).unwrap();
            }
        }
    }
}

fn damage_texture(house: &House, name: &str, path: &Path) {
    let jid = path.parent().unwrap().file_name().unwrap().to_str().unwrap();
    let model = house.models.iter().find(|model| model.jid() == jid).unwrap();
    let picture = swatch_picture(&model.swatches, model.side);
    match name {
        "texture_alpha_zero" => write_rgba_bytes(path, &picture.map(|[r, g, b, _]| [r, g, b, 0])).unwrap(),
        "texture_grey_alpha" => write_grey_alpha_bytes(path, &picture.map(|[r, _, _, a]| [r, a])).unwrap(),
        "texture_missing" => std::fs::remove_file(path).unwrap(),
        "texture_truncated" => {
            let bytes = std::fs::read(path).unwrap();
            std::fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
        }
        // The shadow is the second field, at the upper right.
        "model_drop_shadow" => {
            let half = model.side / 2;
            let at = |texel: usize| ((texel % half) as f64 + 0.5) / half as f64;
            let painted = Picture::from_fn(model.side, model.side, |x, y| {
                if x >= half && y < half { [0, 0, 0, shadow_opacity(at(x), at(y))] } else { picture.get(x, y) }
            });
            write_rgba_bytes(path, &painted).unwrap();
        }
        _ => panic!("no code plants the fault {name}"),
    }
}

/// The opacity of a painted shadow. As in the data: 40 to 51 nearly everywhere, less at the edge, more under the
/// middle.
fn shadow_opacity(u: f64, v: f64) -> u8 {
    let edge = u.min(1.0 - u).min(v.min(1.0 - v));
    if edge < 0.08 {
        (edge / 0.08 * 45.0) as u8
    } else if edge > 0.4 {
        193
    } else {
        45
    }
}

/// The text of an OBJ, of an MTL or of the list of models with a fault.
fn damaged_text(name: &str, text: &str) -> String {
    let lines = |change: &dyn Fn(&str) -> String| text.lines().map(|line| change(line) + "\n").collect::<String>();
    match name {
        "model_not_listed" => {
            let mut list: Vec<Value> = serde_json::from_str(text).unwrap();
            list.retain(|entry| entry["model_id"] != "cc0f0000-5a3b-4e00-8000-000000000021");
            mateval_dataset::json::to_text(&list)
        }
        "mtl_misleads" => {
            let black = text.replace("Ka 0.588 0.588 0.588", "Ka 0 0 0").replace("Kd 0.588 0.588 0.588", "Kd 0 0 0");
            black.replace("Tf 0 0 0", "Tf 1 1 1").replace("Ke 0 0 0", "Ke 1 1 1")
        }
        "model_shadow" => text.replace("g solid_002\n", "g Shadow_001\n"),
        "model_centimetres" => lines(&|line| {
            let Some(metres) = line.strip_prefix("v ") else { return line.to_owned() };
            let metres = metres.split(' ').map(|number| number.parse::<f64>().unwrap());
            metres.fold("v".to_owned(), |line, metres| format!("{line} {:.5}", 100.0 * metres))
        }),
        "obj_quads" => with_quads(text),
        "obj_blanks" => text.replace("\nv ", "\nv  ").replace("\nf ", "\nf  "),
        "obj_three_uvs" => {
            lines(&|line| if line.starts_with("vt ") { format!("{line} 0.00000\r") } else { format!("{line}\r") })
        }
        "obj_without_materials" => {
            let names_one = |line: &&str| ["mtllib ", "usemtl ", "s "].iter().any(|word| line.starts_with(word));
            text.split_inclusive('\n').filter(|line| !names_one(line)).collect()
        }
        // The mat's shape is flat.
        "model_flat" => text.to_owned(),
        _ => panic!("no code plants the fault {name}"),
    }
}

/// Joins two triangles that follow each other to a quad if they are the two of a fan.
fn with_quads(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
        if let Some(last) = lines.last_mut()
            && let ([f, a, _, b], [g, c, d, e]) = (&words(last)[..], &words(line)[..])
            && [f, g] == ["f", "f"]
            && [a, b] == [c, d]
        {
            *last = format!("{last} {e}");
            continue;
        }
        lines.push(line.to_owned());
    }
    lines.join("\n") + "\n"
}
