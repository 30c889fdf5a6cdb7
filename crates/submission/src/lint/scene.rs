//! One scene checked: each map is read once, a few instances at a time, then judged together. This file judges the
//! other maps and the scene as a whole: roughness and metallic exchanged, one base colour for everything, texels left
//! empty, copies of the ground truth.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::open::Dataset;
use mateval_dataset::submission::Map;
use mateval_dataset::{DatasetError, Finding, InstanceId, Severity};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Texture, Wrap};
use rayon::prelude::*;

use super::base_colours::{self, Decoding, Readings};
use super::map_headers::{self, Largest};
use super::sight::{CoarseTexel, InstanceSight, Look, Pairs, ScalarLook, Sight, looks, scalar_looks};
use crate::atlas::AtlasMeshes;
use crate::error::{SubmissionError, error, note, warning};
use crate::files::{MapFolder, relative};
use crate::map_file::{self, MapFile, MapHeader};
use crate::prediction::{MAX_SCENE_BYTES, MemoryBudget, compact_texture};

/// Instances whose maps are in memory at once.
const AT_ONCE: usize = 4;
/// Fewest pixels that allow a judgement of roughness and metallic.
const FEWEST_PIXELS: usize = 400;
/// A surface smoother and more metallic than this is a mirror of some kind.
const MIRROR: (f32, f32) = (0.1, 0.3);
/// No room is a hall of mirrors: if more than this share of the pixels shows one, the two maps are exchanged.
const MOST_MIRRORS: f64 = 0.6;
/// Roughness and metallic of a pixel that differ by at most this much count as equal.
const SAME: f32 = 1.0 / 255.0;
/// Fewest neighbourhoods of an instance whose hues are compared, and fewest pixels of each, which keeps noise out of
/// its mean.
const FEWEST_TILES: usize = 4;
const FEWEST_OF_TILE: f64 = 16.0;
/// Darker values hold more noise than hue.
const DARKEST: f32 = 0.01;
/// How much the picture's hues must differ between the neighbourhoods of an instance for a single base colour to be
/// wrong.
const MOST_HUE: f64 = 0.3;
/// A single value on this share of the unobserved area counts as empty, unless the observed area has it too.
const MOST_EMPTY: f64 = 0.5;
/// The largest share of the observed area that may have that value.
const MOST_FILLED: f64 = 0.02;
/// The share of maps from which a scene counts as a copy.
const LEAST_COPIED: f64 = 0.5;

#[derive(Default)]
pub(super) struct SceneFindings {
    pub(super) findings: Vec<Finding>,
    pub(super) maps: usize,
    /// Not among the findings, since both are judged over all scenes.
    pub(super) decoding: Decoding,
    pub(super) readings: Readings,
}

/// Checks one scene. A scene that the submission leaves out has no findings here.
pub(super) fn check(dataset: &Dataset, submission: &Path, scene: &SceneFile) -> Result<SceneFindings, SubmissionError> {
    if !submission.join("scenes").join(scene.id.as_str()).is_dir() {
        return Ok(SceneFindings::default());
    }
    // Each map is read once, a few instances at a time.
    let sight = Sight::read(dataset, scene)?;
    let order: Vec<usize> = (0..scene.instances.len()).filter(|at| scene.instances[*at].atlas.is_some()).collect();
    let atlases = AtlasMeshes::on_demand(dataset, scene);
    let mut all: Vec<InstanceFacts> = Vec::new();
    for some in order.chunks(AT_ONCE) {
        let facts = some.par_iter().map(|&at| instance(dataset, submission, scene, at, &sight.instances[at], &atlases));
        all.extend(facts.collect::<Result<Vec<_>, _>>()?);
    }
    let maps = all.iter().map(|facts| facts.maps).sum();
    let mut findings: Vec<Finding> = all.iter_mut().flat_map(|facts| std::mem::take(&mut facts.findings)).collect();
    // What concerns the scene as a whole.
    let place = format!("scenes/{}", scene.id);
    if all.iter().map(|facts| facts.bytes).sum::<usize>() > MAX_SCENE_BYTES {
        findings.push(error("scene_too_large", &place, MemoryBudget::exceeded(), "bake them smaller, or with 8 bits"));
    }
    if !sight.has_photo {
        let message = "the dataset has no input picture";
        let action = "maps were not compared with it; render the dataset (`mateval prep render`)";
        findings.push(note("no_photo", &place, message, action));
    }
    // Base colours compared with the picture.
    let looks: Vec<Look> = all.iter().flat_map(|facts| facts.looks.iter().copied()).collect();
    let files: Vec<&(String, bool)> = all.iter().filter_map(|facts| facts.base_color.as_ref()).collect();
    let are_png = files.iter().filter(|(_, is_png)| *is_png).count() * 2 >= files.len();
    findings.extend(base_colours::turned(&place, &looks));
    let swapped_channels = base_colours::swapped_red_blue(&place, &looks);
    let decoding = match swapped_channels {
        Some(_) => Decoding::Unknown,
        None => base_colours::decoding(&place, &looks, are_png),
    };
    findings.extend(swapped_channels);
    findings.extend(base_colours::shading_baked_in(&place, &looks));
    for map in Map::ALL {
        let of_map = all.iter().flat_map(|facts| &facts.largest).filter(|(other, _)| *other == map);
        findings.extend(map_headers::small_numbers(&place, map, &of_map.map(|(_, one)| *one).collect::<Vec<_>>()));
    }
    // The other maps, and what instances have in common.
    let scalars: Vec<ScalarLook> = all.iter().flat_map(|facts| facts.scalars.iter().copied()).collect();
    findings.extend(swapped_scalars(&place, &scalars).or_else(|| same_scalars(&place, &scalars)));
    findings.extend(one_for_all(&place, &all));
    findings.extend(all.iter().filter_map(one_colour));
    findings.extend(left_empty(&place, all.iter().filter_map(|facts| facts.fill.as_ref())));
    findings.extend(copies(&place, all.iter().map(|facts| facts.copies)));
    Ok(SceneFindings { findings, maps, decoding, readings: base_colours::readings(&looks) })
}

