//! Positions of lights in a room whose own lamps are unknown.
//!
//! In: a world, its architecture, the cameras of all views. Out: named quads: a grid under the ceiling, one quad behind the
//! camera, one in front of each wall that no view sees. The layout follows PSDR-Room (Yan et al., SIGGRAPH Asia 2023), whose
//! constants are not published; ours are [`StageRules`]. No light lies in a view, and none casts a shadow.

use glam::{DVec3, Vec3};
use mateval_scene::Camera;
use mateval_scene::dataset::SceneFile;
use mateval_tracer::{Ray, StageLight, World};

use crate::rectangle::{Rectangle, forward, is_in_picture};
use crate::rules::StageRules;
use crate::walls::walls;

/// One light of a stage, of radiance 1.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedLight {
    /// `ceiling_<column>_<row>`, `camera`, `wall_<number>`.
    pub name: String,
    /// The quad.
    pub light: StageLight,
}

/// The lights of a scene's stage, for all views of the scene from the input camera's place: a stage does not depend on wide
/// views. Instances that belong to the building may be walls; no other instance is one. `world` holds a surface for each instance, in the order of the instances.
pub fn scene_lights(rules: &StageRules, scene: &SceneFile, world: &World) -> Vec<NamedLight> {
    let views = scene.views.iter().filter(|view| !view.id.is_wide());
    let cameras: Vec<Camera> = views.map(|view| view.camera).collect();
    lights(rules, world, &scene.architecture(), &cameras)
}

/// The lights of a stage. `architecture` lists the surfaces of the world that may be walls. `cameras` holds the cameras of
/// all views, the input view's first; there is at least one, and all stand in one place or close to it.
pub fn lights(rules: &StageRules, world: &World, architecture: &[usize], cameras: &[Camera]) -> Vec<NamedLight> {
    let room = LitRoom { rules, world, centre: cameras[0].position() };
    let mut lights = room.ceiling_lights(cameras);
    lights.push(NamedLight { name: "camera".to_owned(), light: camera_light(rules, &cameras[0]) });
    let walls = room.walls(architecture).into_iter();
    let unseen = walls.filter(|wall| room.is_visible(wall) && !room.is_in_a_view(wall, cameras));
    lights.extend(
        unseen
            .enumerate()
            .map(|(number, wall)| NamedLight { name: format!("wall_{}", number + 1), light: room.wall_light(&wall) }),
    );
    lights
}

/// A quad behind the camera that faces where the camera looks.
fn camera_light(rules: &StageRules, camera: &Camera) -> StageLight {
    let rotation = camera.rotation();
    let middle = camera.position() - forward(camera) * rules.camera_distance_m;
    let sides = [rotation.x_axis * rules.camera_side_m, rotation.y_axis * rules.camera_side_m];
    Rectangle::around(middle, sides).facing(forward(camera))
}

/// A room as it is seen from `centre`: the position of the input camera, or of the camera whose view is tested.
struct LitRoom<'a> {
    rules: &'a StageRules,
    world: &'a World,
    centre: DVec3,
}

