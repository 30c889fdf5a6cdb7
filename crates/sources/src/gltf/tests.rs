//! Tests on whole files, built here, with and without faults. `tests/suite/gltf.rs` reads files that Blender wrote.

use std::f64::consts::PI;
use std::path::Path;

use mateval_dataset::Severity;
use mateval_dataset::material::{ColorInput, MaterialModel, ScalarInput};
use mateval_image::{Picture, png_io};
use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;

/// A triangle in z = 0 that faces +z: positions, uv (with v downwards) and indices.
const FLOATS: [f32; 15] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0];
const INDICES: [u16; 3] = [0, 1, 2];

fn triangle_bytes() -> Vec<u8> {
    let floats = FLOATS.iter().flat_map(|value| value.to_le_bytes());
    floats.chain(INDICES.iter().flat_map(|index| index.to_le_bytes())).collect()
}

fn data_uri(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", base64::encode(bytes))
}

/// A scene of one node with one triangle, whose buffer is part of the JSON.
fn triangle() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "chair", "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 }] }],
        "materials": [{ "name": "wood", "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 0.75 } }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 0, "byteOffset": 36, "componentType": 5126, "count": 3, "type": "VEC2" },
            { "bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 60 },
            { "buffer": 0, "byteOffset": 60, "byteLength": 6 },
        ],
        "buffers": [{ "byteLength": 66, "uri": data_uri(&triangle_bytes()) }],
    })
}

/// [`triangle`] with the value at a JSON pointer set. A missing key is added; `-` appends to a list.
fn with(pointer: &str, value: Value) -> Value {
    changed(triangle(), pointer, value)
}

fn changed(mut file: Value, pointer: &str, value: Value) -> Value {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match file.pointer_mut(parent).unwrap() {
        Value::Object(map) => drop(map.insert(key.to_owned(), value)),
        Value::Array(list) if key == "-" => list.push(value),
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        other => panic!("{other}"),
    }
    file
}

fn read_within(file: &Value, limits: Limits) -> Result<FileScene, SourceError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    read(&path, None, &limits)
}

fn read_bytes_in(folder: &Path, bytes: &[u8]) -> Result<FileScene, SourceError> {
    let path = folder.join("room.gltf");
    std::fs::write(&path, bytes).unwrap();
    read(&path, None, &Limits::default())
}

fn read_bytes(bytes: &[u8]) -> Result<FileScene, SourceError> {
    read_bytes_in(tempfile::tempdir().unwrap().path(), bytes)
}

fn read_json(file: &Value) -> FileScene {
    read_bytes(file.to_string().as_bytes()).unwrap()
}

fn error_of(file: &Value) -> String {
    read_bytes(file.to_string().as_bytes()).unwrap_err().to_string()
}

/// Code and place of each finding, but for `no_light`, which most of these files cause.
fn findings(scene: &FileScene) -> Vec<(&str, &str)> {
    let others = scene.findings.iter().filter(|finding| finding.code != "no_light");
    others.map(|finding| (finding.code.as_str(), finding.place.as_str())).collect()
}

fn principled(scene: &FileScene) -> (ColorInput, ScalarInput, ScalarInput) {
    match scene.scene.materials[0].model {
        MaterialModel::Principled { base_color, roughness, metallic, .. } => (base_color, roughness, metallic),
        other => panic!("{other:?}"),
    }
}

/// The whole path of a small file, from a .gltf and from a .glb.
#[test]
fn a_node_is_an_instance() {
    let mut apart = triangle();
    apart["buffers"][0].as_object_mut().unwrap().remove("uri");
    let glb = glb(&apart, &triangle_bytes());
    for scene in [read_json(&triangle()), read_bytes(&glb).unwrap()] {
        assert_eq!(findings(&scene), []);
        let surface = &scene.scene.surfaces[0];
        assert_eq!((surface.name.as_str(), scene.scene.materials[0].name.as_str()), ("chair", "wood"));
        assert_eq!(surface.mesh.positions[1].to_array(), [1.0, 0.0, 0.0]);
        // v counts from the top in the file, from the bottom here.
        assert_eq!(surface.mesh.uvs.as_ref().unwrap()[1].to_array(), [1.0, 0.0]);
        let expected = (ColorInput::Constant([1.0; 3]), ScalarInput::Constant(0.75), ScalarInput::Constant(0.0));
        assert_eq!(principled(&scene), expected);
        assert_eq!((scene.lights, scene.camera), (SceneLights::Stage, None));
    }
}

fn glb(file: &Value, blob: &[u8]) -> Vec<u8> {
    let padded = |mut bytes: Vec<u8>, with: u8| {
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, blob) = (padded(file.to_string().into_bytes(), b' '), padded(blob.to_vec(), 0));
    let word = |value: usize| (value as u32).to_le_bytes();
    let length = 28 + json.len() + blob.len();
    let header = [b"glTF".as_slice(), &word(2), &word(length), &word(json.len()), b"JSON"].concat();
    [header, json, [word(blob.len()).as_slice(), b"BIN\0"].concat(), blob].concat()
}

