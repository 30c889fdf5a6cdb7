//! `mateval prep render`: the RGB pictures of a dataset.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
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
    /// The renderer.
    #[arg(long, value_parser = renderer_parser(), default_value = "builtin")]
    renderer: RendererKind,
    #[command(flatten)]
    blender: BlenderArgs,
    /// Samples per pixel of each of the two halves of a picture [default: the recipe's].
    #[arg(long, value_parser = samples_parser())]
    samples: Option<u32>,
    /// Render this scene only, and leave the manifest to `prep finish`; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    /// Render pictures again that already exist.
    #[arg(long)]
    force: bool,
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

/// Renders the dataset.
pub fn run(args: &RenderArgs) -> anyhow::Result<Outcome> {
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
    super::finish::say_if_apart(&args.scenes, &args.dataset);
    if !report.failures.is_empty() {
        bail!("{} could not be rendered; all others were rendered", counted(report.failures.len(), "scene"));
    }
    Ok(Outcome::Good)
}
