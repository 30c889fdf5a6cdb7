//! `mateval prep export`: a dataset in a format that other tools read.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_export::croissant::Publication;
use mateval_export::{ExportOptions, Exported, Format, export};

use crate::bars::with_progress;
use crate::outcome::{Outcome, counted, print};

/// Arguments of `prep export`.
#[derive(clap::Args)]
pub struct ExportArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// The format to write.
    #[arg(long = "as", value_enum, value_name = "FORMAT")]
    format: FormatName,
    /// Folder to write.
    #[arg(long)]
    out: PathBuf,
    /// For croissant: the address of the folder where the files will be published; without it their places are relative.
    #[arg(long)]
    url: Option<String>,
    /// For croissant: the day of publication, as in 2026-11-24.
    #[arg(long)]
    date: Option<String>,
    /// For croissant: how to cite the dataset [default: its name, version and hash].
    #[arg(long)]
    citation: Option<String>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum FormatName {
    /// One tar for each scene and base.tar for the rest, so that scenes can be downloaded one by one.
    Tar,
    /// The same tars, described by a Croissant file.
    Croissant,
    /// A Parquet file with a row for each view, and a dataset card for the Hugging Face Hub.
    Huggingface,
    /// For each scene a folder with transforms.json.
    Nerfstudio,
    /// For each scene a folder with COLMAP's text model.
    Colmap,
}

impl FormatName {
    fn format(self) -> Format {
        match self {
            Self::Tar => Format::Tar,
            Self::Croissant => Format::Croissant,
            Self::Huggingface => Format::Huggingface,
            Self::Nerfstudio => Format::Nerfstudio,
            Self::Colmap => Format::Colmap,
        }
    }
}

/// Exports the dataset and prints what was written.
pub fn run(args: &ExportArgs) -> anyhow::Result<Outcome> {
    let options = ExportOptions {
        dataset: args.dataset.clone(),
        format: args.format.format(),
        out: args.out.clone(),
        publication: Publication { url: args.url.clone(), date: args.date.clone(), citation: args.citation.clone() },
    };
    let Exported { scenes, views, without_picture } =
        with_progress(|progress| export(&options, progress)).context("cannot export the dataset")?;
    let mut line = format!("{}: {}", args.out.display(), counted(scenes, "scene"));
    if let Some(views) = views {
        line.push_str(&format!(", {}", counted(views, "view")));
    }
    if without_picture > 0 {
        line.push_str(&format!("; {} without a picture, because theirs is withheld", counted(without_picture, "view")));
    }
    print(&format!("{line}\n"))?;
    Ok(Outcome::Good)
}
