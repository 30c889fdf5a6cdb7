//! `mateval prep`: makes, checks and describes datasets. The commands that examine a dataset are here, those that make
//! one in `make`, those that pass it on in `publish`.

pub mod make;
mod publish;

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_dataset::manifest::check_opened;
use mateval_dataset::open::{Dataset, check_outside_datasets};
use mateval_dataset::withheld::Secret;
use mateval_dataset::{SceneId, Severity, json};
use mateval_files::whole::write_whole;
use mateval_prep::compare::{CompareOptions, Sampling, compare, tables};
use mateval_prep::stats;
use mateval_prep::verify::verify;

use self::make::{BuildArgs, FinishArgs, PerturbArgs, RenderArgs, SurveyArgs, samples_parser};
use self::publish::{ExportArgs, PublishArgs};
use crate::TOOL;
use crate::arguments::{Format, check_output_file, open_dataset};
use crate::terminal::{Outcome, columns, print, print_fitted, say, with_progress};

/// Subcommands of `prep`.
#[derive(clap::Subcommand)]
pub enum Command {
    /// Converts the scenes that a recipe lists into a dataset. A build that was killed resumes when it is run again.
    Build(BuildArgs),
    /// Searches 3D-FRONT houses for rooms that could become scenes, and writes a page to choose from and a recipe.
    Survey(SurveyArgs),
    /// Renders the photos that methods see, and the reference with which scores under light compare. Changes the
    /// manifest: run it before the dataset is given to anyone.
    Render(RenderArgs),
    /// Writes the files that describe the whole dataset, after scenes were made or rendered apart by --scene.
    Finish(FinishArgs),
    /// Compares Blender's pictures with those of the built-in path tracer, and keeps the verdict in the dataset's
    /// compare.json, which its identity does not cover. Exit code 1: a check that could be decided does not agree.
    Compare(CompareArgs),
    /// Checks a dataset: hashes, schemas, reprojection, ids and masks. Exit code 1: it has an error.
    Verify(VerifyArgs),
    /// Copies what methods see of a dataset with furniture moved, scaled or bent, to measure what imperfect geometry
    /// costs.
    Perturb(PerturbArgs),
    /// Splits a dataset into the public files and the ground truth of a hidden split, and writes a page that describes
    /// the release. Exit code 1: the page states a fault.
    Publish(PublishArgs),
    /// Writes a dataset in a format that other tools read: tars, Croissant, Hugging Face, nerfstudio, COLMAP or Mitsuba.
    Export(ExportArgs),
    /// Counts what a dataset holds: the paper's Table I, objects by category, and numbers scene by scene.
    Stats(StatsArgs),
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Build(args) => args.run(),
        Command::Survey(args) => args.run(),
        Command::Render(args) => args.run(),
        Command::Finish(args) => args.run(),
        Command::Compare(args) => args.run(),
        Command::Verify(args) => args.run(),
        Command::Perturb(args) => args.run(),
        Command::Publish(args) => args.run(),
        Command::Export(args) => args.run(),
        Command::Stats(args) => args.run(),
    }
}

#[derive(clap::Args)]
pub struct VerifyArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// The secret of a hidden split, which its keeper publishes together with the ground truth: checks that the truth is
    /// the one that was committed to.
    #[arg(long, value_name = "SECRET")]
    opened: Option<PathBuf>,
    /// How to print the findings.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

impl VerifyArgs {
    /// Checks the dataset and prints all findings.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let mut findings = with_progress(|progress| verify(&self.dataset, progress))
            .with_context(|| format!("cannot verify '{}'", self.dataset.display()))?;
        if let Some(secret) = &self.opened {
            findings.extend(check_opened(&self.dataset, &Secret::read(secret)?)?);
        }
        let errors = findings.iter().filter(|finding| finding.severity == Severity::Error).count();
        match self.format {
            Format::Json => print(&json::to_text(&serde_json::json!({
                "format": "mateval-verify/1",
                "tool": TOOL,
                "sound": errors == 0,
                "findings": findings,
            })))?,
            Format::Text => {
                for finding in &findings {
                    print_fitted(&format!("{finding}\n"))?;
                }
                let verdict = if errors == 0 { "sound" } else { "NOT sound" };
                print_fitted(&format!("{}: {verdict}, {errors} errors\n", self.dataset.display()))?;
            }
        }
        Ok(if errors == 0 { Outcome::Good } else { Outcome::No })
    }
}

