//! `mateval prep build`: converts the scenes of a recipe into a dataset.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_prep::build::BuildOptions;

use crate::bars::with_progress;
use crate::outcome::{Outcome, print, say, say_findings};
use crate::tool::TOOL;

/// Arguments of `prep build`.
#[derive(clap::Args)]
pub struct BuildArgs {
    /// The recipe, a TOML file.
    recipe: PathBuf,
    /// Folder of the dataset.
    #[arg(long)]
    out: PathBuf,
    /// Folder that the recipe's paths are relative to [default: the recipe's folder].
    #[arg(long)]
    source: Option<PathBuf>,
    /// Replace a dataset that already exists.
    #[arg(long)]
    force: bool,
}

/// Builds the dataset and reports the findings of each scene.
pub fn run(args: &BuildArgs) -> anyhow::Result<Outcome> {
    let options = BuildOptions {
        recipe: args.recipe.clone(),
        source: args.source.clone(),
        out: args.out.clone(),
        force: args.force,
    };
    let report = with_progress(|progress| mateval_prep::build::build(&options, TOOL, progress))
        .context("cannot build the dataset")?;
    for scene in &report.resumed {
        say(&format!("scene '{scene}' was already made by an earlier run"));
    }
    for (scene, findings) in &report.findings {
        say_findings(scene.as_str(), findings);
    }
    print(&format!("{}: {} scenes\n", args.out.display(), report.dataset.scenes.len()))?;
    Ok(Outcome::Good)
}
