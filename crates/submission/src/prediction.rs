//! A submission's maps, read for one scene; what is missing or unsound scores as the default, and is a finding unless the
//! format lets it be left out.

use std::path::{Path, PathBuf};

use mateval_image::{Texels, Texture, Wrap};
use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::manifest::{sha256_of_bytes, sha256_of_file};
use mateval_scene::submission::{GREY, Map};
use mateval_scene::{Finding, Severity};

use crate::map_file::{self, MAX_MAP_BYTES, MapFile, candidates, check_place, is_there};

/// What a missing roughness scores as; perceptual.
pub const MISSING_ROUGHNESS: f32 = 0.5;

/// What a missing metallic scores as.
pub const MISSING_METALLIC: f32 = 0.0;

/// One instance's maps. A map that is the same everywhere is one texel.
#[derive(Clone, Debug)]
pub struct PredictedMaterial {
    /// Linear at lookup.
    pub base_color: Texture,
    /// Perceptual, 0 to 1; all three channels the same.
    pub roughness: Texture,
    /// 0 to 1; all three channels the same.
    pub metallic: Texture,
}

impl PredictedMaterial {
    /// A map's texture.
    pub fn texture(&self, map: Map) -> &Texture {
        match map {
            Map::BaseColor => &self.base_color,
            Map::Roughness => &self.roughness,
            Map::Metallic => &self.metallic,
        }
    }
}

/// One scene's maps, in the order of the scene's instances.
#[derive(Clone, Debug)]
pub struct PredictedScene {
    /// None for instances without an atlas.
    pub materials: Vec<Option<PredictedMaterial>>,
    /// SHA-256, hex, over all texels of roughness and metallic as they were decoded. Submissions of equal keys have the same
    /// roughness and metallic at every place of the scene, whatever files say so; those of others may.
    pub scattering_key: String,
    /// What was wrong and what is scored instead.
    pub findings: Vec<Finding>,
    /// Path in the submission and SHA-256 of every map that is there.
    pub files: Vec<(String, String)>,
}

/// Most bytes that the texels of a scene's maps may take in memory together.
pub const MAX_SCENE_BYTES: usize = 8 << 30;

/// Reads the maps of one scene.
pub fn read_scene(submission: &Path, scene: &SceneFile) -> PredictedScene {
    let (mut findings, mut files) = (Vec::new(), Vec::new());
    let mut room = Room { bytes: MAX_SCENE_BYTES };
    let materials: Vec<Option<PredictedMaterial>> = scene
        .instances
        .iter()
        .map(|instance| {
            instance.atlas.as_ref()?;
            let mut map = |map| read_map(submission, scene, instance, map, &mut room, &mut findings);
            let [base_color, roughness, metallic] = Map::ALL.map(&mut map);
            files.extend(files_there(submission, scene, instance));
            Some(PredictedMaterial { base_color, roughness, metallic })
        })
        .collect();
    PredictedScene { scattering_key: scattering_key(&materials), materials, findings, files }
}

/// One map, or its default.
fn read_map(
    submission: &Path,
    scene: &SceneFile,
    instance: &Instance,
    map: Map,
    room: &mut Room,
    findings: &mut Vec<Finding>,
) -> Texture {
    let candidates = candidates(submission, &scene.id, &instance.id, map);
    let present: Vec<&PathBuf> = candidates.iter().filter(|path| is_there(path)).collect();
    let fault = match present.as_slice() {
        [path] => match map_file::read(submission, path, map) {
            Ok(file) => match room.holding(in_memory(file, map)) {
                Some(texture) => return texture,
                None => replaced("unsound_map", &relative(submission, path), map, &Room::full()),
            },
            Err(fault) => {
                let finding = replaced("unsound_map", &relative(submission, path), map, &fault.message);
                Finding { place: fault.place, ..finding }
            }
        },
        // The format lets the others be left out.
        [] if map != Map::BaseColor => return default_of(map),
        [] => {
            let message = "expected a PNG or an EXR, found none";
            replaced("missing_map", &relative(submission, &candidates[0]), map, message)
        }
        _ => {
            let message = "found both a PNG and an EXR; expected one of them";
            replaced("ambiguous_map", &relative(submission, &candidates[0]), map, message)
        }
    };
    findings.push(fault);
    default_of(map)
}

/// What is left for a scene's texels in memory.
pub struct Room {
    /// Bytes that may still be taken.
    pub bytes: usize,
}

