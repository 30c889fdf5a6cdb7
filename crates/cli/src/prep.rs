//! `mateval prep`: makes, checks and describes datasets.

pub mod blender;
pub mod build;
mod compare;
mod export;
mod finish;
mod mitsuba;
mod perturb;
mod publish;
pub mod render;
mod stats;
mod survey;
mod verify;

use crate::outcome::Outcome;

/// Subcommands of `prep`.
#[derive(clap::Subcommand)]
pub enum Command {
    /// Converts the scenes that a recipe lists into a dataset. A build that was killed resumes when it is run again.
    Build(build::BuildArgs),
    /// Searches 3D-FRONT houses for rooms that could become scenes, and writes a page to choose from and a recipe.
    Survey(survey::SurveyArgs),
    /// Renders the photos that methods see, and the reference with which scores under light compare. Changes the manifest: run
    /// it before the dataset is given to anyone.
    Render(render::RenderArgs),
    /// Writes the files that describe the whole dataset, after scenes were made or rendered apart by --scene.
    Finish(finish::FinishArgs),
    /// Compares Blender's pictures with those of the built-in path tracer, and keeps the verdict in the dataset's compare.json,
    /// which its identity does not cover. Exit code 1: they disagree.
    Compare(compare::CompareArgs),
    /// Checks a dataset: hashes, schemas, reprojection, ids and masks. Exit code 1: it has an error.
    Verify(verify::VerifyArgs),
    /// Copies what methods see of a dataset with furniture moved, scaled or bent, to measure what imperfect geometry
    /// costs.
    Perturb(perturb::PerturbArgs),
    /// Splits a dataset into the public files and the ground truth of a hidden split, and writes a page that describes the
    /// release. Exit code 1: the page states a fault.
    Publish(publish::PublishArgs),
    /// Writes a dataset in a format that other tools read: tars, Croissant, Hugging Face, nerfstudio or COLMAP.
    Export(export::ExportArgs),
    /// Counts what a dataset holds: the paper's Table I, objects by category, and numbers scene by scene.
    Stats(stats::StatsArgs),
    /// Writes a view with its ground truth as a scene for Mitsuba 3. Exit code 1: Mitsuba cannot express all of it.
    Mitsuba(mitsuba::MitsubaArgs),
}

/// Runs the subcommand.
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Build(args) => build::run(args),
        Command::Survey(args) => survey::run(args),
        Command::Render(args) => render::run(args),
        Command::Finish(args) => finish::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Perturb(args) => perturb::run(args),
        Command::Publish(args) => publish::run(args),
        Command::Export(args) => export::run(args),
        Command::Stats(args) => stats::run(args),
        Command::Mitsuba(args) => mitsuba::run(args),
    }
}
