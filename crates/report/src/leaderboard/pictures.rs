//! The pictures of a site: copied from a folder, kept while scoring, or drawn from the dataset and the submissions.
//!
//! They are a set of single pictures, `<method>/<scene>/<view>/<kind>.png`, the truth's under `_truth`. A kind is any
//! word, as in `albedo` or `rgb_true`; `<kind>-error` shows the errors of a prediction of that kind.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::{Progress, Report, SceneId, ViewId};
use mateval_eval::error::EvalError;
use mateval_eval::metric::PictureKind;
use mateval_eval::result::ResultFile;
use mateval_eval::scene::SeenLight;
use mateval_eval::truth::scored_views;
use mateval_files::FileError;
use mateval_files::work_folder::make_folder;
use mateval_image::transfer::byte_from_unit;
use mateval_image::{Mask, Picture, SrgbRgb, png_io};
use mateval_submission::files::HashedFiles;
use serde::Serialize;

use super::entries::{LeaderboardPlan, Submissions};
use crate::error::ReportError;
use crate::ranking::file::{RankedMethod, Ranking};
use crate::ranking::method_id;
use crate::strips::{StripPlan, error_map, errors, rows};

/// The folder of the truth's pictures; no id of a method begins with an underscore.
pub(super) const TRUTH: &str = "_truth";

/// The suffix of kinds that show errors.
pub(super) const ERROR: &str = "-error";

/// A submission and the method that it belongs to.
pub(super) struct NamedSubmission<'a> {
    pub(super) id: String,
    pub(super) folder: &'a Path,
    /// Scenes of the board that were not scored.
    not_scored: Vec<SceneId>,
}

impl NamedSubmission<'_> {
    /// Whether the method was scored on the scene.
    pub(super) fn covers(&self, scene: &SceneId) -> bool {
        !self.not_scored.contains(scene)
    }
}

/// The given submissions, once for each method whose result states the submission's hash. Fails for a submission that
/// no result states.
pub(super) fn named<'a>(
    plan: &'a LeaderboardPlan<'_>,
    ranking: &Ranking,
) -> Result<Vec<NamedSubmission<'a>>, ReportError> {
    let mut named = Vec::new();
    let Some(from) = &plan.submissions else { return Ok(named) };
    for folder in &from.folders {
        let files = HashedFiles::read(folder, from.dataset, &ranking.scenes)?;
        let is_of = |method: &&RankedMethod| {
            files.over(|scene| !method.not_scored.contains(scene)).sha256 == method.submission_sha256
        };
        let before = named.len();
        named.extend(ranking.methods.iter().filter(is_of).map(|method| NamedSubmission {
            id: method.id.clone(),
            folder,
            not_scored: method.not_scored.clone(),
        }));
        if named.len() == before {
            return Err(ReportError::UnscoredSubmission { path: folder.clone() });
        }
    }
    Ok(named)
}

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
        draw(submissions, named, ranking, folder, progress)?;
    }
    if folder.is_dir() { PictureSet::list(folder) } else { Ok(PictureSet::default()) }
}

fn draw(
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
        write(&plan, &names, scene, progress)?;
    }
    Ok(())
}

/// The path of a picture in a set.
pub(super) fn place(set: &Path, method: &str, scene: &SceneId, view: &ViewId, kind: &str) -> PathBuf {
    set.join(method).join(scene.as_str()).join(view.as_str()).join(format!("{kind}.png"))
}

/// Writes the pictures of one scene and their errors; `names` are the folders of the plan's submissions. Invalid
/// pixels are black.
fn write(plan: &StripPlan<'_>, names: &[&str], scene: &SceneFile, progress: Progress<'_>) -> Result<(), ReportError> {
    let views = scored_views(plan.dataset, scene)?;
    for shown in plan.shown_of(scene) {
        for (view, row) in views.iter().zip(rows(plan, scene, shown, progress)?) {
            let write = |method: &str, kind: &str, picture: &Picture<[u8; 3]>| -> Result<(), ReportError> {
                let path = place(plan.out, method, &scene.id, &view.id, kind);
                let folder = path.parent().unwrap_or(plan.out);
                make_folder(folder)?;
                Ok(png_io::write_rgb_bytes(&path, picture)?)
            };
            for (method, picture) in std::iter::once(&TRUTH).chain(names).zip(&row.shown) {
                write(method, shown.kind().word(), &black_where_invalid(&row.truth.valid, picture))?;
            }
            for (method, error) in names.iter().zip(errors(&row)) {
                write(method, &format!("{}{ERROR}", shown.kind()), &error)?;
            }
        }
    }
    Ok(())
}

fn black_where_invalid(valid: &Mask, picture: &Picture<SrgbRgb>) -> Picture<[u8; 3]> {
    Picture::from_fn(picture.width(), picture.height(), |x, y| match valid.get(x, y) {
        true => picture.get(x, y).0.map(byte_from_unit),
        false => [0; 3],
    })
}

