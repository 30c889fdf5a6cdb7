//! `mateval schema`: the JSON Schemas of the format's files, made from the Rust types that read and write them.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use mateval_audit::compare::file::CompareFile;
use mateval_audit::stats::StatsFile;
use mateval_baselines::encoding_report::EncodingReport;
use mateval_baselines::import::{FlatMaterials, ImportReport};
use mateval_dataset::dataset::{DatasetFile, SceneFile, TargetsFile};
use mateval_dataset::material::MaterialClassesFile;
use mateval_dataset::reference::{LightsFile, ReferenceFile, SourceMaterialsFile};
use mateval_dataset::render_file::RenderFile;
use mateval_dataset::render_file::ScorerFile;
use mateval_dataset::submission::SubmissionFile;
use mateval_dataset::{json, render_file};
use mateval_eval::result::ResultFile;
use mateval_eval::verify::VerificationFile;
use mateval_prep::blender::{BlenderJob, BlenderResult};
use mateval_prep::survey::SurveyFile;
use mateval_release::ReleaseFile;
use mateval_report::explain::file::ExplainFile;
use mateval_report::leaderboard::entries::ErrataFile;
use mateval_report::leaderboard::file::LeaderboardFile;
use mateval_submission::lint::LintFile;
use schemars::{Schema, schema_for};

use crate::terminal::{Outcome, print};

#[derive(clap::Args)]
pub struct SchemaArgs {
    /// Folder that the schemas are written to, such as `dataset_spec/schema`.
    out: PathBuf,
    /// Replace schemas that already exist.
    #[arg(long)]
    force: bool,
}

impl SchemaArgs {
    /// Writes `NAME.schema.json` for every kind of JSON file.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let schemas = schemas().map(|(name, schema)| (self.out.join(name).with_extension("schema.json"), schema));
        if let Some((path, _)) = schemas.iter().find(|(path, _)| path.exists() && !self.force) {
            bail!("'{}' already exists; choose another folder, or add --force to overwrite it", path.display());
        }
        std::fs::create_dir_all(&self.out).with_context(|| format!("cannot create '{}'", self.out.display()))?;
        for (path, schema) in &schemas {
            json::write(path, schema)?;
            print(&format!("{}\n", path.display()))?;
        }
        Ok(Outcome::Good)
    }
}

fn schemas() -> [(&'static str, Schema); 26] {
    [
        ("dataset", schema_for!(DatasetFile)),
        ("targets", schema_for!(TargetsFile)),
        ("scene", schema_for!(SceneFile)),
        ("reference", schema_for!(ReferenceFile)),
        ("source_materials", schema_for!(SourceMaterialsFile)),
        ("lights", schema_for!(LightsFile)),
        ("material_classes", schema_for!(MaterialClassesFile)),
        ("render", schema_for!(RenderFile)),
        ("submission", schema_for!(SubmissionFile)),
        ("scorer", schema_for!(ScorerFile)),
        ("result", schema_for!(ResultFile)),
        ("explain", schema_for!(ExplainFile)),
        ("verification", schema_for!(VerificationFile)),
        ("lint", schema_for!(LintFile)),
        ("leaderboard", schema_for!(LeaderboardFile)),
        ("errata", schema_for!(ErrataFile)),
        ("stats", schema_for!(StatsFile)),
        ("release", schema_for!(ReleaseFile)),
        ("survey", schema_for!(SurveyFile)),
        ("blender_job", schema_for!(BlenderJob)),
        ("blender_result", schema_for!(BlenderResult)),
        ("compare", schema_for!(CompareFile)),
        ("compare_verdict", schema_for!(render_file::CompareFile)),
        ("encoding", schema_for!(EncodingReport)),
        ("import", schema_for!(ImportReport)),
        ("import_materials", schema_for!(FlatMaterials)),
    ]
}
