//! `mateval eval pictures`.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::builder::PossibleValue;
use mateval_eval::light_rules::Track;
use mateval_eval::result_key::PictureKind;
use mateval_report::strips::{self, Shown, StripPlan};
use mateval_scene::SceneId;
use mateval_scene::open::Dataset;

use crate::bars::Bars;
use crate::outcome::{Outcome, print};

/// What it is given.
#[derive(clap::Args)]
pub struct PicturesArgs {
    /// Submission folders, a column each behind the truth's.
    #[arg(required = true)]
    submissions: Vec<PathBuf>,
    /// The dataset's folder.
    #[arg(long)]
    dataset: PathBuf,
    /// The folder of the pictures.
    #[arg(long)]
    out: PathBuf,
    /// Only this scene; may be given several times.
    #[arg(long = "scene")]
    scenes: Vec<SceneId>,
    /// What they show; may be given several times.
    #[arg(long = "picture", value_enum, default_values_t = [StripPicture::Albedo])]
    pictures: Vec<StripPicture>,
    /// Samples a pixel of pictures of light, half of them in each of two halves.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=65536))]
    samples: u32,
    /// Replace pictures that are there.
    #[arg(long)]
    force: bool,
}

/// What they show.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum StripPicture {
    Albedo,
    RgbTrue,
    RgbFitted,
}

impl clap::ValueEnum for StripPicture {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Albedo, Self::RgbTrue, Self::RgbFitted]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (kind, help) = match self {
            Self::Albedo => (PictureKind::Albedo, "base_color"),
            Self::RgbTrue => (PictureKind::RgbTrue, "Under the scene's own lights"),
            Self::RgbFitted => (PictureKind::RgbFitted, "Under lights fitted to the input view"),
        };
        Some(PossibleValue::new(kind.word()).help(help))
    }
}

impl StripPicture {
    /// With so many samples a pixel, half of them in each of two halves.
    pub fn shown(self, samples: u32) -> Shown {
        let light = |track| Shown::Light { track, samples: samples / 2 };
        match self {
            Self::Albedo => Shown::Albedo,
            Self::RgbTrue => light(Track::True),
            Self::RgbFitted => light(Track::Fitted),
        }
    }
}

/// Writes the pictures and prints their paths.
pub fn pictures(args: &PicturesArgs) -> anyhow::Result<Outcome> {
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let submissions: Vec<&Path> = args.submissions.iter().map(PathBuf::as_path).collect();
    let bars = Bars::new();
    let progress = |step: &str, done: usize, all: usize| bars.step(step, done, all);
    let shown = args.pictures.iter().map(|picture| picture.shown(args.samples));
    let plan = StripPlan {
        dataset: &dataset,
        submissions: &submissions,
        scenes: &args.scenes,
        shown: &shown.collect::<Vec<_>>(),
        out: &args.out,
        force: args.force,
    };
    let written = strips::write(&plan, &progress)?;
    drop(bars);
    written.iter().try_for_each(|path| print(&format!("{}\n", path.display())))?;
    Ok(Outcome::Good)
}
