//! The `mateval` command. Only this crate prints, reads the environment and ends the process.
//!
//! Each subcommand has a file. It parses its arguments, checks them and everything else that can fail early, and then
//! calls a library, which returns values. Results go to stdout; progress and warnings go to stderr. Exit codes: 0 the
//! command did its work and the answer is good, 1 it did its work and the answer is no, 2 it could not do its work.

mod bars;
mod baseline;
mod demo;
mod eval;
mod format;
mod outcome;
mod output_file;
mod parsing;
mod prep;
mod sample;
mod schema;
mod tool;
mod weights;

use clap::{Parser, Subcommand};

use outcome::Outcome;

/// Makes and scores a benchmark for recovering the materials of an indoor room from one photo.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs everything on the built-in sample: dataset, renders, baselines, scores and leaderboard.
    Demo(demo::Args),
    /// Writes the built-in sample: the source scenes of a small CC0 room and a house, and a recipe for them.
    Sample(sample::Args),
    /// Makes, checks and describes datasets.
    #[command(subcommand)]
    Prep(prep::Command),
    /// Makes a submission by a method that comes with the tool, or from another method's files.
    #[command(subcommand)]
    Baseline(baseline::Command),
    /// Checks, scores and compares submissions.
    #[command(subcommand)]
    Eval(eval::Command),
    /// Writes the JSON Schemas of the format's files.
    #[command(hide = true)]
    Schema(schema::Args),
}

fn main() -> std::process::ExitCode {
    // A panic is a bug and has printed its own message.
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
            outcome::say(&format!("error: {}", outcome::error_text(&error)));
            std::process::ExitCode::from(2)
        }
    }
}
