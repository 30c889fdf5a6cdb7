//! A scene's public geometry: `instances.glb` as surfaces of one grey material, without lights.

use crate::dataset::SceneFile;
use crate::error::SceneError;
use crate::glb;
use crate::layout::SceneFolder;
use crate::material::{ColorInput, Material, MaterialModel};
use crate::reference::{MaterialIndex, ReferenceScene, Surface};

/// Reads all instances as opaque surfaces with the uv of their atlases, in the order of `scene.json`. Fails where
/// `instances.glb` cannot be read or holds other instances than `scene.json`.
pub fn read(folder: &SceneFolder, scene: &SceneFile) -> Result<ReferenceScene, SceneError> {
    let path = folder.instances();
    let nodes = glb::read(&path)?;
    let ids = scene.instances.iter().map(|instance| instance.id.as_str());
    if !(nodes.len() == scene.instances.len() && nodes.iter().map(|node| node.name.as_str()).eq(ids)) {
        let what = "its nodes are not the instances of scene.json; run `mateval prep verify`".to_owned();
        return Err(SceneError::Unsupported { path, what });
    }
    let surface = |node: glb::GlbNode| Surface { name: node.name, mesh: node.mesh, material: MaterialIndex(0) };
    let grey = Material {
        name: String::new(),
        model: MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None },
        two_sided: true,
        opacity: None,
        bump: None,
    };
    let surfaces = nodes.into_iter().map(surface).collect();
    Ok(ReferenceScene { surfaces, materials: vec![grey], ..ReferenceScene::default() })
}
