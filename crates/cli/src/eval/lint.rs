//! `mateval eval lint`: checks a submission before it is scored.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_scene::json;
use mateval_scene::open::Dataset;
use mateval_submission::SubmissionError;
use mateval_submission::archive;
use mateval_submission::lint::{LintFile, LintPlan, lint, plain, refused};

use crate::bars::with_progress;
use crate::format::Format;
use crate::outcome::{Outcome, print};
use crate::output_file::check_output_file;
use crate::tool::TOOL;

/// Arguments of `eval lint`.
#[derive(clap::Args)]
pub struct LintArgs {
    /// The submission: a folder, a .zip or a .tar.gz archive.
    submission: PathBuf,
    /// Folder of the dataset; its ground truth is not needed.
    #[arg(long)]
    dataset: PathBuf,
    /// File for the report, as JSON.
    #[arg(long)]
    out: Option<PathBuf>,
    /// How to print the report.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Replace a report that already exists.
    #[arg(long)]
    force: bool,
}

/// Checks the submission; the answer is no where it has an error.
pub fn run(args: &LintArgs) -> anyhow::Result<Outcome> {
    args.out.iter().try_for_each(|out| check_output_file(out, "--out", "report", args.force))?;
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let file = report(args, &dataset).context("cannot check the submission")?;
    args.out.iter().try_for_each(|out| json::write(out, &file))?;
    print(&match args.format {
        Format::Json => json::to_text(&file),
        Format::Text => plain(&file),
    })?;
    Ok(if file.good { Outcome::Good } else { Outcome::No })
}

fn report(args: &LintArgs, dataset: &Dataset) -> Result<LintFile, SubmissionError> {
    let opened = match archive::open(&args.submission, &std::env::temp_dir()) {
        // An unsound archive is a result of the check, not a failure to check.
        Err(SubmissionError::Archive { findings, .. }) => return Ok(refused(dataset, TOOL, findings)),
        opened => opened?,
    };
    let plan = LintPlan { dataset, submission: opened.root(), tool: TOOL.to_owned() };
    with_progress(|progress| lint(&plan, progress))
}
