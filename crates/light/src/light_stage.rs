//! Lights for a room whose own lamps are not known: where they stand.
//!
//! In: a world, its architecture, the cameras of all views. Out: quads, each named. A grid under the ceiling, one quad
//! behind the camera, one before each wall that no view sees: after PSDR-Room (Yan et al., SIGGRAPH Asia 2023), whose
//! constants are not published; ours are [`StageRules`]. None lies in a view, and none hides anything.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use mateval_scene::dataset::SceneFile;
use mateval_scene::{Camera, TriangleMesh};
use mateval_tracer::{Ray, StageLight, World};

use crate::rules::StageRules;

/// One light of a stage, of radiance 1.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedLight {
    /// `ceiling_<column>_<row>`, `camera`, `wall_<number>`.
    pub name: String,
    /// The quad.
    pub light: StageLight,
}

/// A rectangle: a corner and two sides, each orthogonal to the other.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rectangle {
    corner: DVec3,
    sides: [DVec3; 2],
}

/// Horizontal directions along which the room is measured.
const DIRECTIONS: u32 = 64;
/// Places along each side of a wall at which it is looked at.
const WALL_SAMPLES: u32 = 16;
/// How near to vertical the normal of a ceiling, and to horizontal that of a wall, is: the sine of the angle.
const UPRIGHT: f64 = 0.05;
/// Triangles whose planes differ by less, in metres, are of one wall.
const SAME_PLANE_M: f64 = 0.01;
/// A place counts as seen if nothing is nearer than this before it.
const NEARLY_M: f64 = 2e-3;

/// The lights of a scene's stage, for all views of the scene. Instances that belong to the building may be walls; no other
/// instance is one. `world` holds a surface for each instance, in the order of the instances.
pub fn scene_lights(rules: &StageRules, scene: &SceneFile, world: &World) -> Vec<NamedLight> {
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    lights(rules, world, &scene.architecture(), &cameras)
}

/// The lights of a stage. `architecture` says which surfaces of the world may be walls. `cameras` are those of all views,
/// the input view's first; there is at least one, and all stand in one place or near to it.
pub fn lights(rules: &StageRules, world: &World, architecture: &[usize], cameras: &[Camera]) -> Vec<NamedLight> {
    let camera = &cameras[0];
    let mut lights = ceiling_lights(rules, world, cameras);
    lights.push(NamedLight { name: "camera".to_owned(), light: camera_light(rules, camera) });
    let walls = walls(rules, world, architecture, camera.position());
    let dark = walls.into_iter().filter(|wall| is_in_the_room(world, camera, wall) && !is_seen(world, cameras, wall));
    lights.extend(dark.enumerate().map(|(number, wall)| NamedLight {
        name: format!("wall_{}", number + 1),
        light: wall_light(rules, &wall, camera.position()),
    }));
    lights
}

/// One light a cell of the ceiling that no view sees and that does not lie behind the camera.
fn ceiling_lights(rules: &StageRules, world: &World, cameras: &[Camera]) -> Vec<NamedLight> {
    let camera = &cameras[0];
    let centre = camera.position();
    let [low, high] = seen_extent(world, centre);
    let cells = [0, 2].map(|axis| ((high[axis] - low[axis]) / rules.cell_m).round().max(1.0));
    let side = DVec3::new((high.x - low.x) / cells[0], 0.0, (high.z - low.z) / cells[1]);
    let mut lights = Vec::new();
    for row in 0..cells[1] as u32 {
        for column in 0..cells[0] as u32 {
            let offset = DVec3::new(f64::from(column) + 0.5, 0.0, f64::from(row) + 0.5) * side;
            let place = DVec3::new(low.x, centre.y, low.z) + offset;
            let Some(ceiling) = ceiling_above(world, centre, place) else { continue };
            let middle = DVec3::new(place.x, ceiling - rules.ceiling_gap_m, place.z);
            let sides = [DVec3::X * side.x * rules.cell_share, DVec3::Z * side.z * rules.cell_share];
            let quad = Rectangle { corner: middle - (sides[0] + sides[1]) / 2.0, sides };
            let is_behind = (middle - centre).dot(forward(camera)) < 0.0;
            if !is_behind && !cameras.iter().any(|camera| meets_frustum(camera, &quad)) {
                let name = format!("ceiling_{column}_{row}");
                lights.push(NamedLight { name, light: facing(&quad, DVec3::NEG_Y) });
            }
        }
    }
    lights
}

