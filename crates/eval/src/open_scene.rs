//! Scenes of a dataset, opened for scoring.

use std::sync::Arc;

use mateval_scene::companions_file::is_rendered;
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::SceneFolder;
use mateval_scene::open::Dataset;
use mateval_scene::render_file::RENDER_FILE;
use mateval_scene::{RendererId, SceneError, TriangleMesh, glb, reference_io};
use mateval_tracer::World;

use crate::error::EvalError;

/// The views of the scene that `targets.json` names, in the scene's order; at least one.
pub fn scored_views<'a>(dataset: &Dataset, scene: &'a SceneFile) -> Result<Vec<&'a View>, EvalError> {
    let targets = &dataset.targets.targets;
    let is_target = |view: &&View| targets.iter().any(|t| t.scene == scene.id && t.view == view.id);
    let views: Vec<&View> = scene.views.iter().filter(is_target).collect();
    if views.is_empty() {
        return Err(EvalError::NoTargets { scene: scene.id.clone() });
    }
    Ok(views)
}

/// A scene, opened for scoring.
pub struct OpenScene {
    /// Its folder.
    pub folder: SceneFolder,
    /// Its true geometry, materials and lights, ready for ray tracing.
    pub world: World,
    /// The meshes of `instances.glb`, one for each surface of the world.
    pub atlases: Vec<TriangleMesh>,
}

impl OpenScene {
    /// Fails if a file differs from the dataset's manifest or does not fit the others. `renderer` is the one whose pictures
    /// will be read.
    pub fn read(dataset: &Dataset, scene: &SceneFile, renderer: Option<&RendererId>) -> Result<Self, EvalError> {
        let render = renderer.map(|renderer| format!("ground_truth/renders/{renderer}/"));
        let is_light = |file: &str| {
            let name = file.rsplit('/').next().unwrap_or(file);
            render.as_ref().is_some_and(|render| file.starts_with(render.as_str()))
                && (name == RENDER_FILE
                    || name.ends_with(".exr") && (name.starts_with("rgb") || name.starts_with("group_")))
        };
        // Numbers carry the dataset's fingerprint, so they must come from the files that it covers.
        // Companions' pictures are checked when they are used, against their own list.
        let concerns = |file: &str| !is_rendered(file) || is_light(file);
        dataset.check_files(&scene.id, concerns)?;
        let folder = dataset.folder(&scene.id);
        let world = World::new(Arc::new(reference_io::read(&folder)?))?;
        let atlases = read_atlases(&folder, scene, &world)?;
        Ok(Self { folder, world, atlases })
    }
}

/// The meshes of `instances.glb`; the instances of `scene.json` in its order, and the same triangles as the world's
/// surfaces, or the dataset is unsound.
fn read_atlases(folder: &SceneFolder, scene: &SceneFile, world: &World) -> Result<Vec<TriangleMesh>, EvalError> {
    let nodes = glb::read(&folder.instances())?;
    let ids = scene.instances.iter().map(|instance| instance.id.as_str());
    let named = nodes.len() == scene.instances.len() && nodes.iter().map(|node| node.name.as_str()).eq(ids);
    let meshes: Vec<TriangleMesh> = nodes.into_iter().map(|node| node.mesh).collect();
    let surfaces = &world.scene().surfaces;
    let fits = named
        && meshes.len() == surfaces.len()
        && meshes.iter().zip(surfaces).all(|(mesh, surface)| mesh.triangles.len() == surface.mesh.triangles.len());
    if fits {
        return Ok(meshes);
    }
    let path = folder.instances();
    let what = "it does not fit scene.json and ground_truth/reference/geometry.glb; run `mateval prep verify`";
    Err(SceneError::Unsupported { path, what: what.to_owned() }.into())
}