/// Puts what a score compares in a view under light into a set: the truth's picture, the method's and its errors. A board that gets
/// the set has no paths to trace again. `method` is the name in
/// `submission.json`; names must give different ids.
pub fn keep_seen(set: &Path, method: &str, seen: &SeenLight<'_>) -> Result<(), EvalError> {
    let id = method_id(method);
    let errors = error_map(&seen.prediction.map(|p| p.0), &seen.reference.map(|p| p.0), seen.valid);
    let pictures = [
        (TRUTH, seen.kind.to_string(), black_where_invalid(seen.valid, seen.reference)),
        (&id, seen.kind.to_string(), black_where_invalid(seen.valid, seen.prediction)),
        (&id, format!("{}{ERROR}", seen.kind), errors),
    ];
    for (id, kind, picture) in pictures {
        let path = place(set, id, seen.scene, seen.view, &kind);
        let folder = path.parent().unwrap_or(set);
        make_folder(folder)?;
        png_io::write_rgb_bytes(&path, &picture)?;
    }
    Ok(())
}

/// Fails where results are of a hidden split and the set shows its truth, which everybody who opens the site would see.
/// Pictures of errors count: beside the prediction they narrow the truth down.
pub fn check_may_be_shown(set: &Path, results: &[ResultFile]) -> Result<(), ReportError> {
    if !results.iter().any(|result| result.dataset.withheld.is_some()) {
        return Ok(());
    }
    for ([method, scene, view], kinds) in &PictureSet::list(set)?.kinds {
        if let Some(kind) = kinds.iter().find(|kind| method == TRUTH || kind.ends_with(ERROR)) {
            let path = set.join(method).join(scene).join(view).join(format!("{kind}.png"));
            return Err(ReportError::PictureOfHiddenTruth { path });
        }
    }
    Ok(())
}

/// The kinds of pictures that exist, by method, scene and view.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct PictureSet {
    kinds: BTreeMap<[String; 3], BTreeSet<String>>,
}

impl PictureSet {
    /// Lists the pictures in a folder. Names that are not ids and files that are not PNG are skipped; links are not
    /// followed.
    pub(super) fn list(set: &Path) -> Result<Self, ReportError> {
        let mut found = Self::default();
        for method in folders(set)? {
            for scene in folders(&set.join(&method))? {
                for view in folders(&set.join(&method).join(&scene))? {
                    let kinds = pngs(&set.join(&method).join(&scene).join(&view))?;
                    if !kinds.is_empty() {
                        found.kinds.insert([method.clone(), scene.clone(), view], kinds);
                    }
                }
            }
        }
        Ok(found)
    }

    /// The kinds of one method's pictures of a view, sorted.
    pub(super) fn kinds(&self, method: &str, scene: &SceneId, view: &str) -> Vec<&str> {
        let key = [method, scene.as_str(), view].map(str::to_owned);
        self.kinds.get(&key).into_iter().flatten().map(String::as_str).collect()
    }

    /// The views of a scene that any method has a picture of.
    pub(super) fn views(&self, scene: &SceneId) -> BTreeSet<&str> {
        self.kinds.keys().filter(|[_, of, _]| of == scene.as_str()).map(|[_, _, view]| view.as_str()).collect()
    }

    /// Copies all pictures from one folder to another.
    pub(super) fn copy(&self, from: &Path, to: &Path) -> Result<(), ReportError> {
        for ([method, scene, view], kinds) in &self.kinds {
            let folder = Path::new(method).join(scene).join(view);
            make_folder(&to.join(&folder))?;
            for kind in kinds {
                let file = folder.join(format!("{kind}.png"));
                std::fs::copy(from.join(&file), to.join(&file)).map_err(FileError::io("copy", &from.join(&file)))?;
            }
        }
        Ok(())
    }
}

/// Whether a name is safe in paths and links.
fn is_word(name: &str) -> bool {
    let is_safe = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    !name.is_empty() && name.len() <= 64 && name.chars().all(is_safe)
}

fn folders(path: &Path) -> Result<Vec<String>, ReportError> {
    let names = entries(path)?.into_iter().filter(|(name, kind)| kind.is_dir() && is_word(name));
    Ok(names.map(|(name, _)| name).collect())
}

fn pngs(path: &Path) -> Result<BTreeSet<String>, ReportError> {
    let files = entries(path)?.into_iter().filter(|(_, kind)| kind.is_file());
    let stems = files.filter_map(|(name, _)| name.strip_suffix(".png").map(str::to_owned));
    Ok(stems.filter(|stem| is_word(stem)).collect())
}

fn entries(path: &Path) -> Result<Vec<(String, std::fs::FileType)>, ReportError> {
    let io = |source| FileError::io("read", path)(source);
    let mut found = Vec::new();
    for entry in std::fs::read_dir(path).map_err(io)? {
        let entry = entry.map_err(io)?;
        if let Ok(name) = entry.file_name().into_string() {
            found.push((name, entry.file_type().map_err(io)?));
        }
    }
    found.sort_by(|(a, _), (b, _)| a.cmp(b));
    Ok(found)
}

/// Width and height of a PNG, from its header; none if the file is not a PNG.
pub(super) fn png_size(path: &Path) -> Option<[u32; 2]> {
    let mut head = [0; 24];
    std::fs::File::open(path).ok()?.read_exact(&mut head).ok()?;
    let number = |at: usize| Some(u32::from_be_bytes(head[at..at + 4].try_into().ok()?));
    head.starts_with(b"\x89PNG\r\n\x1a\n").then_some([number(16)?, number(20)?])
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
