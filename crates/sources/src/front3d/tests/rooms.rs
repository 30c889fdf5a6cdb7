//! Rooms: checks, with independent code, that cameras found by the sampler satisfy the rules; and one room as a scene:
//! the parts of other rooms that are kept, names, lights, and a render.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

use glam::DVec2;
use mateval_dataset::Camera;
use mateval_dataset::camera::Intrinsics;
use mateval_dataset::ids::id_text_from;
use mateval_dataset::material::{ColorInput, MaterialModel};
use mateval_dataset::reference::Emission;
use mateval_tracer::{Hit, Ray, RenderSettings, World, render};

use super::*;
use crate::front3d::camera_rules::{CameraRules, SamplerRules};
use crate::front3d::camera_sampler::{CameraError, FoundCamera, Refusal, RoomSampler, score, score_grid};
use crate::source_scene::SourceScene;

/// The default intrinsics of a recipe.
const TURNS: [[f64; 2]; 4] = [[5.0, 5.0], [5.0, -5.0], [-5.0, 5.0], [-5.0, -5.0]];

fn intrinsics() -> Intrinsics {
    Intrinsics::from_fov_y(480, 270, 50_f64.to_radians())
}

fn bare_world() -> &'static World {
    static WORLD: OnceLock<World> = OnceLock::new();
    WORLD.get_or_init(|| World::new(bare().scene.clone()).unwrap())
}

/// The living room's camera for a seed.
fn sample(house: &FurnishedHouse, rules: &SamplerRules, seed: u64) -> Result<FoundCamera, CameraError> {
    let world = World::new(house.scene.clone()).unwrap();
    RoomSampler::new(house, &world, LIVING)?.sample(intrinsics(), &TURNS, rules, seed)
}

/// A few cameras of the living room and the bedroom by BlenderProc's rules.
fn found_by_default() -> &'static [Vec<FoundCamera>; 2] {
    static FOUND: OnceLock<[Vec<FoundCamera>; 2]> = OnceLock::new();
    FOUND.get_or_init(|| [LIVING, 1].map(|room| found(room, &SamplerRules::default())))
}