/// Primitives of one material are the parts of one instance; another material is another instance.
#[test]
fn primitives_are_parts() {
    let same = triangle()["meshes"][0]["primitives"][0].clone();
    let other = json!({ "attributes": { "POSITION": 0 }, "indices": 2 });
    let file = changed(with("/meshes/0/primitives/-", same), "/meshes/0/primitives/-", other);
    let scene = read_json(&file);
    let names: Vec<&str> = scene.scene.surfaces.iter().map(|surface| surface.name.as_str()).collect();
    assert_eq!(names, ["chair wood", "chair default"]);
    assert_eq!(scene.origins[0].part_of_triangle, Some(vec![0, 1]));
    // This one lies in the others and is moved, before which its parts are found.
    assert_eq!(scene.origins[1].part_of_triangle, Some(vec![0]));
    assert_eq!(findings(&scene), [("coincident_sheets", ""), ("not_represented", "/nodes/0")]);
    // The material of primitives without one: glTF's defaults.
    let MaterialModel::Principled { roughness, metallic, .. } = scene.scene.materials[1].model else { panic!() };
    assert_eq!((roughness, metallic), (ScalarInput::Constant(1.0), ScalarInput::Constant(1.0)));
}

/// A mirrored node keeps its front, rotations are normalised, and transforms multiply down the tree.
#[test]
fn transforms() {
    let nodes = json!([
        { "translation": [10, 0, 0], "children": [1] },
        { "name": "chair", "mesh": 0, "scale": [-2, 1, 1], "rotation": [0, 0, 1, 1] },
    ]);
    let scene = read_json(&with("/nodes", nodes));
    let mesh = &scene.scene.surfaces[0].mesh;
    assert_eq!(findings(&scene), []);
    // (1, 0, 0) is scaled to (-2, 0, 0), turned to (0, -2, 0) and moved.
    assert!(mesh.positions.iter().any(|place| (*place - glam::Vec3::new(10.0, -2.0, 0.0)).length() < 1e-5));
    assert!((mesh.geometric_normal(0) - glam::DVec3::Z).length() < 1e-6, "{}", mesh.geometric_normal(0));
}

fn write_png(path: &Path) {
    let texels = [[255, 0, 0, 255], [0, 255, 0, 0], [0, 0, 255, 100], [255, 255, 255, 200]];
    png_io::write_rgba_bytes(path, &Picture::new(2, 2, texels.to_vec()).unwrap()).unwrap();
}

/// A material whose base colour and roughness come from an image beside the file, with a space in its name.
fn textured(extra: Value) -> FileScene {
    let folder = tempfile::tempdir().unwrap();
    write_png(&folder.path().join("a b.png"));
    let pbr = json!({ "baseColorTexture": { "index": 0 }, "metallicRoughnessTexture": { "index": 0 } });
    let mut material = json!({ "pbrMetallicRoughness": pbr });
    for (key, value) in extra.as_object().unwrap() {
        match key.as_str() {
            "pbr" => {
                material["pbrMetallicRoughness"].as_object_mut().unwrap().extend(value.as_object().unwrap().clone())
            }
            _ => material[key] = value.clone(),
        }
    }
    let file = changed(with("/materials/0", material), "/images", json!([{ "uri": "a%20b.png" }]));
    let file = changed(file, "/textures", json!([{ "source": 0, "sampler": 0 }]));
    let file = changed(file, "/samplers", json!([{ "wrapS": 33071, "wrapT": 33071 }]));
    read_bytes_in(folder.path(), file.to_string().as_bytes()).unwrap()
}

#[test]
fn textures_are_colours_and_channels() {
    let scene = textured(json!({}));
    assert_eq!(findings(&scene), []);
    let (ColorInput::Texture { texture: color, .. }, roughness, metallic) = principled(&scene) else { panic!() };
    let ScalarInput::Texture { texture: numbers, channel: 1, .. } = roughness else { panic!("{roughness:?}") };
    let ScalarInput::Texture { texture: same, channel: 2, .. } = metallic else { panic!("{metallic:?}") };
    assert_eq!(numbers, same);
    let textures = &scene.scene.textures;
    assert_eq!(
        (textures[color.0].name.as_str(), textures[color.0].texture.wrap()),
        ("a b.png", mateval_image::Wrap::Clamp)
    );
    assert!(textures[color.0].sha256.is_some() && scene.files.hashes.iter().any(|(file, _)| file == "a b.png"));
    assert_eq!(textures[color.0].texture.texel(0, 0), [1.0, 0.0, 0.0]);
    // Factors multiply linear values.
    let half = textured(json!({ "pbr": { "baseColorFactor": [0.5, 1, 1, 1], "roughnessFactor": 0.25 } }));
    let (ColorInput::Texture { texture, .. }, ScalarInput::Texture { texture: rough, channel: 0, .. }, _) =
        principled(&half)
    else {
        panic!()
    };
    assert_eq!(half.scene.textures[texture.0].texture.texel(1, 1), [0.5, 1.0, 1.0]);
    assert_eq!(half.scene.textures[rough.0].texture.texel(1, 0)[0], 0.25);
}

