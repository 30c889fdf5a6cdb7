//! The rooms in 3D: for each scene one script with its public geometry, and one for each method with its atlases.
//!
//! They are scripts because browsers let a page that is opened from the disk load scripts, but not read other files.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_eval::light::true_maps::TruthMaterial;
use mateval_image::limits::read_at_most;
use mateval_image::store::write_whole;
use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::INPUT;
use mateval_scene::submission::{MAP_SIZES, Map};
use mateval_scene::{InstanceId, Progress, Report, SceneError, SceneId};
use mateval_submission::atlas_meshes::AtlasMeshes;
use mateval_submission::prediction::read_scene;
use serde::Serialize;
use serde_json::json;

use super::named_submission::NamedSubmission;
use super::plan::{LeaderboardPlan, Submissions};
use super::room_maps::{RoomMaps, room_maps};
use crate::error::ReportError;
use crate::picture_set::TRUTH;
use crate::ranking::file::Ranking;

/// The largest `instances.glb` that a page shows, in bytes.
const MOST_GEOMETRY_BYTES: u64 = 48 << 20;

/// The stem of the script with a room's geometry; no id of a method begins with an underscore.
const GEOMETRY: &str = "_geometry";

/// Whether a scene is shown in 3D.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Room {
    /// It is shown with the atlases of the truth and of these methods, which were scored on it.
    Shown {
        /// The methods' ids.
        methods: Vec<String>,
    },
    /// Its geometry is larger than a page shows.
    TooLarge {
        /// The size of its geometry in MiB, rounded up.
        mebibytes: u64,
        /// The largest size that is shown, in MiB.
        most_mebibytes: u64,
    },
}

/// The rooms of the scenes; empty if no dataset and submission were given.
pub(super) type Rooms = BTreeMap<SceneId, Room>;

/// Writes the scripts of all ranked scenes to `folder`; writes nothing if no submission was given.
pub(super) fn write(
    plan: &LeaderboardPlan<'_>,
    named: &[NamedSubmission<'_>],
    ranking: &Ranking,
    folder: &Path,
    progress: Progress<'_>,
) -> Result<Rooms, ReportError> {
    let mut rooms = Rooms::new();
    let Some(from) = &plan.submissions else { return Ok(rooms) };
    let scenes = from.ranked_scenes(ranking);
    for (done, scene) in scenes.iter().enumerate() {
        progress(Report::step("rooms", done, scenes.len()));
        rooms.insert(scene.id.clone(), write_room(from, named, scene, &folder.join(scene.id.as_str()))?);
    }
    Ok(rooms)
}

fn write_room(
    from: &Submissions<'_>,
    named: &[NamedSubmission<'_>],
    scene: &SceneFile,
    folder: &Path,
) -> Result<Room, ReportError> {
    let geometry = from.dataset.folder(&scene.id).instances();
    let io = |source| SceneError::io("read", &geometry)(source);
    let bytes = std::fs::metadata(&geometry).map_err(io)?.len();
    if bytes > MOST_GEOMETRY_BYTES {
        let [mebibytes, most_mebibytes] = [bytes, MOST_GEOMETRY_BYTES].map(|bytes| bytes.div_ceil(1 << 20));
        return Ok(Room::TooLarge { mebibytes, most_mebibytes });
    }
    std::fs::create_dir_all(folder).map_err(SceneError::io("make", folder))?;
    let script = |name: &str, text: String| write_whole(&folder.join(format!("{name}.js")), text.as_bytes());
    let glb = base64::encode(read_at_most(&geometry, MOST_GEOMETRY_BYTES).map_err(io)?);
    let camera = scene.view(INPUT).map(|view| &view.camera);
    script(GEOMETRY, format!("roomGeometry({});\n", json!({ "glb": glb, "camera": camera })))?;
    script(TRUTH, materials_script(TRUTH, &truth(from, scene)?))?;
    let atlases = AtlasMeshes::on_demand(from.dataset, scene);
    let shown: Vec<_> = named.iter().filter(|submission| submission.covers(&scene.id)).collect();
    for submission in &shown {
        let prediction = read_scene(submission.folder, scene, &atlases)?;
        let materials = scene.instances.iter().zip(&prediction.materials);
        let maps = materials.filter_map(|(instance, material)| {
            let material = material.as_ref()?;
            Some((&instance.id, room_maps(|map| material.texture(map))))
        });
        script(&submission.id, materials_script(&submission.id, &maps.collect()))?;
    }
    Ok(Room::Shown { methods: shown.iter().map(|submission| submission.id.clone()).collect() })
}

/// The truth's maps, by instance.
fn truth<'a>(from: &Submissions<'_>, scene: &'a SceneFile) -> Result<BTreeMap<&'a InstanceId, RoomMaps>, ReportError> {
    let folder = from.dataset.folder(&scene.id);
    let mut maps = BTreeMap::new();
    for instance in &scene.instances {
        let size = instance.atlas.as_ref().map(|atlas| atlas.size as usize);
        // Scoring has already refused other sizes.
        let Some(size) = size.filter(|size| MAP_SIZES.contains(size)) else { continue };
        let truth = TruthMaterial::read(&folder, &instance.id, size)?;
        let texture = |map| match map {
            Map::BaseColor => &truth.base_color,
            Map::Roughness => &truth.roughness,
            Map::Metallic => &truth.metallic,
        };
        maps.insert(&instance.id, room_maps(texture));
    }
    Ok(maps)
}

/// A script that hands a method's maps to the page, by instance.
fn materials_script(method: &str, maps: &BTreeMap<&InstanceId, RoomMaps>) -> String {
    // JSON is also valid JavaScript.
    format!("roomMaterials({}, {});\n", json!(method), json!(maps))
}
