//! `mateval baseline delight`: base colour from the photo and the geometry alone.

use clap::ValueEnum;
use mateval_baselines::delight::{self, CandidateLights, DelightOptions};

use super::places::ExportPlaces;
use crate::bars::with_progress;
use crate::outcome::{Outcome, counted, print};

/// Arguments of `delight`.
#[derive(clap::Args)]
pub struct DelightArgs {
    #[command(flatten)]
    places: ExportPlaces,
    /// Which lights may shine.
    #[arg(long, value_enum, default_value_t = Lights::Room)]
    lights: Lights,
}

/// Which lights may shine while a photo is de-lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Lights {
    /// Light fixtures, ceilings, what is seen to glow, the world around, and the lights of a stage.
    Room,
    /// The lights of a stage alone, as in PSDR-Room.
    Stage,
}

impl Lights {
    /// The same as an option of the baseline.
    pub fn candidates(self) -> CandidateLights {
        match self {
            Self::Room => CandidateLights::Room,
            Self::Stage => CandidateLights::Stage,
        }
    }
}

/// Writes the pictures.
pub fn run(args: &DelightArgs) -> anyhow::Result<Outcome> {
    let dataset = args.places.open()?;
    let options = DelightOptions { lights: args.lights.candidates(), ..DelightOptions::default() };
    let out = &args.places.out;
    let count = with_progress(|progress| delight::write(&dataset, out, &options, progress))?;
    let shown = out.display();
    let scenes = counted(count, "scene");
    print(&format!(
        "'{shown}': {scenes}; open '{shown}/index.html'; use them with --estimate '{shown}' --adapter delight\n"
    ))?;
    Ok(Outcome::Good)
}
