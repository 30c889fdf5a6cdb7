//! `mateval eval score`: scores submissions on a dataset.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use mateval_eval::protocol::Protocol;
use mateval_eval::score::{ScorePlan, score};
use mateval_metrics::Net;
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::is_inside;
use mateval_scene::{SceneId, json};
use mateval_submission::archive::{self, Opened};

use crate::bars::with_progress;
use crate::outcome::{Outcome, print, say_findings};
use crate::output_file::check_output_file;
use crate::tool::TOOL;
use crate::weights;

/// Arguments of `eval score`.
#[derive(clap::Args)]
pub struct ScoreArgs {
    /// Submissions: folders, .zip or .tar.gz archives.
    #[arg(required = true, value_name = "SUBMISSION")]
    submissions: Vec<PathBuf>,
    /// Folder of the dataset.
    #[arg(long)]
    dataset: PathBuf,
    /// The result file; with several submissions a folder, which gets one file named after each.
    #[arg(long)]
    out: PathBuf,
    /// Score this scene only; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    /// Protocol to score under; may be given several times.
    #[arg(long = "protocol", value_name = "PROTOCOL", default_values = ["mateval-3"])]
    protocols: Vec<String>,
    /// Number of scenes that are scored at once. More take more memory and leave fewer threads idle.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    jobs: u8,
    /// Folder in which the scores of every scene are kept for later runs, found by the hashes of everything that they
    /// depend on [default: a folder beside the result, removed when the result is complete, so that a run that was
    /// killed resumes].
    #[arg(long)]
    cache: Option<PathBuf>,
    /// Compute nothing: put the result together from the scores in --cache, and fail where one is missing. For scenes that
    /// were scored apart.
    #[arg(long, requires = "cache")]
    only_cached: bool,
    /// Folder for the pictures from which the numbers are computed, as float EXR, for whoever computes them again with
    /// other tools; with several submissions a folder of it for each, 0 first.
    #[arg(long, value_name = "FOLDER", conflicts_with = "only_cached")]
    pictures: Option<PathBuf>,
    /// Replace result files that already exist.
    #[arg(long)]
    force: bool,
}

/// Scores the submissions, writes a result file for each and prints its path.
pub fn run(args: &ScoreArgs) -> anyhow::Result<Outcome> {
    let protocols = args.protocols.iter().map(|name| Protocol::named(name)).collect::<Result<Vec<_>, _>>()?;
    let outs = args.result_paths();
    for (place, path) in
        [("--out", Some(&args.out)), ("--cache", args.cache.as_ref()), ("--pictures", args.pictures.as_ref())]
    {
        if let Some(path) = path.filter(|path| is_inside(path, &args.dataset)) {
            bail!(
                "'{}' would lie in the dataset, whose manifest does not list it; choose another {place}",
                path.display()
            );
        }
    }
    check_results(&outs, args)?;
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let work = std::env::temp_dir();
    let opened = args.submissions.iter().map(|path| archive::open(path, &work)).collect::<Result<Vec<_>, _>>()?;
    let cache = args.cache.clone().unwrap_or_else(|| cache_beside(&args.out));
    if args.cache.is_some() && !args.only_cached {
        // A folder that cannot be made is found before anything is scored.
        std::fs::create_dir_all(&cache).with_context(|| format!("cannot create '{}'", cache.display()))?;
    }
    let plan = ScorePlan {
        dataset: &dataset,
        submissions: opened.iter().map(Opened::root).collect(),
        protocols,
        scenes: args.scenes.clone(),
        lpips: weights::load(Net::Alex),
        tool: TOOL.to_owned(),
        jobs: usize::from(args.jobs),
        cache: Some(&cache),
        only_cached: args.only_cached,
        pictures: args.pictures.as_deref(),
    };
    let results = with_progress(|progress| score(&plan, progress)).context("cannot score")?;
    for (result, out) in results.iter().zip(&outs) {
        json::write_lines(out, result)?;
        say_findings(&result.method, &result.findings, &out.display().to_string());
        print(&format!("{}\n", out.display()))?;
    }
    if args.cache.is_none() && cache.exists() {
        std::fs::remove_dir_all(&cache).with_context(|| format!("cannot remove '{}'", cache.display()))?;
    }
    Ok(Outcome::Good)
}

impl ScoreArgs {
    /// Where each submission's result goes: `--out`, or with several submissions a file in that folder.
    pub fn result_paths(&self) -> Vec<PathBuf> {
        match self.submissions.as_slice() {
            [_] => vec![self.out.clone()],
            several => several.iter().map(|path| self.out.join(format!("{}.json", submission_name(path)))).collect(),
        }
    }
}

/// Fails where a result could not be written. Scoring takes minutes, so this comes first.
fn check_results(outs: &[PathBuf], args: &ScoreArgs) -> anyhow::Result<()> {
    if outs.len() > 1 {
        std::fs::create_dir_all(&args.out).with_context(|| format!("cannot create '{}'", args.out.display()))?;
    }
    for (at, out) in outs.iter().enumerate() {
        check_output_file(out, "--out", "result", args.force)?;
        if outs[..at].contains(out) {
            bail!("two submissions would be written to '{}'; rename one of the folders", out.display());
        }
    }
    Ok(())
}

/// The folder in which scores are kept until the result `out` is complete.
fn cache_beside(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".scenes");
    PathBuf::from(name)
}

/// The name of a submission's folder, or of its archive without the ending.
fn submission_name(path: &Path) -> String {
    let whole = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let name = whole.file_name().map_or_else(|| "submission".to_owned(), |name| name.to_string_lossy().into_owned());
    let stem = [".zip", ".tar.gz", ".tgz"].iter().find_map(|ending| name.strip_suffix(ending).map(str::to_owned));
    stem.unwrap_or(name)
}
