//! `mateval eval explain`: where the albedo of one scene is wrong, and how.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_eval::result::ResultFile;
use mateval_report::explain::{self, ExplainPlan};
use mateval_scene::open::Dataset;
use mateval_scene::{SceneId, json};

use crate::bars::with_progress;
use crate::format::Format;
use crate::outcome::{Outcome, print, say};
use crate::tool::TOOL;

/// Arguments of `eval explain`.
#[derive(clap::Args)]
pub struct ExplainArgs {
    /// The RESULT.json file.
    #[arg(value_name = "RESULT.json")]
    result: PathBuf,
    /// The scene to explain.
    #[arg(long)]
    scene: SceneId,
    /// Folder of the dataset that the result was scored on.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder of the submission that was scored.
    #[arg(long)]
    submission: PathBuf,
    /// Protocol whose scores are explained.
    #[arg(long, default_value = "mateval-3")]
    protocol: String,
    /// Folder for explain.md and pictures of the ten worst instances.
    #[arg(long)]
    out: Option<PathBuf>,
    /// How to print the explanation.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Replace files that already exist.
    #[arg(long)]
    force: bool,
}

/// Explains the scene's errors.
pub fn run(args: &ExplainArgs) -> anyhow::Result<Outcome> {
    args.out.iter().try_for_each(|out| explain::check_out(out, args.force))?;
    let result = ResultFile::read(&args.result)?;
    let dataset = Dataset::open(&args.dataset).context("cannot open the dataset")?;
    let plan = ExplainPlan {
        result: &result,
        protocol: &args.protocol,
        dataset: &dataset,
        submission: &args.submission,
        scene: &args.scene,
        tool: TOOL.to_owned(),
    };
    let found = with_progress(|progress| explain::explain(&plan, progress)).context("cannot explain")?;
    if let Some(out) = &args.out {
        for path in found.write(out, args.force)? {
            say(&format!("wrote '{}'", path.display()));
        }
    }
    print(&match args.format {
        Format::Json => json::to_text(&found.file),
        Format::Text => explain::text::plain(&found.file),
    })?;
    Ok(Outcome::Good)
}
