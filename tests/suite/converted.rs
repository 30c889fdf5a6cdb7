//! Converted materials: nothing about a surface is hidden from the three maps, `materials = "source"` keeps the source's
//! own, and parameters that a source does not state have no scores.

use std::path::Path;
use std::sync::Arc;

use mateval_dataset::dataset::{SceneFile, TrueMaterials};
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::material::{ConductorIor, MaterialModel, PrincipledFlavour};
use mateval_dataset::{SceneId, glb, reference};
use mateval_eval::truth::true_material;
use mateval_image::{LinearRgb, Picture};
use mateval_prep::conversion::is_scored_model;
use mateval_tracer::{
    Lighting, RenderSettings, Repaint, Scattering, SurfaceMaps, World, render_repainted, render_views,
};
use serde_json::Value;

use super::blender::blender;
use super::command::{baseline, build, mateval, render, run, score};
use super::planted::{Room, rehash};
use super::sample::{copied_dataset, dataset, json, unrendered, write_source};
use mateval_testkit::copy_folder;

fn room(dataset: &Path) -> SceneFolder {
    SceneFolder::of(dataset, &SceneId::new("room").unwrap())
}

fn scene_file(dataset: &Path) -> SceneFile {
    mateval_dataset::json::read(&room(dataset).scene_file()).unwrap()
}

/// The mean over pixels of the absolute difference, over the mean of the second picture.
fn off(found: &Picture<LinearRgb>, expected: &Picture<LinearRgb>) -> f64 {
    let (mut difference, mut sum) = (0.0, 0.0);
    for (LinearRgb(a), LinearRgb(b)) in found.pixels().iter().zip(expected.pixels()) {
        for channel in 0..3 {
            difference += f64::from((a[channel] - b[channel]).abs());
            sum += f64::from(b[channel]);
        }
    }
    difference / sum
}

/// The true maps, rendered as any submission, give the picture of the true materials: the paths are the same, and only
/// texels and bytes lie between. The twin, the source's own materials, gives another picture.
#[test]
fn the_maps_describe_a_surface_completely() {
    let folder = room(dataset());
    let scene = scene_file(dataset());
    let world = World::new(Arc::new(reference::read(&folder).unwrap())).unwrap();
    assert_eq!(scene.materials, TrueMaterials::Converted);
    let materials = &world.scene().materials;
    assert!(materials.iter().all(is_scored_model));
    assert!(materials.iter().filter(|material| material.has_appearance()).count() >= 8);

    let atlases: Vec<_> = glb::read(&folder.instances()).unwrap().into_iter().map(|node| node.mesh).collect();
    let maps = |instance: &mateval_dataset::dataset::Instance| {
        let size = instance.atlas.as_ref()?.size as usize;
        let truth = true_material(&folder, &instance.id, size).unwrap();
        let scattering = Scattering { roughness: truth.roughness, metallic: truth.metallic };
        Some(SurfaceMaps { base_colors: vec![truth.base_color], scattering })
    };
    let maps = scene.instances.iter().map(maps).collect();
    let repaint = Repaint::new(&world, &atlases, maps, PrincipledFlavour::Blender).unwrap();
    let settings = RenderSettings { samples: 16, ..Default::default() };
    let (cameras, seeds) = ([scene.views[0].camera], [5]);
    let none = |_: usize, _: usize| ();
    let painted = render_repainted(&world, &repaint, &cameras, Lighting::Apart, &settings, &seeds, &none).unwrap();
    let rendered = |world: &World| {
        let render = render_views(world, &cameras, &settings, &seeds, &none).unwrap();
        render.views[0].by_seed[0].sum()
    };
    let (painted, true_picture) = (painted[0].views[0].by_seed[0].sum(), rendered(&world));
    let found = off(&painted, &true_picture);

    let source = reference::read_source_materials(&folder, materials.len()).unwrap().unwrap();
    let own = World::sharing(Arc::new(source.in_scene(world.scene())), world.accel().clone()).unwrap();
    assert!(!own.scene().materials.iter().all(is_scored_model));
    let twin = off(&rendered(&own), &true_picture);
    assert!(found < 0.02 && twin > 4.0 * found, "{found} {twin}");
}

#[test]
fn a_recipe_may_keep_the_sources_materials() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(
        &folder.path().join("source"),
        "materials = \"source\"\nresolution = [32, 24]\natlas_size = 64\nviews = []",
        &["room"],
    );
    let dataset = folder.path().join("dataset");
    run(&mut build(&recipe, &dataset)).ends_with(0);
    assert_eq!(scene_file(&dataset).materials, TrueMaterials::Source);
    let scene = reference::read(&room(&dataset)).unwrap();
    assert!(scene.materials.iter().any(|material| matches!(material.model, MaterialModel::Plastic { .. })));
    assert_eq!(reference::read_source_materials(&room(&dataset), scene.materials.len()).unwrap(), None);
    // The same materials are kept beside the converted ones.
    let count = reference::read(&room(unrendered())).unwrap().materials.len();
    let kept = reference::read_source_materials(&room(unrendered()), count).unwrap().unwrap();
    let models = |materials: &[mateval_dataset::material::Material]| {
        materials
            .iter()
            .map(|material| (material.name.clone(), std::mem::discriminant(&material.model)))
            .collect::<Vec<_>>()
    };
    assert_eq!(models(&kept.materials), models(&scene.materials));
    // An unknown word is refused.
    let text = std::fs::read_to_string(&recipe).unwrap().replace("\"source\"", "\"mine\"");
    std::fs::write(&recipe, text).unwrap();
    run(&mut build(&recipe, &folder.path().join("other"))).ends_with(2).says("converted");
}