/// The findings about one instance, and what the scene's findings need of it.
#[derive(Default)]
struct InstanceFacts {
    /// Its folder in the submission.
    folder: String,
    /// Findings about its maps alone.
    findings: Vec<Finding>,
    maps: usize,
    /// Memory that its maps take while a scene is scored.
    bytes: usize,
    /// The largest number of each map.
    largest: Vec<(Map, Largest)>,
    looks: Vec<Look>,
    scalars: Vec<ScalarLook>,
    fill: Option<Fill>,
    copies: CopyCount,
    /// The hash of the base colour's file, and whether that is a PNG.
    base_color: Option<(String, bool)>,
}

fn instance(
    dataset: &Dataset,
    submission: &Path,
    scene: &SceneFile,
    at: usize,
    sight: &InstanceSight,
    atlases: &AtlasMeshes<'_>,
) -> Result<InstanceFacts, DatasetError> {
    let instance = &scene.instances[at];
    let mut facts =
        InstanceFacts { folder: format!("scenes/{}/{}", scene.id, instance.id), ..InstanceFacts::default() };
    let folder = MapFolder { submission, scene: &scene.id, instance: &instance.id };
    // None if the map is missing or cannot be used. Fails only where the dataset does.
    let mut read = |map: Map| -> Result<Option<MapFile>, DatasetError> {
        // A missing map, and two files for one map, are findings of `folder`.
        let Ok([path]) = <[_; 1]>::try_from(folder.present(map)) else { return Ok(None) };
        let name = relative(submission, &path);
        let decoded = match folder.read(&path) {
            Ok(file) => map_file::decode(file, map, || atlases.mesh(at))?,
            Err(fault) => Err(fault),
        };
        match decoded {
            Ok(file) => {
                facts.maps += 1;
                facts.largest.push((map, Largest::of(&file)));
                // A clone shares its texels.
                facts.bytes += compact_texture(file.clone(), map).bytes().len();
                let bad_texels = file.bad_texels.clone();
                facts.findings.extend(bad_texels.map(|fault| fault.into_finding(Severity::Warning, name.clone())));
                facts.findings.extend(map_headers::remarks(&name, map, &file));
                Ok(Some(file))
            }
            Err(fault) => {
                facts.findings.push(fault.into_finding(Severity::Error, name));
                Ok(None)
            }
        }
    };
    let [base_color, roughness, metallic] = [read(Map::BaseColor)?, read(Map::Roughness)?, read(Map::Metallic)?];
    if let Some(file) = &base_color {
        facts.looks = looks(at, &sight.pixels, &file.texture);
        facts.fill = Some(fill(&sight.texels, &file.texture));
        facts.base_color = Some((file.sha256.clone(), matches!(file.header, MapHeader::Png(_))));
    }
    let of = |file: &Option<MapFile>| -> Option<Texture> { file.as_ref().map(|file| file.texture.clone()) };
    facts.scalars = scalar_looks(&sight.pixels, of(&roughness), of(&metallic));
    let files = [base_color, roughness, metallic];
    facts.copies = CopyCount::of(&dataset.folder(&scene.id), &instance.id, &files);
    Ok(facts)
}

