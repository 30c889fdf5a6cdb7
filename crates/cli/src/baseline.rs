//! `mateval baseline`: makes a submission by a method that comes with the tool, or from another method's files.

mod encoding;
mod import;

use std::num::NonZero;
use std::path::PathBuf;

use anyhow::bail;
use clap::{ArgMatches, Args as _, FromArgMatches, Subcommand};
use mateval_baselines::delight::{self, CandidateLights, DelightOptions};
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::fill::FillRule;
use mateval_baselines::median::{self, MedianOf};
use mateval_baselines::nn::{self, NnOptions};
use mateval_baselines::procedural::{self, FitMode, ProceduralOptions, report_folder};
use mateval_baselines::submission::Baseline;
use mateval_baselines::{BASELINES, bridges};
use mateval_dataset::PartSetId;

use crate::arguments::{EstimateArgs, ExportPlaces, Places, open_for, open_with_twins, word_parser};
use crate::terminal::{Outcome, counted, print, with_progress};

/// Subcommands of `baseline`, one per method.
#[derive(clap::Subcommand)]
pub enum Command {
    #[command(flatten)]
    WithoutOptions(WithoutOptions),
    /// Lifts an estimate of the input view to the atlases and fills unseen texels from their nearest seen points.
    Nn(NnArgs),
    /// One colour per instance, or per part: the median of an estimate inside its mask (IM2CAD).
    Median(MedianArgs),
    /// A procedural graph per part, fitted to an estimate: patterns continue where the input view shows nothing.
    Procedural(ProceduralArgs),
    /// Takes the light out of every photo: base colour from photo and geometry alone, as pictures that other baselines
    /// accept as an estimate.
    Delight(DelightArgs),
    /// Compares a method's pictures with the truth and reports which encoding their numbers fit; exit code 1 if it is
    /// not the adapter's.
    Encoding(encoding::EncodingArgs),
    /// Transfers a method's own textured meshes, or one material per part, to the dataset's atlases.
    Import(import::ImportArgs),
    /// Writes seen instances as TEXGen reads objects: mesh, partial atlas, masks, positions and picture of each.
    TexgenExport(TexgenExportArgs),
    /// Makes a submission of TEXGen's textures: seen texels from the estimate, all others from TEXGen.
    TexgenImport(TexgenImportArgs),
    /// Writes every instance as a mesh that PartField reads.
    PartfieldExport(ExportPlaces),
    /// Copies PartField's labels to where `part_labels` in a recipe expects them: one folder per scene.
    PartfieldImport(PartfieldImportArgs),
}

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

#[derive(clap::Args)]
pub struct MedianArgs {
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
    /// One colour per part.
    #[arg(long)]
    parts: bool,
    /// The part set, such as `partfield` [default: the parts of the source].
    #[arg(long, requires = "parts")]
    part_set: Option<PartSetId>,
}

/// One of the [`BASELINES`], with its only arguments.
pub struct WithoutOptions {
    baseline: Baseline,
    places: Places,
}

impl Subcommand for WithoutOptions {
    fn augment_subcommands(command: clap::Command) -> clap::Command {
        command.subcommands(
            BASELINES.map(|baseline| Places::augment_args(clap::Command::new(baseline.name)).about(baseline.about)),
        )
    }

    fn augment_subcommands_for_update(command: clap::Command) -> clap::Command {
        Self::augment_subcommands(command)
    }

    fn has_subcommand(name: &str) -> bool {
        BASELINES.iter().any(|baseline| baseline.name == name)
    }
}

impl FromArgMatches for WithoutOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let named = |(name, matches)| Some((BASELINES.into_iter().find(|baseline| baseline.name == name)?, matches));
        let missing = || clap::Error::new(clap::error::ErrorKind::MissingSubcommand);
        let (baseline, matches) = matches.subcommand().and_then(named).ok_or_else(missing)?;
        Ok(Self { baseline, places: Places::from_arg_matches(matches)? })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::WithoutOptions(WithoutOptions { baseline, places }) => {
            places.done((baseline.write)(&open_with_twins(&places.dataset)?, &places.out, places.force)?)
        }
        Command::Nn(args) => nearest_neighbours(args),
        Command::Median(args) => {
            let (places, source) = (&args.places, args.estimate.source(EstimateSource::Input)?);
            let dataset = open_for(&places.dataset, &source)?;
            let of = if args.parts { MedianOf::Parts(args.part_set.as_ref()) } else { MedianOf::Instances };
            places.done(with_progress(|progress| {
                median::write(&dataset, &places.out, places.force, &source, of, progress)
            })?)
        }
        Command::Procedural(args) => args.run(),
        Command::Delight(args) => args.run(),
        Command::Encoding(args) => args.run(),
        Command::Import(args) => args.run(),
        Command::TexgenExport(args) => args.run(),
        Command::TexgenImport(args) => args.run(),
        Command::PartfieldExport(places) => partfield_export(places),
        Command::PartfieldImport(args) => args.run(),
    }
}

fn nearest_neighbours(args: &NnArgs) -> anyhow::Result<Outcome> {
    let (places, source) = (&args.places, args.estimate.source(EstimateSource::Truth)?);
    if !(0.0..=100.0).contains(&args.normal_weight) {
        bail!("--normal-weight {}: expected 0 to 100 m", args.normal_weight);
    }
    let rule = FillRule { neighbours: args.neighbours.into(), normal_weight_m: args.normal_weight };
    let options = NnOptions { rule, any_instance: args.any_instance, atlas_size: args.atlas_size };
    let dataset = open_for(&places.dataset, &source)?;
    places.done(with_progress(|progress| nn::write(&dataset, &places.out, places.force, &source, &options, progress))?)
}

