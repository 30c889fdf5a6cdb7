//! `mateval eval`.

pub mod leaderboard;
mod lint;
pub mod pictures;
mod verify;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use mateval_eval::archive::{self, Opened};
use mateval_eval::explain::{self, ExplainPlan};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::ResultFile;
use mateval_eval::score::{ScorePlan, score};
use mateval_eval::tables::{Grouping, TableFormat, tables};
use mateval_metrics::{Lpips, Net};
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::check_free;
use mateval_scene::{SceneId, json};

use self::pictures::PicturesArgs;
use self::verify::VerifyArgs;
use crate::TOOL;
use crate::bars::Bars;
use crate::outcome::{Outcome, print, say, say_findings};
use crate::weights;

/// Its subcommands.
#[derive(clap::Subcommand)]
pub enum Command {
    /// The metrics of two pictures, with both mask rules.
    Image(ImageArgs),
    /// Looks a submission over before it is scored: every fault at once, in seconds; exit code 1 where there is an error.
    Lint(lint::LintArgs),
    /// Scores submissions on a dataset.
    Score(ScoreArgs),
    /// Albedo or light of truth and submissions side by side, and where they err: two PNG a scene and picture.
    Pictures(PicturesArgs),
    /// Sets results side by side, as the paper's Tables II to V, and ours in the same layout.
    Tables(TablesArgs),
    /// Tells where one scene's albedo errs and how: brightness, tint, shading left in, misplacement, lost detail.
    Explain(ExplainArgs),
    /// Makes every number of a result anew: exit code 0 where all are the same, 1 where one is not.
    Verify(VerifyArgs),
    /// Ranks results and writes a site of them that opens from the disk.
    Leaderboard(leaderboard::LeaderboardArgs),
}

