//! Positions of lights in a room whose own lamps are unknown.
//!
//! In: a world, its architecture, the cameras of all views. Out: named quads: a grid under the ceiling, one quad behind
//! the camera, one in front of each wall that no view sees. A captured room may have a flash, too ([`flash_light`]).
//!
//! The layout follows PSDR-Room (Yan et al., SIGGRAPH Asia 2023), whose constants are not published; ours are
//! [`StageRules`]. No light lies in a view, and none casts a shadow.
//!
//! A wall is an upright piece of the architecture, in one plane and connected. It grows from the largest triangle that
//! belongs to none yet. It takes in every triangle of that triangle's plane that is connected with it: no farther from
//! one of its triangles than the tolerance, so that they share a corner or an edge, touch or overlap. Coplanar walls of
//! different rooms are different walls.

use glam::{DVec2, DVec3, Vec3};
use mateval_dataset::dataset::{Flash, SceneFile};
use mateval_dataset::{Camera, TriangleMesh};
use mateval_tracer::{Ray, StageLight, World};
use serde::{Deserialize, Serialize};

/// Where the lights of a stage are; lengths in metres. PSDR-Room's values are not published; these are MatEval's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageRules {
    /// Number of horizontal directions along which the extent of the room is measured from the camera.
    pub extent_directions: u32,
    /// Approximate side of a ceiling cell. Cells fill the rectangle that the camera sees at its own height.
    pub cell_m: f64,
    /// Side of a cell's light, as a share of the cell's side.
    pub cell_share: f64,
    /// Distance from the ceiling down to its lights.
    pub ceiling_gap_m: f64,
    /// Side of the light behind the camera.
    pub camera_side_m: f64,
    /// Distance from the camera back to that light.
    pub camera_distance_m: f64,
    /// Width and height of a wall's light, as a share of the wall's own.
    pub wall_share: f64,
    /// Distance from a wall to its light.
    pub wall_gap_m: f64,
    /// Connected pieces of the architecture that are narrower or lower than this are not walls.
    pub least_wall_m: f64,
    /// A wall's visibility is tested at a grid of places, with this many along each side.
    pub wall_samples: u32,
    /// Sine of the largest angle between a ceiling's normal and the vertical, and between a wall's normal and the
    /// horizontal, and between the normals of one wall's triangles and of its largest one.
    pub upright_sine: f64,
    /// The largest distance of a wall's corners from the plane of its largest triangle, and the largest gap within that
    /// plane between connected triangles.
    pub same_plane_m: f64,
    /// A place is visible if nothing is nearer to the camera than the place by more than this.
    pub visible_within_m: f64,
}

impl Default for StageRules {
    /// The values of every protocol today.
    fn default() -> Self {
        Self {
            extent_directions: 64,
            cell_m: 1.0,
            cell_share: 0.5,
            ceiling_gap_m: 1e-3,
            camera_side_m: 1.5,
            camera_distance_m: 0.5,
            wall_share: 0.8,
            wall_gap_m: 1e-3,
            least_wall_m: 0.5,
            wall_samples: 16,
            upright_sine: 0.05,
            same_plane_m: 0.01,
            visible_within_m: 2e-3,
        }
    }
}

/// One light of a stage, of radiance 1.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedLight {
    /// `ceiling_<column>_<row>`, `camera`, `wall_<number>`.
    pub name: String,
    pub light: StageLight,
}

/// The lights of a scene's stage, for all views of the scene from the input camera's place: a stage does not depend on
/// wide views. Instances that belong to the building may be walls; no other instance is one. `world` holds a surface
/// for each instance, in the order of the instances. A scene whose only light is a flash has none.
pub fn scene_lights(rules: &StageRules, scene: &SceneFile, world: &World) -> Vec<NamedLight> {
    if scene.flash.as_ref().is_some_and(|flash| flash.only_light) {
        return Vec::new();
    }
    let views = scene.views.iter().filter(|view| !view.id.is_wide());
    let cameras: Vec<Camera> = views.map(|view| view.camera).collect();
    lights(rules, world, &scene.architecture(), &cameras)
}

