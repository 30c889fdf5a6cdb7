//! A description of the tars and of every view in Croissant 1.1, the JSON-LD that dataset searches and `mlcroissant`
//! read.
//!
//! Beside the tars lie `views.jsonl`, a line a view, and `croissant.json`, whose record set `views` joins those lines
//! with the pictures in the tars by the pictures' paths.

use std::path::Path;

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::INPUT;
use mateval_dataset::{Progress, ViewId};
use mateval_files::source_folder::slashed;
use mateval_files::untrusted::sha256_of_bytes;
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::dataset::{ExportError, Exported, SoundDataset, licence_text, picture, write_file};
use crate::tars::{self, WrittenTar};

/// The version of Croissant that the description follows.
const CONFORMS_TO: &str = "http://mlcommons.org/croissant/1.1";

pub const CROISSANT: &str = "croissant.json";

/// A line for each view.
pub const VIEWS: &str = "views.jsonl";

/// The words of Croissant's own context, which its specification prescribes, as far as this file uses them.
const CONTEXT: &str = include_str!("croissant_context.json");

/// Facts about the publication, which a dataset does not hold.
#[derive(Clone, Debug, Default)]
pub struct Publication {
    /// The address of the folder in which the files will lie; their places are relative without it.
    pub url: Option<String>,
    /// The day of publication, as in `2026-11-24`.
    pub date: Option<String>,
    /// How to cite the dataset; its name, version and hash where absent.
    pub citation: Option<String>,
}

/// A line of [`VIEWS`].
#[derive(Debug, Serialize)]
struct Line<'a> {
    scene: &'a str,
    view: &'a str,
    /// Null where the picture is withheld.
    picture_path: Option<String>,
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    world_from_camera: [[f64; 4]; 4],
    licence: Option<String>,
}

/// Writes the tars as [`tars::export`] does, [`VIEWS`] and [`CROISSANT`] to `out`.
pub fn export(
    sound: &SoundDataset,
    publication: &Publication,
    out: &Path,
    progress: Progress<'_>,
) -> Result<Exported, ExportError> {
    let tars = tars::write(sound, out, progress)?;
    let mut exported = Exported { scenes: sound.dataset.scenes.len(), views: Some(0), without_picture: 0 };
    let mut lines = String::new();
    for scene in &sound.dataset.scenes {
        let licence = licence_text(&sound.dataset, &scene.id);
        for view in &scene.views {
            let line = line(sound, scene, view, licence.clone());
            exported.views = exported.views.map(|sum| sum + 1);
            exported.without_picture += usize::from(line.picture_path.is_none());
            lines.push_str(&serde_json::to_string(&line).expect("numbers and texts are JSON"));
            lines.push('\n');
        }
    }
    write_file(&out.join(VIEWS), lines.as_bytes())?;
    let description = description(sound, publication, &tars, &lines);
    write_file(&out.join(CROISSANT), mateval_dataset::json::to_text(&description).as_bytes())?;
    Ok(exported)
}

fn line<'a>(sound: &SoundDataset, scene: &'a SceneFile, view: &'a View, licence: Option<String>) -> Line<'a> {
    let k = view.camera.intrinsics;
    Line {
        scene: scene.id.as_str(),
        view: view.id.as_str(),
        picture_path: picture(&sound.dataset, scene, view).map(|path| slashed(&path)),
        width: k.width,
        height: k.height,
        fx: k.fx,
        fy: k.fy,
        cx: k.cx,
        cy: k.cy,
        world_from_camera: view.camera.world_from_camera,
        licence,
    }
}

fn description(sound: &SoundDataset, publication: &Publication, tars: &[WrittenTar], lines: &str) -> Value {
    let file = &sound.dataset.file;
    let citation = format!("{}, version {}, manifest SHA-256 {}", file.name, file.version, file.manifest_sha256);
    let place = |name: &str| match &publication.url {
        Some(url) => format!("{}/{name}", url.trim_end_matches('/')),
        None => name.to_owned(),
    };
    let tar = |tar: &WrittenTar| {
        let facts = json!({"contentSize": format!("{} B", tar.bytes), "encodingFormat": "application/x-tar"});
        file_object(&tar.name, &place(&tar.name), &tar.sha256, facts)
    };
    let mut distribution: Vec<Value> = tars.iter().map(tar).collect();
    let lines_format = json!({"encodingFormat": "application/jsonlines"});
    distribution.push(file_object(VIEWS, &place(VIEWS), &sha256_of_bytes(lines.as_bytes()), lines_format));
    distribution.push(pictures(sound, tars));
    let mut description = json!({
        "@context": serde_json::from_str::<Value>(CONTEXT).expect("the file beside this one is JSON"),
        "@type": "sc:Dataset",
        "conformsTo": CONFORMS_TO,
        "name": file.name,
        "description": DESCRIPTION,
        "version": file.version,
        "license": licence_list(sound),
        "citeAs": publication.citation.clone().unwrap_or(citation),
        "distribution": distribution,
        "recordSet": [record_set()],
    });
    for (key, fact) in [("url", &publication.url), ("datePublished", &publication.date)] {
        if let Some(fact) = fact {
            description[key] = Value::from(fact.as_str());
        }
    }
    description
}

