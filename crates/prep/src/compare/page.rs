//! Shows the comparison as an index of the scenes and a page for each, with the pictures of both renderers side by side
//! and their difference, as 8-bit PNG.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_dataset::SceneId;
use mateval_dataset::dataset::{DatasetVersion, SceneFile};
use mateval_files::untrusted;
use mateval_files::work_folder::make_folder;
use mateval_image::png_io::write_rgb_bytes;
use mateval_image::transfer::byte_from_unit;
use mateval_image::{LinearRgb, Normal, Picture};
use mateval_pages as pages;
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::file::{Check, CompareFile, LightComparison, SceneComparison, State, ViewComparison};
use super::geometry::{OurGeometry, TheirGeometry, angle_deg, away_from_edges};
use super::light::ShownKinds;
use super::tables::{Counts, counted, verdict};
use super::tiles::{Halves, Tolerance};
use crate::error::PrepError;

/// The index of the scenes.
const INDEX: &str = include_str!("page.j2");

/// The page of a scene.
const SCENE: &str = include_str!("scene.j2");

/// The folder of a scene's page and pictures, below that of the index.
fn scene_folder(scene: &SceneId) -> String {
    format!("scenes/{scene}")
}

/// HTML with the verdict of the dataset and one row per scene, which leads to the scene's page.
pub(super) fn index(file: &CompareFile) -> String {
    let scenes: Vec<_> = file
        .scenes
        .iter()
        .map(|scene| {
            let counts = Counts::of(scene);
            context! {
                scene => scene.scene.as_str(), page => format!("{}/index.html", scene_folder(&scene.scene)),
                word => counts.word(), class => class(counts), agree => counts.agree, faults => counts.faults,
                open => counts.open, samples => scene.samples_each_half(),
            }
        })
        .collect();
    let DatasetVersion { name, version, .. } = &file.dataset;
    let values = context! {
        title => format!("{name} {version}: {} compared with MatEval", file.renderer),
        tool => &file.tool, renderer => &file.renderer, dataset => Serde(&file.dataset), agrees => file.agrees,
        verdict => verdict(file), scenes,
    };
    pages::single(INDEX, values, pages::SORT)
}

/// The class of a verdict on a page.
fn class(counts: Counts) -> &'static str {
    match (counts.faults, counts.open) {
        (0, 0) => "good",
        (0, _) => "",
        _ => "bad",
    }
}

/// Writes the page of a scene: its verdict, its checks and its pictures.
pub(super) fn write_scene(
    out: &Path,
    file: &CompareFile,
    scene: &SceneComparison,
    previews: &[ViewPreviews],
) -> Result<(), PrepError> {
    let views: Vec<_> = scene
        .views
        .iter()
        .map(|view| {
            let shown = previews.iter().find(|shown| shown.view == view.view.as_str());
            let has = |is: fn(State) -> bool| view.checks.iter().any(|check| is(check.state));
            let (word, class) = match (has(State::is_fault), has(State::is_open)) {
                (true, _) => ("does not agree", "bad"),
                (false, true) => ("agrees in part", ""),
                (false, false) => ("agrees", "good"),
            };
            context! { view => view.view.as_str(), word, class, checks => Serde(&view.checks), shown => Serde(shown) }
        })
        .collect();
    let kinds: Vec<&str> = scene.kinds.iter().map(|kind| kind.word()).collect();
    let checks: Vec<&Check> = scene.views.iter().flat_map(|view| &view.checks).collect();
    let DatasetVersion { name, version, .. } = &file.dataset;
    let values = context! {
        title => format!("{} of {name} {version}: {} compared with MatEval", scene.scene, file.renderer),
        scene => scene.scene.as_str(), renderer => &file.renderer, kinds, views,
        class => class(Counts::of(scene)), verdict => counted(&checks, &file.renderer),
        tile_bound => 100.0 * scene.tile_bound, samples => scene.samples_each_half(),
    };
    let folder = out.join(scene_folder(&scene.scene));
    make_folder(&folder)?;
    let page = pages::single(SCENE, values, "");
    Ok(mateval_files::whole::write_whole(&folder.join("index.html"), page.as_bytes())?)
}

