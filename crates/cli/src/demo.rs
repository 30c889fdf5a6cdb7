//! `mateval demo`: every step from the built-in sample to a leaderboard.
//!
//! The steps are other commands, given as words, so that their defaults are those of the command line.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};

use mateval_eval::result::ResultFile;
use mateval_prep::render::RendererKind;
use mateval_report::tables::{Grouping, TableFormat, headline, tables};
use mateval_scene::open::Dataset;
use mateval_scene::work_folder;

use crate::baseline;
use crate::eval::leaderboard::{self, LeaderboardArgs};
use crate::eval::score::{self, ScoreArgs};
use crate::outcome::{Outcome, print, say};
use crate::parsing::{parse_args, parse_subcommand, path_option};
use crate::prep::build::{self, BuildArgs};
use crate::prep::render::{self, RenderArgs, RendererArgs};

/// The protocol whose numbers are printed.
const PROTOCOL: &str = "mateval-2";

/// A baseline of the demo.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
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

    /// Whether it starts from the de-lit photos.
    fn needs_delit(self) -> bool {
        matches!(self, Self::Procedural | Self::ProceduralKeepSeen)
    }

    /// The subcommand of `baseline` with its options, other than its places.
    fn words(self, delit: &Path) -> Vec<OsString> {
        let subcommand = if self.needs_delit() { "procedural" } else { self.name() };
        let mut words = vec![OsString::from(subcommand)];
        if self.needs_delit() {
            words.extend([path_option("estimate", delit), "--adapter=delight".into()]);
        }
        words.extend((self == Self::ProceduralKeepSeen).then(|| OsString::from("--keep-seen")));
        words
    }
}

/// Arguments of `demo`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder for everything that the demo makes.
    #[arg(long, default_value = "mateval-demo")]
    out: PathBuf,
    /// Samples per pixel of each half of a rendered picture [default: 24; with --full 64].
    #[arg(long)]
    samples: Option<u32>,
    #[command(flatten)]
    by: RendererArgs,
    /// Baselines to make and score [default: gt, nn, grey; with --full all].
    #[arg(long, value_enum, value_delimiter = ',')]
    baselines: Vec<DemoBaseline>,
    /// Views of 320x240 pixels in place of 160x120, three more baselines, and every table.
    #[arg(long)]
    full: bool,
    /// Replace what an earlier demo wrote.
    #[arg(long)]
    force: bool,
}

/// Samples per pixel of the leaderboard's lit pictures: two for their two halves at least, and few at most, since noise is
/// filtered for display.
const LEAST_SHOWN_SAMPLES: u32 = 2;
const MOST_SHOWN_SAMPLES: u32 = 16;

/// Width and height of a view, unless everything is asked for: large enough to look at, and rendered in seconds.
const SMALL: [u32; 2] = [160, 120];