impl LitRoom<'_> {
    /// One light for each cell of the ceiling that no view sees and that does not lie behind the input camera.
    fn ceiling_lights(&self, cameras: &[Camera]) -> Vec<NamedLight> {
        let (rules, centre) = (self.rules, self.centre);
        let [low, high] = self.visible_extent();
        let cells = [0, 2].map(|axis| ((high[axis] - low[axis]) / rules.cell_m).round().max(1.0));
        let side = DVec3::new((high.x - low.x) / cells[0], 0.0, (high.z - low.z) / cells[1]);
        let mut lights = Vec::new();
        for row in 0..cells[1] as u32 {
            for column in 0..cells[0] as u32 {
                let offset = DVec3::new(f64::from(column) + 0.5, 0.0, f64::from(row) + 0.5) * side;
                let place = DVec3::new(low.x, centre.y, low.z) + offset;
                let Some(ceiling) = self.ceiling_above(place) else { continue };
                let middle = DVec3::new(place.x, ceiling - rules.ceiling_gap_m, place.z);
                let sides = [DVec3::X * side.x * rules.cell_share, DVec3::Z * side.z * rules.cell_share];
                let quad = Rectangle::around(middle, sides);
                let is_behind = (middle - centre).dot(forward(&cameras[0])) < 0.0;
                if !is_behind && !cameras.iter().any(|camera| quad.meets_frustum(camera)) {
                    let name = format!("ceiling_{column}_{row}");
                    lights.push(NamedLight { name, light: quad.facing(DVec3::NEG_Y) });
                }
            }
        }
        lights
    }

    /// The bounds of the places that horizontal rays from the centre hit first: smallest and largest coordinates.
    fn visible_extent(&self) -> [DVec3; 2] {
        let mut extent = [self.centre; 2];
        let directions = self.rules.extent_directions;
        for k in 0..directions {
            let angle = f64::from(k) / f64::from(directions) * std::f64::consts::TAU;
            let direction = DVec3::new(libm::cos(angle), 0.0, libm::sin(angle));
            if let Some(place) = self.first_place(direction) {
                extent = [extent[0].min(place), extent[1].max(place)];
            }
        }
        extent
    }

    /// The height of the level ceiling above `place`; none where `place` is hidden from the centre or has no such ceiling.
    fn ceiling_above(&self, place: DVec3) -> Option<f64> {
        if !self.sees(place) {
            return None;
        }
        let hit = self.world.first_hit(&Ray::endless(place.as_vec3(), Vec3::Y))?;
        let hit = self.world.surface_hit(&hit);
        let normal = hit.geometric_normal.as_dvec3();
        let tilt = normal.x * normal.x + normal.z * normal.z;
        let most = self.rules.upright_sine;
        (tilt < most * most).then(|| f64::from(hit.position.y))
    }

    /// The walls of the architecture.
    fn walls(&self, architecture: &[usize]) -> Vec<Rectangle> {
        let meshes = architecture.iter().map(|&surface| &self.world.scene().surfaces[surface].mesh);
        let triangles = meshes.flat_map(|mesh| (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle)));
        walls(self.rules, triangles.map(|corners| corners.map(|corner| corner.as_dvec3())))
    }

    fn wall_light(&self, wall: &Rectangle) -> StageLight {
        let StageRules { wall_share, wall_gap_m, .. } = *self.rules;
        let normal = wall.normal_towards(self.centre);
        let margin = (1.0 - wall_share) / 2.0;
        let corner = wall.corner + (wall.sides[0] + wall.sides[1]) * margin + normal * wall_gap_m;
        Rectangle { corner, sides: wall.sides.map(|side| side * wall_share) }.facing(normal)
    }

    /// Whether any place of the wall is visible from the centre, in any direction.
    fn is_visible(&self, wall: &Rectangle) -> bool {
        self.places(wall).any(|place| self.sees(place))
    }

    /// Whether any place of the wall is in the picture of a view.
    fn is_in_a_view(&self, wall: &Rectangle, cameras: &[Camera]) -> bool {
        cameras.iter().any(|camera| {
            let room = LitRoom { centre: camera.position(), ..*self };
            room.places(wall).any(|place| is_in_picture(camera, place) && room.sees(place))
        })
    }

    /// A grid of places just in front of the wall, on the side of the centre.
    fn places(&self, wall: &Rectangle) -> impl Iterator<Item = DVec3> {
        let StageRules { wall_samples, visible_within_m, .. } = *self.rules;
        let before = wall.normal_towards(self.centre) * visible_within_m;
        let Rectangle { corner, sides: [along, up] } = *wall;
        let share = move |k: u32| (f64::from(k) + 0.5) / f64::from(wall_samples);
        (0..wall_samples * wall_samples)
            .map(move |k| corner + along * share(k % wall_samples) + up * share(k / wall_samples) + before)
    }

    /// Whether nothing hides `place` from the centre.
    fn sees(&self, place: DVec3) -> bool {
        let Some(direction) = (place - self.centre).try_normalize() else { return true };
        let distance = place.distance(self.centre) - self.rules.visible_within_m;
        self.first_place(direction).is_none_or(|first| first.distance(self.centre) > distance)
    }

    /// The first place of a surface from the centre along a direction.
    fn first_place(&self, direction: DVec3) -> Option<DVec3> {
        let hit = self.world.first_hit(&Ray::endless(self.centre.as_vec3(), direction.as_vec3()))?;
        Some(self.world.surface_hit(&hit).position.as_dvec3())
    }
}

#[cfg(test)]
mod tests;