#[derive(clap::Args)]
pub struct CompareArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// Compare this scene only; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    /// Most samples per pixel of each half of the built-in tracer's pictures. Samples are added until every check is
    /// decided that they can decide [default: four times as many as Blender's].
    #[arg(long, value_name = "SAMPLES", value_parser = samples_parser())]
    budget: Option<u32>,
    /// Render exactly this number of samples, whatever they decide.
    #[arg(long, value_parser = samples_parser(), conflicts_with = "budget")]
    samples: Option<u32>,
    /// How to print the comparison.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Folder for compare.json and pages, an index and one per scene, that show both pictures side by side.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Replace a comparison that already exists.
    #[arg(long, requires = "out")]
    force: bool,
}

impl CompareArgs {
    /// Compares and prints the checks.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let options = CompareOptions {
            dataset: self.dataset.clone(),
            scenes: self.scenes.clone(),
            samples: match (self.samples, self.budget) {
                (Some(samples), _) => Sampling::Exactly(samples),
                (None, Some(budget)) => Sampling::AtMost(budget),
                (None, None) => Sampling::UntilDecided,
            },
            out: self.out.clone(),
            force: self.force,
        };
        let file = with_progress(|progress| compare(&options, TOOL, progress))
            .context("cannot compare the dataset's pictures")?;
        match self.format {
            Format::Json => print(&json::to_text(&file))?,
            Format::Text => print(&tables::text(&file, columns()))?,
        }
        if let Some(out) = &self.out {
            say(&format!("{}: both pictures side by side", out.join("index.html").display()));
        }
        Ok(if file.agrees { Outcome::Good } else { Outcome::No })
    }
}

#[derive(clap::Args)]
pub struct StatsArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// How to print the counts.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Lay the look of another dataset's true albedo beside this one's, as of the rooms before they were redressed.
    #[arg(long, value_name = "ORIGINAL", conflicts_with = "findings")]
    beside: Option<PathBuf>,
    /// SVG file for a chart of the counts, or with --beside of both looks; must lie outside the dataset.
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// Sum up the findings about the sources instead, by code and by scene.
    #[arg(long, conflicts_with = "picture")]
    findings: bool,
    /// Replace a chart that already exists.
    #[arg(long, requires = "picture")]
    force: bool,
}

impl StatsArgs {
    /// Counts, compares looks and draws the chart where asked for, and prints the counts or the findings.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        if let Some(picture) = &self.picture {
            check_outside_datasets(picture, "--picture")?;
            check_output_file(picture, "--picture", "picture", self.force)?;
        }
        let dataset = open_dataset(&self.dataset)?;
        let original = self.beside.as_deref().map(open_dataset).transpose()?;
        if self.findings {
            let found = stats::findings::findings(&dataset, TOOL);
            match self.format {
                Format::Json => print(&json::to_text(&found))?,
                Format::Text => print(&stats::findings::text(&found, columns()))?,
            }
            return Ok(Outcome::Good);
        }
        let mut counted = stats::count(&dataset, TOOL).context("cannot count the dataset")?;
        counted.look = stats::look::look(&dataset)?;
        if let Some(original) = &original {
            let withheld = |dataset: &Dataset| {
                let root = dataset.root.display();
                format!("cannot compare the look of '{root}': its ground truth is withheld; name a copy that has it")
            };
            let look = counted.look.as_ref().with_context(|| withheld(&dataset))?;
            counted.beside = Some(look.beside(original)?.with_context(|| withheld(original))?);
        }
        if let Some(picture) = &self.picture {
            write_whole(picture, stats::show::picture(&counted).as_bytes())?;
        }
        match (self.format, &self.picture) {
            (Format::Json, _) => print(&json::to_text(&counted))?,
            (Format::Text, None) => print(&stats::show::text(&counted, columns()))?,
            (Format::Text, Some(picture)) => {
                print(&format!("{}\n{}\n", stats::show::text(&counted, columns()), picture.display()))?
            }
        }
        Ok(Outcome::Good)
    }
}
