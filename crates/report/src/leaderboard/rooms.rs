//! The rooms in 3D: for each scene one script with its public geometry, and one for each method with its atlases as
//! small pictures.
//!
//! They are scripts because browsers let a page that is opened from the disk load scripts, but not read other files.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::layout::INPUT;
use mateval_dataset::submission::{MAP_SIZES, Map};
use mateval_dataset::{InstanceId, Progress, Report, SceneId};
use mateval_eval::truth::true_material;
use mateval_files::FileError;
use mateval_files::untrusted::read_at_most;
use mateval_files::whole::write_whole;
use mateval_files::work_folder::make_folder;
use mateval_image::png_io::jpeg_bytes;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{Picture, Texture};
use mateval_submission::atlas::AtlasMeshes;
use mateval_submission::prediction::read_scene;
use serde::Serialize;
use serde_json::json;

use super::entries::{LeaderboardPlan, Submissions};
use super::pictures::{NamedSubmission, TRUTH};
use crate::error::ReportError;
use crate::ranking::file::Ranking;

/// The largest `instances.glb` that a page shows, in bytes.
const MOST_GEOMETRY_BYTES: u64 = 48 << 20;

/// The stem of the script with a room's geometry; no id of a method begins with an underscore.
const GEOMETRY: &str = "_geometry";

/// The most pixels a side of a map's picture.
pub(super) const MOST_TEXELS: usize = 512;
/// JPEG quality: at 90, errors are hardly visible.
const QUALITY: u8 = 90;

/// Whether a scene is shown in 3D.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Room {
    /// It is shown with the atlases of these methods, which were scored on it, and of the truth.
    Shown {
        methods: Vec<String>,
        /// Not of a captured room, whose true materials nobody knows.
        has_truth: bool,
    },
    /// Its geometry is larger than a page shows.
    TooLarge {
        /// The size of its geometry in MiB, rounded up.
        mebibytes: u64,
        /// The largest size that is shown, in MiB.
        most_mebibytes: u64,
    },
}

/// The rooms of the scenes for which there are atlases to show; empty if no dataset and submission were given.
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
        let room = write_room(from, named, scene, &folder.join(scene.id.as_str()))?;
        rooms.extend(room.map(|room| (scene.id.clone(), room)));
    }
    Ok(rooms)
}

fn write_room(
    from: &Submissions<'_>,
    named: &[NamedSubmission<'_>],
    scene: &SceneFile,
    folder: &Path,
) -> Result<Option<Room>, ReportError> {
    let shown: Vec<_> = named.iter().filter(|submission| submission.covers(&scene.id)).collect();
    let has_truth = scene.source.kind.states_materials();
    if shown.is_empty() && !has_truth {
        return Ok(None);
    }
    let geometry = from.dataset.folder(&scene.id).instances();
    let io = |source| FileError::io("read", &geometry)(source);
    let bytes = std::fs::metadata(&geometry).map_err(io)?.len();
    if bytes > MOST_GEOMETRY_BYTES {
        let [mebibytes, most_mebibytes] = [bytes, MOST_GEOMETRY_BYTES].map(|bytes| bytes.div_ceil(1 << 20));
        return Ok(Some(Room::TooLarge { mebibytes, most_mebibytes }));
    }
    make_folder(folder)?;
    let script = |name: &str, text: String| write_whole(&folder.join(format!("{name}.js")), text.as_bytes());
    let glb = base64::encode(read_at_most(&geometry, MOST_GEOMETRY_BYTES).map_err(io)?);
    let camera = scene.view(INPUT).map(|view| &view.camera);
    script(GEOMETRY, format!("roomGeometry({});\n", json!({ "glb": glb, "camera": camera })))?;
    if has_truth {
        script(TRUTH, materials_script(TRUTH, &truth(from, scene)?))?;
    }
    let atlases = AtlasMeshes::on_demand(from.dataset, scene);
    for submission in &shown {
        let prediction = read_scene(submission.folder, scene, &atlases)?;
        let materials = scene.instances.iter().zip(&prediction.materials);
        let maps = materials.filter_map(|(instance, material)| {
            let material = material.as_ref()?;
            Some((&instance.id, room_maps(|map| material.texture(map))))
        });
        script(&submission.id, materials_script(&submission.id, &maps.collect()))?;
    }
    let methods = shown.iter().map(|submission| submission.id.clone()).collect();
    Ok(Some(Room::Shown { methods, has_truth }))
}

/// The truth's maps, by instance.
fn truth<'a>(from: &Submissions<'_>, scene: &'a SceneFile) -> Result<BTreeMap<&'a InstanceId, RoomMaps>, ReportError> {
    let folder = from.dataset.folder(&scene.id);
    let mut maps = BTreeMap::new();
    for instance in &scene.instances {
        let size = instance.atlas.as_ref().map(|atlas| atlas.size as usize);
        // Scoring has already refused other sizes.
        let Some(size) = size.filter(|size| MAP_SIZES.contains(size)) else { continue };
        let truth = true_material(&folder, &instance.id, size)?;
        maps.insert(&instance.id, room_maps(|map| truth.texture(map)));
    }
    Ok(maps)
}

/// A script that hands a method's maps to the page, by instance.
fn materials_script(method: &str, maps: &BTreeMap<&InstanceId, RoomMaps>) -> String {
    // JSON is also valid JavaScript.
    format!("roomMaterials({}, {});\n", json!(method), json!(maps))
}

/// For each map, by the stem of its files, a colour such as `#808080` or the `data:` address of a JPEG.
type RoomMaps = BTreeMap<&'static str, String>;

/// The maps of a material, whose linear values `texture` gives. Their bytes are those that a screen shows: base colour
/// in sRGB, roughness and metallic as 255 times their value.
fn room_maps<'a>(texture: impl Fn(Map) -> &'a Texture) -> RoomMaps {
    let shown = |map: Map| {
        let encode = |value: f32| match map {
            Map::BaseColor => byte_from_unit(srgb_from_linear(value)),
            Map::Roughness | Map::Metallic => byte_from_unit(value),
        };
        (map.stem(), address(&shrunk(texture(map)).map(|value| value.map(encode))))
    };
    Map::ALL.into_iter().map(shown).collect()
}

