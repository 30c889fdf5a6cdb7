//! Opens a dataset for work on all of its scenes that exist.

use std::path::Path;

use anyhow::Context as _;
use mateval_scene::open::Dataset;

use crate::outcome::say;

/// Opens the dataset in `root`, and says so where scenes of it are absent.
pub fn open_dataset(root: &Path) -> anyhow::Result<Dataset> {
    let dataset = Dataset::open(root).context("cannot open the dataset")?;
    if let Some(absence) = dataset.absence() {
        say(&absence);
    }
    Ok(dataset)
}
