//! Redressed rooms, from the recipe to the maps: the built-in sample with other materials, drawn with a key.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_image::{Picture, png_io};
use serde_json::Value;

use super::command::{build, mateval, render, run, stats, verify};
use super::sample::{copy_source, files_below, json, manifest};
use mateval_testkit::kept_folder;

/// A folder with the sample in `source`, a `key`, a folder of `materials`, and these datasets: the `original` with
/// classes of material, two of the same key (`first`, `again`), and one of an `other` key.
static BUILT: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("redress");
    copy_source(&folder.join("source"));
    write_materials(&folder.join("materials"));
    made(&folder, "original", "");
    std::fs::write(folder.join("key"), [7; 32]).unwrap();
    let redress = "redress = { key = \"../key\" }";
    made(&folder, "first", redress);
    made(&folder, "again", redress);
    std::fs::write(folder.join("key"), [8; 32]).unwrap();
    made(&folder, "other", redress);
    folder
});

/// A floor of wide stripes and a cloth, with names that occur nowhere else.
fn write_materials(folder: &Path) {
    let stripes = |x: usize, _| if x % 64 < 32 { [200, 60, 20] } else { [20, 60, 200] };
    for name in ["WoodFloorSecretum", "FabricSecretum"] {
        let place = folder.join(name);
        std::fs::create_dir_all(&place).unwrap();
        let picture = Picture::from_fn(64, 64, stripes);
        png_io::write_rgb_bytes(&place.join(format!("{name}_1K_Color.png")), &picture).unwrap();
    }
}

fn made(folder: &Path, name: &str, redress: &str) {
    let recipe = recipe(folder, redress);
    run(&mut build(&recipe, &folder.join(name))).ends_with(0);
}

