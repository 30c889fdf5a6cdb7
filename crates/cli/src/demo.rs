//! `mateval demo`: everything on the built-in sample.

use std::path::{Path, PathBuf};

use anyhow::Context as _;

use mateval_baselines::estimate::EstimateSource;
use mateval_baselines::nn::NnOptions;
use mateval_eval::tables::{Grouping, TableFormat, tables};
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::check_free;

use crate::bars::Bars;
use crate::eval::leaderboard::LeaderboardArgs;
use crate::eval::pictures::StripPicture;
use crate::outcome::{Outcome, print, say};
use crate::{eval, prep};

/// A baseline of the demo.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum DemoBaseline {
    /// The truth, baked to the atlases.
    Gt,
    /// The truth of the photo, lifted by nearest neighbours.
    Nn,
    /// One colour an instance, that of the photo.
    Median,
    /// 0.5 everywhere.
    Grey,
}

/// What it is given.
#[derive(clap::Args)]
pub struct Args {
    /// Folder for everything that it makes.
    #[arg(long, default_value = "mateval-demo")]
    out: PathBuf,
    /// Samples a pixel of each half of a rendered picture.
    #[arg(long, default_value_t = 16)]
    samples: u32,
    /// What renders the truth.
    #[arg(long, value_enum, default_value = "blender")]
    renderer: prep::RendererWord,
    /// Which baselines are made and scored.
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["gt", "nn", "median", "grey"])]
    baselines: Vec<DemoBaseline>,
    #[command(flatten)]
    blender: prep::blender::BlenderArgs,
    /// Replace what an earlier demo left there.
    #[arg(long)]
    force: bool,
}

/// Sample, dataset, renders, baselines, scores, leaderboard, table.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let out = args.out.as_path();
    check_free(out, args.force, "--out")?;
    let [source, dataset, results] = ["source", "dataset", "results"].map(|name| out.join(name));
    say("1/6 sample: a house and a room that the program makes itself");
    mateval_prep::sample::write(&source).context("cannot write the sample")?;
    say("2/6 prep build: geometry, atlases, pictures of five views");
    prep::build(&prep::BuildArgs {
        recipe: source.join("recipe.toml"),
        out: dataset.clone(),
        source: None,
        force: args.force,
    })?;
    say("3/6 prep render: RGB truth");
    prep::render(&prep::RenderArgs {
        dataset: dataset.clone(),
        renderer: args.renderer,
        blender: args.blender.clone(),
        samples: Some(args.samples),
        scenes: Vec::new(),
        force: args.force,
    })?;
    say("4/6 baselines");
    let opened = Dataset::open(&dataset)?;
    let submissions = make_baselines(&opened, &args.baselines, &out.join("submissions"), args.force)?;
    say("5/6 eval score");
    let files = eval::score_submissions(&eval::ScoreArgs {
        submissions: submissions.clone(),
        dataset: dataset.clone(),
        out: results,
        scenes: Vec::new(),
        protocols: vec!["mateval-1".to_owned()],
        jobs: 1,
        cache: None,
        force: args.force,
    })?;
    say("6/6 eval leaderboard");
    eval::leaderboard::run(&LeaderboardArgs {
        results: files.clone(),
        out: out.join("leaderboard"),
        protocol: "mateval-1".to_owned(),
        partial: false,
        dataset: Some(dataset),
        submissions,
        shown: vec![StripPicture::Albedo],
        samples: 64,
        pictures: None,
        errata: None,
        force: args.force,
    })?;
    print_closing(&opened, out, &files)?;
    Ok(Outcome::Good)
}

fn make_baselines(
    dataset: &Dataset,
    baselines: &[DemoBaseline],
    folder: &Path,
    force: bool,
) -> anyhow::Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make '{}'", folder.display()))?;
    baselines.iter().map(|&baseline| make_baseline(dataset, baseline, folder, force)).collect()
}

fn make_baseline(dataset: &Dataset, baseline: DemoBaseline, folder: &Path, force: bool) -> anyhow::Result<PathBuf> {
    match baseline {
        DemoBaseline::Gt => {
            let out = folder.join("gt");
            mateval_baselines::truth::write(dataset, &out, force)?;
            Ok(out)
        }
        DemoBaseline::Nn => {
            let out = folder.join("nn");
            let bars = Bars::new();
            let progress = |step: &str, done: usize, all: usize| bars.step(step, done, all);
            let (source, options) = (EstimateSource::Truth, NnOptions::default());
            mateval_baselines::nn::write(dataset, &out, force, &source, &options, &progress)?;
            Ok(out)
        }
        DemoBaseline::Median => {
            let out = folder.join("median");
            mateval_baselines::homogeneous::write_by_instance(dataset, &out, force, &EstimateSource::Input)?;
            Ok(out)
        }
        DemoBaseline::Grey => {
            let out = folder.join("grey");
            mateval_baselines::grey::write(dataset, &out, force)?;
            Ok(out)
        }
    }
}

fn print_closing(dataset: &Dataset, out: &Path, files: &[PathBuf]) -> anyhow::Result<()> {
    let results = files.iter().map(|path| mateval_scene::json::read(path)).collect::<Result<Vec<_>, _>>()?;
    print("\n")?;
    print(&tables(&results, "mateval-1", Grouping::Dataset, TableFormat::Markdown)?)?;
    for id in &dataset.file.scenes {
        let scene = dataset.folder(id);
        print(&format!("input picture:  {}\n", scene.path().join("views/input/rgb.png").display()))?;
        print(&format!("all pictures:   {}\n", scene.path().join("views").display()))?;
        print(&format!("truth:          {}\n", scene.truth().display()))?;
    }
    print(&format!("results:        {}\n", out.join("results").display()))?;
    print(&format!("leaderboard:    {}\n", out.join("leaderboard/index.html").display()))?;
    Ok(())
}
