//! `mateval eval tables`: tables of several results.

use std::io::IsTerminal as _;
use std::path::PathBuf;

use mateval_eval::result::ResultFile;
use mateval_report::tables::{Grouping, TableFormat, tables};

use crate::outcome::{Outcome, print, say};

/// Arguments of `eval tables`.
#[derive(clap::Args)]
pub struct TablesArgs {
    /// RESULT.json files.
    #[arg(required = true, value_name = "RESULT.json")]
    results: Vec<PathBuf>,
    /// RESULT.json of the truth itself (`mateval baseline gt`), shown in the last row as the ceiling of each column.
    #[arg(long, value_name = "RESULT.json")]
    ceiling: Option<PathBuf>,
    /// Protocol whose scores are shown.
    #[arg(long, default_value = "mateval-3")]
    protocol: String,
    /// Format of the tables.
    #[arg(long, value_enum, default_value = "markdown")]
    format: FormatName,
    /// One row per scene, or per category of instances, whose errors are pooled over all their pixels [default: one row
    /// per result, over the whole dataset].
    #[arg(long, value_enum)]
    by: Option<GroupName>,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum GroupName {
    Scene,
    Category,
    SuperCategory,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FormatName {
    Markdown,
    Latex,
    Csv,
    Text,
}

/// Prints the tables, and a warning for each metric that a result lacks.
pub fn run(args: &TablesArgs) -> anyhow::Result<Outcome> {
    let results = args.results.iter().map(|path| ResultFile::read(path)).collect::<Result<Vec<_>, _>>()?;
    let format = match args.format {
        FormatName::Markdown => TableFormat::Markdown,
        FormatName::Latex => TableFormat::Latex,
        FormatName::Csv => TableFormat::Csv,
        FormatName::Text => TableFormat::Text { bold: std::io::stdout().is_terminal() },
    };
    let grouping = match args.by {
        None => Grouping::Dataset,
        Some(GroupName::Scene) => Grouping::Scene,
        Some(GroupName::Category) => Grouping::Category,
        Some(GroupName::SuperCategory) => Grouping::SuperCategory,
    };
    let ceiling = args.ceiling.as_deref().map(ResultFile::read).transpose()?;
    print(&tables(&results, ceiling.as_ref(), &args.protocol, grouping, format)?)?;
    for result in results.iter().chain(&ceiling) {
        for missing in &result.missing {
            say(&format!(
                "warning: '{}': {} is missing: {}; run: {}",
                result.method, missing.metric, missing.reason, missing.fix
            ));
        }
    }
    Ok(Outcome::Good)
}