/// The name of a flash among the lights of a scene.
pub const FLASH: &str = "flash";
/// The radius of the sphere that stands for a flash, in metres: small against its distance from what it lights.
const FLASH_RADIUS_M: f64 = 0.005;

/// The flash at a camera, of radiant intensity 1 in every direction: a small sphere.
pub fn flash_light(flash: &Flash, camera: &Camera) -> StageLight {
    let centre = camera.position() + camera.rotation() * DVec3::from_array(flash.offset_m);
    // An octahedron whose triangles are divided into four, three times, with all corners on the sphere. Its intensity
    // differs by less than 1 % between directions and their mean.
    let sides = [DVec3::X, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Z];
    let mut triangles: Vec<[DVec3; 3]> = (0..4)
        .flat_map(|k| {
            let [a, b] = [sides[k], sides[(k + 1) % 4]];
            [[a, DVec3::Y, b], [b, DVec3::NEG_Y, a]]
        })
        .collect();
    for _ in 0..3 {
        let quarters = |[a, b, c]: [DVec3; 3]| {
            let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(quarters).collect();
    }
    let positions = triangles.iter().flatten().map(|at| (centre + *at * FLASH_RADIUS_M).as_vec3()).collect();
    let triangles = (0..triangles.len() as u32).map(|at| [3 * at, 3 * at + 1, 3 * at + 2]).collect();
    let mesh = TriangleMesh { positions, triangles, ..Default::default() };
    // The mean projected area of a convex body is a quarter of its surface (Cauchy), so the mean intensity is 1.
    let radiance = (4.0 / mesh.area()) as f32;
    StageLight { mesh, radiance: [radiance; 3], is_flash: true }
}

/// The lights of a stage. `architecture` lists the surfaces of the world that may be walls. `cameras` holds the cameras
/// of all views, the input view's first; there is at least one, and all stand in one place or close to it.
pub fn lights(rules: &StageRules, world: &World, architecture: &[usize], cameras: &[Camera]) -> Vec<NamedLight> {
    let room = LitRoom { rules, world, centre: cameras[0].position() };
    let mut lights = room.ceiling_lights(cameras);
    lights.push(NamedLight { name: "camera".to_owned(), light: camera_light(rules, &cameras[0]) });
    let meshes = architecture.iter().map(|&surface| &world.scene().surfaces[surface].mesh);
    let triangles = meshes.flat_map(|mesh| (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle)));
    let walls = walls(rules, triangles.map(|corners| corners.map(|corner| corner.as_dvec3())));
    let is_visible = |wall: &Rectangle| room.places(wall).any(|place| room.sees(place));
    let unseen = walls.into_iter().filter(|wall| is_visible(wall) && !room.is_in_a_view(wall, cameras));
    let named = |(wall, number)| NamedLight { name: format!("wall_{number}"), light: room.wall_light(&wall) };
    lights.extend(unseen.zip(1..).map(named));
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

    /// The height of the level ceiling above `place`; absent if `place` is hidden from the centre or has no such
    /// ceiling.
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

    fn wall_light(&self, wall: &Rectangle) -> StageLight {
        let StageRules { wall_share, wall_gap_m, .. } = *self.rules;
        let normal = wall.normal_towards(self.centre);
        let margin = (1.0 - wall_share) / 2.0;
        let corner = wall.corner + (wall.sides[0] + wall.sides[1]) * margin + normal * wall_gap_m;
        Rectangle { corner, sides: wall.sides.map(|side| side * wall_share) }.facing(normal)
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

struct Upright {
    corners: [DVec3; 3],
    /// Unit length.
    normal: DVec3,
    /// In square metres.
    area: f64,
}

impl Upright {
    /// None where the triangle has no area or is not upright.
    fn new(rules: &StageRules, corners: [DVec3; 3]) -> Option<Self> {
        let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let normal = cross.try_normalize()?;
        (normal.y.abs() <= rules.upright_sine).then_some(Self { corners, normal, area: 0.5 * cross.length() })
    }

    /// Its smallest and largest coordinates.
    fn bounds(&self) -> [DVec3; 2] {
        let [a, b, c] = self.corners;
        [a.min(b).min(c), a.max(b).max(c)]
    }

    /// Whether `other` lies in the plane of this triangle, whichever way it faces.
    fn is_coplanar(&self, rules: &StageRules, other: &Self) -> bool {
        let is_near = |corner: &DVec3| (*corner - self.corners[0]).dot(self.normal).abs() <= rules.same_plane_m;
        self.normal.cross(other.normal).length() <= rules.upright_sine && other.corners.iter().all(is_near)
    }
}

/// The rectangle around each wall of at least [`StageRules::least_wall_m`] in width and height; the wall with the
/// largest triangle first.
fn walls(rules: &StageRules, triangles: impl Iterator<Item = [DVec3; 3]>) -> Vec<Rectangle> {
    let mut all: Vec<Upright> = triangles.filter_map(|corners| Upright::new(rules, corners)).collect();
    all.sort_by(|a, b| b.area.total_cmp(&a.area));
    walls_among(rules, &all, &BoxTree::new(all.iter().map(Upright::bounds).collect()))
}

/// The rectangles of [`walls`], of triangles in the order of their area, the largest first. `tree` holds their bounds.
fn walls_among(rules: &StageRules, all: &[Upright], tree: &BoxTree) -> Vec<Rectangle> {
    let mut taken = vec![false; all.len()];
    let mut walls = Vec::new();
    for seed in 0..all.len() {
        if !taken[seed] {
            walls.extend(grown(rules, all, tree, seed, &mut taken));
        }
    }
    walls
}

/// Marks the triangles of the wall around number `first` as taken; returns the rectangle around them if it is large
/// enough.
fn grown(rules: &StageRules, all: &[Upright], tree: &BoxTree, first: usize, taken: &mut [bool]) -> Option<Rectangle> {
    let seed = &all[first];
    let up = (DVec3::Y - seed.normal * seed.normal.y).normalize();
    let along = up.cross(seed.normal);
    let flat = |triangle: &Upright| triangle.corners.map(|corner| DVec2::new(corner.dot(along), corner.dot(up)));
    // Take in what is near any triangle of the wall until nothing is. Triangles whose gap within the plane is at most
    // the tolerance are less than three times that apart in space: each is at most the tolerance from the plane.
    let reach = DVec3::splat(3.0 * rules.same_plane_m);
    taken[first] = true;
    let (mut wall, mut done, mut near) = (vec![first], 0, Vec::new());
    while let Some(&at) = wall.get(done) {
        let (own, [low, high]) = (flat(&all[at]), all[at].bounds());
        near.clear();
        tree.meeting([low - reach, high + reach], &mut near);
        for &other in &near {
            let triangle = &all[other];
            let is_next = || seed.is_coplanar(rules, triangle) && distance(&own, &flat(triangle)) <= rules.same_plane_m;
            if !taken[other] && is_next() {
                taken[other] = true;
                wall.push(other);
            }
        }
        done += 1;
    }
    // The rectangle around the wall.
    let corners = || wall.iter().flat_map(|&at| flat(&all[at]));
    let low = corners().reduce(DVec2::min)?;
    let high = corners().reduce(DVec2::max)?;
    let size = high - low;
    let corner = seed.normal * seed.corners[0].dot(seed.normal) + along * low.x + up * low.y;
    (size.min_element() >= rules.least_wall_m).then_some(Rectangle { corner, sides: [along * size.x, up * size.y] })
}

/// A binary tree of axis-aligned boxes, each as its smallest and largest coordinates. A node's boxes are halved along
/// the longest axis of the box around them. Walls of scans have a million triangles.
struct BoxTree {
    boxes: Vec<[DVec3; 2]>,
    /// The numbers of the boxes, in an order in which those of every node are neighbours.
    order: Vec<usize>,
    /// The box around each node; node k has the children 2 k and 2 k + 1, and the root is number 1.
    nodes: Vec<[DVec3; 2]>,
}

impl BoxTree {
    /// The most boxes of a leaf.
    const LEAF: usize = 8;

    fn new(boxes: Vec<[DVec3; 2]>) -> Self {
        // Halving leaves at most LEAF boxes at this depth.
        let nodes = 2 * boxes.len().div_ceil(Self::LEAF).next_power_of_two();
        let mut tree = Self { order: Vec::new(), nodes: vec![[DVec3::ZERO; 2]; nodes], boxes };
        let mut order: Vec<usize> = (0..tree.boxes.len()).collect();
        tree.build(1, &mut order);
        tree.order = order;
        tree
    }

    fn build(&mut self, node: usize, order: &mut [usize]) {
        let around = |all: [DVec3; 2], at: &usize| {
            let [low, high] = self.boxes[*at];
            [all[0].min(low), all[1].max(high)]
        };
        let [low, high] = order.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], around);
        self.nodes[node] = [low, high];
        if order.len() <= Self::LEAF {
            return;
        }
        let axis = (high - low).max_position();
        let middle = |at: &usize| self.boxes[*at][0][axis] + self.boxes[*at][1][axis];
        let half = order.len() / 2;
        order.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
        let (left, right) = order.split_at_mut(half);
        self.build(2 * node, left);
        self.build(2 * node + 1, right);
    }

    /// Adds the numbers of the boxes that meet `wanted` to `found`.
    fn meeting(&self, wanted: [DVec3; 2], found: &mut Vec<usize>) {
        self.meeting_in(1, &self.order, &wanted, found);
    }

    fn meeting_in(&self, node: usize, order: &[usize], wanted: &[DVec3; 2], found: &mut Vec<usize>) {
        let meets = |[low, high]: &[DVec3; 2]| low.cmple(wanted[1]).all() && high.cmpge(wanted[0]).all();
        if !meets(&self.nodes[node]) {
            return;
        }
        if order.len() <= Self::LEAF {
            found.extend(order.iter().filter(|at| meets(&self.boxes[**at])));
            return;
        }
        let (left, right) = order.split_at(order.len() / 2);
        self.meeting_in(2 * node, left, wanted, found);
        self.meeting_in(2 * node + 1, right, wanted, found);
    }
}

