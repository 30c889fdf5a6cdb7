//! A scene's geometry as everybody may see it: `instances.glb` as surfaces of grey paper, without light.

use crate::dataset::SceneFile;
use crate::error::SceneError;
use crate::glb;
use crate::layout::SceneFolder;
use crate::material::{ColorInput, Material, MaterialModel};
use crate::reference::{MaterialIndex, ReferenceScene, Surface};

/// All instances, opaque: surface k is instance k of `scene.json`, with the uv of its atlas. Fails where `instances.glb` is
/// no such file, or holds other instances than `scene.json` says.
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
