//! The parts of a scene as the surfaces of a world.

use std::collections::BTreeMap;

use mateval_scene::material::{ColorInput, Material, MaterialModel};
use mateval_scene::reference::{MaterialIndex, ReferenceScene, Surface};
use mateval_scene::{SceneError, glb};

use crate::error::BaselineError;
use crate::geometry::SceneGeometry;

/// The pixel shows no part.
pub(super) const NO_PART: u16 = u16::MAX;

/// One surface for each part of an instance that has an atlas. Glass has none: light passes it.
pub(super) struct PartSurfaces {
    /// The surfaces, without lights.
    pub(super) room: ReferenceScene,
    /// The instance of each surface.
    pub(super) owners: Vec<usize>,
    /// The surface of each index in `part.png`.
    pub(super) of_part: BTreeMap<u16, u16>,
}

impl PartSurfaces {
    /// Reads `parts.glb`. Fails if its nodes are not the parts of `scene.json`.
    pub(super) fn read(geometry: &SceneGeometry<'_>) -> Result<Self, BaselineError> {
        let (scene, path) = (geometry.scene, geometry.folder.parts(None));
        let instance_at: BTreeMap<&str, usize> =
            scene.instances.iter().enumerate().map(|(at, instance)| (instance.id.as_str(), at)).collect();
        let nodes = glb::read(&path)?;
        let unsupported = |what: &str| SceneError::Unsupported { path: path.clone(), what: what.to_owned() };
        if !nodes.iter().map(|node| node.name.as_str()).eq(scene.parts.iter().map(|part| part.id.as_str())) {
            return Err(unsupported("its nodes are not the parts of scene.json; run `mateval prep verify`").into());
        }
        let room = ReferenceScene { materials: vec![grey()], ..ReferenceScene::default() };
        let mut found = Self { room, owners: Vec::new(), of_part: BTreeMap::new() };
        for (part, node) in scene.parts.iter().zip(nodes) {
            let owner = instance_at.get(part.instance.as_str()).copied();
            let Some(owner) = owner.filter(|owner| scene.instances[*owner].atlas.is_some()) else { continue };
            let surface = u16::try_from(found.owners.len()).ok().filter(|surface| *surface != NO_PART);
            let surface = surface.ok_or_else(|| unsupported("it has more parts than part.png can hold"))?;
            found.of_part.insert(part.index.0.get(), surface);
            found.owners.push(owner);
            found.room.surfaces.push(Surface { name: node.name, mesh: node.mesh, material: MaterialIndex(0) });
        }
        Ok(found)
    }
}

/// A material that no path asks for: what is assumed of surfaces takes its place.
fn grey() -> Material {
    Material {
        name: String::new(),
        model: MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None },
        two_sided: true,
        opacity: None,
        bump: None,
    }
}
