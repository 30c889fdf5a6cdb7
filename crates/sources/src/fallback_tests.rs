//! The fallback values of all readers, in one place: each is a finding, or marks the base colour as unstated, which
//! `prep build` reports and refuses beyond a small share. A reader that gets another fallback value gets a line here.

use mateval_dataset::{Finding, Severity};
use serde_json::{Value, json};

use crate::bitterli::tests::{read_inner, read_xml};
use crate::front3d::tests::house_findings;
use crate::gltf::tests::{read_json, with};

/// What a reader uses in place of what it cannot read, an input that makes it do so, and the finding that says so.
struct Fallback<I> {
    value: &'static str,
    input: I,
    code: &'static str,
}

fn fallback<I>(value: &'static str, input: I, code: &'static str) -> Fallback<I> {
    Fallback { value, input, code }
}

/// Of the reader of Mitsuba scenes. The input stands in a scene with a sensor.
fn of_mitsuba() -> Vec<Fallback<String>> {
    let in_cube = |inner: &str| format!("<shape type='cube'>{inner}</shape>");
    let bsdf = |kind: &str, inner: &str| in_cube(&format!("<bsdf type='{kind}'>{inner}</bsdf>"));
    let color = |name: &str, value: &str| bsdf("diffuse", &format!("<rgb name='{name}' value='{value}'/>"));
    let string = |name: &str, value: &str| format!("<string name='{name}' value='{value}'/>");
    let bitmap = |file: &str, extra: &str| {
        let file = string("filename", file);
        bsdf("diffuse", &format!("<texture name='reflectance' type='bitmap'>{file}{extra}</texture>"))
    };
    let checkerboard = bsdf("diffuse", "<texture name='reflectance' type='checkerboard'/>");
    let anisotropic = "<float name='alpha_u' value='0.1'/><float name='alpha_v' value='0.4'/>";
    let obj = "<shape type='obj'><string name='filename' value='plain.obj'/>";
    let without_uv = bitmap("a b.png", "").replace("<shape type='cube'>", obj);
    let blend = bsdf("blendbsdf", "<bsdf type='diffuse'/><bsdf type='plastic'/>");
    let clearcoat = bsdf("principled", "<float name='clearcoat' value='1'/>");
    let environment = format!("<emitter type='envmap'>{}</emitter>", string("filename", "none.exr"));
    let low_sun = "<emitter type='sky'><vector name='sunDirection' value='0 -1 0'/></emitter>";
    let bright = "<emitter type='area'><rgb name='radiance' value='bright'/></emitter>";
    vec![
        fallback("diffuse grey 0.5", in_cube(""), "no_bsdf"),
        fallback("diffuse grey 0.5", bsdf("velvet", ""), "unknown_plugin"),
        fallback("diffuse grey 0.5", bsdf("twosided", ""), "missing_child"),
        fallback("linear mid-grey", bitmap("none.png", ""), "missing_file"),
        fallback("linear mid-grey", checkerboard, "unknown_plugin"),
        fallback("the plugin's default colour", color("reflectance", "red"), "bad_value"),
        fallback("the plugin's default colour, for one out of range", color("reflectance", "3"), "out_of_range"),
        fallback("the plugin's default colour, for an unknown name", color("reflectence", "0.2"), "unknown_parameter"),
        fallback("the texture's colour as it is, of another range", bitmap("bytes.exr", ""), "out_of_range"),
        fallback("the colour of the first of two", blend, "unsupported"),
        fallback("beckmann", bsdf("roughplastic", &string("distribution", "phong")), "unsupported"),
        fallback(
            "the default metal's colour",
            bsdf("conductor", &string("material", "Unobtainium")),
            "unknown_material",
        ),
        fallback("no shape", in_cube("<transform name='to_world'><matrix value='1'/></transform>"), "bad_transform"),
        fallback("no light", environment, "missing_file"),
        fallback("no light", "<emitter type='point'/>".into(), "unknown_plugin"),
        fallback("the first of two environments", "<emitter type='constant'/>".repeat(2), "unsupported"),
        fallback("the sun 45 degrees high", "<emitter type='sky'/>".into(), "sun_by_time"),
        fallback("the sun at the horizon", low_sun.into(), "out_of_range"),
        fallback("radiance 1", in_cube(bright), "bad_value"),
        fallback("the geometric mean of both", bsdf("roughconductor", anisotropic), "unsupported"),
        fallback("0 for what the principled model lacks", clearcoat, "unsupported"),
        fallback("no bumps", bsdf("bumpmap", "<bsdf type='diffuse'/>"), "missing_child"),
        fallback("the mode of u", bitmap("a b.png", &string("wrap_mode_v", "clamp")), "unsupported"),
        fallback("all channels", bitmap("a b.png", &string("channel", "r")), "unsupported"),
        fallback("all channels, for an unknown one", bitmap("a b.png", &string("channel", "z")), "bad_value"),
        fallback("the text of an unknown variable", color("reflectance", "$none"), "unknown_variable"),
        fallback("no reference", in_cube("<ref id='nobody'/>"), "unknown_id"),
        fallback("no medium", "<medium type='homogeneous'/>".into(), "unsupported"),
        fallback("barycentric coordinates", without_uv, "no_uv"),
    ]
}

