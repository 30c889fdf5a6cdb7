//! `mateval demo`: every step from the built-in sample to a leaderboard; and `mateval sample`, which writes that
//! sample.
//!
//! Every step of the demo keeps the finished files in the demo's folder. So a demo that failed or was killed resumes
//! when it is run again with the same options, and a finished one shows its table again.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, bail};
use mateval_baselines::adapter::Adapter;
use mateval_baselines::bounds;
use mateval_baselines::delight::{self, DelightOptions};
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::median::{self, MedianOf};
use mateval_baselines::nn::{self, NnOptions};
use mateval_baselines::procedural::{self, ProceduralOptions};
use mateval_dataset::json;
use mateval_dataset::open::{Dataset, check_outside_datasets};
use mateval_dataset::progress::wrapped;
use mateval_eval::light::reference::{ReferenceOptions, make_references};
use mateval_eval::protocol::{Protocol, SCORER_VERSION};
use mateval_eval::result::ResultFile;
use mateval_eval::scene::SeenLight;
use mateval_eval::score::{LpipsWeights, ScorePlan, score};
use mateval_files::work_folder;
use mateval_metrics::Net;
use mateval_prep::build::finish::finish_again;
use mateval_prep::build::{BuildOptions, build};
use mateval_prep::render::{RenderOptions, Renderer, RendererKind, render};
use mateval_report::leaderboard::entries::ResultsFolder;
use mateval_report::leaderboard::marks::TrustedKeys;
use mateval_report::leaderboard::{self, LeaderboardPlan, Submissions, entries, keep_seen};
use mateval_report::strips::Shown;
use mateval_report::tables::{Grouping, TableFormat, headline, tables};
use mateval_submission::files::SubmissionJson;
use serde::{Deserialize, Serialize};

use crate::TOOL;
use crate::fetch::{cache_folder, load_weights};
use crate::prep::make::{BlenderArgs, checked_renderer, renderer_parser, samples_parser};
use crate::terminal::{Outcome, columns, counted, error_text, print, say, say_warnings, with_progress};

/// A baseline of the demo.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum DemoBaseline {
    /// The ground truth, baked to the atlases.
    Gt,
    /// The ground truth of the input view, lifted by nearest neighbours.
    Nn,
    /// One colour per instance: its median in the input picture.
    Median,
    /// A procedural graph per part, fitted to the de-lit photo.
    Procedural,
    /// The de-lit photo where it shows a surface, the part's graph elsewhere.
    ProceduralKeepSeen,
    /// Base colour 0.5 everywhere.
    Grey,
}

impl DemoBaseline {
    /// The name of its folder.
    fn name(self) -> &'static str {
        match self {
            Self::Gt => "gt",
            Self::Nn => "nn",
            Self::Median => "median",
            Self::Procedural => "procedural",
            Self::ProceduralKeepSeen => "procedural-keep-seen",
            Self::Grey => "grey",
        }
    }
}

#[derive(clap::Args)]
pub struct DemoArgs {
    /// Folder for everything that the demo makes. A demo that was interrupted there resumes.
    #[arg(long, default_value = "mateval-demo")]
    out: PathBuf,
    /// Samples per pixel of each half of a rendered picture [default: 8; with --full 64].
    #[arg(long, value_parser = samples_parser())]
    samples: Option<u32>,
    /// The renderer [default: blender, or builtin where Blender is not installed].
    #[arg(long, value_parser = renderer_parser())]
    renderer: Option<RendererKind>,
    #[command(flatten)]
    blender: BlenderArgs,
    /// Baselines to make and score [default: gt, nn, grey; with --full all].
    #[arg(long, value_enum, value_delimiter = ',')]
    baselines: Vec<DemoBaseline>,
    /// Views of 320x240 pixels in place of 160x120, three more baselines, and every table.
    #[arg(long)]
    full: bool,
    /// Start anew: remove what an earlier demo wrote.
    #[arg(long)]
    force: bool,
}

/// Steps from the sample to the leaderboard.
const STEPS: u8 = 6;
/// Samples per pixel of each half of the scorer's reference: fewer than a release has, as befits its small views. A demo
/// with few samples has at most four times as many here.
const REFERENCE_SAMPLES: u32 = 32;
/// Width and height of a view: large enough to look at, and rendered in seconds.
const SMALL: [u32; 2] = [160, 120];
const LARGE: [u32; 2] = [320, 240];

