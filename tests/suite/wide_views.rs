//! Views from other places than the input view's: what they show of the unseen is what straight lines say, and what they
//! score leaves the numbers of the other views alone.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use glam::{DMat4, DVec2, DVec3};
use mateval_dataset::Camera;
use mateval_dataset::glb;
use mateval_image::{exr_io, png_io};
use mateval_testkit::kept_folder;
use serde_json::Value;

use super::command::{baseline, build, render_for_scores, run, run_words, verify};
use super::sample::{json, write_source};

const HEAD: &str = "resolution = [64, 48]\natlas_size = 128\nviews = [{ id = \"up_left\", x_deg = 5, y_deg = 5 }]\n";
const WIDE: &str = "wide = { count = 3, distance_m = [0.3, 0.9] }\n";

/// A folder with the dataset `wide`, and `plain` without wide views, each with its results `gt.json` and `nn.json`.
static SCORED: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("wide_views");
    for (name, head) in [("plain", HEAD.to_owned()), ("wide", format!("{HEAD}{WIDE}"))] {
        let dataset = folder.join(name);
        run(&mut build(&write_source(&folder.join(format!("source-{name}")), &head, &["room"]), &dataset)).ends_with(0);
        run(&mut render_for_scores(&dataset, 8, 16)).ends_with(0);
        for method in ["gt", "nn"] {
            let submission = folder.join(format!("{name}-{method}"));
            run(&mut baseline(method, &dataset, &submission)).ends_with(0);
            let words =
                ["eval", "score"].map(PathBuf::from).into_iter().chain([submission.clone(), "--dataset".into()]);
            run_words(words.chain([dataset.clone(), "--out".into(), submission.with_extension("json")])).ends_with(0);
        }
    }
    folder
});

fn result(name: &str) -> Value {
    json(&SCORED.join(format!("{name}.json")))
}

/// The views of the dataset `wide`.
fn views() -> Vec<Value> {
    json(&SCORED.join("wide/scenes/room/scene.json"))["views"].as_array().unwrap().clone()
}

