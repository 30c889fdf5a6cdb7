//! `mateval prep`.

pub mod blender;
mod compare;
mod publish;
mod survey;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use mateval_image::store::write_whole;
use mateval_prep::build::{BuildOptions, BuildReport};
use mateval_prep::mitsuba_export::ExportOptions;
use mateval_prep::render::{RenderOptions, Renderer};
use mateval_prep::stats;
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::check_free;
use mateval_scene::{SceneId, Severity, ViewId, json};

use crate::TOOL;
use crate::bars::Bars;
use crate::outcome::{Outcome, print, say, say_findings};

/// Its subcommands.
#[derive(clap::Subcommand)]
pub enum Command {
    /// Converts what a recipe lists into a dataset; goes on where it was killed.
    Build(BuildArgs),
    /// Looks through 3D-FRONT houses for rooms that could be scenes: a page to pick from, and a recipe.
    Survey(survey::SurveyArgs),
    /// Renders the dataset's RGB pictures.
    Render(RenderArgs),
    /// Holds Blender's pictures against our own tracer's; exit code 1 where they do not agree.
    Compare(compare::CompareArgs),
    /// Looks for faults in a dataset: hashes, schemas, reprojection, ids, masks.
    Verify(VerifyArgs),
    /// Writes a dataset as two trees: what everybody may see, and the ground truth of a hidden split.
    Publish(publish::PublishArgs),
    /// Counts what a dataset holds: the paper's Table I, objects by category, scene by scene.
    Stats(StatsArgs),
    /// Writes a view with its ground truth as a scene for Mitsuba 3; exit code 1 where Mitsuba cannot say all of it.
    Mitsuba(MitsubaArgs),
}

/// What `prep build` is given.
#[derive(clap::Args)]
pub struct BuildArgs {
    /// The recipe, a TOML file.
    pub recipe: PathBuf,
    /// Folder of the dataset.
    #[arg(long)]
    pub out: PathBuf,
    /// Folder that the recipe's paths are relative to; the recipe's own if absent.
    #[arg(long)]
    pub source: Option<PathBuf>,
    /// Replace a dataset that is there.
    #[arg(long)]
    pub force: bool,
}

/// What `prep render` is given.
#[derive(clap::Args)]
pub struct RenderArgs {
    /// The dataset's folder.
    pub dataset: PathBuf,
    /// By what.
    #[arg(long, value_enum, default_value = "builtin")]
    pub renderer: RendererWord,
    #[command(flatten)]
    pub blender: blender::BlenderArgs,
    /// Samples a pixel of each of the two halves; the recipe's if absent.
    #[arg(long)]
    pub samples: Option<u32>,
    /// Only this scene; may be given several times.
    #[arg(long = "scene")]
    pub scenes: Vec<SceneId>,
    /// Render again what is there.
    #[arg(long)]
    pub force: bool,
}

/// What renders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum RendererWord {
    /// Our own path tracer.
    Builtin,
    /// Blender's Cycles, denoised, light group by light group.
    Blender,
}

/// What `prep verify` is given.
#[derive(clap::Args)]
pub struct VerifyArgs {
    /// The dataset's folder.
    dataset: PathBuf,
    /// How to print the findings.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    Text,
    Json,
}

/// What `prep stats` is given.
#[derive(clap::Args)]
pub struct StatsArgs {
    /// The dataset's folder.
    dataset: PathBuf,
    /// How to print the counts.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// SVG file to draw them to, outside the dataset.
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// Replace a picture that is there.
    #[arg(long, requires = "picture")]
    force: bool,
}

/// What `prep mitsuba` is given.
#[derive(clap::Args)]
pub struct MitsubaArgs {
    /// The dataset's folder.
    dataset: PathBuf,
    /// The scene.
    #[arg(long)]
    scene: SceneId,
    /// The view.
    #[arg(long, default_value = "input")]
    view: ViewId,
    /// Folder to write scene.xml, meshes and textures to.
    #[arg(long)]
    out: PathBuf,
    /// Samples a pixel; the recipe's if absent.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    samples: Option<u32>,
    /// Replace a folder that is there.
    #[arg(long)]
    force: bool,
}

/// Runs one of them.
pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Build(args) => build(args),
        Command::Survey(args) => survey::run(args),
        Command::Render(args) => render(args),
        Command::Compare(args) => compare::run(args),
        Command::Verify(args) => verify(args),
        Command::Publish(args) => publish::run(args),
        Command::Stats(args) => count(args),
        Command::Mitsuba(args) => mitsuba(args),
    }
}

/// Carries a recipe out.
pub fn build(args: &BuildArgs) -> anyhow::Result<Outcome> {
    let options = BuildOptions {
        recipe: args.recipe.clone(),
        source: args.source.clone(),
        out: args.out.clone(),
        force: args.force,
    };
    let bars = Bars::new();
    let report = mateval_prep::build::build(&options, TOOL, &|step, done, all| bars.step(step, done, all))
        .context("cannot build the dataset")?;
    drop(bars);
    tell(&report);
    print(&format!("{}: {} scenes\n", args.out.display(), report.dataset.scenes.len()))?;
    Ok(Outcome::Good)
}

