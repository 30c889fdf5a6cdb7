//! `mateval prep publish`.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use mateval_prep::publish::publish;
use mateval_scene::work_folder::check_free;

use crate::bars::Bars;
use crate::outcome::{Outcome, print};

/// What it is given.
#[derive(clap::Args)]
pub struct PublishArgs {
    /// The dataset's folder, with its ground truth.
    dataset: PathBuf,
    /// What the public tree leaves out.
    #[arg(long, value_enum)]
    withhold: Part,
    /// The folder for everybody: the dataset without it.
    #[arg(long)]
    public: PathBuf,
    /// The folder to keep: what is withheld. Laid over the public one it gives the dataset again.
    #[arg(long)]
    private: PathBuf,
    /// Replace folders that are there.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// All of `scenes/<scene>/ground_truth`.
    #[value(name = "ground_truth")]
    GroundTruth,
}

/// Writes both trees and prints the commitment.
pub fn run(args: &PublishArgs) -> anyhow::Result<Outcome> {
    let Part::GroundTruth = args.withhold;
    if args.public == args.private {
        bail!("--public and --private are one folder; the ground truth would not be withheld");
    }
    for place in [&args.public, &args.private] {
        check_free(place, args.force, "folder")?;
    }
    let bars = Bars::new();
    let found = publish(&args.dataset, &args.public, &args.private, &|step, done, all| bars.step(step, done, all))
        .context("cannot publish the dataset")?;
    drop(bars);
    print(&format!(
        "{}: {} files\n{}: {} files\ncommitment {}\n",
        args.public.display(),
        found.public_files,
        args.private.display(),
        found.private_files,
        found.commitment_sha256
    ))?;
    Ok(Outcome::Good)
}
