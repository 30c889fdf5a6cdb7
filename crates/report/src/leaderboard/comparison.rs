//! A prediction beside the truth, as the sliders on the first page and on the pages of methods show them.

use mateval_eval::result_key::PictureKind;
use mateval_scene::SceneId;
use mateval_scene::layout::INPUT;
use serde::Serialize;

use super::board::Board;
use super::heads::MethodHead;
use super::site::SiteWriter;
use crate::picture_set::{ERROR, TRUTH, png_size};

/// The kinds that are shown where they exist: the albedo, and the room in the light of its own lamps.
pub(super) const KINDS: [PictureKind; 2] = [PictureKind::Albedo, PictureKind::RgbTrue];

/// A prediction of one kind beside the truth, in the input view. Paths are relative to the site.
#[derive(Serialize)]
pub(super) struct Comparison<'a> {
    scene: &'a str,
    method: &'a str,
    /// The title of the kind of picture, such as `Albedo`.
    kind: String,
    prediction: String,
    truth: String,
    width: u32,
    height: u32,
}

/// The comparisons of a method in a scene: those of [`KINDS`], or of the first kind that both have if there are none.
pub(super) fn comparisons<'a>(
    board: &Board<'_>,
    site: &SiteWriter<'_>,
    method: &'a MethodHead,
    scene: &'a SceneId,
) -> Vec<Comparison<'a>> {
    let truth = board.pictures.kinds(TRUTH, scene, INPUT);
    let predicted = board.pictures.kinds(&method.id, scene, INPUT);
    let both: Vec<&str> = predicted.into_iter().filter(|kind| truth.contains(kind) && !kind.ends_with(ERROR)).collect();
    let known: Vec<&str> = KINDS.iter().map(|kind| kind.word()).filter(|kind| both.contains(kind)).collect();
    let shown = if known.is_empty() { both.into_iter().take(1).collect() } else { known };
    let comparison = |word: &str| {
        let place = |of: &str| format!("pictures/{of}/{scene}/{INPUT}/{word}.png");
        let [width, height] = png_size(&site.path(&place(TRUTH))).unwrap_or([4, 3]);
        let title = word.parse::<PictureKind>().map_or_else(|_| word.replace('_', " "), |kind| kind.title().to_owned());
        Comparison {
            scene: scene.as_str(),
            method: &method.name,
            kind: title,
            prediction: place(&method.id),
            truth: place(TRUTH),
            width,
            height,
        }
    };
    shown.into_iter().map(comparison).collect()
}