/// The options on which the content of a demo's folder depends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Options {
    tool: String,
    scorer_version: u32,
    renderer: RendererKind,
    samples: u32,
    /// Samples per pixel of each half of the scorer's reference.
    reference_samples: u32,
    resolution: [u32; 2],
    baselines: Vec<DemoBaseline>,
    /// Whether the weights of LPIPS were found.
    lpips: bool,
}

/// The folders and files in a demo's folder.
struct DemoFolder {
    out: PathBuf,
    options: PathBuf,
    source: PathBuf,
    dataset: PathBuf,
    submissions: PathBuf,
    delit: PathBuf,
    results: PathBuf,
    pictures: PathBuf,
    leaderboard: PathBuf,
}

impl DemoFolder {
    fn of(out: &Path) -> Self {
        let place = |name| out.join(name);
        Self {
            out: out.to_owned(),
            options: place("demo.json"),
            source: place("source"),
            dataset: place("dataset"),
            submissions: place("submissions"),
            delit: place("delit"),
            results: place("results"),
            pictures: place("pictures"),
            leaderboard: place("leaderboard"),
        }
    }

    fn submission(&self, baseline: DemoBaseline) -> PathBuf {
        self.submissions.join(baseline.name())
    }

    fn result(&self, baseline: DemoBaseline) -> PathBuf {
        self.results.join(format!("{}.json", baseline.name()))
    }
}

impl DemoArgs {
    /// Runs the steps one after the other and prints the results.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let demo = DemoFolder::of(&self.out);
        let lpips = load_weights(Net::Alex);
        let earlier = earlier_options(&demo)?;
        let (kind, renderer) = choose_renderer(self, earlier.as_ref())?;
        let samples = self.samples.unwrap_or(if self.full { 64 } else { 8 });
        let options = Options {
            tool: TOOL.to_owned(),
            scorer_version: SCORER_VERSION,
            renderer: kind,
            samples,
            reference_samples: REFERENCE_SAMPLES.min(4 * samples),
            resolution: if self.full { LARGE } else { SMALL },
            baselines: self.baselines(),
            lpips: matches!(lpips, LpipsWeights::Loaded(_)),
        };
        begin(&demo, earlier.as_ref(), &options, self.force)?;
        json::write(&demo.options, &options).context("cannot begin the demo")?;

        step(1, "sample", || {
            mateval_sample::write_at(&demo.source, options.resolution).context("cannot write the sample")?;
            Ok("2 source scenes, a house and a room, and their recipe".to_owned())
        })?;
        step(2, "prep build", || build_dataset(&demo))?;
        step(3, "prep render", || render_dataset(&demo, &options, renderer))?;
        let dataset = Dataset::open(&demo.dataset).context("cannot open the dataset")?;
        step(4, "baseline", || make_submissions(&demo, &options, &dataset))?;
        step(5, "eval score", || score_submissions(&demo, &options, &dataset, lpips))?;
        step(6, "leaderboard", || write_leaderboard(&demo, &options, &dataset))?;
        close(&demo, &options, &dataset, self.full)?;
        Ok(Outcome::Good)
    }

    fn baselines(&self) -> Vec<DemoBaseline> {
        use DemoBaseline::{Grey, Gt, Median, Nn, Procedural, ProceduralKeepSeen};
        match (self.baselines.is_empty(), self.full) {
            (false, _) => self.baselines.clone(),
            (true, false) => vec![Gt, Nn, Grey],
            (true, true) => vec![Gt, Nn, Median, Procedural, ProceduralKeepSeen, Grey],
        }
    }
}

/// The options of an earlier demo in the folder. Fails where the folder holds anything else.
fn earlier_options(demo: &DemoFolder) -> anyhow::Result<Option<Options>> {
    let is_empty = |folder: &Path| std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    if !demo.out.exists() || is_empty(&demo.out) {
        return Ok(None);
    }
    match json::read(&demo.options) {
        Ok(options) => Ok(Some(options)),
        Err(reason) => bail!(
            "'{}' exists and does not hold a demo of this version ({reason}); choose another --out",
            demo.out.display()
        ),
    }
}

