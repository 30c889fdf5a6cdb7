//! A scene as methods see it: the instances' meshes with their atlas uv, and rays through them.

use std::sync::Arc;

use mateval_image::png_io;
use mateval_image::{Mask, Picture};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder, part_picture};
use mateval_scene::submission::MAP_SIZES;
use mateval_scene::{PartSetId, SceneError, TriangleMesh, plain_instances};
use mateval_tracer::World;

use crate::error::BaselineError;

/// The public part of a scene. The surfaces of the world have the order of the instances in `scene.json`.
pub struct SceneGeometry<'a> {
    /// `scene.json`.
    pub scene: &'a SceneFile,
    /// The input view.
    pub view: &'a View,
    /// The scene's folder.
    pub folder: SceneFolder,
    /// All instances, opaque and without emission.
    pub world: World,
    /// `valid.png` of the input view.
    pub valid: Mask,
    /// `instance.png` of the input view.
    pub instances: Picture<u16>,
}

impl<'a> SceneGeometry<'a> {
    /// Reads the files of a scene that methods may see, and none of its ground truth.
    pub fn read(folder: SceneFolder, scene: &'a SceneFile) -> Result<Self, BaselineError> {
        let view = input_view(&folder, scene)?;
        let shown = folder.view(&view.id);
        let sizes =
            scene.instances.iter().filter_map(|instance| Some((instance, instance.atlas.as_ref()?.size as usize)));
        if let Some((instance, size)) = { sizes }.find(|(_, size)| !MAP_SIZES.contains(size)) {
            let what = format!("instance '{}' has an atlas of {size} texels; run `mateval prep verify`", instance.id);
            return Err(SceneError::Unsupported { path: folder.scene_file(), what }.into());
        }
        let world = World::new(Arc::new(plain_instances::read(&folder, scene)?))?;
        let valid = png_io::read_mask(&shown.join("valid.png"))?;
        let instances = png_io::read_ids(&shown.join("instance.png"))?;
        let size = (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize);
        if (valid.width(), valid.height()) != size || (instances.width(), instances.height()) != size {
            let what =
                "valid.png or instance.png is not as large as scene.json says; run `mateval prep verify`".to_owned();
            return Err(SceneError::Unsupported { path: shown, what }.into());
        }
        Ok(Self { scene, view, folder, world, valid, instances })
    }

    /// An instance's mesh, whose uv are those of the atlas.
    pub fn mesh(&self, instance: usize) -> &TriangleMesh {
        &self.world.scene().surfaces[instance].mesh
    }

    /// The input view's picture of part indices, for a part set.
    pub fn part_picture(&self, set: Option<&PartSetId>) -> Result<Picture<u16>, BaselineError> {
        let path = self.folder.view(&self.view.id).join(part_picture(set));
        let picture = png_io::read_ids(&path)?;
        if picture.same_size(&self.valid) {
            return Ok(picture);
        }
        let what = "it is not as large as scene.json says; run `mateval prep verify`".to_owned();
        Err(SceneError::Unsupported { path, what }.into())
    }
}

/// The input view, which estimates are made for.
pub(crate) fn input_view<'a>(folder: &SceneFolder, scene: &'a SceneFile) -> Result<&'a View, BaselineError> {
    let missing = || BaselineError::NoInputView(folder.scene_file());
    scene.view(INPUT).ok_or_else(missing)
}
