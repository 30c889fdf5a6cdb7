//! `mateval graph`: procedural materials as graphs of MaterialX nodes.

mod check;
mod list;
mod render;
mod source;

use crate::outcome::Outcome;

/// Subcommands of `graph`.
#[derive(clap::Subcommand)]
pub enum Command {
    /// Lists the built-in graphs, or the parameters of one graph.
    List(list::ListArgs),
    /// Checks .mtlx files and reports every fault with its line. Exit code 1: a file has one.
    Check(check::CheckArgs),
    /// Writes a picture of a graph's base colour.
    Render(render::RenderArgs),
}

/// Runs the subcommand.
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::List(args) => list::run(args),
        Command::Check(args) => check::run(args),
        Command::Render(args) => render::run(args),
    }
}
