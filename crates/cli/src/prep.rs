//! `mateval prep`: makes, checks and describes datasets.

mod check;
pub mod make;
mod publish;

use check::{CompareArgs, StatsArgs, VerifyArgs};
use make::{BuildArgs, FinishArgs, PerturbArgs, RenderArgs, SurveyArgs};
use publish::{ExportArgs, MitsubaArgs, PublishArgs};

use crate::terminal::Outcome;

/// Subcommands of `prep`.
#[derive(clap::Subcommand)]
pub enum Command {
    /// Converts the scenes that a recipe lists into a dataset. A build that was killed resumes when it is run again.
    Build(BuildArgs),
    /// Searches 3D-FRONT houses for rooms that could become scenes, and writes a page to choose from and a recipe.
    Survey(SurveyArgs),
    /// Renders the photos that methods see, and the reference with which scores under light compare. Changes the manifest: run
    /// it before the dataset is given to anyone.
    Render(RenderArgs),
    /// Writes the files that describe the whole dataset, after scenes were made or rendered apart by --scene.
    Finish(FinishArgs),
    /// Compares Blender's pictures with those of the built-in path tracer, and keeps the verdict in the dataset's compare.json,
    /// which its identity does not cover. Exit code 1: they disagree.
    Compare(CompareArgs),
    /// Checks a dataset: hashes, schemas, reprojection, ids and masks. Exit code 1: it has an error.
    Verify(VerifyArgs),
    /// Copies what methods see of a dataset with furniture moved, scaled or bent, to measure what imperfect geometry
    /// costs.
    Perturb(PerturbArgs),
    /// Splits a dataset into the public files and the ground truth of a hidden split, and writes a page that describes the
    /// release. Exit code 1: the page states a fault.
    Publish(PublishArgs),
    /// Writes a dataset in a format that other tools read: tars, Croissant, Hugging Face, nerfstudio or COLMAP.
    Export(ExportArgs),
    /// Counts what a dataset holds: the paper's Table I, objects by category, and numbers scene by scene.
    Stats(StatsArgs),
    /// Writes a view with its ground truth as a scene for Mitsuba 3. Exit code 1: Mitsuba cannot express all of it.
    Mitsuba(MitsubaArgs),
}

/// Runs the subcommand.
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Build(args) => args.run(),
        Command::Survey(args) => args.run(),
        Command::Render(args) => args.run(),
        Command::Finish(args) => args.run(),
        Command::Compare(args) => args.run(),
        Command::Verify(args) => args.run(),
        Command::Perturb(args) => args.run(),
        Command::Publish(args) => args.run(),
        Command::Export(args) => args.run(),
        Command::Stats(args) => args.run(),
        Command::Mitsuba(args) => args.run(),
    }
}