/// The smallest and largest coordinates that are seen from `centre` in a horizontal plane.
fn seen_extent(world: &World, centre: DVec3) -> [DVec3; 2] {
    let mut extent = [centre; 2];
    for k in 0..DIRECTIONS {
        let angle = f64::from(k) / f64::from(DIRECTIONS) * std::f64::consts::TAU;
        let direction = DVec3::new(libm::cos(angle), 0.0, libm::sin(angle));
        if let Some(place) = first_place(world, centre, direction) {
            extent = [extent[0].min(place), extent[1].max(place)];
        }
    }
    extent
}

/// The height of the ceiling above `place`, if that is seen from `centre` and there is one.
fn ceiling_above(world: &World, centre: DVec3, place: DVec3) -> Option<f64> {
    if !is_clear(world, centre, place) {
        return None;
    }
    let hit = world.first_hit(&Ray::endless(place.as_vec3(), Vec3::Y))?;
    let hit = world.surface_hit(&hit);
    let normal = hit.geometric_normal.as_dvec3();
    let tilt = normal.x * normal.x + normal.z * normal.z;
    (tilt < UPRIGHT * UPRIGHT).then(|| f64::from(hit.position.y))
}

fn camera_light(rules: &StageRules, camera: &Camera) -> StageLight {
    let rotation = camera.rotation();
    let middle = camera.position() - forward(camera) * rules.camera_distance_m;
    let sides = [rotation.x_axis * rules.camera_side_m, rotation.y_axis * rules.camera_side_m];
    facing(&Rectangle { corner: middle - (sides[0] + sides[1]) / 2.0, sides }, forward(camera))
}

/// The plane upright pieces of the architecture, as rectangles around them; sorted by where they are.
fn walls(rules: &StageRules, world: &World, architecture: &[usize], centre: DVec3) -> Vec<Rectangle> {
    let mut planes: BTreeMap<[i64; 3], Vec<DVec3>> = BTreeMap::new();
    for &surface in architecture {
        let mesh = &world.scene().surfaces[surface].mesh;
        for triangle in 0..mesh.triangles.len() {
            let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
            let Some(normal) = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize() else {
                continue;
            };
            if normal.y.abs() > UPRIGHT {
                continue;
            }
            // The same for both ways round: towards the camera.
            let normal = if normal.dot(centre - corners[0]) < 0.0 { -normal } else { normal };
            let steps = |value: f64, step: f64| (value / step).round() as i64;
            let key = [
                steps(normal.x, UPRIGHT),
                steps(normal.z, UPRIGHT),
                steps(normal.dot(corners[0] - centre), SAME_PLANE_M),
            ];
            planes.entry(key).or_default().extend(corners);
        }
    }
    let least = rules.least_wall_m;
    let rectangles = planes.into_iter().filter_map(|(key, corners)| around(key, &corners));
    rectangles.filter(|wall| wall.sides.iter().all(|side| side.length() >= least)).collect()
}