/// Ends of the scale of differences. Of a pixel of light: relative to the picture's mean over valid pixels that decide.
const LIGHT_PIXEL: f64 = 0.5;
/// Of a tile of light: a multiple of the bound.
const LIGHT_TILE: f64 = 5.0;
/// Of a base colour.
const BASE_COLOR: f64 = 0.1;
/// Of a depth, in metres.
const DEPTH_M: f64 = 0.01;
/// Of a normal, in degrees.
const NORMAL_DEG: f64 = 5.0;
/// The linear mean that the preview of a light group is scaled to.
const GROUP_MEAN: f64 = 0.2;

/// Colours for darker, equal and brighter than the built-in tracer's: ColorBrewer's RdBu, whose ends are distinct for
/// colour-blind readers too.
const DIVERGING: [[u8; 3]; 3] = [[33, 102, 172], [247, 247, 247], [178, 24, 43]];
/// Colour of tiles that do not count for the verdict, and of pixels at edges.
const APART: [u8; 3] = [150, 150, 150];

/// The previews of a view.
#[derive(Clone, Debug, Serialize)]
pub(super) struct ViewPreviews {
    /// Folder of the scene's page.
    #[serde(skip)]
    out: PathBuf,
    #[serde(skip)]
    exposure: f64,
    pub(super) view: String,
    /// The pictures that are shown; all where absent.
    #[serde(skip)]
    only: Option<BTreeSet<String>>,
    /// One row per picture.
    rows: Vec<Row>,
}

/// One picture; files are relative to the page.
#[derive(Clone, Debug, Serialize)]
struct Row {
    picture: String,
    /// How both previews were made.
    note: String,
    ours: String,
    theirs: String,
    differences: Vec<DifferencePreview>,
}

/// A signed difference.
#[derive(Clone, Debug, Serialize)]
struct DifferencePreview {
    file: String,
    title: String,
    /// The values at the ends of the scale.
    low: String,
    high: String,
}

/// A picture of differences, and the labels of its scale.
struct Shown {
    suffix: &'static str,
    title: String,
    low: String,
    high: String,
    picture: Picture<[u8; 3]>,
}

impl ViewPreviews {
    /// Creates the view's folder below `out`. Unless `whole`, only pictures with a check that speaks against them are
    /// shown: a scene has dozens of others in each view.
    pub(super) fn new(out: &Path, scene: &SceneFile, found: &ViewComparison, whole: bool) -> Result<Self, PrepError> {
        let out = out.join(scene_folder(&scene.id));
        let place = out.join(found.view.as_str());
        make_folder(&place)?;
        let faults = found.checks.iter().filter(|check| check.state.is_fault());
        let shown_by = |check: &Check| match check.picture.as_str() {
            "silhouette" => "instance".to_owned(),
            "rgb_a" | "rgb_b" => "rgb".to_owned(),
            other => other.to_owned(),
        };
        let only = (!whole).then(|| faults.map(shown_by).collect());
        Ok(Self { out, exposure: scene.exposure, view: found.view.to_string(), only, rows: Vec::new() })
    }

    fn shows(&self, picture: &str) -> bool {
        self.only.as_ref().is_none_or(|only| only.contains(picture))
    }

    /// Adds RGB or a light group: the mean of the halves, not the denoised picture.
    pub(super) fn add_light(
        &mut self,
        light: &LightComparison,
        [ours, theirs]: [&Halves; 2],
        kinds: &ShownKinds,
        bound: f64,
    ) -> Result<(), PrepError> {
        if !self.shows(&light.picture) {
            return Ok(());
        }
        let scale = light.means[0];
        let level = scale.iter().sum::<f64>() / 3.0;
        let (gain, note) = self.gain(light, level);
        let means = [ours.mean(), theirs.mean()];
        let off = |at: usize| {
            let [a, b] = [0, 1].map(|side: usize| grey(means[side].pixels()[at]));
            if level > 0.0 { (b - a) / level / LIGHT_PIXEL } else { f64::from(a != b) }
        };
        let (width, height) = (means[0].width(), means[0].height());
        let title = "theirs minus MatEval's, relative to MatEval's mean";
        let by_pixel = scaled("pixels", title, 100.0 * LIGHT_PIXEL, " %", signed(width, height, off));
        let title = format!(
            "tiles, worst channel; dark frame: over the bound of {} %; grey frame: does not count for the verdict",
            100.0 * bound
        );
        let map = tile_map((width, height), [ours, theirs], kinds, bound, scale);
        let by_tile = scaled("tiles", &title, 100.0 * LIGHT_TILE * bound, " %", map);
        let previews = means.map(|picture| to_bytes(&picture, gain));
        self.add(&light.picture, note, previews, vec![by_pixel, by_tile])
    }

