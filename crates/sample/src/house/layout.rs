//! A house as data, from which its files follow: rooms with their meshes, furniture and cameras, and the materials,
//! textures and models that they name; and the two rooms of the built-in house.
//!
//! Meshes are made of rectangles and boxes. Positions and texture coordinates are in metres, as in the data, +y up, the
//! floor at y = 0. On a plan with -z at the top, the living room is in the west and the bedroom is east of it behind an
//! opening without a door. The door in the living room's south wall is shut, and the outer wall behind it has no
//! opening, so that no light comes in around the door.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{DVec2, DVec3};

use super::materials::{ArchitectureMaterial, ArchitectureTexture};
use super::models::Model;
use crate::solid::sides;

pub struct House {
    pub rooms: Vec<Room>,
    /// The materials that the rooms' meshes name. A material's id follows from its position.
    pub materials: Vec<ArchitectureMaterial>,
    pub textures: Vec<ArchitectureTexture>,
    /// The library of models, which the rooms' furniture names.
    pub models: Vec<Model>,
}

/// A rectangular room between two corners (x, z).
pub struct Room {
    /// The data's type of room.
    pub kind: &'static str,
    /// The data's instanceid.
    pub name: &'static str,
    pub low: DVec2,
    pub high: DVec2,
    pub meshes: Vec<ArchitectureMesh>,
    pub furniture: Vec<Furniture>,
    pub cameras: Vec<Snapshot>,
}

/// A record of the `furniture` list, and where its model is placed.
pub struct Furniture {
    pub uid: &'static str,
    /// The name of its model.
    pub model: &'static str,
    /// As in "sofa/l-shaped sofa"; may be empty.
    pub title: &'static str,
    /// A position in metres and a rotation for each piece.
    pub pieces: Vec<([f64; 3], Turn)>,
}

impl Furniture {
    /// A record whose model is placed once.
    pub fn new(uid: &'static str, model: &'static str, title: &'static str, at: [f64; 3], turn: Turn) -> Self {
        Self { uid, model, title, pieces: vec![(at, turn)] }
    }
}

/// A rotation about y as a quaternion in the data's order x, y, z, w.
pub type Turn = [f64; 4];

/// Rotations by the direction that the front faces. A model's own front faces +z, which is south.
pub const SOUTH: Turn = [0.0, 0.0, 0.0, 1.0];
pub const EAST: Turn = [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];
pub const NORTH: Turn = [0.0, 1.0, 0.0, 0.0];
pub const WEST: Turn = [0.0, -FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];

/// A designer's camera.
pub struct Snapshot {
    /// Position and target in metres.
    pub at: [f64; 3],
    pub target: [f64; 3],
    /// Vertical field of view in degrees.
    pub fov_y_deg: f64,
}

impl Snapshot {
    pub fn new(at: [f64; 3], target: [f64; 3], fov_y_deg: f64) -> Self {
        Self { at, target, fov_y_deg }
    }
}

impl House {
    /// The model with this name.
    pub fn model(&self, name: &str) -> &Model {
        self.models.iter().find(|model| model.name == name).expect("furniture names models of the library")
    }

    /// The least and the greatest corner (x, z) of the rooms' inner outlines.
    pub fn outline(&self) -> [DVec2; 2] {
        let grown = |[low, high]: [DVec2; 2], room: &Room| [low.min(room.low), high.max(room.high)];
        self.rooms.iter().fold([DVec2::MAX, DVec2::MIN], grown)
    }
}

#[derive(Clone, Debug)]
pub struct ArchitectureMesh {
    /// The data's type of mesh, as in "WallInner".
    pub kind: &'static str,
    /// The name of its material in `materials`.
    pub material: &'static str,
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
    pub faces: Vec<[usize; 3]>,
}

/// A rectangular hole in a wall, in metres from the wall's start on the floor.
#[derive(Clone, Copy, Debug)]
pub struct WallHole {
    /// Along the wall.
    pub left: f64,
    pub right: f64,
    /// Above the floor.
    pub bottom: f64,
    pub top: f64,
}

