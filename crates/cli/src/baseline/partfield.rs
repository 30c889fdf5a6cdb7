//! `mateval baseline partfield-export` and `partfield-import`: the bridge to PartField.

use std::path::PathBuf;

use mateval_baselines::partfield;

use super::places::ExportPlaces;
use crate::outcome::{Outcome, counted, print};

/// Arguments of `partfield-import`.
#[derive(clap::Args)]
pub struct PartfieldImportArgs {
    /// PartField's folder `cluster_out`, with files `<id>_0_<parts>.npy`.
    clusters: PathBuf,
    /// Number of parts that an instance is split into.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u8).range(1..=64))]
    parts: u8,
    #[command(flatten)]
    places: ExportPlaces,
}

/// Writes the meshes.
pub fn export(places: &ExportPlaces) -> anyhow::Result<Outcome> {
    let count = partfield::export(&places.open()?, &places.out)?;
    print(&format!("{}: {count} mesh{}\n", places.out.display(), if count == 1 { "" } else { "es" }))?;
    Ok(Outcome::Good)
}

/// Copies the labels to where a recipe expects them.
pub fn import(args: &PartfieldImportArgs) -> anyhow::Result<Outcome> {
    let count = partfield::import(&args.places.open()?, &args.clusters, args.parts, &args.places.out)?;
    print(&format!("{}: labels of {}\n", args.places.out.display(), counted(count, "instance")))?;
    Ok(Outcome::Good)
}
