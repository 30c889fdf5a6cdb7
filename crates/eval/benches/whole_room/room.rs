//! The room, its submission, and their data that both tools need.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use mateval_eval::light_rules::Track;
use mateval_eval::protocol::Protocol;
use mateval_eval::truth::{RgbTruth, ViewTruth};
use mateval_light::light_stage::{self, NamedLight};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::SceneFolder;
use mateval_scene::open::Dataset;
use mateval_scene::reference::Emission;
use mateval_scene::{Camera, RendererId, SceneId, SceneLights, TriangleMesh, glb, reference_io};
use mateval_submission::atlas_meshes::AtlasMeshes;
use mateval_submission::prediction::{PredictedScene, read_scene};
use mateval_tracer::World;

/// One scene of a dataset and one submission.
pub struct Room {
    pub dataset: PathBuf,
    pub submission: PathBuf,
    /// The weights of LPIPS.
    pub weights: Option<PathBuf>,
    pub scene: SceneFile,
    pub folder: SceneFolder,
    pub renderer: RendererId,
    pub world: World,
    /// One mesh for each surface, with the uv of its atlas.
    pub atlases: Vec<TriangleMesh>,
    pub predicted: PredictedScene,
    pub protocol: Protocol,
    /// One for each view.
    pub truths: Vec<ViewTruth>,
    pub light: Vec<RgbTruth>,
}

impl Room {
    pub fn open(dataset: &Path, scene: &str, submission: &Path, weights: Option<PathBuf>) -> Self {
        let open = Dataset::open(dataset).unwrap();
        let id = SceneId::new(scene).unwrap();
        let scene = open.scenes.iter().find(|scene| scene.id == id).unwrap().clone();
        let folder = open.folder(&id);
        let renderer = open.file.scored_renderer.clone().expect("a dataset whose light was rendered");
        let world = World::new(Arc::new(reference_io::read(&folder).unwrap())).unwrap();
        let truth = |view: &View| ViewTruth::read(&folder, view).unwrap();
        let light = |view: &View| RgbTruth::read(&folder, &renderer, view).unwrap();
        let nodes = glb::read(&folder.instances()).unwrap();
        let atlases: Vec<TriangleMesh> = nodes.into_iter().map(|node| node.mesh).collect();
        Self {
            dataset: dataset.to_owned(),
            submission: submission.to_owned(),
            weights,
            predicted: read_scene(submission, &scene, &AtlasMeshes::in_memory(&atlases)).unwrap(),
            atlases,
            protocol: protocol(),
            truths: scene.views.iter().map(truth).collect(),
            light: scene.views.iter().map(light).collect(),
            world,
            folder,
            renderer,
            scene,
        }
    }

    pub fn cameras(&self) -> Vec<Camera> {
        self.scene.views.iter().map(|view| view.camera).collect()
    }

    /// Whether a stage replaces the room's own lights in track `fitted`.
    pub fn is_staged(&self) -> bool {
        self.scene.lights == SceneLights::Stage
    }

    /// The stage, as scoring sets it up; empty where the scene's own lights are fitted.
    pub fn stage(&self) -> Vec<NamedLight> {
        if !self.is_staged() {
            return Vec::new();
        }
        light_stage::scene_lights(&self.protocol.light.stage, &self.scene, &self.world)
    }

    /// Surfaces that emit and are hidden only from the camera.
    pub fn hidden_lights(&self) -> Vec<usize> {
        let groups = self.world.scene().lights.iter().filter(|group| !group.camera_visible);
        let surfaces = groups.filter_map(|group| match &group.emission {
            Emission::Area { surfaces, .. } => Some(surfaces.iter().map(|surface| surface.0)),
            _ => None,
        });
        surfaces.flatten().collect()
    }
}

/// `mateval-2` with the tracks that both tools render.
fn protocol() -> Protocol {
    let mut protocol = Protocol::named("mateval-2").unwrap();
    protocol.light.tracks = vec![Track::True, Track::Fitted];
    protocol
}
