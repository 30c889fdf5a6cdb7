//! `mateval eval`: checks, scores and compares submissions. The commands that judge submissions are here, those that
//! show results in `show`.

mod show;

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use mateval_dataset::open::{Dataset, check_outside_datasets};
use mateval_dataset::scene_cost::processor_time;
use mateval_dataset::{SceneId, json};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::ResultFile;
use mateval_eval::score::{LpipsWeights, ScorePlan, score};
use mateval_eval::verify::{VerificationFile, VerifyPlan, verify};
use mateval_files::work_folder;
use mateval_metrics::{Lpips, Net};
use mateval_report::leaderboard::marks;
use mateval_report::pair::{PairValues, compare};
use mateval_report::release::file::Day;
use mateval_report::rounded::{RoundedFile, check_floor};
use mateval_submission::SubmissionError;
use mateval_submission::archive::Opened;
use mateval_submission::lint::{LintFile, LintPlan, lint, plain, refused};

use self::show::{ExplainArgs, LeaderboardArgs, PicturesArgs, TablesArgs, VotesArgs};
use crate::TOOL;
use crate::arguments::{Format, check_output_file, open_submission};
use crate::fetch::{FETCH_LPIPS, load_weights};
use crate::key::today;
use crate::terminal::{Outcome, counted, print, print_fitted, say, say_findings, with_progress};

/// Subcommands of `eval`.
#[derive(clap::Subcommand)]
pub enum Command {
    /// Prints the metrics of two pictures, with a mask under both mask rules.
    Image(ImageArgs),
    /// Checks a submission before it is scored and lists all faults at once, in seconds. Exit code 1: it has an error.
    Lint(LintArgs),
    /// Scores submissions on a dataset.
    Score(ScoreArgs),
    /// Writes truth and submissions side by side, as albedo or relit, and maps of their errors: two PNG files per
    /// scene.
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
    /// Counts people's votes on a leaderboard's pictures: the strength of each method, and which number orders methods
    /// as people do.
    Votes(VotesArgs),
}

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
        Command::Votes(args) => args.run(),
    }
}

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

impl LintArgs {
    /// Checks the submission; the answer is no where it has an error.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        self.out.iter().try_for_each(|out| check_output_file(out, "--out", "report", self.force))?;
        let dataset = Dataset::open(&self.dataset).context("cannot open the dataset")?.with_twins();
        let file = lint_report(self, &dataset).context("cannot check the submission")?;
        self.out.iter().try_for_each(|out| json::write(out, &file))?;
        match self.format {
            Format::Json => print(&json::to_text(&file))?,
            Format::Text => print_fitted(&plain(&file))?,
        }
        Ok(if file.good { Outcome::Good } else { Outcome::No })
    }
}

fn lint_report(args: &LintArgs, dataset: &Dataset) -> Result<LintFile, SubmissionError> {
    let opened = match open_submission(&args.submission) {
        // An unsound archive is a result of the check, not a failure to check.
        Err(SubmissionError::Archive { findings, .. }) => return Ok(refused(dataset, TOOL, findings)),
        opened => opened?,
    };
    let plan = LintPlan { dataset, submission: opened.root(), tool: TOOL.to_owned() };
    with_progress(|progress| lint(&plan, progress))
}

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
    /// Protocol to score under, `capture-1` for captured rooms; may be given several times.
    #[arg(long = "protocol", value_name = "PROTOCOL", default_values = [Protocol::DEFAULT])]
    protocols: Vec<String>,
    /// Number of scenes that are scored at once. More take more memory and leave fewer threads idle.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    jobs: u8,
    /// Folder in which the scores of every scene are kept for later runs, found by the hashes of everything that they
    /// depend on [default: a folder beside the result, removed when the result is complete, so that a run that was
    /// killed resumes].
    #[arg(long)]
    cache: Option<PathBuf>,
    /// Compute nothing: put the result together from the scores in --cache, and fail where one is missing. For scenes
    /// that were scored apart.
    #[arg(long, requires = "cache")]
    only_cached: bool,
    /// File for the numbers of a hidden split that may be shown: the headline, rounded, with no scene, instance or
    /// picture, and only where it is better than every --floor; for a single submission.
    #[arg(long, value_name = "FILE", requires = "floors")]
    rounded: Option<PathBuf>,
    /// For --rounded: the result of a baseline that anybody can make from the public files, such as `nn` on `delight`,
    /// on these scenes or more. Numbers that are not better than its own are shown as its own; may be given several
    /// times.
    #[arg(long = "floor", value_name = "RESULT.json", requires = "rounded")]
    floors: Vec<PathBuf>,
    /// Folder for the pictures from which the numbers are computed, as float EXR, for whoever computes them again with
    /// other tools; with several submissions a folder of it for each, 0 first.
    #[arg(long, value_name = "FOLDER", conflicts_with = "only_cached")]
    pictures: Option<PathBuf>,
    /// Replace result files that already exist.
    #[arg(long)]
    force: bool,
}

