//! Tests on whole scenes, built here, with and without faults, and on real ones from the shared data.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_dataset::material::{ColorInput, ConductorIor, MaterialModel, ScalarInput, TextureIndex, UvTransform};
use mateval_dataset::reference::{Emission, EmissionMap, SurfaceIndex};
use mateval_dataset::{Finding, Severity, obj};
use mateval_image::{LinearRgb, Picture, Texels, exr_io};
use mateval_testkit::{kept_folder, shared_data};
use proptest::prelude::*;

use super::*;

const SENSOR: &str = "<sensor type='perspective'><float name='fov' value='60'/></sensor>";
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n";

/// A 2x2 sRGB PNG: red, green; blue, white.
fn write_png(path: &Path) {
    let bytes = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]];
    let picture = mateval_image::Picture::new(2, 2, bytes.to_vec()).unwrap();
    mateval_image::png_io::write_rgb_bytes(path, &picture).unwrap();
}

fn write_scene(folder: &Path, xml: &str) {
    std::fs::write(folder.join("scene.xml"), xml).unwrap();
    std::fs::create_dir(folder.join("models")).unwrap();
    std::fs::write(folder.join("models/a b.obj"), TRIANGLE).unwrap();
    std::fs::write(folder.join("plain.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    write_png(&folder.join("a b.png"));
    let bytes = Picture::from_fn(2, 1, |x, _| LinearRgb([55.0 * x as f32, 200.0, 9.0]));
    exr_io::write_linear(&folder.join("bytes.exr"), &bytes, exr_io::Precision::Float).unwrap();
}

fn folder_with(xml: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path(), xml);
    folder
}

/// A folder for all cases of a test, which run one after the other.
fn kept_folder_with(xml: &str) -> PathBuf {
    let folder = kept_folder("bitterli");
    write_scene(&folder, xml);
    folder
}

/// Reads a scene from a folder with `models/a b.obj`, `plain.obj`, `a b.png`, and `bytes.exr` with numbers of 0 to 255.
pub(crate) fn read_xml(xml: &str) -> Result<FileScene, SourceError> {
    read(&folder_with(xml).path().join("scene.xml"), None, &Limits::default())
}

/// A scene of version 0.6 with a sensor and `inner`.
fn read_inner(inner: &str) -> FileScene {
    read_xml(&format!("<scene version='0.6.0'>{SENSOR}{inner}</scene>")).unwrap()
}

/// The codes of the findings above notes.
fn codes(scene: &FileScene) -> Vec<&str> {
    scene.findings.iter().filter(|f| f.severity != Severity::Note).map(|f| f.code.as_str()).collect()
}

fn only_model(bsdf: &str) -> (MaterialModel, FileScene) {
    let scene = read_inner(&format!("<shape type='rectangle'>{bsdf}</shape>"));
    (scene.scene.materials[0].model, scene)
}

const SCENE: &str = r#"<?xml version="1.0" encoding="utf-8"?><scene version="0.6.0">
<default name="size" value="64"/>
<integrator type="path"><integer name="maxDepth" value="65"/></integrator>
<sensor type="perspective"><string name="fovAxis" value="y"/><float name="fov" value="60"/>
 <transform name="toWorld"><lookAt origin="1,2,3" target="0,1,0" up="0,1,0"/></transform>
 <film type="hdrfilm"><integer name="width" value="$size"/><integer name="height" value="32"/></film></sensor>
<bsdf type="mask" id="Wood"><rgb name="opacity" value="0.5, 0.5, 0.5"/><bsdf type="twosided"><bsdf type="roughplastic">
 <float name="alpha" value="0.1"/><string name="distribution" value="ggx"/>
 <float name="intIOR" value="1.5"/><float name="extIOR" value="1"/><boolean name="nonlinear" value="true"/>
 <texture name="diffuseReflectance" type="bitmap"><string name="filename" value="a b.png"/>
  <string name="filterType" value="trilinear"/><string name="wrapMode" value="clamp"/></texture></bsdf></bsdf></bsdf>
<bsdf type="twosided" id="Metal"><bsdf type="roughconductor"><float name="alpha" value="0.2"/>
 <float name="extEta" value="2"/><rgb name="eta" value="2 4 6"/><rgb name="k" value="8, 4, 2"/>
 <rgb name="specularReflectance" value="0.5"/></bsdf></bsdf>
<shape type="obj" id="Table"><string name="filename" value="models/a b.obj"/><boolean name="faceNormals" value="true"/>
 <transform name="toWorld"><scale value="2"/><translate x="1"/></transform><ref id="Wood"/></shape>
<shape type="rectangle"><ref id="Metal"/><emitter type="area"><rgb name="radiance" value="16.032"/></emitter></shape>
<emitter type="envmap"><string name="filename" value="a b.png"/><float name="scale" value="3"/>
 <transform name="toWorld"><rotate y="1" angle="90"/></transform></emitter>
</scene>"#;

#[test]
fn included_files_stand_in_their_place_and_paths_are_searched() {
    let folder = folder_with(&format!(
        "<scene version='3.0.0'><path value='parts'/><default name='n' value='2'/><include filename='parts/more.xml'/>{SENSOR}</scene>"
    ));
    let parts = folder.path().join("parts");
    std::fs::create_dir(&parts).unwrap();
    std::fs::write(parts.join("t.obj"), TRIANGLE).unwrap();
    let read_with = |text: &str| {
        std::fs::write(parts.join("more.xml"), text).unwrap();
        read(&folder.path().join("scene.xml"), None, &Limits::default())
    };
    let shape = "<shape type='obj'><string name='filename' value='t.obj'/><transform name='to_world'><scale value='$n'/></transform></shape>";
    let scene = read_with(&format!("<scene version='3.0.0'>{shape}</scene>")).unwrap();
    assert_eq!((codes(&scene), scene.scene.surfaces[0].mesh.positions[1].x), (vec![], 2.0));
    assert!(scene.files.hashes.iter().any(|(file, _)| file == "parts/t.obj"));
    for (text, word) in [
        ("<scene version='3.0.0'><include filename='parts/more.xml'/></scene>", "includes itself"),
        ("<scene version='3.0.0'><include filename='../more.xml'/></scene>", "leads out"),
        ("<scene version='3.0.0'><include filename='none.xml'/></scene>", "does not exist"),
        ("<scene", "well-formed"),
    ] {
        let error = read_with(text).unwrap_err().to_string();
        assert!(error.contains("<include>") && error.contains(word), "{error}");
    }
}

/// Mitsuba 3.9.1 takes files of the last `<path>` first, but an included file beside the one that includes it, else
/// beside the scene, else of a `<path>` before it.
#[test]
fn folders_are_searched_in_mitsubas_order() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    let read_with = |text: &str| {
        write("scene.xml", &format!("<scene version='3.0.0'>{text}{SENSOR}</scene>"));
        read(&folder.path().join("scene.xml"), None, &Limits::default()).unwrap()
    };
    let at = |z: f64| format!("v 0 0 {z}\nv 1 0 {z}\nv 0 1 {z}\nf 1 2 3\n");
    for (name, z) in [("t.obj", 1.0), ("a/t.obj", 2.0), ("b/t.obj", 3.0)] {
        write(name, &at(z));
    }
    let shape = "<shape type='obj'><string name='filename' value='t.obj'/></shape>";
    let found = |paths: &str| read_with(&format!("{paths}{shape}")).scene.surfaces[0].mesh.positions[0].z;
    assert_eq!(found(""), 1.0);
    assert_eq!(found("<path value='a'/>"), 2.0);
    assert_eq!(found("<path value='a'/><path value='b'/>"), 3.0);
    assert_eq!(found("<path value='b'/><path value='a'/><path value='gone'/>"), 2.0);

    let of = |name: &str| format!("<scene version='3.0.0'><shape type='rectangle' id='{name}'/></scene>");
    let including = "<scene version='3.0.0'><include filename='more.xml'/></scene>";
    write("in/first.xml", including);
    write("a/more.xml", &of("path"));
    let found = |text: &str| read_with(text).scene.surfaces[0].name.clone();
    let include = "<include filename='in/first.xml'/>";
    assert_eq!(found(&format!("<path value='a'/>{include}")), "path");
    write("more.xml", &of("own"));
    assert_eq!(found(include), "own");
    assert_eq!(found(&format!("<path value='a'/>{include}")), "own");
    write("in/more.xml", &of("beside"));
    assert_eq!(found(&format!("<path value='a'/>{include}")), "beside");
}

