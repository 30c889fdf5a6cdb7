//! What the arguments of several commands name: a dataset, an output file, how a result is printed, where a baseline
//! reads and writes, and the estimate that it starts from.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mateval_baselines::adapter::Adapter;
use mateval_baselines::delight::CandidateLights;
use mateval_baselines::estimate_source::EstimateSource;
use mateval_dataset::open::Dataset;
use mateval_dataset::word_enum::UnknownWord;
use mateval_submission::SubmissionError;
use mateval_submission::archive::{self, Opened};

use crate::terminal::{Outcome, counted, print, say};

/// For people or for programs.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Lines for people; numbers are rounded.
    Text,
    /// One JSON document with exact numbers.
    Json,
}

/// Opens the dataset in `root`, and says so where scenes of it are absent.
pub fn open_dataset(root: &Path) -> anyhow::Result<Dataset> {
    let dataset = Dataset::open(root).context("cannot open the dataset")?;
    if let Some(absence) = dataset.absence() {
        say(&absence);
    }
    Ok(dataset)
}

/// Opens a submission; an archive is unpacked to a temporary folder, which goes with the value.
pub fn open_submission(path: &Path) -> Result<Opened, SubmissionError> {
    archive::open(path, &std::env::temp_dir())
}

/// Fails where no file can be written to `path`, the value of `flag`; `kind` names the file in messages.
pub fn check_output_file(path: &Path, flag: &str, kind: &str, force: bool) -> anyhow::Result<()> {
    let shown = path.display();
    if !path.parent().is_some_and(|folder| folder.as_os_str().is_empty() || folder.is_dir()) {
        bail!("the folder of '{shown}' does not exist; make it, or choose another {flag}");
    }
    if path.is_dir() {
        bail!("'{shown}' is a folder; expected the name of a {kind} file");
    }
    if path.exists() && !force {
        bail!("'{shown}' already exists; choose another {flag}, or add --force to overwrite it");
    }
    Ok(())
}

/// Arguments of every baseline that writes a submission.
#[derive(clap::Args)]
pub struct Places {
    /// Folder of the dataset.
    #[arg(long)]
    pub dataset: PathBuf,
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
    pub dataset: PathBuf,
    /// Folder for the files; must not exist yet.
    #[arg(long)]
    pub out: PathBuf,
}

impl Places {
    /// Prints where the submission is and how many instances it covers.
    pub fn done(&self, instances: usize) -> anyhow::Result<Outcome> {
        print(&format!("{}: {}\n", self.out.display(), counted(instances, "instance")))?;
        Ok(Outcome::Good)
    }
}

/// Opens the dataset in `root` as methods see it.
pub fn open_with_twins(root: &Path) -> anyhow::Result<Dataset> {
    Ok(open_dataset(root)?.with_twins())
}

/// Opens the dataset in `root`, and says which of the estimate's files are read for it and what may be wrong with them.
pub fn open_for(root: &Path, source: &EstimateSource) -> anyhow::Result<Dataset> {
    let dataset = open_with_twins(root)?;
    if let Some(text) = source.files_read(&dataset) {
        say(&text);
    }
    source.remarks(&dataset)?.iter().for_each(|text| say(&format!("warning: {text}")));
    Ok(dataset)
}

/// An estimate and the format of its files.
#[derive(clap::Args)]
pub struct EstimateArgs {
    /// Estimate of base colour, roughness and metallic in the input view: `gt` (the ground truth), `input` (the input
    /// picture as base colour), `delight` (the input picture without its light), or a folder of a method's pictures
    /// [default: gt for nn and texgen-export, input for median, delight for procedural].
    #[arg(long, value_name = "gt|input|delight|FOLDER")]
    estimate: Option<PathBuf>,
    /// Names and encodings of the folder's files: colorful-shading, crefnet, delight, diffusion-renderer,
    /// dnf-intrinsic, iid, intrinsic, marigold, materialist, mvinverse, ouroboros, plain, rgbx, or a TOML file like
    /// those in crates/baselines/adapters [default: plain].
    #[arg(long, value_name = "NAME|FILE.toml")]
    adapter: Option<String>,
}

impl EstimateArgs {
    pub fn is_given(&self) -> bool {
        self.estimate.is_some()
    }

    /// The chosen source; `default` if none was given. For a folder it prints the encodings by which files are read,
    /// because maps that are read by a wrong one are valid too.
    pub fn source(&self, default: EstimateSource) -> anyhow::Result<EstimateSource> {
        let named = self.estimate.as_ref().map(|path| path.to_string_lossy());
        let source = match (named.as_deref(), &self.adapter) {
            (None, None) => default,
            (Some("gt"), None) => EstimateSource::Truth,
            (Some("input"), None) => EstimateSource::Input,
            (Some("delight"), None) => EstimateSource::Delight(CandidateLights::Room),
            (Some("gt" | "input" | "delight") | None, Some(_)) => {
                bail!("--adapter describes the files of a folder; give --estimate FOLDER")
            }
            (Some(folder), adapter) => {
                let adapter = Box::new(Adapter::find(adapter.as_deref().unwrap_or("plain"))?);
                let folder = PathBuf::from(folder);
                if !folder.is_dir() {
                    let shown = folder.display();
                    bail!(
                        "--estimate '{shown}' does not exist; expected gt, input, delight or a folder of a method's pictures"
                    );
                }
                say(&format!(
                    "'{}': the adapter '{}' reads {}; `mateval baseline encoding` checks this where the ground truth is at \
                     hand",
                    folder.display(),
                    adapter.name,
                    adapter.encodings()
                ));
                EstimateSource::Files { folder, adapter }
            }
        };
        Ok(source)
    }
}

/// Reads one of the words of an enum. `listed` gives each word and its line in the help.
pub fn word_parser<T>(all: &[T], listed: fn(&T) -> (&'static str, &'static str)) -> impl TypedValueParser<Value = T>
where
    T: std::str::FromStr<Err = UnknownWord> + Clone + Send + Sync + 'static,
{
    let words = all.iter().map(listed).map(|(word, help)| PossibleValue::new(word).help(help));
    PossibleValuesParser::new(words).try_map(|word| word.parse::<T>())
}
