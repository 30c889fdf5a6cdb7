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
    /// Write this many houses made of the built-in one instead, with a recipe of one scene a house: a rehearsal of a
    /// release at full size.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    houses: Option<u32>,
    /// With --houses: what the houses are drawn from.
    #[arg(long, requires = "houses", default_value_t = 0)]
    seed: u64,
}

/// Writes the sample and prints the path of its recipe.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.out.exists() && !args.force {
        bail!("'{}' already exists; choose another folder, or add --force to write into it", args.out.display());
    }
    match args.houses {
        None => mateval_sample::write(&args.out),
        Some(count) => mateval_sample::write_houses(&args.out, count, args.seed),
    }
    .context("cannot write the sample")?;
    print(&format!("{}\n", args.out.join("recipe.toml").display()))?;
    Ok(Outcome::Good)
}
