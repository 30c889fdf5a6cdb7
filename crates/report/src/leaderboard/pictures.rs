//! The pictures of a site: copied from a folder, or drawn from the dataset and the submissions.

use std::collections::BTreeSet;
use std::path::Path;

use mateval_scene::{Progress, Report};
use serde::Serialize;

use super::named_submission::NamedSubmission;
use super::plan::{LeaderboardPlan, Submissions};
use crate::error::ReportError;
use crate::picture_set::{self, ERROR, PictureSet};
use crate::ranking::file::Ranking;
use crate::strips::StripPlan;
use mateval_eval::result_key::PictureKind;

/// Puts all pictures into `folder`, and lists them.
pub(super) fn gather(
    plan: &LeaderboardPlan<'_>,
    named: &[NamedSubmission<'_>],
    ranking: &Ranking,
    folder: &Path,
    progress: Progress<'_>,
) -> Result<PictureSet, ReportError> {
    if let Some(set) = plan.pictures {
        PictureSet::list(set)?.copy(set, folder)?;
    }
    if let Some(submissions) = &plan.submissions {
        make(submissions, named, ranking, folder, progress)?;
    }
    if folder.is_dir() { PictureSet::list(folder) } else { Ok(PictureSet::default()) }
}

fn make(
    from: &Submissions<'_>,
    named: &[NamedSubmission<'_>],
    ranking: &Ranking,
    folder: &Path,
    progress: Progress<'_>,
) -> Result<(), ReportError> {
    let scenes = from.ranked_scenes(ranking);
    for (done, scene) in scenes.iter().enumerate() {
        progress(Report::step("pictures", done, scenes.len()));
        let shown = named.iter().filter(|submission| submission.covers(&scene.id));
        let (names, submissions): (Vec<&str>, Vec<&Path>) =
            shown.map(|submission| (submission.id.as_str(), submission.folder)).unzip();
        let plan = StripPlan {
            dataset: from.dataset,
            submissions: &submissions,
            scenes: &ranking.scenes,
            shown: &from.shown,
            out: folder,
            force: false,
        };
        picture_set::write(&plan, &names, scene, progress)?;
    }
    Ok(())
}

/// A kind of picture that a page offers.
#[derive(Clone, Serialize)]
pub(super) struct Kind {
    /// The stem of its files.
    pub(super) word: String,
    title: String,
    /// The stem of the files that show its errors; none for errors themselves.
    pub(super) error: Option<String>,
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
