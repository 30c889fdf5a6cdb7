//! The commands that examine a dataset: `mateval prep verify`, `compare` and `stats`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use mateval_audit::compare::{CompareOptions, compare, report};
use mateval_audit::stats;
use mateval_image::store::write_whole;
use mateval_scene::work_folder::is_inside;
use mateval_scene::{SceneId, Severity, json};

use crate::TOOL;
use crate::arguments::{Format, check_output_file, open_dataset};
use crate::prep::make::samples_parser;
use crate::terminal::{Outcome, print, say, with_progress};

#[derive(clap::Args)]
pub struct VerifyArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// How to print the findings.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

impl VerifyArgs {
    /// Checks the dataset and prints all findings.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let findings = with_progress(|progress| mateval_audit::verify::verify(&self.dataset, progress))
            .with_context(|| format!("cannot verify '{}'", self.dataset.display()))?;
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
                    print(&format!("{finding}\n"))?;
                }
                let verdict = if errors == 0 { "sound" } else { "NOT sound" };
                print(&format!("{}: {verdict}, {errors} errors\n", self.dataset.display()))?;
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

impl CompareArgs {
    /// Compares and prints the checks.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let options = CompareOptions {
            dataset: self.dataset.clone(),
            scenes: self.scenes.clone(),
            samples: self.samples,
            out: self.out.clone(),
            force: self.force,
        };
        let file = with_progress(|progress| compare(&options, TOOL, progress))
            .context("cannot compare the dataset's pictures")?;
        match self.format {
            Format::Json => print(&json::to_text(&file))?,
            Format::Text => print(&report::text(&file))?,
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
    /// SVG file for a chart of the counts; must lie outside the dataset.
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// Replace a chart that already exists.
    #[arg(long, requires = "picture")]
    force: bool,
}

impl StatsArgs {
    /// Counts, draws the chart where one is asked for, and prints the counts.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        if let Some(picture) = &self.picture {
            check_picture(picture, &self.dataset, self.force)?;
        }
        let dataset = open_dataset(&self.dataset)?;
        let counted = stats::count(&dataset, TOOL).context("cannot count the dataset")?;
        if let Some(picture) = &self.picture {
            write_whole(picture, stats::show::picture(&counted).as_bytes())?;
        }
        match (self.format, &self.picture) {
            (Format::Json, _) => print(&json::to_text(&counted))?,
            (Format::Text, None) => print(&stats::show::text(&counted))?,
            (Format::Text, Some(picture)) => {
                print(&format!("{}\n{}\n", stats::show::text(&counted), picture.display()))?
            }
        }
        Ok(Outcome::Good)
    }
}

/// The dataset's manifest would not list a chart in its folder, so there must be none.
fn check_picture(picture: &Path, dataset: &Path, force: bool) -> anyhow::Result<()> {
    if is_inside(picture, dataset) {
        let shown = picture.display();
        bail!("'{shown}' would lie in the dataset, whose manifest does not list it; choose another --picture");
    }
    check_output_file(picture, "--picture", "picture", force)
}
