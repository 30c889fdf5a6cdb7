//! Renders scenes with Blender in the same way as `prep render`.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Duration;

use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{Camera, SceneId, ViewId};
use mateval_image::{LinearRgb, Picture};
use mateval_prep::blender_job::{
    BlenderEvent, BlenderLimits, BlenderProgram, DeviceChoice, JobFolder, JobPlan, JobView, tail,
};

use super::tiles::Tiles;

/// Pixels a side of every picture. To reduce a tile's noise, samples are needed and not more tiles.
pub const SIZE: usize = 48;
/// Renders of each picture, by either renderer: two halves of every other view.
pub const SEEDS: u64 = 4;
/// Blender's "max bounces", of every kind.
pub const BOUNCES: u32 = 16;

/// A scene, its camera, and the samples for each pixel and seed.
pub struct Shot {
    pub name: String,
    pub scene: ReferenceScene,
    pub camera: Camera,
    pub samples: u32,
}

/// Blender's renders of all shots, one after the other.
pub fn render(shots: &[Shot]) -> Vec<Tiles> {
    // Blender uses every processor, so two at once would only need more memory.
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock();
    shots.iter().map(|shot| Tiles::of(&pictures(shot))).collect()
}

fn pictures(shot: &Shot) -> Vec<Picture<LinearRgb>> {
    let folder = tempfile::tempdir().unwrap();
    let id = SceneId::new("shot").unwrap();
    let parts: Vec<Vec<u16>> = shot.scene.surfaces.iter().map(|s| vec![1; s.mesh.triangles.len()]).collect();
    let view = |first: u32| JobView {
        id: ViewId::new(format!("seed{first}")).unwrap(),
        camera: shot.camera,
        seeds: [first, first + 1],
    };
    let plan = JobPlan {
        scene: &id,
        reference: &shot.scene,
        parts: &parts,
        views: (1..=SEEDS as u32).step_by(2).map(view).collect(),
        samples_each_half: shot.samples,
        max_bounces: BOUNCES,
        threads: 0,
        device: DeviceChoice::Cpu,
        required_device: None,
        turn: 0,
    };
    let job = JobFolder::prepare(folder.path(), &plan).unwrap();
    let hour = Duration::from_secs(3600);
    let limits = BlenderLimits { time: hour, silence: hour, memory_bytes: 8 << 30 };
    let mut pictures = Vec::new();
    let ended = job.run(&program(), &limits, &mut |event| {
        if let BlenderEvent::View(_, _, view) = event {
            pictures.extend(view.halves.map(|half| half.rgb));
        }
        Ok(())
    });
    assert_eq!(pictures.len(), SEEDS as usize, "{}: {ended:?}\n{}", shot.name, tail(&job.log(), 4000));
    pictures
}

fn program() -> BlenderProgram {
    let python = std::env::var_os("MATEVAL_PEERS_BLENDER")
        .expect("MATEVAL_PEERS_BLENDER names no Blender: run tools/test_peers.sh, which installs it");
    BlenderProgram(PathBuf::from(python))
}