/// The named renderer, else that of an earlier demo in this folder, else Blender if it can be used, else the built-in
/// one. A Blender that the user names must be usable.
fn choose_renderer(args: &DemoArgs, earlier: Option<&Options>) -> anyhow::Result<(RendererKind, Renderer)> {
    let earlier = earlier.filter(|_| !args.force);
    if let Some(kind) = args.renderer.or_else(|| earlier.map(|options| options.renderer)) {
        return Ok((kind, checked_renderer(kind, &args.blender)?));
    }
    match checked_renderer(RendererKind::Blender, &args.blender) {
        Ok(renderer) => Ok((RendererKind::Blender, renderer)),
        Err(reason) if args.blender.is_given() => Err(reason),
        Err(reason) => {
            say(&format!(
                "{}\nThe demo uses the built-in renderer instead; scores of light are then other numbers.\n",
                error_text(&reason)
            ));
            Ok((RendererKind::Builtin, Renderer::Builtin))
        }
    }
}

/// Makes the folder, or checks that it holds a demo of these options; with `force`, removes an earlier demo. What
/// depends on the weights of LPIPS is removed where they were missing and are found now.
fn begin(demo: &DemoFolder, earlier: Option<&Options>, options: &Options, force: bool) -> anyhow::Result<()> {
    let out = demo.out.display();
    let Some(earlier) = earlier else {
        return std::fs::create_dir_all(&demo.out).with_context(|| format!("cannot create '{out}'"));
    };
    let DemoFolder { source, dataset, submissions, delit, results, pictures, leaderboard, .. } = demo;
    let remove = |folders: &[&PathBuf]| folders.iter().try_for_each(|folder| work_folder::remove(folder));
    if force {
        remove(&[source, dataset, submissions, delit, results, pictures, leaderboard])?;
    } else if options.lpips && *earlier == (Options { lpips: false, ..options.clone() }) {
        remove(&[results, pictures, leaderboard])?;
    } else if earlier != options {
        bail!(
            "'{out}' holds a demo that was run with other options or another version ({}); run it again with those, add \
             --force to replace it, or choose another --out",
            earlier.in_words()
        );
    } else if !pictures.exists() {
        // The score makes them, and takes no results that are there.
        remove(&[results, leaderboard])?;
    }
    Ok(())
}

impl Options {
    fn in_words(&self) -> String {
        let names: Vec<&str> = self.baselines.iter().map(|baseline| baseline.name()).collect();
        let [width, height] = self.resolution;
        let lpips = if self.lpips { "with" } else { "without" };
        format!(
            "{}, {}, {} samples, {width}x{height} pixels, {}, {lpips} LPIPS",
            self.tool,
            self.renderer.word(),
            self.samples,
            names.join(","),
        )
    }
}

/// Runs a step and prints a line about what it made and the time that it took.
fn step(number: u8, name: &str, work: impl FnOnce() -> anyhow::Result<String>) -> anyhow::Result<()> {
    let start = Instant::now();
    let made = work()?;
    say(&format!("{number}/{STEPS} {name:<12} {made:<52} {:>6.1} s", start.elapsed().as_secs_f64()));
    Ok(())
}

fn build_dataset(demo: &DemoFolder) -> anyhow::Result<String> {
    let options = BuildOptions {
        recipe: demo.source.join("recipe.toml"),
        source: None,
        out: demo.dataset.clone(),
        scenes: Vec::new(),
        force: false,
        blender: None,
        atlas_cache: Some(cache_folder().join("atlases")),
    };
    let report = with_progress(|progress| build(&options, TOOL, progress)).context("cannot build the dataset")?;
    for (scene, findings) in &report.findings {
        say_warnings(scene.as_str(), findings);
    }
    let dataset = Dataset::open(&demo.dataset).context("cannot open the dataset")?;
    let instances: usize = dataset.scenes.iter().map(|scene| scene.instances.len()).sum();
    let views: usize = dataset.scenes.iter().map(|scene| scene.views.len()).sum();
    let scenes = counted(dataset.scenes.len(), "scene");
    Ok(format!("{scenes}, {}, {}", counted(instances, "object"), counted(views, "view")))
}

