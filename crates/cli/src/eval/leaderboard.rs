//! `mateval eval leaderboard`: ranks results and writes a site.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use mateval_report::leaderboard::results_folder::ResultsFolder;
use mateval_report::leaderboard::{LeaderboardPlan, Submissions, entries, verified, write};
use mateval_scene::open::Dataset;

use super::strip_picture::StripArgs;
use crate::bars::with_progress;
use crate::outcome::{Outcome, print, say};
use crate::tool::TOOL;

/// Arguments of `eval leaderboard`.
#[derive(clap::Args)]
pub struct LeaderboardArgs {
    /// RESULT.json files. One is marked as verified if RESULT.verified.json, written by `eval verify`, lies beside it.
    #[arg(required_unless_present = "from", value_name = "RESULT.json")]
    results: Vec<PathBuf>,
    /// Folder of results, as collected by pull requests: every .json file in it and in the folders below it. In the
    /// folder itself, ceiling.json is taken for `--ceiling` and errata.json for `--errata`.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["results", "ceiling", "errata"])]
    from: Option<PathBuf>,
    /// RESULT.json of the truth itself (`mateval baseline gt`), shown below the methods as the ceiling of each column.
    #[arg(long, value_name = "RESULT.json")]
    ceiling: Option<PathBuf>,
    /// Folder of the site; its index.html opens from the disk.
    #[arg(long)]
    out: PathBuf,
    /// Protocol whose scores are ranked.
    #[arg(long, default_value = "mateval-3")]
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
    let files = match &args.from {
        Some(folder) => ResultsFolder::list(folder)?,
        None => {
            ResultsFolder { results: args.results.clone(), ceiling: args.ceiling.clone(), errata: args.errata.clone() }
        }
    };
    let entries = entries::read(&files)?;
    let marked = files.results.iter().zip(&entries.verified);
    for (path, _) in marked.filter(|(_, mark)| **mark == verified::Verified::Stale) {
        let sidecar = verified::sidecar(path);
        say(&format!(
            "warning: '{}' verifies an earlier version of the result; run `eval verify` again",
            sidecar.display()
        ));
    }
    let dataset = args.dataset.as_deref().map(Dataset::open).transpose().context("cannot open the dataset")?;
    if let Some(pictures) = args.pictures.as_ref().filter(|pictures| !pictures.is_dir()) {
        bail!("'{}' is not a folder; expected a folder of pictures", pictures.display());
    }
    let plan = LeaderboardPlan {
        results: &entries.results,
        ceiling: entries.ceiling.as_ref(),
        verified: entries.verified.clone(),
        protocol: &args.protocol,
        partial: args.partial,
        errata: entries.errata.as_ref(),
        pictures: args.pictures.as_deref(),
        submissions: dataset.as_ref().map(|dataset| Submissions {
            dataset,
            folders: args.submissions.clone(),
            shown: args.strips.shown_in_leaderboard(dataset),
        }),
        tool: TOOL.to_owned(),
    };
    with_progress(|progress| write(&plan, &args.out, args.force, progress)).context("cannot write the leaderboard")?;
    print(&format!("{}\n", args.out.join("index.html").display()))?;
    Ok(Outcome::Good)
}