impl ArchitectureMesh {
    pub fn new(kind: &'static str, material: &'static str) -> Self {
        Self { kind, material, positions: vec![], normals: vec![], uvs: vec![], faces: vec![] }
    }

    /// Adds a rectangle that spans `right` and `up` from `corner` and faces their cross product. The corner's texture
    /// coordinates are `uv`. The two triangles share no vertices.
    pub fn rectangle(mut self, corner: DVec3, right: DVec3, up: DVec3, uv: DVec2) -> Self {
        let (width, height) = (right.length(), up.length());
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)] {
            self.positions.push(corner + right * u + up * v);
            self.normals.push(right.cross(up).normalize());
            self.uvs.push(uv + DVec2::new(width * u, height * v));
        }
        let first = self.positions.len() - 6;
        self.faces.extend([[first, first + 1, first + 2], [first + 3, first + 4, first + 5]]);
        self
    }

    /// Adds a box between two corners. The two triangles of a side share vertices.
    pub fn boxed(mut self, low: DVec3, high: DVec3) -> Self {
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        for (normal, right, up) in sides() {
            let first = self.positions.len();
            for (u, v) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                self.positions.push(middle + (normal + right * u + up * v) * half);
                self.normals.push(normal);
                let size = DVec2::new((right * half).length(), (up * half).length());
                self.uvs.push(size * DVec2::new(1.0 + u, 1.0 + v));
            }
            self.faces.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        self
    }

    /// Adds an upright wall that starts at `foot` and runs along `along`, to the right seen from its front. u is
    /// measured from the start, v downwards from the top.
    pub fn wall(self, foot: DVec3, along: DVec3, height: f64, holes: &[WallHole]) -> Self {
        let (length, right) = (along.length(), along.normalize());
        let mut holes = holes.to_vec();
        holes.sort_by(|a, b| a.left.total_cmp(&b.left));
        // The wall is cut into full-height strips between the holes and rectangles below and above each hole.
        let mut pieces = Vec::new();
        let mut from = 0.0;
        for hole in holes {
            pieces.push((from, 0.0, hole.left, height));
            pieces.push((hole.left, 0.0, hole.right, hole.bottom));
            pieces.push((hole.left, hole.top, hole.right, height));
            from = hole.right;
        }
        pieces.push((from, 0.0, length, height));
        pieces.into_iter().filter(|(x0, y0, x1, y1)| x1 > x0 && y1 > y0).fold(self, |wall, (x0, y0, x1, y1)| {
            let corner = foot + right * x0 + DVec3::Y * y0;
            wall.rectangle(corner, right * (x1 - x0), DVec3::Y * (y1 - y0), DVec2::new(x0, y0 - height))
        })
    }

    /// Adds a horizontal rectangle between two corners (x, z) that faces up. u runs along +x, v along -z.
    pub fn facing_up(self, low: DVec2, high: DVec2, y: f64) -> Self {
        let size = high - low;
        let (right, up) = (DVec3::X * size.x, DVec3::NEG_Z * size.y);
        self.rectangle(DVec3::new(low.x, y, high.y), right, up, DVec2::new(0.0, -size.y))
    }

    /// Adds a horizontal rectangle between two corners (x, z) that faces down. u runs along +x, v along +z.
    pub fn facing_down(self, low: DVec2, high: DVec2, y: f64) -> Self {
        let size = high - low;
        let (right, up) = (DVec3::X * size.x, DVec3::Z * size.y);
        self.rectangle(DVec3::new(low.x, y, low.y), right, up, DVec2::new(0.0, -size.y))
    }

    /// Adds the inner sides of a hole through a wall, between two corners, facing into the hole: the left, right and
    /// upper sides and, with `sill`, the lower one. The hole passes through the wall along the shorter of x and z.
    pub fn reveal(mut self, low: DVec3, high: DVec3, sill: bool) -> Self {
        let size = high - low;
        let through_x = size.x < size.z;
        let (middle, half) = ((low + high) / 2.0, size / 2.0);
        for (normal, right, up) in sides() {
            let open = if through_x { normal.x != 0.0 } else { normal.z != 0.0 };
            if open || (normal.y < 0.0 && !sill) {
                continue;
            }
            // `sides` face out of a box; here right and the front are reversed.
            let corner = middle + normal * half + right * half - up * half;
            self = self.rectangle(corner, -right * half * 2.0, up * half * 2.0, DVec2::ZERO);
        }
        self
    }
}

