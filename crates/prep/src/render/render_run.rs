//! The settings that all views of a run share, and whether an earlier run rendered a view with the same ones.

use std::path::Path;

use mateval_scene::dataset::View;
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::manifest::sha256_of_bytes;
use mateval_scene::render_file::{RENDER_FILE, RenderFile};
use mateval_scene::scene_change::change_scene;
use mateval_scene::scene_cost::{self, Step, TimedStep};
use mateval_scene::{RendererId, SceneId, json};

use crate::error::PrepError;

/// Number of scatterings after the first hit after which a path is cut.
pub const MAX_BOUNCES: u32 = 16;

/// The settings that all views of a run share.
pub(super) struct RenderRun<'a> {
    /// The dataset's folder.
    pub(super) root: &'a Path,
    pub(super) renderer: RendererId,
    /// Samples per pixel of each half.
    pub(super) samples: u32,
    /// Whether pictures that already exist are rendered again.
    pub(super) force: bool,
    /// Whether scenes are rendered one after the other.
    pub(super) one_at_a_time: bool,
}

impl RenderRun<'_> {
    /// Renders a scene by `work`, as [`change_scene`], and records its cost.
    pub(super) fn on_scene<T>(
        &self,
        id: &SceneId,
        work: impl FnOnce() -> Result<T, PrepError>,
    ) -> Result<T, PrepError> {
        let ours = format!("/ground_truth/renders/{}/", self.renderer);
        let shown = format!("/views/{INPUT}/rgb.");
        let step = TimedStep { step: Step::Render, renderer: Some(&self.renderer), is_alone: self.one_at_a_time };
        let work = || scene_cost::timed(self.root, id, &step, work);
        change_scene(self.root, id, |path| path.contains(&ours) || path.contains(&shown), work)
    }

    /// Whether the view's pictures exist and were made with these settings.
    pub(super) fn is_done(&self, folder: &SceneFolder, view: &View, seeds: &[String; 2]) -> bool {
        let path = folder.render(&self.renderer, &view.id).join(RENDER_FILE);
        let has_same_settings = |found: RenderFile| {
            (found.samples_each_half, &found.seeds, found.max_bounces) == (self.samples, seeds, MAX_BOUNCES)
        };
        !self.force && json::read::<RenderFile>(&path).is_ok_and(has_same_settings)
    }
}

/// The seed of one half of a view's picture. The two halves must not share a sequence: their errors would be correlated.
pub(super) fn seed(scene: &SceneId, view: &View, half: usize) -> u64 {
    let text = sha256_of_bytes(format!("{scene}/{}/{half}", view.id).as_bytes());
    u64::from_str_radix(&text[..16], 16).expect("a hash is hexadecimal")
}

/// Seeds as `render.json` holds them.
pub(super) fn seed_texts(seeds: [u64; 2]) -> [String; 2] {
    seeds.map(|seed| format!("{seed:016x}"))
}