#[derive(clap::Args)]
pub struct DelightArgs {
    #[command(flatten)]
    places: ExportPlaces,
    /// Which lights may shine.
    #[arg(long, value_parser = word_parser(CandidateLights::ALL, shown_lights), default_value = "room")]
    lights: CandidateLights,
}

fn shown_lights(lights: &CandidateLights) -> (&'static str, &'static str) {
    let help = match lights {
        CandidateLights::Room => {
            "Light fixtures, ceilings, what is seen to glow, the world around, and the lights of a stage"
        }
        CandidateLights::Stage => "The lights of a stage alone, as in PSDR-Room",
    };
    (lights.word(), help)
}

impl DelightArgs {
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let dataset = open_with_twins(&self.places.dataset)?;
        let options = DelightOptions { lights: self.lights, ..DelightOptions::default() };
        let out = &self.places.out;
        let count = with_progress(|progress| delight::write(&dataset, out, &options, progress))?;
        let shown = out.display();
        let scenes = counted(count, "scene");
        print(&format!(
            "'{shown}': {scenes}; open '{shown}/index.html'; use them with --estimate '{shown}' --adapter delight\n"
        ))?;
        Ok(Outcome::Good)
    }
}

#[derive(clap::Args)]
pub struct ProceduralArgs {
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
    /// Which lights may shine while the photo is de-lit; for --estimate delight [default: room].
    #[arg(long, value_parser = word_parser(CandidateLights::ALL, shown_lights))]
    lights: Option<CandidateLights>,
    /// The part set, such as `partfield` [default: the parts of the source].
    #[arg(long)]
    part_set: Option<PartSetId>,
    /// How graphs are chosen.
    #[arg(long, value_parser = word_parser(FitMode::ALL, shown_mode), default_value = "best")]
    mode: FitMode,
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

fn shown_mode(mode: &FitMode) -> (&'static str, &'static str) {
    let help = match mode {
        FitMode::Best => "Orientation and sizes in closed form; a graph is taken if held-out pixels speak for it",
        FitMode::Paper => "In the way of PSDR-Room, for comparison: a grid of turns and scales, then gradient descent",
    };
    (mode.word(), help)
}

impl ProceduralArgs {
    /// Writes the submission and its report.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let default = EstimateSource::Delight(CandidateLights::Room);
        let source = match (self.estimate.source(default)?, self.lights) {
            (EstimateSource::Delight(_), Some(lights)) => EstimateSource::Delight(lights),
            (source, None) => source,
            (_, Some(_)) => bail!("--lights is for --estimate delight alone; other estimates are not lit"),
        };
        let options = ProceduralOptions {
            part_set: self.part_set.clone(),
            mode: self.mode,
            keep_seen: self.keep_seen,
            detail: self.detail,
            graphs: self.graphs.clone(),
        };
        let (places, dataset) = (&self.places, open_for(&self.places.dataset, &source)?);
        let instances = with_progress(|progress| {
            procedural::write(&dataset, &places.out, places.force, &source, &options, progress)
        })?;
        print(&format!("report: {}\n", report_folder(&places.out).join("index.html").display()))?;
        places.done(instances)
    }
}

#[derive(clap::Args)]
pub struct TexgenExportArgs {
    #[command(flatten)]
    places: ExportPlaces,
    #[command(flatten)]
    estimate: EstimateArgs,
}

#[derive(clap::Args)]
pub struct TexgenImportArgs {
    /// Folder of TEXGen's textures, one `<id>.png` per object.
    results: PathBuf,
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
}

impl TexgenExportArgs {
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let source = self.estimate.source(EstimateSource::Truth)?;
        let dataset = open_for(&self.places.dataset, &source)?;
        let count = with_progress(|progress| bridges::export_texgen(&dataset, &self.places.out, &source, progress))?;
        print(&format!("{}: {count} objects\n", self.places.out.display()))?;
        Ok(Outcome::Good)
    }
}

impl TexgenImportArgs {
    /// Makes a submission of TEXGen's textures.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        if !self.estimate.is_given() {
            bail!("texgen-import needs --estimate, the same as texgen-export had: seen texels are taken from it");
        }
        let (places, source) = (&self.places, self.estimate.source(EstimateSource::Truth)?);
        let dataset = open_for(&places.dataset, &source)?;
        let (instances, textured) = with_progress(|progress| {
            bridges::import_texgen(&dataset, &self.results, &places.out, places.force, &source, progress)
        })?;
        print(&format!("{}: {textured} textures found\n", self.results.display()))?;
        places.done(instances)
    }
}

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

fn partfield_export(places: &ExportPlaces) -> anyhow::Result<Outcome> {
    let count = bridges::export_partfield(&open_with_twins(&places.dataset)?, &places.out)?;
    print(&format!("{}: {count} mesh{}\n", places.out.display(), if count == 1 { "" } else { "es" }))?;
    Ok(Outcome::Good)
}

impl PartfieldImportArgs {
    /// Copies the labels to where a recipe expects them.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let dataset = open_with_twins(&self.places.dataset)?;
        let count = bridges::import_partfield(&dataset, &self.clusters, self.parts, &self.places.out)?;
        print(&format!("{}: labels of {}\n", self.places.out.display(), counted(count, "instance")))?;
        Ok(Outcome::Good)
    }
}