#[test]
fn each_of_mitsuba_is_a_finding_and_the_rest_is_read() {
    for Fallback { value, input, code } in of_mitsuba() {
        let scene = read_inner(&format!("{input}<shape type='rectangle' id='rest'><bsdf type='diffuse'/></shape>"));
        // Nothing is lost: this grey is Mitsuba's own default.
        let severity = if code == "no_bsdf" { Severity::Note } else { Severity::Warning };
        let is_expected = |finding: &Finding| finding.code == code && finding.severity == severity;
        assert!(scene.findings.iter().any(is_expected), "{value}: {input}: {:?}", scene.findings);
        assert_eq!(scene.scene.surfaces.last().map(|s| s.name.as_str()), Some("rest"), "{input}");
        // A colour that nobody states must not count as stated.
        if value.contains("grey") || value.contains("colour") {
            assert!(scene.origins.iter().any(|origin| !origin.stated.base_color), "{input}");
        }
    }
    let without = "<scene version='3.0.0'><sensor type='perspective'/></scene>";
    let codes = |text: &str| -> Vec<String> {
        read_xml(text).unwrap().findings.into_iter().map(|finding| finding.code).collect()
    };
    assert!(codes(without).contains(&"no_field_of_view".to_owned()));
    assert!(codes(&without.replace("3.0.0", "9")).contains(&"unknown_version".to_owned()));
    for (sensor, code) in [
        ("<sensor type='thinlens'><float name='fov' value='9'/></sensor>", "unsupported"),
        ("<sensor type='perspective'><float name='fov' value='wide'/></sensor>", "bad_value"),
        (
            "<sensor type='perspective'><float name='fov' value='9'/><string name='fov_axis' value='w'/></sensor>",
            "bad_value",
        ),
        (
            "<sensor type='perspective'><float name='fov' value='9'/><film type='hdrfilm'><integer name='width' value='none'/></film></sensor>",
            "bad_value",
        ),
    ] {
        let found = codes(&format!("<scene version='3.0.0'>{sensor}</scene>"));
        assert!(found.contains(&code.to_owned()), "{sensor}: {found:?}");
    }
}

/// A triangle whose vertices have these colours.
fn painted(colors: [f32; 9]) -> Value {
    let bytes: Vec<u8> = colors.iter().flat_map(|value| value.to_le_bytes()).collect();
    let mut file = with("/meshes/0/primitives/0/attributes/COLOR_0", json!(3));
    let uri = format!("data:application/octet-stream;base64,{}", base64::encode(bytes));
    let mut append = |key: &str, value: Value| file[key].as_array_mut().expect("a list").push(value);
    append("buffers", json!({ "byteLength": 36, "uri": uri }));
    append("bufferViews", json!({ "buffer": 1, "byteLength": 36 }));
    append("accessors", json!({ "bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3" }));
    file["materials"][0]["pbrMetallicRoughness"] = json!({ "baseColorFactor": [1, 1, 1, 1] });
    file
}

#[test]
fn what_multiplies_or_exceeds_a_base_colour_of_gltf_unstates_it() {
    let states = |file: &Value| read_json(file).origins[0].stated.base_color;
    assert!(!states(&painted([0.5; 9])));
    assert!(states(&painted([1.0; 9])), "its twin: white for all vertices");
    let factor = |factor: Value| with("/materials/0/pbrMetallicRoughness", json!({ "baseColorFactor": factor }));
    assert!(!states(&factor(json!([200, 100, 50, 1]))) && !states(&factor(json!([0.5, -0.2, 0, 1]))));
    assert!(states(&factor(json!([1.0000001, 0.5, 0, 1]))));
}

