//! The maps that a submission holds for one scene, ready to be rendered.
//!
//! A missing or unusable map is replaced by a default, which is scored and reported as a finding. A map that the format
//! makes optional may be missing without a finding.

use std::path::Path;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::submission::Map;
use mateval_dataset::{DatasetError, Finding, Severity};
use mateval_files::untrusted::sha256_of_bytes;
use mateval_image::{Texels, Texture, Wrap};

use crate::atlas::AtlasMeshes;
use crate::error::{FileFault, finding};
use crate::files::{HashedFile, MapFolder, SubmittedFile, relative};
use crate::map_file::{self, MapFile, default_value};

/// Most bytes that the texels of a scene's maps may take in memory together.
pub const MAX_SCENE_BYTES: usize = 8 << 30;

/// The code of a finding about a base colour that a submission lacks.
pub const MISSING_MAP: &str = "missing_map";

/// One instance's maps. A map with the same value everywhere has one texel.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedMaterial {
    /// Linear at lookup.
    pub base_color: Texture,
    /// Perceptual, 0 to 1; all three channels the same.
    pub roughness: Texture,
    /// 0 to 1; all three channels the same.
    pub metallic: Texture,
}

impl PredictedMaterial {
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
    /// SHA-256, hex, over all decoded texels of roughness and metallic. Submissions with equal keys have the same
    /// roughness and metallic everywhere in the scene, however their files store them. Different keys prove nothing.
    pub scattering_key: String,
    /// Every fault, with what is scored instead.
    pub findings: Vec<Finding>,
    /// Every map that could be read, with the hash of the bytes that [`PredictedScene::materials`] were decoded from. A
    /// file that cannot be decoded, or stands beside another of the same map, is hashed too.
    pub files: Vec<HashedFile>,
}

/// Reads, hashes and decodes the maps of one scene, each file once. `atlases` are the scene's; a submission without bad
/// texels does not need them. Every fault of the submission is a finding; the call fails only where the atlases cannot
/// be read.
pub fn read_scene(
    submission: &Path,
    scene: &SceneFile,
    atlases: &AtlasMeshes<'_>,
) -> Result<PredictedScene, DatasetError> {
    let (memory, findings, files) = (MemoryBudget::of_scene(), Vec::new(), Vec::new());
    let mut reader = Reader { submission, scene, atlases, memory, findings, files };
    let instances = 0..scene.instances.len();
    let materials = instances.map(|at| reader.material(at)).collect::<Result<Vec<_>, DatasetError>>()?;
    let Reader { findings, files, .. } = reader;
    Ok(PredictedScene { scattering_key: scattering_key(&materials), materials, findings, files })
}

/// Reads maps one by one and gathers what is known about their files.
struct Reader<'a> {
    submission: &'a Path,
    scene: &'a SceneFile,
    atlases: &'a AtlasMeshes<'a>,
    memory: MemoryBudget,
    findings: Vec<Finding>,
    files: Vec<HashedFile>,
}