/// Height of the ceiling.
pub const HEIGHT: f64 = 2.8;
/// Thickness of the walls.
pub const THICKNESS: f64 = 0.2;

/// The inner outline of a rectangular room between two corners (x, z), and the materials of its shell.
#[derive(Clone, Copy, Debug)]
pub struct Outline {
    pub low: DVec2,
    pub high: DVec2,
    pub floor: &'static str,
    pub walls: &'static str,
    /// The baseboards' material.
    pub trim: &'static str,
}

const LIVING_ROOM: Outline =
    Outline { low: DVec2::new(0.0, 0.0), high: DVec2::new(6.0, 4.4), floor: "floor", walls: "wallpaper", trim: "trim" };
const BEDROOM: Outline = Outline {
    low: DVec2::new(6.2, 0.0),
    high: DVec2::new(10.0, 4.4),
    floor: "floor",
    walls: "bedroom_wallpaper",
    trim: "trim",
};

const fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// An opening through a wall, between its lowest and its highest corner; it is as deep as the wall.
pub type Opening = [DVec3; 2];

const PASSAGE: Opening = [v(6.0, 0.0, 1.5), v(6.2, 2.2, 2.9)];
/// The door in the living room's south wall.
pub const DOOR: Opening = [v(4.6, 0.0, 4.4), v(5.5, 2.1, 4.6)];
const LIVING_WINDOW: Opening = [v(1.4, 0.9, -0.2), v(4.2, 2.3, 0.0)];
const BEDROOM_WINDOW: Opening = [v(10.0, 0.9, 1.4), v(10.2, 2.3, 3.2)];
const OPENINGS: [Opening; 4] = [PASSAGE, DOOR, LIVING_WINDOW, BEDROOM_WINDOW];

/// Those openings that lie in the wall that starts at `foot` and runs along `along`.
fn holes_of(foot: DVec3, along: DVec3, openings: &[Opening]) -> Vec<WallHole> {
    let (length, right) = (along.length(), along.normalize());
    let normal = right.cross(DVec3::Y);
    let within = |[low, high]: &Opening| {
        let (a, b) = ((low - foot).dot(right), (high - foot).dot(right));
        let off = ((low + high) / 2.0 - foot).dot(normal).abs();
        let (left, right) = (a.min(b), a.max(b));
        let here = off < THICKNESS * 0.6 && left >= 0.0 && right <= length;
        here.then_some(WallHole { left, right, bottom: low.y, top: high.y })
    };
    openings.iter().filter_map(within).collect()
}

/// The four walls of a room, each as its start on the floor and its extent, which runs to the right seen from inside.
fn wall_lines(room: &Outline) -> [(DVec3, DVec3); 4] {
    let (low, high) = (room.low, room.high);
    let size = high - low;
    [
        (v(low.x, 0.0, low.y), DVec3::X * size.x),
        (v(high.x, 0.0, low.y), DVec3::Z * size.y),
        (v(high.x, 0.0, high.y), DVec3::NEG_X * size.x),
        (v(low.x, 0.0, high.y), DVec3::NEG_Z * size.y),
    ]
}

/// Floor, ceiling, four walls and their baseboards.
pub fn shell(room: &Outline, openings: &[Opening]) -> Vec<ArchitectureMesh> {
    let mut meshes = vec![
        ArchitectureMesh::new("Floor", room.floor).facing_up(room.low, room.high, 0.0),
        ArchitectureMesh::new("Ceiling", "ceiling").facing_down(room.low, room.high, HEIGHT),
    ];
    for (foot, along) in wall_lines(room) {
        let holes = holes_of(foot, along, openings);
        meshes.push(ArchitectureMesh::new("WallInner", room.walls).wall(foot, along, HEIGHT, &holes));
        meshes.push(baseboard(room.trim, foot, along, &holes));
    }
    meshes
}

