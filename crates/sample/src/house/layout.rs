//! The three rooms of the house: floors, walls, ceilings, openings and fittings.
//!
//! Metres, +y up, the floor at y = 0. On a plan with -z at the top, the living room is in the north-west, the bedroom is
//! east of it behind an opening without a door, and the library is south of it behind a door.

use glam::{DVec2, DVec3};

use super::surfaces::{ArchitectureMesh, WallHole};

/// Height of the ceiling.
pub(super) const HEIGHT: f64 = 2.8;
/// Thickness of the walls.
pub(super) const THICKNESS: f64 = 0.2;

/// A rectangular room between two corners (x, z).
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// The data's type of room.
    pub(super) kind: &'static str,
    /// The data's instanceid.
    pub(super) name: &'static str,
    pub(super) low: DVec2,
    pub(super) high: DVec2,
    /// Materials of the floor, the walls and the baseboards.
    floor: &'static str,
    walls: &'static str,
    trim: &'static str,
}

/// The three rooms. Most faults are planted in the last.
pub(super) const ROOMS: [Room; 3] = [
    Room {
        kind: "LivingDiningRoom",
        name: "LivingDiningRoom-101",
        low: DVec2::new(0.0, 0.0),
        high: DVec2::new(6.0, 4.4),
        floor: "floor",
        walls: "wallpaper",
        trim: "trim",
    },
    Room {
        kind: "MasterBedroom",
        name: "MasterBedroom-102",
        low: DVec2::new(6.2, 0.0),
        high: DVec2::new(10.0, 4.4),
        floor: "floor",
        walls: "bedroom_wallpaper",
        trim: "trim",
    },
    Room {
        kind: "OtherRoom",
        name: "OtherRoom-103",
        low: DVec2::new(0.0, 4.6),
        high: DVec2::new(5.6, 8.2),
        floor: "library_floor",
        walls: "library_wall",
        trim: "library_trim",
    },
];

const fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Lowest and highest corners of the openings, each as deep as its wall.
const PASSAGE: [DVec3; 2] = [v(6.0, 0.0, 1.5), v(6.2, 2.2, 2.9)];
const DOOR: [DVec3; 2] = [v(4.6, 0.0, 4.4), v(5.5, 2.1, 4.6)];
const LIVING_WINDOW: [DVec3; 2] = [v(1.4, 0.9, -0.2), v(4.2, 2.3, 0.0)];
const BEDROOM_WINDOW: [DVec3; 2] = [v(10.0, 0.9, 1.4), v(10.2, 2.3, 3.2)];
const LIBRARY_WINDOW: [DVec3; 2] = [v(-0.2, 1.2, 5.8), v(0.0, 2.2, 6.8)];
const HOLES: [[DVec3; 2]; 5] = [PASSAGE, DOOR, LIVING_WINDOW, BEDROOM_WINDOW, LIBRARY_WINDOW];

/// The meshes of the room with this index in [`ROOMS`]. The library has no ceiling.
pub(super) fn meshes(room: usize) -> Vec<ArchitectureMesh> {
    let mut meshes = shell(&ROOMS[room]);
    meshes.retain(|mesh| room < 2 || mesh.kind != "Ceiling");
    meshes.extend(outside(room));
    meshes.extend(match room {
        0 => living_room(),
        1 => bedroom(),
        _ => library(),
    });
    meshes
}

/// The openings in the wall that starts at `foot` and runs along `along`.
fn holes_of(foot: DVec3, along: DVec3) -> Vec<WallHole> {
    let (length, right) = (along.length(), along.normalize());
    let normal = right.cross(DVec3::Y);
    let within = |[low, high]: &[DVec3; 2]| {
        let (a, b) = ((low - foot).dot(right), (high - foot).dot(right));
        let off = ((low + high) / 2.0 - foot).dot(normal).abs();
        let (left, right) = (a.min(b), a.max(b));
        let here = off < THICKNESS * 0.6 && left >= 0.0 && right <= length;
        here.then_some(WallHole { left, right, bottom: low.y, top: high.y })
    };
    HOLES.iter().filter_map(within).collect()
}

