//! Radiances that were planted on the stage are recovered.
//!
//! Only by the basis that made the photo: at 64x48 pixels eight lights, some of a sixtieth of others' light, stand
//! against 48 averaged squares, and between two streams of samples most radiances are off by half their value or more.

use std::sync::{Arc, LazyLock};

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::{Camera, TriangleMesh, glb, reference};
use mateval_eval::truth::ViewTruth;
use mateval_image::{LinearRgb, Picture};
use mateval_light::light_fit::{FitRules, FitTarget, fit_lights};
use mateval_light::light_stage::{self, NamedLight};
use mateval_submission::atlas::AtlasMeshes;
use mateval_submission::prediction::{PredictedScene, read_scene};
use mateval_tracer::{
    LightBasis, LightMix, Lighting, RenderSettings, Repaint, Scattering, StageLight, SurfaceMaps, World,
    render_repainted,
};

use super::sample::{dataset, hasty, write_truth};
use mateval_testkit::kept_folder;

/// The furnished room of the sample on its stage, with the prediction `gt`.
struct Staged {
    scene: &'static SceneFile,
    world: World,
    atlases: Vec<TriangleMesh>,
    prediction: PredictedScene,
    truth: ViewTruth,
    stage: Vec<NamedLight>,
}

static STAGED: LazyLock<Staged> = LazyLock::new(|| {
    let scene = &dataset().scenes[0];
    let (world, atlases, prediction, truth) = read("living", scene);
    let stage = light_stage::scene_lights(&hasty().light.stage, scene, &world);
    Staged { scene, world, atlases, prediction, truth, stage }
});

/// A scene with the prediction `gt`, which is written to a folder called `name`, and its input view.
fn read(name: &str, scene: &SceneFile) -> (World, Vec<TriangleMesh>, PredictedScene, ViewTruth) {
    let folder = dataset().folder(&scene.id);
    let submission = kept_folder("planted").join(name);
    write_truth(&submission);
    let world = World::new(Arc::new(reference::read(&folder).unwrap())).unwrap();
    let nodes = glb::read(&folder.instances()).unwrap();
    let atlases: Vec<TriangleMesh> = nodes.into_iter().map(|node| node.mesh).collect();
    let predicted = read_scene(&submission, scene, &AtlasMeshes::in_memory(&atlases)).unwrap();
    (world, atlases, predicted, ViewTruth::read(&folder, &scene.views[0]).unwrap())
}

/// The input view of a prediction under each light of a world alone.
fn basis_of(
    (world, atlases, prediction): (&World, &[TriangleMesh], &PredictedScene),
    camera: Camera,
    samples: u32,
    seed: u64,
) -> LightBasis {
    let coat = |surface: usize| {
        prediction.materials[surface].as_ref().map(|material| SurfaceMaps {
            base_colors: vec![material.base_color.clone()],
            scattering: Scattering { roughness: material.roughness.clone(), metallic: material.metallic.clone() },
        })
    };
    let repaint = Repaint::new(world, atlases, (0..atlases.len()).map(coat).collect(), flavour()).unwrap();
    let settings = RenderSettings { samples, ..Default::default() };
    let done = render_repainted(world, &repaint, &[camera], Lighting::Apart, &settings, &[seed], &|_, _| ());
    done.unwrap().remove(0).views.remove(0).by_seed.remove(0)
}

/// The planted radiance: 0.5 to 3.5, different in every channel.
fn planted(light: usize) -> [f64; 3] {
    [0, 1, 2].map(|c| 0.5 + 3.0 * ((light * 7 + c * 5) % 11) as f64 / 10.0)
}

impl Staged {
    /// The input view under each light of the stage alone, with radiances by `radiance`.
    fn basis(&self, radiance: impl Fn(usize) -> [f64; 3], samples: u32, seed: u64) -> LightBasis {
        let quad = |(at, named): (usize, &NamedLight)| StageLight {
            radiance: radiance(at).map(|v| v as f32),
            ..named.light.clone()
        };
        let quads: Vec<StageLight> = self.stage.iter().enumerate().map(quad).collect();
        let world = self.world.on_stage(&quads).unwrap();
        basis_of((&world, &self.atlases, &self.prediction), self.scene.views[0].camera, samples, seed)
    }
}

fn flavour() -> mateval_dataset::material::PrincipledFlavour {
    hasty().light.flavour
}

/// Rules whose ridge is too weak to move what the photo states.
fn weak_ridge() -> FitRules {
    FitRules { ridge: 1e-6, ..hasty().light.fit }
}

/// A photo of which nothing is clipped.
fn target<'a>(photo: &'a Picture<LinearRgb>, truth: &'a ViewTruth) -> FitTarget<'a> {
    FitTarget { photo, mask: Some(&truth.valid), exposure: 1e-3, known: &[] }
}

/// The relative errors of all lights and channels, sorted.
fn errors(found: &LightMix) -> Vec<f64> {
    let pairs = found.iter().enumerate().flat_map(|(light, found)| found.iter().copied().zip(planted(light)));
    let mut errors: Vec<f64> = pairs.map(|(found, planted)| (found / planted - 1.0).abs()).collect();
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn the_basis_that_made_the_photo_gives_its_radiances() {
    let staged = &*STAGED;
    let mix: LightMix = (0..staged.stage.len()).map(planted).collect();
    let basis = staged.basis(|_| [1.0; 3], 32, 1);
    let fit =
        |photo: &Picture<LinearRgb>| fit_lights(&weak_ridge(), &basis, &target(photo, &staged.truth)).unwrap().weights;
    let found = errors(&fit(&basis.weighted(&mix).unwrap()));
    assert!(found.len() == 24 && found[23] < 1e-3, "{found:?}");
    // The twin: equal radiances for all lights.
    assert!(errors(&fit(&basis.sum()))[12] > 0.1);
}

/// The room that keeps its own lights: their planted radiances are recovered from a noisy photo, with other paths, to 2
/// %. On a stage some lights contribute a hundredth of the
/// photo's light, which noise hides. The twin: a basis of one sample.
#[test]
fn a_noisy_photo_gives_the_radiances_of_a_rooms_own_lights() {
    let scene = dataset().scenes.iter().find(|scene| scene.id.as_str() == "room").unwrap();
    let (world, atlases, prediction, truth) = read("room", scene);
    let basis =
        |samples: u32, seed: u64| basis_of((&world, &atlases, &prediction), scene.views[0].camera, samples, seed);
    let mix: LightMix = (0..world.emitters().groups()).map(planted).collect();
    let photo = basis(256, 2).weighted(&mix).unwrap();
    let median = |samples: u32| {
        let errors = errors(&fit_lights(&weak_ridge(), &basis(samples, 1), &target(&photo, &truth)).unwrap().weights);
        errors[errors.len() / 2]
    };
    let [found, twin] = [256, 1].map(median);
    assert!(found < 0.02 && twin > 0.02, "{found} {twin}");
}
