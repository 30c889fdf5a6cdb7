//! Writes the initial corpus of the targets to `CORPUS/<target>/`, from the built-in sample and from generated files.

use mateval_testkit::{faulty_house, packed};

use std::path::{Path, PathBuf};

use mateval_image::exr_io::{Precision, write_linear, write_scalar};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_dataset::{TriangleMesh, glb, obj};

/// A scene with a textured triangle, every kind of light and a camera.
const LIT: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1,2,3]}],
"nodes":[{"name":"a","mesh":0,"scale":[-1,2,1],"rotation":[0,0,0,1]},{"camera":0,"translation":[0,1,3]},
{"extensions":{"KHR_lights_punctual":{"light":0}},"children":[4]},{"extensions":{"KHR_lights_punctual":{"light":1}}},
{"extensions":{"KHR_lights_punctual":{"light":2}}}],
"cameras":[{"type":"perspective","perspective":{"yfov":0.8,"znear":0.1,"aspectRatio":1.5}}],
"extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":9,"color":[1,0.5,0]},
{"type":"spot","spot":{"innerConeAngle":0.1,"outerConeAngle":0.6}},{"type":"directional","intensity":3}]}},
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"mode":4,"material":0}]}],
"materials":[{"alphaMode":"MASK","doubleSided":true,"emissiveFactor":[1,0,0],"pbrMetallicRoughness":
{"baseColorFactor":[1,0.5,1,1],"baseColorTexture":{"index":0,"extensions":
{"KHR_texture_transform":{"offset":[0.1,0],"rotation":0.3,"scale":[2,2]}}}},
"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":4},"KHR_materials_ior":{"ior":1.4}}}],
"textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":33071,"wrapT":33648,"magFilter":9728}],
"images":[{"uri":"data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC2"}],
"bufferViews":[{"buffer":0,"byteLength":60}],
"buffers":[{"byteLength":60,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8AAIA/AACAPwAAAAAAAAAA"}]}"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let corpus = PathBuf::from(std::env::args().nth(1).ok_or("name the folder of the corpus")?);
    let work = tempfile::tempdir()?;
    let source = work.path().join("source");
    mateval_sample::write(&source)?;
    // The test kit's house replaces the sample's, so that the corpus holds faults.
    faulty_house::write(&source);
    for (name, bytes) in packed::files(&source) {
        let target = match name.rsplit('.').next() {
            Some("xml") => "bitterli_xml",
            Some("obj" | "mtl") => "obj",
            Some("json") if name.contains("3D-FRONT/") => "front3d_house",
            Some("png" | "jpg") => "texture",
            _ => continue,
        };
        keep(&corpus, target, &name.replace('/', "_"), &bytes)?;
        if target == "texture" {
            keep(&corpus, "photo", &name.replace('/', "_"), &bytes)?;
        }
    }
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../dataset_spec/examples");
    for (name, target) in
        [("submission.json", "submission_json"), ("scene.json", "dataset_json"), ("result.json", "result_json")]
    {
        keep(&corpus, target, name, &std::fs::read(examples.join(name))?)?;
    }
    for entry in &mateval_procedural::library::LIBRARY {
        keep(&corpus, "mtlx", entry.name, entry.text.as_bytes())?;
    }
    let header = "{'descr': '<i4', 'fortran_order': False, 'shape': (3,), }";
    let numbers = [&b"\x93NUMPY\x01\x00\x76\x00"[..], format!("{header:117}\n").as_bytes(), &[1, 0, 0, 0].repeat(3)].concat();
    keep(&corpus, "npy", "labels", &numbers)?;
    for (name, photometric) in [("grey", 1), ("rgb", 2), ("mosaic", 32803)] {
        keep(&corpus, "photo", &format!("{name}.tif"), &tiff(photometric))?;
    }
    maps(&corpus, work.path())?;
    archives(&corpus, work.path())?;
    captures(&corpus, &numbers)?;
    geometry(&corpus, work.path(), &source)
}

fn keep(corpus: &Path, target: &str, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let folder = corpus.join(target);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(name), bytes)
}