/// A mesh has one uv: for a texture at another set than the first, its mean stands.
#[test]
fn one_uv_set() {
    let scene = textured(json!({ "pbr": { "metallicRoughnessTexture": { "index": 0, "texCoord": 1 } } }));
    let (ColorInput::Texture { .. }, roughness, _) = principled(&scene) else { panic!() };
    assert_eq!(roughness, ScalarInput::Constant(0.5));
    assert_eq!(findings(&scene), [("not_represented", "/materials/0")]);
}

#[test]
fn alpha_modes() {
    let opacity = |extra: Value| {
        let scene = textured(extra);
        match scene.scene.materials[0].opacity {
            Some(ScalarInput::Texture { texture, .. }) => {
                let texture = &scene.scene.textures[texture.0].texture;
                Some([texture.texel(0, 0)[0], texture.texel(1, 0)[0], texture.texel(0, 1)[0], texture.texel(1, 1)[0]])
            }
            Some(ScalarInput::Constant(value)) => Some([value; 4]),
            None => None,
        }
    };
    assert_eq!(opacity(json!({})), None);
    assert_eq!(opacity(json!({ "alphaMode": "MASK" })), Some([1.0, 0.0, 0.0, 1.0]));
    assert_eq!(opacity(json!({ "alphaMode": "MASK", "alphaCutoff": 0.3 })), Some([1.0, 0.0, 1.0, 1.0]));
    let blend = opacity(json!({ "alphaMode": "BLEND", "pbr": { "baseColorFactor": [1, 1, 1, 0.5] } })).unwrap();
    assert_eq!(blend, [0.5, 0.0, 0.5 * (100.0 / 255.0), 0.5 * (200.0 / 255.0)]);
}

#[test]
fn glass_transmits() {
    let extensions =
        json!({ "KHR_materials_transmission": { "transmissionFactor": 1 }, "KHR_materials_ior": { "ior": 1.33 } });
    let pbr = json!({ "baseColorFactor": [0.9, 1, 1, 1], "roughnessFactor": 0 });
    let scene = read_json(&with("/materials/0", json!({ "pbrMetallicRoughness": pbr, "extensions": extensions })));
    let MaterialModel::ThinDielectric { eta, specular_transmittance, .. } = scene.scene.materials[0].model else {
        panic!()
    };
    assert_eq!((eta, specular_transmittance), (1.33, ColorInput::Constant([0.9, 1.0, 1.0])));
    assert_eq!(findings(&scene), []);
}

#[test]
fn surfaces_that_emit() {
    let material = json!({
        "emissiveFactor": [1, 0.5, 0], "doubleSided": true,
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8 } },
    });
    let scene = read_json(&with("/materials/0", material));
    let expected = Emission::Area {
        surfaces: vec![mateval_dataset::reference::SurfaceIndex(0)],
        radiance: [8.0, 4.0, 0.0],
        map: None,
        two_sided: true,
    };
    assert_eq!((&scene.scene.lights[0].emission, scene.lights), (&expected, SceneLights::Own));
}

/// A file with lights in its nodes 1, 2 and so on.
fn lit(lights: &[Value]) -> Value {
    let mut file = with("/extensions", json!({ "KHR_lights_punctual": { "lights": lights } }));
    for light in 0..lights.len() {
        let node = json!({ "extensions": { "KHR_lights_punctual": { "light": light } }, "translation": [0, 2, 0] });
        file = changed(changed(file, "/nodes/-", node), "/scenes/0/nodes/-", json!(light + 1));
    }
    file
}

/// 683 candela over the whole sphere are 4 pi watts.
#[test]
fn a_point_light_keeps_its_power() {
    let scene = read_json(&lit(&[json!({ "type": "point", "intensity": 683, "color": [1, 0.5, 0] })]));
    let Emission::Area { surfaces, radiance, .. } = &scene.scene.lights[0].emission else { panic!() };
    let area = scene.scene.surfaces[surfaces[0].0].mesh.area();
    for (found, share) in radiance.iter().zip([1.0, 0.5, 0.0]) {
        assert!((PI * area * f64::from(*found) - 4.0 * PI * share).abs() < 1e-4);
    }
    assert!(!scene.scene.lights[0].camera_visible);
    assert!(!scene.scene.materials[scene.scene.surfaces[1].material.0].has_appearance());
}

#[test]
fn lights_are_limited() {
    let lights = vec![json!({ "type": "point", "intensity": 1 }); 20];
    let scene = read_within(&lit(&lights), Limits { lights: 8, ..Limits::default() }).unwrap();
    assert_eq!((scene.scene.lights.len(), scene.scene.surfaces.len()), (8, 9));
    let beyond = scene.findings.iter().find(|finding| finding.message.contains("lights beyond 8"));
    assert!(beyond.unwrap().message.contains("12 times"), "{beyond:?}");
    let names: BTreeSet<_> = scene.scene.lights.iter().map(|light| &light.name).collect();
    assert_eq!(names.len(), 8);
}

