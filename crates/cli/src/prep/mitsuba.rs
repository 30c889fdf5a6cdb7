//! `mateval prep mitsuba`: a view with its ground truth as a scene for Mitsuba 3.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_audit::mitsuba_export::{ExportOptions, export_view};
use mateval_scene::{SceneId, Severity, ViewId};

use super::render::samples_parser;
use crate::outcome::{Outcome, counted, print, say};

/// Arguments of `prep mitsuba`.
#[derive(clap::Args)]
pub struct MitsubaArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// The scene to export.
    #[arg(long)]
    scene: SceneId,
    /// The view to export.
    #[arg(long, default_value = "input")]
    view: ViewId,
    /// Folder that scene.xml, meshes and textures are written to.
    #[arg(long)]
    out: PathBuf,
    /// Samples per pixel [default: the recipe's].
    #[arg(long, value_parser = samples_parser())]
    samples: Option<u32>,
    /// Replace a folder that already exists.
    #[arg(long)]
    force: bool,
}

/// Exports the view and reports what Mitsuba cannot express.
pub fn run(args: &MitsubaArgs) -> anyhow::Result<Outcome> {
    let options = ExportOptions {
        dataset: args.dataset.clone(),
        scene: args.scene.clone(),
        view: args.view.clone(),
        samples: args.samples,
        out: args.out.clone(),
        force: args.force,
    };
    let findings = export_view(&options).context("cannot export to Mitsuba")?;
    for finding in &findings {
        say(&format!("{}: {finding}", args.scene));
    }
    let differences = findings.iter().filter(|finding| finding.severity != Severity::Note).count();
    let verdict = if differences == 0 { "means the same" } else { "does NOT mean the same" };
    let file = args.out.join("scene.xml");
    print(&format!("{}: {verdict} in Mitsuba, {}\n", file.display(), counted(differences, "difference")))?;
    Ok(if differences == 0 { Outcome::Good } else { Outcome::No })
}
