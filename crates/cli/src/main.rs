//! `mateval`: the command line. The only part that prints, reads the environment and ends the process.
//!
//! Results go to stdout, progress, log and warnings to stderr. Exit codes: 0 done and good, 1 done and the answer is no,
//! 2 could not be done.

mod bars;
mod baseline;
mod demo;
mod eval;
mod outcome;
mod prep;
mod sample;
mod schema;
mod weights;

use clap::{Parser, Subcommand};

use outcome::Outcome;

/// Name and version, as results and datasets are marked with.
const TOOL: &str = concat!("mateval ", env!("CARGO_PKG_VERSION"));

/// Makes and scores a benchmark for recovering the materials of an indoor room from one photo.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Everything on the built-in sample: dataset, renders, baselines, scores.
    Demo(demo::Args),
    /// Writes the built-in sample: a small CC0 room and a house as source scenes, with a recipe.
    Sample(sample::Args),
    /// Makes datasets.
    #[command(subcommand)]
    Prep(prep::Command),
    /// Makes a submission by a baseline that comes with the tool.
    #[command(subcommand)]
    Baseline(baseline::Command),
    /// Scores submissions.
    #[command(subcommand)]
    Eval(eval::Command),
    /// Writes the JSON Schemas of the format's files.
    #[command(hide = true)]
    Schema(schema::Args),
}

fn main() -> std::process::ExitCode {
    // A bug that panics has said so by itself; what it was about to do could not be done.
    std::panic::catch_unwind(run).unwrap_or(std::process::ExitCode::from(2))
}

fn run() -> std::process::ExitCode {
    let result = match Cli::parse().command {
        Command::Demo(args) => demo::run(&args),
        Command::Sample(args) => sample::run(&args),
        Command::Prep(command) => prep::run(&command),
        Command::Baseline(command) => baseline::run(&command),
        Command::Eval(command) => eval::run(&command),
        Command::Schema(args) => schema::run(&args),
    };
    match result {
        Ok(Outcome::Good) => std::process::ExitCode::from(0),
        Ok(Outcome::No) => std::process::ExitCode::from(1),
        Err(error) => {
            outcome::say(&format!("error: {}", outcome::told(&error)));
            std::process::ExitCode::from(2)
        }
    }
}