#[test]
fn the_first_perspective_camera_counts() {
    let cameras = json!([
        { "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "zfar": 9, "znear": 0.1 } },
        { "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1, "aspectRatio": 2.0 } },
    ]);
    let nodes = json!([
        { "mesh": 0, "children": [1, 2] },
        { "camera": 0 },
        { "camera": 1, "translation": [0, 1, 3], "scale": [2, 2, 2] },
    ]);
    let scene = read_json(&changed(with("/cameras", cameras), "/nodes", nodes));
    let camera = scene.camera.unwrap();
    assert_eq!(camera.position().to_array(), [0.0, 1.0, 3.0]);
    assert_eq!((camera.intrinsics.width, camera.intrinsics.height, scene.aspect), (480, 240, Some(2.0)));
    assert_eq!(findings(&scene), [("not_represented", "/nodes/1")]);
}

/// Each kind is one finding, however often it occurs.
#[test]
fn kinds_are_counted() {
    let extensions = json!({ "KHR_materials_clearcoat": {}, "KHR_materials_sheen": {} });
    let mut file = with("/materials/0", json!({ "name": "a", "extensions": extensions }));
    file = changed(file, "/materials/-", json!({ "extensions": { "KHR_materials_sheen": {} } }));
    file = changed(
        file,
        "/meshes/0/primitives/-",
        json!({ "attributes": { "POSITION": 0 }, "indices": 2, "material": 1 }),
    );
    let scene = read_json(&file);
    let messages: Vec<&str> = scene.findings.iter().map(|finding| finding.message.as_str()).collect();
    assert!(messages.contains(&"KHR_materials_clearcoat: not represented"), "{messages:?}");
    assert!(messages.contains(&"KHR_materials_sheen: not represented (2 times; the first is named)"), "{messages:?}");
}

#[test]
fn required_extensions_are_refused_by_name() {
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu", "ACME_new"] {
        let error = error_of(&with("/extensionsRequired", json!([name])));
        assert!(error.contains("room.gltf") && error.contains(&format!("/extensionsRequired: '{name}'")), "{error}");
    }
    let known = with("/extensionsRequired", json!(["KHR_texture_transform", "KHR_lights_punctual"]));
    assert_eq!(findings(&read_json(&known)), []);
    let ktx2 = error_of(&with("/extensionsRequired", json!(["KHR_texture_basisu"])));
    assert!(ktx2.contains("ktxdecompress"), "{ktx2}");
}

#[test]
fn circles_end() {
    let nodes = json!([{ "mesh": 0, "children": [1] }, { "children": [0, 1] }]);
    let scene = read_json(&with("/nodes", nodes));
    assert_eq!(
        (scene.scene.surfaces.len(), findings(&scene).as_slice()),
        (1, &[("not_a_tree", "/nodes/0"), ("not_a_tree", "/nodes/1")][..])
    );
}

#[test]
fn missing_files_have_a_pointer() {
    for uri in ["none.bin", "../secret.bin", "/etc/passwd", "data:text/plain,hello", "data:;base64,@@@"] {
        let error = error_of(&with("/buffers/0/uri", json!(uri)));
        assert!(error.contains("room.gltf") && error.contains("/buffers/0/uri: "), "{error}");
    }
    let mut none = triangle();
    none["buffers"][0].as_object_mut().unwrap().remove("uri");
    assert!(error_of(&none).contains("/buffers/0: expected a `uri`"));
    // A missing image is replaced.
    let pbr = json!({ "baseColorTexture": { "index": 0 } });
    let mut file =
        changed(with("/materials/0", json!({ "pbrMetallicRoughness": pbr })), "/textures", json!([{ "source": 0 }]));
    for uri in ["none.png", "../secret.png", "room.gltf"] {
        file = changed(file, "/images", json!([{ "uri": uri }]));
        let scene = read_json(&file);
        assert_eq!(findings(&scene).iter().map(|finding| finding.1).collect::<Vec<_>>(), ["/images/0"], "{uri}");
        assert_eq!(principled(&scene).0, ColorInput::Constant([0.5; 3]));
    }
}

/// What a texture that was not read would state is unstated; a factor of 0 is a value whatever the texture holds.
#[test]
fn parameters_of_unread_textures_are_unstated() {
    let stated = |material: Value, texture: Value, uri: &str| {
        let file = changed(with("/materials/0", material), "/images", json!([{ "uri": uri }]));
        let scene = read_json(&changed(file, "/textures", json!([texture])));
        let stated = scene.origins[0].stated;
        [stated.base_color, stated.roughness, stated.metallic, stated.emission]
    };
    let info = json!({ "index": 0 });
    let base = json!({ "pbrMetallicRoughness": {
        "baseColorTexture": info, "baseColorFactor": [1, 1, 1, 1], "roughnessFactor": 0.5, "metallicFactor": 0,
    } });
    let numbers = json!({
        "pbrMetallicRoughness": { "baseColorFactor": [1, 1, 1, 1], "metallicRoughnessTexture": info, "metallicFactor": 0 },
    });
    let emissive = json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": info });
    let specular = |key: &str| {
        let factors = json!({
            key: info, "diffuseFactor": [1, 1, 1, 1], "specularFactor": [0, 0, 0], "glossinessFactor": 0.5,
        });
        json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": factors } })
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    write_png(&path);
    let png = std::fs::read(&path).unwrap();
    let pointer = b"version https://git-lfs.github.com/spec/v1\n".as_slice();
    let faulty = [pointer, b"garbage", &png[..png.len() / 2], b"\xabKTX 20\xbb\r\n\x1a\n"].map(data_uri);
    let (named, unnamed) = (json!({ "source": 0 }), json!({}));
    let mut read: Vec<(Value, &str)> = faulty.iter().map(|uri| (named.clone(), uri.as_str())).collect();
    read.push((unnamed, "a.png"));
    for (texture, uri) in read {
        let of = |material: &Value| stated(material.clone(), texture.clone(), uri);
        assert_eq!(of(&base), [false, true, true, false], "{uri}");
        assert_eq!(of(&numbers), [true, false, true, false], "{uri}");
        assert_eq!(of(&emissive), [false; 4], "{uri}");
        assert_eq!(of(&specular("diffuseTexture")), [false, true, false, false], "{uri}");
        assert_eq!(of(&specular("specularGlossinessTexture")), [false; 4], "{uri}");
    }
    let sound = data_uri(&png);
    let of = |material: &Value| stated(material.clone(), named.clone(), &sound);
    assert_eq!(of(&base), [true, true, true, false]);
    assert_eq!(of(&emissive), [false, false, false, true]);
    assert_eq!(of(&specular("specularGlossinessTexture")), [true, true, true, false]);
}

/// Meshes that exist in a compressed form alone are refused, though the file does not require the extension.
#[test]
fn compressed_meshes_are_refused_by_name() {
    let draco = json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": { "POSITION": 0 } } });
    let mut file = with("/meshes/0/primitives/0/extensions", draco);
    // With uncompressed data beside it, it is read.
    assert_eq!(read_json(&file).scene.surfaces.len(), 1);
    for accessor in file["accessors"].as_array_mut().unwrap() {
        let accessor = accessor.as_object_mut().unwrap();
        accessor.remove("bufferView");
        accessor.remove("byteOffset");
    }
    let error = error_of(&file);
    assert!(error.contains("/meshes/0/primitives/0: ") && error.contains("KHR_draco_mesh_compression"), "{error}");
    assert!(error.contains("without compression"), "{error}");
    let meshopt = json!({ "EXT_meshopt_compression": { "buffer": 0, "byteLength": 60, "byteStride": 12, "count": 5 } });
    let file = with("/bufferViews/0/extensions", meshopt);
    assert_eq!(read_json(&file).scene.surfaces.len(), 1);
    let file = changed(file, "/buffers/-", json!({ "byteLength": 60 }));
    let error = error_of(&changed(file, "/bufferViews/0/buffer", json!(1)));
    assert!(error.contains("/bufferViews/0: ") && error.contains("EXT_meshopt_compression"), "{error}");
}

/// Instances without a place are a finding, and those that name no accessor an error: the mesh does not just vanish.
#[test]
fn instances_do_not_vanish() {
    let file = |attributes: Value| {
        with("/nodes/0/extensions", json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } }))
    };
    for index in [json!(99), json!(-1), json!("a")] {
        let error = error_of(&file(json!({ "TRANSLATION": index })));
        assert!(error.contains("/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes/TRANSLATION: "), "{error}");
    }
    assert_eq!(findings(&read_json(&file(json!({})))), [("bad_instances", "/nodes/0")]);
    assert_eq!(read_json(&file(json!({ "TRANSLATION": 0 }))).scene.surfaces.len(), 3);
}

