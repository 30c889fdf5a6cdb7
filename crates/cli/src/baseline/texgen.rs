//! `mateval baseline texgen-export` and `texgen-import`: the bridge to TEXGen.

use std::path::PathBuf;

use anyhow::bail;
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::texgen;

use super::estimate::EstimateArgs;
use super::places::{ExportPlaces, Places};
use crate::bars::with_progress;
use crate::outcome::{Outcome, print};

/// Arguments of `texgen-export`.
#[derive(clap::Args)]
pub struct TexgenExportArgs {
    #[command(flatten)]
    places: ExportPlaces,
    #[command(flatten)]
    estimate: EstimateArgs,
}

/// Arguments of `texgen-import`.
#[derive(clap::Args)]
pub struct TexgenImportArgs {
    /// Folder of TEXGen's textures, one `<id>.png` per object.
    results: PathBuf,
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
}

/// Writes the objects.
pub fn export(args: &TexgenExportArgs) -> anyhow::Result<Outcome> {
    let source = args.estimate.source(EstimateSource::Truth)?;
    let dataset = args.places.open()?;
    let count = with_progress(|progress| texgen::export(&dataset, &args.places.out, &source, progress))?;
    print(&format!("{}: {count} objects\n", args.places.out.display()))?;
    Ok(Outcome::Good)
}

/// Makes a submission of TEXGen's textures.
pub fn import(args: &TexgenImportArgs) -> anyhow::Result<Outcome> {
    if !args.estimate.is_given() {
        bail!("texgen-import needs --estimate, the same as texgen-export had: seen texels are taken from it");
    }
    let (places, source) = (&args.places, args.estimate.source(EstimateSource::Truth)?);
    let dataset = places.open()?;
    let found = with_progress(|progress| {
        texgen::import(&dataset, &args.results, &places.out, places.force, &source, progress)
    })?;
    print(&format!("{}: {} textures found\n", args.results.display(), found.textured))?;
    places.done(found.instances)
}
