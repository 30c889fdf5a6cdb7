//! `mateval eval pictures`: truth and submissions side by side.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use mateval_report::strips::{self, StripPlan};
use mateval_scene::SceneId;
use mateval_scene::open::Dataset;

use super::strip_picture::StripArgs;
use crate::bars::with_progress;
use crate::outcome::{Outcome, print};

/// Arguments of `eval pictures`.
#[derive(clap::Args)]
pub struct PicturesArgs {
    /// Folders of submissions; each has a column after the truth's.
    #[arg(required = true, value_name = "SUBMISSION")]
    submissions: Vec<PathBuf>,
    /// Folder of the dataset.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder for the pictures.
    #[arg(long)]
    out: PathBuf,
    /// Draw this scene only; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    #[command(flatten)]
    strips: StripArgs,
    /// Replace pictures that already exist.
    #[arg(long)]
    force: bool,
}

/// Writes the pictures and prints their paths.
pub fn run(args: &PicturesArgs) -> anyhow::Result<Outcome> {
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let submissions: Vec<&Path> = args.submissions.iter().map(PathBuf::as_path).collect();
    let plan = StripPlan {
        dataset: &dataset,
        submissions: &submissions,
        scenes: &args.scenes,
        shown: &args.strips.shown(),
        out: &args.out,
        force: args.force,
    };
    let written = with_progress(|progress| strips::write(&plan, progress))?;
    written.iter().try_for_each(|path| print(&format!("{}\n", path.display())))?;
    Ok(Outcome::Good)
}
