//! `mateval eval leaderboard`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use mateval_eval::result::ResultFile;
use mateval_report::leaderboard::errata::ErrataFile;
use mateval_report::leaderboard::{LeaderboardPlan, Submissions, verified, write};
use mateval_scene::json;
use mateval_scene::open::Dataset;

use super::pictures::StripPicture;
use crate::TOOL;
use crate::bars::Bars;
use crate::outcome::{Outcome, print, say};

/// What it is given.
#[derive(clap::Args)]
pub struct LeaderboardArgs {
    /// RESULT.json files; RESULT.verified.json beside one, from `eval verify`, gives it its mark.
    #[arg(required = true)]
    pub results: Vec<PathBuf>,
    /// The folder of the site; its index.html opens from the disk.
    #[arg(long)]
    pub out: PathBuf,
    /// Under which rules.
    #[arg(long, default_value = "mateval-1")]
    pub protocol: String,
    /// Let in results of fewer scenes, and rank each on the scenes that it covers; they are marked.
    #[arg(long)]
    pub partial: bool,
    /// The dataset's folder, to show pictures of each `--submission`.
    #[arg(long, requires = "submissions")]
    pub dataset: Option<PathBuf>,
    /// A submission's folder, to be shown beside the truth; may be given several times.
    #[arg(long = "submission", requires = "dataset")]
    pub submissions: Vec<PathBuf>,
    /// What is shown of them; may be given several times.
    #[arg(long = "picture", value_enum, default_values_t = [StripPicture::Albedo])]
    pub shown: Vec<StripPicture>,
    /// Samples a pixel of pictures of light, half of them in each of two halves.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=65536))]
    pub samples: u32,
    /// A folder of more pictures to show: `<method>/<scene>/<view>/<kind>.png`, and `_truth` for the method's name.
    #[arg(long)]
    pub pictures: Option<PathBuf>,
    /// A JSON file of what was found wrong later.
    #[arg(long)]
    pub errata: Option<PathBuf>,
    /// Replace a leaderboard that is there.
    #[arg(long)]
    pub force: bool,
}

/// Writes the site.
pub fn run(args: &LeaderboardArgs) -> anyhow::Result<Outcome> {
    let errata = args.errata.as_deref().map(read_errata).transpose()?;
    let mut results = Vec::new();
    let mut marks = Vec::new();
    for path in &args.results {
        let mut result: ResultFile = json::read(path)?;
        marks.push(verified::read(path, &result)?);
        // Most of a result's memory, and of no use here.
        result.protocols.values_mut().for_each(|scores| scores.pictures = Vec::new());
        results.push(result);
    }
    for (path, _) in args.results.iter().zip(&marks).filter(|(_, mark)| **mark == verified::Verified::Stale) {
        let sidecar = verified::sidecar(path);
        say(&format!("warning: '{}' is not of this result as it is now; run `eval verify` again", sidecar.display()));
    }
    let dataset = args.dataset.as_deref().map(Dataset::open).transpose().context("cannot open the dataset")?;
    if let Some(pictures) = args.pictures.as_ref().filter(|pictures| !pictures.is_dir()) {
        bail!("'{}' is no folder; expected one of pictures", pictures.display());
    }
    let plan = LeaderboardPlan {
        results: &results,
        verified: marks,
        protocol: &args.protocol,
        partial: args.partial,
        errata: errata.as_ref(),
        pictures: args.pictures.as_deref(),
        submissions: dataset.as_ref().map(|dataset| Submissions {
            dataset,
            folders: args.submissions.clone(),
            shown: args.shown.iter().map(|picture| picture.shown(args.samples)).collect(),
        }),
        tool: TOOL.to_owned(),
    };
    let bars = Bars::new();
    write(&plan, &args.out, args.force, &|step, done, all| bars.step(step, done, all))
        .context("cannot write the leaderboard")?;
    drop(bars);
    print(&format!("{}\n", args.out.join("index.html").display()))?;
    Ok(Outcome::Good)
}

fn read_errata(path: &Path) -> anyhow::Result<ErrataFile> {
    let errata: ErrataFile = json::read(path)?;
    errata.check()?;
    Ok(errata)
}
