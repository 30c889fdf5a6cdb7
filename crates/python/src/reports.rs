//! `mateval.lint` and `mateval.score`: the command's reports as JSON texts, which Python parses.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context as _;
use mateval_cli::{TOOL, find_weights};
use mateval_eval::protocol::Protocol;
use mateval_eval::score::ScorePlan;
use mateval_metrics::Net;
use mateval_scene::open::Dataset as OpenDataset;
use mateval_scene::{Progress, SceneId, json};
use mateval_submission::SubmissionError;
use mateval_submission::archive;
use mateval_submission::lint::{LintFile, LintPlan, lint as check, plain, refused};
use pyo3::prelude::*;

use crate::dataset::{Dataset, scene_place};
use crate::failure::failed;
use crate::long_work::run_long;

/// Checks a submission, a folder or an archive. Returns the report as JSON, and as text for people.
#[pyfunction]
pub fn lint(py: Python<'_>, submission: PathBuf, dataset: &Dataset) -> PyResult<(String, String)> {
    let dataset = Arc::clone(&dataset.0);
    let checked = run_long(py, move |progress| lint_file(&dataset, &submission, progress))?;
    let file = checked.context("cannot check the submission").map_err(failed)?;
    Ok((json::to_text(&file), plain(&file)))
}

fn lint_file(dataset: &OpenDataset, submission: &Path, progress: Progress<'_>) -> Result<LintFile, SubmissionError> {
    let opened = match archive::open(submission, &std::env::temp_dir()) {
        // An unsound archive is a result of the check, not a failure to check.
        Err(SubmissionError::Archive { findings, .. }) => return Ok(refused(dataset, TOOL, findings)),
        opened => opened?,
    };
    check(&LintPlan { dataset, submission: opened.root(), tool: TOOL.to_owned() }, progress)
}

/// Scores a submission, a folder or an archive. Returns the result as JSON.
#[pyfunction]
#[pyo3(signature = (submission, dataset, *, scenes, protocol, cache))]
pub fn score(
    py: Python<'_>,
    submission: PathBuf,
    dataset: &Dataset,
    scenes: Vec<String>,
    protocol: &str,
    cache: Option<PathBuf>,
) -> PyResult<String> {
    let dataset = Arc::clone(&dataset.0);
    scenes.iter().try_for_each(|id| scene_place(&dataset, id).map(drop))?;
    let task = ScoreTask {
        dataset,
        submission,
        scenes: scenes.into_iter().map(SceneId::new).collect::<Result<_, _>>().map_err(failed)?,
        protocol: Protocol::named(protocol).map_err(failed)?,
        cache,
    };
    run_long(py, move |progress| task.run(progress))?.map_err(failed)
}

struct ScoreTask {
    dataset: Arc<OpenDataset>,
    submission: PathBuf,
    scenes: Vec<SceneId>,
    protocol: Protocol,
    cache: Option<PathBuf>,
}

impl ScoreTask {
    /// The result as the command writes it.
    fn run(self, progress: Progress<'_>) -> anyhow::Result<String> {
        let opened = archive::open(&self.submission, &std::env::temp_dir())?;
        if let Some(cache) = &self.cache {
            std::fs::create_dir_all(cache).with_context(|| format!("cannot create '{}'", cache.display()))?;
        }
        let plan = ScorePlan {
            dataset: &self.dataset,
            submissions: vec![opened.root()],
            protocols: vec![self.protocol],
            scenes: self.scenes,
            lpips: find_weights(Net::Alex),
            tool: TOOL.to_owned(),
            // Threads of the scorer's own would work in rayon's global pool.
            jobs: 1,
            cache: self.cache.as_deref(),
            only_cached: false,
            pictures: None,
        };
        let results = mateval_eval::score::score(&plan, progress).context("cannot score")?;
        Ok(results.iter().map(json::to_lines).collect())
    }
}