impl Reader<'_> {
    /// The maps of the instance at a place of the scene; none without an atlas.
    fn material(&mut self, at: usize) -> Result<Option<PredictedMaterial>, DatasetError> {
        if self.scene.instances[at].atlas.is_none() {
            return Ok(None);
        }
        let mut texture = |map| self.texture(at, map);
        let base_color = texture(Map::BaseColor)?;
        let (roughness, metallic) = (texture(Map::Roughness)?, texture(Map::Metallic)?);
        Ok(Some(PredictedMaterial { base_color, roughness, metallic }))
    }

    fn texture(&mut self, at: usize, map: Map) -> Result<Texture, DatasetError> {
        let (scene, instance) = (&self.scene.id, &self.scene.instances[at].id);
        let folder = MapFolder { submission: self.submission, scene, instance };
        let present = folder.present(map);
        let fault = match present.as_slice() {
            [path] => match self.decoded(folder, path, at, map)? {
                Ok(texture) => return Ok(texture),
                Err(finding) => *finding,
            },
            // Roughness and metallic are optional.
            [] if map != Map::BaseColor => return Ok(one_texel(default_value(map))),
            [] => self.replaced(MISSING_MAP, &folder.candidates(map)[0], map, "expected a PNG or an EXR, found none"),
            several => {
                // Neither is scored, but both belong to the submission's hash. An unreadable one has no hash.
                several.iter().for_each(|path| drop(self.read(folder, path)));
                let message = "found both a PNG and an EXR; expected one of them";
                self.replaced("ambiguous_map", &several[0], map, message)
            }
        };
        self.findings.push(fault);
        Ok(one_texel(default_value(map)))
    }

    /// The map of a file, or the finding that it is replaced. Fails only where the atlas cannot be read.
    fn decoded(
        &mut self,
        folder: MapFolder<'_>,
        path: &Path,
        at: usize,
        map: Map,
    ) -> Result<Result<Texture, Box<Finding>>, DatasetError> {
        let atlases = self.atlases;
        let decoded = match self.read(folder, path) {
            Ok(file) => map_file::decode(file, map, || atlases.mesh(at))?,
            Err(fault) => Err(fault),
        };
        let mut file = match decoded {
            Ok(file) => file,
            Err(fault) => {
                let finding = self.replaced("unsound_map", path, map, &fault.message);
                return Ok(Err(Box::new(Finding { place: fault.place, ..finding })));
            }
        };
        let bad_texels = file.bad_texels.take();
        let Some(texture) = self.memory.holding(compact_texture(file, map)) else {
            return Ok(Err(Box::new(self.replaced("unsound_map", path, map, &MemoryBudget::exceeded()))));
        };
        let name = relative(self.submission, path);
        self.findings.extend(bad_texels.map(|fault| fault.into_finding(Severity::Warning, name)));
        Ok(Ok(texture))
    }

    fn read(&mut self, folder: MapFolder<'_>, path: &Path) -> Result<SubmittedFile, FileFault> {
        let file = folder.read(path)?;
        self.files.push(file.hashed.clone());
        Ok(file)
    }

    /// The finding that a map's default is scored.
    fn replaced(&self, code: &str, path: &Path, map: Map, message: &str) -> Finding {
        let value = default_value(map);
        let scored = match map {
            Map::BaseColor => format!("base colour {value} (linear)"),
            Map::Roughness => format!("roughness {value}"),
            Map::Metallic => format!("metallic {value}"),
        };
        let file = relative(self.submission, path);
        finding(Severity::Warning, code, &file, message, format!("scored as {scored}"))
    }
}

pub fn one_texel(value: f32) -> Texture {
    Texture::new(1, 1, Texels::Grey(vec![value]), Wrap::Clamp).expect("one texel is what one pixel needs")
}

/// The map's texture, reduced to one texel if all texels are equal. Constant roughness and metallic become one float,
/// so that files of different types with the same value give equal textures.
pub fn compact_texture(file: MapFile, map: Map) -> Texture {
    let texture = file.texture.collapsed();
    if map != Map::BaseColor && texture.width() == 1 { one_texel(texture.texel(0, 0)[0]) } else { texture }
}

/// The value of [`PredictedScene::scattering_key`] for these materials.
pub fn scattering_key(materials: &[Option<PredictedMaterial>]) -> String {
    let mut text = String::new();
    for material in materials {
        for texture in material.iter().flat_map(|material| [&material.roughness, &material.metallic]) {
            let kind = if matches!(texture.texels(), Texels::Grey8(_)) { "bytes" } else { "floats" };
            text.push_str(&format!("{kind} {} {}\n", texture.width(), sha256_of_bytes(texture.bytes())));
        }
    }
    sha256_of_bytes(text.as_bytes())
}

/// The memory that is left for the texels of a scene.
pub(crate) struct MemoryBudget {
    bytes_left: usize,
}

impl MemoryBudget {
    /// The budget of a scene, none of it used.
    pub(crate) fn of_scene() -> Self {
        Self { bytes_left: MAX_SCENE_BYTES }
    }