#[test]
fn drawn_views_stand_where_they_should() {
    let views = views();
    let ids: Vec<&str> = views.iter().map(|view| view["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["input", "up_left", "wide_1", "wide_2", "wide_3"]);
    let place = |view: &Value| {
        DVec3::from_array([0, 1, 2].map(|row| view["camera"]["world_from_camera"][row][3].as_f64().unwrap()))
    };
    for (view, distance) in views[2..].iter().zip([0.3, 0.6, 0.9]) {
        assert!((place(view).distance(place(&views[0])) - distance).abs() < 1e-9, "{view}");
        assert!((view["wide"]["distance_m"].as_f64().unwrap() - distance).abs() < 1e-9);
        let unseen = view["wide"]["unseen_share"].as_f64().unwrap();
        assert!(unseen > 0.0 && unseen < 0.7, "{unseen}");
    }
    assert!(views[1].get("wide").is_none());
    run(&mut verify(&SCORED.join("wide"))).ends_with(0);
}

/// A view that is moved by a centimetre, and one that states another distance, are found.
#[test]
fn a_moved_view_is_found() {
    let twin = kept_folder("wide_views_moved").join("dataset");
    mateval_testkit::copy_folder(&SCORED.join("wide"), &twin);
    let path = twin.join("scenes/room/scene.json");
    let mut scene = json(&path);
    let x = &mut scene["views"][3]["camera"]["world_from_camera"][0][3];
    *x = (x.as_f64().unwrap() + 0.01).into();
    scene["views"][4]["wide"]["distance_m"] = 0.5.into();
    std::fs::write(&path, scene.to_string()).unwrap();
    run(&mut verify(&twin)).ends_with(1).prints("/views/3/camera").prints("the view states 0.5 m");
}

/// Triangles of all instances, as corners.
fn triangles(dataset: &Path) -> Vec<[DVec3; 3]> {
    let nodes = glb::read(&dataset.join("scenes/room/geometry/instances.glb")).unwrap();
    let of_mesh = |mesh: &mateval_dataset::TriangleMesh| -> Vec<[DVec3; 3]> {
        mesh.triangles.iter().map(|corners| corners.map(|at| mesh.positions[at as usize].as_dvec3())).collect()
    };
    nodes.iter().flat_map(|node| of_mesh(&node.mesh)).collect()
}

/// The distance to a triangle along a direction (Möller and Trumbore 1997), in units of the direction's length.
fn distance([a, b, c]: &[DVec3; 3], from: DVec3, way: DVec3) -> Option<f64> {
    let (ab, ac) = (*b - *a, *c - *a);
    let normal = way.cross(ac);
    let scale = ab.dot(normal);
    let to = from - *a;
    let (u, cross) = (to.dot(normal) / scale, to.cross(ab));
    let (v, t) = (way.dot(cross) / scale, ac.dot(cross) / scale);
    (scale != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

fn camera(view: &Value) -> Camera {
    serde_json::from_value(view["camera"].clone()).unwrap()
}

/// The mask of every wide view, pixel by pixel, against a straight line from the input camera through all triangles.
#[test]
fn unobserved_pixels_are_those_that_no_line_reaches() {
    let dataset = SCORED.join("wide");
    let (triangles, views) = (triangles(&dataset), views());
    let input = camera(&views[0]);
    let eye = DMat4::from_cols_array_2d(&input.world_from_camera).transpose().w_axis.truncate();
    for view in &views[2..] {
        let folder = dataset.join("scenes/room/views").join(view["id"].as_str().unwrap());
        let depth = exr_io::read_scalar(&folder.join("depth.exr")).unwrap();
        let [valid, unobserved] =
            ["valid.png", "unobserved.png"].map(|file| png_io::read_mask(&folder.join(file)).unwrap());
        let (mut all, mut hidden, mut strays) = (0, 0, 0);
        for (x, y) in (0..48).flat_map(|y| (0..64).map(move |x| (x, y))).filter(|&(x, y)| valid.get(x, y)) {
            let pixel = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let point = camera(view).unproject(pixel, f64::from(depth.get(x, y)));
            let is_in_frame = input.project(point).is_some_and(|(place, _)| input.holds(place));
            let way = point - eye;
            let nearest =
                triangles.iter().filter_map(|triangle| distance(triangle, eye, way)).fold(f64::INFINITY, f64::min);
            let is_seen = is_in_frame && nearest > 1.0 - 2e-3;
            all += 1;
            hidden += usize::from(is_in_frame && !is_seen);
            strays += usize::from(is_seen == unobserved.get(x, y));
        }
        // Lines that graze an edge may pass or not.
        assert!(strays * 200 <= all, "{}: {strays} of {all}", view["id"]);
        assert!(hidden * 200 > all, "{}: {hidden} of {all} are in the frame and hidden", view["id"]);
    }
}

/// The numbers of input and turned views do not know of wide views; the twin, another pass of the same views, does.
#[test]
fn other_views_score_what_they_did() {
    for method in ["gt", "nn"] {
        let [plain, wide] =
            ["plain", "wide"].map(|name| result(&format!("{name}-{method}"))["protocols"]["mateval-3"].clone());
        let [plain, wide] = [&plain["summary"], &wide["summary"]].map(|summary| summary.as_object().unwrap());
        let mut compared = 0;
        for (key, value) in plain {
            assert_eq!(value, &wide[key], "{method} {key}");
            compared += 1;
        }
        assert!(compared > 40, "{compared}");
        let of_wide = wide.keys().filter(|key| key.contains(".wide")).count();
        assert_eq!(wide.len() - of_wide, compared);
        assert!(of_wide > 10, "{of_wide}");
    }
}

/// What the input view shows is all that `nn` knows, so it falls; the truth does not.
#[test]
fn nearest_neighbours_fall_and_the_truth_does_not() {
    let psnr = |method: &str, key: &str| {
        let summary = &result(&format!("wide-{method}"))["protocols"]["mateval-3"]["summary"];
        summary[key].as_f64().unwrap_or_else(|| panic!("no {key}"))
    };
    for (picture, fall) in [("albedo", 1.0), ("rgb_true", 0.5)] {
        let [input, wide] = ["input", "wide"].map(|views| psnr("nn", &format!("{picture}.{views}.psnr")));
        let [truth_input, truth_wide] = ["input", "wide"].map(|views| psnr("gt", &format!("{picture}.{views}.psnr")));
        assert!(input > wide + fall, "{picture}: {input} {wide}");
        assert!(truth_wide > truth_input - 1.5 && truth_wide > wide + 3.0, "{picture}: {truth_input} {truth_wide}");
    }
    assert!(psnr("nn", "albedo.wide.psnr") > psnr("nn", "albedo.wide_unobserved.psnr") + 0.5);
    let file = result("wide-nn");
    assert_eq!(file["dataset"]["wide_views"]["room"].as_object().unwrap().len(), 3);
}

/// The board has a page of curves.
#[test]
fn the_board_shows_curves() {
    let site = kept_folder("wide_views_site").join("site");
    let results = ["gt", "nn"].map(|method| SCORED.join(format!("wide-{method}.json")));
    let words =
        ["eval", "leaderboard"].map(PathBuf::from).into_iter().chain(results).chain(["--out".into(), site.clone()]);
    run_words(words).ends_with(0);
    let page = std::fs::read_to_string(site.join("wide_views.html")).unwrap();
    assert!(page.contains("<polyline") && page.contains("Albedo, PSNR") && page.contains("0.90 m"), "{page}");
    assert!(std::fs::read_to_string(site.join("index.html")).unwrap().contains("wide_views.html"));
}

/// Where no place is free, the view is left out with a finding, and the scene is built.
#[test]
fn a_view_without_a_free_place_is_left_out() {
    let folder = kept_folder("wide_views_far");
    let head = format!("{HEAD}wide = {{ count = 1, distance_m = [9.5, 9.9] }}\n");
    let dataset = folder.join("dataset");
    run(&mut build(&write_source(&folder.join("source"), &head, &["room"]), &dataset)).ends_with(0);
    let scene = json(&dataset.join("scenes/room/scene.json"));
    assert_eq!(scene["views"].as_array().unwrap().len(), 2);
    let findings = scene["findings"].as_array().unwrap();
    let found = findings.iter().find(|finding| finding["code"] == "no_wide_view").unwrap();
    assert_eq!(found["place"], "view 'wide_1'");
    run(&mut verify(&dataset)).ends_with(0);
}
