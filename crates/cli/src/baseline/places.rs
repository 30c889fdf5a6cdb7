//! Where a baseline reads and writes, and what is printed when it is done.

use std::path::PathBuf;

use mateval_scene::open::Dataset;

use crate::open_dataset::open_dataset;
use crate::outcome::{Outcome, counted, print};

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
