//! Checks, with independent code, that cameras found by the sampler satisfy the rules.

use std::collections::BTreeMap;

use glam::DVec2;
use mateval_scene::Camera;
use mateval_scene::camera::Intrinsics;
use mateval_tracer::{Ray, World};

use super::*;
use crate::front3d::camera_rules::{CameraRules, SamplerRules};
use crate::front3d::camera_sampler::{CameraError, FoundCamera, Refusals, RoomSampler, score, score_grid};

/// The default intrinsics of a recipe.
const TURNS: [[f64; 2]; 4] = [[5.0, 5.0], [5.0, -5.0], [-5.0, 5.0], [-5.0, -5.0]];

fn intrinsics() -> Intrinsics {
    Intrinsics::from_fov_y(480, 270, 50_f64.to_radians())
}

fn world() -> World {
    World::new(bare().scene.clone()).unwrap()
}

/// The living room's camera for a seed.
fn sample(house: &FurnishedHouse, rules: &SamplerRules, seed: u64) -> Result<FoundCamera, CameraError> {
    let world = World::new(house.scene.clone()).unwrap();
    RoomSampler::new(house, &world, LIVING)?.sample(intrinsics(), &TURNS, rules, seed)
}

/// A few cameras of a room, from the seeds that find one.
fn found(world: &World, room: usize, rules: &SamplerRules) -> Vec<FoundCamera> {
    let sampler = RoomSampler::new(bare(), world, room).unwrap();
    (0..6).filter_map(|seed| sampler.sample(intrinsics(), &TURNS, rules, seed).ok()).collect()
}

/// The distance to a triangle, by a search with thousands of tries instead of a formula.
fn nearest_by_search([a, b, c]: [DVec3; 3], from: DVec3) -> f64 {
    let at = |u: f64, v: f64| (a + (b - a) * u + (c - a) * v).distance(from);
    let (mut best, mut step) = ([1.0_f64 / 3.0; 2], 0.5);
    while step > 1e-5 {
        let mut better = best;
        for (du, dv) in [(1., 0.), (-1., 0.), (0., 1.), (0., -1.), (1., -1.), (-1., 1.), (1., 1.), (-1., -1.)] {
            let u = (best[0] + du * step).clamp(0.0, 1.0);
            let v = (best[1] + dv * step).clamp(0.0, 1.0 - u);
            if at(u, v) < at(better[0], better[1]) {
                better = [u, v];
            }
        }
        if better == best {
            step /= 2.0;
        }
        best = better;
    }
    at(best[0], best[1])
}

/// The distance to the nearest surface in the picture in metres, by `side` x `side` rays.
fn nearest_seen(world: &World, camera: &Camera, side: u32) -> f64 {
    let mut nearest = f64::INFINITY;
    for k in 0..side * side {
        let share = |v: u32, size: u32| (f64::from(v) + 0.5) / f64::from(side) * f64::from(size);
        let place = DVec2::new(share(k % side, camera.intrinsics.width), share(k / side, camera.intrinsics.height));
        let ray = Ray::endless(camera.position().as_vec3(), camera.direction(place).as_vec3());
        nearest = world.first_hit(&ray).map_or(nearest, |hit| nearest.min(f64::from(hit.distance)));
    }
    nearest
}

#[test]
fn same_seed_same_camera() {
    let rules = SamplerRules::default();
    let of = |seed| sample(bare(), &rules, seed);
    let (one, again, other) = (of(1).unwrap(), of(1).unwrap(), of(2).unwrap());
    assert_eq!(one, again);
    assert_ne!(one.camera, other.camera);
}

/// Cameras are above their own floor, inside their room and level, have the height and pitch that the rules state, and
/// have nothing within the clearance.
#[test]
fn cameras_stand_free_in_their_room() {
    let (house, world) = (bare(), world());
    let rules = SamplerRules::default();
    let mut seen = 0;
    for room in [LIVING, 1] {
        let floor =
            house.placed.iter().position(|p| p.room == room && p.origin.role.architecture_kind() == Some("Floor"));
        let [low, high] = bounds(&house.scene.surfaces[floor.unwrap()].mesh);
        for found in found(&world, room, &rules) {
            let at = found.camera.position();
            assert!(at.x > f64::from(low.x) && at.x < f64::from(high.x), "{at}");
            assert!(at.z > f64::from(low.z) && at.z < f64::from(high.z), "{at}");
            assert!((1.4..=1.8).contains(&(at.y - f64::from(high.y))), "{at}");
            let forward = -found.camera.rotation().z_axis;
            let down = (-forward.y).asin().to_degrees();
            assert!((13.34..=20.0).contains(&down), "{down}");
            assert!(found.camera.rotation().x_axis.y.abs() < 1e-9);
            let triangles = house.scene.surfaces.iter().flat_map(|surface| {
                (0..surface.mesh.triangles.len()).map(|at| surface.mesh.corners(at).map(|p| p.as_dvec3()))
            });
            let radius = |t: &[DVec3; 3]| (t[1] - t[0]).length().max((t[2] - t[0]).length());
            let near = triangles.filter(|t| t[0].distance(at) < radius(t) + 0.5);
            let nearest = near.map(|t| nearest_by_search(t, at)).fold(f64::INFINITY, f64::min);
            assert!(nearest >= rules.clearance_m - 1e-4, "{nearest}");
            assert!(found.score > rules.min_score && found.nearest_m >= 1.0);
            assert!((2.5..=3.5).contains(&found.mean_m), "{}", found.mean_m);
            seen += 1;
        }
    }
    assert!(seen >= 4, "{seen}");
}