impl Room {
    /// The texture, if there is room for it.
    pub fn holding(&mut self, texture: Texture) -> Option<Texture> {
        self.bytes = self.bytes.checked_sub(texture.bytes().len())?;
        Some(texture)
    }

    /// What is wrong where there is none.
    pub fn full() -> String {
        format!("the maps of its scene take more than {MAX_SCENE_BYTES} bytes together")
    }
}

/// What scores where a map is missing or unsound.
fn default_of(map: Map) -> Texture {
    one_texel(match map {
        Map::BaseColor => GREY,
        Map::Roughness => MISSING_ROUGHNESS,
        Map::Metallic => MISSING_METALLIC,
    })
}

fn one_texel(value: f32) -> Texture {
    Texture::new(1, 1, Texels::Grey(vec![value]), Wrap::Clamp).expect("one texel is what one pixel needs")
}

/// Every map that is there with its hash: what a result was made of, whatever was made of it. A file that is too large to
/// be read as a map has none: hashing it would take as long as its maker likes.
fn files_there(submission: &Path, scene: &SceneFile, instance: &Instance) -> Vec<(String, String)> {
    let paths = Map::ALL.into_iter().flat_map(|map| candidates(submission, &scene.id, &instance.id, map));
    let is_bounded = |path: &PathBuf| path.metadata().is_ok_and(|data| data.len() <= MAX_MAP_BYTES);
    let inside = paths.filter(|path| check_place(submission, path).is_ok() && is_bounded(path));
    inside.filter_map(|path| Some((relative(submission, &path), sha256_of_file(&path).ok()?))).collect()
}

/// Path in the submission and SHA-256 of every map of the scene that is there, as [`read_scene`] tells them.
pub fn map_files(submission: &Path, scene: &SceneFile) -> Vec<(String, String)> {
    let recovered = scene.instances.iter().filter(|instance| instance.atlas.is_some());
    recovered.flat_map(|instance| files_there(submission, scene, instance)).collect()
}

fn relative(submission: &Path, path: &Path) -> String {
    path.strip_prefix(submission).unwrap_or(path).to_string_lossy().replace('\\', "/")
}

/// In as little memory as holds it. Equal scalars everywhere become one float, whatever they were stored as.
pub fn in_memory(file: MapFile, map: Map) -> Texture {
    let texture = file.texture.collapsed();
    if map != Map::BaseColor && texture.width() == 1 { one_texel(texture.texel(0, 0)[0]) } else { texture }
}

fn scattering_key(materials: &[Option<PredictedMaterial>]) -> String {
    let mut text = String::new();
    for material in materials {
        for texture in material.iter().flat_map(|material| [&material.roughness, &material.metallic]) {
            let kind = if matches!(texture.texels(), Texels::Grey8(_)) { "bytes" } else { "floats" };
            text.push_str(&format!("{kind} {} {}\n", texture.width(), sha256_of_bytes(texture.bytes())));
        }
    }
    sha256_of_bytes(text.as_bytes())
}

fn replaced(code: &str, file: &str, map: Map, message: &str) -> Finding {
    let scored = match map {
        Map::BaseColor => format!("base colour {GREY} (linear)"),
        Map::Roughness => format!("roughness {MISSING_ROUGHNESS}"),
        Map::Metallic => format!("metallic {MISSING_METALLIC}"),
    };
    Finding {
        severity: Severity::Warning,
        code: code.to_owned(),
        file: file.to_owned(),
        place: String::new(),
        message: message.to_owned(),
        action: format!("scored as {scored}"),
    }
}

#[cfg(test)]
mod tests {
    use mateval_image::exr_io::{self, Precision};
    use mateval_image::{LinearRgb, Picture, png_io};
    use serde_json::json;

    use super::*;

    /// A scene of an instance `a` with an atlas, a pane without, and `b`.
    fn scene() -> SceneFile {
        let instance = |id: &str, index: usize, atlas: bool| {
            let atlas =
                atlas.then(|| json!({"size": 64, "charts": 1, "coverage": 1.0, "texel_m": 0.1, "half_pixel_m": null}));
            json!({"id": id, "index": index, "name": id, "category": null, "super_category": null, "triangles": 2,
                   "atlas": atlas})
        };
        serde_json::from_value(json!({
            "format": "mateval/1", "id": "s", "source": {"kind": "test", "house": "s", "files": []}, "exposure": 1.0,
            "views": [], "instances": [instance("a", 1, true), instance("pane", 2, false), instance("b", 3, true)],
            "parts": [], "part_sets": [], "findings": [],
        }))
        .unwrap()
    }