/// The distance of two triangles in a plane; 0 where they overlap.
fn distance(a: &[DVec2; 3], b: &[DVec2; 3]) -> f64 {
    if contains(a, b[0]) || contains(b, a[0]) {
        return 0.0;
    }
    let edges = |triangle: &[DVec2; 3]| [0, 1, 2].map(|k| [triangle[k], triangle[(k + 1) % 3]]);
    let pairs = edges(a).into_iter().flat_map(|one| edges(b).map(|other| (one, other)));
    pairs.map(|(one, other)| edge_distance(one, other)).fold(f64::INFINITY, f64::min)
}

fn contains(triangle: &[DVec2; 3], place: DVec2) -> bool {
    let side = |k: usize| (triangle[(k + 1) % 3] - triangle[k]).perp_dot(place - triangle[k]);
    let sides = [0, 1, 2].map(side);
    sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
}

/// The distance of two line segments.
fn edge_distance([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> f64 {
    let side = |from: DVec2, to: DVec2, place: DVec2| (to - from).perp_dot(place - from);
    if side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0 {
        return 0.0;
    }
    let to_edge = |place: DVec2, from: DVec2, to: DVec2| {
        let edge = to - from;
        let share = ((place - from).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        place.distance(from + edge * share)
    };
    [to_edge(a, c, d), to_edge(b, c, d), to_edge(c, a, b), to_edge(d, a, b)].into_iter().fold(f64::INFINITY, f64::min)
}

/// A corner and two sides that are orthogonal to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rectangle {
    corner: DVec3,
    sides: [DVec3; 2],
}

impl Rectangle {
    /// The rectangle with these sides around `middle`.
    fn around(middle: DVec3, sides: [DVec3; 2]) -> Self {
        Self { corner: middle - (sides[0] + sides[1]) / 2.0, sides }
    }

    /// The unit normal on the side of `place`.
    fn normal_towards(&self, place: DVec3) -> DVec3 {
        let normal = self.sides[0].cross(self.sides[1]).normalize_or_zero();
        if normal.dot(place - self.corner) < 0.0 { -normal } else { normal }
    }

    fn corners(&self) -> [DVec3; 4] {
        let Self { corner, sides: [u, v] } = *self;
        [corner, corner + u, corner + u + v, corner + v]
    }

    /// A light of radiance 1 whose front is on the side of `normal`.
    fn facing(&self, normal: DVec3) -> StageLight {
        let turned = self.sides[0].cross(self.sides[1]).dot(normal) < 0.0;
        let positions = self.corners().map(|corner| corner.as_vec3()).to_vec();
        let triangles = if turned { vec![[0, 2, 1], [0, 3, 2]] } else { vec![[0, 1, 2], [0, 2, 3]] };
        let mesh = TriangleMesh { positions, triangles, ..Default::default() };
        StageLight { mesh, radiance: [1.0; 3], is_flash: false }
    }

    /// Whether any of the rectangle is in the camera's picture, occlusion aside: clips the rectangle at each side of
    /// the picture (Sutherland and Hodgman, "Reentrant polygon clipping", CACM 1974) and checks that something remains.
    fn meets_frustum(&self, camera: &Camera) -> bool {
        let mut polygon = self.corners().to_vec();
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
}

/// Whether `place` projects into the camera's picture, occlusion aside.
fn is_in_picture(camera: &Camera, place: DVec3) -> bool {
    frustum(camera).iter().all(|plane| plane.dot(place - camera.position()) >= 0.0)
}

/// The direction in which the camera looks.
fn forward(camera: &Camera) -> DVec3 {
    -camera.rotation().z_axis
}

/// Inward normals of the four planes through the camera's position and the sides of its picture.
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

/// The stage of a plain closed room.
#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use mateval_dataset::{Intrinsics, splitmix64};
    use mateval_testkit::scenes::{Builder, WALLS, box_camera, box_quad, box_room, camera, grey};
    use mateval_tracer::{RenderSettings, render};

    use super::*;

    fn flash(offset_m: [f64; 3]) -> Flash {
        Flash { offset_m, intensity: None, views: Vec::new(), only_light: false }
    }

    /// A floor of albedo a, lit by a flash of intensity 1 from the distance d at the angle t to its normal, has the
    /// radiance a cos t / (pi d^2).
    #[test]
    fn the_light_of_a_flash_falls_off_with_the_square_of_the_distance() {
        let floor = box_quad([-8.0, 0.0, -8.0], [0.0, 0.0, 16.0], [16.0, 0.0, 0.0]);
        let world = Builder::default().surface(floor, grey(0.5)).world();
        for height in [0.5_f64, 2.0] {
            let camera = camera([0.0, height, 0.0], [0.0; 3], 9, 0.5);
            let lit = world.on_stage(&[flash_light(&flash([0.3, 0.0, 0.0]), &camera)]).unwrap();
            let settings = RenderSettings { samples: 1024, ..RenderSettings::default() };
            let picture = render(&lit, &camera, &settings, &|_, _| ()).unwrap().picture;
            let sum: f64 = picture.pixels().iter().map(|pixel| f64::from(pixel.0[1])).sum();
            let (found, distance) = (sum / picture.pixels().len() as f64, height.hypot(0.3));
            let expected = 0.5 / std::f64::consts::PI * height / distance.powi(3);
            assert!((found / expected - 1.0).abs() < 0.02, "{height}: {found} {expected}");
        }
    }

    /// A camera that looks along +X has +Z to its right, and -X behind it.
    #[test]
    fn a_flash_stands_beside_its_camera() {
        let light = flash_light(&flash([0.1, 0.2, 0.3]), &camera([1.0, 2.0, 3.0], [5.0, 2.0, 3.0], 9, 60.0));
        let positions = &light.mesh.positions;
        let middle = positions.iter().map(|place| place.as_dvec3()).sum::<DVec3>() / positions.len() as f64;
        assert!(middle.distance(DVec3::new(0.7, 2.2, 3.1)) < 1e-5, "{middle}");
        // Every triangle faces outwards.
        let outwards = |at: usize| normal_of(&light, at).dot(light.mesh.corners(at)[0].as_dvec3() - middle) > 0.0;
        assert!(light.mesh.triangles.len() == 512 && (0..512).all(outwards));
    }

    fn normal_of(light: &StageLight, triangle: usize) -> DVec3 {
        let [a, b, c] = light.mesh.corners(triangle).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a)
    }

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
        let lights = lights(&rules(), &world(Vec::new()), &WALLS, &[box_camera()]);
        // Four columns; the picture's upper edge rises by 0.325 a metre: the ceiling, 1.3 above, is in view from 4
        // metres before the camera on. Cells end 0.25 beyond their middles, which are at 0.5, 1.5, ...
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
        let turned = box_camera().turned(5.0, 5.0);
        let room = world(Vec::new());
        let one = lights(&rules(), &room, &WALLS, &[box_camera()]);
        let two = lights(&rules(), &room, &WALLS, &[box_camera(), turned]);
        assert!(named(&two, "ceiling").len() < named(&one, "ceiling").len());
    }

    /// A screen across the room hides its far part, and a low ledge is not a wall.
    #[test]
    fn hidden_and_low_pieces_get_no_light() {
        let screen = box_quad([0.0, 0.0, 3.0], [4.0, 0.0, 0.0], [0.0, 2.5, 0.0]);
        let ledge = box_quad([0.0, 1.0, 5.9], [4.0, 0.0, 0.0], [0.0, 0.2, 0.0]);
        let lights = lights(&rules(), &world(vec![screen, ledge]), &[2, 3, 4, 5, 6, 7], &[box_camera()]);
        let ceiling = named(&lights, "ceiling");
        assert!(!ceiling.is_empty());
        assert!(ceiling.iter().all(|light| light.light.mesh.positions.iter().all(|p| p.z > 3.0)));
        // Now no view sees the side walls either; neither the screen nor the ledge is one of them.
        let walls = named(&lights, "wall");
        assert_eq!(walls.len(), 3);
        assert!(walls.iter().all(|wall| wall.light.mesh.positions[0].y < 0.3));
        assert_eq!(walls.iter().filter(|wall| normal(&wall.light).x.abs() > 0.99).count(), 2);
    }

    /// Furniture is no wall: it gets no light, and hides the wall behind it, which then gets none either.
    #[test]
    fn only_architecture_gets_wall_lights() {
        let room = world(vec![box_quad([0.5, 0.0, 5.8], [3.0, 0.0, 0.0], [0.0, 2.4, 0.0])]);
        let depths = |architecture: &[usize]| -> Vec<f32> {
            let lights = lights(&rules(), &room, architecture, &[box_camera()]);
            named(&lights, "wall").iter().map(|wall| wall.light.mesh.positions[0].z).collect()
        };
        let is_at_the_screen = |z: &f32| (z - 5.8).abs() < 0.01;
        assert!(!depths(&WALLS).iter().any(is_at_the_screen));
        // The twin: the same quad as architecture.
        assert!(depths(&[2, 3, 4, 5, 6]).iter().any(is_at_the_screen));
    }

    /// Two triangles that make a rectangle in the plane x = `x`, from `low` to `high` in z and y.
    fn sheet(x: f64, low: [f64; 2], high: [f64; 2]) -> Vec<[DVec3; 3]> {
        let at = |z: f64, y: f64| DVec3::new(x, y, z);
        let [a, b, c, d] = [at(low[0], low[1]), at(high[0], low[1]), at(high[0], high[1]), at(low[0], high[1])];
        vec![[a, b, c], [a, c, d]]
    }

    fn found(triangles: Vec<[DVec3; 3]>) -> Vec<[f64; 2]> {
        let walls = walls(&StageRules::default(), triangles.into_iter());
        walls.iter().map(|wall| wall.sides.map(|side| (side.length() * 1e6).round() / 1e6)).collect()
    }

    #[test]
    fn coplanar_walls_of_two_rooms_are_two() {
        let apart = [sheet(1.0, [0.0, 0.0], [4.0, 2.5]), sheet(1.0, [4.1, 0.0], [6.1, 2.5])].concat();
        assert_eq!(found(apart), [[4.0, 2.5], [2.0, 2.5]]);
        // The twin: no gap between them, and triangles that share no corner.
        let together = [sheet(1.0, [0.0, 0.0], [4.0, 2.5]), sheet(1.0, [4.005, 1.0], [6.0, 2.0])].concat();
        assert_eq!(found(together), [[6.0, 2.5]]);
    }

    #[test]
    fn pieces_around_a_window_are_one_wall() {
        let around = [
            sheet(1.0, [0.0, 0.0], [4.0, 0.8]),
            sheet(1.0, [0.0, 2.0], [4.0, 2.5]),
            sheet(1.0, [0.0, 0.8], [1.0, 2.0]),
            sheet(1.0, [3.0, 0.8], [4.0, 2.0]),
        ];
        assert_eq!(found(around.concat()), [[4.0, 2.5]]);
        // The twin: without what joins them, sill and lintel are two.
        assert_eq!(found(around[..2].concat()), [[4.0, 0.8], [4.0, 0.5]]);
    }

    #[test]
    fn overlapping_sheets_are_one_wall_and_parallel_ones_are_not() {
        let cross = [sheet(1.0, [0.0, 1.0], [4.0, 2.0]), sheet(1.0, [1.0, 0.0], [2.0, 2.5])].concat();
        assert_eq!(found(cross), [[4.0, 2.5]]);
        let parallel = [sheet(1.0, [0.0, 0.0], [4.0, 2.5]), sheet(1.02, [0.0, 0.0], [3.0, 2.5])].concat();
        assert_eq!(found(parallel), [[4.0, 2.5], [3.0, 2.5]]);
    }

    /// A drawn number from 0 to 1.
    fn number(index: u64) -> f64 {
        (splitmix64::number(7, index) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Triangles of drawn places and sizes in two planes; those in one of them lie at two depths within the tolerance.
    /// With a tree whose boxes all meet, the search tests every pair.
    #[test]
    fn the_tree_leaves_out_no_piece_of_a_wall() {
        let rules = StageRules { least_wall_m: 0.0, ..rules() };
        let drawn = |k: u64| {
            let [plane, z, y, width, height] = [0, 1, 2, 3, 4].map(|part| number(6 * k + part));
            let corner = DVec3::new([1.0, 1.006, 1.5][(3.0 * plane) as usize], 3.0 * y, 6.0 * z);
            [corner, corner + DVec3::Z * (0.1 + 0.3 * width), corner + DVec3::Y * (0.1 + 0.3 * height)]
        };
        let triangles: Vec<[DVec3; 3]> = (0..300).map(drawn).collect();
        let mut all: Vec<Upright> = triangles.iter().filter_map(|corners| Upright::new(&rules, *corners)).collect();
        all.sort_by(|a, b| b.area.total_cmp(&a.area));
        let everywhere = BoxTree::new(vec![[DVec3::splat(-1e3), DVec3::splat(1e3)]; all.len()]);
        let expected = walls_among(&rules, &all, &everywhere);
        assert!((60..200).contains(&expected.len()), "{}", expected.len());
        assert_eq!(walls(&rules, triangles.into_iter()), expected);
        // The twin: triangles that are only found by their middles.
        let middles = all.iter().map(|triangle| [triangle.bounds().iter().sum::<DVec3>() / 2.0; 2]).collect();
        assert_ne!(walls_among(&rules, &all, &BoxTree::new(middles)), expected);
    }

    /// Among boxes of drawn places and sizes, the tree finds those that a test of every box finds.
    #[test]
    fn a_tree_finds_the_boxes_that_a_box_meets() {
        let drawn = |k: u64| {
            let [x, y, z, size] = [0, 1, 2, 3].map(|part| number(4 * k + part));
            let low = DVec3::new(x, y, z) * 10.0;
            [low, low + DVec3::new(size, size * size, 1.0 - size)]
        };
        for count in [0, 1, 8, 9, 1000] {
            let boxes: Vec<[DVec3; 2]> = (0..count).map(drawn).collect();
            let tree = BoxTree::new(boxes.clone());
            let mut most = 0;
            for wanted in (5000..5200).map(drawn) {
                let mut found = Vec::new();
                tree.meeting(wanted, &mut found);
                found.sort_unstable();
                let meets = |[low, high]: &[DVec3; 2]| {
                    (0..3).all(|axis| low[axis] <= wanted[1][axis] && high[axis] >= wanted[0][axis])
                };
                let expected: Vec<usize> = (0..boxes.len()).filter(|at| meets(&boxes[*at])).collect();
                assert_eq!(found, expected);
                most = most.max(found.len());
            }
            assert!(count < 1000 || most > 3, "{most}");
        }
    }

    #[test]
    fn neither_order_nor_orientation_matters() {
        let wall = [sheet(1.0, [0.0, 0.0], [4.0, 0.8]), sheet(1.0, [0.0, 0.8], [1.0, 2.0])].concat();
        let mut turned: Vec<[DVec3; 3]> = wall.iter().rev().map(|[a, b, c]| [*a, *c, *b]).collect();
        assert_eq!(found(wall), [[4.0, 2.0]]);
        assert_eq!(found(turned.clone()), [[4.0, 2.0]]);
        // Floors, low ledges and triangles without area are no walls.
        turned.clear();
        turned.extend(sheet(1.0, [0.0, 0.0], [4.0, 0.4]));
        turned.push([DVec3::ZERO, DVec3::X * 4.0, DVec3::Z * 4.0]);
        turned.push([DVec3::ZERO, DVec3::Y, DVec3::Y * 2.0]);
        assert!(found(turned).is_empty());
    }

    #[test]
    fn a_rectangle_meets_the_frustum_exactly_up_to_its_edge() {
        let intrinsics = Intrinsics::from_fov_x(320, 180, 60_f64.to_radians());
        let camera =
            Camera::look_at(DVec3::new(2.0, 1.2, 5.5), DVec3::new(2.0, 1.2, 0.0), DVec3::Y, intrinsics).unwrap();
        // At depth 5 the picture reaches 5 tan 30 = 2.887 to each side.
        let beside = |x: f64| Rectangle { corner: DVec3::new(2.0 + x, 1.0, 0.5), sides: [DVec3::X, DVec3::Y * 0.1] };
        assert!(beside(2.88).meets_frustum(&camera) && !beside(2.89).meets_frustum(&camera));
        // Larger than the picture, with every corner outside.
        let large = Rectangle { corner: DVec3::new(-50.0, -50.0, 0.5), sides: [DVec3::X * 100.0, DVec3::Y * 100.0] };
        assert!(large.meets_frustum(&camera));
        let behind = Rectangle { corner: DVec3::new(2.0, 1.0, 5.6), sides: [DVec3::X * 0.1, DVec3::Y * 0.1] };
        assert!(!behind.meets_frustum(&camera));
    }
}