impl ScoreArgs {
    /// Scores the submissions, writes a result file for each and prints its path.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let protocols = self.protocols.iter().map(|name| Protocol::named(name)).collect::<Result<Vec<_>, _>>()?;
        let outs = self.result_paths();
        for (place, path) in
            [("--out", Some(&self.out)), ("--cache", self.cache.as_ref()), ("--pictures", self.pictures.as_ref())]
        {
            path.iter().try_for_each(|path| check_outside_datasets(path, place))?;
        }
        check_results(&outs, self)?;
        if let Some(rounded) = &self.rounded {
            check_output_file(rounded, "--rounded", "result", self.force)?;
            if self.submissions.len() > 1 {
                bail!("--rounded takes the numbers of one submission; {} are given", self.submissions.len());
            }
        }
        let floors = self.floors.iter().map(|path| ResultFile::read(path)).collect::<Result<Vec<_>, _>>()?;
        let dataset = Dataset::open(&self.dataset).context("cannot open the dataset")?;
        let scored: Vec<&SceneId> = dataset.chosen_scenes(&self.scenes)?.iter().map(|scene| &scene.id).collect();
        floors.iter().try_for_each(|floor| check_floor(floor, &dataset, scored.iter().copied()))?;
        let opened = self.submissions.iter().map(|path| open_submission(path)).collect::<Result<Vec<_>, _>>()?;
        let cache = self.cache.clone().unwrap_or_else(|| cache_beside(&self.out));
        if !self.only_cached {
            // A folder that cannot be made is found before anything is scored.
            std::fs::create_dir_all(&cache).with_context(|| format!("cannot create '{}'", cache.display()))?;
        }
        let times = Mutex::new(Vec::new());
        let keep_time = |scene: &SceneId, time: Duration| {
            times.lock().unwrap_or_else(PoisonError::into_inner).push((time, scene.clone()));
        };
        let (start, processor) = (Instant::now(), processor_time());
        let plan = ScorePlan {
            dataset: &dataset,
            submissions: opened.iter().map(Opened::root).collect(),
            protocols,
            scenes: self.scenes.clone(),
            lpips: load_weights(Net::Alex),
            tool: TOOL.to_owned(),
            jobs: usize::from(self.jobs),
            cache: Some(&cache),
            only_cached: self.only_cached,
            pictures: self.pictures.as_deref(),
            seen: None,
            timed: Some(&keep_time),
        };
        let results = with_progress(|progress| score(&plan, progress)).context("cannot score")?;
        let processor = processor.zip(processor_time()).map(|(before, after)| after.saturating_sub(before));
        let times = times.lock().unwrap_or_else(PoisonError::into_inner);
        let cost = cost_text(&times, self.submissions.len(), start.elapsed(), processor);
        for (result, out) in results.iter().zip(&outs) {
            json::write_lines(out, result)?;
            if let Some(rounded) = &self.rounded {
                json::write(rounded, &RoundedFile::new(result, &floors).context("cannot round the result")?)?;
            }
            say_findings(&result.method, &result.findings, &out.display().to_string());
            print(&format!("{}\n", out.display()))?;
        }
        cost.iter().for_each(|text| say(text));
        if self.cache.is_none() && cache.exists() {
            std::fs::remove_dir_all(&cache).with_context(|| format!("cannot remove '{}'", cache.display()))?;
        }
        Ok(Outcome::Good)
    }

    /// Where each submission's result goes: `--out`, or with several submissions a file in that folder.
    pub fn result_paths(&self) -> Vec<PathBuf> {
        match self.submissions.as_slice() {
            [_] => vec![self.out.clone()],
            several => several.iter().map(|path| self.out.join(format!("{}.json", submission_name(path)))).collect(),
        }
    }
}

