//! The pages of a scene. The first shows all methods side by side in all views, the slider between prediction and
//! truth, and scores, and for a captured room the measured colours beside those of the methods. The second shows the
//! room in 3D; `rooms` writes its scripts.

use std::collections::BTreeSet;
use std::io::Read as _;

use flate2::read::GzDecoder;
use mateval_dataset::SceneId;
use mateval_dataset::layout::INPUT;
use mateval_eval::metric::{Metric, PictureKind};
use mateval_eval::result::MeasuredValues;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::board::{Board, KINDS};
use super::columns::{Column, MethodHead, headlines};
use super::pictures::{Kind, TRUTH, kinds_in_order, png_size};
use super::rooms::{MOST_TEXELS, Room};
use super::site::{Page, SiteWriter};
use crate::error::ReportError;
use crate::strips::WHITE_ERROR;

#[derive(Serialize)]
struct ScenePage<'a> {
    id: &'a str,
    house: &'a str,
    siblings: Vec<&'a str>,
    before: Option<&'a str>,
    next: Option<&'a str>,
    kinds: Vec<Kind>,
    views: Vec<&'a str>,
    gallery: Vec<GalleryRow<'a>>,
    sliders: Vec<Slider>,
    room: Option<&'a Room>,
    width: u32,
    height: u32,
    white_error: f32,
    columns: Vec<&'a Column>,
    rows: Vec<ScoreRow<'a>>,
    regions: Vec<RegionRow<'a>>,
}

/// The slider of one kind of picture.
#[derive(Serialize)]
struct Slider {
    kind: Kind,
    /// The pictures that it shows before the script runs.
    prediction: Option<String>,
    truth: Option<String>,
    is_shown: bool,
}

#[derive(Serialize)]
struct GalleryRow<'a> {
    id: &'a str,
    name: &'a str,
    cells: Vec<Option<GalleryCell<'a>>>,
}

#[derive(Serialize)]
struct GalleryCell<'a> {
    view: &'a str,
    base: String,
    kinds: String,
    src: String,
}

#[derive(Serialize)]
struct ScoreRow<'a> {
    method: &'a MethodHead,
    cells: Vec<Option<String>>,
}

/// A region of a captured room whose colour was measured.
#[derive(Serialize)]
struct RegionRow<'a> {
    name: &'a str,
    pixels: usize,
    color: String,
    /// How far the measurement itself may be off, as CIEDE2000.
    error: Option<String>,
    /// In the order of the scores' rows.
    answers: Vec<Option<RegionAnswer>>,
}

#[derive(Serialize)]
struct RegionAnswer {
    color: String,
    delta_e: String,
}

/// An entry in the list of scenes.
#[derive(Serialize)]
struct SceneCard<'a> {
    id: &'a str,
    house: &'a str,
    thumbnail: Option<String>,
    width: u32,
    height: u32,
    best: Option<String>,
}

/// Writes `scenes/<scene>.html` of the scene at place `at`.
pub(super) fn write(board: &Board<'_>, at: usize, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let scenes = &board.ranking().scenes;
    let scene = &scenes[at];
    let columns = headlines(&board.columns);
    let views = views_in_order(board.pictures.views(scene));
    let gallery = gallery(board, scene, &views);
    let words: BTreeSet<&str> =
        gallery.iter().flat_map(|row| row.cells.iter().flatten()).flat_map(|cell| cell.kinds.split(' ')).collect();
    let first = gallery.iter().flat_map(|row| row.cells.iter().flatten()).next();
    let [width, height] = size(site, first.map(|cell| cell.src.clone()));
    let kinds = kinds_in_order(words);
    let page = ScenePage {
        id: scene.as_str(),
        house: house(board, scene),
        siblings: scenes
            .iter()
            .filter(|s| *s != scene && house(board, s) == house(board, scene))
            .map(SceneId::as_str)
            .collect(),
        before: at.checked_sub(1).map(|at| scenes[at].as_str()),
        next: scenes.get(at + 1).map(SceneId::as_str),
        sliders: sliders(&kinds, &gallery),
        kinds,
        gallery,
        views,
        room: board.rooms.get(scene),
        width,
        height,
        white_error: WHITE_ERROR,
        rows: score_rows(board, scene, &columns),
        regions: region_rows(board, scene),
        columns,
    };
    site.page(&Page {
        file: &format!("scenes/{scene}.html"),
        template: "scene.j2",
        title: scene.as_str(),
        scripts: &["sort.js", "slider.js", "scene.js"],
        values: context! { page => Serde(&page), truth => TRUTH },
    })
}

