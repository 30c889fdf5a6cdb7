//! `mateval baseline procedural`: a graph for each part, fitted to an estimate.

use std::path::PathBuf;

use anyhow::bail;
use clap::ValueEnum;
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::procedural::{self, FitMode, ProceduralOptions, report_folder};
use mateval_scene::PartSetId;

use super::delight::Lights;
use super::estimate::EstimateArgs;
use super::places::Places;
use crate::bars::with_progress;
use crate::outcome::{Outcome, print};

/// Arguments of `procedural`.
#[derive(clap::Args)]
pub struct ProceduralArgs {
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
    /// Which lights may shine while the photo is de-lit; for --estimate delight [default: room].
    #[arg(long, value_enum)]
    lights: Option<Lights>,
    /// The part set, such as `partfield` [default: the parts of the source].
    #[arg(long)]
    part_set: Option<PartSetId>,
    /// How graphs are chosen.
    #[arg(long, value_enum, default_value_t = Mode::Best)]
    mode: Mode,
    /// Keep the estimate in texels that the input view shows, and let graphs fill only the others.
    #[arg(long)]
    keep_seen: bool,
    /// How much of a pattern's randomness is kept, 0 to 1: with 1 it looks most alike, with 0 it has the least error.
    #[arg(long, default_value_t = 1.0, value_name = "SHARE", allow_negative_numbers = true)]
    detail: f64,
    /// A folder of .mtlx files that are fitted beside the built-in graphs.
    #[arg(long, value_name = "FOLDER")]
    graphs: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Mode {
    /// Orientation and sizes in closed form; a graph is taken if held-out pixels speak for it.
    Best,
    /// In the way of PSDR-Room, for comparison: a grid of turns and scales, then gradient descent.
    Paper,
}

/// Writes the submission and its report.
pub fn run(args: &ProceduralArgs) -> anyhow::Result<Outcome> {
    let default = EstimateSource::Delight(Lights::Room.candidates());
    let source = match (args.estimate.source(default)?, args.lights) {
        (EstimateSource::Delight(_), Some(lights)) => EstimateSource::Delight(lights.candidates()),
        (source, None) => source,
        (_, Some(_)) => bail!("--lights is for --estimate delight alone; other estimates are not lit"),
    };
    let options = ProceduralOptions {
        part_set: args.part_set.clone(),
        mode: match args.mode {
            Mode::Best => FitMode::Best,
            Mode::Paper => FitMode::Paper,
        },
        keep_seen: args.keep_seen,
        detail: args.detail,
        graphs: args.graphs.clone(),
    };
    let (places, dataset) = (&args.places, args.places.open()?);
    let instances =
        with_progress(|progress| procedural::write(&dataset, &places.out, places.force, &source, &options, progress))?;
    print(&format!("report: {}\n", report_folder(&places.out).join("index.html").display()))?;
    places.done(instances)
}
