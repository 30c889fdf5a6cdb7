//! The scripts that Blender runs, embedded when this program was built.

use std::path::{Path, PathBuf};

use crate::error::PrepError;

macro_rules! script {
    ($name:literal) => {
        ($name, include_str!(concat!("../../../../blender_scripts/", $name)))
    };
}

/// The files of `blender_scripts`. The first one renders.
const SCRIPTS: [(&str, &str); 26] = [
    script!("render.py"),
    script!("bake_blend.py"),
    script!("mateval/__init__.py"),
    script!("mateval/bake.py"),
    script!("mateval/baking_job.py"),
    script!("mateval/blend_file.py"),
    script!("mateval/bodies.py"),
    script!("mateval/camera.py"),
    script!("mateval/channels.py"),
    script!("mateval/cycles.py"),
    script!("mateval/denoise.py"),
    script!("mateval/environment.py"),
    script!("mateval/evaluated.py"),
    script!("mateval/gltf.py"),
    script!("mateval/job.py"),
    script!("mateval/lighting.py"),
    script!("mateval/materials.py"),
    script!("mateval/metal.py"),
    script!("mateval/nodes.py"),
    script!("mateval/osl.py"),
    script!("mateval/pictures.py"),
    script!("mateval/plastic.py"),
    script!("mateval/scene.py"),
    script!("mateval/unwrap.py"),
    script!("mateval/uv_charts.py"),
    script!("mateval/world.py"),
];

/// The script that bakes a `.blend` file.
pub const BAKE: &str = "bake_blend.py";

/// The folder of the modules.
const PACKAGE: &str = "mateval";

/// Writes the scripts into `folder/scripts` and returns the path of the one that renders.
pub fn write(folder: &Path) -> Result<PathBuf, PrepError> {
    let scripts = folder.join("scripts");
    let package = scripts.join(PACKAGE);
    std::fs::create_dir_all(&package).map_err(PrepError::io("make", package))?;
    for (name, text) in SCRIPTS {
        let path = scripts.join(name);
        std::fs::write(&path, text).map_err(PrepError::io("write", path))?;
    }
    Ok(scripts.join(SCRIPTS[0].0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A script that is not in the list would be missing when Blender runs.
    #[test]
    fn every_script_is_embedded() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../blender_scripts");
        let mut found = Vec::new();
        for below in ["", PACKAGE] {
            for entry in std::fs::read_dir(folder.join(below)).unwrap() {
                let name = Path::new(below).join(entry.unwrap().file_name()).to_string_lossy().into_owned();
                found.extend(name.ends_with(".py").then_some(name));
            }
        }
        let mut listed = SCRIPTS.map(|(name, _)| name.to_owned());
        found.sort();
        listed.sort();
        assert_eq!(found, listed);
    }
}