/// A strip of 10 cm by 1.2 cm along a wall, interrupted by the openings that reach down to the floor.
fn baseboard(material: &'static str, foot: DVec3, along: DVec3, holes: &[WallHole]) -> ArchitectureMesh {
    let (length, right) = (along.length(), along.normalize());
    let inwards = right.cross(DVec3::Y);
    let mut gaps: Vec<_> = holes.iter().filter(|h| h.bottom < 0.1).map(|h| (h.left - 0.06, h.right + 0.06)).collect();
    gaps.push((length, length));
    let (mut board, mut from) = (ArchitectureMesh::new("Baseboard", material), 0.0);
    for (left, next) in gaps {
        let (a, b) = (foot + right * from, foot + right * left + inwards * 0.012 + DVec3::Y * 0.1);
        board = board.boxed(a.min(b), a.max(b));
        from = next;
    }
    board
}

/// Outer walls, and the tops and bottoms of walls. An outer wall is given by its start and its extent, which runs to
/// the right seen from outside; `plans` are corners (x, z) of walls on the plan.
pub fn outside(lines: &[(DVec3, DVec3)], plans: &[[f64; 4]], openings: &[Opening]) -> Vec<ArchitectureMesh> {
    let outer = lines.iter().map(|&(foot, along)| {
        ArchitectureMesh::new("WallOuter", "outer_wall").wall(foot, along, HEIGHT, &holes_of(foot, along, openings))
    });
    let levels = plans.iter().flat_map(|&[x0, z0, x1, z1]| {
        let (low, high) = (DVec2::new(x0, z0), DVec2::new(x1, z1));
        let bottom = ArchitectureMesh::new("WallBottom", "outer_wall");
        let on_the_floor = on_the_floor(low, high, openings);
        [
            ArchitectureMesh::new("WallTop", "outer_wall").facing_up(low, high, HEIGHT),
            on_the_floor.into_iter().fold(bottom, |mesh, (low, high)| mesh.facing_down(low, high, 0.0)),
        ]
    });
    outer.chain(levels).collect()
}

/// The parts of a wall's plan that touch the floor: all of it except an opening that reaches down to the floor. A wall
/// has at most one such opening.
fn on_the_floor(low: DVec2, high: DVec2, openings: &[Opening]) -> Vec<(DVec2, DVec2)> {
    for [from, to] in openings.iter().filter(|[from, _]| from.y == 0.0) {
        let (from, to) = (DVec2::new(from.x, from.z), DVec2::new(to.x, to.z));
        if from.cmpge(low).all() && to.cmple(high).all() {
            let along_x = high.x - low.x > high.y - low.y;
            let [until, beyond] =
                if along_x { [high.with_x(from.x), low.with_x(to.x)] } else { [high.with_y(from.y), low.with_y(to.y)] };
            return vec![(low, until), (beyond, high)];
        }
    }
    vec![(low, high)]
}

pub(super) fn living_room() -> Room {
    Room {
        kind: "LivingDiningRoom",
        name: "LivingDiningRoom-101",
        low: LIVING_ROOM.low,
        high: LIVING_ROOM.high,
        meshes: living_room_meshes(),
        furniture: living_room_furniture(),
        cameras: vec![
            Snapshot::new([5.5, 1.5, 3.9], [1.8, 0.85, 1.7], 60.0),
            Snapshot::new([0.6, 1.5, 2.2], [6.1, 1.0, 2.0], 55.0),
            Snapshot::new([3.6, 1.45, 0.5], [1.2, 0.7, 3.6], 62.0),
        ],
    }
}

