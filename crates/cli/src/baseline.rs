//! `mateval baseline`.

mod import;

use std::num::NonZero;
use std::path::PathBuf;

use anyhow::bail;
use clap::Subcommand;
use mateval_baselines::adapter::Adapter;
use mateval_baselines::estimate::EstimateSource;
use mateval_baselines::nn::NnOptions;
use mateval_baselines::seen_cloud::FillRule;
use mateval_baselines::{grey, homogeneous, nn, partfield, texgen, truth};
use mateval_scene::PartSetId;
use mateval_scene::open::Dataset;

use crate::bars::Bars;
use crate::outcome::{Outcome, print};

/// Which baseline.
#[derive(Subcommand)]
pub enum Command {
    /// The source materials baked to the dataset's own atlases: the ceiling.
    Gt(Places),
    /// Base colour 0.5 (linear) everywhere: the floor.
    Grey(Places),
    /// An estimate of the input view lifted to the atlases; what is not seen by nearest neighbours.
    Nn(NnArgs),
    /// One colour an instance: the median of an estimate under its mask (IM2CAD).
    Median(MedianArgs),
    /// One colour a part: the median of an estimate under its mask.
    MedianPart(MedianPartArgs),
    /// A method's own meshes and textures, or one material a part, rebaked to the atlases by surface.
    Import(import::ImportArgs),
    /// Writes each instance that is seen as TEXGen reads objects: mesh, partial atlas, masks, positions, picture, list.
    TexgenExport(TexgenExportArgs),
    /// TEXGen's textures where nothing is seen, the estimate where something is.
    TexgenImport(TexgenImportArgs),
    /// Writes each instance as a mesh that PartField reads.
    PartfieldExport(PartfieldExportArgs),
    /// PartField's labels as a recipe's `part_labels` wants them: a folder a scene.
    PartfieldImport(PartfieldImportArgs),
}

/// What every baseline is given.
#[derive(clap::Args)]
pub struct Places {
    /// The dataset's folder.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder of the submission.
    #[arg(long)]
    out: PathBuf,
    /// Replace a submission that is there.
    #[arg(long)]
    force: bool,
}

/// Where an estimate comes from.
#[derive(clap::Args)]
pub struct EstimateArgs {
    /// `gt` (the truth of the input view; what nn and texgen-export take if absent), `input` (the input picture itself;
    /// what median and median-part take), or a folder of a method's pictures.
    #[arg(long, value_name = "gt|input|FOLDER")]
    estimate: Option<PathBuf>,
    /// What the folder's files are: colorful-shading, intrinsic, marigold, plain (if absent), rgbx, or a TOML file like
    /// those.
    #[arg(long, value_name = "NAME|FILE.toml")]
    adapter: Option<String>,
}

impl EstimateArgs {
    fn source(&self, default: EstimateSource) -> anyhow::Result<EstimateSource> {
        let named = self.estimate.as_ref().map(|path| path.to_string_lossy());
        let source = match (named.as_deref(), &self.adapter) {
            (None, None) => default,
            (Some("gt"), None) => EstimateSource::Truth,
            (Some("input"), None) => EstimateSource::Input,
            (Some("gt" | "input") | None, Some(_)) => {
                bail!("--adapter tells what a folder holds; give --estimate FOLDER")
            }
            (Some(folder), adapter) => {
                let adapter = Box::new(Adapter::find(adapter.as_deref().unwrap_or("plain"))?);
                let folder = PathBuf::from(folder);
                if !folder.is_dir() {
                    bail!("'{}' is no folder; expected gt, input or a folder of a method's pictures", folder.display());
                }
                EstimateSource::Files { folder, adapter }
            }
        };
        Ok(source)
    }
}

/// Of `nn`.
#[derive(clap::Args)]
pub struct NnArgs {
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
    /// Seen points that an unseen texel follows from: 1 as the paper, 3 as Point-UV (weighted by the inverse square of
    /// the distance).
    #[arg(long, default_value_t = NonZero::<u8>::MIN)]
    neighbours: NonZero<u8>,
    /// Metres that opposite normals count as, so that the back of a board does not take its front's colour.
    #[arg(long, default_value_t = 0.0, value_name = "METRES", allow_negative_numbers = true)]
    normal_weight: f64,
    /// Take the nearest seen point of any instance, not only of the same.
    #[arg(long)]
    any_instance: bool,
    /// Texels a side of every atlas; the dataset's own sizes if absent.
    #[arg(long, value_parser = clap::value_parser!(u32).range(64..=4096))]
    atlas_size: Option<u32>,
}

/// Of `median`.
#[derive(clap::Args)]
pub struct MedianArgs {
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
}