/// Roughness and metallic exchanged: most of the scene would be mirrors.
fn swapped_scalars(place: &str, looks: &[ScalarLook]) -> Option<Finding> {
    let mirrors = looks.iter().filter(|look| look.roughness < MIRROR.0 && look.metallic > MIRROR.1).count();
    let share = mirrors as f64 / looks.len().max(1) as f64;
    (looks.len() >= FEWEST_PIXELS && share >= MOST_MIRRORS).then(|| {
        let message = format!(
            "roughness and metallic seem exchanged: {:.0} % of {} pixels are smooth metal (roughness under {}, metallic \
             above {})",
            100.0 * share,
            looks.len(),
            MIRROR.0,
            MIRROR.1
        );
        let action = "write each into its own file; in an ORM map, green is roughness";
        warning("swapped_roughness_metallic", place, message, action)
    })
}

/// The same map written as both.
fn same_scalars(place: &str, looks: &[ScalarLook]) -> Option<Finding> {
    let same = looks.iter().all(|look| (look.roughness - look.metallic).abs() <= SAME);
    (looks.len() >= FEWEST_PIXELS && same).then(|| {
        let message = format!("roughness and metallic are the same at all {} pixels", looks.len());
        warning("same_roughness_metallic", place, message, "write each into its own file")
    })
}

/// The same base colour for every instance.
fn one_for_all(place: &str, all: &[InstanceFacts]) -> Option<Finding> {
    let hashes: Vec<&String> = all.iter().filter_map(|facts| facts.base_color.as_ref().map(|(hash, _)| hash)).collect();
    (hashes.len() > 2 && hashes.iter().all(|hash| *hash == hashes[0])).then(|| {
        let message = format!("all {} base colours are the same file", hashes.len());
        warning("same_base_color", place, message, "bake a map of its own for each instance, unless this is a baseline")
    })
}

/// A single colour where the picture shows several. Light and shadow change brightness, and hues only a little.
fn one_colour(facts: &InstanceFacts) -> Option<Finding> {
    let first = facts.looks.first()?.own();
    let is_first = |look: &Look| look.own().iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-4);
    if !facts.looks.iter().all(is_first) {
        return None;
    }
    let (hue, tiles) =
        [1, 2].map(|channel| hues(&facts.looks, channel)).into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (tiles >= FEWEST_TILES && hue > MOST_HUE).then(|| {
        let message = format!(
            "a single colour where the input picture shows several: its hue differs by {hue:.2} between {tiles} tiles"
        );
        warning("one_colour", &facts.folder, message, "bake what the picture shows, unless this is a baseline")
    })
}

/// The standard deviation of log(red / `channel`) of the picture between neighbourhoods, and the number of
/// neighbourhoods.
fn hues(looks: &[Look], channel: usize) -> (f64, usize) {
    let mut tiles: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
    for look in looks {
        let Some(photo) = look.photo.filter(|photo| photo[0] > DARKEST && photo[channel] > DARKEST) else { continue };
        let tile = tiles.entry(look.tile).or_default();
        *tile = (tile.0 + f64::from(photo[0] / photo[channel]).ln(), tile.1 + 1.0);
    }
    let mut means = Pairs::default();
    tiles.values().filter(|(_, count)| *count >= FEWEST_OF_TILE).for_each(|(sum, count)| means.add(sum / count, 0.0));
    (means.deviations()[0], means.count() as usize)
}

type Bits = [u32; 3];

/// The area of an instance by base colour.
#[derive(Clone, Debug, Default)]
struct Fill {
    /// Unobserved, then observed, in square metres.
    by_value: BTreeMap<Bits, [f64; 2]>,
}

/// The base colour of observed and of unobserved texels.
fn fill(texels: &[CoarseTexel], base_color: &Texture) -> Fill {
    let mut fill = Fill::default();
    for texel in texels {
        let value = base_color.sample(texel.uv).map(f32::to_bits);
        fill.by_value.entry(value).or_default()[usize::from(texel.observed)] += texel.area_m2;
    }
    fill
}

