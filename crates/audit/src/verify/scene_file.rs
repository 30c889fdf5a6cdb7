//! Checks that `scene.json` is consistent: indices, references, cameras.

use std::collections::BTreeSet;

use glam::DMat3;
use mateval_scene::dataset::{Part, SceneFile, View, WideView};
use mateval_scene::layout::INPUT;
use mateval_scene::{Camera, ViewId};

use mateval_prep::faults::Faults;

const FILE: &str = "scene.json";
/// Largest deviation of a camera's rotation from orthonormality, and of a view's camera from the turned input camera.
const CAMERA_SLACK: f64 = 1e-9;

/// Checks the views, and the instances with their parts.
pub(super) fn check(scene: &SceneFile, faults: &mut Faults) {
    check_views(scene, faults);
    check_numbers(scene, faults);
}

fn check_views(scene: &SceneFile, faults: &mut Faults) {
    let Some(input) = scene.views.first().filter(|view| view.id.as_str() == INPUT) else {
        faults.add("bad_view", FILE, "/views/0", "the first view must be 'input'");
        return;
    };
    let mut ids = BTreeSet::new();
    for (at, view) in scene.views.iter().enumerate() {
        let place = format!("/views/{at}/camera");
        if !ids.insert(&view.id) {
            faults.add("bad_view", FILE, format!("/views/{at}/id"), format!("'{}' is listed twice", view.id));
        }
        let rotation = view.camera.rotation();
        let turned_back = rotation.transpose() * rotation;
        let is_rotation = turned_back.abs_diff_eq(DMat3::IDENTITY, CAMERA_SLACK) && rotation.determinant() > 0.0;
        if !is_rotation || view.camera.world_from_camera[3] != [0.0, 0.0, 0.0, 1.0] {
            faults.add("bad_camera", FILE, &place, "world_from_camera is not a rotation and a translation");
        }
        let k = view.camera.intrinsics;
        let is_valid = k.fx > 0.0 && k.fy > 0.0 && k.cx.is_finite() && k.cy.is_finite() && k.width > 0 && k.height > 0;
        if !is_valid {
            faults.add(
                "bad_camera",
                FILE,
                format!("{place}/intrinsics"),
                "expected focal lengths and a size above 0, and a finite principal point",
            );
        }
        check_place(view, &input.camera, at, faults);
    }
}

/// Checks that a turned view is the input camera turned, and that a wide view is as far from it as it states.
fn check_place(view: &View, input: &Camera, at: usize, faults: &mut Faults) {
    let place = format!("/views/{at}/camera");
    if view.camera.intrinsics != input.intrinsics {
        faults.add("bad_camera", FILE, format!("{place}/intrinsics"), "differ from those of the input camera");
    }
    match &view.wide {
        _ if view.wide.is_some() != view.id.is_wide() => {
            let message = format!("a view has this key if and only if its id begins with '{}'", ViewId::WIDE);
            faults.add("bad_view", FILE, format!("/views/{at}/wide"), message);
        }
        None => {
            let expected = input.turned(view.x_deg, view.y_deg);
            if !view.camera.matrix().abs_diff_eq(expected.matrix(), CAMERA_SLACK) {
                let (x_deg, y_deg) = (view.x_deg, view.y_deg);
                let message = format!("differs from the input camera turned by {x_deg} and {y_deg} degrees");
                faults.add("bad_camera", FILE, &place, message);
            }
        }
        Some(WideView { distance_m, unseen_share }) => {
            let found = view.camera.position().distance(input.position());
            // Also refuses numbers that are not finite.
            let is_stated = (found - distance_m).abs() <= CAMERA_SLACK;
            if !is_stated {
                let message = format!("is {found} m from the input camera, and the view states {distance_m} m");
                faults.add("bad_camera", FILE, &place, message);
            }
            if !(0.0..=1.0).contains(unseen_share) {
                let message = format!("found {unseen_share}, expected 0 to 1");
                faults.add("bad_view", FILE, format!("/views/{at}/wide/unseen_share"), message);
            }
        }
    }
}

fn check_numbers(scene: &SceneFile, faults: &mut Faults) {
    let mut ids = BTreeSet::new();
    for (at, instance) in scene.instances.iter().enumerate() {
        if usize::from(instance.index.0.get()) != at + 1 {
            faults.add("bad_index", FILE, format!("/instances/{at}/index"), format!("expected {}", at + 1));
        }
        if !ids.insert(&instance.id) {
            faults.add(
                "duplicate_id",
                FILE,
                format!("/instances/{at}/id"),
                format!("'{}' is listed twice", instance.id),
            );
        }
    }
    check_parts(scene, &scene.parts, "/parts", faults);
    let mut sets = BTreeSet::new();
    for (at, set) in scene.part_sets.iter().enumerate() {
        if !sets.insert(&set.id) {
            faults.add("duplicate_id", FILE, format!("/part_sets/{at}/id"), format!("'{}' is listed twice", set.id));
        }
        check_parts(scene, &set.parts, &format!("/part_sets/{at}/parts"), faults);
    }
}

/// Checks one set of parts, whose JSON pointer is `pointer`.
fn check_parts(scene: &SceneFile, parts: &[Part], pointer: &str, faults: &mut Faults) {
    let instances: BTreeSet<_> = scene.instances.iter().map(|instance| &instance.id).collect();
    let mut ids = BTreeSet::new();
    for (at, part) in parts.iter().enumerate() {
        if usize::from(part.index.0.get()) != at + 1 {
            faults.add("bad_index", FILE, format!("{pointer}/{at}/index"), format!("expected {}", at + 1));
        }
        if !ids.insert(&part.id) {
            faults.add("duplicate_id", FILE, format!("{pointer}/{at}/id"), format!("'{}' is listed twice", part.id));
        }
        if !instances.contains(&part.instance) {
            let message = format!("the scene has no instance '{}'", part.instance);
            faults.add("dangling_reference", FILE, format!("{pointer}/{at}/instance"), message);
        }
    }
    for (at, instance) in scene.instances.iter().enumerate() {
        let of_parts: usize = parts.iter().filter(|part| part.instance == instance.id).map(|part| part.triangles).sum();
        if of_parts != instance.triangles {
            let message = format!("{} triangles, but its parts in {pointer} have {of_parts}", instance.triangles);
            faults.add("bad_parts", FILE, format!("/instances/{at}"), message);
        }
    }
}
