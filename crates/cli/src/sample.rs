//! `mateval sample`: the built-in sample as source scenes and a recipe.

use std::path::PathBuf;

use anyhow::{Context as _, bail};

use crate::outcome::{Outcome, print};

/// Arguments of `sample`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder that the sample is written to.
    out: PathBuf,
    /// Write into a folder that already exists and replace files of the same name.
    #[arg(long)]
    force: bool,
}

/// Writes the sample and prints the path of its recipe.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.out.exists() && !args.force {
        bail!("'{}' already exists; choose another folder, or add --force to write into it", args.out.display());
    }
    mateval_sample::write(&args.out).context("cannot write the sample")?;
    print(&format!("{}\n", args.out.join("recipe.toml").display()))?;
    Ok(Outcome::Good)
}
