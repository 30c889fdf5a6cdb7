//! One room as a scene: the parts of other rooms that are kept, names, lights, and a render.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

use glam::DVec2;
use mateval_scene::Camera;
use mateval_scene::camera::Intrinsics;
use mateval_scene::ids::id_text_from;
use mateval_scene::material::{ColorInput, MaterialModel};
use mateval_scene::reference::Emission;
use mateval_tracer::{Ray, RenderSettings, World, render};

use super::*;
use crate::source_scene::SourceScene;

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
    scene.scene.surfaces.iter().map(of).collect()
}

/// The surfaces that a grid of single rays through the picture hits.
fn met(camera: &Camera, side: u32) -> BTreeSet<usize> {
    let world = world();
    let origin = camera.position().as_vec3();
    let places = (0..side * side).map(|k| {
        let share = |v: u32, size: u32| (f64::from(v) + 0.5) / f64::from(side) * f64::from(size);
        DVec2::new(share(k % side, camera.intrinsics.width), share(k / side, camera.intrinsics.height))
    });
    places
        .filter_map(|place| world.first_hit(&Ray::endless(origin, camera.direction(place).as_vec3())))
        .map(|hit| hit.surface.0)
        .collect()
}

/// Camera 1 looks from the living room through the passage into the bedroom; camera 0 looks the other way.
#[test]
fn only_visible_parts_of_other_rooms_are_kept() {
    let house = furnished();
    let scene = scene_from(1);
    let kept = in_house(&scene);
    assert_eq!(scene.origins.len(), kept.len());
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
    let ids: BTreeSet<String> = scene.scene.surfaces.iter().map(|surface| id_text_from(&surface.name, "")).collect();
    assert_eq!(ids.len(), scene.scene.surfaces.len());
    assert!(scene.scene.surfaces.iter().any(|surface| surface.name == "Dining Chair 4"));
    assert!(scene.scene.surfaces.iter().any(|surface| surface.name.starts_with("MasterBedroom-102 ")));
    let lights: BTreeSet<&str> = scene.scene.lights.iter().map(|light| light.name.as_str()).collect();
    assert_eq!(lights.len(), scene.scene.lights.len());
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
        scene.scene.surfaces.iter().map(|surface| id_text_from(&surface.name, "object")).collect();
    assert_eq!(ids.len(), scene.scene.surfaces.len());
    assert!(!ids.contains("world"));
    let lights: BTreeSet<&str> = scene.scene.lights.iter().map(|light| light.name.as_str()).collect();
    assert_eq!(lights.len(), scene.scene.lights.len());
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
    let lights = &scene.scene.lights;
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
                    let material = &scene.scene.materials[scene.scene.surfaces[lamp].material.0];
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
        let material = &scene.scene.materials[scene.scene.surfaces[own].material.0];
        let source = &house.scene.materials[house.scene.surfaces[at].material.0];
        assert_eq!(material.name, source.name);
        let texture = |model: &MaterialModel| match model {
            MaterialModel::Principled { base_color: ColorInput::Texture { texture, .. }, .. } => Some(texture.0),
            _ => None,
        };
        let names = (
            texture(&material.model).map(|at| &scene.scene.textures[at].name),
            texture(&source.model).map(|at| &house.scene.textures[at].name),
        );
        assert_eq!(names.0, names.1);
    }
    // Unused materials and textures are removed.
    assert!(scene.scene.textures.len() < house.scene.textures.len());
    let world = World::new(Arc::new(scene.scene)).unwrap();
    let settings = RenderSettings { samples: 1, ..RenderSettings::default() };
    let made = render(&world, &scene.camera, &settings, &|_, _| ()).unwrap();
    assert_eq!(made.stats.not_finite, 0);
    let texels = made.picture.pixels();
    assert_eq!(texels.len(), 48 * 32);
    assert!(texels.iter().filter(|rgb| rgb.0.iter().all(|v| *v > 0.0)).count() > 1000);
}