fn recipe(folder: &Path, redress: &str) -> PathBuf {
    let path = folder.join("source/redress.toml");
    let room = "house = \"house/3D-FRONT/cc000000-5a3b-4e00-8000-000000000001.json\", room = \"LivingDiningRoom-101\", \
                models = \"house/3D-FUTURE-model\", textures = \"house/3D-FRONT-texture\", appearance = \"stated\"";
    let text = format!(
        "name = \"redress\"\nresolution = [64, 48]\natlas_size = 128\nviews = []\nlicences = {{ front3d = \"CC0-1.0\" }}\n\
         [[scene]]\nid = \"living\"\nfront3d = {{ {room} }}\ncamera = {{ designer = 0 }}\n{redress}\n\
         [[scene]]\nid = \"room\"\nbitterli = \"room/scene.xml\"\n{redress}\n"
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn bytes(dataset: &str, file: &str) -> Vec<u8> {
    let path = BUILT.join(dataset).join("scenes").join(file);
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn scene(dataset: &str, scene: &str) -> Value {
    json(&BUILT.join(dataset).join(format!("scenes/{scene}/scene.json")))
}

#[test]
fn the_same_key_makes_the_same_bytes_and_another_key_other_maps() {
    assert_eq!(manifest(&BUILT.join("first")), manifest(&BUILT.join("again")));
    let mut counts = [0, 0];
    for id in ["living", "room"] {
        let weak = weak(&scene("first", id));
        for instance in scene("first", id)["instances"].as_array().unwrap() {
            let name = instance["id"].as_str().unwrap();
            if instance["atlas"].is_null() {
                continue;
            }
            let map = format!("{id}/ground_truth/materials/{name}/base_color.png");
            let [original, first, other] = ["original", "first", "other"].map(|dataset| bytes(dataset, &map));
            let is_kept = weak.contains(&(name.to_owned(), "kept".to_owned()));
            assert_eq!(original == first, is_kept, "{id} {name}");
            assert_eq!(first == other, is_kept, "{id} {name}");
            counts[usize::from(is_kept)] += 1;
        }
        // Geometry is the same, and so are classes of parts.
        for file in ["views/input/depth.exr", "views/input/instance.png", "views/input/part.png"] {
            assert_eq!(bytes("original", &format!("{id}/{file}")), bytes("first", &format!("{id}/{file}")), "{file}");
        }
    }
    assert!(counts[0] > 30 && counts[1] >= 1, "{counts:?}");
    let classes = "living/ground_truth/material_classes.json";
    assert_eq!(bytes("original", classes), bytes("first", classes));
}

/// The weak secrets of a scene, with their reasons.
fn weak(scene: &Value) -> BTreeSet<(String, String)> {
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let weak = scene["redressed"]["weak"].as_array().unwrap();
    weak.iter().map(|weak| (text(&weak["instance"]), text(&weak["reason"]))).collect()
}

#[test]
fn the_dataset_states_what_is_no_good_secret() {
    let room = scene("first", "room");
    let weak = weak(&room);
    for (instance, reason) in [("mirror", "kept"), ("rug", "motif")] {
        assert!(weak.contains(&(instance.to_owned(), reason.to_owned())), "{weak:?}");
    }
    assert!(!weak.iter().any(|(instance, _)| instance == "sofa" || instance == "window_glass"), "{weak:?}");
    let shares = room["redressed"]["weak"].as_array().unwrap().iter().map(|weak| weak["area_share"].as_f64().unwrap());
    let total = room["redressed"]["weak_area_share"].as_f64().unwrap();
    assert!((shares.sum::<f64>() - total).abs() < 1e-9 && total > 0.01 && total < 0.3, "{total}");
    let findings = room["findings"].to_string();
    assert_eq!(findings.matches("weak_secret").count(), weak.len());
    assert_eq!(scene("original", "room")["redressed"], Value::Null);
    let living = scene("first", "living")["source"].clone();
    assert_eq!([&living["states_roughness"], &living["states_metallic"]], [&Value::from(true); 2]);
    run(&mut verify(&BUILT.join("first"))).ends_with(0);
    let beside = run(stats(&BUILT.join("first")).arg("--beside").arg(BUILT.join("original"))).ends_with(0);
    let share = (total + scene("first", "living")["redressed"]["weak_area_share"].as_f64().unwrap()) / 2.0;
    assert!(beside.stdout.contains(&format!("  weak area share    {share:.3}\n")), "{}", beside.stdout);
}

/// Lamps shine as before, glass is the same, and no texture of the source stays but those of lights.
#[test]
fn lights_and_glass_stay_and_textures_go() {
    for id in ["living", "room"] {
        let reference = |dataset: &str| {
            json(&BUILT.join(dataset).join(format!("scenes/{id}/ground_truth/reference/reference.json")))
        };
        let [original, first] = ["original", "first"].map(reference);
        let glass = |file: &Value| {
            let all = file["materials"].as_array().unwrap().iter().map(|material| material["model"].clone());
            all.filter(|model| model.to_string().contains("dielectric")).collect::<Vec<_>>()
        };
        assert_eq!(glass(&original), glass(&first));
        let lights = |dataset: &str| {
            let file = json(&BUILT.join(dataset).join(format!("scenes/{id}/ground_truth/lights.json")));
            let groups = file["groups"].as_array().unwrap().clone();
            let light = |group: &Value| (group["name"].clone(), group["emission"]["radiance"].clone());
            groups.iter().map(light).collect::<Vec<_>>()
        };
        assert_eq!(lights("original"), lights("first"));
        let of_lights = json(&BUILT.join("first").join(format!("scenes/{id}/ground_truth/lights.json"))).to_string();
        for (at, texture) in first["textures"].as_array().unwrap().iter().enumerate() {
            let is_ours = texture["source"].as_str().unwrap().starts_with("redressed");
            assert!(is_ours || of_lights.contains(&format!("\"texture\":{at}")), "{id} {texture}");
        }
        let names: Vec<&Value> = first["materials"].as_array().unwrap().iter().map(|m| &m["name"]).collect();
        assert!(
            names.iter().filter(|name| name.to_string().contains("redressed")).count() + 3 >= names.len(),
            "{names:?}"
        );
    }
}

/// The recipe's for a room of a house, the file beside it for the other scene.
#[test]
fn every_source_has_its_licence() {
    let licences = json(&BUILT.join("first/dataset.json"))["licences"].clone();
    let of = |at: usize| (licences[at]["scene"].clone(), licences[at]["file"].clone());
    assert_eq!((of(0), &licences[0]["text"]), (("living".into(), "recipe.toml".into()), &"CC0-1.0".into()));
    assert_eq!((of(1), licences[2].clone()), (("room".into(), "LICENSE.txt".into()), Value::Null));
}

#[test]
fn materials_come_from_the_folder_and_are_not_named() {
    let name = "tiles";
    made(&BUILT, name, "redress = { key = \"../key\", materials = \"../materials\" }");
    let dataset = BUILT.join(name);
    for file in files_below(&dataset) {
        let bytes = std::fs::read(dataset.join(&file)).unwrap();
        assert!(!bytes.windows(8).any(|window| window == b"Secretum"), "{}", file.display());
    }
    let path = dataset.join("scenes/room/ground_truth/materials/floor/base_color.png");
    let map = png_io::read_srgb(&path).unwrap();
    let is_red = map.pixels().iter().filter(|pixel| pixel.0[0] > pixel.0[2]).count() as f64 / map.pixels().len() as f64;
    assert!(is_red > 0.2 && is_red < 0.8, "{is_red}");
    run(&mut render(&dataset, 1)).ends_with(0);
}

#[test]
fn keys_that_are_no_secret_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    copy_source(&folder.path().join("source"));
    let refused = |redress: &str, text: &str| {
        let recipe = recipe(folder.path(), redress);
        run(&mut build(&recipe, &folder.path().join("dataset"))).ends_with(2).says(text);
        assert!(!folder.path().join("dataset").exists());
    };
    let with = |key: &str| format!("redress = {{ key = \"{key}\" }}");
    std::fs::write(folder.path().join("key"), [1; 31]).unwrap();
    std::fs::write(folder.path().join("source/key"), [1; 32]).unwrap();
    refused(&with("../key"), "has 31 bytes; expected 32 or more random ones");
    refused(&with("../none"), "cannot be read");
    refused(&with("key"), "which may be published; keep keys and materials elsewhere");
    std::fs::write(folder.path().join("key"), [1; 32]).unwrap();
    refused("redress = { key = \"../key\", materials = \"room\" }", "which may be published");
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    refused("redress = { key = \"../key\", materials = \"../empty\" }", "holds no material");
    refused("redress = { key = \"../key\" }\nphoto = \"a.png\"", "`redress` changes the room");
}

/// A glTF file of a textured floor and a plain cushion above it, with its files beside it.
fn write_gltf(folder: &Path) {
    let square = |from: f32, to: f32, y: f32| [[from, y, from], [from, y, to], [to, y, to], [to, y, from]].concat();
    let uv = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0];
    let floats = [square(0.0, 2.0, 0.0), uv.to_vec(), square(0.5, 1.5, 0.5)].concat();
    let corners = [0_u16, 1, 2, 0, 2, 3];
    let bytes =
        floats.iter().flat_map(|value| value.to_le_bytes()).chain(corners.iter().flat_map(|at| at.to_le_bytes()));
    std::fs::write(folder.join("room.bin"), bytes.collect::<Vec<u8>>()).unwrap();
    let checks = |x: usize, y: usize| if (x + y).is_multiple_of(2) { [120, 90, 60] } else { [90, 60, 30] };
    png_io::write_rgb_bytes(&folder.join("checks.png"), &Picture::from_fn(8, 8, checks)).unwrap();
    let view = |at: usize, length: usize| serde_json::json!({ "buffer": 0, "byteOffset": at, "byteLength": length });
    let places = |view: usize, from: [f32; 3], to: [f32; 3]| {
        let kind = "VEC3";
        serde_json::json!({ "bufferView": view, "componentType": 5126, "count": 4, "type": kind, "min": from, "max": to })
    };
    let file = serde_json::json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "name": "floor", "mesh": 0 }, { "name": "cushion", "mesh": 1 }],
        "meshes": [
            { "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 3, "material": 0 }] },
            { "primitives": [{ "attributes": { "POSITION": 2 }, "indices": 3, "material": 1 }] },
        ],
        "materials": [
            { "name": "Wood", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "metallicFactor": 0 } },
            { "name": "Fabric", "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.2, 0.1, 1], "metallicFactor": 0 } },
        ],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": "checks.png" }],
        "accessors": [
            places(0, [0.0, 0.0, 0.0], [2.0, 0.0, 2.0]),
            { "bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2" },
            places(2, [0.5, 0.5, 0.5], [1.5, 0.5, 1.5]),
            { "bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ],
        "bufferViews": [view(0, 48), view(48, 32), view(80, 48), view(128, 12)],
        "buffers": [{ "byteLength": 140, "uri": "room.bin" }],
    });
    std::fs::write(folder.join("room.gltf"), file.to_string()).unwrap();
}

