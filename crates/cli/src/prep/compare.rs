//! `mateval prep compare`.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_audit::compare::{CompareOptions, compare, text};
use mateval_scene::{SceneId, json};

use super::Format;
use crate::TOOL;
use crate::bars::Bars;
use crate::outcome::{Outcome, print, say};

/// What it is given.
#[derive(clap::Args)]
pub struct CompareArgs {
    /// The dataset's folder.
    dataset: PathBuf,
    /// Only this scene; may be given several times.
    #[arg(long = "scene")]
    scenes: Vec<SceneId>,
    /// Samples a pixel of each half of our own pictures; as many as Blender's if absent.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    samples: Option<u32>,
    /// How to print what was found.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Folder for compare.json and a page with the pictures side by side.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Replace a comparison that is there.
    #[arg(long, requires = "out")]
    force: bool,
}

/// Runs it.
pub fn run(args: &CompareArgs) -> anyhow::Result<Outcome> {
    let options = CompareOptions {
        dataset: args.dataset.clone(),
        scenes: args.scenes.clone(),
        samples: args.samples,
        out: args.out.clone(),
        force: args.force,
    };
    let bars = Bars::new();
    let file = compare(&options, TOOL, &|step, done, all| bars.step(step, done, all))
        .context("cannot compare the dataset's pictures")?;
    drop(bars);
    match args.format {
        Format::Json => print(&json::to_text(&file))?,
        Format::Text => print(&text::text(&file))?,
    }
    if let Some(out) = &args.out {
        say(&format!("{}: both pictures side by side", out.join("index.html").display()));
    }
    Ok(if file.agrees { Outcome::Good } else { Outcome::No })
}