/// A little-endian TIFF of 4x2 pixels with this photometric interpretation: 2 is RGB, all others have one number per
/// pixel.
fn tiff(photometric: u16) -> Vec<u8> {
    let samples: u16 = if photometric == 2 { 3 } else { 1 };
    let length = 4 * 2 * samples;
    // Width, height, bits, compression, interpretation, the strip's offset behind the tags, samples, rows, bytes.
    let size = [(256, 4), (257, 2), (258, 8), (259, 1), (262, photometric)];
    let tags = [&size[..], &[(273, 122), (277, samples), (278, 2), (279, length)]].concat();
    let mut bytes = b"II*\0\x08\0\0\0\x09\0".to_vec();
    for (tag, value) in tags {
        // One value of the type SHORT.
        bytes.extend([tag, 3, 1, 0, value, 0].into_iter().flat_map(u16::to_le_bytes));
    }
    bytes.extend([0; 4]);
    bytes.extend((0..length).map(|at| 9 * at as u8));
    bytes
}

/// Maps of the smallest size, of every kind; the first byte selects the map.
fn maps(corpus: &Path, work: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let (png, exr) = (work.join("a.png"), work.join("a.exr"));
    let ramp = Picture::from_fn(64, 64, |x, y| [(x * 4) as u8, (y * 4) as u8, 9]);
    let write = |target: &str, which: u8, path: &Path, name: &str| -> std::io::Result<()> {
        let bytes = [&[which][..], &std::fs::read(path)?].concat();
        keep(corpus, target, name, &bytes)
    };
    png_io::write_rgb_bytes(&png, &ramp)?;
    write("png_map", 0, &png, "rgb")?;
    png_io::write_rgb_words(&png, &ramp.map(|rgb| rgb.map(|byte| 257 * u16::from(byte))))?;
    write("png_map", 0, &png, "rgb_words")?;
    png_io::write_rgba_bytes(&png, &ramp.map(|[r, g, b]| [r, g, b, 255]))?;
    write("png_map", 1, &png, "rgba")?;
    png_io::write_grey_bytes(&png, &ramp.map(|[r, ..]| r))?;
    write("png_map", 1, &png, "grey")?;
    png_io::write_ids(&png, &ramp.map(|[r, ..]| u16::from(r)))?;
    write("png_map", 2, &png, "grey_words")?;
    let linear = ramp.map(|rgb| LinearRgb(rgb.map(|byte| f32::from(byte) / 255.0)));
    for (precision, name) in [(Precision::Half, "half"), (Precision::Float, "float")] {
        write_linear(&exr, &linear, precision)?;
        write("exr_map", 0, &exr, &format!("rgb_{name}"))?;
        write_scalar(&exr, &linear.map(|rgb| rgb.0[0]), precision)?;
        write("exr_map", 1, &exr, &format!("v_{name}"))?;
    }
    Ok(())
}

/// A small submission, packed in every supported format.
fn archives(corpus: &Path, work: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let folder = work.join("submission");
    std::fs::create_dir_all(folder.join("scenes/room/rug"))?;
    std::fs::write(folder.join("submission.json"), "{}")?;
    std::fs::write(folder.join("scenes/room/rug/base_color.png"), vec![7; 3000])?;
    let files = packed::files(&folder);
    let stored: Vec<_> = files.iter().map(|(name, bytes)| packed::ZipEntry::stored(name, bytes)).collect();
    keep(corpus, "archive_zip", "deflated", &packed::zipped(&folder, ""))?;
    keep(corpus, "archive_zip", "stored", &packed::zip(&stored, b"a comment"))?;
    keep(corpus, "archive_tar_gz", "packed", &packed::tarred(&folder, "./"))?;
    let tar: Vec<u8> = files.iter().flat_map(|(name, bytes)| packed::tar_entry(name, b'0', bytes)).collect();
    let long = [packed::tar_entry("long", b'L', b"a/long/name"), packed::tar_entry("pax", b'x', b"15 path=a/name\n")];
    keep(corpus, "archive_tar_gz", "plain", &[long.concat(), tar].concat())?;
    Ok(())
}