pub(super) fn write_list<'a>(board: &'a Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let card = |scene: &'a SceneId| {
        let kinds = board.pictures.kinds(TRUTH, scene, INPUT);
        let is_light = |kind: &&&str| kind.parse().is_ok_and(PictureKind::is_light);
        let kind = kinds.iter().find(is_light).or(kinds.first());
        let thumbnail = kind.map(|kind| format!("pictures/{TRUTH}/{scene}/{INPUT}/{kind}.png"));
        let [width, height] = size(site, thumbnail.clone());
        let (id, house) = (scene.as_str(), house(board, scene));
        SceneCard { id, house, thumbnail, width, height, best: best(board, scene) }
    };
    let cards: Vec<SceneCard<'_>> = board.ranking().scenes.iter().map(card).collect();
    site.page(&Page {
        file: "scenes.html",
        template: "scenes.j2",
        title: "Scenes",
        scripts: &[],
        values: context! { scenes => Serde(&cards) },
    })
}

fn house<'a>(board: &'a Board<'_>, scene: &SceneId) -> &'a str {
    board.ranking().houses.get(scene).map_or("", String::as_str)
}

/// The input view, then the novel ones as the format lists them, then any others.
fn views_in_order(views: BTreeSet<&str>) -> Vec<&str> {
    const KNOWN: [&str; 5] = [INPUT, "up_left", "up_right", "down_left", "down_right"];
    let mut views: Vec<&str> = views.into_iter().collect();
    views.sort_by_key(|view| KNOWN.iter().position(|known| known == view).unwrap_or(KNOWN.len()));
    views
}

/// The truth, then the methods, the best first; those without pictures are left out.
fn gallery<'a>(board: &'a Board<'_>, scene: &SceneId, views: &[&'a str]) -> Vec<GalleryRow<'a>> {
    let methods = board.best_first().into_iter().map(|at| &board.heads[at]);
    let methods = methods.map(|head| (head.id.as_str(), head.name.as_str()));
    let row = |(id, name): (&'a str, &'a str)| {
        let cell = |view: &&'a str| {
            let kinds = board.pictures.kinds(id, scene, view);
            let base = format!("../pictures/{id}/{scene}/{view}/");
            let src = format!("{base}{}.png", kinds.first()?);
            Some(GalleryCell { view, kinds: kinds.join(" "), base, src })
        };
        GalleryRow { id, name, cells: views.iter().map(cell).collect() }
    };
    let rows = std::iter::once((TRUTH, "Truth")).chain(methods).map(row);
    rows.filter(|row| row.cells.iter().any(Option::is_some)).collect()
}

/// A slider for each kind of picture except errors, with pictures of the first method in the first view. Those of
/// albedo and light are shown, or the first slider if there are none.
fn sliders(kinds: &[Kind], gallery: &[GalleryRow<'_>]) -> Vec<Slider> {
    let path = |is_truth: bool, kind: &Kind| {
        let row = gallery.iter().find(|row| (row.id == TRUTH) == is_truth)?;
        let cell = row.cells.iter().flatten().next()?;
        cell.kinds.split(' ').any(|word| word == kind.word).then(|| format!("{}{}.png", cell.base, kind.word))
    };
    let is_known = |kind: &Kind| KINDS.iter().any(|known| known.word() == kind.word);
    let has_known = kinds.iter().any(is_known);
    let kinds = kinds.iter().filter(|kind| kind.error.is_some()).enumerate();
    let slider = |(at, kind): (usize, &Kind)| Slider {
        kind: kind.clone(),
        prediction: path(false, kind),
        truth: path(true, kind),
        is_shown: if has_known { is_known(kind) } else { at == 0 },
    };
    kinds.map(slider).collect()
}

/// Width and height of the picture that a page names; 4 by 3 if there is none.
fn size(site: &SiteWriter<'_>, file: Option<String>) -> [u32; 2] {
    file.and_then(|file| png_size(&site.path(file.trim_start_matches("../")))).unwrap_or([4, 3])
}

fn score_rows<'a>(board: &'a Board<'_>, scene: &SceneId, columns: &[&Column]) -> Vec<ScoreRow<'a>> {
    let row = |at: usize| ScoreRow { method: &board.heads[at], cells: board.texts(at, scene, columns) };
    board.best_first().into_iter().map(row).collect()
}

/// The measured regions of a scene in the order of the dataset, with the answers of the methods, the best first.
fn region_rows<'a>(board: &'a Board<'_>, scene: &SceneId) -> Vec<RegionRow<'a>> {
    let regions_of = |at: usize| -> Vec<&'a MeasuredValues> {
        board.scores[at].measured.iter().filter(|region| region.scene == *scene).collect()
    };
    let methods: Vec<Vec<&MeasuredValues>> = board.best_first().into_iter().map(regions_of).collect();
    // Every result lists the same regions; a method that was not scored on the scene lists none.
    let Some(listed) = methods.iter().find(|regions| !regions.is_empty()) else { return Vec::new() };
    let text = |delta_e: f64| Metric::RegionDeltaE.style().text(delta_e);
    let row = |(at, region): (usize, &&'a MeasuredValues)| {
        let answer = |regions: &Vec<&MeasuredValues>| {
            let own = regions.get(at).filter(|own| own.region == region.region)?;
            Some(RegionAnswer { color: shown_color(own.predicted), delta_e: text(own.delta_e) })
        };
        RegionRow {
            name: &region.region,
            pixels: region.pixels,
            color: shown_color(region.measured),
            error: region.measurement_delta_e.map(text),
            answers: methods.iter().map(answer).collect(),
        }
    };
    listed.iter().enumerate().map(row).collect()
}