/// The same room at the origin and 571 km from it.
#[test]
fn far_scenes_are_moved_by_whole_metres() {
    let at = |x: f64, y: f64, z: f64| {
        let camera = format!("<lookat origin='{},{},{}' target='{x},{y},{z}' up='0,1,0'/>", x + 0.25, y + 1.5, z + 3.0);
        let place = format!("<translate x='{}' y='{y}' z='{z}'/>", x + 0.123);
        let sphere = format!("<point name='center' x='{x}' y='{y}' z='{}'/>", z + 0.5);
        read_xml(&format!(
            "<scene version='3.0.0'><sensor type='perspective'><float name='fov' value='60'/><transform name='to_world'>{camera}</transform></sensor>
            <shape type='rectangle'><transform name='to_world'>{place}</transform></shape><shape type='sphere'>{sphere}</shape></scene>"
        ))
        .unwrap()
    };
    let (near, far) = (at(0.0, 0.0, 0.0), at(448_231.0, 120.0, -354_123.0));
    assert_eq!((near.shift_m, far.shift_m), (DVec3::ZERO, DVec3::new(448_231.0, 122.0, -354_120.0)));
    let moved = near.camera.unwrap().position() - far.camera.unwrap().position();
    assert!((moved - DVec3::new(0.0, 2.0, 3.0)).length() < 1e-9, "{moved}");
    for (near, far) in near.scene.surfaces.iter().zip(&far.scene.surfaces) {
        let miss = |(a, b): (&glam::Vec3, &glam::Vec3)| (a.as_dvec3() - b.as_dvec3() - moved).length();
        assert!(near.mesh.positions.iter().zip(&far.mesh.positions).map(miss).fold(0.0, f64::max) < 1e-6);
    }
    assert_eq!(far.findings.iter().filter(|finding| finding.code == "far_from_origin").count(), 1);
}