    /// The factor of a picture of light in its preview, and the note that states it.
    fn gain(&self, light: &LightComparison, level: f64) -> (f64, String) {
        match light.light.as_ref().map(|name| untrusted::shown(name, 60)) {
            None => (self.exposure, "mean of both halves, with the scene's exposure".to_owned()),
            Some(name) if level > 0.0 => (GROUP_MEAN / level, format!("{name}, times {:.3}", GROUP_MEAN / level)),
            Some(name) => (1.0, format!("{name}, black")),
        }
    }

    /// Adds the pictures without light that Blender made.
    pub(super) fn add_geometry(&mut self, ours: &OurGeometry, theirs: &TheirGeometry) -> Result<(), PrepError> {
        if let Some(base_color) = theirs.base_color.as_ref().filter(|_| self.shows("base_color")) {
            self.add_base_color(ours, base_color)?;
        }
        if let Some(depth) = theirs.depth.as_ref().filter(|_| self.shows("depth")) {
            self.add_depth(&ours.depth, depth)?;
        }
        if let Some(normal) = theirs.normal.as_ref().filter(|_| self.shows("normal")) {
            self.add_normal(&ours.normal, normal)?;
        }
        let ids = [("instance", &ours.instance, &theirs.instance), ("part", &ours.part, &theirs.part)];
        for (name, ours, theirs) in ids {
            if let Some(theirs) = theirs.as_ref().filter(|_| self.shows(name)) {
                self.add_ids(name, ours, theirs)?;
            }
        }
        Ok(())
    }

    fn add_base_color(&mut self, ours: &OurGeometry, theirs: &Picture<LinearRgb>) -> Result<(), PrepError> {
        let off = |at: usize| {
            let [a, b] = [&ours.base_color, theirs].map(|picture| grey(picture.pixels()[at]));
            if ours.valid.pixels()[at] { (b - a) / BASE_COLOR } else { 0.0 }
        };
        let map = signed(theirs.width(), theirs.height(), off);
        let shown = scaled("difference", "theirs minus MatEval's, mean of channels, valid pixels", BASE_COLOR, "", map);
        let previews = [&ours.base_color, theirs].map(|picture| to_bytes(picture, 1.0));
        self.add("base_color", "linear values, sRGB-encoded".to_owned(), previews, vec![shown])
    }

    fn add_depth(&mut self, ours: &Picture<f32>, theirs: &Picture<f32>) -> Result<(), PrepError> {
        let off = |at: usize| f64::from(theirs.pixels()[at] - ours.pixels()[at]) / DEPTH_M;
        let map = signed(ours.width(), ours.height(), off);
        let shown = scaled("difference", "theirs minus MatEval's", 1e3 * DEPTH_M, " mm", map);
        let far = ours.pixels().iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let previews = [ours, theirs].map(|picture| picture.map(|depth| [byte_from_unit(depth / far); 3]));
        self.add("depth", format!("white is {far:.2} m"), previews, vec![shown])
    }

    fn add_normal(&mut self, ours: &Picture<Normal>, theirs: &Picture<Normal>) -> Result<(), PrepError> {
        let off = |at: usize| {
            let (a, b) = (ours.pixels()[at], theirs.pixels()[at]);
            if a == b { 0.0 } else { angle_deg(a, b) / NORMAL_DEG }
        };
        let map = signed(ours.width(), ours.height(), off);
        let mut shown = scaled("difference", "angle between the normals", NORMAL_DEG, " degrees", map);
        shown.low = "0".to_owned();
        let previews = [ours, theirs].map(|p| p.map(|Normal(v)| v.map(|v| byte_from_unit(0.5 * v + 0.5))));
        self.add("normal", "world space, 0.5 + 0.5 n".to_owned(), previews, vec![shown])
    }

    fn add_ids(&mut self, name: &str, ours: &Picture<u16>, theirs: &Picture<u16>) -> Result<(), PrepError> {
        let inner = away_from_edges(ours);
        let color = |at: usize| match (ours.pixels()[at] == theirs.pixels()[at], inner[at]) {
            (true, _) => DIVERGING[1],
            (false, true) => DIVERGING[2],
            (false, false) => APART,
        };
        let width = ours.width();
        let picture = Picture::from_fn(width, ours.height(), |x, y| color(y * width + x));
        let title = "red: ids differ; grey: ids differ at an edge".to_owned();
        let shown = Shown { suffix: "difference", title, low: String::new(), high: String::new(), picture };
        self.add(name, "one colour per id".to_owned(), [ours, theirs].map(|ids| ids.map(id_color)), vec![shown])
    }

