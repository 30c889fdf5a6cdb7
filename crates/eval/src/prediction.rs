//! A submission's maps, read for one scene; what is missing or unsound is a finding and scores as the default.

use std::path::{Path, PathBuf};

use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Texels, Texture, Wrap};
use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::manifest::sha256_of_file;
use mateval_scene::submission::{GREY, MAP_SIZES, Map, instance_folder};
use mateval_scene::{Finding, Severity};

/// What a base colour may be, linear; a stray value must not swamp the mean over all pixels.
pub const BASE_COLOR_RANGE: std::ops::RangeInclusive<f32> = -1.0..=16.0;

/// One instance's maps.
#[derive(Clone, Debug)]
pub struct PredictedMaterial {
    /// Linear at lookup.
    pub base_color: Texture,
}

/// One scene's maps, in the order of the scene's instances.
#[derive(Clone, Debug)]
pub struct PredictedScene {
    /// None for instances without an atlas.
    pub materials: Vec<Option<PredictedMaterial>>,
    /// What was wrong and what is scored instead.
    pub findings: Vec<Finding>,
    /// Path in the submission and SHA-256 of every map that is there.
    pub files: Vec<(String, String)>,
}

/// Reads the maps of one scene.
pub fn read_scene(submission: &Path, scene: &SceneFile) -> PredictedScene {
    let mut read = PredictedScene { materials: Vec::new(), findings: Vec::new(), files: Vec::new() };
    for instance in &scene.instances {
        let material = instance.atlas.is_some().then(|| {
            let base_color = read_base_color(submission, scene, instance, &mut read);
            note_files(submission, scene, instance, &mut read);
            let grey = Texels::Grey(vec![GREY]);
            let default = || Texture::new(1, 1, grey, Wrap::Clamp).expect("one texel is what one pixel needs");
            PredictedMaterial { base_color: base_color.unwrap_or_else(default) }
        });
        read.materials.push(material);
    }
    read
}

fn read_base_color(
    submission: &Path,
    scene: &SceneFile,
    instance: &Instance,
    read: &mut PredictedScene,
) -> Option<Texture> {
    let candidates = candidates(submission, scene, instance, Map::BaseColor);
    let file = relative(submission, &candidates[0]);
    let present: Vec<&PathBuf> = candidates.iter().filter(|path| path.is_file()).collect();
    let found = match present.as_slice() {
        [path] => read_sound(path),
        [] => {
            read.findings.push(replaced("missing_map", &file, "expected a PNG or an EXR, found none"));
            return None;
        }
        _ => {
            let message = "found both a PNG and an EXR; expected one of them";
            read.findings.push(replaced("ambiguous_map", &file, message));
            return None;
        }
    };
    let unsound = |message: String| replaced("unsound_map", &relative(submission, present[0]), &message);
    found.map_err(|message| read.findings.push(unsound(message))).ok()
}

/// Notes every map that is there with its hash: what a result was made of, whatever was made of it.
fn note_files(submission: &Path, scene: &SceneFile, instance: &Instance, read: &mut PredictedScene) {
    for path in Map::ALL.into_iter().flat_map(|map| candidates(submission, scene, instance, map)) {
        if let Ok(hash) = sha256_of_file(&path) {
            read.files.push((relative(submission, &path), hash));
        }
    }
}

/// Where a map may lie.
fn candidates(submission: &Path, scene: &SceneFile, instance: &Instance, map: Map) -> [PathBuf; 2] {
    let folder = instance_folder(submission, &scene.id, &instance.id);
    ["png", "exr"].map(|ending| folder.join(map.stem()).with_extension(ending))
}

fn relative(submission: &Path, path: &Path) -> String {
    path.strip_prefix(submission).unwrap_or(path).to_string_lossy().replace('\\', "/")
}

/// The texture, or what is wrong with it.
fn read_sound(path: &Path) -> Result<Texture, String> {
    let texture = read_texture(path, Encoding::Srgb, Wrap::Clamp).map_err(|error| error.to_string())?;
    let (width, height) = (texture.width(), texture.height());
    if width != height || !MAP_SIZES.contains(&width) {
        let (least, most) = (MAP_SIZES.start(), MAP_SIZES.end());
        return Err(format!("{width}x{height} texels; expected a square of {least} to {most} a side"));
    }
    if let Texels::Linear(values) = texture.texels()
        && let Some(value) = values.iter().flatten().find(|value| !BASE_COLOR_RANGE.contains(value))
    {
        let (least, most) = (BASE_COLOR_RANGE.start(), BASE_COLOR_RANGE.end());
        return Err(format!("a base colour of {value}; expected {least} to {most}"));
    }
    Ok(texture.collapsed())
}

fn replaced(code: &str, file: &str, message: &str) -> Finding {
    Finding {
        severity: Severity::Warning,
        code: code.to_owned(),
        file: file.to_owned(),
        place: String::new(),
        message: message.to_owned(),
        action: format!("scored as base colour {GREY} (linear)"),
    }
}