#[test]
fn the_three_versions_spell_one_scene() {
    let second = read_xml(SCENE).unwrap();
    assert_eq!(codes(&second), [""; 0]);
    let first = read_xml(&SCENE.replace("0.6.0", "0.5.0")).unwrap();
    let words = [
        ("0.6.0", "3.0.0"),
        ("maxDepth", "max_depth"),
        ("fovAxis", "fov_axis"),
        ("toWorld", "to_world"),
        ("lookAt", "lookat"),
        ("intIOR", "int_ior"),
        ("extIOR", "ext_ior"),
        ("diffuseReflectance", "diffuse_reflectance"),
        ("filterType", "filter_type"),
        ("wrapMode", "wrap_mode"),
        ("extEta", "ext_eta"),
        ("specularReflectance", "specular_reflectance"),
        ("faceNormals", "face_normals"),
    ];
    let third = words.iter().fold(SCENE.to_owned(), |xml, (old, new)| xml.replace(old, new));
    let third = read_xml(&third).unwrap();
    for other in [first, third] {
        assert_eq!((&other.scene, &other.camera, &other.findings), (&second.scene, &second.camera, &second.findings));
    }
    // Twin: another number is another scene.
    assert_ne!(read_xml(&SCENE.replace("16.032", "16.033")).unwrap().scene, second.scene);
}

