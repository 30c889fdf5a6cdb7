//! Bad texels in submissions for the sample: what scoring reads, and that lint reports the same.

use std::cell::Cell;
use std::path::{Path, PathBuf};

use mateval_image::exr_io::{Precision, write_linear, write_scalar};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Picture, Texture, Wrap};
use mateval_scene::dataset::SceneFile;
use mateval_scene::open::Dataset;
use mateval_scene::submission::{Map, instance_folder};
use mateval_scene::uv_atlas::UvAtlas;
use mateval_scene::{Finding, Severity, glb};
use mateval_submission::atlas_meshes::AtlasMeshes;
use mateval_submission::lint::{LintPlan, lint};
use mateval_submission::prediction::{PredictedScene, read_scene};
use mateval_testkit::sample_dataset::{dataset, write_truth};

use super::lint::copy_public;

fn room() -> &'static SceneFile {
    dataset().scenes.iter().find(|scene| scene.id.as_str() == "room").unwrap()
}

/// `gt` with the maps of every instance of the room written as EXR, each texel `value(instance, x, y, side)` in all channels
/// where that is a number and the truth elsewhere.
fn planted(value: impl Fn(usize, usize, usize, usize) -> Option<f32>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_truth(&submission(&folder));
    for (at, instance) in room().instances.iter().enumerate().filter(|(_, instance)| instance.atlas.is_some()) {
        for map in Map::ALL {
            let png =
                instance_folder(&submission(&folder), &room().id, &instance.id).join(map.stem()).with_extension("png");
            let encoding = if map == Map::BaseColor { Encoding::Srgb } else { Encoding::Linear };
            let truth = read_texture(&png, encoding, Wrap::Clamp).unwrap();
            std::fs::remove_file(&png).unwrap();
            let (side, exr) = (truth.width(), png.with_extension("exr"));
            let texel = |x: usize, y: usize| value(at, x, y, side).map_or(truth.texel(x, y), |value| [value; 3]);
            if map == Map::BaseColor {
                let picture = Picture::from_fn(side, side, |x, y| LinearRgb(texel(x, y)));
                write_linear(&exr, &picture, Precision::Float).unwrap();
            } else {
                let picture = Picture::from_fn(side, side, |x, y| texel(x, y)[0]);
                write_scalar(&exr, &picture, Precision::Float).unwrap();
            }
        }
    }
    folder
}

fn submission(folder: &tempfile::TempDir) -> PathBuf {
    folder.path().join("gt")
}

fn read(submission: &Path) -> PredictedScene {
    read_scene(submission, room(), &AtlasMeshes::on_demand(dataset(), room())).unwrap()
}

/// The texels of each atlas from which a lookup in a triangle is at most a texel away, by the rasteriser that bakes the
/// truth.
fn owners() -> Vec<Vec<bool>> {
    let nodes = glb::read(&dataset().folder(&room().id).instances()).unwrap();
    let owned = |(node, side): (glb::GlbNode, usize)| {
        let atlas = UvAtlas::new(&node.mesh, side);
        (0..side * side).map(|at| atlas.owner(at % side, at / side).is_some()).collect()
    };
    let sides = room().instances.iter().map(|instance| instance.atlas.as_ref().map_or(1, |atlas| atlas.size as usize));
    nodes.into_iter().zip(sides).map(owned).collect()
}

fn bits(texture: &Texture, at: usize, side: usize) -> [u32; 3] {
    texture.texel(at % side % texture.width(), at / side % texture.height()).map(f32::to_bits)
}

/// Gutters of NaN and infinity, in every map: no finding, and what lies on the surfaces is read to the last bit.
#[test]
fn gutters_may_hold_anything() {
    let owners = owners();
    let near = |instance: usize, x: usize, y: usize, side: usize| {
        let around = |at: usize| at.saturating_sub(1)..(at + 2).min(side);
        around(y).any(|y| around(x).any(|x| owners[instance][y * side + x]))
    };
    let count = Cell::new(0);
    let value = |at: usize, x: usize, y: usize, side: usize| {
        let is_gutter = !near(at, x, y, side);
        count.set(count.get() + usize::from(is_gutter));
        is_gutter.then_some(if x.is_multiple_of(2) { f32::NAN } else { f32::INFINITY })
    };
    let [sound, damaged] = [read(&submission(&planted(|_, _, _, _| None))), read(&submission(&planted(value)))];
    assert_eq!(damaged.findings, Vec::new());
    assert!(count.get() > 10_000, "{} texels were changed", count.get());
    let mut counts = [0; 2];
    for (at, (sound, damaged)) in sound.materials.iter().zip(&damaged.materials).enumerate() {
        let (Some(sound), Some(damaged)) = (sound, damaged) else { continue };
        let side = room().instances[at].atlas.as_ref().unwrap().size as usize;
        for (texel, owned) in owners[at].iter().enumerate() {
            counts[usize::from(*owned)] += 1;
            let equal = |map: Map| bits(sound.texture(map), texel, side) == bits(damaged.texture(map), texel, side);
            assert!(!owned || Map::ALL.into_iter().all(equal), "{at} {texel}");
        }
    }
    assert!(counts.iter().all(|count| *count > 10_000), "{counts:?}");
}

/// Some bad texels everywhere, so that some maps keep theirs and none is sound.
fn sprinkled() -> tempfile::TempDir {
    planted(|at, x, y, _| (x * 31 + y * 17 + at).is_multiple_of(211).then_some(f32::NAN))
}

#[test]
fn lint_reports_what_scoring_reports() {
    let folder = sprinkled();
    let read = read(&submission(&folder));
    let scored: Vec<Finding> = read.findings.into_iter().filter(|finding| finding.code == "bad_texels").collect();
    assert!(scored.len() > 20 && scored.iter().all(|finding| finding.severity == Severity::Warning), "{scored:?}");
    let plan = LintPlan { dataset: dataset(), submission: &submission(&folder), tool: "test".to_owned() };
    let file = lint(&plan, &|_| ()).unwrap();
    let folded = file.findings.iter().find(|finding| finding.code == "bad_texels").unwrap();
    let sorted = |mut all: Vec<Finding>| {
        all.sort();
        all
    };
    assert_eq!(sorted(folded.examples.clone()), sorted(scored));
}

#[test]
fn maps_are_the_same_for_any_number_of_threads() {
    let folder = sprinkled();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| read(&submission(&folder)))
    };
    let [one, several] = [with(1), with(5)];
    assert_eq!((one.scattering_key, one.findings), (several.scattering_key, several.findings));
    for (one, several) in one.materials.iter().zip(&several.materials) {
        let (Some(one), Some(several)) = (one, several) else { continue };
        assert!(Map::ALL.into_iter().all(|map| one.texture(map).bytes() == several.texture(map).bytes()));
    }
}

/// A changed `instances.glb` is an error for maps with bad texels, and unnecessary for sound ones.
#[test]
fn atlases_are_read_for_bad_texels_only() {
    let public = tempfile::tempdir().unwrap();
    copy_public(&dataset().root, public.path());
    let opened = Dataset::open(public.path()).unwrap();
    std::fs::write(opened.folder(&room().id).instances(), "glTF").unwrap();
    let read =
        |folder: &tempfile::TempDir| read_scene(&submission(folder), room(), &AtlasMeshes::on_demand(&opened, room()));
    assert_eq!(read(&planted(|_, _, _, _| None)).unwrap().findings, Vec::new());
    assert!(read(&sprinkled()).unwrap_err().to_string().contains("instances.glb"));
}
