//! `mateval baseline`: makes a submission by a method that comes with the tool, or from another method's files.

mod delight;
mod encoding;
mod estimate;
mod import;
mod partfield;
mod places;
mod procedural;
mod relight;
mod texgen;

use std::num::NonZero;

use anyhow::bail;
use clap::Subcommand;
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::nn::{self, NnOptions};
use mateval_baselines::seen_cloud::FillRule;
use mateval_baselines::{grey, homogeneous, truth};
use mateval_scene::PartSetId;

use self::estimate::EstimateArgs;
use self::places::{ExportPlaces, Places};
use crate::bars::with_progress;
use crate::outcome::Outcome;

/// Subcommands of `baseline`, one per method.
#[derive(Subcommand)]
pub enum Command {
    /// Ceiling: the true materials, baked to the dataset's own atlases.
    Gt(Places),
    /// Floor: base colour 0.5 (linear) everywhere.
    Grey(Places),
    /// Lifts an estimate of the input view to the atlases and fills unseen texels from their nearest seen points.
    Nn(NnArgs),
    /// One colour per instance: the median of an estimate inside the instance's mask (IM2CAD).
    Median(MedianArgs),
    /// One colour per part: the median of an estimate inside the part's mask.
    MedianPart(MedianPartArgs),
    /// A procedural graph per part, fitted to an estimate: patterns continue where the input view shows nothing.
    Procedural(procedural::ProceduralArgs),
    /// Takes the light out of every photo: base colour from photo and geometry alone, as pictures that other baselines
    /// accept as an estimate.
    Delight(delight::DelightArgs),
    /// Lights the rooms of de-lit photos anew: a page with a slider for each of the strongest lights.
    Relight(relight::RelightArgs),
    /// Compares a method's pictures with the truth and reports which encoding their numbers fit; exit code 1 if it is
    /// not the adapter's.
    Encoding(encoding::EncodingArgs),
    /// Transfers a method's own textured meshes, or one material per part, to the dataset's atlases.
    Import(import::ImportArgs),
    /// Writes seen instances as TEXGen reads objects: mesh, partial atlas, masks, positions and picture of each.
    TexgenExport(texgen::TexgenExportArgs),
    /// Makes a submission of TEXGen's textures: seen texels from the estimate, all others from TEXGen.
    TexgenImport(texgen::TexgenImportArgs),
    /// Writes every instance as a mesh that PartField reads.
    PartfieldExport(ExportPlaces),
    /// Copies PartField's labels to where `part_labels` in a recipe expects them: one folder per scene.
    PartfieldImport(partfield::PartfieldImportArgs),
}

/// Arguments of `nn`.
#[derive(clap::Args)]
pub struct NnArgs {
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
    /// Number of nearest seen points that an unseen texel is computed from: 1 as in the paper, or 3 as in Point-UV
    /// (weighted by the inverse square of the distance).
    #[arg(long, default_value_t = NonZero::<u8>::MIN)]
    neighbours: NonZero<u8>,
    /// Distance that opposite normals count as, in metres (0 to 100), so that the back of a board does not take the
    /// colour of its front.
    #[arg(long, default_value_t = 0.0, value_name = "METRES", allow_negative_numbers = true)]
    normal_weight: f64,
    /// Search the seen points of all instances, not only those of the texel's own instance.
    #[arg(long)]
    any_instance: bool,
    /// Width and height of every atlas, in texels [default: the dataset's own size of each instance].
    #[arg(long, value_name = "TEXELS", value_parser = clap::value_parser!(u32).range(64..=4096))]
    atlas_size: Option<u32>,
}

/// Arguments of `median`.
#[derive(clap::Args)]
pub struct MedianArgs {
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
}

/// Arguments of `median-part`.
#[derive(clap::Args)]
pub struct MedianPartArgs {
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
    /// The part set, such as `partfield` [default: the parts of the source].
    #[arg(long)]
    part_set: Option<PartSetId>,
}

/// Makes the submission.
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Gt(places) => places.done(truth::write(&places.open()?, &places.out, places.force)?),
        Command::Grey(places) => places.done(grey::write(&places.open()?, &places.out, places.force)?),
        Command::Nn(args) => nearest_neighbours(args),
        Command::Median(args) => {
            let (places, source) = (&args.places, args.estimate.source(EstimateSource::Input)?);
            let dataset = places.open_for(&source)?;
            places.done(with_progress(|progress| {
                homogeneous::write_by_instance(&dataset, &places.out, places.force, &source, progress)
            })?)
        }
        Command::MedianPart(args) => {
            let (places, source) = (&args.places, args.estimate.source(EstimateSource::Input)?);
            let set = args.part_set.as_ref();
            let dataset = places.open_for(&source)?;
            places.done(with_progress(|progress| {
                homogeneous::write_by_part(&dataset, &places.out, places.force, &source, set, progress)
            })?)
        }
        Command::Procedural(args) => procedural::run(args),
        Command::Delight(args) => delight::run(args),
        Command::Relight(args) => relight::run(args),
        Command::Encoding(args) => encoding::run(args),
        Command::Import(args) => import::run(args),
        Command::TexgenExport(args) => texgen::export(args),
        Command::TexgenImport(args) => texgen::import(args),
        Command::PartfieldExport(places) => partfield::export(places),
        Command::PartfieldImport(args) => partfield::import(args),
    }
}

fn nearest_neighbours(args: &NnArgs) -> anyhow::Result<Outcome> {
    let (places, source) = (&args.places, args.estimate.source(EstimateSource::Truth)?);
    if !(0.0..=100.0).contains(&args.normal_weight) {
        bail!("--normal-weight {}: expected 0 to 100 m", args.normal_weight);
    }
    let rule = FillRule { neighbours: args.neighbours.into(), normal_weight_m: args.normal_weight };
    let options = NnOptions { rule, any_instance: args.any_instance, atlas_size: args.atlas_size };
    let dataset = places.open_for(&source)?;
    places.done(with_progress(|progress| nn::write(&dataset, &places.out, places.force, &source, &options, progress))?)
}
