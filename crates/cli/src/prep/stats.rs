//! `mateval prep stats`: counts what a dataset holds.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use mateval_audit::stats;
use mateval_image::store::write_whole;
use mateval_scene::json;
use mateval_scene::work_folder::is_inside;

use crate::format::Format;
use crate::open_dataset::open_dataset;
use crate::outcome::{Outcome, print};
use crate::output_file::check_output_file;
use crate::tool::TOOL;

/// Arguments of `prep stats`.
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

/// Counts, draws the chart where one is asked for, and prints the counts.
pub fn run(args: &StatsArgs) -> anyhow::Result<Outcome> {
    if let Some(picture) = &args.picture {
        check_picture(picture, &args.dataset, args.force)?;
    }
    let dataset = open_dataset(&args.dataset)?;
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

/// The dataset's manifest would not list a chart in its folder, so there must be none.
fn check_picture(picture: &Path, dataset: &Path, force: bool) -> anyhow::Result<()> {
    if is_inside(picture, dataset) {
        let shown = picture.display();
        bail!("'{shown}' would lie in the dataset, whose manifest does not list it; choose another --picture");
    }
    check_output_file(picture, "--picture", "picture", force)
}