/// Of the reader of glTF: a changed file.
fn of_gltf() -> Vec<Fallback<Value>> {
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
        fallback("linear mid-grey", textured(json!({ "source": 0 })), "missing_file"),
        fallback("the factor alone", textured(json!({})), "not_represented"),
        fallback("mid-grey where the texture has no place either", no_uv, "missing_file"),
        fallback("no rotation", with("/nodes/0/rotation", json!([0, 0, 0, 0])), "bad_value"),
        fallback("the other triangles", with("/accessors/2/count", json!(2)), "bad_indices"),
        fallback("no texture coordinates", with("/accessors/1/count", json!(2)), "bad_attribute"),
        fallback(
            "an index of 1.5",
            material("extensions", json!({ "KHR_materials_ior": { "ior": 9.0 } })),
            "not_represented",
        ),
        fallback(
            "an opaque surface",
            material("extensions", json!({ "KHR_materials_transmission": { "transmissionFactor": 0.2 } })),
            "not_represented",
        ),
        fallback("radiance 1 from outside", with("/asset/generator", json!("x")), "no_light"),
        fallback("16 to 9, or the recipe's resolution, for a picture", camera(json!(null)), "no_aspect_ratio"),
        fallback("no camera of a field of view in degrees", camera_of(json!(1.5), 55.0), "bad_value"),
        fallback("the same for width over height of 0", camera(json!(0)), "no_aspect_ratio"),
        fallback(
            "a clamped factor",
            material("pbrMetallicRoughness", json!({ "baseColorFactor": [200, 100, 50, 1] })),
            "out_of_range",
        ),
        fallback(
            "a clamped roughness",
            material("pbrMetallicRoughness", json!({ "roughnessFactor": 30 })),
            "out_of_range",
        ),
        fallback("no colours of vertices", painted([0.5; 9]), "not_represented"),
        fallback(
            "no normal map",
            {
                let mut file = with("/materials/0/normalTexture", json!({ "index": 0 }));
                (file["textures"], file["images"]) = (json!([{ "source": 0 }]), json!([{ "uri": "none.png" }]));
                file
            },
            "not_represented",
        ),
        fallback(
            "a node left out",
            with("/nodes/0/matrix", json!([1, 0, 0, 0.2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])),
            "bad_transform",
        ),
    ]
}

#[test]
fn each_of_gltf_is_a_finding() {
    for Fallback { value, input, code } in of_gltf() {
        let findings = read_json(&input).findings;
        assert!(findings.iter().any(|finding| finding.code == code), "{value}: {findings:?}");
    }
    // The default of the format for a base colour is marked, since the reader does not know its share of the
    // picture.
    let scene = read_json(&with("/asset/generator", json!("x")));
    assert!(!scene.origins[0].stated.base_color && scene.origins[0].stated.roughness);
}

/// Of the reader of 3D-FRONT houses: a change of a small house.
#[test]
fn each_of_3d_front_is_a_finding() {
    for Fallback { value, input: (pointer, changed), code } in [
        fallback("white", ("/material/0/color", json!("red")), "bad_color"),
        fallback("mid-grey", ("/mesh/0/material", json!("nobody")), "no_material"),
        fallback("white", ("/material/0/color", json!([1, 1, 1])), "bad_color"),
        fallback("no mesh", ("/scene/room/0/children/0/ref", json!("nobody")), "dangling_ref"),
        fallback("no numbers", ("/mesh/0/xyz", json!("0 0 0")), "bad_number"),
        fallback("no record", ("/mesh/0/uid", json!(null)), "no_uid"),
        fallback("no texture coordinates", ("/mesh/0/uv", json!(["a"])), "bad_uv"),
        fallback("geometric normals", ("/mesh/0/normal", json!("x")), "bad_normals"),
        fallback("the other triangles", ("/mesh/0/faces/0", json!(99)), "bad_faces"),
        fallback("no rotation", ("/scene/room/0/children/0/rot", json!("x")), "bad_placement"),
        fallback("the origin", ("/scene/room/0/children/0/pos", json!([1e30, 0, 0])), "bad_placement"),
        fallback("the identity", ("/material/0/UVTransform", json!([1])), "bad_uv_transform"),
    ] {
        let codes = house_findings(pointer, changed);
        assert!(codes.contains(&code.to_owned()), "{value}: {pointer}: {codes:?}");
    }
    assert_eq!(house_findings("/uid", json!("x")), [""; 0], "the house itself is sound");
}