/// What `eval image` is given.
#[derive(clap::Args)]
pub struct ImageArgs {
    /// PNG (8-bit sRGB) or EXR (linear).
    prediction: PathBuf,
    /// PNG (8-bit sRGB) or EXR (linear).
    reference: PathBuf,
    /// 8-bit grey PNG, 255 where pixels count.
    #[arg(long)]
    mask: Option<PathBuf>,
    /// Networks of LPIPS.
    #[arg(long = "net", value_enum, default_values = ["alex"])]
    nets: Vec<NetName>,
    /// How to print.
    #[arg(long, value_enum, default_value = "text")]
    format: ImageFormat,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum NetName {
    Alex,
    Vgg,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ImageFormat {
    Text,
    Json,
}

/// What `eval score` is given.
#[derive(clap::Args)]
pub struct ScoreArgs {
    /// Submissions: folders, .zip or .tar.gz.
    #[arg(required = true)]
    pub submissions: Vec<PathBuf>,
    /// The dataset's folder.
    #[arg(long)]
    pub dataset: PathBuf,
    /// The result file; with several submissions a folder, for one file each.
    #[arg(long)]
    pub out: PathBuf,
    /// Only this scene; may be given several times.
    #[arg(long = "scene")]
    pub scenes: Vec<SceneId>,
    /// The rules; may be given several times.
    #[arg(long = "protocol", default_values = ["mateval-1"])]
    pub protocols: Vec<String>,
    /// Scenes that are scored at once; more take more memory and leave threads less idle.
    #[arg(long, default_value_t = 1)]
    pub jobs: usize,
    /// Keep every scene's scores in this folder, by hashes of all they depend on, for later runs too. By default they are
    /// kept beside the result until it is whole, so that a killed run goes on.
    #[arg(long)]
    pub cache: Option<PathBuf>,
    /// Replace result files that are there.
    #[arg(long)]
    pub force: bool,
}

/// What `eval tables` is given.
#[derive(clap::Args)]
pub struct TablesArgs {
    /// RESULT.json files.
    #[arg(required = true)]
    results: Vec<PathBuf>,
    /// Under which rules.
    #[arg(long, default_value = "mateval-1")]
    protocol: String,
    /// How to write them.
    #[arg(long, value_enum, default_value = "markdown")]
    format: TableName,
    /// What has rows of its own: a scene, or a category, whose errors are pooled over all its pixels. By default the whole
    /// dataset.
    #[arg(long, value_enum)]
    by: Option<GroupName>,
}

/// What `eval explain` is given.
#[derive(clap::Args)]
pub struct ExplainArgs {
    /// The RESULT.json file.
    result: PathBuf,
    /// The scene.
    #[arg(long)]
    scene: SceneId,
    /// The dataset's folder that was scored on.
    #[arg(long)]
    dataset: PathBuf,
    /// The submission's folder that was scored.
    #[arg(long)]
    submission: PathBuf,
    /// Whose scores of the result.
    #[arg(long, default_value = "mateval-1")]
    protocol: String,
    /// A folder for `explain.md` and pictures of the ten worst instances.
    #[arg(long)]
    out: Option<PathBuf>,
    /// How to print.
    #[arg(long, value_enum, default_value = "text")]
    format: ImageFormat,
    /// Replace files that are there.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum GroupName {
    Scene,
    Category,
    SuperCategory,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TableName {
    Markdown,
    Latex,
    Csv,
}

/// Runs one of them.
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Image(args) => image(args),
        Command::Lint(args) => lint::run(args),
        Command::Pictures(args) => pictures::pictures(args),
        Command::Score(args) => score_submissions(args).map(|_| Outcome::Good),
        Command::Tables(args) => print_tables(args),
        Command::Explain(args) => print_explanation(args),
        Command::Verify(args) => verify::run(args),
        Command::Leaderboard(args) => leaderboard::run(args),
    }
}

fn image(args: &ImageArgs) -> anyhow::Result<Outcome> {
    let mut nets: Vec<Lpips> = Vec::new();
    let mut missing = Vec::new();
    for name in &args.nets {
        let net = if *name == NetName::Alex { Net::Alex } else { Net::Vgg };
        match weights::load(net) {
            mateval_eval::score::LpipsWeights::Loaded(lpips) => nets.push(*lpips),
            mateval_eval::score::LpipsWeights::Missing { reason, .. } => missing.push((net.key(), reason)),
        }
    }
    let values = mateval_eval::pair::compare(&args.prediction, &args.reference, args.mask.as_deref(), &nets)?;
    match args.format {
        ImageFormat::Json => print(&json::to_text(&serde_json::json!({
            "format": "mateval-image/1",
            "tool": TOOL,
            "values": values,
            "missing": missing
                .iter()
                .map(|(net, reason)| serde_json::json!({ "metric": net, "reason": reason, "mend": weights::MEND }))
                .collect::<Vec<_>>(),
        })))?,
        ImageFormat::Text => print(&image_text(&values, &missing))?,
    }
    Ok(Outcome::Good)
}

fn image_text(values: &mateval_eval::pair::PairValues, missing: &[(&str, String)]) -> String {
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
    lines.extend(missing.iter().map(|(net, _)| format!("{net:24} missing; run: {}", weights::MEND)));
    lines.join("\n") + "\n"
}

/// Scores, writes the result files and gives their paths.
pub fn score_submissions(args: &ScoreArgs) -> anyhow::Result<Vec<PathBuf>> {
    let protocols = args.protocols.iter().map(|name| Protocol::named(name)).collect::<Result<Vec<_>, _>>()?;
    let outs = result_paths(args)?;
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let cache = args.cache.clone().unwrap_or_else(|| beside(&args.out));
    std::fs::create_dir_all(&cache).with_context(|| format!("cannot make '{}'", cache.display()))?;
    let work = std::env::temp_dir();
    let opened = args.submissions.iter().map(|path| archive::open(path, &work)).collect::<Result<Vec<_>, _>>()?;
    let plan = ScorePlan {
        dataset: &dataset,
        submissions: opened.iter().map(Opened::root).collect(),
        protocols,
        scenes: args.scenes.clone(),
        lpips: weights::load(Net::Alex),
        tool: TOOL.to_owned(),
        jobs: args.jobs,
        cache: Some(&cache),
    };
    let bars = Bars::new();
    let results = score(&plan, &|step, done, all| bars.step(step, done, all)).context("cannot score")?;
    drop(bars);
    for (result, out) in results.iter().zip(&outs) {
        json::write(out, result)?;
        say_findings(&result.method, &result.findings);
        print(&format!("{}\n", out.display()))?;
    }
    if args.cache.is_none() {
        std::fs::remove_dir_all(&cache).with_context(|| format!("cannot remove '{}'", cache.display()))?;
    }
    Ok(outs)
}

/// The folder that scores are kept in until `out` is whole.
fn beside(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".scenes");
    PathBuf::from(name)
}