const DESCRIPTION: &str = "Indoor scenes for recovering materials from one photo. A row is a view: its picture (8-bit \
     sRGB) and its camera. Pixels count from the upper left corner, and the first one's centre is (0.5, 0.5). Cameras look \
     along their -Z, +Y is up, lengths are metres. base.tar and any of the scenes' tars, unpacked in one folder, are a \
     dataset that MatEval opens.";

/// The texts of the scenes' licences, each once, and what is to be said of scenes without one.
fn licence_list(sound: &SoundDataset) -> Value {
    let texts = sound.dataset.file.shared_licences().into_iter().map(|licence| licence.text);
    json!(texts.chain(sound.dataset.unstated_licences()).collect::<Vec<_>>())
}

fn file_object(name: &str, place: &str, sha256: &str, facts: Value) -> Value {
    let mut object =
        json!({"@type": "cr:FileObject", "@id": name, "name": name, "contentUrl": place, "sha256": sha256});
    if let (Value::Object(object), Value::Object(facts)) = (&mut object, facts) {
        object.extend(facts);
    }
    object
}

/// The views' pictures. The input view's is that of `views/`; its copy among the renders is not matched.
fn pictures(sound: &SoundDataset, tars: &[WrittenTar]) -> Value {
    let mut includes = vec![format!("scenes/*/views/{INPUT}/rgb.png")];
    if let Some(renderer) = &sound.dataset.file.photo_renderer {
        let rendered = sound.dataset.scenes.iter().filter(|scene| scene.photo.is_none());
        let views = rendered.flat_map(|scene| scene.views.iter().map(|view| &view.id));
        let novel: std::collections::BTreeSet<&ViewId> = views.filter(|id| id.as_str() != INPUT).collect();
        includes.extend(novel.iter().map(|view| format!("scenes/*/ground_truth/renders/{renderer}/{view}/rgb.png")));
    }
    let scenes = tars.iter().filter(|tar| tar.name != tars::BASE);
    json!({
        "@type": "cr:FileSet",
        "@id": "pictures",
        "name": "pictures",
        "containedIn": scenes.map(|tar| json!({"@id": tar.name})).collect::<Vec<_>>(),
        "encodingFormat": "image/png",
        "includes": includes,
    })
}

fn record_set() -> Value {
    let column = |name: &str| json!({"fileObject": {"@id": VIEWS}, "extract": {"column": name}});
    let plain = |name: &str, kind: &str, about: &str| field(name, kind, about, column(name), json!({}));
    // A path becomes text only by a transformation, and only texts can be joined.
    let path = json!({
        "fileSet": {"@id": "pictures"},
        "extract": {"fileProperty": "fullpath"},
        "transform": {"regex": "^(.*)$"},
    });
    let content = json!({"fileSet": {"@id": "pictures"}, "extract": {"fileProperty": "content"}});
    let matrix = json!({"isArray": true, "arrayShape": "4,4"});
    let fields = [
        plain("scene", "sc:Text", "The scene's id."),
        plain("view", "sc:Text", "The view's id; `input` is the photo that methods may see."),
        field(
            "picture_path",
            "sc:Text",
            "The picture's path in the dataset.",
            path,
            json!({"references": column("picture_path")}),
        ),
        field("picture", "sc:ImageObject", "The picture, 8-bit sRGB, with the scene's exposure.", content, json!({})),
        plain("width", "sc:Integer", "Pixels in a row."),
        plain("height", "sc:Integer", "Rows."),
        plain("fx", "sc:Float", "Horizontal focal length in pixels."),
        plain("fy", "sc:Float", "Vertical focal length in pixels."),
        plain("cx", "sc:Float", "Column of the principal point in pixels from the left edge."),
        plain("cy", "sc:Float", "Row of the principal point in pixels from the top edge."),
        field(
            "world_from_camera",
            "sc:Float",
            "4x4, row-major, metres; the camera looks along -Z, +Y is up.",
            column("world_from_camera"),
            matrix,
        ),
        plain("licence", "sc:Text", "The licence of the scene."),
    ];
    json!({
        "@type": "cr:RecordSet",
        "@id": "views",
        "name": "views",
        "description": "A record for each view that has a picture.",
        "key": [{"@id": "views/scene"}, {"@id": "views/view"}],
        "field": fields,
    })
}

fn field(name: &str, kind: &str, about: &str, source: Value, more: Value) -> Value {
    let mut field = Map::new();
    field.insert("@type".to_owned(), "cr:Field".into());
    field.insert("@id".to_owned(), format!("views/{name}").into());
    field.insert("name".to_owned(), name.into());
    field.insert("description".to_owned(), about.into());
    field.insert("dataType".to_owned(), kind.into());
    field.insert("source".to_owned(), source);
    if let Value::Object(more) = more {
        field.extend(more);
    }
    Value::Object(field)
}
