//! `mateval eval leaderboard`: ranks results and writes a site.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use mateval_eval::result::ResultFile;
use mateval_report::leaderboard::errata::ErrataFile;
use mateval_report::leaderboard::{LeaderboardPlan, Submissions, verified, write};
use mateval_scene::open::Dataset;

use super::strip_picture::StripArgs;
use crate::bars::with_progress;
use crate::outcome::{Outcome, print, say};
use crate::tool::TOOL;

/// Arguments of `eval leaderboard`.
#[derive(clap::Args)]
pub struct LeaderboardArgs {
    /// RESULT.json files. One is marked as verified if RESULT.verified.json, written by `eval verify`, lies beside it.
    #[arg(required = true, value_name = "RESULT.json")]
    results: Vec<PathBuf>,
    /// RESULT.json of the truth itself (`mateval baseline gt`), shown below the methods as the ceiling of each column.
    #[arg(long, value_name = "RESULT.json")]
    ceiling: Option<PathBuf>,
    /// Folder of the site; its index.html opens from the disk.
    #[arg(long)]
    out: PathBuf,
    /// Protocol whose scores are ranked.
    #[arg(long, default_value = "mateval-2")]
    protocol: String,
    /// Accept results that lack scenes, and rank each on the scenes that it covers; they are marked.
    #[arg(long)]
    partial: bool,
    /// Folder of the dataset, to draw pictures of each `--submission`.
    #[arg(long, requires = "submissions")]
    dataset: Option<PathBuf>,
    /// Folder of a submission to show beside the truth; may be given several times.
    #[arg(long = "submission", value_name = "SUBMISSION", requires = "dataset")]
    submissions: Vec<PathBuf>,
    #[command(flatten)]
    strips: StripArgs,
    /// Folder of further pictures to show: `<method>/<scene>/<view>/<kind>.png`, with `_truth` as the method of the
    /// truth's pictures.
    #[arg(long)]
    pictures: Option<PathBuf>,
    /// JSON file of errors that were found after publication.
    #[arg(long)]
    errata: Option<PathBuf>,
    /// Replace a leaderboard that already exists.
    #[arg(long)]
    force: bool,
}

/// Writes the site and prints the path of its first page.
pub fn run(args: &LeaderboardArgs) -> anyhow::Result<Outcome> {
    let errata = args.errata.as_deref().map(ErrataFile::read).transpose()?;
    let mut results = Vec::new();
    let mut marks = Vec::new();
    for path in &args.results {
        let mut result = ResultFile::read(path)?;
        marks.push(verified::read(path, &result)?);
        // Single pictures are most of a result's memory, and the site does not show them.
        result.protocols.values_mut().for_each(|scores| scores.pictures = Vec::new());
        results.push(result);
    }
    for (path, _) in args.results.iter().zip(&marks).filter(|(_, mark)| **mark == verified::Verified::Stale) {
        let sidecar = verified::sidecar(path);
        say(&format!(
            "warning: '{}' verifies an earlier version of the result; run `eval verify` again",
            sidecar.display()
        ));
    }
    let ceiling = args.ceiling.as_deref().map(ResultFile::read).transpose()?;
    let dataset = args.dataset.as_deref().map(Dataset::open).transpose().context("cannot open the dataset")?;
    if let Some(pictures) = args.pictures.as_ref().filter(|pictures| !pictures.is_dir()) {
        bail!("'{}' is not a folder; expected a folder of pictures", pictures.display());
    }
    let plan = LeaderboardPlan {
        results: &results,
        ceiling: ceiling.as_ref(),
        verified: marks,
        protocol: &args.protocol,
        partial: args.partial,
        errata: errata.as_ref(),
        pictures: args.pictures.as_deref(),
        submissions: dataset.as_ref().map(|dataset| Submissions {
            dataset,
            folders: args.submissions.clone(),
            shown: args.strips.shown(),
        }),
        tool: TOOL.to_owned(),
    };
    with_progress(|progress| write(&plan, &args.out, args.force, progress)).context("cannot write the leaderboard")?;
    print(&format!("{}\n", args.out.join("index.html").display()))?;
    Ok(Outcome::Good)
}
