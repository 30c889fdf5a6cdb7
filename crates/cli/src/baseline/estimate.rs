//! Arguments that choose the estimate of the input view which a baseline starts from.

use std::path::PathBuf;

use anyhow::bail;
use mateval_baselines::adapter::Adapter;
use mateval_baselines::delight::CandidateLights;
use mateval_baselines::estimate_source::EstimateSource;

use crate::outcome::say;

/// An estimate and the format of its files.
#[derive(clap::Args)]
pub struct EstimateArgs {
    /// Estimate of base colour, roughness and metallic in the input view: `gt` (the ground truth), `input` (the input
    /// picture as base colour), `delight` (the input picture without its light), or a folder of a method's pictures
    /// [default: gt for nn and texgen-export, input for median and median-part, delight for procedural].
    #[arg(long, value_name = "gt|input|delight|FOLDER")]
    estimate: Option<PathBuf>,
    /// Names and encodings of the folder's files: colorful-shading, crefnet, delight, diffusion-renderer, dnf-intrinsic,
    /// iid, intrinsic, marigold, materialist, mvinverse, ouroboros, plain, rgbx, or a TOML file like those in
    /// crates/baselines/adapters [default: plain].
    #[arg(long, value_name = "NAME|FILE.toml")]
    adapter: Option<String>,
}

impl EstimateArgs {
    /// Whether `--estimate` was given.
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