/// The picture with at most [`MOST_TEXELS`] a side; each pixel is the mean of the linear texels that it covers.
fn shrunk(texture: &Texture) -> Picture<[f32; 3]> {
    let [width, height] = [texture.width(), texture.height()];
    let mean = |columns: Range<usize>, rows: Range<usize>| {
        let texels = rows.clone().flat_map(|y| columns.clone().map(move |x| texture.texel(x, y)));
        let sum = texels.fold([0.0; 3], |sum, texel| std::array::from_fn(|c| sum[c] + f64::from(texel[c])));
        sum.map(|sum| (sum / (columns.len() * rows.len()) as f64) as f32)
    };
    let [across, down] = [width.min(MOST_TEXELS), height.min(MOST_TEXELS)];
    Picture::from_fn(across, down, |x, y| mean(covered(x, across, width), covered(y, down, height)))
}

/// The texels that pixel `at` covers, where `count` pixels share a row of `size` texels.
fn covered(at: usize, count: usize, size: usize) -> Range<usize> {
    (at * size / count)..((at + 1) * size).div_ceil(count)
}

/// The colour of a picture of one colour, else the address of the picture as a JPEG.
fn address(picture: &Picture<[u8; 3]>) -> String {
    let first = picture.get(0, 0);
    if picture.pixels().iter().all(|pixel| *pixel == first) {
        let [r, g, b] = first;
        return format!("#{r:02x}{g:02x}{b:02x}");
    }
    let jpeg = jpeg_bytes(picture, QUALITY).expect("the picture has 1 to MOST_TEXELS pixels a side");
    format!("data:image/jpeg;base64,{}", base64::encode(jpeg))
}

#[cfg(test)]
mod tests {
    use mateval_image::{Texels, Wrap};

    use super::*;

    fn grey(size: usize, value: impl Fn(usize, usize) -> f32) -> Texture {
        let texels = (0..size * size).map(|at| value(at % size, at / size)).collect();
        Texture::new(size, size, Texels::Grey(texels), Wrap::Clamp).unwrap()
    }

    #[test]
    fn a_map_of_one_value_is_a_colour() {
        let maps = room_maps(|map| {
            let texture = grey(64, |_, _| 0.5);
            Box::leak(Box::new(if map == Map::BaseColor { texture } else { texture.collapsed() }))
        });
        assert_eq!(maps["base_color"], "#bcbcbc");
        assert_eq!((maps["roughness"].as_str(), maps["metallic"].as_str()), ("#808080", "#808080"));
    }

    #[test]
    fn large_maps_shrink_to_means_and_small_ones_are_kept() {
        let large = shrunk(&grey(1024, |x, _| (x % 2) as f32));
        assert_eq!((large.width(), large.height()), (MOST_TEXELS, MOST_TEXELS));
        assert!(large.pixels().iter().all(|pixel| *pixel == [0.5; 3]));
        let small = grey(64, |x, y| (x * 64 + y) as f32 / 4096.0);
        assert_eq!(shrunk(&small), Picture::from_fn(64, 64, |x, y| small.texel(x, y)));
        // Sides that are no multiple: every texel is covered.
        let covered: Vec<Range<usize>> = (0..512).map(|at| covered(at, 512, 700)).collect();
        assert!(covered[0].start == 0 && covered[511].end == 700);
        assert!(covered.windows(2).all(|pair| pair[1].start <= pair[0].end && pair[1].start >= pair[0].start));
    }

    #[test]
    fn other_maps_are_jpegs_of_bounded_size() {
        let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + x * y * 31) % 251) as f32 / 251.0;
        let texture = grey(2048, noise);
        let map = &room_maps(|_| &texture)["base_color"];
        assert!(map.starts_with("data:image/jpeg;base64,/9j/") && map.len() < 1 << 20, "{}", map.len());
    }
}
