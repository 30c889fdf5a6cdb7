//! A set of single pictures, as a leaderboard shows them: `<method>/<scene>/<view>/<kind>.png`, the truth's under
//! `_truth`.
//!
//! A kind is any word, as in `albedo` or `rgb_true`; `<kind>-error` shows the errors of a prediction of that kind.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use mateval_image::transfer::byte_from_unit;
use mateval_image::{Picture, SrgbRgb, png_io};
use mateval_scene::dataset::SceneFile;
use mateval_scene::{Progress, SceneError, SceneId, ViewId};

use crate::error::ReportError;
use crate::strips::{StripPlan, StripRow, errors, rows};
use mateval_eval::open_scene::scored_views;

/// The folder of the truth's pictures; no id of a method begins with an underscore.
pub const TRUTH: &str = "_truth";

/// The suffix of kinds that show errors.
pub const ERROR: &str = "-error";

/// The path of a picture in a set.
pub fn place(set: &Path, method: &str, scene: &SceneId, view: &ViewId, kind: &str) -> PathBuf {
    set.join(method).join(scene.as_str()).join(view.as_str()).join(format!("{kind}.png"))
}

/// Writes the pictures of one scene and their errors; `names` are the folders of the plan's submissions. Invalid
/// pixels are black.
pub fn write(
    plan: &StripPlan<'_>,
    names: &[&str],
    scene: &SceneFile,
    progress: Progress<'_>,
) -> Result<(), ReportError> {
    let views = scored_views(plan.dataset, scene)?;
    for shown in plan.shown_of(scene) {
        for (view, row) in views.iter().zip(rows(plan, scene, shown, progress)?) {
            let write = |method: &str, kind: &str, picture: &Picture<[u8; 3]>| -> Result<(), ReportError> {
                let path = place(plan.out, method, &scene.id, &view.id, kind);
                let folder = path.parent().unwrap_or(plan.out);
                std::fs::create_dir_all(folder).map_err(SceneError::io("make", folder))?;
                Ok(png_io::write_rgb_bytes(&path, picture)?)
            };
            for (method, picture) in std::iter::once(&TRUTH).chain(names).zip(&row.shown) {
                write(method, shown.kind().word(), &black_where_invalid(&row, picture))?;
            }
            for (method, error) in names.iter().zip(errors(&row)) {
                write(method, &format!("{}{ERROR}", shown.kind()), &error)?;
            }
        }
    }
    Ok(())
}

fn black_where_invalid(row: &StripRow, picture: &Picture<SrgbRgb>) -> Picture<[u8; 3]> {
    Picture::from_fn(picture.width(), picture.height(), |x, y| match row.truth.valid.get(x, y) {
        true => picture.get(x, y).0.map(byte_from_unit),
        false => [0; 3],
    })
}

/// The kinds of pictures that exist, by method, scene and view.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PictureSet {
    kinds: BTreeMap<[String; 3], BTreeSet<String>>,
}

impl PictureSet {
    /// Lists the pictures in a folder. Names that are not ids and files that are not PNG are skipped; links are not
    /// followed.
    pub fn list(set: &Path) -> Result<Self, ReportError> {
        let mut found = Self::default();
        for method in folders(set)? {
            for scene in folders(&set.join(&method))? {
                for view in folders(&set.join(&method).join(&scene))? {
                    let kinds = pictures(&set.join(&method).join(&scene).join(&view))?;
                    if !kinds.is_empty() {
                        found.kinds.insert([method.clone(), scene.clone(), view], kinds);
                    }
                }
            }
        }
        Ok(found)
    }

    /// The kinds of one method's pictures of a view, sorted.
    pub fn kinds(&self, method: &str, scene: &SceneId, view: &str) -> Vec<&str> {
        let key = [method, scene.as_str(), view].map(str::to_owned);
        self.kinds.get(&key).into_iter().flatten().map(String::as_str).collect()
    }

    /// The views of a scene that any method has a picture of.
    pub fn views(&self, scene: &SceneId) -> BTreeSet<&str> {
        self.kinds.keys().filter(|[_, of, _]| of == scene.as_str()).map(|[_, _, view]| view.as_str()).collect()
    }

    /// Copies all pictures from one folder to another.
    pub fn copy(&self, from: &Path, to: &Path) -> Result<(), ReportError> {
        for ([method, scene, view], kinds) in &self.kinds {
            let folder = Path::new(method).join(scene).join(view);
            std::fs::create_dir_all(to.join(&folder)).map_err(SceneError::io("make", &to.join(&folder)))?;
            for kind in kinds {
                let file = folder.join(format!("{kind}.png"));
                std::fs::copy(from.join(&file), to.join(&file)).map_err(SceneError::io("copy", &from.join(&file)))?;
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

fn pictures(path: &Path) -> Result<BTreeSet<String>, ReportError> {
    let files = entries(path)?.into_iter().filter(|(_, kind)| kind.is_file());
    let stems = files.filter_map(|(name, _)| name.strip_suffix(".png").map(str::to_owned));
    Ok(stems.filter(|stem| is_word(stem)).collect())
}

fn entries(path: &Path) -> Result<Vec<(String, std::fs::FileType)>, ReportError> {
    let io = |source| SceneError::io("read", path)(source);
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
pub(crate) fn png_size(path: &Path) -> Option<[u32; 2]> {
    let mut head = [0; 24];
    std::fs::File::open(path).ok()?.read_exact(&mut head).ok()?;
    let number = |at: usize| Some(u32::from_be_bytes(head[at..at + 4].try_into().ok()?));
    head.starts_with(b"\x89PNG\r\n\x1a\n").then_some([number(16)?, number(20)?])
}