#[test]
fn surfaces_lights_and_camera_are_those_of_the_xml() {
    let FileScene { scene, camera, files, .. } = read_xml(SCENE).unwrap();
    let camera = camera.unwrap();
    assert_eq!((camera.intrinsics.width, camera.intrinsics.height), (64, 32));
    assert_eq!(camera.position(), glam::DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(scene.surfaces[0].name, "Table");
    assert_eq!(scene.surfaces[0].mesh.positions[1], glam::Vec3::new(3.0, 0.0, 0.0));
    assert!(scene.surfaces[0].mesh.normals.is_none());
    let wood = &scene.materials[0];
    assert!(wood.two_sided && wood.name == "Wood" && wood.opacity == Some(ScalarInput::Constant(0.5)));
    let MaterialModel::Conductor { ior, .. } = scene.materials[1].model else { panic!("expected a conductor") };
    assert_eq!(ior, ConductorIor::EtaK { eta: [1.0, 2.0, 3.0], k: [4.0, 2.0, 1.0] });
    let emission =
        Emission::Area { surfaces: vec![SurfaceIndex(1)], radiance: [16.032; 3], map: None, two_sided: false };
    assert_eq!(scene.lights[0].emission, emission);
    let Emission::Environment { scale, world_from_environment, .. } = scene.lights[1].emission else {
        panic!("expected an environment")
    };
    assert_eq!(scale, 3.0);
    // A quarter turn about y takes +z to +x.
    assert!((world_from_environment[0][2] - 1.0).abs() < 1e-6);
    let files: Vec<_> = files.hashes.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(files, ["a b.png", "models/a b.obj", "scene.xml"]);
}

#[test]
fn wrappers_may_nest_in_any_order() {
    let texture = "<texture type='bitmap'><string name='filename' value='a b.png'/></texture>";
    let wrap = |order: [&str; 3]| {
        let inner = "<bsdf type='diffuse'/>".to_owned();
        let bsdf = order.iter().rev().fold(inner, |inner, kind| match *kind {
            "mask" => format!("<bsdf type='mask'><float name='opacity' value='0.25'/>{inner}</bsdf>"),
            "bumpmap" => format!("<bsdf type='bumpmap'>{texture}{inner}</bsdf>"),
            kind => format!("<bsdf type='{kind}'>{inner}</bsdf>"),
        });
        let scene = read_inner(&format!("<shape type='rectangle'>{bsdf}</shape>"));
        assert_eq!(codes(&scene), [""; 0]);
        scene.scene.materials
    };
    let first = wrap(["mask", "bumpmap", "twosided"]);
    assert!(first[0].two_sided && first[0].opacity.is_some() && first[0].bump.is_some());
    for order in [["twosided", "bumpmap", "mask"], ["bumpmap", "twosided", "mask"], ["bumpmap", "mask", "twosided"]] {
        assert_eq!(wrap(order), first);
    }
}

#[test]
fn an_id_within_a_bumpmap_refers_to_the_inner_bsdf() {
    let bsdf = "<bsdf type='bumpmap'><texture name='map' type='bitmap'><string name='filename' value='a b.png'/>\
                </texture><bsdf type='twosided' id='Floor'><bsdf type='diffuse'/></bsdf></bsdf>";
    let scene = read_inner(&format!("{bsdf}<shape type='rectangle'><ref id='Floor'/></shape>"));
    assert!(scene.scene.materials[0].bump.is_none());
    assert!(scene.findings.iter().any(|f| f.code == "unused_bsdf" && f.message.contains("Floor")));
}

#[test]
fn defaults_are_those_of_the_version() {
    let cu = only_model("<bsdf type='conductor'/>").0;
    let MaterialModel::Conductor { ior: ConductorIor::EtaK { eta, .. }, .. } = cu else { panic!("{cu:?}") };
    assert!((eta[0] - 0.201).abs() < 1e-3);
    let none = only_model("<bsdf type='roughconductor'><string name='material' value='none'/></bsdf>").0;
    assert!(matches!(none, MaterialModel::Conductor { ior: ConductorIor::PerfectMirror, microfacets: Some(_), .. }));
    let three =
        format!("<scene version='3.0.0'>{SENSOR}<shape type='rectangle'><bsdf type='conductor'/></shape></scene>");
    let three = read_xml(&three).unwrap().scene.materials[0].model;
    assert!(matches!(three, MaterialModel::Conductor { ior: ConductorIor::PerfectMirror, microfacets: None, .. }));
    let MaterialModel::Plastic { eta, nonlinear, .. } = only_model("<bsdf type='plastic'/>").0 else { panic!() };
    assert!((eta - 1.48959).abs() < 1e-5 && !nonlinear);
    let water = "<bsdf type='dielectric'><string name='intIOR' value='water'/><float name='extIOR' value='1'/></bsdf>";
    let MaterialModel::Dielectric { eta, .. } = only_model(water).0 else { panic!() };
    assert_eq!(eta, 1.333);
}

#[test]
fn a_shape_without_bsdf_is_grey_and_a_lamp_black() {
    let scene = read_inner("<shape type='rectangle'/><shape type='rectangle'><emitter type='area'/></shape>").scene;
    let reflectance = |value| ColorInput::Constant([value; 3]);
    for (material, value) in scene.materials.iter().zip([0.5, 0.0]) {
        assert_eq!(material.model, MaterialModel::Diffuse { reflectance: reflectance(value), alpha: None });
    }
    assert_eq!(
        scene.lights[0].emission,
        Emission::Area { surfaces: vec![SurfaceIndex(1)], radiance: [1.0; 3], map: None, two_sided: false }
    );
}

#[test]
fn each_fault_is_a_finding_and_the_rest_is_read() {
    for (inner, code) in [
        ("<shape type='teapot'/>", "unknown_plugin"),
        ("<shape type='obj'><string name='filename' value='models/none.obj'/></shape>", "missing_file"),
        ("<shape type='obj'><string name='filename' value='../a.obj'/></shape>", "path_escapes"),
        ("<shape type='obj'><string name='filename' value='/etc/passwd'/></shape>", "path_escapes"),
        ("<shape type='obj'/>", "bad_value"),
        ("<shape type='obj'><string name='filename' value='a b.png'/></shape>", "bad_mesh"),
        ("<shape type='rectangle'><float name='wings' value='2'/></shape>", "unknown_parameter"),
        (
            "<shape type='rectangle'><bsdf type='diffuse'><rgb name='reflectance' value='nan'/></bsdf></shape>",
            "bad_value",
        ),
        ("<shape type='rectangle'><transform name='toWorld'><scale value='1e308'/></transform></shape>", "not_finite"),
        ("<shape type='rectangle'><medium type='homogeneous' name='interior'/></shape>", "unsupported"),
        (
            "<bsdf id='a' type='twosided'><ref id='a'/></bsdf><shape type='rectangle'><ref id='a'/></shape>",
            "nested_too_deep",
        ),
        ("<teapot/>", "unknown_element"),
    ] {
        let scene = read_inner(&format!("{inner}<shape type='cube'/>"));
        assert!(codes(&scene).contains(&code), "{inner}: {:?}", scene.findings);
        assert_eq!(scene.scene.surfaces.last().map(|s| s.name.as_str()), Some("cube"), "{inner}");
    }
    // Twin.
    let sound = read_inner("<shape type='cube'/>");
    assert_eq!(codes(&sound), [""; 0]);
    assert!(sound.findings.iter().any(|finding| finding.code == "no_bsdf"));
    let other_version = read_xml(&format!("<scene version='9'>{SENSOR}</scene>")).unwrap();
    assert_eq!(codes(&other_version), ["unknown_version"]);
}

/// Whether the scene states the base colour of a rectangle with this BSDF.
fn states_base_color(bsdf: &str) -> bool {
    read_inner(&format!("<shape type='rectangle'>{bsdf}</shape>")).origins[0].stated.base_color
}

#[test]
fn a_colour_that_cannot_be_read_is_not_stated() {
    let states = |inner: &str| states_base_color(&format!("<bsdf type='diffuse'>{inner}</bsdf>"));
    for inner in [
        "<rgb name='reflectance' value='0.4;0.1;0.2'/>",
        "<rgb name='reflectance' value='#8c2'/>",
        "<rgb name='reflectance' value='#80c020ff'/>",
        "<rgb name='reflectance'/>",
        "<spectrum name='reflectance' value='500:0.2 400:0.1'/>",
        "<spectrum name='reflectance' type='irregular'/>",
        "<ref name='reflectance' id='nothing'/>",
        "<texture name='reflectance' type='checkerboard'/>",
        // Out of range.
        "<rgb name='reflectance' value='200 100 50'/>",
        "<rgb name='reflectance' value='0.5 -0.2 0.5'/>",
        "<rgb name='reflectance' value='1.01'/>",
        "<blackbody name='reflectance' temperature='3000'/>",
        // Of an unknown name.
        "<rgb name='reflectence' value='0.4'/>",
        "<float name='reflectence' value='0.4'/>",
        "<texture type='bitmap'><string name='filename' value='a b.png'/></texture>",
        // A texture in another place.
        "<texture name='reflectance' type='bitmap'><string name='filename' value='a b.png'/>\
         <transform name='to_uv'><scale x='nan'/></transform></texture>",
    ] {
        assert!(!states(inner), "{inner}");
    }
    // Twins, among them noise above 1 and Mitsuba's own default.
    for inner in [
        "",
        "<rgb name='reflectance' value='0.4 0.1 0.2'/>",
        "<rgb name='reflectance' value='#80c020'/>",
        "<rgb name='reflectance' value='1.0005'/>",
        "<spectrum name='reflectance' type='irregular' wavelengths='400 700' values='0.2 0.4'/>",
        "<texture name='reflectance' type='bitmap'><string name='filename' value='a b.png'/></texture>",
    ] {
        assert!(states(inner), "{inner}");
    }
    assert!(!states_base_color("<bsdf type='conductor'><string name='materail' value='Au'/></bsdf>"));
    assert!(states_base_color("<bsdf type='conductor'><string name='material' value='Au'/></bsdf>"));
}

#[test]
fn one_of_several_bsdfs_states_no_base_colour() {
    let one = "<bsdf type='diffuse'><rgb name='reflectance' value='0.4'/></bsdf>";
    let two = format!("{one}<bsdf type='plastic'/>");
    for several in [
        format!("<bsdf type='blendbsdf'><float name='weight' value='0.5'/>{two}</bsdf>"),
        format!("<bsdf type='mixturebsdf'><string name='weights' value='0.5, 0.5'/>{two}</bsdf>"),
        format!("<bsdf type='twosided'>{two}</bsdf>"),
        format!("<bsdf type='twosided'><bsdf type='blendbsdf'>{two}</bsdf></bsdf>"),
        two.clone(),
    ] {
        assert!(!states_base_color(&several), "{several}");
    }
    let lamp = "<emitter type='area'/>";
    assert!(!states_base_color(&format!("<ref id='nothing'/>{lamp}")) && states_base_color(lamp));
    for single in [one.to_owned(), format!("<bsdf type='twosided'>{one}</bsdf>")] {
        assert!(states_base_color(&single), "{single}");
    }
}

#[test]
fn an_emission_that_cannot_be_read_is_not_stated() {
    let states = |radiance: &str| {
        let scene = read_inner(&format!("<shape type='rectangle'><emitter type='area'>{radiance}</emitter></shape>"));
        scene.origins[0].stated.emission
    };
    assert!(states("<rgb name='radiance' value='200 100 50'/>"));
    assert!(states("<blackbody name='radiance' temperature='3000'/>"));
    assert!(!states("<rgb name='radiance' value='bright'/>"));
    assert!(!states("<rgb name='radience' value='5'/>"));
}

#[test]
fn a_shape_whose_place_cannot_be_read_is_missing() {
    let cube =
        |step: &str| format!("<shape type='cube' id='Lost'><transform name='to_world'>{step}</transform></shape>");
    for lost in [
        cube("<translate x='nan'/>"),
        cube("<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2'/>"),
        cube("<skew/>"),
        "<shape type='cube' id='Lost'><string name='to_world' value='2'/></shape>".to_owned(),
        "<shape type='sphere' id='Lost'><float name='radius' value='nan'/></shape>".to_owned(),
    ] {
        let scene = read_inner(&format!("{lost}<shape type='cube'/>"));
        let names: Vec<&str> = scene.scene.surfaces.iter().map(|surface| surface.name.as_str()).collect();
        assert_eq!((names, scene.missing.files), (vec!["cube"], vec!["Lost".to_owned()]), "{lost}");
    }
    // Twin.
    assert_eq!(read_inner(&cube("<translate x='1'/>")).missing.files, [""; 0]);
}

#[test]
fn findings_name_file_and_element() {
    let scene = read_inner("\n<shape type='obj'><string name='filename' value='models/Mesh7.obj'/></shape>");
    let finding = &scene.findings[0];
    assert_eq!((finding.file.as_str(), finding.place.as_str()), ("models/Mesh7.obj", "shape 'Mesh7'"));
    assert!(finding.message.contains("'scene.xml' line 2"), "{finding}");
}

#[test]
fn a_missing_texture_is_grey_and_named_once() {
    let bsdf = "<bsdf type='diffuse'><texture name='reflectance' type='bitmap'>\
                <string name='filename' value='rug.png'/></texture></bsdf>";
    let scene = read_inner(&format!("<shape type='cube'>{bsdf}</shape><shape type='rectangle'>{bsdf}</shape>"));
    assert_eq!(codes(&scene), ["missing_file"]);
    assert_eq!(scene.findings[0].file, "rug.png");
    for material in &scene.scene.materials {
        let grey = ColorInput::Constant([0.5; 3]);
        assert_eq!(material.model, MaterialModel::Diffuse { reflectance: grey, alpha: None });
    }
}

#[test]
fn textures_are_decoded_shared_and_turned_upright() {
    let bitmap = |more: &str| {
        format!(
            "<bsdf type='diffuse'><texture name='reflectance' type='bitmap'>\
             <string name='filename' value='a b.png'/>{more}</texture></bsdf>"
        )
    };
    let shapes = [
        bitmap(""),
        bitmap(""),
        bitmap("<float name='gamma' value='1'/>"),
        bitmap("<boolean name='raw' value='true'/>"),
        bitmap(
            "<float name='uscale' value='2'/><float name='vscale' value='0.5'/><float name='voffset' value='0.25'/>",
        ),
    ];
    let inner: String = shapes.iter().map(|bsdf| format!("<shape type='rectangle'>{bsdf}</shape>")).collect();
    let FileScene { scene, .. } = read_inner(&inner);
    assert_eq!(scene.textures.len(), 2);
    assert!(matches!(scene.textures[0].texture.texels(), Texels::Srgb8(_)));
    assert!(matches!(scene.textures[1].texture.texels(), Texels::Linear8(_)));
    assert!(scene.textures.iter().all(|t| t.sha256.is_some()));
    let MaterialModel::Diffuse { reflectance: ColorInput::Texture { uv, .. }, .. } = scene.materials[4].model else {
        panic!("expected a texture")
    };
    // Mitsuba's v is one minus ours: ours 0.2 is its 0.8, scaled and shifted 0.65, so ours 0.35.
    let at = uv.apply(glam::Vec2::new(0.1, 0.2));
    assert!((at - glam::Vec2::new(0.2, 0.35)).length() < 1e-6, "{at}");
    // In Mitsuba the picture's top row is at the rectangle's lower edge.
    let mesh = &scene.surfaces[0].mesh;
    let lower_left = mesh.uvs.as_ref().unwrap()[0] + glam::Vec2::new(0.25, -0.25);
    assert_eq!(scene.textures[0].texture.sample(lower_left.to_array()), [1.0, 0.0, 0.0]);
}

/// A shape's textured radiance is 1 times the texture, looked up like a material's. An environment's is the texture's
/// mean.
#[test]
fn a_texture_as_radiance() {
    let texture = "<texture name='radiance' type='bitmap'><string name='filename' value='a b.png'/>\
                   <float name='uscale' value='2'/></texture>";
    let FileScene { scene, findings, .. } =
        read_inner(&format!("<shape type='rectangle'><emitter type='area'>{texture}</emitter></shape>"));
    assert_eq!(findings, []);
    let uv = UvTransform([[2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let map = Some(EmissionMap { texture: TextureIndex(0), uv });
    let emission = Emission::Area { surfaces: vec![SurfaceIndex(0)], radiance: [1.0; 3], map, two_sided: false };
    assert_eq!(scene.lights[0].emission, emission);
    let world = read_inner(&format!("<emitter type='constant'>{texture}</emitter>"));
    assert_eq!(codes(&world), ["unsupported"]);
    assert!(matches!(world.scene.lights[0].emission, Emission::Constant { .. }));
    let absent = texture.replace("a b.png", "none.png");
    let absent = read_inner(&format!("<shape type='rectangle'><emitter type='area'>{absent}</emitter></shape>"));
    assert_eq!(codes(&absent), ["missing_file"]);
    let emission = Emission::Area { surfaces: vec![SurfaceIndex(0)], radiance: [0.5; 3], map: None, two_sided: false };
    assert_eq!(absent.scene.lights[0].emission, emission);
}

#[test]
fn opacity_is_luminance_unless_alpha_varies() {
    let folder = folder_with("");
    let write = |alpha: u8| {
        let file = std::fs::File::create(folder.path().join("leaf.png")).unwrap();
        let mut encoder = png::Encoder::new(file, 2, 1);
        encoder.set_color(png::ColorType::Rgba);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&[200, 200, 200, 255, 200, 200, 200, alpha]).unwrap();
    };
    let xml = format!(
        "<scene version='0.6.0'>{SENSOR}<shape type='rectangle'><bsdf type='mask'><texture name='opacity' type='bitmap'>\
         <string name='filename' value='leaf.png'/></texture><bsdf type='diffuse'/></bsdf></shape></scene>"
    );
    std::fs::write(folder.path().join("scene.xml"), xml).unwrap();
    let opacity = || {
        let scene = read(&folder.path().join("scene.xml"), None, &Limits::default()).unwrap();
        let texture = scene.scene.textures[0].texture.clone();
        ([texture.texel(0, 0)[0], texture.texel(1, 0)[0]], scene.findings)
    };
    write(255);
    let (values, findings) = opacity();
    assert!((values[0] - 0.5776).abs() < 1e-3 && values[0] == values[1] && findings.is_empty(), "{values:?}");
    write(0);
    let (values, findings) = opacity();
    assert_eq!(values, [1.0, 0.0]);
    assert_eq!((findings[0].code.as_str(), findings[0].severity), ("opacity_from_alpha", Severity::Note));
}

#[test]
fn the_licence_is_kept() {
    let folder = folder_with(&format!("<scene version='0.6.0'>{SENSOR}</scene>"));
    let text = "This is the Mitsuba version of 'A Room' by Somebody, downloaded from there\nCC0\n";
    std::fs::write(folder.path().join("LICENSE.txt"), text).unwrap();
    let scene = read(&folder.path().join("scene.xml"), None, &Limits::default()).unwrap();
    assert_eq!(scene.licence.map(|licence| licence.text).as_deref(), Some(text));
}

#[test]
fn limits_hold() {
    let folder = folder_with(&format!("<scene version='0.6.0'>{SENSOR}{}</scene>", "<shape type='cube'/>".repeat(5)));
    let path = folder.path().join("scene.xml");
    let read_with = |limits: Limits| read(&path, None, &limits);
    let shapes = read_with(Limits { shapes: 2, ..Limits::default() }).unwrap();
    assert_eq!((shapes.scene.surfaces.len(), codes(&shapes)), (2, vec!["limit"]));
    let triangles = read_with(Limits { triangles: 36, ..Limits::default() }).unwrap();
    assert_eq!(triangles.scene.surfaces.len(), 3);
    assert!(read_with(Limits { xml_bytes: 10, ..Limits::default() }).is_err());
    assert!(read(Path::new("no-such-folder/scene.xml"), None, &Limits::default()).is_err());
    assert!(read(folder.path(), None, &Limits::default()).is_err());
}

#[test]
fn names_of_many_lights_are_unique() {
    let lamp = "<shape type='rectangle'><emitter type='area'/></shape>";
    let scene = read_inner(&lamp.repeat(300)).scene;
    let names: std::collections::BTreeSet<_> = scene.lights.iter().map(|light| &light.name).collect();
    assert_eq!(names.len(), 300);
    assert_eq!(scene.lights[2].name, "rectangle-3");
}

/// Some bytes of the file changed, or its end cut off.
fn mutated(bytes: &[u8], changes: &[(usize, u8)], cut: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let length = bytes.len();
    changes.iter().for_each(|(at, byte)| bytes[at % length] = *byte);
    bytes.truncate(length - cut % length);
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_xml_never_panics(
        changes in prop::collection::vec((any::<usize>(), any::<u8>()), 0..6),
        cut in prop_oneof![3 => Just(0_usize), 1 => any::<usize>()],
    ) {
        static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| kept_folder_with(""));
        let path = FOLDER.join("scene.xml");
        std::fs::write(&path, mutated(SCENE.as_bytes(), &changes, cut)).unwrap();
        let _ = read(&path, None, &Limits { triangles: 10_000, ..Limits::default() });
    }

    /// Words of the format in any order, which a change of single bytes would rarely produce.
    #[test]
    fn shuffled_xml_never_panics(words in prop::collection::vec(0_usize..WORDS.len(), 0..40)) {
        static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| kept_folder_with(""));
        let body: String = words.iter().map(|&word| WORDS[word]).collect();
        let path = FOLDER.join("scene.xml");
        std::fs::write(&path, format!("<scene version='3.0.0'>{SENSOR}{body}</scene>")).unwrap();
        let _ = read(&path, None, &Limits::default());
    }

    #[test]
    fn mutated_obj_never_panics(
        changes in prop::collection::vec((any::<usize>(), any::<u8>()), 0..8),
        cut in prop_oneof![3 => Just(0_usize), 1 => any::<usize>()],
    ) {
        static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
            let shape = "<shape type='obj'><string name='filename' value='models/a b.obj'/></shape>";
            kept_folder_with(&format!("<scene version='0.6.0'>{SENSOR}{shape}</scene>"))
        });
        std::fs::write(FOLDER.join("models/a b.obj"), mutated(TRIANGLE.as_bytes(), &changes, cut)).unwrap();
        let scene = read(&FOLDER.join("scene.xml"), None, &Limits::default()).unwrap();
        for surface in &scene.scene.surfaces {
            let count = surface.mesh.positions.len();
            prop_assert!(surface.mesh.triangles.iter().flatten().all(|&v| (v as usize) < count));
            prop_assert!(surface.mesh.positions.iter().all(|p| p.is_finite()));
        }
        prop_assert!(!scene.scene.surfaces.is_empty() || !scene.findings.is_empty());
    }

    #[test]
    fn any_faces_never_panic(faces in prop::collection::vec("f( -?[0-9]{1,20}(/-?[0-9]{0,20}){0,2}){0,6}", 0..6)) {
        let text = format!("{TRIANGLE}{}\n", faces.join("\n"));
        let _ = obj::read(text.as_bytes(), obj::ObjLimits { triangles: 100, corners: 300 }, obj::Materials::Ignored);
    }
}

