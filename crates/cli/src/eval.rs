//! `mateval eval`: checks, scores and compares submissions.

mod score;
mod show;

use score::{ImageArgs, LintArgs, ScoreArgs, VerifyArgs};
use show::{ExplainArgs, LeaderboardArgs, PicturesArgs, TablesArgs};

use crate::terminal::Outcome;

/// Subcommands of `eval`.
#[derive(clap::Subcommand)]
pub enum Command {
    /// Prints the metrics of two pictures, with a mask under both mask rules.
    Image(ImageArgs),
    /// Checks a submission before it is scored and lists all faults at once, in seconds. Exit code 1: it has an error.
    Lint(LintArgs),
    /// Scores submissions on a dataset.
    Score(ScoreArgs),
    /// Writes truth and submissions side by side, as albedo or relit, and maps of their errors: two PNG files per scene.
    Pictures(PicturesArgs),
    /// Prints tables of several results: the paper's Tables II to V, and MatEval's metrics in the same layout.
    Tables(TablesArgs),
    /// Reports where the albedo of one scene is wrong and how: brightness, tint, shading left in, misplacement, lost
    /// detail.
    Explain(ExplainArgs),
    /// Computes every number of a result again. Exit code 1: one differs.
    Verify(VerifyArgs),
    /// Ranks results and writes them as a site that opens from the disk.
    Leaderboard(LeaderboardArgs),
}

/// Runs the subcommand.
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Image(args) => args.run(),
        Command::Lint(args) => args.run(),
        Command::Score(args) => args.run(),
        Command::Pictures(args) => args.run(),
        Command::Tables(args) => args.run(),
        Command::Explain(args) => args.run(),
        Command::Verify(args) => args.run(),
        Command::Leaderboard(args) => args.run(),
    }
}