/// What scoring cost, for whoever sizes a queue: times in seconds, as the time limits of queues and `prep export
/// --seconds-a-scene` are. Absent if every score was in the cache.
fn cost_text(
    times: &[(Duration, SceneId)],
    submissions: usize,
    wall: Duration,
    processor: Option<Duration>,
) -> Option<String> {
    let (longest, slowest) = times.iter().max()?;
    let processor = processor.map(|time| format!("; {:.1} s of processor time", time.as_secs_f64()));
    Some(format!(
        "{} scored on {} in {:.1} s: {:.1} s per scene, {:.1} s for the slowest, '{slowest}'{}",
        counted(submissions, "submission"),
        counted(times.len(), "scene"),
        wall.as_secs_f64(),
        wall.as_secs_f64() / times.len() as f64,
        longest.as_secs_f64(),
        processor.unwrap_or_default(),
    ))
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
    /// A secret key, as `mateval key new` writes it, to sign the verification with: the signature lies beside `--out`,
    /// with the ending .minisig.
    #[arg(long, value_name = "KEY", requires = "out")]
    sign: Option<PathBuf>,
    /// The day that the signature states [default: today, in UTC].
    #[arg(long, requires = "sign")]
    date: Option<Day>,
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

impl VerifyArgs {
    /// Scores again and compares; the answer is no where a number differs.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        self.out.iter().try_for_each(|out| check_output_file(out, "--out", "verification", self.force))?;
        // A key that cannot be read is found before anything is scored.
        let key = self.sign.as_deref().map(marks::secret_key).transpose()?;
        let dataset = Dataset::open(&self.dataset).context("cannot open the dataset")?;
        let opened = open_submission(&self.submission)?;
        let plan = VerifyPlan {
            result: &self.result,
            submission: opened.root(),
            dataset: &dataset,
            lpips: load_weights(Net::Alex),
            tool: TOOL.to_owned(),
            jobs: usize::from(self.jobs),
        };
        let found = with_progress(|progress| verify(plan, progress)).context("cannot verify")?;
        if let Some(out) = &self.out {
            json::write(out, &found)?;
            // A signature of an earlier verification must not stay beside this one.
            work_folder::remove(&marks::signature_of(out))?;
            if let Some(key) = &key {
                marks::sign(out, key, &String::from(self.date.clone().unwrap_or_else(today)))?;
            }
        }
        match self.format {
            Format::Json => print(&json::to_text(&found))?,
            Format::Text => print_fitted(&verification_text(&found))?,
        }
        Ok(if found.confirmed { Outcome::Good } else { Outcome::No })
    }
}

fn verification_text(found: &VerificationFile) -> String {
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

#[derive(clap::Args)]
pub struct ImageArgs {
    /// The picture to judge: 8-bit sRGB PNG or linear EXR.
    prediction: PathBuf,
    /// The true picture, of the same size: 8-bit sRGB PNG or linear EXR.
    reference: PathBuf,
    /// 8-bit grey PNG of the same size: 255 where pixels count, 0 elsewhere.
    #[arg(long)]
    mask: Option<PathBuf>,
    /// Network of LPIPS; may be given several times.
    #[arg(long = "net", value_name = "NET", value_enum, default_values = ["alex"])]
    nets: Vec<NetName>,
    /// How to print the metrics.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum NetName {
    Alex,
    Vgg,
}

impl ImageArgs {
    /// Compares the pictures and prints the metrics.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let mut nets: Vec<Lpips> = Vec::new();
        let mut missing = Vec::new();
        for name in &self.nets {
            let net = if *name == NetName::Alex { Net::Alex } else { Net::Vgg };
            match load_weights(net) {
                LpipsWeights::Loaded(lpips) => nets.push(*lpips),
                LpipsWeights::Missing { reason, .. } => missing.push((net.key(), reason)),
            }
        }
        let values = compare(&self.prediction, &self.reference, self.mask.as_deref(), &nets)?;
        match self.format {
            Format::Json => print(&json::to_text(&serde_json::json!({
                "format": "mateval-image/1",
                "tool": TOOL,
                "values": values,
                "missing": missing
                    .iter()
                    .map(|(net, reason)| serde_json::json!({ "metric": net, "reason": reason, "fix": FETCH_LPIPS }))
                    .collect::<Vec<_>>(),
            })))?,
            Format::Text => print(&image_text(&values, &missing))?,
        }
        Ok(Outcome::Good)
    }
}

fn image_text(values: &PairValues, missing: &[(&str, String)]) -> String {
    let mut lines = Vec::new();
    let mut line = |name: &str, value: Option<f64>| {
        lines.push(format!("{name:24} {}", value.map_or("none".to_owned(), |value| format!("{value:.6}"))));
    };
    line("mse", values.mse);
    line("psnr_db", values.psnr);
    line("ssim", values.ssim);
    for net in &values.lpips {
        line(&net.metric, net.value);
    }
    if let Some(masked) = &values.masked {
        line("masked mse", masked.mse);
        line("masked psnr_db", masked.psnr);
        line("masked ssim inside", masked.ssim_inside);
        line("masked ssim black_fill", masked.ssim_black_fill);
        for (rule, nets) in [("inside", &masked.lpips_inside), ("black_fill", &masked.lpips_black_fill)] {
            for net in nets {
                line(&format!("masked {} {rule}", net.metric), net.value);
            }
        }
    }
    lines.extend(missing.iter().map(|(net, _)| format!("{net:24} missing; run: {FETCH_LPIPS}")));
    lines.join("\n") + "\n"
}