const WORDS: [&str; 20] = [
    "<shape type='rectangle'>",
    "<shape type='sphere'>",
    "<shape type='cylinder'>",
    "</shape>",
    "<bsdf type='twosided' id='a'>",
    "<bsdf type='principled'>",
    "<bsdf type='mask'>",
    "</bsdf>",
    "<ref id='a' name='reflectance'/>",
    "<float name='radius' value='-1'/>",
    "<vector name='p1' x='0' z='0'/>",
    "<float name='roughness' value='1e400'/>",
    "<texture type='bitmap' name='opacity'><string name='filename' value='a b.png'/></texture>",
    "<emitter type='sky'/>",
    "<emitter type='area'/>",
    "<transform name='to_world'><scale value='0'/></transform>",
    "<transform name='to_world'><rotate x='1' angle='1e300'/></transform>",
    "<default name='x' value='$x$x'/>",
    "<string name='$x' value='$'/>",
    "<sensor type='thinlens'/>",
];

/// The scene; absent if the shared data are missing.
fn real(file: &str) -> Option<FileScene> {
    let path = shared_data(&format!("bitterli/{file}"))?;
    Some(read(&path, None, &Limits::default()).unwrap())
}

/// The triangles of the OBJ files. Rectangles and disks come in addition.
fn file_triangles(scene: &FileScene) -> usize {
    let of_files = |name: &&mateval_dataset::reference::Surface| name.name != "rectangle" && name.name != "disk";
    scene.scene.surfaces.iter().filter(of_files).map(|s| s.mesh.triangles.len()).sum()
}

