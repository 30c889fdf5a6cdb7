//! Where a baseline reads and writes, and what is printed when it is done.

use std::path::PathBuf;

use mateval_baselines::estimate_source::EstimateSource;
use mateval_scene::open::Dataset;

use crate::open_dataset::open_dataset;
use crate::outcome::{Outcome, counted, print, say};

/// Arguments of every baseline that writes a submission.
#[derive(clap::Args)]
pub struct Places {
    /// Folder of the dataset.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder of the submission.
    #[arg(long)]
    pub out: PathBuf,
    /// Replace a submission that already exists.
    #[arg(long)]
    pub force: bool,
}

/// Arguments of commands that write files for another project, which are never replaced.
#[derive(clap::Args)]
pub struct ExportPlaces {
    /// Folder of the dataset.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder for the files; must not exist yet.
    #[arg(long)]
    pub out: PathBuf,
}

impl Places {
    /// Opens the dataset.
    pub fn open(&self) -> anyhow::Result<Dataset> {
        open_dataset(&self.dataset)
    }

    /// Opens the dataset, and says which of the estimate's files are read for it.
    pub fn open_for(&self, source: &EstimateSource) -> anyhow::Result<Dataset> {
        let dataset = self.open()?;
        if let Some(text) = source.files_read(&dataset) {
            say(&text);
        }
        Ok(dataset)
    }

    /// Prints where the submission is and how many instances it covers.
    pub fn done(&self, instances: usize) -> anyhow::Result<Outcome> {
        print(&format!("{}: {}\n", self.out.display(), counted(instances, "instance")))?;
        Ok(Outcome::Good)
    }
}

impl ExportPlaces {
    /// Opens the dataset.
    pub fn open(&self) -> anyhow::Result<Dataset> {
        open_dataset(&self.dataset)
    }
}
