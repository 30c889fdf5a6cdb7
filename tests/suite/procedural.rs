//! `baseline procedural`: a pattern that the input view shows in part continues where it shows nothing.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use glam::{DVec2, DVec3};
use mateval_baselines::estimate::Estimate;
use mateval_baselines::geometry::SceneGeometry;
use mateval_baselines::geometry::SeenPixels;
use mateval_baselines::lift::{Texel, lift, place_of};
use mateval_dataset::open::Dataset;
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_image::exr_io::{self, Precision};
use mateval_image::transfer::linear_from_srgb_byte;
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_procedural::library::entry;
use mateval_testkit::kept_folder;

use super::command::{Run, baseline, run};
use super::lifting::{ROOM, base_colors};
use super::sample::{files_below, json};

/// Sides of a field of the checks, in metres.
const FIELD: [f64; 2] = [0.31, 0.23];
/// The turn of the checks about the vertical, in radians.
const TURN: f64 = 0.4;
const COLORS: [[f32; 3]; 2] = [[0.55, 0.4, 0.2], [0.12, 0.2, 0.3]];

/// The colour of the floor at a place.
fn check(place: DVec3) -> [f32; 3] {
    let turned = DVec2::from_angle(TURN).rotate(DVec2::new(place.x, place.z)) / DVec2::from(FIELD);
    COLORS[(turned.floor().element_sum().rem_euclid(2.0)) as usize]
}

/// An estimate of the sample's room whose floor has checks; all else is grey. The estimate has four times the pixels of
/// the input view a side.
static ESTIMATE: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("procedural-estimate");
    std::fs::create_dir_all(&folder).unwrap();
    let dataset = Dataset::open(&ROOM).unwrap();
    let scene = &dataset.scenes[0];
    let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene).unwrap();
    let size = (4 * geometry.valid.width(), 4 * geometry.valid.height());
    let mut picture = Picture::filled(size.0, size.1, LinearRgb([0.5; 3]));
    for point in SeenPixels::new(&geometry, size).points(&geometry) {
        if geometry.scene.instances[point.instance].id.as_str() == "floor" {
            picture.set(point.pixel.0, point.pixel.1, LinearRgb(check(point.place)));
        }
    }
    exr_io::write_linear(&folder.join("room.exr"), &picture, Precision::Float).unwrap();
    let adapter = "name = \"checks\"\n[base_color]\nfiles = [\"{scene}.exr\"]\nencoding = \"linear\"\n";
    std::fs::write(folder.join("checks.toml"), adapter).unwrap();
    folder
});

fn words() -> [String; 4] {
    let path = |name: &str| ESTIMATE.join(name).to_string_lossy().into_owned();
    ["--estimate".to_owned(), path(""), "--adapter".to_owned(), path("checks.toml")]
}

fn procedural(out: &Path, more: &[&str], threads: usize) -> Run {
    let mut command = baseline("procedural", &ROOM, out);
    run(command.args(words()).args(more).env("RAYON_NUM_THREADS", threads.to_string()))
}

/// The submission on two threads.
static SUBMISSION: LazyLock<PathBuf> = LazyLock::new(|| {
    let out = kept_folder("procedural").join("submission");
    procedural(&out, &[], 2).ends_with(0).prints("submission.report/index.html");
    out
});

/// What `nn` makes of the estimate.
static NEAREST: LazyLock<PathBuf> = LazyLock::new(|| {
    let out = kept_folder("procedural-nn").join("nn");
    run(baseline("nn", &ROOM, &out).args(words())).ends_with(0);
    out
});

/// The submission with `--keep-seen`. A slash at the end of its path does not move its report.
static KEPT: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("procedural-kept");
    let out = folder.join("kept/");
    procedural(&out, &["--keep-seen"], 2).ends_with(0).prints("kept.report/index.html");
    assert!(folder.join("kept.report/report.json").is_file());
    out
});