/// A finding where one colour fills the area that the input picture does not show, and only that: the submission leaves
/// it empty, although it is scored like the rest. Instances that are observed nowhere or everywhere do not count: for
/// the former, a single colour is a legitimate answer.
fn left_empty<'a>(place: &str, fills: impl Iterator<Item = &'a Fill>) -> Option<Finding> {
    let mut by_value: BTreeMap<Bits, [f64; 2]> = BTreeMap::new();
    let mut all = [0.0; 2];
    for fill in fills {
        let areas = fill.by_value.values().fold([0.0; 2], |sum: [f64; 2], area| [sum[0] + area[0], sum[1] + area[1]]);
        if areas[0] <= 0.0 || areas[1] <= 0.0 {
            continue;
        }
        for (value, area) in &fill.by_value {
            let sum = by_value.entry(*value).or_default();
            *sum = [sum[0] + area[0], sum[1] + area[1]];
        }
        all = [all[0] + areas[0], all[1] + areas[1]];
    }
    let (value, empty) = by_value.iter().max_by(|a, b| a.1[0].total_cmp(&b.1[0]))?;
    let [unobserved, observed] = [empty[0] / all[0], empty[1] / all[1]];
    if unobserved < MOST_EMPTY || observed > MOST_FILLED {
        return None;
    }
    let [r, g, b] = value.map(f32::from_bits);
    let message = format!(
        "the area that the input picture does not show seems left empty: {:.0} % of it has exactly the base colour ({r:.3}, \
         {g:.3}, {b:.3}), and {:.0} % of the area that it shows",
        100.0 * unobserved,
        100.0 * observed
    );
    Some(warning("unobserved_empty", place, message, "fill every texel; unobserved ones are scored too"))
}

/// Of the maps with more than one value, how many there are and how many equal the truth's.
#[derive(Clone, Copy, Debug, Default)]
struct CopyCount {
    copies: usize,
    of: usize,
}

impl CopyCount {
    /// Counts an instance's maps; absent if the ground truth is withheld.
    fn of(folder: &SceneFolder, instance: &InstanceId, files: &[Option<MapFile>; 3]) -> Self {
        let mut count = Self::default();
        for (map, file) in Map::ALL.into_iter().zip(files) {
            let path = folder.truth_material(instance).join(map.stem()).with_extension("png");
            let Some(file) = file.as_ref().filter(|file| path.is_file() && !is_constant(&file.texture)) else {
                continue;
            };
            let encoding = if map == Map::BaseColor { Encoding::Srgb } else { Encoding::Linear };
            // Scoring reports a truth that cannot be read.
            let Ok(truth) = read_texture(&path, encoding, Wrap::Clamp) else { continue };
            count.of += 1;
            count.copies += usize::from(equal_texels(&file.texture, &truth));
        }
        count
    }
}

fn is_constant(texture: &Texture) -> bool {
    texture.clone().collapsed().width() == 1
}

fn equal_texels(map: &Texture, truth: &Texture) -> bool {
    let (width, height) = (truth.width(), truth.height());
    (map.width(), map.height()) == (width, height)
        && (0..width * height).all(|at| {
            let [a, b] = [map, truth].map(|texture| texture.texel(at % width, at / width));
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5)
        })
}

/// A note where most of a scene's maps are the truth's. A copy is not a fault, as the baseline `gt` shows, but a
/// ranking must not hide it.
fn copies(place: &str, instances: impl Iterator<Item = CopyCount>) -> Option<Finding> {
    let CopyCount { copies, of } = instances.fold(CopyCount::default(), |sum, count| CopyCount {
        copies: sum.copies + count.copies,
        of: sum.of + count.of,
    });
    (of > 0 && copies as f64 >= LEAST_COPIED * of as f64).then(|| {
        let message = format!("{copies} of {of} maps with more than one value are the truth's, texel by texel");
        note("copy_of_truth", place, message, "present it as an upper bound, not as a method")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An instance of one colour, seen in eight tiles of 40 pixels; `photo` is the picture's colour of a tile.
    fn facts(photo: impl Fn(usize) -> [f32; 3]) -> InstanceFacts {
        let look = |at: usize| Look {
            instance: 0,
            tile: at / 40,
            photo: Some(photo(at / 40)),
            base_color: [[0.5, 0.4, 0.3]; 5],
        };
        InstanceFacts { looks: (0..320).map(look).collect(), ..InstanceFacts::default() }
    }

    #[test]
    fn one_colour_is_reported_where_hues_differ_and_not_where_light_does() {
        let lit = facts(|tile| [0.1, 0.08, 0.06].map(|value| value * (1 + tile) as f32));
        assert_eq!(one_colour(&lit), None);
        let striped = facts(|tile| if tile % 2 == 0 { [0.5, 0.1, 0.1] } else { [0.1, 0.1, 0.5] });
        assert_eq!(one_colour(&striped).map(|found| found.code), Some("one_colour".to_owned()));
        // Several colours are no finding.
        let mut painted = striped;
        painted.looks[7].base_color[0] = [0.1; 3];
        assert_eq!(one_colour(&painted), None);
    }
}