/// Faults of a primitive leave the rest of the scene whole.
#[test]
fn faulty_primitives_are_left_out() {
    let faults = [
        ("/accessors/2/count", json!(9_000_000), "reaches outside its buffer"),
        ("/accessors/2/count", json!(900_000_000), "more than 20000000 triangles"),
        ("/accessors/2/count", json!(2), "too few"),
        ("/accessors/2/type", json!("VEC2"), "expected one index"),
        ("/accessors/2/componentType", json!(5126), "expected indices"),
        ("/accessors/0/byteOffset", json!(40), "reaches outside its buffer"),
        ("/bufferViews/0/byteLength", json!(1_u64 << 40), "reaches outside its buffer"),
        ("/accessors/1/type", json!("SCALAR"), "expected 2 numbers an entry"),
    ];
    for (pointer, value, message) in faults {
        let scene = read_json(&with(pointer, value));
        let found = scene.findings.iter().find(|finding| finding.place == "/meshes/0/primitives/0");
        let found = found.unwrap_or_else(|| panic!("{pointer}: {:?}", scene.findings));
        assert!(found.message.contains(message), "{pointer}: {}", found.message);
        assert!(scene.scene.surfaces.is_empty(), "{pointer}");
    }
    // An attribute of another length is absent, and the rest stays.
    let scene = read_json(&with("/accessors/1/count", json!(2)));
    assert!(scene.findings.iter().any(|finding| finding.code == "bad_attribute"), "{:?}", scene.findings);
    assert_eq!(scene.scene.surfaces.len(), 1);
    let mut bytes = triangle_bytes();
    bytes[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let scene = read_json(&with("/buffers/0/uri", json!(data_uri(&bytes))));
    assert!(scene.findings.iter().any(|finding| finding.message.contains("not finite")), "{:?}", scene.findings);
    bytes = triangle_bytes();
    bytes[60] = 7;
    let scene = read_json(&with("/buffers/0/uri", json!(data_uri(&bytes))));
    assert!(
        scene.findings.iter().any(|finding| finding.message.contains("name vertices that do not exist")),
        "{:?}",
        scene.findings
    );
}

#[test]
fn invalid_indices_are_errors_with_a_pointer() {
    for (pointer, value, place) in [
        ("/nodes/0/mesh", json!(9), "/nodes/0/mesh: "),
        ("/scenes/0/nodes", json!([9]), "/scenes/0/nodes/0: "),
        ("/bufferViews/0/buffer", json!(9), "/bufferViews/0/buffer: "),
    ] {
        let error = error_of(&with(pointer, value));
        assert!(error.contains(place), "{error}");
    }
    assert!(error_of(&with("/scenes", json!([]))).contains("/scene"), "{}", error_of(&with("/scenes", json!([]))));
}

/// JSON whose parsed form would be huge, before it is parsed.
#[test]
fn large_json_is_refused() {
    let limits = Limits { json_containers: 99, ..Limits::default() };
    let error = read_within(&with("/nodes", json!(vec![json!({}); 100])), limits).unwrap_err().to_string();
    assert!(error.contains("99 lists and objects"), "{error}");
}

/// Meshes that many nodes show count for each of them, before they are read.
#[test]
fn copies_count() {
    let nodes: Vec<Value> = (0..50).map(|_| json!({ "mesh": 0 })).collect();
    let file = changed(with("/nodes", json!(nodes)), "/scenes/0/nodes", json!((0..50).collect::<Vec<_>>()));
    let scene = read_within(&file, Limits { triangles: 20, primitives: 30, ..Limits::default() }).unwrap();
    assert_eq!(scene.scene.surfaces.len(), 20);
    let beyond = scene.findings.iter().find(|finding| finding.message.contains("primitives beyond 30"));
    assert!(beyond.is_some_and(|finding| finding.severity == Severity::Warning), "{:?}", scene.findings);
}

/// Damaged bytes cause no panic.
#[test]
fn damage_is_an_error_or_another_scene() {
    let sound =
        glb(&lit(&[json!({ "type": "spot", "spot": {} }), json!({ "type": "directional" })]), &triangle_bytes());
    let places = (0..sound.len()).step_by(3);
    let is_refused = |at: &usize| {
        let mut damaged = sound.clone();
        damaged[*at] = b'9';
        read_bytes(&damaged).is_err()
    };
    let (count, refused) = (places.len(), places.filter(is_refused).count());
    assert!(refused > count / 4, "{refused} of {count}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Any numbers in a node's transform, a light and a texture transform give a scene of finite numbers.
    #[test]
    fn numbers_stay_finite(values in prop::collection::vec(prop::num::f64::ANY, 14)) {
        let number = |at: usize| if values[at].is_finite() { json!(values[at]) } else { json!(0.0) };
        let light = json!({ "type": "point", "intensity": number(0), "color": [number(1), 1, 1] });
        let mut file = lit(&[light, json!({ "type": "directional", "intensity": number(2) })]);
        file = changed(file, "/nodes/0/rotation", json!([number(3), number(4), number(5), number(6)]));
        file = changed(file, "/nodes/0/scale", json!([number(7), number(8), number(9)]));
        file = changed(file, "/nodes/1/translation", json!([number(10), number(11), number(12)]));
        if let Ok(scene) = read_bytes(file.to_string().as_bytes()) {
            for surface in &scene.scene.surfaces {
                prop_assert!(surface.mesh.positions.iter().all(|place| place.is_finite()));
            }
            for light in &scene.scene.lights {
                if let Emission::Area { radiance, .. } = &light.emission {
                    prop_assert!(radiance.iter().all(|value| value.is_finite() && *value >= 0.0));
                }
            }
        }
    }
}

/// Far from the origin, the scene is moved by whole metres and keeps its shape; near it, nothing changes.
#[test]
fn far_scenes_are_moved_by_whole_metres() {
    let lens = json!([{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.01, "aspectRatio": 1.5 } }]);
    let at = |place: [f64; 3]| {
        let camera = json!({ "camera": 0, "translation": [0.25, 1.5, 3.0] });
        let chair = json!({ "name": "chair", "mesh": 0, "translation": [0.5, 0.25, -1.0] });
        let nodes = json!([{ "translation": place, "children": [1, 2] }, chair, camera]);
        read_json(&changed(with("/nodes", nodes), "/cameras", lens.clone()))
    };
    let (near, far) = (at([0.0; 3]), at([448_231.25, 120.125, -354_123.5]));
    assert_eq!((near.shift_m, far.shift_m), (DVec3::ZERO, DVec3::new(448_232.0, 122.0, -354_121.0)));
    let moved = near.camera.unwrap().position() - far.camera.unwrap().position();
    for (near, far) in near.scene.surfaces.iter().zip(&far.scene.surfaces) {
        for (near, far) in near.mesh.positions.iter().zip(&far.mesh.positions) {
            assert!((near.as_dvec3() - far.as_dvec3() - moved).length() < 1e-6);
        }
    }
    assert_eq!(findings(&far), [("far_from_origin", "")]);
}

/// Two copies, one turned by 90 degrees about Z and one twice as large.
#[test]
fn gpu_instances_are_placed() {
    let (half, mut bytes) = (std::f32::consts::FRAC_1_SQRT_2, triangle_bytes());
    let start = bytes.len();
    let rows = [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]].concat();
    let turns = [[0.0, 0.0, half, half], [0.0, 0.0, 0.0, 1.0]].concat();
    let scales = [[1.0_f32; 3], [2.0; 3]].concat();
    bytes.extend([rows, turns, scales].concat().iter().flat_map(|value: &f32| value.to_le_bytes()));
    let extension = json!({ "attributes": { "TRANSLATION": 3, "ROTATION": 4, "SCALE": 5 } });
    let mut file = with("/buffers/0", json!({ "byteLength": bytes.len(), "uri": data_uri(&bytes) }));
    for (offset, size, kind) in [(0, 24, "VEC3"), (24, 32, "VEC4"), (56, 24, "VEC3")] {
        let view = json!({ "buffer": 0, "byteOffset": start + offset, "byteLength": size });
        file["bufferViews"].as_array_mut().unwrap().push(view);
        let view = file["bufferViews"].as_array().unwrap().len() - 1;
        let accessor = json!({ "bufferView": view, "componentType": 5126, "count": 2, "type": kind });
        file["accessors"].as_array_mut().unwrap().push(accessor);
    }
    file["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": extension });
    let scene = read_json(&changed(file, "/extensionsRequired", json!(["EXT_mesh_gpu_instancing"])));
    assert_eq!((scene.scene.surfaces.len(), findings(&scene).len()), (2, 0), "{:?}", scene.findings);
    let [turned, large] = [0, 1].map(|at| scene.scene.surfaces[at].mesh.clone());
    assert!((turned.area() * 4.0 - large.area()).abs() < 1e-5);
    assert!(large.positions.iter().all(|place| place.x > 4.0 - 1e-5));
}