/// A triangle with a camera of every format but `.npz`, whose archive is empty, and after it labels of a NumPy file or
/// measured colours.
fn captures(corpus: &Path, labels: &[u8]) -> std::io::Result<()> {
    const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nproperty int label\nend_header\n\
        0 0 0\n1 0 0\n0 1 0\n3 0 1 2 5\n";
    const OBJ: &str = "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    const MEASURED: &str = r#"{"format":"mateval-measurements/1","regions":[{"name":"a","photo":"a.png","mask":"a.png",
        "value":1,"color":[0.5,0.5,0.5],"standard_error":[0.1,0.1,0.1]}]}"#;
    let transforms = r#"{"camera_model":"OPENCV","fl_x":9,"fl_y":9,"cx":4,"cy":3,"w":8,"h":6,"k1":-0.2,"applied_transform":
        [[1,0,0,0],[0,1,0,0],[0,0,1,0]],"frames":[{"file_path":"photos/a.png","transform_matrix":
        [[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]}]}"#;
    let of = |numbers: &[u32], rest: &[f64]| -> Vec<u8> {
        let words = numbers.iter().flat_map(|number| number.to_le_bytes());
        words.chain(rest.iter().flat_map(|number| number.to_le_bytes())).collect()
    };
    // One camera: its number, its model, width and height as 64 bits, four parameters. One photo: number, pose, camera,
    // name, no points.
    let camera = of(&[1, 0, 1, 1, 8, 0, 6, 0], &[9.0, 9.0, 4.0, 3.0]);
    let pose = of(&[1, 0, 1], &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0]);
    let image = [pose, of(&[1], &[]), b"a.png\0".to_vec(), of(&[0; 2], &[])].concat();
    // A camera with rows of K, of its rotation, of its translation and of its size.
    let lighting = b"9 0 4\n0 9 3\n0 0 1\n1 0 0\n0 1 0\n0 0 1\n0 0 3\n8 6 3\n";
    let cameras: [(&[u8], &[u8]); 6] = [
        (transforms.as_bytes(), b""),
        (&camera, &image),
        (b"1 SIMPLE_RADIAL 8 6 9 4 3 -0.1\n", b"1 1 0 0 0 0 0 3 1 a.png\n\n"),
        (b"PK\x05\x06\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", b""),
        (b"1\n0 0 3\n0 0 0\n0 1 0\n", b"1\n9 0 4\n0 9 3\n0 0 1\n"),
        (lighting, lighting),
    ];
    let meshes: [&[u8]; 2] = [PLY.as_bytes(), OBJ.as_bytes()];
    for (format, (first, second)) in cameras.into_iter().enumerate() {
        for (kind, mesh) in meshes.into_iter().enumerate() {
            for (name, last) in [("labels", labels), ("measured", MEASURED.as_bytes())] {
                let lengths = [first.len(), second.len(), mesh.len()].map(|length| (length as u32).to_le_bytes()).concat();
                let bytes = [&[format as u8, kind as u8][..], &lengths, first, second, mesh, last].concat();
                keep(corpus, "capture", &format!("{format}_{kind}_{name}"), &bytes)?;
            }
        }
    }
    Ok(())
}

/// The sample's rug as binary glTF, and a small scene with lights.
fn geometry(corpus: &Path, work: &Path, source: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let limits = obj::ObjLimits { triangles: 100_000, corners: 300_000 };
    let bytes = std::fs::read(source.join("room/models/rug.obj"))?;
    let mesh: TriangleMesh =
        obj::read(&bytes, limits, obj::Materials::Ignored).map_err(|fault| format!("{fault:?}"))?.mesh;
    let path = work.join("a.glb");
    glb::write(&path, &[glb::GlbNode { name: "rug".to_owned(), mesh }])?;
    let bytes = std::fs::read(path)?;
    keep(corpus, "glb", "rug.glb", &bytes)?;
    keep(corpus, "gltf_scene", "rug.glb", &bytes)?;
    keep(corpus, "gltf_scene", "lit.gltf", LIT.as_bytes())?;
    // The same with light from outside, as the script that bakes a .blend file hands it back.
    let exr = work.join("world.exr");
    write_linear(&exr, &Picture::filled(4, 2, LinearRgb([0.5; 3])), Precision::Half)?;
    let world = std::fs::read(exr)?;
    let of = |world: &str| format!(
        r#"{{"format":"mateval-baked/1","blender":"4.5.15 LTS","glb":"scene.glb","world":{world},"lamps":[{{"node":"a","visible":false}}],"materials":[{{"name":"material 0","base_color":"unstated"}}],"files":[],"findings":[{{"code":"omitted","place":"a","message":"b","action":"c"}}],"faults":[],"error":null}}"#
    );
    let map = r#"{"image":"world.exr","world_from_environment":[[1,0,0],[0,0,1],[0,-1,0]]}"#;
    for (name, result, glb) in [
        ("constant", of(r#"{"radiance":[0,0,0.5]}"#), &bytes[..]),
        ("map", of(map), LIT.as_bytes()),
        ("none", of("null"), LIT.as_bytes()),
    ] {
        let lengths = [result.len() as u32, glb.len() as u32].map(u32::to_le_bytes).concat();
        keep(corpus, "blend_result", name, &[&lengths, result.as_bytes(), glb, &world].concat())?;
    }
    Ok(())
}
