//! `mateval eval lint`.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_eval::EvalError;
use mateval_eval::archive;
use mateval_eval::lint::{LintFile, LintPlan, lint, plain, refused};
use mateval_scene::json;
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::check_free;

use crate::TOOL;
use crate::bars::Bars;
use crate::outcome::{Outcome, print};

/// What it is given.
#[derive(clap::Args)]
pub struct LintArgs {
    /// The submission: a folder, a .zip or a .tar.gz.
    submission: PathBuf,
    /// The dataset's folder; its ground truth is not needed.
    #[arg(long)]
    dataset: PathBuf,
    /// A file for the report, as JSON.
    #[arg(long)]
    out: Option<PathBuf>,
    /// How to print.
    #[arg(long, value_enum, default_value = "text")]
    format: LintFormat,
    /// Replace a file that is there.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum LintFormat {
    Text,
    Json,
}

/// Looks a submission over; the answer is no where there is an error.
pub fn run(args: &LintArgs) -> anyhow::Result<Outcome> {
    args.out.iter().try_for_each(|out| check_free(out, args.force, "--out"))?;
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let file = look_over(args, &dataset).context("cannot look the submission over")?;
    args.out.iter().try_for_each(|out| json::write(out, &file))?;
    print(&match args.format {
        LintFormat::Json => json::to_text(&file),
        LintFormat::Text => plain(&file),
    })?;
    Ok(if file.good { Outcome::Good } else { Outcome::No })
}

fn look_over(args: &LintArgs, dataset: &Dataset) -> Result<LintFile, EvalError> {
    let opened = match archive::open(&args.submission, &std::env::temp_dir()) {
        // That it is no sound archive is an answer too.
        Err(EvalError::Archive { findings, .. }) => return Ok(refused(dataset, TOOL, findings)),
        opened => opened?,
    };
    let bars = Bars::new();
    let plan = LintPlan { dataset, submission: opened.root(), tool: TOOL.to_owned() };
    lint(&plan, &|step, done, all| bars.step(step, done, all))
}
