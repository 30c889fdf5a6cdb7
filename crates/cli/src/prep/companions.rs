//! `mateval prep companions`: the pictures with which scoring corrects render noise.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_eval::dataset_companions::make_companions;
use mateval_eval::protocol::Protocol;
use mateval_prep::finish::finish_again;
use mateval_scene::SceneId;

use crate::bars::with_progress;
use crate::outcome::{Outcome, print};

/// Arguments of `prep companions`.
#[derive(clap::Args)]
pub struct CompanionsArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// Render those of this scene only, and leave the manifest to `prep finish`; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
}

/// Renders the companions.
pub fn run(args: &CompanionsArgs) -> anyhow::Result<Outcome> {
    let protocol = Protocol::named("mateval-2")?;
    let report = with_progress(|progress| make_companions(&args.dataset, &args.scenes, &protocol, progress))
        .context("cannot make the companions")?;
    if args.scenes.is_empty() {
        with_progress(|progress| finish_again(&args.dataset, progress)).context("cannot finish the dataset")?;
    }
    print(&format!("{}: companions of {} passes made, {} kept\n", args.dataset.display(), report.made, report.kept))?;
    super::finish::say_if_apart(&args.scenes, &args.dataset);
    Ok(Outcome::Good)
}