fn warnings_at(scene: &FileScene) -> Vec<String> {
    let above_note = scene.findings.iter().filter(|f| f.severity != Severity::Note);
    above_note.map(|f| format!("{} {} {}", f.code, f.file, f.place)).collect()
}

#[test]
fn staircase2() {
    let Some(scene) = real("staircase2/scene.xml") else { return };
    assert_eq!((file_triangles(&scene), scene.scene.surfaces.len(), scene.scene.lights.len()), (30_911, 32, 13));
    assert_eq!(warnings_at(&scene), [""; 0]);
    assert_eq!(scene.camera.map(|camera| (camera.intrinsics.width, camera.intrinsics.height)), Some((1280, 720)));
}

#[test]
fn living_room() {
    for file in ["living-room/scene.xml", "living-room/scene_v0.6_dppm.xml"] {
        let Some(scene) = real(file) else { return };
        assert_eq!((file_triangles(&scene), scene.scene.surfaces.len(), scene.scene.lights.len()), (143_163, 65, 1));
        assert_eq!(warnings_at(&scene), [""; 0]);
    }
}

#[test]
fn bathroom() {
    for file in ["bathroom/scene.xml", "bathroom/scene_v0.6_dppm.xml"] {
        let Some(scene) = real(file) else { return };
        assert_eq!((file_triangles(&scene), scene.scene.surfaces.len()), (380_288, 856 - 3));
        let missing: Vec<_> = scene.findings.iter().filter(|f| f.code == "missing_file").map(|f| &f.file).collect();
        assert_eq!(missing, ["models/Mesh206.obj", "models/Mesh263.obj", "models/Mesh381.obj", "textures/rug.png"]);
        assert_eq!(warnings_at(&scene).len(), 4, "{:?}", warnings_at(&scene));
    }
}