/// A few cameras of a room, from the seeds that find one.
fn found(room: usize, rules: &SamplerRules) -> Vec<FoundCamera> {
    let sampler = RoomSampler::new(bare(), bare_world(), room).unwrap();
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

/// What `side` x `side` rays through the picture hit.
fn hits(world: &World, camera: &Camera, side: u32) -> impl Iterator<Item = Hit> {
    (0..side * side).filter_map(move |k| {
        let share = |v: u32, size: u32| (f64::from(v) + 0.5) / f64::from(side) * f64::from(size);
        let place = DVec2::new(share(k % side, camera.intrinsics.width), share(k / side, camera.intrinsics.height));
        world.first_hit(&Ray::endless(camera.position().as_vec3(), camera.direction(place).as_vec3()))
    })
}

/// The distance to the nearest surface in the picture in metres.
fn nearest_seen(world: &World, camera: &Camera, side: u32) -> f64 {
    hits(world, camera, side).map(|hit| f64::from(hit.distance)).fold(f64::INFINITY, f64::min)
}

/// The first surface that is a piece whose name contains `word`.
fn piece_named(word: &str) -> usize {
    let is_it = |p: &PlacedSurface| p.model.as_ref().is_some_and(|model| model.name.contains(word));
    bare().placed.iter().position(is_it).unwrap()
}

/// A hundred rays: these counts at these surfaces, the others at nothing.
fn rays(counts: &[(usize, usize)]) -> Vec<Option<usize>> {
    let mut all: Vec<Option<usize>> =
        counts.iter().flat_map(|(surface, count)| std::iter::repeat_n(Some(*surface), *count)).collect();
    all.resize(100, None);
    all
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
    let house = bare();
    let rules = SamplerRules::default();
    let mut seen = 0;
    for (room, cameras) in [LIVING, 1].into_iter().zip(found_by_default()) {
        let floor = house.placed.iter().position(|p| p.room == room && is_kind(p, "Floor"));
        let [low, high] = bounds(&house.scene.surfaces[floor.unwrap()].mesh);
        for found in cameras {
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
    let rules = SamplerRules::default();
    let mut worst = f64::INFINITY;
    for found in found_by_default().iter().flatten() {
        let views = TURNS.iter().map(|turn| found.camera.turned(turn[0], turn[1])).chain([found.camera]);
        for view in views {
            worst = worst.min(nearest_seen(bare_world(), &view, 100));
        }
    }
    assert!(worst >= rules.min_distance_m, "{worst}");
}

/// The twin: without the rule, near surfaces are seen.
#[test]
fn without_the_rule_near_things_are_seen() {
    let all = found(LIVING, &SamplerRules { min_distance_m: 0.0, ..SamplerRules::default() });
    assert!(all.iter().any(|found| nearest_seen(bare_world(), &found.camera, 100) < 1.0));
}

/// The fork's cameras may look at the outside and at near walls; BlenderProc's rules refuse most of them.
#[test]
fn the_forks_cameras_have_a_score_of_furniture_alone() {
    let (house, world) = (bare(), bare_world());
    let rules = CameraRules::ThreeDlg.sampler_rules();
    let all = found(LIVING, &rules);
    assert_eq!(all.len(), 6);
    for found in &all {
        let ray = |place| Ray::endless(found.camera.position().as_vec3(), found.camera.direction(place).as_vec3());
        let places = score_grid(&found.camera.intrinsics);
        let seen: Vec<Option<usize>> =
            places.map(|place| world.first_hit(&ray(place)).map(|hit| hit.surface.0)).collect();
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
    let far = SamplerRules { mean_distance_m: [50.0, 60.0], ..rules };
    let error = sample(&house, &far, 1).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("none of 200") && message.contains("outside 50 to 60 m"), "{message}");
    let found = refusals(error);
    assert!(found[&Refusal::MeanDistance] > 0 && found.values().sum::<u32>() == 200, "{found:?}");
    let near = SamplerRules { clearance_m: 3.0, ..rules };
    let error = sample(&house, &near, 1).unwrap_err();
    assert!(error.to_string().contains("within 3 m"), "{error}");
    let found = refusals(error);
    assert!(found[&Refusal::NoClearance] > 0 && found.values().sum::<u32>() == 200, "{found:?}");
    // The room has no floor.
    for placed in &mut house.placed {
        if placed.room == LIVING && is_kind(placed, "Floor") {
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
    let is_plain = |p: &PlacedSurface| {
        p.model.as_ref().is_some_and(|m| !["chair", "sofa", "table", "bed"].iter().any(|word| m.name.contains(word)))
    };
    let [sofa, chair] = ["sofa", "chair"].map(piece_named);
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
        let found = score(house, &rays(&hits), &rules);
        assert!((found - expected).abs() < 1e-9, "{hits:?}: {found} {expected}");
    }
}

/// BlenderProc's sum, computed by hand: 50 rays at a sofa, 30 at walls, 20 at the floor:
/// (500 + 30 + 20) / 100 * 3 / 3 * (0.5 * 0.7 * 0.8) = 1.54.
#[test]
fn scores_are_those_of_the_formula() {
    let house = bare();
    let of_kind =
        |kind: &str| (0..house.placed.len()).filter(|at| is_kind(&house.placed[*at], kind)).collect::<Vec<_>>();
    let (walls, floor) = (of_kind("WallInner"), of_kind("Floor")[0]);
    let (sofa, wall) = (piece_named("sofa"), walls[0]);
    let rules = SamplerRules::default();
    let found = score(house, &rays(&[(sofa, 50), (wall, 30), (floor, 20)]), &rules);
    assert!((found - 1.54).abs() < 1e-12, "{found}");
    // Rays that hit nothing lower the score: (200 + 0) / 100 * 1 / 3 * 0.8.
    assert!((score(house, &rays(&[(sofa, 20)]), &rules) - 2.0 / 3.0 * 0.8).abs() < 1e-12);
    // Where architecture weighs nothing: (500 + 0) / 100 * 3 / 3 * (0.5 * 0.7 * 0.8) = 1.4.
    let light = SamplerRules { architecture_weight: 0, ..rules };
    let found = score(house, &rays(&[(sofa, 50), (wall, 30), (floor, 20)]), &light);
    assert!((found - 1.4).abs() < 1e-12, "{found}");
    // If one kind fills the picture, the score is 0.
    assert_eq!(score(house, &rays(&[(wall, 100)]), &rules), 0.0);
    // Two surfaces of one kind count as one: 100 / 100 * 2 / 3 * 0.4 * 0.6.
    let found = score(house, &rays(&[(walls[0], 30), (walls[1], 30), (floor, 40)]), &rules);
    assert!((found - 0.16).abs() < 1e-12, "{found}");
    let names: BTreeSet<&str> = house.placed.iter().filter_map(|p| Some(p.model.as_ref()?.name.as_str())).collect();
    assert!(names.len() > 5 && names.iter().all(|name| *name == name.to_lowercase()), "{names:?}");
}

/// A designer's camera of the house.
fn snapshot(number: usize) -> Camera {
    let own = &furnished().cameras[number];
    let intrinsics = Intrinsics::from_fov_y(48, 32, own.fov_y_deg.to_radians());
    Camera::look_at(own.position, own.target, DVec3::Y, intrinsics).unwrap()
}

/// The furnished house ready for rays, made once for each process.
fn world() -> &'static World {
    static WORLD: OnceLock<World> = OnceLock::new();
    WORLD.get_or_init(|| World::new(furnished().scene.clone()).unwrap())
}

fn scene_from(number: usize) -> SourceScene {
    room_scene::room_scene(furnished(), world(), LIVING, &[snapshot(number)])
}

/// The house's index of each surface of the scene, found by its mesh, which is unchanged.
fn in_house(scene: &SourceScene) -> Vec<usize> {
    let house = furnished();
    let of = |surface: &Surface| house.scene.surfaces.iter().position(|own| own.mesh == surface.mesh).unwrap();
    scene.read.scene.surfaces.iter().map(of).collect()
}

/// The surfaces that a grid of single rays through the picture hits.
fn met(camera: &Camera, side: u32) -> BTreeSet<usize> {
    hits(world(), camera, side).map(|hit| hit.surface.0).collect()
}

/// Camera 1 looks from the living room through the passage into the bedroom; camera 0 looks the other way.
#[test]
fn only_visible_parts_of_other_rooms_are_kept() {
    let house = furnished();
    let scene = scene_from(1);
    let kept = in_house(&scene);
    assert_eq!(scene.read.origins.len(), kept.len());
    let met = met(&snapshot(1), 300);
    let is_furniture = |at: &usize| house.placed[*at].origin.role.is_furniture();
    let of_room = |room: usize| (0..house.placed.len()).filter(move |at| house.placed[*at].room == room);

    // The whole living room, all walls of the bedroom, nothing of the library.
    assert!(of_room(LIVING).all(|at| kept.contains(&at)));
    assert!(of_room(1).filter(|at| !is_furniture(at)).all(|at| kept.contains(&at)));
    assert!(of_room(LIBRARY).all(|at| !kept.contains(&at)), "the library cannot be seen");
    // Only the furniture of the bedroom that rays hit, which is not all of it.
    let bedroom = |all: &mut dyn Iterator<Item = usize>| -> BTreeSet<usize> {
        all.filter(|at| house.placed[*at].room == 1).filter(is_furniture).collect()
    };
    let (kept_pieces, met_pieces) = (bedroom(&mut kept.iter().copied()), bedroom(&mut met.iter().copied()));
    assert!(!kept_pieces.is_empty() && kept_pieces.len() < 6, "{kept_pieces:?}");
    // A finer grid may hit slivers that the picture's rays miss.
    assert!(kept_pieces.is_subset(&met_pieces), "{kept_pieces:?} {met_pieces:?}");
    let coarse = self::met(&snapshot(1), 24);
    assert!(coarse.iter().all(|at| kept.contains(at)));

    // Twin.
    let other = in_house(&scene_from(0));
    assert!(other.iter().all(|at| house.placed[*at].room == LIVING));
    assert_eq!(other.len(), of_room(LIVING).count());
}

#[test]
fn names_are_unique_as_ids() {
    let scene = scene_from(1);
    let ids: BTreeSet<String> =
        scene.read.scene.surfaces.iter().map(|surface| id_text_from(&surface.name, "")).collect();
    assert_eq!(ids.len(), scene.read.scene.surfaces.len());
    assert!(scene.read.scene.surfaces.iter().any(|surface| surface.name == "Dining Chair 4"));
    assert!(scene.read.scene.surfaces.iter().any(|surface| surface.name.starts_with("MasterBedroom-102 ")));
    let lights: BTreeSet<&str> = scene.read.scene.lights.iter().map(|light| light.name.as_str()).collect();
    assert_eq!(lights.len(), scene.read.scene.lights.len());
}

/// Untrusted names that collide with each other's numbered form, that have the maximum length of an id, or that equal
/// the world's.
#[test]
fn untrusted_names_are_unique_too() {
    let mut house = furnished().clone();
    let long = "x".repeat(60);
    let names = ["world", "a", "a", "a 2", "a-2", "", "-", "object 2", long.as_str(), long.as_str(), long.as_str()];
    for (surface, name) in Arc::make_mut(&mut house.scene).surfaces.iter_mut().zip(names.iter().cycle()) {
        (*name).clone_into(&mut surface.name);
    }
    let scene = room_scene::room_scene(&house, world(), LIVING, &[snapshot(1)]);
    let ids: BTreeSet<String> =
        scene.read.scene.surfaces.iter().map(|surface| id_text_from(&surface.name, "object")).collect();
    assert_eq!(ids.len(), scene.read.scene.surfaces.len());
    assert!(!ids.contains("world"));
    let lights: BTreeSet<&str> = scene.read.scene.lights.iter().map(|light| light.name.as_str()).collect();
    assert_eq!(lights.len(), scene.read.scene.lights.len());
}

/// One group for each colour of ceiling and room, one for each lamp, and the world, whose emission alone is visible to
/// the camera. Radiances are BlenderProc's: 0.8 times the colour, 7, 0.05.
#[test]
fn lights_are_ceilings_lamps_and_the_world() {
    let house = furnished();
    let scene = scene_from(1);
    let kept = in_house(&scene);
    let mut ceilings: BTreeMap<(usize, [u32; 3]), Vec<usize>> = BTreeMap::new();
    let mut lamps = Vec::new();
    for (at, own) in kept.iter().enumerate() {
        let placed = &house.placed[*own];
        match &placed.origin.role {
            Role::Architecture { kind } if kind.contains("Ceiling") => {
                ceilings.entry((placed.room, placed.color.map(f32::to_bits))).or_default().push(at);
            }
            Role::LightFixture {} => lamps.push(at),
            _ => {}
        }
    }
    let lights = &scene.read.scene.lights;
    assert_eq!(lights.len(), ceilings.len() + lamps.len() + 1);
    assert!(ceilings.len() >= 2 && lamps.len() >= 2, "{ceilings:?} {lamps:?}");
    for light in lights {
        assert_eq!(light.camera_visible, light.name == "world");
        match &light.emission {
            Emission::Constant { radiance } => assert_eq!((light.name.as_str(), *radiance), ("world", [0.05; 3])),
            Emission::Area { surfaces, radiance, map, two_sided } => {
                assert!(two_sided);
                let all: Vec<usize> = surfaces.iter().map(|surface| surface.0).collect();
                if let [lamp] = all[..]
                    && lamps.contains(&lamp)
                {
                    assert_eq!(*radiance, [7.0; 3]);
                    let material = &scene.read.scene.materials[scene.read.scene.surfaces[lamp].material.0];
                    let MaterialModel::Principled { base_color, .. } = material.model else { panic!("{material:?}") };
                    let map = map.expect("a lamp of the house has a texture");
                    assert_eq!(base_color, ColorInput::Texture { texture: map.texture, uv: map.uv });
                    continue;
                }
                let color = house.placed[kept[all[0]]].color;
                assert_eq!((*radiance, *map), (color.map(|v| 0.8 * v), None));
                assert_eq!(ceilings[&(house.placed[kept[all[0]]].room, color.map(f32::to_bits))], all);
            }
            other => panic!("{other:?}"),
        }
    }
}

/// Indices refer to the same things as in the house, and the picture is not black.
#[test]
fn a_room_can_be_rendered() {
    let house = furnished();
    let scene = scene_from(1);
    for (own, at) in in_house(&scene).into_iter().enumerate() {
        let material = &scene.read.scene.materials[scene.read.scene.surfaces[own].material.0];
        let source = &house.scene.materials[house.scene.surfaces[at].material.0];
        assert_eq!(material.name, source.name);
        let texture = |model: &MaterialModel| match model {
            MaterialModel::Principled { base_color: ColorInput::Texture { texture, .. }, .. } => Some(texture.0),
            _ => None,
        };
        let names = (
            texture(&material.model).map(|at| &scene.read.scene.textures[at].name),
            texture(&source.model).map(|at| &house.scene.textures[at].name),
        );
        assert_eq!(names.0, names.1);
    }
    // Unused materials and textures are removed.
    assert!(scene.read.scene.textures.len() < house.scene.textures.len());
    let world = World::new(Arc::new(scene.read.scene)).unwrap();
    let settings = RenderSettings { samples: 1, ..RenderSettings::default() };
    let made = render(&world, &scene.camera, &settings, &|_, _| ()).unwrap();
    assert_eq!(made.stats.not_finite, 0);
    let texels = made.picture.pixels();
    assert_eq!(texels.len(), 48 * 32);
    assert!(texels.iter().filter(|rgb| rgb.0.iter().all(|v| *v > 0.0)).count() > 1000);
}