/// A tile 5 mm before a wall, 571 km from the origin: 32 bits are 31 mm apart there.
#[test]
fn nodes_that_each_lie_far_keep_their_distance() {
    let matrix = |z: f64| json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 448231.137, 120.271, z, 1]);
    for by_matrix in [false, true] {
        let node = |name: &str, z: f64| match by_matrix {
            true => json!({ "name": name, "mesh": 0, "matrix": matrix(z) }),
            false => json!({ "name": name, "mesh": 0, "translation": [448231.137, 120.271, z] }),
        };
        let mut file = triangle();
        file["nodes"] = json!([node("wall", -354123.613), node("tile", -354123.608),
            { "camera": 0, "translation": [448231.137, 120.271, -354120.613] }]);
        file["scenes"] = json!([{ "nodes": [0, 1, 2] }]);
        file["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }]);
        let scene = read_json(&file);
        let z = |at: usize| scene.scene.surfaces[at].mesh.positions[0].z;
        assert!((z(1) - z(0) - 0.005).abs() < 1e-6, "{} {}", z(0), z(1));
        let distance = scene.camera.unwrap().position() - scene.scene.surfaces[0].mesh.positions[0].as_dvec3();
        assert!((distance - DVec3::new(0.0, 0.0, 3.0)).length() < 1e-6, "{distance}");
    }
}

