//! A submission's maps, read for one scene; what is missing or unsound is a finding and scores as the default.

use std::path::Path;

use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Texels, Texture, Wrap};
use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::manifest::sha256_of_file;
use mateval_scene::submission::{Map, instance_folder};
use mateval_scene::{Finding, Severity};

/// What a missing base colour scores as, linear.
pub const DEFAULT_BASE_COLOR: f32 = 0.5;

/// Texels a side that a submission may use.
pub const SIZES: std::ops::RangeInclusive<usize> = 64..=4096;

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
    /// Path in the submission and SHA-256 of every file that was read.
    pub files: Vec<(String, String)>,
}

/// Reads the maps of one scene.
pub fn read_scene(submission: &Path, scene: &SceneFile) -> PredictedScene {
    let mut read = PredictedScene { materials: Vec::new(), findings: Vec::new(), files: Vec::new() };
    for instance in &scene.instances {
        let material = instance.atlas.is_some().then(|| {
            let base_color = read_map(submission, scene, instance, Map::BaseColor, &mut read);
            let grey = Texels::Grey(vec![DEFAULT_BASE_COLOR]);
            let default = || Texture::new(1, 1, grey, Wrap::Clamp).expect("one texel is what one pixel needs");
            PredictedMaterial { base_color: base_color.unwrap_or_else(default) }
        });
        read.materials.push(material);
    }
    read
}

fn read_map(
    submission: &Path,
    scene: &SceneFile,
    instance: &Instance,
    map: Map,
    read: &mut PredictedScene,
) -> Option<Texture> {
    let folder = instance_folder(submission, &scene.id, &instance.id);
    let candidates = ["png", "exr"].map(|ending| folder.join(map.stem()).with_extension(ending));
    let present: Vec<&std::path::PathBuf> = candidates.iter().filter(|path| path.is_file()).collect();
    let relative = |path: &Path| path.strip_prefix(submission).unwrap_or(path).to_string_lossy().replace('\\', "/");
    let path = match present.as_slice() {
        [path] => *path,
        [] => {
            read.findings.push(replaced(
                "missing_map",
                &relative(&candidates[0]),
                "expected a PNG or an EXR, found none",
            ));
            return None;
        }
        _ => {
            let message = "found both a PNG and an EXR; expected one of them";
            read.findings.push(replaced("ambiguous_map", &relative(&candidates[0]), message));
            return None;
        }
    };
    match read_sound(path, map) {
        Ok((texture, hash)) => {
            read.files.push((relative(path), hash));
            Some(texture)
        }
        Err(message) => {
            read.findings.push(replaced("unsound_map", &relative(path), &message));
            None
        }
    }
}

fn read_sound(path: &Path, map: Map) -> Result<(Texture, String), String> {
    let encoding = if map == Map::BaseColor { Encoding::Srgb } else { Encoding::Linear };
    let texture = read_texture(path, encoding, Wrap::Clamp).map_err(|error| error.to_string())?;
    let (width, height) = (texture.width(), texture.height());
    if width != height || !SIZES.contains(&width) {
        let (least, most) = (SIZES.start(), SIZES.end());
        return Err(format!("{width}x{height} texels; expected a square of {least} to {most} a side"));
    }
    let hash = sha256_of_file(path).map_err(|error| error.to_string())?;
    Ok((texture.collapsed(), hash))
}

fn replaced(code: &str, file: &str, message: &str) -> Finding {
    Finding {
        severity: Severity::Warning,
        code: code.to_owned(),
        file: file.to_owned(),
        place: String::new(),
        message: message.to_owned(),
        action: format!("scored as base colour {DEFAULT_BASE_COLOR} (linear)"),
    }
}
