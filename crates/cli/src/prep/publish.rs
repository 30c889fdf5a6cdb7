//! `mateval prep publish`: a dataset as a public and a withheld folder.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use mateval_audit::publish::publish;

use crate::bars::with_progress;
use crate::outcome::{Outcome, print};

/// Arguments of `prep publish`.
#[derive(clap::Args)]
pub struct PublishArgs {
    /// Folder of the dataset, with its ground truth.
    dataset: PathBuf,
    /// The part that the public folder leaves out.
    #[arg(long, value_enum)]
    withhold: Withheld,
    /// Folder for the public files: the dataset without the withheld part.
    #[arg(long)]
    public: PathBuf,
    /// Folder for the withheld files. Copied over the public folder they give the dataset again.
    #[arg(long)]
    private: PathBuf,
    /// Replace folders that already exist.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Withheld {
    /// All files in `scenes/<scene>/ground_truth`.
    #[value(name = "ground_truth")]
    GroundTruth,
}

/// Writes both folders and prints the commitment, a hash of the withheld files.
pub fn run(args: &PublishArgs) -> anyhow::Result<Outcome> {
    let Withheld::GroundTruth = args.withhold;
    if args.public == args.private {
        bail!("--public and --private are the same folder; the ground truth would not be withheld");
    }
    for place in [&args.public, &args.private] {
        if place.exists() && !args.force {
            bail!("'{}' already exists; choose another folder, or add --force to overwrite it", place.display());
        }
    }
    let found = with_progress(|progress| publish(&args.dataset, &args.public, &args.private, progress))
        .context("cannot publish the dataset")?;
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