/// Of `median-part`.
#[derive(clap::Args)]
pub struct MedianPartArgs {
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
    /// The set of parts, as in `partfield`; the source's own if absent.
    #[arg(long)]
    part_set: Option<PartSetId>,
}

/// Of `texgen-export`.
#[derive(clap::Args)]
pub struct TexgenExportArgs {
    /// The dataset's folder.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder of the objects.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    estimate: EstimateArgs,
}

/// Of `texgen-import`.
#[derive(clap::Args)]
pub struct TexgenImportArgs {
    /// Folder with a texture an object, `<id>.png`.
    results: PathBuf,
    #[command(flatten)]
    places: Places,
    #[command(flatten)]
    estimate: EstimateArgs,
}

/// Of `partfield-export`.
#[derive(clap::Args)]
pub struct PartfieldExportArgs {
    /// The dataset's folder.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder of the meshes.
    #[arg(long)]
    out: PathBuf,
}

/// Of `partfield-import`.
#[derive(clap::Args)]
pub struct PartfieldImportArgs {
    /// PartField's `cluster_out`, with `<id>_0_<parts>.npy`.
    clusters: PathBuf,
    /// Parts an instance is split into.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u8).range(1..=64))]
    parts: u8,
    /// The dataset's folder.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder of the labels.
    #[arg(long)]
    out: PathBuf,
}

/// Makes the submission.
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Gt(places) => done(places, truth::write(&open(places)?, &places.out, places.force)?),
        Command::Grey(places) => done(places, grey::write(&open(places)?, &places.out, places.force)?),
        Command::Nn(args) => {
            let places = &args.places;
            let source = args.estimate.source(EstimateSource::Truth)?;
            if !(0.0..=100.0).contains(&args.normal_weight) {
                bail!("--normal-weight {}; expected 0 to 100 m", args.normal_weight);
            }
            let rule = FillRule { neighbours: args.neighbours.into(), normal_weight_m: args.normal_weight };
            let options = NnOptions { rule, any_instance: args.any_instance, atlas_size: args.atlas_size };
            let bars = Bars::new();
            let progress = |step: &str, done: usize, all: usize| bars.step(step, done, all);
            let count = nn::write(&open(places)?, &places.out, places.force, &source, &options, &progress)?;
            drop(bars);
            done(places, count)
        }
        Command::Median(args) => {
            let source = args.estimate.source(EstimateSource::Input)?;
            let places = &args.places;
            done(places, homogeneous::write_by_instance(&open(places)?, &places.out, places.force, &source)?)
        }
        Command::MedianPart(args) => {
            let source = args.estimate.source(EstimateSource::Input)?;
            let (places, set) = (&args.places, args.part_set.as_ref());
            done(places, homogeneous::write_by_part(&open(places)?, &places.out, places.force, &source, set)?)
        }
        Command::Import(args) => import::run(args),
        Command::TexgenExport(args) => {
            let source = args.estimate.source(EstimateSource::Truth)?;
            let bars = Bars::new();
            let progress = |step: &str, done: usize, all: usize| bars.step(step, done, all);
            let count = texgen::export(&Dataset::open(&args.dataset)?, &args.out, &source, &progress)?;
            drop(bars);
            print(&format!("{}: {count} objects\n", args.out.display()))?;
            Ok(Outcome::Good)
        }
        Command::TexgenImport(args) => {
            if args.estimate.estimate.is_none() {
                bail!("texgen-import needs the --estimate that texgen-export was given: seen texels are taken from it");
            }
            let (places, source) = (&args.places, args.estimate.source(EstimateSource::Truth)?);
            let bars = Bars::new();
            let progress = |step: &str, done: usize, all: usize| bars.step(step, done, all);
            let dataset = open(places)?;
            let found = texgen::import(&dataset, &args.results, &places.out, places.force, &source, &progress)?;
            drop(bars);
            print(&format!("{}: {} textures found\n", args.results.display(), found.textured))?;
            done(places, found.instances)
        }
        Command::PartfieldExport(args) => {
            let count = partfield::export(&Dataset::open(&args.dataset)?, &args.out)?;
            print(&format!("{}: {count} meshes\n", args.out.display()))?;
            Ok(Outcome::Good)
        }
        Command::PartfieldImport(args) => {
            let dataset = Dataset::open(&args.dataset)?;
            let count = partfield::import(&dataset, &args.clusters, args.parts, &args.out)?;
            print(&format!("{}: labels of {count} instances\n", args.out.display()))?;
            Ok(Outcome::Good)
        }
    }
}

fn open(places: &Places) -> anyhow::Result<Dataset> {
    Ok(Dataset::open(&places.dataset)?)
}

fn done(places: &Places, instances: usize) -> anyhow::Result<Outcome> {
    print(&format!("{}: {instances} instances\n", places.out.display()))?;
    Ok(Outcome::Good)
}
