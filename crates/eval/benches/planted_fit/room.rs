//! A scene with the lights that are fitted.

use std::path::Path;
use std::sync::Arc;

use mateval_eval::light_rules::{LightRules, Track};
use mateval_light::light_stage;
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::SceneFolder;
use mateval_scene::material::PrincipledFlavour;
use mateval_scene::{SceneId, SceneLights, TriangleMesh, glb, open::Dataset, reference_io};
use mateval_submission::atlas_meshes::AtlasMeshes;
use mateval_submission::prediction::read_scene;
use mateval_tracer::{
    Coat, LightBasis, LightGroups, Lighting, RenderSettings, Repaint, StageLight, World, render_repainted,
};

/// The scene, its light stage or its own emitters.
pub struct Room {
    pub dataset: Dataset,
    pub folder: SceneFolder,
    pub scene: SceneFile,
    pub world: World,
    pub names: Vec<String>,
    pub rules: LightRules,
    atlases: Vec<TriangleMesh>,
}

impl Room {
    pub fn open(dataset: &Path, scene: &str) -> Self {
        let dataset = Dataset::open(dataset).unwrap();
        let id = SceneId::new(scene).unwrap();
        let scene = dataset.scenes.iter().find(|scene| scene.id == id).unwrap().clone();
        let folder = dataset.folder(&id);
        let own = World::new(Arc::new(reference_io::read(&folder).unwrap())).unwrap();
        let atlases: Vec<_> = glb::read(&folder.instances()).unwrap().into_iter().map(|node| node.mesh).collect();
        let rules = LightRules::new(vec![Track::Fitted], PrincipledFlavour::Mitsuba);
        let (world, names) = match scene.lights {
            SceneLights::Own => {
                let names = own.scene().lights.iter().map(|light| light.name.clone()).collect();
                (own, names)
            }
            SceneLights::Stage => {
                let lights = light_stage::scene_lights(&rules.stage, &scene, &own);
                let quads: Vec<StageLight> = lights.iter().map(|named| named.light.clone()).collect();
                (own.on_stage(&quads).unwrap(), lights.into_iter().map(|named| named.name).collect())
            }
        };
        Self { dataset, folder, scene, world, names, rules, atlases }
    }

    /// Views of a submission under each light alone: for each view, one basis for each seed.
    pub fn bases(&self, submission: &Path, views: &[View], samples: u32, seeds: &[u64]) -> Vec<Vec<LightBasis>> {
        let predicted = read_scene(submission, &self.scene, &AtlasMeshes::in_memory(&self.atlases)).unwrap();
        let coats = predicted.materials.iter().map(|material| {
            material.as_ref().map(|material| Coat {
                base_colors: vec![material.base_color.clone()],
                roughness: material.roughness.clone(),
                metallic: material.metallic.clone(),
            })
        });
        let repaint = Repaint::new(&self.world, &self.atlases, coats.collect(), self.rules.flavour).unwrap();
        let groups = LightGroups::apart(self.names.len());
        let (settings, light) = (self.rules.settings(samples), Lighting::Apart(&groups));
        let settings = RenderSettings { samples, ..settings };
        let cameras: Vec<_> = views.iter().map(|view| view.camera).collect();
        let quiet = |_: usize, _: usize| ();
        let done = render_repainted(&self.world, &repaint, 0..1, &cameras, light, &settings, seeds, &quiet);
        let views = done.unwrap().remove(0).views;
        views.into_iter().map(|view| view.halves.into_iter().map(|half| half.basis).collect()).collect()
    }
}
