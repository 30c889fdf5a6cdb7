//! Furniture without thickness in the plane of a floor: Blender and the built-in tracer show the same, since `prep build`
//! moves it in front of the floor.

use std::path::{Path, PathBuf};

use mateval_scene::layout::SceneFolder;
use mateval_scene::{SceneId, reference_io};

use super::blender::blender;
use super::command::{Run, build, mateval, render, run, run_words};
use super::planted::rehash;

const SAMPLES: u32 = 96;

/// The built-in library: its mat lies in the floor, and its basket has a painted shadow.
const RECIPE: &str = r#"name = "library"
resolution = [96, 72]
atlas_size = 64
views = []

[[scene]]
id = "library"
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
    let mut scene = reference_io::read(&folder).unwrap();
    let is_mat = |surface: &&mut mateval_scene::reference::Surface| {
        surface.mesh.triangles.len() == 2 && surface.mesh.positions.iter().all(|corner| corner.y == 1e-4)
    };
    let mats: Vec<_> = scene.surfaces.iter_mut().filter(is_mat).collect();
    assert_eq!(mats.len(), 1);
    for mat in mats {
        mat.mesh.positions.iter_mut().for_each(|corner| corner.y = 0.0);
    }
    reference_io::write(&folder, &scene).unwrap();
    rehash(dataset);
}

#[test]
fn both_renderers_show_the_same() {
    let Some((python, _turn)) = blender() else { return };
    let folder = tempfile::tempdir().unwrap();
    let [source, dataset] = ["source", "dataset"].map(|name| folder.path().join(name));
    run_words([Path::new("sample"), &source]).ends_with(0);
    let recipe: PathBuf = source.join("recipe.toml");
    std::fs::write(&recipe, RECIPE).unwrap();
    run(&mut build(&recipe, &dataset)).ends_with(0);
    compared(&dataset, &python).ends_with(0);
    // The twin: in the floor's plane, the mat is seen in Blender as one sheet or the other.
    lower_the_mat(&dataset);
    compared(&dataset, &python).ends_with(1);
}
