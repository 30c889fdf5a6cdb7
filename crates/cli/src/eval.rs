//! `mateval eval`: checks, scores and compares submissions.

mod explain;
mod image;
pub mod leaderboard;
mod lint;
mod pictures;
pub mod score;
mod strip_picture;
mod tables;
mod verify;

use crate::outcome::Outcome;

/// Subcommands of `eval`.
#[derive(clap::Subcommand)]
pub enum Command {
    /// Prints the metrics of two pictures, with a mask under both mask rules.
    Image(image::ImageArgs),
    /// Checks a submission before it is scored and lists all faults at once, in seconds. Exit code 1: it has an error.
    Lint(lint::LintArgs),
    /// Scores submissions on a dataset.
    Score(score::ScoreArgs),
    /// Writes truth and submissions side by side, as albedo or relit, and maps of their errors: two PNG files per scene.
    Pictures(pictures::PicturesArgs),
    /// Prints tables of several results: the paper's Tables II to V, and MatEval's metrics in the same layout.
    Tables(tables::TablesArgs),
    /// Reports where the albedo of one scene is wrong and how: brightness, tint, shading left in, misplacement, lost
    /// detail.
    Explain(explain::ExplainArgs),
    /// Computes every number of a result again. Exit code 1: one differs.
    Verify(verify::VerifyArgs),
    /// Ranks results and writes them as a site that opens from the disk.
    Leaderboard(leaderboard::LeaderboardArgs),
}

/// Runs the subcommand.
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Image(args) => image::run(args),
        Command::Lint(args) => lint::run(args),
        Command::Score(args) => score::run(args),
        Command::Pictures(args) => pictures::run(args),
        Command::Tables(args) => tables::run(args),
        Command::Explain(args) => explain::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Leaderboard(args) => leaderboard::run(args),
    }
}
