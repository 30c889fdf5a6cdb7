//! `mateval sample`.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_scene::work_folder::check_free;

use crate::outcome::{Outcome, print};

/// What it is given.
#[derive(clap::Args)]
pub struct Args {
    /// Folder to write it to.
    out: PathBuf,
    /// Write into a folder that is there already, replacing files of the same name.
    #[arg(long)]
    force: bool,
}

/// Writes the sample.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    check_free(&args.out, args.force, "folder")?;
    mateval_prep::sample::write(&args.out).context("cannot write the sample")?;
    print(&format!("{}\n", args.out.join("recipe.toml").display()))?;
    Ok(Outcome::Good)
}