/// Files of the source's materials that are truncated, of another scene, or that point out of their folder are named.
#[test]
fn faulty_source_materials_are_named() {
    let copy = copied_dataset();
    let path = room(copy.path()).source_materials().join(reference::SOURCE_MATERIALS);
    let sound = std::fs::read_to_string(&path).unwrap();
    let verified = |text: &str| {
        std::fs::write(&path, text).unwrap();
        rehash(copy.path());
        run(mateval().args(["prep", "verify"]).arg(copy.path()))
    };
    verified(&sound).ends_with(0);
    verified(&sound[..sound.len() / 2]).ends_with(1).prints("source");
    verified(&sound.replacen(".png", "/../../x.png", 1)).ends_with(1).prints("dangling_reference");
    let mut fewer: Value = serde_json::from_str(&sound).unwrap();
    fewer["materials"].as_array_mut().unwrap().pop();
    verified(&fewer.to_string()).ends_with(1).prints("dangling_reference");
}

/// A metal of eta 0, converted or not, does not stop Blender.
#[test]
fn a_metal_without_a_real_index_renders() {
    let Some((python, _turn)) = blender() else { return };
    for materials in ["converted", "source"] {
        let folder = tempfile::tempdir().unwrap();
        let head = format!("materials = \"{materials}\"\nresolution = [32, 24]\natlas_size = 64\nviews = []");
        let recipe = write_source(&folder.path().join("source"), &head, &["room"]);
        let xml = folder.path().join("source/room/scene.xml");
        let text = std::fs::read_to_string(&xml).unwrap();
        let tinted = r#"<bsdf type="conductor"><rgb name="eta" value="0"/><rgb name="k" value="K"/>
            <rgb name="specular_reflectance" value="0.9, 0.8, 0.7"/></bsdf>"#;
        let plain = r#"<bsdf type="conductor"><rgb name="eta" value="0"/><rgb name="k" value="K"/></bsdf>"#;
        let shapes: String = [(tinted, "1"), (tinted, "0"), (plain, "1"), (plain, "0")]
            .iter()
            .map(|(bsdf, k)| format!("<shape type=\"disk\">{}</shape>\n", bsdf.replace('K', k)))
            .collect();
        std::fs::write(&xml, text.replace("</scene>", &format!("{shapes}</scene>"))).unwrap();
        let dataset = folder.path().join("dataset");
        run(&mut build(&recipe, &dataset)).ends_with(0);
        let scene = reference::read(&room(&dataset)).unwrap();
        let metals = scene.materials.iter().filter(|material| {
            matches!(material.model, MaterialModel::Conductor { ior: ConductorIor::EtaK { eta: [0.0, ..], .. }, .. })
        });
        assert_eq!(metals.count(), if materials == "source" { 4 } else { 0 });
        run(render(&dataset, 1).args(["--renderer", "blender", "--blender"]).arg(&python)).ends_with(0);
        let record = json(&dataset.join("scenes/room/ground_truth/renders/blender/input/render.json"));
        let is_plastic = |line: &Value| line.as_str().unwrap().contains("plastic is Principled");
        assert_eq!(record["approximations"].as_array().unwrap().iter().any(is_plastic), materials == "source");
        run(&mut render(&dataset, 1)).ends_with(0);
    }
}

/// Without a stated roughness no key of it has a value, in pictures or texels; metallic keeps its values. Tables and the
/// leaderboard are made all the same.
#[test]
fn what_the_source_does_not_state_has_no_score() {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("dataset");
    copy_folder(unrendered(), &copy);
    assert!(scene_file(&copy).source.states_roughness && scene_file(&copy).source.states_metallic);
    Room::of(&copy).edit_scene(|scene| scene["source"]["states_roughness"] = Value::Bool(false));
    rehash(&copy);
    let keys = |dataset: &Path, name: &str| {
        let (submission, result) = (folder.path().join(name), folder.path().join(name).with_extension("json"));
        run(&mut baseline("gt", dataset, &submission)).ends_with(0);
        run(&mut score(&submission, dataset, &result)).ends_with(0);
        let found = json(&result);
        let summary = found["protocols"]["mateval-3"]["summary"].as_object().unwrap();
        (summary.keys().cloned().collect::<Vec<_>>(), found)
    };
    let (all, _) = keys(unrendered(), "stated");
    let (some, result) = keys(&copy, "unstated");
    let expected: Vec<_> = all.iter().filter(|key| !key.contains("roughness")).cloned().collect();
    assert!(all.len() > expected.len() + 5 && expected.iter().any(|key| key.starts_with("metallic")));
    assert_eq!(some, expected);
    let pictures = result["protocols"]["mateval-3"]["pictures"].as_array().unwrap();
    assert!(pictures.iter().all(|value| !value["picture"].as_str().unwrap().starts_with("roughness")));
    let file = folder.path().join("unstated.json");
    run(mateval().args(["eval", "tables"]).arg(&file)).ends_with(0);
    run(mateval().args(["eval", "leaderboard"]).arg(&file).arg("--out").arg(folder.path().join("site"))).ends_with(0);
}

/// A dataset of the format before is refused with a sentence that names both versions.
#[test]
fn the_format_before_is_named() {
    let copy = copied_dataset();
    let path = room(copy.path()).scene_file();
    let text = std::fs::read_to_string(&path).unwrap().replace("mateval/3", "mateval/1");
    std::fs::write(&path, text).unwrap();
    rehash(copy.path());
    run(mateval().args(["prep", "stats"]).arg(copy.path())).ends_with(2).says("mateval/1").says("mateval/3");
}