/// Every value that the reader uses in place of what it cannot read, what in a scene makes it do so, and the code of the
/// finding that says so.
fn fallbacks() -> Vec<(&'static str, String, &'static str)> {
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
        ("diffuse grey 0.5", in_cube(""), "no_bsdf"),
        ("diffuse grey 0.5", bsdf("velvet", ""), "unknown_plugin"),
        ("diffuse grey 0.5", bsdf("twosided", ""), "missing_child"),
        ("linear mid-grey", bitmap("none.png", ""), "missing_file"),
        ("linear mid-grey", checkerboard, "unknown_plugin"),
        ("the plugin's default colour", color("reflectance", "red"), "bad_value"),
        ("the plugin's default colour, for one out of range", color("reflectance", "3"), "out_of_range"),
        ("the plugin's default colour, for an unknown name", color("reflectence", "0.2"), "unknown_parameter"),
        ("the texture's colour as it is, of another range", bitmap("bytes.exr", ""), "out_of_range"),
        ("the colour of the first of two", blend, "unsupported"),
        ("beckmann", bsdf("roughplastic", &string("distribution", "phong")), "unsupported"),
        ("the default metal's colour", bsdf("conductor", &string("material", "Unobtainium")), "unknown_material"),
        ("no shape", in_cube("<transform name='to_world'><matrix value='1'/></transform>"), "bad_transform"),
        ("no light", environment, "missing_file"),
        ("no light", "<emitter type='point'/>".into(), "unknown_plugin"),
        ("the first of two environments", "<emitter type='constant'/>".repeat(2), "unsupported"),
        ("the sun 45 degrees high", "<emitter type='sky'/>".into(), "sun_by_time"),
        ("the sun at the horizon", low_sun.into(), "out_of_range"),
        ("radiance 1", in_cube(bright), "bad_value"),
        ("the geometric mean of both", bsdf("roughconductor", anisotropic), "unsupported"),
        ("0 for what the principled model lacks", clearcoat, "unsupported"),
        ("no bumps", bsdf("bumpmap", "<bsdf type='diffuse'/>"), "missing_child"),
        ("the mode of u", bitmap("a b.png", &string("wrap_mode_v", "clamp")), "unsupported"),
        ("all channels", bitmap("a b.png", &string("channel", "r")), "unsupported"),
        ("all channels, for an unknown one", bitmap("a b.png", &string("channel", "z")), "bad_value"),
        ("the text of an unknown variable", color("reflectance", "$none"), "unknown_variable"),
        ("no reference", in_cube("<ref id='nobody'/>"), "unknown_id"),
        ("no medium", "<medium type='homogeneous'/>".into(), "unsupported"),
        ("barycentric coordinates", without_uv, "no_uv"),
    ]
}

#[test]
fn each_fallback_is_a_finding_and_the_rest_is_read() {
    for (value, input, code) in fallbacks() {
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