fn render_dataset(demo: &DemoFolder, options: &Options, renderer: Renderer) -> anyhow::Result<String> {
    let render_options = RenderOptions { renderer, samples: Some(options.samples), scenes: Vec::new(), force: false };
    let report = with_progress(|progress| render(&demo.dataset, &render_options, progress))
        .context("cannot render the dataset")?;
    report.remarks.iter().for_each(|line| say(line));
    if !report.failures.is_empty() {
        report.failures.iter().for_each(|failure| say(&failure.to_string()));
        let failed = counted(report.failures.len(), "scene");
        bail!("{failed} could not be rendered; run the demo again to go on from here");
    }
    let reference_options = ReferenceOptions { samples: options.reference_samples, scenes: Vec::new(), force: false };
    let references = with_progress(|progress| make_references(&demo.dataset, &reference_options, progress))
        .context("cannot render the scorer's references")?;
    if references.rendered > 0 {
        with_progress(|progress| finish_again(&demo.dataset, progress)).context("cannot finish the dataset")?;
    }
    let (by, samples) = (options.renderer.word(), options.samples);
    let kept = if report.kept > 0 { format!(", {} kept", report.kept) } else { String::new() };
    let rendered = counted(report.rendered, "picture");
    Ok(format!("{rendered} by {by}{kept}, 2 x {}", counted(samples as usize, "sample")))
}

/// Makes the submissions that do not exist yet. They appear whole or not at all.
fn make_submissions(demo: &DemoFolder, options: &Options, dataset: &Dataset) -> anyhow::Result<String> {
    std::fs::create_dir_all(&demo.submissions)
        .with_context(|| format!("cannot create '{}'", demo.submissions.display()))?;
    for &baseline in &options.baselines {
        let out = demo.submission(baseline);
        if out.exists() {
            continue;
        }
        match baseline {
            DemoBaseline::Gt => bounds::write_truth(dataset, &out, false)?,
            DemoBaseline::Grey => bounds::write_grey(dataset, &out, false)?,
            DemoBaseline::Nn => with_progress(|progress| {
                nn::write(dataset, &out, false, &EstimateSource::Truth, &NnOptions::default(), progress)
            })?,
            DemoBaseline::Median => with_progress(|progress| {
                median::write(dataset, &out, false, &EstimateSource::Input, MedianOf::Instances, progress)
            })?,
            DemoBaseline::Procedural | DemoBaseline::ProceduralKeepSeen => {
                if !demo.delit.exists() {
                    with_progress(|progress| {
                        delight::write(dataset, &demo.delit, &DelightOptions::default(), progress)
                    })?;
                }
                let adapter = Box::new(Adapter::find("delight")?);
                let source = EstimateSource::Files { folder: demo.delit.clone(), adapter };
                let keep_seen = baseline == DemoBaseline::ProceduralKeepSeen;
                let procedural = ProceduralOptions { keep_seen, ..ProceduralOptions::default() };
                with_progress(|progress| procedural::write(dataset, &out, false, &source, &procedural, progress))?
            }
        };
    }
    let names: Vec<&str> = options.baselines.iter().map(|baseline| baseline.name()).collect();
    Ok(format!("{}: {}", counted(names.len(), "submission"), names.join(", ")))
}

/// Scores the submissions that have no result yet.
fn score_submissions(
    demo: &DemoFolder,
    options: &Options,
    dataset: &Dataset,
    lpips: LpipsWeights,
) -> anyhow::Result<String> {
    std::fs::create_dir_all(&demo.results).with_context(|| format!("cannot create '{}'", demo.results.display()))?;
    let missing: Vec<DemoBaseline> =
        options.baselines.iter().copied().filter(|baseline| !demo.result(*baseline).exists()).collect();
    if !missing.is_empty() {
        let folders: Vec<PathBuf> = missing.iter().map(|baseline| demo.submission(*baseline)).collect();
        let methods = folders.iter().map(|path| SubmissionJson::read(path)).collect::<Result<Vec<_>, _>>()?;
        let (ranked, _) = results_and_ceiling(demo, options);
        let keep = |seen: &SeenLight| match ranked.contains(&missing[seen.submission]) {
            true => keep_seen(&demo.pictures, &methods[seen.submission].file.method, seen),
            false => Ok(()),
        };
        let submissions = folders.iter().map(PathBuf::as_path).collect();
        let plan = ScorePlan::new(dataset, submissions, vec![Protocol::named(Protocol::DEFAULT)?], lpips, TOOL);
        let plan = ScorePlan { seen: Some(&keep), ..plan };
        let results = with_progress(|progress| score(&plan, progress)).context("cannot score")?;
        for (result, baseline) in results.iter().zip(&missing) {
            json::write_lines(&demo.result(*baseline), result)?;
            say_warnings(&result.method, &result.findings);
        }
    }
    Ok(counted(options.baselines.len(), "result"))
}

