//! `mateval graph check`: every fault of `.mtlx` files.

use std::path::{Path, PathBuf};

use mateval_procedural::ProceduralError;
use mateval_procedural::finding::Finding;
use mateval_procedural::limits::Limits;
use mateval_procedural::mtlx::read_file;
use mateval_scene::json;

use crate::format::Format;
use crate::outcome::{Outcome, print};
use crate::tool::TOOL;

/// Arguments of `graph check`.
#[derive(clap::Args)]
pub struct CheckArgs {
    /// The .mtlx files.
    #[arg(required = true, value_name = "FILE.mtlx")]
    files: Vec<PathBuf>,
    /// How to print the findings.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

/// Checks the files; the answer is no where one has a fault.
pub fn run(args: &CheckArgs) -> anyhow::Result<Outcome> {
    let checked = args.files.iter().map(|file| Ok((file.as_path(), findings(file)?)));
    let checked = checked.collect::<anyhow::Result<Vec<(&Path, Vec<Finding>)>>>()?;
    print(&match args.format {
        Format::Text => checked.iter().map(|(file, findings)| text(file, findings)).collect(),
        Format::Json => {
            let files = checked.iter().map(
                |(file, findings)| serde_json::json!({ "file": file.display().to_string(), "findings": findings }),
            );
            let files: Vec<_> = files.collect();
            json::to_text(&serde_json::json!({ "format": "mateval-graph-check/1", "tool": TOOL, "files": files }))
        }
    })?;
    let good = checked.iter().all(|(_, findings)| findings.is_empty());
    Ok(if good { Outcome::Good } else { Outcome::No })
}

/// A file that is refused is a result of the check; one that cannot be read is a failure to check.
fn findings(file: &Path) -> anyhow::Result<Vec<Finding>> {
    match read_file(file, &Limits::default()) {
        Ok(_) => Ok(Vec::new()),
        Err(ProceduralError::Invalid { findings, .. }) => Ok(findings),
        Err(other) => Err(other.into()),
    }
}

fn text(file: &Path, findings: &[Finding]) -> String {
    let file = file.display();
    match findings {
        [] => format!("{file}: good\n"),
        findings => findings.iter().map(|finding| format!("{file}: {finding}\n")).collect(),
    }
}