fn tell(report: &BuildReport) {
    for scene in &report.resumed {
        say(&format!("scene '{scene}' was already made by an earlier run"));
    }
    for (scene, findings) in &report.findings {
        say_findings(scene.as_str(), findings);
    }
}

/// Renders a dataset's RGB pictures.
pub fn render(args: &RenderArgs) -> anyhow::Result<Outcome> {
    let renderer = match args.renderer {
        RendererWord::Builtin => Renderer::Builtin,
        RendererWord::Blender => Renderer::Blender(args.blender.options()?),
    };
    let options = RenderOptions { renderer, samples: args.samples, scenes: args.scenes.clone(), force: args.force };
    let bars = Bars::new();
    let report = mateval_prep::render::render(&args.dataset, &options, &|step, done, all| bars.step(step, done, all))
        .context("cannot render the dataset")?;
    drop(bars);
    for line in &report.remarks {
        say(line);
    }
    for failure in &report.failures {
        say(&failure.to_string());
    }
    print(&format!("{}: {} views rendered, {} were there\n", args.dataset.display(), report.rendered, report.kept))?;
    if !report.failures.is_empty() {
        bail!("{} scenes could not be rendered; the others were", report.failures.len());
    }
    Ok(Outcome::Good)
}

fn verify(args: &VerifyArgs) -> anyhow::Result<Outcome> {
    let bars = Bars::new();
    let findings = mateval_prep::verify::verify(&args.dataset, &|step, done, all| bars.step(step, done, all))
        .with_context(|| format!("cannot verify '{}'", args.dataset.display()))?;
    drop(bars);
    let errors = findings.iter().filter(|finding| finding.severity == Severity::Error).count();
    match args.format {
        Format::Json => print(&json::to_text(&serde_json::json!({
            "format": "mateval-verify/1",
            "tool": TOOL,
            "sound": errors == 0,
            "findings": findings,
        })))?,
        Format::Text => {
            for finding in &findings {
                print(&format!("{finding}\n"))?;
            }
            let verdict = if errors == 0 { "sound" } else { "NOT sound" };
            print(&format!("{}: {verdict}, {errors} errors\n", args.dataset.display()))?;
        }
    }
    Ok(if errors == 0 { Outcome::Good } else { Outcome::No })
}

fn count(args: &StatsArgs) -> anyhow::Result<Outcome> {
    if let Some(picture) = &args.picture {
        check_picture_place(picture, args)?;
    }
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let counted = stats::count(&dataset, TOOL).context("cannot count the dataset")?;
    if let Some(picture) = &args.picture {
        write_whole(picture, stats::picture::picture(&counted).as_bytes())?;
    }
    match (args.format, &args.picture) {
        (Format::Json, _) => print(&json::to_text(&counted))?,
        (Format::Text, None) => print(&stats::text::text(&counted))?,
        (Format::Text, Some(picture)) => print(&format!("{}\n{}\n", stats::text::text(&counted), picture.display()))?,
    }
    Ok(Outcome::Good)
}

/// A picture replaces nothing unasked, and is no part of the dataset, whose manifest would not know it.
fn check_picture_place(picture: &Path, args: &StatsArgs) -> anyhow::Result<()> {
    let shown = picture.display();
    if picture.is_dir() {
        bail!("'{shown}' is a folder; expected the name of a picture file");
    }
    check_free(picture, args.force, "--picture")?;
    let folder = picture.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(folder) = folder.canonicalize() else {
        bail!("the folder of '{shown}' is not there; make it, or choose another --picture");
    };
    if args.dataset.canonicalize().is_ok_and(|dataset| folder.starts_with(dataset)) {
        bail!("'{shown}' would lie in the dataset, whose manifest does not list it; choose another --picture");
    }
    Ok(())
}

fn mitsuba(args: &MitsubaArgs) -> anyhow::Result<Outcome> {
    let options = ExportOptions {
        dataset: args.dataset.clone(),
        scene: args.scene.clone(),
        view: args.view.clone(),
        samples: args.samples,
        out: args.out.clone(),
        force: args.force,
    };
    let findings = mateval_prep::mitsuba_export::export_view(&options).context("cannot export to Mitsuba")?;
    say_findings(args.scene.as_str(), &findings);
    let unsaid = findings.iter().filter(|finding| finding.severity != Severity::Note).count();
    let verdict = if unsaid == 0 { "means the same" } else { "does NOT mean the same" };
    let file = args.out.join("scene.xml");
    print(&format!("{}: {verdict} in Mitsuba, {unsaid} things that it cannot say\n", file.display()))?;
    Ok(if unsaid == 0 { Outcome::Good } else { Outcome::No })
}