/// The living room's shell and outer sides, the opening to the bedroom, the door, the window and the suspended ceiling.
/// The last mesh closes the house behind the door.
fn living_room_meshes() -> Vec<ArchitectureMesh> {
    let mut meshes = shell(&LIVING_ROOM, &OPENINGS);
    meshes.extend(outside(
        &[(v(6.1, 0.0, -0.2), v(-6.3, 0.0, 0.0)), (v(-0.2, 0.0, -0.2), v(0.0, 0.0, 4.8))],
        &[[-0.2, -0.2, 6.1, 0.0], [-0.2, 0.0, 0.0, 4.4], [6.0, 0.0, 6.2, 4.4], [-0.2, 4.4, 6.1, 4.6]],
        &OPENINGS,
    ));
    meshes.extend([
        ArchitectureMesh::new("Hole", "trim").reveal(PASSAGE[0], PASSAGE[1], true),
        ArchitectureMesh::new("Door", "door").reveal(DOOR[0], DOOR[1], true),
        ArchitectureMesh::new("Door", "door").boxed(DOOR[0].with_z(4.48), DOOR[1].with_z(4.52)),
        door_trim(4.388, 4.4),
        ArchitectureMesh::new("Window", "trim").reveal(LIVING_WINDOW[0], LIVING_WINDOW[1], true),
        window_bars(),
    ]);
    meshes.extend(hung_ceiling());
    meshes.push(ArchitectureMesh::new("WallOuter", "outer_wall").wall(
        v(-0.2, 0.0, 4.6),
        v(6.0, 0.0, 0.0),
        HEIGHT,
        &[],
    ));
    meshes
}

/// Trim on three sides of the door from z = `back` to z = `front`.
pub fn door_trim(back: f64, front: f64) -> ArchitectureMesh {
    let ([low, high], w) = (DOOR, 0.06);
    ArchitectureMesh::new("Pocket", "door")
        .boxed(v(low.x - w, 0.0, back), v(low.x, high.y, front))
        .boxed(v(high.x, 0.0, back), v(high.x + w, high.y, front))
        .boxed(v(low.x - w, high.y, back), v(high.x + w, high.y + w, front))
}

/// The frame of the living room's window, with two mullions.
fn window_bars() -> ArchitectureMesh {
    let ([low, high], w) = (LIVING_WINDOW, 0.05);
    let bar =
        |mesh: ArchitectureMesh, x0: f64, y0: f64, x1: f64, y1: f64| mesh.boxed(v(x0, y0, -0.13), v(x1, y1, -0.08));
    let mut bars = ArchitectureMesh::new("Window", "trim");
    for x in [low.x, low.x + 0.9, high.x - 0.95, high.x - w] {
        bars = bar(bars, x, low.y, x + w, high.y);
    }
    for y in [low.y, high.y - w] {
        bars = bar(bars, low.x, y, high.x, y + w);
    }
    bars
}

/// A suspended ceiling: four boxes whose tops lie in the ceiling, a sheet just below the ceiling, and light strips
/// along the inner edges.
fn hung_ceiling() -> Vec<ArchitectureMesh> {
    let (low, high, wide, bottom) = (LIVING_ROOM.low, LIVING_ROOM.high, 0.5, 2.55);
    let mut frame = ArchitectureMesh::new("CustomizedCeiling", "ceiling");
    let mut band = ArchitectureMesh::new("LightBand", "light_band");
    let strip = |mesh: ArchitectureMesh, x0: f64, y0: f64, z0: f64, x1: f64, y1: f64, z1: f64| {
        mesh.boxed(v(x0, y0, z0), v(x1, y1, z1))
    };
    for x in [low.x, high.x - wide] {
        frame = strip(frame, x, bottom, low.y, x + wide, HEIGHT, high.y);
    }
    for z in [low.y, high.y - wide] {
        frame = strip(frame, low.x + wide, bottom, z, high.x - wide, HEIGHT, z + wide);
    }
    for x in [low.x + wide, high.x - wide - 0.02] {
        band = strip(band, x, 2.7, low.y + wide, x + 0.02, 2.72, high.y - wide);
    }
    for z in [low.y + wide, high.y - wide - 0.02] {
        band = strip(band, low.x + wide, 2.7, z, high.x - wide, 2.72, z + 0.02);
    }
    let sheet =
        ArchitectureMesh::new("CustomizedCeiling", "ceiling").facing_down(low + wide, high - wide, HEIGHT - 0.005);
    vec![frame, sheet, band]
}