/// The baselines that are ranked, and the result of the truth as their ceiling, if it is not the only baseline.
fn results_and_ceiling(demo: &DemoFolder, options: &Options) -> (Vec<DemoBaseline>, Option<PathBuf>) {
    let has_ceiling = options.baselines.len() > 1 && options.baselines.contains(&DemoBaseline::Gt);
    let ranked = options.baselines.iter().copied().filter(|baseline| !has_ceiling || *baseline != DemoBaseline::Gt);
    (ranked.collect(), has_ceiling.then(|| demo.result(DemoBaseline::Gt)))
}

fn write_leaderboard(demo: &DemoFolder, options: &Options, dataset: &Dataset) -> anyhow::Result<String> {
    let (ranked, ceiling) = results_and_ceiling(demo, options);
    let results = ranked.iter().map(|baseline| demo.result(*baseline)).collect();
    let entries =
        entries::read(&ResultsFolder { results, ceiling, ..ResultsFolder::default() }, &TrustedKeys::default())?;
    let plan = LeaderboardPlan {
        results: &entries.results,
        ceiling: entries.ceiling.as_ref(),
        verified: entries.verified.clone(),
        protocol: Protocol::DEFAULT,
        partial: false,
        errata: None,
        about: None,
        pictures: Some(&demo.pictures),
        submissions: Some(Submissions {
            dataset,
            folders: ranked.iter().map(|baseline| demo.submission(*baseline)).collect(),
            shown: vec![Shown::Albedo],
        }),
        votes: false,
        original: None,
        hub: None,
        tool: TOOL.to_owned(),
    };
    with_progress(|progress| leaderboard::write(&plan, &demo.leaderboard, true, progress))
        .context("cannot write the leaderboard")?;
    let scenes = counted(dataset.scenes.len(), "scene");
    Ok(format!("{}, pictures of {scenes}", counted(ranked.len(), "method")))
}

/// Prints the table, the address of the leaderboard and the next commands.
fn close(demo: &DemoFolder, options: &Options, dataset: &Dataset, full: bool) -> anyhow::Result<()> {
    let (ranked, ceiling) = results_and_ceiling(demo, options);
    let read = |path: PathBuf| ResultFile::read(&path);
    let results = ranked.iter().map(|baseline| read(demo.result(*baseline))).collect::<Result<Vec<_>, _>>()?;
    let ceiling = ceiling.map(read).transpose()?;
    let format = TableFormat::Text { bold: std::io::stdout().is_terminal(), columns: columns() };
    let shown = match full {
        true => tables(&results, ceiling.as_ref(), Protocol::DEFAULT, Grouping::Dataset, format)?,
        false => headline(&results, ceiling.as_ref(), Protocol::DEFAULT, format)?,
    };
    let page = std::path::absolute(demo.leaderboard.join("index.html"))?;
    print(&format!("\n{shown}\nThe leaderboard, with pictures:\n  {}\n", address(&page)))?;
    if full {
        let rooms = dataset.file.scenes.iter().map(|id| dataset.folder(id).path().join("views").display().to_string());
        print(&format!("The rooms' pictures: {}\n", rooms.collect::<Vec<_>>().join(", ")))?;
    }
    print(&next_commands(demo, options))
}

