//! The stage of a plain closed room.

use std::sync::Arc;

use mateval_scene::dataset::{FORMAT, Instance, SceneSource, TrueMaterials, View};
use mateval_scene::{InstanceId, InstanceIndex, Role, SceneId, SceneLights, SourceKind, TriangleMesh, ViewId};
use mateval_testkit::box_room::{WALLS, box_room, camera, quad};

use super::*;

fn world(more: Vec<TriangleMesh>) -> World {
    World::new(Arc::new(box_room(more))).unwrap()
}

fn rules() -> StageRules {
    StageRules::default()
}

fn named(lights: &[NamedLight], start: &str) -> Vec<NamedLight> {
    lights.iter().filter(|light| light.name.starts_with(start)).cloned().collect()
}

fn normal(light: &StageLight) -> Vec3 {
    let [a, b, c] = light.mesh.corners(0);
    (b - a).cross(c - a).normalize()
}

#[test]
fn an_empty_room() {
    let lights = lights(&rules(), &world(Vec::new()), &WALLS, &[camera()]);
    // Four columns; the picture's upper edge rises by 0.325 a metre: the ceiling, 1.3 above, is in view from 4 metres
    // before the camera on. Cells end 0.25 beyond their middles, which are at 0.5, 1.5, ...
    let ceiling = named(&lights, "ceiling");
    assert_eq!(ceiling.len(), 4 * 3, "{:?}", ceiling.iter().map(|l| &l.name).collect::<Vec<_>>());
    for NamedLight { light, .. } in &ceiling {
        assert!(light.mesh.positions.iter().all(|p| (p.y - 2.499).abs() < 1e-5 && p.z > 1.6 && p.z < 5.5));
        assert!((light.mesh.positions[0].distance(light.mesh.positions[1]) - 0.5).abs() < 1e-5);
        assert!((normal(light) - Vec3::NEG_Y).length() < 1e-6);
    }
    let camera_light = &named(&lights, "camera")[0].light;
    assert!((normal(camera_light) - Vec3::NEG_Z).length() < 1e-6);
    assert!(camera_light.mesh.positions.iter().all(|p| (p.z - 6.0).abs() < 1e-5));
    // The side walls are in view, that behind the camera is not: 80 % of 4 x 2.5.
    let walls = named(&lights, "wall");
    assert_eq!(walls.len(), 1);
    let [a, b, c] = walls[0].light.mesh.corners(0).map(|p| p.as_dvec3());
    assert!(((b - a).cross(c - a).length() - 0.64 * 10.0).abs() < 1e-4);
    assert!((a.z - 5.999).abs() < 1e-5 && normal(&walls[0].light).z < -0.999);
}

/// Turned views see more of the room, so that fewer cells and walls get a light.
#[test]
fn no_light_lies_in_any_view() {
    let turned = camera().turned(5.0, 5.0);
    let room = world(Vec::new());
    let one = lights(&rules(), &room, &WALLS, &[camera()]);
    let two = lights(&rules(), &room, &WALLS, &[camera(), turned]);
    assert!(named(&two, "ceiling").len() < named(&one, "ceiling").len());
}

/// A screen across the room hides its far part, and a low ledge is not a wall.
#[test]
fn hidden_and_low_pieces_get_no_light() {
    let screen = quad([0.0, 0.0, 3.0], [4.0, 0.0, 0.0], [0.0, 2.5, 0.0]);
    let ledge = quad([0.0, 1.0, 5.9], [4.0, 0.0, 0.0], [0.0, 0.2, 0.0]);
    let lights = lights(&rules(), &world(vec![screen, ledge]), &[2, 3, 4, 5, 6, 7], &[camera()]);
    let ceiling = named(&lights, "ceiling");
    assert!(!ceiling.is_empty());
    assert!(ceiling.iter().all(|light| light.light.mesh.positions.iter().all(|p| p.z > 3.0)));
    // Now no view sees the side walls either; neither the screen nor the ledge is one of them.
    let walls = named(&lights, "wall");
    assert_eq!(walls.len(), 3);
    assert!(walls.iter().all(|wall| wall.light.mesh.positions[0].y < 0.3));
    assert_eq!(walls.iter().filter(|wall| normal(&wall.light).x.abs() > 0.99).count(), 2);
}

/// The names of the lights in a room whose architecture is a piece of furniture or a wall that no view sees: a screen behind
/// the camera, of the given role and without a category.
fn lights_with_screen(role: &Role) -> Vec<NamedLight> {
    let screen = quad([0.5, 0.0, 5.8], [3.0, 0.0, 0.0], [0.0, 2.4, 0.0]);
    let world = world(vec![screen]);
    let wall = Role::Architecture { kind: "WallInner".to_owned() };
    let roles = std::iter::repeat_n(&wall, 6).chain([role]);
    let scene = SceneFile {
        format: FORMAT.to_owned(),
        id: SceneId::new("room").unwrap(),
        source: SceneSource {
            kind: SourceKind::Front3d,
            house: "house".to_owned(),
            states_roughness: false,
            states_metallic: false,
            shift_m: [0.0; 3],
            files: Vec::new(),
        },
        lights: SceneLights::Stage,
        materials: TrueMaterials::Converted,
        exposure: 1.0,
        photo: None,
        views: vec![View { id: ViewId::new("input").unwrap(), x_deg: 0.0, y_deg: 0.0, camera: camera(), wide: None }],
        instances: roles.zip(1..).map(|(role, index)| instance(index, role)).collect(),
        parts: Vec::new(),
        part_sets: Vec::new(),
        findings: Vec::new(),
    };
    scene_lights(&rules(), &scene, &world)
}

fn instance(index: u16, role: &Role) -> Instance {
    Instance {
        id: InstanceId::new(format!("i{index}")).unwrap(),
        index: InstanceIndex(index.try_into().unwrap()),
        name: String::new(),
        role: role.clone(),
        category: None,
        super_category: None,
        triangles: 2,
        unstated: Vec::new(),
        atlas: None,
    }
}

/// Furniture without a category is no wall: it gets no light, and hides the wall behind it, which then gets none either.
#[test]
fn only_architecture_gets_wall_lights() {
    for role in [Role::Furniture {}, Role::LightFixture {}, Role::Other {}] {
        let walls = named(&lights_with_screen(&role), "wall");
        let at_the_screen = |wall: &NamedLight| wall.light.mesh.positions.iter().any(|p| (p.z - 5.8).abs() < 0.01);
        assert!(!walls.iter().any(at_the_screen), "{role:?}: {walls:?}");
    }
    // The twin: the same quad as architecture.
    let walls = named(&lights_with_screen(&Role::Architecture { kind: "Other".to_owned() }), "wall");
    assert!(walls.iter().any(|wall| (wall.light.mesh.positions[0].z - 5.799).abs() < 1e-4), "{walls:?}");
}