/// The four walls of a room, each as its start on the floor and its extent, which runs to the right seen from inside.
fn wall_lines(room: &Room) -> [(DVec3, DVec3); 4] {
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
fn shell(room: &Room) -> Vec<ArchitectureMesh> {
    let mut meshes = vec![
        ArchitectureMesh::new("Floor", room.floor).facing_up(room.low, room.high, 0.0),
        ArchitectureMesh::new("Ceiling", "ceiling").facing_down(room.low, room.high, HEIGHT),
    ];
    for (foot, along) in wall_lines(room) {
        let holes = holes_of(foot, along);
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

/// The outer walls of a room, and the tops and bottoms of its walls.
fn outside(room: usize) -> Vec<ArchitectureMesh> {
    // Start and extent of the outer sides, which run to the right seen from outside.
    let lines: &[(DVec3, DVec3)] = &match room {
        0 => vec![(v(6.1, 0.0, -0.2), v(-6.3, 0.0, 0.0)), (v(-0.2, 0.0, -0.2), v(0.0, 0.0, 4.7))],
        1 => vec![
            (v(5.8, 0.0, 4.6), v(4.4, 0.0, 0.0)),
            (v(10.2, 0.0, 4.6), v(0.0, 0.0, -4.8)),
            (v(10.2, 0.0, -0.2), v(-4.1, 0.0, 0.0)),
        ],
        _ => vec![
            (v(-0.2, 0.0, 4.5), v(0.0, 0.0, 3.9)),
            (v(-0.2, 0.0, 8.4), v(6.0, 0.0, 0.0)),
            (v(5.8, 0.0, 8.4), v(0.0, 0.0, -3.8)),
        ],
    };
    // Corners (x, z) of the walls on the plan.
    let plans: &[[f64; 4]] = match room {
        0 => &[[-0.2, -0.2, 6.1, 0.0], [-0.2, 0.0, 0.0, 4.4], [6.0, 0.0, 6.2, 4.4], [-0.2, 4.4, 6.1, 4.6]],
        1 => &[[6.1, -0.2, 10.2, 0.0], [10.0, 0.0, 10.2, 4.4], [6.1, 4.4, 10.2, 4.6]],
        _ => &[[-0.2, 4.6, 0.0, 8.2], [5.6, 4.6, 5.8, 8.2], [-0.2, 8.2, 5.8, 8.4]],
    };
    // The outer sides with their openings; a top and a bottom for every wall.
    let outer = lines.iter().map(|&(foot, along)| {
        ArchitectureMesh::new("WallOuter", "outer_wall").wall(foot, along, HEIGHT, &holes_of(foot, along))
    });
    let levels = plans.iter().flat_map(|&[x0, z0, x1, z1]| {
        let (low, high) = (DVec2::new(x0, z0), DVec2::new(x1, z1));
        let bottom = ArchitectureMesh::new("WallBottom", "outer_wall");
        [
            ArchitectureMesh::new("WallTop", "outer_wall").facing_up(low, high, HEIGHT),
            on_the_floor(low, high).into_iter().fold(bottom, |mesh, (low, high)| mesh.facing_down(low, high, 0.0)),
        ]
    });
    outer.chain(levels).collect()
}

/// The parts of a wall's plan that touch the floor: all of it except an opening that reaches down to the floor. A wall
/// has at most one such opening.
fn on_the_floor(low: DVec2, high: DVec2) -> Vec<(DVec2, DVec2)> {
    for [from, to] in HOLES.iter().filter(|[from, _]| from.y == 0.0) {
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

/// The opening to the bedroom, the door to the library, the window and the suspended ceiling.
fn living_room() -> Vec<ArchitectureMesh> {
    let mut meshes = vec![
        ArchitectureMesh::new("Hole", "trim").reveal(PASSAGE[0], PASSAGE[1], true),
        ArchitectureMesh::new("Door", "door").reveal(DOOR[0], DOOR[1], true),
        ArchitectureMesh::new("Door", "door").boxed(DOOR[0].with_z(4.48), DOOR[1].with_z(4.52)),
        door_trim(4.388, 4.4),
        ArchitectureMesh::new("Window", "trim").reveal(LIVING_WINDOW[0], LIVING_WINDOW[1], true),
        window_bars(),
    ];
    meshes.extend(hung_ceiling());
    meshes
}

/// Trim on three sides of the door from z = `back` to z = `front`.
fn door_trim(back: f64, front: f64) -> ArchitectureMesh {
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

/// A suspended ceiling: four boxes whose tops lie in the ceiling, a sheet just below the ceiling, and light strips along
/// the inner edges.
fn hung_ceiling() -> Vec<ArchitectureMesh> {
    let (low, high, wide, bottom) = (ROOMS[0].low, ROOMS[0].high, 0.5, 2.55);
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

/// A panel on the wall behind the bed, the window's inner sides and its sill.
fn bedroom() -> Vec<ArchitectureMesh> {
    let (low, high) = (v(6.95, 0.12, 0.0), v(9.25, 2.4, 0.03));
    vec![
        ArchitectureMesh::new("CustomizedFeatureWall", "panel").boxed(low, high),
        ArchitectureMesh::new("BayWindow", "trim").reveal(BEDROOM_WINDOW[0], BEDROOM_WINDOW[1], true),
        ArchitectureMesh::new("BayWindow", "trim").boxed(v(9.94, 0.87, 1.35), v(10.0, 0.9, 3.25)),
    ]
}

/// A wall cabinet of three meshes, a cornice, a pipe and the door's trim on this side. The window is an open hole.
fn library() -> Vec<ArchitectureMesh> {
    vec![
        ArchitectureMesh::new("Cabinet", "cabinet").boxed(v(2.0, 1.5, 7.86), v(4.6, 2.2, 8.19)),
        ArchitectureMesh::new("Front", "cabinet")
            .boxed(v(2.02, 1.52, 7.84), v(3.29, 2.18, 7.86))
            .boxed(v(3.31, 1.52, 7.84), v(4.58, 2.18, 7.86)),
        ArchitectureMesh::new("Back", "cabinet").boxed(v(2.0, 1.5, 8.19), v(4.6, 2.2, 8.2)),
        ArchitectureMesh::new("Cornice", "library_trim").boxed(v(5.54, 2.7, 4.6), v(5.6, 2.8, 8.2)),
        ArchitectureMesh::new("SewerPipe", "library_trim").boxed(v(5.44, 0.0, 8.04), v(5.6, 2.8, 8.2)),
        door_trim(4.6, 4.612),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every opening is cut into the walls on both of its sides and into no other wall.
    #[test]
    fn holes_go_through() {
        let lines = ROOMS.iter().flat_map(wall_lines);
        assert_eq!(lines.map(|(foot, along)| holes_of(foot, along).len()).sum::<usize>(), 7);
        let windows = [
            (v(6.1, 0.0, -0.2), v(-6.3, 0.0, 0.0)),
            (v(10.2, 0.0, 4.6), v(0.0, 0.0, -4.8)),
            (v(-0.2, 0.0, 4.5), v(0.0, 0.0, 3.9)),
        ];
        assert!(windows.iter().all(|&(foot, along)| holes_of(foot, along).len() == 1));
    }

    /// Floors face up, ceilings down, inner walls into their room.
    #[test]
    fn the_shell_faces_the_room() {
        for (room, shell) in ROOMS.iter().map(|room| (room, shell(room))) {
            let middle = ((room.low + room.high) / 2.0).extend(HEIGHT / 2.0);
            let middle = v(middle.x, middle.z, middle.y);
            for mesh in shell.iter().filter(|mesh| mesh.kind != "Baseboard") {
                for &[a, b, c] in &mesh.faces {
                    let p = |i: usize| mesh.positions[i];
                    assert!((p(b) - p(a)).cross(p(c) - p(a)).dot(middle - p(a)) > 0.0, "{} {}", room.name, mesh.kind);
                }
            }
        }
    }
}