/// A linear colour as a screen shows it, as in `#808080`.
fn shown_color(linear: [f64; 3]) -> String {
    let [r, g, b] = linear.map(|value| byte_from_unit(srgb_from_linear(value as f32)));
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The best method by the score that the board is sorted by initially, with that score.
fn best(board: &Board<'_>, scene: &SceneId) -> Option<String> {
    let column = board.first()?;
    let sign = column.better.sign();
    let values = board.heads.iter().zip(&board.scores);
    let values = values.filter_map(|(head, scores)| Some((head, *scores.scenes.get(scene)?.get(&column.key)?)));
    let (head, value) = values.max_by(|a, b| (sign * a.1).total_cmp(&(sign * b.1)))?;
    Some(format!("{}, {} {}", head.name, column.text(value), column.metric_title))
}

#[derive(Serialize)]
struct RoomPage<'a> {
    scene: &'a str,
    methods: Vec<&'a MethodHead>,
    has_truth: bool,
    most_texels: usize,
}

/// Writes `rooms/<scene>.html` of each room that can be shown, and the script that shows it.
pub(super) fn write_rooms(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    for (scene, room) in &board.rooms {
        let Room::Shown { methods: ids, has_truth } = room else { continue };
        let methods =
            board.best_first().into_iter().map(|at| &board.heads[at]).filter(|head| ids.contains(&head.id)).collect();
        let page = RoomPage { scene: scene.as_str(), methods, has_truth: *has_truth, most_texels: MOST_TEXELS };
        site.page(&Page {
            file: &format!("rooms/{scene}.html"),
            template: "room.j2",
            title: &format!("{scene} in 3D"),
            scripts: &["rooms/room.min.js"],
            values: context! { page => Serde(&page), truth => TRUTH },
        })?;
    }
    let has_rooms = board.rooms.values().any(|room| matches!(room, Room::Shown { .. }));
    if has_rooms { site.file("rooms/room.min.js", &viewer()) } else { Ok(()) }
}

/// The script that shows a room, bundled with three.js and compressed; `tools/build_viewer.sh` builds it.
const VIEWER: &[u8] = include_bytes!("../../viewer/room.min.js.gz");

fn viewer() -> String {
    let mut text = String::new();
    GzDecoder::new(VIEWER).read_to_string(&mut text).expect("the file is part of the program, and a test reads it");
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use mateval_files::untrusted::sha256_of_bytes;

    /// The README beside it states the version and the hash of the viewer, which carries its licence.
    #[test]
    fn the_viewer_is_the_one_that_its_readme_states() {
        let readme = include_str!("../../viewer/README.md");
        let viewer = viewer();
        let sha256 = sha256_of_bytes(viewer.as_bytes());
        assert!(readme.contains(&sha256), "{sha256}");
        let package: serde_json::Value = serde_json::from_str(include_str!("../../viewer/package.json")).unwrap();
        let version = package["dependencies"]["three"].as_str().unwrap();
        assert!(readme.contains(&format!("three.js {version}")) && viewer.contains(&format!("three.js {version}")));
        assert!(viewer.contains("The MIT License") && viewer.contains("three.js authors"));
    }
}
