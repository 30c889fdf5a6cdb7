//! `mateval baseline relight`: a de-lit room under its fitted lights, each of which may be dimmed.

use std::path::PathBuf;
use std::str::FromStr;

use anyhow::{Context as _, bail};
use mateval_baselines::delight::relight::{self, Dimmed, RelightOptions};

use super::places::ExportPlaces;
use crate::bars::with_progress;
use crate::outcome::{Outcome, counted, print};

/// Arguments of `relight`.
#[derive(clap::Args)]
pub struct RelightArgs {
    /// The output of `mateval baseline delight`.
    pictures: PathBuf,
    #[command(flatten)]
    places: ExportPlaces,
    /// Multiply the radiance of a light of `lights.json`, such as lamp=0 or world=2; may be repeated. Other lights stay
    /// as they were fitted.
    #[arg(long = "light", value_name = "NAME=FACTOR")]
    lights: Vec<LightFactor>,
    /// Paths per pixel.
    #[arg(long, default_value_t = RelightOptions::default().samples, value_parser = clap::value_parser!(u32).range(2..=65_536))]
    samples: u32,
}

/// A light and the factor of its radiance.
#[derive(Clone)]
struct LightFactor(Dimmed);

impl FromStr for LightFactor {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let (name, factor) = text.rsplit_once('=').context("expected NAME=FACTOR")?;
        let factor: f64 = factor.parse().with_context(|| format!("'{factor}' is not a number"))?;
        if !(0.0..=1e6).contains(&factor) {
            bail!("factor {factor}: expected 0 to 1e6");
        }
        Ok(Self(Dimmed { name: name.to_owned(), factor }))
    }
}

/// Writes the pictures and the page.
pub fn run(args: &RelightArgs) -> anyhow::Result<Outcome> {
    let dataset = args.places.open()?;
    let dimmed = args.lights.iter().map(|LightFactor(dimmed)| dimmed.clone()).collect();
    let options = RelightOptions { dimmed, samples: args.samples };
    let out = &args.places.out;
    let count = with_progress(|progress| relight::write(&dataset, &args.pictures, out, &options, progress))?;
    let scenes = counted(count, "scene");
    print(&format!("'{}': {scenes}; open '{}'\n", out.display(), out.join("index.html").display()))?;
    Ok(Outcome::Good)
}