#[test]
fn a_projection_leaves_its_node_out_and_noise_does_not() {
    let row = |a: f64, w: f64| json!([1, 0, 0, a, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, w]);
    let with_row = |a: f64, w: f64| read_json(&with("/nodes/0/matrix", row(a, w)));
    for (a, w) in [(0.2, 1.0), (0.0, 1.5), (1e-5, 1.0)] {
        let scene = with_row(a, w);
        let is_named = scene.findings.iter().any(|found| found.code == "bad_transform" && found.place == "/nodes/0");
        assert!(is_named && scene.scene.surfaces.is_empty());
    }
    let scene = with_row(-5.9e-8, 1.0000001);
    assert_eq!(scene.scene.surfaces[0].mesh.positions, read_json(&triangle()).scene.surfaces[0].mesh.positions);
}

#[test]
fn colours_that_may_be_baked_to_emission_are_named() {
    let emitting = |pbr: Value| {
        let folder = tempfile::tempdir().unwrap();
        png_io::write_rgb_bytes(&folder.path().join("t.png"), &Picture::filled(2, 2, [200, 60, 40])).unwrap();
        let mut file = with(
            "/materials/0",
            json!({ "pbrMetallicRoughness": pbr, "emissiveFactor": [1, 1, 1],
            "emissiveTexture": { "index": 0 } }),
        );
        (file["textures"], file["images"]) = (json!([{ "source": 0 }]), json!([{ "uri": "t.png" }]));
        let scene = read_bytes_in(folder.path(), file.to_string().as_bytes()).unwrap();
        scene.findings.iter().any(|found| found.code == "only_emission")
    };
    assert!(emitting(json!({})) && emitting(json!({ "baseColorFactor": [0, 0, 0, 1] })));
    assert!(!emitting(json!({ "baseColorFactor": [0.5, 0.5, 0.5, 1] })));
}

