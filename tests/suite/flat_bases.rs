//! Sheets in the plane of a floor, furniture without thickness or a second piece of floor: Blender and the built-in tracer
//! show the same, since `prep build` moves them apart.

use std::path::{Path, PathBuf};

use mateval_dataset::layout::SceneFolder;
use mateval_dataset::{SceneId, reference};
use mateval_testkit::faulty_house;
use serde_json::{Value, json};

use super::blender::blender;
use super::command::{Run, build, mateval, render, run};
use super::planted::{edit_json, rehash};

const SAMPLES: u32 = 96;

/// The library of the test kit's house: its mat lies in the floor, and its basket has a painted shadow.
const RECIPE: &str = r#"name = "library"
resolution = [96, 72]
atlas_size = 64
views = []

[[scene]]
id = "library"
allow_missing = true
allow_unstated = true
camera = { position = [4.6, 1.5, 7.6], target = [1.5, 0.2, 6.2], fov_y_deg = 60.0 }

[scene.front3d]
house = "house/3D-FRONT/cc000000-5a3b-4e00-8000-000000000001.json"
room = "OtherRoom-103"
models = "house/3D-FUTURE-model"
textures = "house/3D-FRONT-texture"
"#;

fn compared(dataset: &Path, blender: &Path) -> Run {
    let mut command = render(dataset, SAMPLES);
    run(command.args(["--renderer", "blender", "--force", "--blender"]).arg(blender)).ends_with(0);
    run(mateval().args(["prep", "compare", "--samples", &SAMPLES.to_string()]).arg(dataset))
}

/// Puts the mat back into the floor.
fn lower_the_mat(dataset: &Path) {
    let folder = SceneFolder::of(dataset, &SceneId::new("library").unwrap());
    let mut scene = reference::read(&folder).unwrap();
    let is_mat = |surface: &&mut mateval_dataset::reference::Surface| {
        surface.mesh.triangles.len() == 2 && surface.mesh.positions.iter().all(|corner| corner.y == 1e-4)
    };
    let mats: Vec<_> = scene.surfaces.iter_mut().filter(is_mat).collect();
    assert_eq!(mats.len(), 1);
    for mat in mats {
        mat.mesh.positions.iter_mut().for_each(|corner| corner.y = 0.0);
    }
    reference::write(&folder, &scene).unwrap();
    rehash(dataset);
}

#[test]
fn both_renderers_show_the_same() {
    let Some((python, _turn)) = blender() else { return };
    let folder = tempfile::tempdir().unwrap();
    let [source, dataset] = ["source", "dataset"].map(|name| folder.path().join(name));
    faulty_house::write(&source);
    let recipe: PathBuf = source.join("recipe.toml");
    std::fs::write(&recipe, RECIPE).unwrap();
    run(&mut build(&recipe, &dataset)).ends_with(0);
    compared(&dataset, &python).ends_with(0);
    // The twin: in the floor's plane, the mat is seen in Blender as one sheet or the other.
    lower_the_mat(&dataset);
    compared(&dataset, &python).ends_with(1);
}

/// The library's floor. It is planted as two sheets of one material that overlap in a strip along the skirting board, in which
/// the second starts its texture anew.
const FLOOR: &str = "101000000002/51";

fn plant_a_second_sheet(source: &Path) {
    // Both sheets lie between x = 0 and 5.6, facing up; v is that of the edge at the lower z.
    let sheet = |low: f64, high: f64, v: f64| {
        let (far, near) = (v - (high - low), v);
        let corners = [
            (0.0, high, far),
            (5.6, high, far),
            (5.6, low, near),
            (5.6, low, near),
            (0.0, low, near),
            (0.0, high, far),
        ];
        let xyz: Vec<f64> = corners.iter().flat_map(|(x, z, _)| [*x, 0.0, *z]).collect();
        let uv: Vec<f64> = corners.iter().flat_map(|(x, _, v)| [*x, *v]).collect();
        (json!(xyz), json!(uv))
    };
    edit_json(&source.join("house/3D-FRONT/cc000000-5a3b-4e00-8000-000000000001.json"), |house| {
        let meshes = house["mesh"].as_array_mut().unwrap();
        let floor = meshes.iter_mut().find(|mesh| mesh["uid"] == FLOOR).unwrap();
        (floor["xyz"], floor["uv"]) = sheet(4.6, 8.1, 0.0);
        let mut second = floor.clone();
        (second["xyz"], second["uv"]) = sheet(7.7, 8.2, 0.35);
        second["uid"] = json!("planted");
        meshes.push(second);
        let rooms = house["scene"]["room"].as_array_mut().unwrap();
        let has_floor = |room: &&mut Value| children(room).iter().any(|child| child["ref"] == FLOOR);
        let room = rooms.iter_mut().find(has_floor).unwrap();
        let mut child = children(room).iter().find(|child| child["ref"] == FLOOR).unwrap().clone();
        child["ref"] = json!("planted");
        child["instanceid"] = json!("mesh/planted");
        room["children"].as_array_mut().unwrap().push(child);
    });
}

fn children(room: &Value) -> &[Value] {
    room["children"].as_array().unwrap()
}

/// The state and the measured value of a check of the only view.
fn check(dataset: &Path, python: &Path, picture: &str) -> (String, f64) {
    run(render(dataset, 1).args(["--renderer", "blender", "--force", "--blender"]).arg(python)).ends_with(0);
    let compared = run(mateval().args(["prep", "compare", "--samples", "1", "--format", "json"]).arg(dataset));
    let compared: Value = serde_json::from_str(&compared.stdout).unwrap();
    let checks = compared["scenes"][0]["views"][0]["checks"].as_array().unwrap();
    let check = checks.iter().find(|check| check["picture"] == picture).unwrap();
    (check["state"].as_str().unwrap().to_owned(), check["measured"].as_f64().unwrap())
}

/// A floor that repeats its texture under a skirting board by a second sheet has the same base colour in both renderers.
/// The twin, with both sheets in one plane, differs in base colour though ids are equal: both sheets are one instance.
#[test]
fn a_floor_of_two_sheets() {
    let Some((python, _turn)) = blender() else { return };
    let folder = tempfile::tempdir().unwrap();
    let [source, dataset] = ["source", "dataset"].map(|name| folder.path().join(name));
    faulty_house::write(&source);
    plant_a_second_sheet(&source);
    let recipe: PathBuf = source.join("recipe.toml");
    let camera = "position = [2.5, 1.5, 5.6], target = [3.0, 0.0, 7.9]";
    std::fs::write(&recipe, RECIPE.replace("position = [4.6, 1.5, 7.6], target = [1.5, 0.2, 6.2]", camera)).unwrap();
    run(&mut build(&recipe, &dataset)).ends_with(0);
    let (state, psnr) = check(&dataset, &python, "base_color");
    assert!(state == "agrees" && psnr > 50.0, "{state} {psnr}");

    let folder = SceneFolder::of(&dataset, &SceneId::new("library").unwrap());
    let mut scene = reference::read(&folder).unwrap();
    let mut lowered = 0;
    for surface in &mut scene.surfaces {
        for corner in surface.mesh.positions.iter_mut().filter(|corner| corner.y == 1e-4 && corner.z > 7.69) {
            corner.y = 0.0;
            lowered += 1;
        }
    }
    assert!(lowered >= 4, "{lowered}");
    reference::write(&folder, &scene).unwrap();
    rehash(&dataset);
    let (state, psnr) = check(&dataset, &python, "base_color");
    assert!(state == "differs" && psnr < 40.0, "{state} {psnr}");
    assert_eq!(check(&dataset, &python, "instance").0, "agrees");
}