/// The upper ends of the lamps touch the ceiling.
const PENDANT_Y: f64 = HEIGHT - 0.95;
const CEILING_LAMP_Y: f64 = HEIGHT - 0.15;

fn living_room_furniture() -> Vec<Furniture> {
    vec![
        Furniture::new("1001/model", "l_sofa", "sofa/l-shaped sofa", [1.6, 0.0, 3.59], NORTH),
        Furniture::new("1002/model", "coffee_table", "table/coffee table", [1.75, 0.0, 2.35], SOUTH),
        Furniture::new("1003/model", "tv_stand", "cabinet/tv stand", [1.75, 0.0, 0.25], SOUTH),
        Furniture::new("1004/model", "dining_table", "table/dining table", [4.4, 0.0, 1.6], SOUTH),
        Furniture::new("1005/model", "dining_chair", "chair/dining chair", [4.0, 0.0, 0.85], SOUTH),
        Furniture::new("1006/model", "dining_chair", "chair/dining chair", [4.8, 0.0, 0.85], SOUTH),
        Furniture::new("1007/model", "dining_chair", "chair/dining chair", [4.0, 0.0, 2.35], NORTH),
        Furniture::new("1008/model", "dining_chair", "", [4.8, 0.0, 2.35], NORTH),
        Furniture::new("1009/model", "pendant_lamp", "lighting/pendant light", [4.4, PENDANT_Y, 1.6], SOUTH),
        Furniture::new("1010/model", "floor_lamp", "lighting/floor lamp", [3.15, 0.0, 4.05], SOUTH),
        Furniture::new("1011/model", "picture", "accessory/picture", [0.025, 1.3, 1.9], EAST),
    ]
}

pub(super) fn bedroom() -> Room {
    Room {
        kind: "MasterBedroom",
        name: "MasterBedroom-102",
        low: BEDROOM.low,
        high: BEDROOM.high,
        meshes: bedroom_meshes(),
        furniture: bedroom_furniture(),
        cameras: vec![Snapshot::new([6.5, 1.55, 3.9], [8.5, 0.75, 0.9], 62.0)],
    }
}

/// The bedroom's shell and outer sides, a panel on the wall behind the bed, the window's inner sides and its sill.
fn bedroom_meshes() -> Vec<ArchitectureMesh> {
    let mut meshes = shell(&BEDROOM, &OPENINGS);
    meshes.extend(outside(
        &[
            (v(5.8, 0.0, 4.6), v(4.4, 0.0, 0.0)),
            (v(10.2, 0.0, 4.6), v(0.0, 0.0, -4.8)),
            (v(10.2, 0.0, -0.2), v(-4.1, 0.0, 0.0)),
        ],
        &[[6.1, -0.2, 10.2, 0.0], [10.0, 0.0, 10.2, 4.4], [6.1, 4.4, 10.2, 4.6]],
        &OPENINGS,
    ));
    meshes.extend([
        ArchitectureMesh::new("CustomizedFeatureWall", "panel").boxed(v(6.95, 0.12, 0.0), v(9.25, 2.4, 0.03)),
        ArchitectureMesh::new("BayWindow", "trim").reveal(BEDROOM_WINDOW[0], BEDROOM_WINDOW[1], true),
        ArchitectureMesh::new("BayWindow", "trim").boxed(v(9.94, 0.87, 1.35), v(10.0, 0.9, 3.25)),
    ]);
    meshes
}