/// A triangle whose vertices have these colours.
fn painted(colors: [f32; 9]) -> Value {
    let bytes: Vec<u8> = colors.iter().flat_map(|value| value.to_le_bytes()).collect();
    let mut file = with("/meshes/0/primitives/0/attributes/COLOR_0", json!(3));
    let mut append = |key: &str, value: Value| file[key].as_array_mut().expect("a list").push(value);
    append("buffers", json!({ "byteLength": 36, "uri": data_uri(&bytes) }));
    append("bufferViews", json!({ "buffer": 1, "byteLength": 36 }));
    append("accessors", json!({ "bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3" }));
    file["materials"][0]["pbrMetallicRoughness"] = json!({ "baseColorFactor": [1, 1, 1, 1] });
    file
}

#[test]
fn what_multiplies_or_exceeds_a_base_colour_unstates_it() {
    let states = |file: &Value| read_json(file).origins[0].stated.base_color;
    assert!(!states(&painted([0.5; 9])));
    assert!(states(&painted([1.0; 9])), "its twin: white for all vertices");
    let factor = |factor: Value| with("/materials/0/pbrMetallicRoughness", json!({ "baseColorFactor": factor }));
    assert!(!states(&factor(json!([200, 100, 50, 1]))) && !states(&factor(json!([0.5, -0.2, 0, 1]))));
    assert!(states(&factor(json!([1.0000001, 0.5, 0, 1]))));
}

/// Every value that the reader uses in place of what it cannot read, a file that makes it do so, and the code of the
/// finding that says so.
fn fallbacks() -> Vec<(&'static str, Value, &'static str)> {
    let material = |key: &str, value: Value| with("/materials/0", json!({ "pbrMetallicRoughness": {}, key: value }));
    let camera_of = |aspect: Value, yfov: f64| {
        let mut file = with("/nodes/0/camera", json!(0));
        file["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": yfov, "znear": 0.1 } }]);
        if !aspect.is_null() {
            file["cameras"][0]["perspective"]["aspectRatio"] = aspect;
        }
        file
    };
    let camera = |aspect: Value| camera_of(aspect, 1.0);
    let textured = |texture: Value| {
        let mut file = with("/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": 0 }));
        (file["textures"], file["images"]) = (json!([texture]), json!([{ "uri": "none.png" }]));
        file
    };
    let mut no_uv = textured(json!({ "source": 0 }));
    no_uv["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": 0 });
    vec![
        ("linear mid-grey", textured(json!({ "source": 0 })), "missing_file"),
        ("the factor alone", textured(json!({})), "not_represented"),
        ("mid-grey where the texture has no place either", no_uv, "missing_file"),
        ("no rotation", with("/nodes/0/rotation", json!([0, 0, 0, 0])), "bad_value"),
        ("the other triangles", with("/accessors/2/count", json!(2)), "bad_indices"),
        ("no texture coordinates", with("/accessors/1/count", json!(2)), "bad_attribute"),
        ("an index of 1.5", material("extensions", json!({ "KHR_materials_ior": { "ior": 9.0 } })), "not_represented"),
        (
            "an opaque surface",
            material("extensions", json!({ "KHR_materials_transmission": { "transmissionFactor": 0.2 } })),
            "not_represented",
        ),
        ("radiance 1 from outside", with("/asset/generator", json!("x")), "no_light"),
        ("16 to 9, or the recipe's resolution, for a picture", camera(json!(null)), "no_aspect_ratio"),
        ("no camera of a field of view in degrees", camera_of(json!(1.5), 55.0), "bad_value"),
        ("the same for width over height of 0", camera(json!(0)), "no_aspect_ratio"),
        (
            "a clamped factor",
            material("pbrMetallicRoughness", json!({ "baseColorFactor": [200, 100, 50, 1] })),
            "out_of_range",
        ),
        ("a clamped roughness", material("pbrMetallicRoughness", json!({ "roughnessFactor": 30 })), "out_of_range"),
        ("no colours of vertices", painted([0.5; 9]), "not_represented"),
        (
            "no normal map",
            {
                let mut file = with("/materials/0/normalTexture", json!({ "index": 0 }));
                (file["textures"], file["images"]) = (json!([{ "source": 0 }]), json!([{ "uri": "none.png" }]));
                file
            },
            "not_represented",
        ),
        (
            "a node left out",
            with("/nodes/0/matrix", json!([1, 0, 0, 0.2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])),
            "bad_transform",
        ),
    ]
}

#[test]
fn each_fallback_is_a_finding() {
    for (value, input, code) in fallbacks() {
        let findings = read_json(&input).findings;
        assert!(findings.iter().any(|finding| finding.code == code), "{value}: {findings:?}");
    }
    // The default of the format for a base colour is marked, since the reader does not know its share of the
    // picture.
    let scene = read_json(&with("/asset/generator", json!("x")));
    assert!(!scene.origins[0].stated.base_color && scene.origins[0].stated.roughness);
}
