//! `mateval prep finish`: the files that describe a whole dataset, after its scenes were made apart.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use mateval_scene::SceneId;

use crate::bars::with_progress;
use crate::outcome::{Outcome, counted, print, say};
use crate::tool::TOOL;

/// Arguments of `prep finish`.
#[derive(clap::Args)]
pub struct FinishArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// Leave this scene of the recipe out; may be given several times. A later call without it takes the scene in again.
    #[arg(long, value_name = "SCENE")]
    without: Vec<SceneId>,
}

/// Finishes the dataset.
pub fn run(args: &FinishArgs) -> anyhow::Result<Outcome> {
    let finish = |progress: mateval_scene::Progress<'_>| {
        mateval_prep::finish::finish(&args.dataset, &args.without, TOOL, progress)
    };
    let dataset = with_progress(finish).context("cannot finish the dataset")?;
    let photos = dataset.photo_renderer.map_or("without photos".to_owned(), |id| format!("photos by {id}"));
    print(&format!("{}: {}, {photos}\n", args.dataset.display(), counted(dataset.scenes.len(), "scene")))?;
    Ok(Outcome::Good)
}

/// Says that the dataset is to be finished, where only some scenes were worked on.
pub fn say_if_apart(scenes: &[SceneId], dataset: &Path) {
    if !scenes.is_empty() {
        say(&format!("when all scenes are done, run `mateval prep finish {}`", dataset.display()));
    }
}
