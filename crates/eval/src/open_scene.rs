//! Scenes of a dataset, opened and checked for scoring.

use std::sync::Arc;

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::{SceneFolder, is_rendered};
use mateval_dataset::open::Dataset;
use mateval_dataset::reference::{self, Surface};
use mateval_dataset::{DatasetError, TriangleMesh};
use mateval_tracer::World;

use crate::error::EvalError;

/// The views of the scene that `targets.json` names, in the scene's order; at least one.
pub fn scored_views<'a>(dataset: &Dataset, scene: &'a SceneFile) -> Result<Vec<&'a View>, EvalError> {
    let targets = &dataset.targets.targets;
    let is_target = |view: &&View| targets.iter().any(|t| t.scene == scene.id && t.view == view.id);
    let views: Vec<&View> = scene.views.iter().filter(is_target).collect();
    if views.is_empty() {
        return Err(EvalError::unsound(format!("scene '{}'", scene.id), "a view of it in targets.json", "none"));
    }
    Ok(views)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ViewSet {
    /// The input view and the turned ones, which share their paths. In captured rooms also the views of other photos.
    Turned,
    Wide,
}

impl ViewSet {
    pub(crate) fn of<'a>(self, views: &[&'a View]) -> Vec<&'a View> {
        views.iter().filter(|view| view.id.is_wide() == (self == Self::Wide)).copied().collect()
    }

    /// The name of a pass over the set, part of its seeds.
    pub(crate) fn pass(self, name: &str) -> String {
        match self {
            Self::Turned => name.to_owned(),
            Self::Wide => format!("{name}_wide"),
        }
    }
}

pub struct OpenScene {
    pub folder: SceneFolder,
    /// Its true geometry, materials and lights, ready for ray tracing.
    pub world: World,
    /// The meshes of `instances.glb`, one with the same triangles for each surface of the world.
    pub atlases: Vec<TriangleMesh>,
}

impl OpenScene {
    /// Fails if a file differs from the dataset's manifest or does not fit the others: numbers carry the dataset's
    /// fingerprint, so they must come from the files that it covers. Renders are not checked here: references
    /// are when they are opened.
    pub fn read(dataset: &Dataset, scene: &SceneFile) -> Result<Self, EvalError> {
        // The input picture is a copy of a photo renderer's, which may have been renewed since.
        let is_needed = |file: &str| !is_rendered(file) && !file.starts_with("views/input/rgb.");
        dataset.check_files(&scene.id, is_needed)?;
        let folder = dataset.folder(&scene.id);
        let world = World::new(Arc::new(reference::read(&folder)?))?;
        let atlases = reference::read_plain(&folder, scene)?.surfaces;
        let triangles = |surface: &Surface| surface.mesh.triangles.len();
        if !atlases.iter().map(triangles).eq(world.scene().surfaces.iter().map(triangles)) {
            let what = "it does not fit ground_truth/reference/geometry.glb; run `mateval prep verify`".to_owned();
            return Err(DatasetError::Unsupported { path: folder.instances(), what }.into());
        }
        Ok(Self { folder, world, atlases: atlases.into_iter().map(|surface| surface.mesh).collect() })
    }
}