    /// Gives the texture back and counts its texels; absent if they exceed the budget.
    pub(crate) fn holding(&mut self, texture: Texture) -> Option<Texture> {
        self.bytes_left = self.bytes_left.checked_sub(texture.bytes().len())?;
        Some(texture)
    }

    /// What is wrong where the budget is exceeded.
    pub(crate) fn exceeded() -> String {
        format!("the maps of its scene take more than {MAX_SCENE_BYTES} bytes together")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use mateval_dataset::TriangleMesh;
    use mateval_image::exr_io::{self, Precision};
    use mateval_image::{LinearRgb, Picture, png_io};
    use mateval_testkit::scenes::quad;
    use serde_json::json;
    use std::collections::BTreeMap;
    use std::path::PathBuf;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// A scene of an instance `a` with an atlas, a pane without, and `b`.
    fn scene() -> SceneFile {
        let instance = |id: &str, index: usize, atlas: bool| {
            let atlas =
                atlas.then(|| json!({"size": 64, "charts": 1, "coverage": 1.0, "texel_m": 0.1, "half_pixel_m": null}));
            json!({"id": id, "index": index, "name": id, "role": {"type": "other"}, "category": null, "super_category": null, "triangles": 2,
                   "atlas": atlas})
        };
        serde_json::from_value(json!({
            "format": "mateval/3", "id": "s", "source": {"kind": "bitterli", "house": "s", "states_roughness": true,
                       "states_metallic": true, "files": []},
            "lights": "own", "materials": "converted", "exposure": 1.0,
            "views": [], "instances": [instance("a", 1, true), instance("pane", 2, false), instance("b", 3, true)],
            "parts": [], "part_sets": [], "findings": [],
        }))
        .unwrap()
    }

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

    /// Three atlases of two triangles that cover all texels.
    fn atlases() -> Vec<TriangleMesh> {
        vec![quad(Vec3::ZERO, Vec3::X, Vec3::Y); 3]
    }

    fn read(folder: &tempfile::TempDir) -> PredictedScene {
        read_scene(folder.path(), &scene(), &AtlasMeshes::in_memory(&atlases())).unwrap()
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
        let found = read(&folder);
        let a = found.materials[0].as_ref().unwrap();
        assert_eq!((constant(&a.roughness), constant(&a.metallic)), (Some(0.5), Some(0.0)));
        assert_eq!(found.findings, Vec::new());
        // Three of b, one of a; the twin: with all of them there are six.
        assert_eq!((found.files.len(), read(&sound()).files.len()), (4, 6));
    }

    /// The file is sparse and takes hardly any disk space.
    #[test]
    fn a_file_too_large_to_read_has_no_hash() {
        let folder = sound();
        let path = file(&folder, "a", "roughness.png");
        std::fs::File::options().write(true).open(&path).unwrap().set_len(1 << 30).unwrap();
        let read = read(&folder);
        assert_eq!(read.files.len(), 5);
        let [finding] = read.findings.as_slice() else { panic!("{:?}", read.findings) };
        assert!(finding.code == "unsound_map" && finding.message.contains("more than 536870912 bytes"), "{finding}");
    }

    /// A map, the expected code, a part of the expected action, and the change to the map's file.
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
                let expected = (other == map).then(|| constant(&one_texel(default_value(map))).unwrap());
                assert_eq!(constant(damaged.texture(other)), expected, "{at}");
            }
            assert!(constant(&read.materials[2].as_ref().unwrap().roughness).is_none());
        }
    }

    /// Replaces roughness or metallic of `a` by an EXR whose texels are 0.25, except some that are `value`.
    fn plant(folder: &tempfile::TempDir, map: Map, value: f32, is_bad: impl Fn(usize, usize) -> bool) {
        let png = file(folder, "a", &format!("{}.png", map.stem()));
        std::fs::remove_file(&png).unwrap();
        let picture = Picture::from_fn(64, 64, |x, y| if is_bad(x, y) { value } else { 0.25 });
        exr_io::write_scalar(&png.with_extension("exr"), &picture, Precision::Float).unwrap();
    }

    /// One bad texel is a finding of its own, and its map is scored.
    #[test]
    fn one_bad_texel_does_not_replace_its_map() {
        for (map, value) in [(Map::Roughness, f32::NAN), (Map::Metallic, f32::NEG_INFINITY), (Map::Metallic, 1.01)] {
            let folder = sound();
            plant(&folder, map, value, |x, y| (x, y) == (20, 31));
            let read = read(&folder);
            let [finding] = read.findings.as_slice() else { panic!("{:?}", read.findings) };
            assert_eq!((finding.code.as_str(), finding.severity), ("bad_texels", Severity::Warning));
            assert_eq!(
                (finding.file.as_str(), finding.place.as_str()),
                (format!("scenes/s/a/{}.exr", map.stem()).as_str(), "texel (20, 31)")
            );
            assert!(finding.message.starts_with("1 of the 4096 texels"), "{finding}");
            assert!(finding.message.ends_with(&value.to_string()), "{finding}");
            // Its neighbours are all 0.25, so the map became constant.
            assert_eq!(constant(read.materials[0].as_ref().unwrap().texture(map)), Some(0.25));
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

    /// A map is replaced over and over while scenes are read: each hash is of the version whose texels were decoded.
    /// The versions are large enough to be replaced between two readings of the same file, if there were two.
    #[test]
    fn a_hash_is_of_the_bytes_that_were_decoded() {
        let folder = sound();
        let map = file(&folder, "a", "roughness.png");
        let versions = [40_u8, 200].map(|first| {
            let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + x * y * 31) >> 3) as u8;
            let texels = Picture::from_fn(512, 512, |x, y| if x + y == 0 { first } else { noise(x, y) });
            let place = folder.path().join(format!("version_{first}"));
            png_io::write_grey_bytes(&place, &texels).unwrap();
            (f32::from(first) / 255.0, sha256_of_bytes(&std::fs::read(&place).unwrap()), place)
        });
        std::fs::copy(&versions[0].2, &map).unwrap();
        let (done, mut reads) = (AtomicBool::new(false), BTreeMap::new());
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let next = map.with_extension("next");
                for (.., place) in versions.iter().cycle().take_while(|_| !done.load(Ordering::Relaxed)) {
                    std::fs::hard_link(place, &next).unwrap();
                    std::fs::rename(&next, &map).unwrap();
                    // Renaming one link of a file to another does nothing.
                    let _ = std::fs::remove_file(&next);
                }
            });
            let start = std::time::Instant::now();
            while (reads.len() < 2 || reads.values().any(|count| *count < 30)) && start.elapsed().as_secs() < 30 {
                let read = read(&folder);
                let value = read.materials[0].as_ref().unwrap().roughness.texel(0, 0)[0];
                let hashed = read.files.into_iter().find(|file| file.path == "scenes/s/a/roughness.png");
                let version = versions.iter().position(|(version, ..)| *version == value);
                *reads.entry((version, hashed.map(|file| file.sha256))).or_insert(0) += 1;
            }
            done.store(true, Ordering::Relaxed);
        });
        let expected: Vec<_> =
            versions.iter().enumerate().map(|(at, (_, sha256, _))| (Some(at), Some(sha256.clone()))).collect();
        assert_eq!(reads.keys().cloned().collect::<Vec<_>>(), expected, "{reads:?}");
    }

    #[test]
    fn textures_are_counted_until_the_budget_is_used_up() {
        let texture = |side: usize| Texture::new(side, side, Texels::Grey8(vec![0; side * side]), Wrap::Clamp).unwrap();
        let mut budget = MemoryBudget { bytes_left: 150 };
        assert!(budget.holding(texture(10)).is_some() && budget.holding(texture(8)).is_none());
        assert!(budget.holding(texture(7)).is_some() && budget.bytes_left == 1);
    }
}