/// With ten times as many rays a side in all five views, surfaces between the sampler's rays are not much nearer.
#[test]
fn nothing_near_is_seen() {
    let world = world();
    let rules = SamplerRules::default();
    let mut worst = f64::INFINITY;
    for room in [LIVING, 1] {
        for found in found(&world, room, &rules) {
            let views = TURNS.iter().map(|turn| found.camera.turned(turn[0], turn[1])).chain([found.camera]);
            for view in views {
                worst = worst.min(nearest_seen(&world, &view, 100));
            }
        }
    }
    assert!(worst >= rules.min_distance_m, "{worst}");
}

/// The twin: without the rule, near surfaces are seen.
#[test]
fn without_the_rule_near_things_are_seen() {
    let world = world();
    let rules = SamplerRules { min_distance_m: 0.0, ..SamplerRules::default() };
    let all = found(&world, LIVING, &rules);
    assert!(all.iter().any(|found| nearest_seen(&world, &found.camera, 100) < 1.0));
}

/// The fork's cameras may look at the outside and at near walls; BlenderProc's rules refuse most of them.
#[test]
fn the_forks_cameras_have_a_score_of_furniture_alone() {
    let (house, world) = (bare(), world());
    let rules = CameraRules::ThreeDlg.sampler_rules();
    let all = found(&world, LIVING, &rules);
    assert_eq!(all.len(), 6);
    for found in &all {
        let seen: Vec<Option<usize>> = score_grid(&found.camera.intrinsics)
            .map(|place| {
                let ray = Ray::endless(found.camera.position().as_vec3(), found.camera.direction(place).as_vec3());
                world.first_hit(&ray).map(|hit| hit.surface.0)
            })
            .collect();
        let again = score(house, &seen, &rules);
        assert!(again >= 0.5 && (again - found.score).abs() < 0.2 * found.score, "{again} {}", found.score);
    }
    let blenderproc = SamplerRules::default();
    let in_range = |found: &&FoundCamera| (2.5..=3.5).contains(&found.mean_m) && found.nearest_m >= 1.0;
    assert!(all.iter().filter(in_range).count() < all.len());
    assert!(blenderproc.min_score > rules.min_score && blenderproc.clearance_m == rules.clearance_m);
}

#[test]
fn rooms_without_a_camera_are_reported() {
    let mut house = bare().clone();
    let rules = SamplerRules { tries: 200, ..SamplerRules::default() };
    // The room is too small for the wanted distances.
    let refusals = |error| match error {
        CameraError::NoneFound { room, refusals, .. } if room == "LivingDiningRoom-101" => refusals,
        other => panic!("{other}"),
    };
    let total =
        |of: Refusals| of.off_floor + of.sees_outside + of.too_near + of.mean_distance + of.low_score + of.no_clearance;
    let far = SamplerRules { mean_distance_m: [50.0, 60.0], ..rules };
    let error = sample(&house, &far, 1).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("none of 200") && message.contains("outside 50 to 60 m"), "{message}");
    let found = refusals(error);
    assert!(found.mean_distance > 0 && total(found) == 200, "{found:?}");
    let near = SamplerRules { clearance_m: 3.0, ..rules };
    let error = sample(&house, &near, 1).unwrap_err();
    assert!(error.to_string().contains("within 3 m"), "{error}");
    let found = refusals(error);
    assert!(found.no_clearance > 0 && total(found) == 200, "{found:?}");
    // The room has no floor.
    for placed in &mut house.placed {
        if placed.room == LIVING && placed.origin.role.architecture_kind() == Some("Floor") {
            placed.origin.role = Role::Architecture { kind: "Other".into() };
        }
    }
    let error = sample(&house, &rules, 1).unwrap_err();
    assert_eq!(error, CameraError::NoFloor { room: "LivingDiningRoom-101".to_owned() });
}