/// A glTF file names no classes: they follow from the names of materials and objects. The twin has the same key.
#[test]
fn a_gltf_scene_has_other_maps_and_the_same_geometry() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("source");
    std::fs::create_dir(&source).unwrap();
    write_gltf(&source);
    let built = |name: &str, redress: &str| {
        let camera = "{ position = [1.0, 1.8, 3.5], target = [1.0, 0.0, 1.0], fov_y_deg = 50.0 }";
        let text = format!(
            "name = \"gltf\"\nresolution = [64, 48]\natlas_size = 64\nviews = []\n[[scene]]\nid = \"room\"\n\
             gltf = \"room.gltf\"\nallow_unstated = true\ncamera = {camera}\n{redress}\n"
        );
        std::fs::write(source.join("recipe.toml"), text).unwrap();
        let dataset = folder.path().join(name);
        run(&mut build(&source.join("recipe.toml"), &dataset)).ends_with(0);
        run(&mut verify(&dataset)).ends_with(0);
        dataset.join("scenes/room")
    };
    let private = |word: &str| BUILT.join(word).canonicalize().unwrap().display().to_string();
    let key = format!("key = \"{}\"", private("key"));
    let [original, first, again, tiled] = [
        ("original", String::new()),
        ("first", format!("redress = {{ {key} }}")),
        ("again", format!("redress = {{ {key} }}")),
        ("tiled", format!("redress = {{ {key}, materials = \"{}\" }}", private("materials"))),
    ]
    .map(|(name, redress)| built(name, &redress));
    let bytes = |scene: &Path, file: &str| std::fs::read(scene.join(file)).unwrap();
    for instance in ["floor", "cushion"] {
        let map = format!("ground_truth/materials/{instance}/base_color.png");
        let maps: BTreeSet<Vec<u8>> = [&original, &first, &tiled].map(|scene| bytes(scene, &map)).into();
        assert_eq!(maps.len(), 3, "{instance}");
        assert_eq!(bytes(&first, &map), bytes(&again, &map), "{instance}");
    }
    for file in ["views/input/depth.exr", "views/input/instance.png", "views/input/part.png"] {
        for scene in [&first, &tiled] {
            assert_eq!(bytes(&original, file), bytes(scene, file), "{file}");
        }
    }
    let scene = json(&first.join("scene.json"));
    assert_eq!(scene["source"]["kind"], "gltf");
    assert_eq!(scene["source"]["states_roughness"], true);
    assert_eq!(scene["redressed"]["weak"].as_array().unwrap().len(), 0);
}

