//! `mateval prep verify`: checks a dataset.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_scene::{Severity, json};

use crate::bars::with_progress;
use crate::format::Format;
use crate::outcome::{Outcome, print};
use crate::tool::TOOL;

/// Arguments of `prep verify`.
#[derive(clap::Args)]
pub struct VerifyArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// How to print the findings.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

/// Checks the dataset and prints all findings.
pub fn run(args: &VerifyArgs) -> anyhow::Result<Outcome> {
    let findings = with_progress(|progress| mateval_audit::verify::verify(&args.dataset, progress))
        .with_context(|| format!("cannot verify '{}'", args.dataset.display()))?;
    let errors = findings.iter().filter(|finding| finding.severity == Severity::Error).count();
    match args.format {
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
            print(&format!("{}: {verdict}, {errors} errors\n", args.dataset.display()))?;
        }
    }
    Ok(if errors == 0 { Outcome::Good } else { Outcome::No })
}