/// Mean square error of the floor's base colour over all its texels, those that the input view does not show included,
/// with `moved` added to every place of the truth.
fn floor_error(submission: &Path, moved: DVec3) -> f64 {
    let dataset = Dataset::open(&ROOM).unwrap();
    let scene = &dataset.scenes[0];
    let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene).unwrap();
    let floor = scene.instances.iter().position(|instance| instance.id.as_str() == "floor").unwrap();
    let baked = png_io::read_rgb_bytes(&submission.join("scenes/room/floor/base_color.png")).unwrap();
    let (mesh, size) = (geometry.mesh(floor), baked.width());
    let atlas = UvAtlas::new(mesh, size);
    let (mut sum, mut count) = (0.0, 0.0);
    for (x, y) in (0..size).flat_map(|y| (0..size).map(move |x| (x, y))) {
        let Some((triangle, true)) = atlas.owner(x, y) else { continue };
        let place = place_of(&atlas, mesh, triangle, DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        let baked = baked.get(x, y).map(linear_from_srgb_byte);
        let pairs = baked.iter().zip(check(place + moved));
        sum += pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / 3.0;
        count += 1.0;
    }
    assert!(count > 10_000.0, "{count} texels");
    sum / count
}

#[test]
fn a_pattern_continues_where_nothing_is_seen() {
    let report = json(&report().join("report.json"));
    assert_eq!(report["format"], "mateval-procedural/1");
    let parts = report["scenes"][0]["parts"].as_array().unwrap();
    let floor = parts.iter().find(|part| part["instance"] == "floor").unwrap();
    assert_eq!((&floor["reason"], &floor["chosen"]["graph"]), (&"graph".into(), &"checks".into()), "{floor}");
    // Grey parts are one colour.
    let graphs: Vec<_> = parts.iter().filter(|part| part["reason"] == "graph").collect();
    assert_eq!(graphs.len(), 1, "{graphs:?}");
    assert!(parts.iter().any(|part| part["reason"] == "one_color"));

    let exact = floor_error(&SUBMISSION, DVec3::ZERO);
    let shifted = floor_error(&SUBMISSION, DVec3::new(0.06, 0.0, 0.0));
    assert!(exact < 0.004 && shifted > 2.0 * exact, "{exact} {shifted}");
    assert!(floor_error(&NEAREST, DVec3::ZERO) > 4.0 * exact, "{exact}");
}

/// The estimate has base colour alone: one-coloured parts have the format's roughness, graphs their own, and nothing is a
/// mirror.
#[test]
fn maps_that_the_estimate_lacks_are_no_zeros() {
    for submission in [&*KEPT, &*SUBMISSION] {
        let path = |map: &str| submission.join("scenes/room/floor").join(map);
        let bytes = |map: &str| image::open(path(map)).unwrap().to_luma8().into_raw();
        assert!(bytes("roughness.png").iter().all(|byte| *byte > 25), "{submission:?}");
        assert!(bytes("metallic.png").iter().all(|byte| *byte == 0));
        // The twin: an instance without a graph has neither.
        assert!(!submission.join("scenes/room/ceiling/roughness.png").exists());
    }
}

#[test]
fn threads_do_not_change_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("submission");
    procedural(&out, &[], 1).ends_with(0);
    for (one, two) in [(out.clone(), SUBMISSION.clone()), (folder.path().join("submission.report"), report())] {
        let files = files_below(&one);
        assert!(files.len() > 3 && files == files_below(&two), "{files:?}");
        for file in files {
            assert!(std::fs::read(one.join(&file)).unwrap() == std::fs::read(two.join(&file)).unwrap(), "{file:?}");
        }
    }
}

fn report() -> PathBuf {
    SUBMISSION.with_file_name("submission.report")
}