/// The recipe names key and materials by paths that lead there from any folder.
#[test]
fn surveys_write_redressed_scenes() {
    let (source, folder) = (BUILT.join("source"), tempfile::tempdir().unwrap());
    let survey = |key: &Path, materials: Option<&Path>| {
        let mut command = mateval();
        command.args(["prep", "survey", "house/3D-FRONT", "--models", "house/3D-FUTURE-model"]);
        command.args(["--cameras-per-room", "1", "--resolution", "64", "48", "--force"]);
        command.arg("--source").arg(&source).arg("--redress").arg(key);
        if let Some(materials) = materials {
            command.arg("--redress-materials").arg(materials);
        }
        run(command.arg("--out").arg(folder.path().join("survey")))
    };
    let key = BUILT.join("key");
    survey(&source.join("recipe.toml"), None).ends_with(2).says("which may be published");
    survey(&key, Some(source.join("room").as_path())).ends_with(2).says("which may be published");
    survey(&key, Some(folder.path())).ends_with(2).says("holds no material");
    assert!(!folder.path().join("survey").exists());
    let materials = BUILT.join("materials");
    let [key_shown, materials_shown] = [&key, &materials].map(|path| path.canonicalize().unwrap());
    let [key_shown, materials_shown] = [key_shown.display(), materials_shown.display()];
    for (given, expected) in [
        (None, format!("redress = {{ key = \"{key_shown}\" }}\n")),
        (Some(&materials), format!("redress = {{ key = \"{key_shown}\", materials = \"{materials_shown}\" }}\n")),
    ] {
        survey(&key, given.map(PathBuf::as_path)).ends_with(0);
        let recipe = std::fs::read_to_string(folder.path().join("survey/recipe.toml")).unwrap();
        let count = recipe.matches(&expected).count();
        assert!(count > 0 && count == recipe.matches("[[scene]]").count(), "{recipe}");
    }
}