    /// Writes the files of a row and adds it.
    fn add(
        &mut self,
        picture: &str,
        note: String,
        [ours, theirs]: [Picture<[u8; 3]>; 2],
        differences: Vec<Shown>,
    ) -> Result<(), PrepError> {
        let file = |suffix: &str, shown: &Picture<[u8; 3]>| {
            let file = format!("{}/{picture}_{suffix}.png", self.view);
            write_rgb_bytes(&self.out.join(&file), shown)?;
            Ok::<_, PrepError>(file)
        };
        let (ours, theirs) = (file("ours", &ours)?, file("theirs", &theirs)?);
        let mut shown = Vec::new();
        for Shown { suffix, title, low, high, picture } in differences {
            shown.push(DifferencePreview { file: file(suffix, &picture)?, title, low, high });
        }
        self.rows.push(Row { picture: picture.to_owned(), note, ours, theirs, differences: shown });
        Ok(())
    }
}

/// A picture of differences whose scale ends at plus and minus `end`.
fn scaled(suffix: &'static str, title: &str, end: f64, unit: &str, picture: Picture<[u8; 3]>) -> Shown {
    let (low, high) = (format!("-{end}{unit}"), format!("+{end}{unit}"));
    Shown { suffix, title: title.to_owned(), low, high, picture }
}

fn grey(LinearRgb(rgb): LinearRgb) -> f64 {
    rgb.into_iter().map(f64::from).sum::<f64>() / 3.0
}

fn to_bytes(picture: &Picture<LinearRgb>, gain: f64) -> Picture<[u8; 3]> {
    let brightened = picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (f64::from(v) * gain) as f32)));
    brightened.to_srgb().map(|srgb| srgb.0.map(byte_from_unit))
}

/// The colour of a number from -1 to 1; numbers beyond have the colour of the nearer end.
fn diverging(value: f64) -> [u8; 3] {
    let share = value.abs().min(1.0);
    let end = if value < 0.0 { DIVERGING[0] } else { DIVERGING[2] };
    std::array::from_fn(|c| {
        let [from, to] = [DIVERGING[1][c], end[c]].map(f64::from);
        (from + (to - from) * share).round() as u8
    })
}

fn signed(width: usize, height: usize, value: impl Fn(usize) -> f64) -> Picture<[u8; 3]> {
    Picture::from_fn(width, height, |x, y| diverging(value(y * width + x)))
}

/// Each tile in one colour. Tiles over the bound have a dark frame, tiles that do not count for the verdict a grey one.
fn tile_map(
    (width, height): (usize, usize),
    [ours, theirs]: [&Halves; 2],
    kinds: &ShownKinds,
    bound: f64,
    scale: [f64; 3],
) -> Picture<[u8; 3]> {
    let mut map = Picture::filled(width, height, DIVERGING[1]);
    let allowed = Tolerance::of_tile(bound);
    for ((tile, decides), off) in kinds.all().zip(kinds.differences([ours, theirs])) {
        let channel = off.worst_channel(allowed, scale);
        let value = match scale[channel] > 0.0 {
            true => off.mean[channel] / scale[channel] / (LIGHT_TILE * bound),
            false => f64::from(off.mean[channel] != 0.0),
        };
        let frame = match (decides, off.is_over(allowed, scale)) {
            (false, _) => Some(APART),
            (true, true) => Some([20; 3]),
            (true, false) => None,
        };
        for (x, y) in tile.pixels() {
            let at_rim =
                x == tile.columns.start || x + 1 == tile.columns.end || y == tile.rows.start || y + 1 == tile.rows.end;
            map.set(x, y, frame.filter(|_| at_rim).unwrap_or_else(|| diverging(value)));
        }
    }
    map
}

/// A colour for each id; consecutive ids have very different colours.
fn id_color(id: u16) -> [u8; 3] {
    if id == 0 {
        return [0; 3];
    }
    let hash = u32::from(id).wrapping_mul(0x9e37_79b1);
    [hash >> 24, hash >> 16, hash >> 8].map(|byte| 40 + (byte as u8 % 200))
}
