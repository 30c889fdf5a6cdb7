//! Every fault of the test kit's house has its expected finding, and there are no other findings.

use std::collections::BTreeSet;

use super::*;
use mateval_testkit::faulty_house::faults::{FAULTS, Fault, Place};

/// The code of the expected finding, and where it is.
enum Expected {
    /// At the fault's pointer, or for its file.
    Here(&'static str),
    /// Elsewhere: the end of the file's path, and the place.
    There(&'static str, &'static str, &'static str),
    /// No finding; another test asserts the effect.
    Silent,
}
use Expected::{Here, Silent, There};

fn expected(name: &str) -> Expected {
    match name {
        "furniture_uid_repeated" | "material_uid_repeated" => Here("duplicate_uid"),
        "model_folder_missing" => There("missing_model", "-000000000928/raw_model.obj", ""),
        "valid_false" | "valid_missing" => There("not_public", ".json", "/furniture"),
        "material_normal_texture" => Here("normal_map"),
        "material_folder_missing" => There("missing_texture", "-000000000900/texture.png", ""),
        "mesh_normals_not_unit" | "mesh_normals_short" => Here("bad_normals"),
        "mesh_zero_area" => Here("zero_area"),
        "mesh_uv_null" => Here("bad_uv"),
        "mesh_material_dangles" => Here("no_material"),
        "mesh_index_out_of_range" => Here("bad_faces"),
        "mesh_without_faces" => There("empty_mesh", ".json", "/mesh/72"),
        "rotation_not_unit" => Here("rotation_not_unit"),
        "scale_mirrors" => Here("mirrored_piece"),
        "scale_tiny" => Here("scale_tiny"),
        "child_without_record" => Here("dangling_ref"),
        "model_not_listed" => There("unlisted_model", ".json", "/furniture/23"),
        "texture_truncated" => Here("unreadable_texture"),
        "texture_missing" => Here("missing_texture"),
        "model_shadow" => There("shadow_group", "16/raw_model.obj", "group 'Shadow_001'"),
        "model_drop_shadow" => Here("drop_shadow"),
        "model_centimetres" => Here("centimetres"),
        "category_chinese" | "category_missing" | "category_null" => Silent,
        "material_jid_local" | "material_jid_empty" | "material_texture_object" | "material_use_color" => Silent,
        "mesh_aid_text" | "mesh_type_empty" | "room_without_ceiling" | "scale_uneven" | "pieces_intersect" => Silent,
        "texture_alpha_zero" | "texture_grey_alpha" | "mtl_misleads" | "model_flat" => Silent,
        "obj_quads" | "obj_blanks" | "obj_three_uvs" | "obj_without_materials" => Silent,
        other => panic!("a fault that this table does not know: {other}"),
    }
}

/// The finding as `code`, the end of its file, its place.
fn wanted(fault: &Fault) -> Option<[String; 3]> {
    let (file, place) = match fault.place {
        Place::Json { pointer } => (".json", pointer),
        Place::File { path } => (path, ""),
    };
    match expected(fault.name) {
        Here(code) => Some([code, file, place].map(str::to_owned)),
        There(code, file, place) => Some([code, file, place].map(str::to_owned)),
        Silent => None,
    }
}

#[test]
fn every_fault_is_reported_and_nothing_else() {
    let house = furnished();
    let mut reported = BTreeSet::new();
    for fault in &FAULTS {
        let Some([code, file, place]) = wanted(fault) else { continue };
        let is_it = |(_, finding): &(usize, &mateval_scene::Finding)| {
            finding.code == code && finding.file.ends_with(&file) && finding.place == place
        };
        let found: Vec<usize> = house.findings.iter().enumerate().filter(is_it).map(|(at, _)| at).collect();
        assert_eq!(found.len(), 1, "{}: {code} {file} {place}", fault.name);
        reported.extend(found);
    }
    assert!(reported.len() > 20);
    let others: Vec<_> =
        (0..house.findings.len()).filter(|at| !reported.contains(at)).map(|at| &house.findings[at]).collect();
    // The model that is missing from the list is placed twice: two records, one finding each. The piece without a
    // folder is one of three models whose folder is missing, but the other two are not valid. Thresholds intersect
    // floors, as in real houses, and what stands on a floor touches it.
    let others: Vec<String> = others.iter().map(|f| format!("{} {}", f.code, f.place)).collect();
    assert_eq!(
        others,
        ["coincident_sheets /mesh", "furniture_in_architecture /furniture", "unlisted_model /furniture/24"]
    );
}

/// Faults without a finding have an effect: the piece exists and has the category of the list of models and its own
/// colours.
#[test]
fn silent_faults_have_their_effect() {
    let house = furnished();
    let origin = |number: u32| {
        let of = |placed: &&PlacedSurface| placed.model.as_ref().is_some_and(|model| model.jid == jid(number));
        let placed = house.placed.iter().rfind(of).unwrap();
        let PlacedModel { name, complete, .. } = placed.model.as_ref().unwrap();
        let [category, super_category] = [&placed.origin.category, &placed.origin.super_category];
        let text = |text: &Option<String>| text.clone().unwrap_or_default();
        (text(super_category), text(category), name.clone(), *complete)
    };
    // Chinese in the house, English in the list.
    let chest = origin(15);
    assert_eq!((chest.0.as_str(), chest.3), ("Cabinet/Shelf/Desk", false));
    assert_eq!(chest.2, chest.1.to_lowercase());
    assert!(chest.1.starts_with("Drawer Chest"), "{}", chest.1);
    // Null as category: the list has none either, so the title decides.
    let picture = origin(8);
    assert_eq!((picture.0.as_str(), picture.1.as_str(), picture.3), ("Others", "picture", true));
    // Pictures without opacity, and grey ones with opacity, are read.
    assert!(origin(14).3 && origin(19).3);
    // Neither in the list nor with a picture of its own.
    let crate_box = origin(21);
    assert_eq!((crate_box.0.as_str(), crate_box.3), ("Others", false));
    // Of two pieces that intersect, both are kept.
    assert_eq!(pieces_of(house, LIBRARY, 21).len(), 2);
    assert!(house.placed.iter().any(|p| p.room == LIBRARY && p.origin.role.architecture_kind() == Some("Other")));
    let ceilings = house.placed.iter().filter(|p| p.origin.role.architecture_kind() == Some("Ceiling"));
    assert_eq!(ceilings.map(|p| p.room).collect::<Vec<_>>(), [0, 1]);
}

/// The twin: the same house without faults has no warning.
#[test]
fn a_sound_house_has_no_warning() {
    let disk = Disk::new();
    for number in [15, 21] {
        std::fs::copy(disk.model(1).join("texture.png"), disk.model(number).join("texture.png")).unwrap();
    }
    let house = disk.furnish_json(&faulty_house::sound_json()).unwrap();
    assert_eq!(warnings(&house), [""; 0]);
    assert_sound(&house);
    let codes: BTreeSet<&str> = house.findings.iter().map(|finding| finding.code.as_str()).collect();
    // Findings about the models' own files and about models that are not public remain, and every real house has
    // coincident sheets, and furniture that touches the floor.
    let of_models = ["centimetres", "drop_shadow", "shadow_group", "unlisted_model"];
    let of_houses = ["coincident_sheets", "furniture_in_architecture", "not_public"];
    assert_eq!(codes, of_models.into_iter().chain(of_houses).collect());
    // The twin of this: the house with its faults has warnings.
    assert!(warnings(furnished()).len() > 5);
}
