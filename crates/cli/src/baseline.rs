//! `mateval baseline`.

use std::path::PathBuf;

use clap::ValueEnum;
use mateval_scene::open::Dataset;

use crate::outcome::{Outcome, print};

/// What it is given.
#[derive(clap::Args)]
pub struct Args {
    /// Which.
    name: Name,
    /// The dataset's folder.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder of the submission.
    #[arg(long)]
    out: PathBuf,
    /// Replace a submission that is there.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Name {
    /// The source materials baked to the dataset's own atlases: the ceiling.
    Gt,
    /// Base colour 0.5 (linear) everywhere: the floor.
    Grey,
}

/// Makes the submission.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let dataset = Dataset::open(&args.dataset)?;
    let write = match args.name {
        Name::Gt => mateval_baselines::truth::write,
        Name::Grey => mateval_baselines::grey::write,
    };
    let instances = write(&dataset, &args.out, args.force)?;
    print(&format!("{}: {instances} instances\n", args.out.display()))?;
    Ok(Outcome::Good)
}
