//! `mateval prep render`: the photos of a dataset, and the scorer's reference.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mateval_eval::light::reference::{RELEASE_SAMPLES, ReferenceOptions, make_references};
use mateval_prep::bring_up_to_date::bring_up_to_date;
use mateval_prep::finish::finish_again;
use mateval_prep::recipe::MOST_SAMPLES;
use mateval_prep::render::{RenderOptions, Renderer, RendererKind};
use mateval_scene::SceneId;

use super::blender::BlenderArgs;
use crate::bars::with_progress;
use crate::fetch::check_blender;
use crate::outcome::{Outcome, counted, print, say};

/// Arguments of `prep render`.
#[derive(clap::Args)]
pub struct RenderArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// Make only one kind of picture [default: both].
    #[arg(long, value_enum)]
    only: Option<Only>,
    /// The renderer of the photos.
    #[arg(long, value_parser = renderer_parser(), default_value = "builtin")]
    renderer: RendererKind,
    #[command(flatten)]
    blender: BlenderArgs,
    /// Samples per pixel of each of the two halves of a photo [default: the recipe's].
    #[arg(long, value_parser = samples_parser())]
    samples: Option<u32>,
    /// Samples per pixel of each of the two halves of the scorer's reference.
    #[arg(long, value_parser = samples_parser(), default_value_t = RELEASE_SAMPLES)]
    scorer_samples: u32,
    /// Render this scene only, and leave the manifest to `prep finish`; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    /// Render pictures again that already exist.
    #[arg(long)]
    force: bool,
}

/// A kind of picture that `prep render` makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Only {
    /// Photos: every view by the renderer, its input view being what methods see.
    Photo,
    /// The scorer's reference: its own render of the true materials, with which scores under light compare. A dataset of the
    /// format before this one is brought up to date first.
    Scorer,
}

/// Reads a renderer's name; the help lists every renderer with its summary.
pub fn renderer_parser() -> impl TypedValueParser<Value = RendererKind> {
    let names = RendererKind::ALL.map(|kind| PossibleValue::new(kind.name()).help(kind.summary()));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<RendererKind>())
}

/// Reads a number of samples, as large as a recipe's may be.
pub fn samples_parser() -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(1..=i64::from(MOST_SAMPLES))
}

/// The renderer with its options. For Blender, fails if it cannot be found, or is a module that cannot be imported.
pub fn checked_renderer(kind: RendererKind, blender: &BlenderArgs) -> anyhow::Result<Renderer> {
    Ok(match kind {
        RendererKind::Builtin => Renderer::Builtin,
        RendererKind::Blender => {
            let options = blender.options()?;
            if options.program.is_python() {
                check_blender(&options.program.0).context("cannot render with Blender")?;
            }
            Renderer::Blender(options)
        }
    })
}

/// Renders the dataset: photos first, then references.
pub fn run(args: &RenderArgs) -> anyhow::Result<Outcome> {
    if args.only == Some(Only::Scorer) {
        let is_new = with_progress(|progress| bring_up_to_date(&args.dataset, progress))
            .context("cannot bring the dataset up to date")?;
        if is_new {
            say(&format!("{}: brought up to date; its identity has changed", args.dataset.display()));
        }
    } else {
        let failed = render_photos(args)?;
        if failed > 0 {
            super::finish::say_if_apart(&args.scenes, &args.dataset);
            let failed = counted(failed, "scene");
            bail!(
                "{failed} could not be rendered; all others were rendered. Run the command again: references follow the photos"
            );
        }
    }
    if args.only != Some(Only::Photo) {
        render_references(args)?;
    }
    super::finish::say_if_apart(&args.scenes, &args.dataset);
    Ok(Outcome::Good)
}

/// Returns the number of scenes that could not be rendered.
fn render_photos(args: &RenderArgs) -> anyhow::Result<usize> {
    let renderer = checked_renderer(args.renderer, &args.blender)?;
    let options = RenderOptions { renderer, samples: args.samples, scenes: args.scenes.clone(), force: args.force };
    let report = with_progress(|progress| mateval_prep::render::render(&args.dataset, &options, progress))
        .context("cannot render the dataset")?;
    for line in &report.remarks {
        say(line);
    }
    for failure in &report.failures {
        say(&failure.to_string());
    }
    let rendered = counted(report.rendered, "view");
    print(&format!("{}: {rendered} rendered, {} kept\n", args.dataset.display(), report.kept))?;
    Ok(report.failures.len())
}

fn render_references(args: &RenderArgs) -> anyhow::Result<()> {
    let options = ReferenceOptions { samples: args.scorer_samples, scenes: args.scenes.clone(), force: args.force };
    let report = with_progress(|progress| make_references(&args.dataset, &options, progress))
        .context("cannot render the scorer's references")?;
    if args.scenes.is_empty() {
        with_progress(|progress| finish_again(&args.dataset, progress)).context("cannot finish the dataset")?;
    }
    let rendered = counted(report.rendered, "scene");
    print(&format!("{}: references of {rendered} rendered, {} kept\n", args.dataset.display(), report.kept))
}