/// The rectangle around corners in one upright plane.
fn around(key: [i64; 3], corners: &[DVec3]) -> Option<Rectangle> {
    let normal = DVec3::new(key[0] as f64, 0.0, key[1] as f64).try_normalize()?;
    let along = DVec3::Y.cross(normal);
    let range = |axis: DVec3| {
        let values = || corners.iter().map(|corner| corner.dot(axis));
        [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
    };
    let ([left, right], [bottom, top]) = (range(along), range(DVec3::Y));
    let depth = corners.iter().map(|corner| corner.dot(normal)).sum::<f64>() / corners.len() as f64;
    let corner = normal * depth + along * left + DVec3::Y * bottom;
    Some(Rectangle { corner, sides: [along * (right - left), DVec3::Y * (top - bottom)] })
}

fn wall_light(rules: &StageRules, wall: &Rectangle, centre: DVec3) -> StageLight {
    let normal = towards(wall, centre);
    let margin = (1.0 - rules.wall_share) / 2.0;
    let corner = wall.corner + (wall.sides[0] + wall.sides[1]) * margin + normal * rules.wall_gap_m;
    facing(&Rectangle { corner, sides: wall.sides.map(|side| side * rules.wall_share) }, normal)
}

/// Whether any place of the wall is seen from where the camera stands, whichever way it looks.
fn is_in_the_room(world: &World, camera: &Camera, wall: &Rectangle) -> bool {
    let centre = camera.position();
    places(wall, centre).any(|place| is_clear(world, centre, place))
}

/// Whether any place of the wall is in a view's picture.
fn is_seen(world: &World, cameras: &[Camera], wall: &Rectangle) -> bool {
    cameras.iter().any(|camera| {
        let centre = camera.position();
        places(wall, centre).any(|place| is_in_picture(camera, place) && is_clear(world, centre, place))
    })
}

/// A grid of places just before the wall.
fn places(wall: &Rectangle, centre: DVec3) -> impl Iterator<Item = DVec3> {
    let before = towards(wall, centre) * NEARLY_M;
    let Rectangle { corner, sides: [along, up] } = *wall;
    let share = |k: u32| (f64::from(k) + 0.5) / f64::from(WALL_SAMPLES);
    (0..WALL_SAMPLES * WALL_SAMPLES)
        .map(move |k| corner + along * share(k % WALL_SAMPLES) + up * share(k / WALL_SAMPLES) + before)
}

/// The rectangle's normal on the side of `place`.
fn towards(rectangle: &Rectangle, place: DVec3) -> DVec3 {
    let normal = rectangle.sides[0].cross(rectangle.sides[1]).normalize_or_zero();
    if normal.dot(place - rectangle.corner) < 0.0 { -normal } else { normal }
}

/// Whether nothing is between two places.
fn is_clear(world: &World, from: DVec3, to: DVec3) -> bool {
    let Some(direction) = (to - from).try_normalize() else { return true };
    first_place(world, from, direction).is_none_or(|place| place.distance(from) > to.distance(from) - NEARLY_M)
}

fn first_place(world: &World, from: DVec3, direction: DVec3) -> Option<DVec3> {
    let hit = world.first_hit(&Ray::endless(from.as_vec3(), direction.as_vec3()))?;
    Some(world.surface_hit(&hit).position.as_dvec3())
}

fn forward(camera: &Camera) -> DVec3 {
    -camera.rotation().z_axis
}

fn is_in_picture(camera: &Camera, place: DVec3) -> bool {
    frustum(camera).iter().all(|plane| plane.dot(place - camera.position()) >= 0.0)
}

/// Inward normals of the planes around what the camera sees, all through its centre.
fn frustum(camera: &Camera) -> [DVec3; 4] {
    let k = camera.intrinsics;
    let (width, height) = (f64::from(k.width), f64::from(k.height));
    let sides = [
        // Left, right, top, bottom: a point is inside where x / depth is at least (0 - cx) / fx, and so on.
        DVec3::new(k.fx, 0.0, -k.cx),
        DVec3::new(-k.fx, 0.0, -(width - k.cx)),
        DVec3::new(0.0, -k.fy, -k.cy),
        DVec3::new(0.0, k.fy, -(height - k.cy)),
    ];
    sides.map(|side| camera.rotation() * side)
}

/// Whether any of the rectangle is in the camera's picture, were nothing before it: what is left of it when it is cut off
/// at each side of the picture (Sutherland and Hodgman, "Reentrant polygon clipping", CACM 1974).
fn meets_frustum(camera: &Camera, rectangle: &Rectangle) -> bool {
    let mut polygon = corners(rectangle).to_vec();
    for plane in frustum(camera) {
        let inside = |place: DVec3| plane.dot(place - camera.position());
        let mut rest = Vec::new();
        for (k, &to) in polygon.iter().enumerate() {
            let from = polygon[(k + polygon.len() - 1) % polygon.len()];
            let (a, b) = (inside(from), inside(to));
            if (a < 0.0) != (b < 0.0) {
                rest.push(from + (to - from) * (a / (a - b)));
            }
            if b >= 0.0 {
                rest.push(to);
            }
        }
        polygon = rest;
    }
    !polygon.is_empty()
}

fn corners(rectangle: &Rectangle) -> [DVec3; 4] {
    let Rectangle { corner, sides: [u, v] } = *rectangle;
    [corner, corner + u, corner + u + v, corner + v]
}

/// The rectangle as a light of radiance 1 whose front is on the side of `normal`.
fn facing(rectangle: &Rectangle, normal: DVec3) -> StageLight {
    let turned = rectangle.sides[0].cross(rectangle.sides[1]).dot(normal) < 0.0;
    let positions = corners(rectangle).map(|corner| corner.as_vec3()).to_vec();
    let triangles = if turned { vec![[0, 2, 1], [0, 3, 2]] } else { vec![[0, 1, 2], [0, 2, 3]] };
    let mesh = TriangleMesh { positions, triangles, ..Default::default() };
    StageLight { mesh, radiance: [1.0; 3] }
}

#[cfg(test)]
mod tests;