/// Every picture of the page exists, and the graphs are those that were baked.
#[test]
fn the_report_shows_what_was_baked() {
    let html = std::fs::read_to_string(report().join("index.html")).unwrap();
    let shown: Vec<&str> = html.split("<img src=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    // Estimate and result of the room and of the floor, and the floor's graph; the room is not rendered.
    assert_eq!(shown.len(), 5, "{shown:?}");
    assert!(
        shown.iter().all(|picture| report().join(picture).is_file())
            && !html.contains("http:")
            && !html.contains("https:")
    );
    let text = std::fs::read_to_string(report().join("room/materials.mtlx")).unwrap();
    let graph = mateval_procedural::mtlx::read_text("materials.mtlx", &text).unwrap();
    let size = |name: &str| graph.parameters[graph.parameter(name).unwrap()].value.numbers()[0];
    let mut sizes = [size("size_u"), size("size_v")];
    sizes.sort_by(f64::total_cmp);
    assert!((sizes[0] / FIELD[1] - 1.0).abs() < 0.01 && (sizes[1] / FIELD[0] - 1.0).abs() < 0.01, "{sizes:?}");
    assert_eq!(graph.nodes.len(), entry("checks").unwrap().graph().unwrap().nodes.len());
}

/// With `--keep-seen` texels that the input view shows are those of `nn`, and the pattern continues in the others.
#[test]
fn seen_texels_are_kept_on_request() {
    let dataset = Dataset::open(&ROOM).unwrap();
    let scene = &dataset.scenes[0];
    let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene).unwrap();
    let picture = exr_io::read_linear(&ESTIMATE.join("room.exr")).unwrap();
    let seen = SeenPixels::new(&geometry, (picture.width(), picture.height()));
    let estimate = Estimate { base_color: Some(picture), ..Estimate::default() };
    let all = |submission: &Path| base_colors(submission).into_iter().collect::<BTreeMap<_, _>>();
    let [kept_colors, nn_colors, graph_colors] = [&KEPT, &NEAREST, &SUBMISSION].map(|submission| all(submission));
    let mut counts = [0; 2];
    for (at, instance) in scene.instances.iter().enumerate().filter(|(_, instance)| instance.atlas.is_some()) {
        let [kept, nn, graph] = [&kept_colors, &nn_colors, &graph_colors].map(|colors| &colors[instance.id.as_str()]);
        let size = kept.width();
        // An instance of which no pixel counts has small maps in `nn`.
        if nn.width() != size {
            continue;
        }
        let known = lift(&geometry, &seen, &estimate, at, size);
        for (texel, [kept, nn, graph]) in known
            .texels
            .pixels()
            .iter()
            .zip((0..size * size).map(|texel| [kept.pixels()[texel], nn.pixels()[texel], graph.pixels()[texel]]))
        {
            if let Texel::Seen(_) = texel {
                assert_eq!(kept, nn, "{}", instance.id);
                counts[usize::from(kept != graph)] += 1;
            }
        }
    }
    assert!(counts[0] > 5_000 && counts[1] > 500, "{counts:?}");
    assert!(floor_error(&KEPT, DVec3::ZERO) < 0.25 * floor_error(&NEAREST, DVec3::ZERO));
}

#[test]
fn what_makes_no_sense_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let refused = |more: &[&str]| procedural(&out, more, 2).ends_with(2);
    refused(&["--detail", "1.5"]).says("the detail is 1.5; expected 0 to 1");
    refused(&["--detail", "nan"]).says("expected 0 to 1");
    refused(&["--lights", "stage"]).says("--lights is for --estimate delight alone");
    refused(&["--part-set", "none"]).says("no part set 'none'");
    let graphs = folder.path().join("graphs");
    std::fs::create_dir(&graphs).unwrap();
    let path = graphs.to_string_lossy().into_owned();
    refused(&["--graphs", &path]).says("holds 0 .mtlx files; expected 1 to 256");
    std::fs::write(graphs.join("bad.mtlx"), "<materialx version=\"1.39\"><image/></materialx>").unwrap();
    refused(&["--graphs", &path]).says("bad.mtlx");
    let taken = entry("brick").unwrap().text;
    std::fs::write(graphs.join("bad.mtlx"), taken).unwrap();
    refused(&["--graphs", &path]).says("has the graph 'brick', which is built in");
    assert!(!out.exists() && !folder.path().join("out.report").exists());
    // Somebody's own folder is not replaced.
    std::fs::create_dir(folder.path().join("out.report")).unwrap();
    std::fs::write(folder.path().join("out.report/mine.txt"), "mine").unwrap();
    refused(&[]).says("already exists");
    refused(&["--force"]).says("holds no report.json");
}
