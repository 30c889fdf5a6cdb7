//! `mateval eval verify`: computes every number of a result again.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_eval::verify::{VerificationFile, VerifyPlan, verify};
use mateval_metrics::Net;
use mateval_scene::json;
use mateval_scene::open::Dataset;
use mateval_submission::archive;

use crate::bars::with_progress;
use crate::format::Format;
use crate::outcome::{Outcome, print};
use crate::output_file::check_output_file;
use crate::tool::TOOL;
use crate::weights;

/// Arguments of `eval verify`.
#[derive(clap::Args)]
pub struct VerifyArgs {
    /// The RESULT.json file.
    #[arg(value_name = "RESULT.json")]
    result: PathBuf,
    /// The submission that was scored: a folder, a .zip or a .tar.gz archive.
    #[arg(long)]
    submission: PathBuf,
    /// Folder of the dataset that it was scored on.
    #[arg(long)]
    dataset: PathBuf,
    /// File for the verification. A leaderboard finds that of `NAME.json` by the name `NAME.verified.json`, in the same
    /// folder.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Number of scenes that are scored at once.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    jobs: u8,
    /// How to print the verification.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Replace a verification that already exists.
    #[arg(long)]
    force: bool,
}

/// Scores again and compares; the answer is no where a number differs.
pub fn run(args: &VerifyArgs) -> anyhow::Result<Outcome> {
    args.out.iter().try_for_each(|out| check_output_file(out, "--out", "verification", args.force))?;
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let opened = archive::open(&args.submission, &std::env::temp_dir())?;
    let plan = VerifyPlan {
        result: &args.result,
        submission: opened.root(),
        dataset: &dataset,
        lpips: weights::load(Net::Alex),
        tool: TOOL.to_owned(),
        jobs: usize::from(args.jobs),
    };
    let found = with_progress(|progress| verify(plan, progress)).context("cannot verify")?;
    args.out.iter().try_for_each(|out| json::write(out, &found))?;
    print(&match args.format {
        Format::Json => json::to_text(&found),
        Format::Text => text(&found),
    })?;
    Ok(if found.confirmed { Outcome::Good } else { Outcome::No })
}

fn text(found: &VerificationFile) -> String {
    let mut lines: Vec<String> = found.findings.iter().map(ToString::to_string).collect();
    let unlisted = found.differences.saturating_sub(found.findings.len());
    if unlisted > 0 {
        lines.push(format!("{unlisted} more values differ"));
    }
    lines.push(match (found.confirmed, found.differences) {
        (true, _) => "confirmed: every number was computed again and is the same".to_owned(),
        (false, 0) => "not confirmed: the result was not made from this submission and dataset".to_owned(),
        (false, count) => format!("not confirmed: {count} values differ"),
    });
    lines.join("\n") + "\n"
}