/// The nightstand is placed twice.
fn bedroom_furniture() -> Vec<Furniture> {
    let mut nightstand = Furniture::new("2002/model", "nightstand", "cabinet/nightstand", [6.8, 0.0, 0.25], SOUTH);
    nightstand.pieces.push(([9.4, 0.0, 0.25], SOUTH));
    vec![
        Furniture::new("2001/model", "bed", "bed/double bed", [8.1, 0.0, 1.125], SOUTH),
        nightstand,
        Furniture::new("2003/model", "wardrobe", "cabinet/wardrobe", [8.6, 0.0, 4.07], NORTH),
        Furniture::new("2004/model", "bed_end_stool", "stool/bed end stool", [8.1, 0.0, 2.5], SOUTH),
        Furniture::new("2005/model", "ceiling_lamp", "lighting/ceiling light", [8.1, CEILING_LAMP_Y, 2.3], SOUTH),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(mesh: &ArchitectureMesh) -> f64 {
        let p = &mesh.positions;
        mesh.faces.iter().map(|&[a, b, c]| (p[b] - p[a]).cross(p[c] - p[a]).length() / 2.0).sum()
    }

    fn faces_agree_with_normals(mesh: &ArchitectureMesh) -> bool {
        let p = &mesh.positions;
        mesh.faces.iter().all(|&[a, b, c]| (p[b] - p[a]).cross(p[c] - p[a]).dot(mesh.normals[a]) > 0.0)
    }

    #[test]
    fn a_wall_has_the_area_that_its_holes_leave() {
        let holes = [
            WallHole { left: 3.0, right: 3.5, bottom: 0.0, top: 2.0 },
            WallHole { left: 0.5, right: 1.5, bottom: 1.0, top: 2.0 },
        ];
        let wall = ArchitectureMesh::new("WallInner", "paint").wall(DVec3::ZERO, DVec3::X * 4.0, 2.5, &holes);
        assert!((area(&wall) - (10.0 - 1.0 - 1.0)).abs() < 1e-12);
        assert!(faces_agree_with_normals(&wall));
        // u is the distance along the wall and v the height relative to its top, however the wall is cut.
        for (p, uv) in wall.positions.iter().zip(&wall.uvs) {
            assert!((DVec2::new(p.x, p.y - 2.5) - uv).length() < 1e-12);
        }
    }

    #[test]
    fn reveals_face_into_their_hole() {
        let (low, high) = (DVec3::new(1.0, 0.5, 0.0), DVec3::new(2.0, 1.5, 0.2));
        for (sill, rectangles) in [(true, 4), (false, 3)] {
            let reveal = ArchitectureMesh::new("Window", "paint").reveal(low, high, sill);
            assert_eq!(reveal.faces.len(), 2 * rectangles);
            assert!(faces_agree_with_normals(&reveal));
            let middle = (low + high) / 2.0;
            assert!(reveal.positions.iter().zip(&reveal.normals).all(|(p, n)| (middle - p).dot(*n) > 0.0));
        }
    }

    /// Every opening is cut into the walls on both of its sides, except the door, which is blind, and into no other
    /// wall.
    #[test]
    fn holes_go_through() {
        let lines = [LIVING_ROOM, BEDROOM].into_iter().flat_map(|room| wall_lines(&room));
        assert_eq!(lines.map(|(foot, along)| holes_of(foot, along, &OPENINGS).len()).sum::<usize>(), 5);
        // The outer walls that hold the windows.
        let windows = [(v(6.1, 0.0, -0.2), v(-6.3, 0.0, 0.0)), (v(10.2, 0.0, 4.6), v(0.0, 0.0, -4.8))];
        assert!(windows.iter().all(|&(foot, along)| holes_of(foot, along, &OPENINGS).len() == 1));
    }

    /// Floors face up, ceilings down, inner walls into their room.
    #[test]
    fn the_shell_faces_the_room() {
        for room in [LIVING_ROOM, BEDROOM] {
            let middle = ((room.low + room.high) / 2.0).extend(HEIGHT / 2.0);
            let middle = v(middle.x, middle.z, middle.y);
            for mesh in shell(&room, &OPENINGS).iter().filter(|mesh| mesh.kind != "Baseboard") {
                for &[a, b, c] in &mesh.faces {
                    let p = |i: usize| mesh.positions[i];
                    assert!((p(b) - p(a)).cross(p(c) - p(a)).dot(middle - p(a)) > 0.0, "{room:?} {}", mesh.kind);
                }
            }
        }
    }
}