impl Args {
    fn samples(&self) -> u32 {
        self.samples.unwrap_or(if self.full { 64 } else { 24 })
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

/// The arguments of all steps.
struct Plan {
    build: BuildArgs,
    render: RenderArgs,
    baselines: Vec<baseline::Command>,
    score: ScoreArgs,
    leaderboard: LeaderboardArgs,
    board: Board,
}

/// The results of a demo: those of methods, and that of the truth.
struct Board {
    results: Vec<PathBuf>,
    ceiling: Option<PathBuf>,
}

/// Runs the steps one after the other and prints the results in tables.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let out = args.out.as_path();
    if out.exists() && !args.force {
        bail!("'{}' already exists; choose another --out, or add --force to replace what a demo left", out.display());
    }
    args.by.clone().or(RendererKind::Blender).checked()?;
    let plan = plan(args)?;
    say(
        "1/6 sample: the source scenes, a house and a room that the program generates; the house has faults that are planted \
         on purpose, which later steps report as notes",
    );
    let source = out.join("source");
    let written = if args.full { mateval_sample::write(&source) } else { mateval_sample::write_at(&source, SMALL) };
    written.context("cannot write the sample")?;
    say("2/6 prep build: geometry, atlases and the pictures of five views");
    build::run(&plan.build)?;
    say("3/6 prep render: RGB truth");
    render::run(&plan.render)?;
    say("4/6 baselines");
    let submissions = out.join("submissions");
    std::fs::create_dir_all(&submissions).with_context(|| format!("cannot create '{}'", submissions.display()))?;
    // De-lit photos are never replaced by their own command; these are the demo's.
    work_folder::remove(&out.join("delit"))?;
    for baseline in &plan.baselines {
        baseline::run(baseline)?;
    }
    say("5/6 eval score");
    score::run(&plan.score)?;
    say("6/6 eval leaderboard");
    leaderboard::run(&plan.leaderboard)?;
    print_closing(out, &plan.board, args.full)?;
    Ok(Outcome::Good)
}

fn plan(args: &Args) -> anyhow::Result<Plan> {
    let [source, dataset, results] = ["source", "dataset", "results"].map(|name| args.out.join(name));
    let submission = |baseline: &DemoBaseline| args.out.join("submissions").join(baseline.name());
    let baselines = args.baselines();
    let submissions: Vec<PathBuf> = baselines.iter().map(submission).collect();
    // The demo's own folder is checked once; a file of an earlier demo is replaced.
    let words = |options: Vec<OsString>, paths: &[PathBuf]| -> Vec<OsString> {
        let force = args.force.then(|| OsString::from("--force"));
        let separator = OsString::from("--");
        let paths = paths.iter().map(|path| path.as_os_str().to_owned());
        options.into_iter().chain(force).chain([separator]).chain(paths).collect()
    };
    let delit = args.out.join("delit");
    let baseline = |baseline: &DemoBaseline| {
        let places = vec![path_option("dataset", &dataset), path_option("out", &submission(baseline))];
        parse_subcommand(&[baseline.words(&delit), words(places, &[])].concat())
    };
    let delight = baselines
        .iter()
        .any(|baseline| baseline.needs_delit())
        .then(|| parse_subcommand(&["delight".into(), path_option("dataset", &dataset), path_option("out", &delit)]));
    let score_words = words(vec![path_option("dataset", &dataset), path_option("out", &results)], &submissions);
    let score: ScoreArgs = parse_args(&score_words)?;
    let board = board(&baselines, score.result_paths());
    let mut shown = vec![path_option("dataset", &dataset), path_option("out", &args.out.join("leaderboard"))];
    let samples = args.samples().clamp(LEAST_SHOWN_SAMPLES, MOST_SHOWN_SAMPLES);
    shown.push(format!("--samples={samples}").into());
    shown.extend(board.ceiling.iter().map(|ceiling| path_option("ceiling", ceiling)));
    let ranked = baselines.iter().filter(|baseline| board.ceiling.is_none() || **baseline != DemoBaseline::Gt);
    shown.extend(ranked.map(|baseline| path_option("submission", &submission(baseline))));
    let render_words = words(vec![format!("--samples={}", args.samples()).into()], std::slice::from_ref(&dataset));
    let mut render: RenderArgs = parse_args(&render_words)?;
    render.by = args.by.clone().or(RendererKind::Blender);
    Ok(Plan {
        build: parse_args(&words(vec![path_option("out", &dataset)], &[source.join("recipe.toml")]))?,
        render,
        baselines: delight.into_iter().chain(baselines.iter().map(baseline)).collect::<anyhow::Result<_>>()?,
        leaderboard: parse_args(&words(shown, &board.results))?,
        score,
        board,
    })
}

/// The truth is the ceiling, unless there is nothing below it.
fn board(baselines: &[DemoBaseline], mut results: Vec<PathBuf>) -> Board {
    let truth = baselines.iter().position(|baseline| *baseline == DemoBaseline::Gt);
    let ceiling = truth.filter(|_| results.len() > 1).map(|at| results.remove(at));
    Board { results, ceiling }
}

/// Prints one table and where the site is; in full all tables, and where to find everything that was made.
fn print_closing(out: &Path, board: &Board, full: bool) -> anyhow::Result<()> {
    let ceiling = board.ceiling.as_deref().map(ResultFile::read).transpose()?;
    let results = board.results.iter().map(|path| ResultFile::read(path)).collect::<Result<Vec<_>, _>>()?;
    print("\n")?;
    let site = format!("leaderboard:    {}\n", out.join("leaderboard/index.html").display());
    if !full {
        print(&headline(&results, ceiling.as_ref(), PROTOCOL)?)?;
        return print(&site);
    }
    print(&tables(&results, ceiling.as_ref(), PROTOCOL, Grouping::Dataset, TableFormat::Markdown)?)?;
    let dataset = Dataset::open(&out.join("dataset"))?;
    for id in &dataset.file.scenes {
        let scene = dataset.folder(id);
        print(&format!("input picture:  {}\n", scene.path().join("views/input/rgb.png").display()))?;
        print(&format!("all pictures:   {}\n", scene.path().join("views").display()))?;
        print(&format!("truth:          {}\n", scene.truth().display()))?;
    }
    print(&format!("results:        {}\n", out.join("results").display()))?;
    print(&site)
}
