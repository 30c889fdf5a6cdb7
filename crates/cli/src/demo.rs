//! `mateval demo`: everything on the built-in sample.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};

use mateval_baselines::estimate::EstimateSource;
use mateval_baselines::nn::NnOptions;
use mateval_eval::tables::{Grouping, TableFormat, tables};
use mateval_scene::open::Dataset;

use crate::bars::Bars;
use crate::eval::leaderboard::LeaderboardArgs;
use crate::eval::pictures::StripPicture;
use crate::outcome::{Outcome, print, say};
use crate::{eval, prep};

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
    #[command(flatten)]
    blender: prep::blender::BlenderArgs,
    /// Replace what an earlier demo left there.
    #[arg(long)]
    force: bool,
}

/// Sample, dataset, renders, baselines, scores, leaderboard, table.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let out = args.out.as_path();
    if out.exists() && !args.force {
        bail!("'{}' is already there; choose another --out, or add --force to replace what a demo left", out.display());
    }
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
    say("4/6 baselines: gt, nn, median and grey");
    let opened = Dataset::open(&dataset)?;
    let submissions = make_baselines(&opened, out, args.force)?;
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

fn make_baselines(dataset: &Dataset, out: &Path, force: bool) -> anyhow::Result<Vec<PathBuf>> {
    let [gt, nn, median, grey] = ["gt", "nn", "median", "grey"].map(|name| out.join("submissions").join(name));
    let folder = out.join("submissions");
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make '{}'", folder.display()))?;
    mateval_baselines::truth::write(dataset, &gt, force)?;
    let bars = Bars::new();
    let progress = |step: &str, done: usize, all: usize| bars.step(step, done, all);
    let (source, options) = (EstimateSource::Truth, NnOptions::default());
    mateval_baselines::nn::write(dataset, &nn, force, &source, &options, &progress)?;
    drop(bars);
    mateval_baselines::homogeneous::write_by_instance(dataset, &median, force, &EstimateSource::Input)?;
    mateval_baselines::grey::write(dataset, &grey, force)?;
    Ok(vec![gt, nn, median, grey])
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
