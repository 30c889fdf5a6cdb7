//! `mateval prep build`: converts the scenes of a recipe into a dataset. Atlases are kept in the cache's `atlases`.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_prep::build::BuildOptions;
use mateval_scene::SceneId;

use super::blender;
use crate::bars::with_progress;
use crate::outcome::{Outcome, counted, print, say, say_findings};
use crate::tool::TOOL;
use crate::weights::cache_folder;

/// Arguments of `prep build`.
#[derive(clap::Args)]
pub struct BuildArgs {
    /// The recipe, a TOML file.
    recipe: PathBuf,
    /// Folder of the dataset.
    #[arg(long)]
    out: PathBuf,
    /// Folder that the recipe's paths are relative to [default: the recipe's folder].
    #[arg(long)]
    source: Option<PathBuf>,
    /// Make this scene only, and leave the files of the whole dataset to `prep finish`; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    /// Replace a dataset that already exists; with --scene, only these scenes.
    #[arg(long)]
    force: bool,
    /// The Blender that reads `.blend` files: Blender 4.5, or a Python with that version's `bpy` module [default:
    /// $MATEVAL_BLENDER, else the one that `mateval fetch blender` installed].
    #[arg(long, value_name = "PATH")]
    blender: Option<PathBuf>,
}

/// Builds the dataset and reports the findings of each scene.
pub fn run(args: &BuildArgs) -> anyhow::Result<Outcome> {
    let options = BuildOptions {
        recipe: args.recipe.clone(),
        source: args.source.clone(),
        out: args.out.clone(),
        scenes: args.scenes.clone(),
        force: args.force,
        blender: blender::found(args.blender.clone())?,
        atlas_cache: Some(cache_folder().join("atlases")),
    };
    let report = with_progress(|progress| mateval_prep::build::build(&options, TOOL, progress))
        .context("cannot build the dataset")?;
    for scene in &report.resumed {
        say(&format!("scene '{scene}' was already made by an earlier run"));
    }
    for (scene, findings) in &report.findings {
        say_findings(scene.as_str(), findings, "scene.json");
    }
    print(&format!("{}: {}\n", args.out.display(), counted(report.findings.len(), "scene")))?;
    super::finish::say_if_apart(&args.scenes, &args.out);
    Ok(Outcome::Good)
}
