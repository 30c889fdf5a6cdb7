//! Writes the initial corpus of the targets to `CORPUS/<target>/`, from the built-in sample and from generated files.

use mateval_testkit::packed;

use std::path::{Path, PathBuf};

use mateval_image::exr_io::{Precision, write_linear, write_scalar};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::{TriangleMesh, glb, obj};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let corpus = PathBuf::from(std::env::args().nth(1).ok_or("name the folder of the corpus")?);
    let work = tempfile::tempdir()?;
    let source = work.path().join("source");
    mateval_sample::write(&source)?;
    for (name, bytes) in packed::files(&source) {
        let target = match name.rsplit('.').next() {
            Some("xml") => "bitterli_xml",
            Some("obj" | "mtl") => "obj",
            Some("json") if name.contains("3D-FRONT/") => "front3d_house",
            Some("png" | "jpg") => "texture",
            _ => continue,
        };
        keep(&corpus, target, &name.replace('/', "_"), &bytes)?;
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
    maps(&corpus, work.path())?;
    archives(&corpus, work.path())?;
    geometry(&corpus, work.path(), &source)
}

fn keep(corpus: &Path, target: &str, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let folder = corpus.join(target);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(name), bytes)
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

/// The sample's rug as binary glTF.
fn geometry(corpus: &Path, work: &Path, source: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let limits = obj::ObjLimits { triangles: 100_000, corners: 300_000 };
    let bytes = std::fs::read(source.join("room/models/rug.obj"))?;
    let mesh: TriangleMesh =
        obj::read(&bytes, limits, obj::Materials::Ignored).map_err(|fault| format!("{fault:?}"))?.mesh;
    let path = work.join("a.glb");
    glb::write(&path, &[glb::GlbNode { name: "rug".to_owned(), mesh }])?;
    keep(corpus, "glb", "rug.glb", &std::fs::read(path)?)?;
    Ok(())
}