/// Where each submission's result goes: `--out`, or a file named after the submission's folder in it.
fn result_paths(args: &ScoreArgs) -> anyhow::Result<Vec<PathBuf>> {
    let outs: Vec<PathBuf> = match args.submissions.as_slice() {
        [_] => vec![args.out.clone()],
        several => {
            std::fs::create_dir_all(&args.out).with_context(|| format!("cannot make '{}'", args.out.display()))?;
            several.iter().map(|path| args.out.join(format!("{}.json", folder_name(path)))).collect()
        }
    };
    for (at, out) in outs.iter().enumerate() {
        // Scoring takes minutes: what can fail early must.
        if !out.parent().is_some_and(|folder| folder.as_os_str().is_empty() || folder.is_dir()) {
            bail!("the folder of '{}' is not there; make it, or choose another --out", out.display());
        }
        if out.is_dir() {
            bail!("'{}' is a folder; expected the name of a result file", out.display());
        }
        check_free(out, args.force, "--out")?;
        if outs[..at].contains(out) {
            bail!("two submissions would be written to '{}'; rename one of the folders", out.display());
        }
    }
    Ok(outs)
}

/// The name of a submission's folder or archive, without the archive's ending.
fn folder_name(path: &Path) -> String {
    let whole = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let name = whole.file_name().map_or_else(|| "submission".to_owned(), |name| name.to_string_lossy().into_owned());
    let stem = [".zip", ".tar.gz", ".tgz"].iter().find_map(|ending| name.strip_suffix(ending).map(str::to_owned));
    stem.unwrap_or(name)
}

fn print_tables(args: &TablesArgs) -> anyhow::Result<Outcome> {
    let results = args.results.iter().map(|path| json::read(path)).collect::<Result<Vec<ResultFile>, _>>()?;
    let format = match args.format {
        TableName::Markdown => TableFormat::Markdown,
        TableName::Latex => TableFormat::Latex,
        TableName::Csv => TableFormat::Csv,
    };
    let grouping = match args.by {
        None => Grouping::Dataset,
        Some(GroupName::Scene) => Grouping::Scene,
        Some(GroupName::Category) => Grouping::Category,
        Some(GroupName::SuperCategory) => Grouping::SuperCategory,
    };
    print(&tables(&results, &args.protocol, grouping, format)?)?;
    for result in results.iter().filter(|result| !result.missing.is_empty()) {
        for missing in &result.missing {
            say(&format!(
                "warning: '{}': {} is missing: {}; run: {}",
                result.method, missing.metric, missing.reason, missing.mend
            ));
        }
    }
    Ok(Outcome::Good)
}

fn print_explanation(args: &ExplainArgs) -> anyhow::Result<Outcome> {
    args.out.iter().try_for_each(|out| explain::check_out(out, args.force))?;
    let result: ResultFile = json::read(&args.result)?;
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let plan = ExplainPlan {
        result: &result,
        protocol: &args.protocol,
        dataset: &dataset,
        submission: &args.submission,
        scene: &args.scene,
        tool: TOOL.to_owned(),
    };
    let bars = Bars::new();
    let found = explain::explain(&plan, &|step, done, all| bars.step(step, done, all)).context("cannot explain")?;
    drop(bars);
    if let Some(out) = &args.out {
        for path in found.write(out, args.force)? {
            say(&format!("wrote '{}'", path.display()));
        }
    }
    print(&match args.format {
        ImageFormat::Json => json::to_text(&found.file),
        ImageFormat::Text => explain::text::plain(&found.file),
    })?;
    Ok(Outcome::Good)
}
