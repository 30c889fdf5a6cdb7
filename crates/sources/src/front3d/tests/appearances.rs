//! Roughness and metallic by what the data states: models, their groups, and architecture.

use mateval_scene::material::{Material, MaterialModel, ScalarInput};
use mateval_scene::material_class::MaterialClass;

use super::*;

/// Two triangles of a group of metal, which shares an edge with one of another group.
const TABLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n\
    g metal_legs\nf 1/1 3/2 2/3\nf 1/1 2/2 4/3\ng solid_001\nf 1/1 4/2 3/3\n";

fn stated(files: HouseFiles, seed: u64) -> FurnishedHouse {
    furnish(&HouseFiles { appearance: AppearanceRule::Stated { seed }, ..files }, &Limits::default()).unwrap()
}

/// The small house with two copies of a model of the groups above, which `model_info.json` says is of marble.
fn tables(folder: &Path, obj: &str) -> HouseFiles {
    let mut json = small_house();
    json["furniture"] = json!([{"uid": "p", "jid": "x", "valid": true}]);
    let children = json["scene"]["room"][0]["children"].as_array_mut().unwrap();
    children.push(json!({"ref": "p", "instanceid": "furniture/1", "pos": [2, 0, 2]}));
    children.push(json!({"ref": "p", "instanceid": "furniture/2", "pos": [1, 0, 1]}));
    let files = lone_house(folder, json.to_string().as_bytes());
    std::fs::create_dir(folder.join("models/x")).unwrap();
    std::fs::write(folder.join("models/x/raw_model.obj"), obj).unwrap();
    let info = json!([{"model_id": "x", "super-category": "Table", "category": null, "material": "Marble"}]);
    std::fs::write(folder.join("models/model_info.json"), info.to_string()).unwrap();
    files
}

fn numbers(material: &Material) -> [ScalarInput; 2] {
    let MaterialModel::Principled { roughness, metallic, .. } = material.model else { panic!("{material:?}") };
    [roughness, metallic]
}

/// Roughness and metallic at the corners of a triangle, all equal.
fn at_triangle(house: &FurnishedHouse, surface: usize, triangle: usize) -> [f32; 2] {
    let surface = &house.scene.surfaces[surface];
    let textures = house.scene.texture_list();
    let uvs = surface.mesh.uvs.as_ref().unwrap();
    let at = |vertex: u32| {
        numbers(&house.scene.materials[surface.material.0]).map(|input| input.at(&textures, uvs[vertex as usize]))
    };
    let [first, second, third] = surface.mesh.triangles[triangle].map(at);
    assert!(first == second && second == third, "{first:?} {second:?} {third:?}");
    first
}

#[test]
fn groups_of_a_model_have_their_own_class() {
    let folder = tempfile::tempdir().unwrap();
    let house = stated(tables(folder.path(), TABLE), 0);
    assert_sound(&house);
    // The floor comes first, then both copies.
    for copy in [1, 2] {
        let parts = house.placed[copy].origin.class_of_part.clone().unwrap();
        assert_eq!(parts, [Some(MaterialClass::Metal), Some(MaterialClass::Stone)]);
        let numbers = [0, 1, 2].map(|triangle| at_triangle(&house, copy, triangle));
        assert_eq!((numbers[0], numbers[0][1], numbers[2][1]), (numbers[1], 1.0, 0.0));
        assert!((0.2..=0.4).contains(&numbers[0][0]) && (0.1..=0.375).contains(&numbers[2][0]), "{numbers:?}");
    }
    assert_eq!(house.scene.surfaces[1].material, house.scene.surfaces[2].material);
    // Another seed draws another roughness of the same classes.
    let folder = tempfile::tempdir().unwrap();
    let other = stated(tables(folder.path(), TABLE), 1);
    assert_ne!(at_triangle(&other, 1, 0)[0], at_triangle(&house, 1, 0)[0]);
    assert_eq!(other.placed[1].origin.class_of_part, house.placed[1].origin.class_of_part);
}

/// Twin of the above: constants and no classes, and the same geometry.
#[test]
fn without_the_rule_everything_is_constant() {
    let folder = tempfile::tempdir().unwrap();
    let files = tables(folder.path(), TABLE);
    let house = furnish(&files, &Limits::default()).unwrap();
    for (placed, surface) in house.placed.iter().zip(&house.scene.surfaces) {
        assert_eq!(placed.origin.class_of_part, None);
        let constants = [0.5, 0.0].map(ScalarInput::Constant);
        assert_eq!(numbers(&house.scene.materials[surface.material.0]), constants);
    }
    let stated = stated(files, 0);
    let corners = |house: &FurnishedHouse| -> Vec<[Vec3; 3]> {
        let meshes = house.scene.surfaces.iter().map(|surface| &surface.mesh);
        meshes.flat_map(|mesh| (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle))).collect()
    };
    assert_eq!(corners(&house), corners(&stated));
}

#[test]
fn texture_coordinates_that_spread_too_far_cost_a_model_the_classes_of_its_groups() {
    let folder = tempfile::tempdir().unwrap();
    let house = stated(tables(folder.path(), &TABLE.replace("vt 1 0", "vt 1e6 0")), 0);
    assert!(house.findings.iter().any(|finding| finding.code == "spread_uv"));
    assert_eq!(house.placed[1].origin.class_of_part, Some(vec![Some(MaterialClass::Stone); 2]));
}

/// The test kit's house: content types of its architecture, materials of its models, and groups of glass.
#[test]
fn the_whole_house_has_many_classes() {
    let disk = Disk::bare();
    let house = stated(disk.files(), 0);
    assert_sound(&house);
    let mut classes: Vec<MaterialClass> = Vec::new();
    for placed in &house.placed {
        let parts = placed.origin.part_of_triangle.as_ref().unwrap();
        let of_parts = placed.origin.class_of_part.as_ref().unwrap();
        assert_eq!(of_parts.len(), 1 + parts.iter().max().unwrap());
        classes.extend(of_parts.iter().flatten());
    }
    classes.sort_unstable();
    classes.dedup();
    for class in [MaterialClass::Glass, MaterialClass::Wood, MaterialClass::Paint, MaterialClass::Tile] {
        assert!(classes.contains(&class), "{class} is not in {classes:?}");
    }
    assert!(classes.len() >= 5, "{classes:?}");
}