/// Three commands that add a method to the leaderboard.
fn next_commands(demo: &DemoFolder, options: &Options) -> String {
    let (ranked, ceiling) = results_and_ceiling(demo, options);
    let [dataset, submission, result, board] = [
        demo.dataset.clone(),
        demo.submissions.join("median-photo"),
        demo.results.join("median-photo.json"),
        demo.out.join("board"),
    ]
    .map(|path| quoted(&path));
    let [dataset, submission, result, board] = [&dataset, &submission, &result, &board].map(String::as_str);
    let others: Vec<String> = ranked.iter().map(|baseline| quoted(&demo.result(*baseline))).collect();
    let ceiling = ceiling.map(|ceiling| quoted(&ceiling));
    let mut rank = vec!["mateval", "eval", "leaderboard"];
    rank.extend(others.iter().map(String::as_str));
    rank.push(result);
    rank.extend(ceiling.iter().flat_map(|ceiling| ["--ceiling", ceiling]));
    rank.extend(["--out", board]);
    let commands = [
        vec!["mateval", "baseline", "median", "--dataset", dataset, "--out", submission],
        vec!["mateval", "eval", "score", submission, "--dataset", dataset, "--out", result],
        rank,
    ];
    let shown: String = commands.map(continued).concat();
    format!("\nNext, score one more method and put it on a board:\n\n{shown}")
}

/// The words of a command, indented, over as many lines of a terminal of 80 columns as they need.
fn continued(words: Vec<&str>) -> String {
    // The end of a line is a blank and a backslash.
    wrapped(words, "  ", "      ", 78).join(" \\\n") + "\n"
}

/// The address of a file for a browser. Terminals end an address at a blank.
fn address(path: &Path) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"/._-~+".contains(&byte);
    let shown = |byte: &u8| if is_plain(*byte) { char::from(*byte).to_string() } else { format!("%{byte:02X}") };
    format!("file://{}", path.as_os_str().as_encoded_bytes().iter().map(shown).collect::<String>())
}

/// A path as a word of a shell.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+".contains(c);
    match text.chars().all(is_plain) && !text.starts_with('-') {
        true => text,
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

#[derive(clap::Args)]
pub struct SampleArgs {
    /// Folder that the sample is written to.
    out: PathBuf,
    /// Write into a folder that already exists and replace files of the same name.
    #[arg(long)]
    force: bool,
    /// Write this many houses made of the built-in one instead, with a recipe of one scene a house: a rehearsal of a
    /// release at full size.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    houses: Option<u32>,
    /// With --houses: what the houses are drawn from.
    #[arg(long, requires = "houses", default_value_t = 0)]
    seed: u64,
}

impl SampleArgs {
    /// Writes the sample and prints the path of its recipe.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        if self.out.exists() && !self.force {
            bail!("'{}' already exists; choose another folder, or add --force to write into it", self.out.display());
        }
        check_outside_datasets(&self.out, "OUT")?;
        match self.houses {
            None => mateval_sample::write(&self.out),
            Some(count) => mateval_sample::write_houses(&self.out, count, self.seed),
        }
        .context("cannot write the sample")?;
        print(&format!("{}\n", self.out.join("recipe.toml").display()))?;
        Ok(Outcome::Good)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Results of a demo whose only change is that the weights were fetched are made again, and the rest is kept.
    #[test]
    fn weights_that_were_fetched_meanwhile_are_used() {
        let folder = tempfile::tempdir().unwrap();
        let demo = DemoFolder::of(folder.path());
        let options = |lpips, samples| Options {
            tool: TOOL.to_owned(),
            scorer_version: SCORER_VERSION,
            renderer: RendererKind::Builtin,
            samples,
            reference_samples: 4 * samples,
            resolution: SMALL,
            baselines: vec![DemoBaseline::Grey],
            lpips,
        };
        for place in [&demo.dataset, &demo.submissions, &demo.results, &demo.pictures, &demo.leaderboard] {
            std::fs::create_dir(place).unwrap();
        }
        begin(&demo, Some(&options(false, 1)), &options(true, 2), false).unwrap_err();
        begin(&demo, Some(&options(true, 1)), &options(false, 1), false).unwrap_err();
        assert!(demo.results.exists(), "a refusal removed something");
        begin(&demo, Some(&options(false, 1)), &options(true, 1), false).unwrap();
        assert!(!demo.results.exists() && !demo.pictures.exists() && !demo.leaderboard.exists());
        assert!(demo.dataset.exists() && demo.submissions.exists());
        // Results without the pictures of their score, as an earlier version left them.
        std::fs::create_dir(&demo.results).unwrap();
        begin(&demo, Some(&options(true, 1)), &options(true, 1), false).unwrap();
        assert!(!demo.results.exists());
    }

    #[test]
    fn addresses_hold_no_blank() {
        assert_eq!(address(Path::new("/my demo/ü.html")), "file:///my%20demo/%C3%BC.html");
    }
}
