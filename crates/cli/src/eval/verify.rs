//! `mateval eval verify`.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_eval::archive;
use mateval_eval::verify::{VerificationFile, VerifyPlan, verify};
use mateval_metrics::Net;
use mateval_scene::json;
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::check_free;

use crate::TOOL;
use crate::bars::Bars;
use crate::outcome::{Outcome, print};
use crate::weights;

/// What it is given.
#[derive(clap::Args)]
pub struct VerifyArgs {
    /// RESULT.json.
    result: PathBuf,
    /// The submission that it was made of: a folder, a .zip or a .tar.gz.
    #[arg(long)]
    submission: PathBuf,
    /// The dataset that it was made on.
    #[arg(long)]
    dataset: PathBuf,
    /// A file for the verification; beside `NAME.json`, `NAME.verified.json` is what a leaderboard looks for.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Scenes that are scored at once.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    jobs: u8,
    /// How to print.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Replace a file that is there.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    Text,
    Json,
}

/// Makes every number anew, and tells whether they are the result's.
pub fn run(args: &VerifyArgs) -> anyhow::Result<Outcome> {
    args.out.iter().try_for_each(|out| check_free(out, args.force, "--out"))?;
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
    let bars = Bars::new();
    let found = verify(plan, &|step, done, all| bars.step(step, done, all)).context("cannot verify")?;
    drop(bars);
    args.out.iter().try_for_each(|out| json::write(out, &found))?;
    print(&match args.format {
        Format::Json => json::to_text(&found),
        Format::Text => text(&found),
    })?;
    Ok(if found.confirmed { Outcome::Good } else { Outcome::No })
}

fn text(found: &VerificationFile) -> String {
    let mut lines: Vec<String> = found.findings.iter().map(ToString::to_string).collect();
    let untold = found.differences.saturating_sub(found.findings.len());
    if untold > 0 {
        lines.push(format!("{untold} values more differ"));
    }
    lines.push(match (found.confirmed, found.differences) {
        (true, _) => "confirmed: every number was made anew".to_owned(),
        (false, 0) => "not confirmed: it was not made of this".to_owned(),
        (false, count) => format!("not confirmed: {count} values differ"),
    });
    lines.join("\n") + "\n"
}
