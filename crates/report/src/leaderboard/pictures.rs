//! The pictures of a site: copied from a folder, or drawn from the dataset and the submissions.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_scene::Progress;
use mateval_scene::open::Dataset;
use serde::Serialize;

use super::plan::{LeaderboardPlan, Submissions};
use crate::error::ReportError;
use crate::picture_set::{self, ERROR, PictureSet};
use crate::ranking::file::Ranking;
use crate::strips::StripPlan;
use mateval_eval::result_key::PictureKind;
use mateval_submission::hashed_submission::hashed_submission;

/// Puts all pictures into `folder`, and lists them.
pub(super) fn gather(
    plan: &LeaderboardPlan<'_>,
    ranking: &Ranking,
    folder: &Path,
    progress: Progress<'_>,
) -> Result<PictureSet, ReportError> {
    if let Some(set) = plan.pictures {
        PictureSet::list(set)?.copy(set, folder)?;
    }
    if let Some(submissions) = &plan.submissions {
        make(submissions, ranking, folder, progress)?;
    }
    if folder.is_dir() { PictureSet::list(folder) } else { Ok(PictureSet::default()) }
}

fn make(from: &Submissions<'_>, ranking: &Ranking, folder: &Path, progress: Progress<'_>) -> Result<(), ReportError> {
    let named = name_submissions(from.dataset, &from.folders, ranking)?;
    let (names, submissions): (Vec<&str>, Vec<&Path>) = named.iter().map(|(id, path)| (id.as_str(), *path)).unzip();
    let plan = StripPlan {
        dataset: from.dataset,
        submissions: &submissions,
        scenes: &ranking.scenes,
        shown: &from.shown,
        out: folder,
        force: false,
    };
    let scenes: Vec<_> = from.dataset.scenes.iter().filter(|scene| ranking.scenes.contains(&scene.id)).collect();
    for (done, scene) in scenes.iter().enumerate() {
        progress("pictures", done, scenes.len());
        picture_set::write(&plan, &names, scene, progress)?;
    }
    Ok(())
}

/// Each submission with the ids of its methods, which have its hash. Fails for a submission that belongs to none.
fn name_submissions<'a>(
    dataset: &Dataset,
    submissions: &'a [PathBuf],
    ranking: &Ranking,
) -> Result<Vec<(String, &'a Path)>, ReportError> {
    let mut named = Vec::new();
    for path in submissions {
        let mut ids = Vec::new();
        for method in &ranking.methods {
            let scored: Vec<_> =
                ranking.scenes.iter().filter(|scene| !method.not_scored.contains(scene)).cloned().collect();
            if hashed_submission(path, dataset, &scored)?.sha256 == method.submission_sha256 {
                ids.push((method.id.clone(), path.as_path()));
            }
        }
        if ids.is_empty() {
            return Err(ReportError::UnscoredSubmission { path: path.clone() });
        }
        named.extend(ids);
    }
    Ok(named)
}

/// A kind of picture that a page offers.
#[derive(Serialize)]
pub(super) struct Kind {
    /// The stem of its files.
    word: String,
    title: String,
    /// The stem of the files that show its errors; none for errors themselves.
    error: Option<String>,
}

/// The kinds of pictures with these words as stems: those that results have first, each followed by its errors.
pub(super) fn kinds_in_order(words: BTreeSet<&str>) -> Vec<Kind> {
    let place = |kind: PictureKind| PictureKind::ALL.iter().position(|known| *known == kind);
    let kind = |word: &str| {
        let stem = word.strip_suffix(ERROR).unwrap_or(word);
        let known = stem.parse::<PictureKind>().ok();
        let title = known.map_or_else(|| stem.replace('_', " "), |kind| kind.title().to_owned());
        let is_error = stem != word;
        let order = (known.and_then(place).unwrap_or(PictureKind::ALL.len()), stem.to_owned(), is_error);
        let title = if is_error { format!("{title}: error") } else { title };
        (order, Kind { word: word.to_owned(), title, error: (!is_error).then(|| format!("{word}{ERROR}")) })
    };
    let mut kinds: Vec<_> = words.into_iter().map(kind).collect();
    kinds.sort_by(|a, b| a.0.cmp(&b.0));
    kinds.into_iter().map(|(_, kind)| kind).collect()
}