/// The fork's score of six cameras, computed by hand: the mean weight times the entropy of the hits of furniture.
#[test]
fn the_forks_score_is_an_entropy() {
    let house = bare();
    let rules = CameraRules::ThreeDlg.sampler_rules();
    let of_name = |word: &str| {
        let is_it = |p: &PlacedSurface| p.model.as_ref().is_some_and(|model| model.name.contains(word));
        house.placed.iter().position(is_it).unwrap()
    };
    let is_plain = |p: &PlacedSurface| {
        p.model.as_ref().is_some_and(|m| !["chair", "sofa", "table", "bed"].iter().any(|word| m.name.contains(word)))
    };
    let (sofa, chair) = (of_name("sofa"), of_name("chair"));
    let plain = house.placed.iter().position(is_plain).unwrap();
    let wall = house.placed.iter().position(|p| p.model.is_none()).unwrap();
    for (hits, expected) in [
        // Walls alone: no weight. One instance: no entropy.
        (vec![(wall, 100)], 0.0),
        (vec![(sofa, 50), (wall, 50)], 0.0),
        // Two instances alike: 10 weight of a fifth of the rays, 1 bit.
        (vec![(sofa, 10), (chair, 10), (wall, 80)], 2.0),
        // A quarter and three quarters: 0.811278 bits.
        (vec![(sofa, 5), (chair, 15), (wall, 80)], 2.0 * 0.811_278_124_459_133),
        // Plain furniture weighs 1: (100 + 10) / 100 with 1 bit.
        (vec![(sofa, 10), (plain, 10)], 1.1),
        // Three alike: log2 3 bits, (10 + 10 + 1) weights of 10 rays each.
        (vec![(sofa, 10), (chair, 10), (plain, 10)], 2.1 * 1.584_962_500_721_156),
    ] {
        let mut seen: Vec<Option<usize>> =
            hits.iter().flat_map(|(surface, count)| std::iter::repeat_n(Some(*surface), *count)).collect();
        seen.resize(100, None);
        let found = score(house, &seen, &rules);
        assert!((found - expected).abs() < 1e-9, "{hits:?}: {found} {expected}");
    }
}

/// BlenderProc's sum, computed by hand: 50 rays at a sofa, 30 at walls, 20 at the floor:
/// (500 + 30 + 20) / 100 * 3 / 3 * (0.5 * 0.7 * 0.8) = 1.54.
#[test]
fn scores_are_those_of_the_formula() {
    let house = bare();
    let of_kind =
        |kind: &str| house.placed.iter().position(|p| p.origin.role.architecture_kind() == Some(kind)).unwrap();
    let of_name = |word: &str| {
        let is_it = |p: &PlacedSurface| p.model.as_ref().is_some_and(|model| model.name.contains(word));
        house.placed.iter().position(is_it).unwrap()
    };
    let rays = |all: &[(usize, usize)]| -> Vec<Option<usize>> {
        all.iter().flat_map(|(surface, count)| std::iter::repeat_n(Some(*surface), *count)).collect()
    };
    let (sofa, wall, floor) = (of_name("sofa"), of_kind("WallInner"), of_kind("Floor"));
    let rules = SamplerRules::default();
    let found = score(house, &rays(&[(sofa, 50), (wall, 30), (floor, 20)]), &rules);
    assert!((found - 1.54).abs() < 1e-12, "{found}");
    // Rays that hit nothing lower the score: (200 + 0) / 100 * 1 / 3 * 0.8.
    let mut open = rays(&[(sofa, 20)]);
    open.resize(100, None);
    assert!((score(house, &open, &rules) - 2.0 / 3.0 * 0.8).abs() < 1e-12);
    // Where architecture weighs nothing: (500 + 0) / 100 * 3 / 3 * (0.5 * 0.7 * 0.8) = 1.4.
    let light = SamplerRules { architecture_weight: 0, ..rules };
    let found = score(house, &rays(&[(sofa, 50), (wall, 30), (floor, 20)]), &light);
    assert!((found - 1.4).abs() < 1e-12, "{found}");
    // If one kind fills the picture, the score is 0.
    assert_eq!(score(house, &rays(&[(wall, 100)]), &rules), 0.0);
    // Two surfaces of one kind count as one: 100 / 100 * 2 / 3 * 0.4 * 0.6.
    let walls: Vec<usize> = (0..house.placed.len())
        .filter(|at| house.placed[*at].origin.role.architecture_kind() == Some("WallInner"))
        .collect();
    assert!(walls.len() > 1);
    let found = score(house, &rays(&[(walls[0], 30), (walls[1], 30), (floor, 40)]), &rules);
    assert!((found - 0.16).abs() < 1e-12, "{found}");
    let mut names: BTreeMap<&str, usize> = BTreeMap::new();
    for placed in &house.placed {
        if let Some(PlacedModel { name, .. }) = &placed.model {
            assert_eq!(*name, name.to_lowercase());
            *names.entry(name).or_insert(0) += 1;
        }
    }
    assert!(names.len() > 5, "{names:?}");
}
