//! `mateval prep compare`: Blender's pictures against those of the built-in path tracer.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_audit::compare::{CompareOptions, compare, text};
use mateval_scene::{SceneId, json};

use super::render::samples_parser;
use crate::bars::with_progress;
use crate::format::Format;
use crate::outcome::{Outcome, print, say};
use crate::tool::TOOL;

/// Arguments of `prep compare`.
#[derive(clap::Args)]
pub struct CompareArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// Compare this scene only; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    /// Samples per pixel of each half of the built-in tracer's pictures [default: as few as leave the
    /// decision to Blender's noise or to the bound, and at most as many as Blender's].
    #[arg(long, value_parser = samples_parser())]
    samples: Option<u32>,
    /// How to print the comparison.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Folder for compare.json and a page that shows both pictures side by side.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Replace a comparison that already exists.
    #[arg(long, requires = "out")]
    force: bool,
}

/// Compares and prints the checks.
pub fn run(args: &CompareArgs) -> anyhow::Result<Outcome> {
    let options = CompareOptions {
        dataset: args.dataset.clone(),
        scenes: args.scenes.clone(),
        samples: args.samples,
        out: args.out.clone(),
        force: args.force,
    };
    let file =
        with_progress(|progress| compare(&options, TOOL, progress)).context("cannot compare the dataset's pictures")?;
    match args.format {
        Format::Json => print(&json::to_text(&file))?,
        Format::Text => print(&text::text(&file))?,
    }
    if let Some(out) = &args.out {
        say(&format!("{}: both pictures side by side", out.join("index.html").display()));
    }
    Ok(if file.agrees { Outcome::Good } else { Outcome::No })
}