    /// A submission with sound maps.
    fn sound() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for instance in ["a", "b"] {
            std::fs::create_dir_all(folder.path().join("scenes/s").join(instance)).unwrap();
            let colors = Picture::from_fn(64, 64, |x, y| [x as u8, y as u8, 200]);
            png_io::write_rgb_bytes(&file(&folder, instance, "base_color.png"), &colors).unwrap();
            for name in ["roughness.png", "metallic.png"] {
                let greys = Picture::from_fn(64, 64, |x, y| (x + y) as u8);
                png_io::write_grey_bytes(&file(&folder, instance, name), &greys).unwrap();
            }
        }
        folder
    }

    fn file(folder: &tempfile::TempDir, instance: &str, name: &str) -> PathBuf {
        folder.path().join("scenes/s").join(instance).join(name)
    }

    fn read(folder: &tempfile::TempDir) -> PredictedScene {
        read_scene(folder.path(), &scene())
    }

    fn constant(texture: &Texture) -> Option<f32> {
        (texture.width() == 1).then(|| texture.texel(0, 0)[0])
    }

    #[test]
    fn scalars_are_linear_and_read_from_every_kind_of_file() {
        let folder = sound();
        png_io::write_rgb_bytes(
            &file(&folder, "b", "roughness.png"),
            &Picture::from_fn(64, 64, |x, _| [x as u8, 9, 9]),
        )
        .unwrap();
        std::fs::remove_file(file(&folder, "b", "metallic.png")).unwrap();
        let values = Picture::from_fn(128, 128, |x, _| x as f32 / 128.0);
        exr_io::write_scalar(&file(&folder, "b", "metallic.exr"), &values, Precision::Float).unwrap();
        png_io::write_ids(&file(&folder, "a", "metallic.png"), &Picture::from_fn(64, 64, |x, _| 1000 * x as u16))
            .unwrap();
        let read = read(&folder);
        assert_eq!(read.findings, Vec::new());
        let [Some(a), None, Some(b)] = read.materials.as_slice() else { panic!("{:?}", read.materials.len()) };
        assert_eq!(a.roughness.texel(20, 31), [51.0 / 255.0; 3]);
        assert_eq!(a.metallic.texel(20, 31), [20_000.0 / 65_535.0; 3]);
        assert_eq!(b.roughness.texel(20, 31), [20.0 / 255.0; 3]);
        assert_eq!((b.metallic.width(), b.metallic.texel(96, 5)), (128, [0.75; 3]));
    }

    #[test]
    fn what_may_be_left_out_has_a_default_and_no_finding() {
        let folder = sound();
        for name in ["roughness.png", "metallic.png"] {
            std::fs::remove_file(file(&folder, "a", name)).unwrap();
        }
        let read = read(&folder);
        let a = read.materials[0].as_ref().unwrap();
        assert_eq!((constant(&a.roughness), constant(&a.metallic)), (Some(0.5), Some(0.0)));
        assert_eq!(read.findings, Vec::new());
        // Three of b, one of a; the twin: with all of them there are six.
        assert_eq!((read.files.len(), super::read_scene(sound().path(), &scene()).files.len()), (4, 6));
    }

    #[test]
    fn a_scene_has_so_much_room_and_no_more() {
        let texture = |side: usize| Texture::new(side, side, Texels::Grey8(vec![0; side * side]), Wrap::Clamp).unwrap();
        let mut room = Room { bytes: 150 };
        assert!(room.holding(texture(10)).is_some() && room.holding(texture(8)).is_none());
        assert!(room.holding(texture(7)).is_some() && room.bytes == 1);
    }

    /// Almost all of it is a hole, that takes no room on the disk.
    #[test]
    fn what_is_too_large_to_be_read_is_not_hashed_either() {
        let folder = sound();
        let path = file(&folder, "a", "roughness.png");
        std::fs::File::options().write(true).open(&path).unwrap().set_len(1 << 30).unwrap();
        let read = read(&folder);
        assert_eq!(read.files.len(), 5);
        let [finding] = read.findings.as_slice() else { panic!("{:?}", read.findings) };
        assert!(finding.code == "unsound_map" && finding.message.contains("more than 536870912 bytes"), "{finding}");
    }

    /// A map, the finding's code, a word of its action, and the fault.
    type Fault = (Map, &'static str, &'static str, fn(&Path));

    const FAULTS: [Fault; 10] = [
        (Map::BaseColor, "missing_map", "base colour 0.5", |png| std::fs::remove_file(png).unwrap()),
        (Map::BaseColor, "ambiguous_map", "base colour 0.5", |png| {
            let grey = Picture::filled(64, 64, LinearRgb([0.1; 3]));
            exr_io::write_linear(&png.with_extension("exr"), &grey, Precision::Half).unwrap();
        }),
        (Map::Roughness, "ambiguous_map", "roughness 0.5", |png| write_exr(png, 64, 0.1)),
        (Map::Metallic, "ambiguous_map", "metallic 0", |png| write_exr(png, 64, 0.1)),
        (Map::Roughness, "unsound_map", "roughness 0.5", |png| write_exr_alone(png, 64, 1.01)),
        (Map::Metallic, "unsound_map", "metallic 0", |png| write_exr_alone(png, 64, -0.01)),
        (Map::Metallic, "unsound_map", "metallic 0", |png| write_exr_alone(png, 64, f32::NAN)),
        (Map::Roughness, "unsound_map", "roughness 0.5", |png| write_exr_alone(png, 32, 0.1)),
        (Map::Roughness, "unsound_map", "roughness 0.5", |png| {
            png_io::write_grey_bytes(png, &Picture::filled(128, 64, 9)).unwrap();
        }),
        (Map::Metallic, "unsound_map", "metallic 0", |png| std::fs::write(png, b"not a picture").unwrap()),
    ];

    fn write_exr(png: &Path, size: usize, value: f32) {
        let picture = Picture::filled(size, size, value);
        exr_io::write_scalar(&png.with_extension("exr"), &picture, Precision::Float).unwrap();
    }

    fn write_exr_alone(png: &Path, size: usize, value: f32) {
        std::fs::remove_file(png).unwrap();
        write_exr(png, size, value);
    }

    #[test]
    fn every_fault_is_one_finding_that_says_what_is_scored() {
        for (at, (map, code, scored, damage)) in FAULTS.into_iter().enumerate() {
            let folder = sound();
            damage(&file(&folder, "a", &format!("{}.png", map.stem())));
            let read = read(&folder);
            let [finding] = read.findings.as_slice() else { panic!("{at}: {:?}", read.findings) };
            assert_eq!((finding.code.as_str(), finding.action.as_str().contains(scored)), (code, true), "{finding}");
            assert!(finding.file.starts_with(&format!("scenes/s/a/{}.", map.stem())), "{finding}");
            let damaged = read.materials[0].as_ref().unwrap();
            for other in Map::ALL {
                let expected = (other == map).then(|| constant(&default_of(map)).unwrap());
                assert_eq!(constant(damaged.texture(other)), expected, "{at}");
            }
            assert!(constant(&read.materials[2].as_ref().unwrap().roughness).is_none());
        }
    }

    /// The key is of values: how they are stored does not enter, base colours do not, every scalar does.
    #[test]
    fn keys_are_equal_for_equal_scattering_only() {
        let key = |change: fn(&tempfile::TempDir)| {
            let folder = sound();
            change(&folder);
            read(&folder).scattering_key
        };
        let plain = key(|_| {});
        assert_eq!(plain, key(|folder| std::fs::remove_file(file(folder, "a", "base_color.png")).unwrap()));
        let as_rgb = |folder: &tempfile::TempDir| {
            let greys = Picture::from_fn(64, 64, |x, y| [(x + y) as u8; 3]);
            png_io::write_rgb_bytes(&file(folder, "a", "roughness.png"), &greys).unwrap();
        };
        assert_eq!(plain, key(as_rgb));
        let one_texel = |folder: &tempfile::TempDir| {
            let greys = Picture::from_fn(64, 64, |x, y| (x + y) as u8 + u8::from((x, y) == (63, 63)));
            png_io::write_grey_bytes(&file(folder, "b", "metallic.png"), &greys).unwrap();
        };
        let no_roughness =
            |folder: &tempfile::TempDir| std::fs::remove_file(file(folder, "a", "roughness.png")).unwrap();
        let no_metal = |folder: &tempfile::TempDir| std::fs::remove_file(file(folder, "a", "metallic.png")).unwrap();
        let black = |folder: &tempfile::TempDir| {
            png_io::write_grey_bytes(&file(folder, "a", "metallic.png"), &Picture::filled(128, 128, 0)).unwrap();
        };
        let others = [key(one_texel), key(no_roughness), key(no_metal)];
        assert!(others.iter().all(|other| *other != plain) && others[1] != others[2]);
        // No metallic is the default, 0; so says a file of zeros, of whatever size.
        assert_eq!(key(no_metal), key(black));
    }
}
