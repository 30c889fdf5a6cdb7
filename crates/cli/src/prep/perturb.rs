//! `mateval prep perturb`: the public side of a dataset with other geometry.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_prep::perturb::{PerturbOptions, PerturbedScene, perturb};
use mateval_scene::perturbation::PerturbationKind;
use mateval_scene::work_folder::check_free;

use crate::bars::with_progress;
use crate::outcome::{Outcome, print};

/// Arguments of `prep perturb`.
#[derive(clap::Args)]
pub struct PerturbArgs {
    /// Folder of the dataset, with its ground truth.
    dataset: PathBuf,
    /// How the furniture differs from the true one.
    #[arg(long, value_enum)]
    kind: Kind,
    /// How far: 0 (not at all) to 3 for pose and shape, to 2 for scale.
    #[arg(long)]
    level: u32,
    /// The seed of the directions. They are the same at every level.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder for the public files with other geometry.
    #[arg(long)]
    out: PathBuf,
    /// Replace a folder that already exists.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Kind {
    /// Moved on the floor by 1, 5, 10 cm and turned by 1, 5, 5 degrees.
    Pose,
    /// Enlarged or reduced by 2, 5 %.
    Scale,
    /// Bent by at most 0.5, 1, 3 cm.
    Shape,
}

impl From<Kind> for PerturbationKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Pose => Self::Pose,
            Kind::Scale => Self::Scale,
            Kind::Shape => Self::Shape,
        }
    }
}

/// Writes the folder, and prints a line for each scene.
pub fn run(args: &PerturbArgs) -> anyhow::Result<Outcome> {
    check_free(&args.out, args.force, "--out")?;
    let options = PerturbOptions { kind: args.kind.into(), level: args.level, seed: args.seed };
    let scenes = with_progress(|progress| perturb(&args.dataset, &args.out, &options, progress))
        .context("cannot perturb the dataset")?;
    print(&scenes.iter().map(line).collect::<String>())?;
    Ok(Outcome::Good)
}

fn line(found: &PerturbedScene) -> String {
    let names: Vec<String> = found.crossing.iter().map(|id| format!("'{id}'")).collect();
    let walls = match &names[..] {
        [] => "none passes through a wall or floor".to_owned(),
        names => format!("{} newly pass through a wall or floor: {}", names.len(), names.join(", ")),
    };
    format!("{}: {} pieces of furniture moved; {walls}\n", found.scene, found.moved)
}
