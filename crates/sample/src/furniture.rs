//! The room's furniture as meshes, in metres, +y up, fronts towards +z, with the origin on the floor below the object.

use glam::{DVec2, DVec3};

use super::solid::Solid;

/// Metres that a texture spans.
pub(super) mod tile {
    /// Planks of the floor.
    pub(crate) const PLANKS: f64 = 1.2;
    /// Wood of furniture.
    pub(crate) const WOOD: f64 = 0.8;
    /// The wallpaper.
    pub(crate) const WALLPAPER: f64 = 0.5;
    /// The sofa's fabric.
    pub(crate) const FABRIC: f64 = 0.3;
    /// Objects without a texture.
    pub(crate) const PLAIN: f64 = 1.0;
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A table of 1.1 m by 0.6 m, 0.42 m high, with a shelf under the top.
pub(super) fn table() -> Solid {
    let mut table = Solid::default().boxed(v(-0.55, 0.385, -0.3), v(0.55, 0.42, 0.3), tile::WOOD).boxed(
        v(-0.5, 0.14, -0.25),
        v(0.5, 0.16, 0.25),
        tile::WOOD,
    );
    for (x, z) in [(-0.51, -0.26), (0.51, -0.26), (0.51, 0.26), (-0.51, 0.26)] {
        table = table.boxed(v(x - 0.03, 0.0, z - 0.03), v(x + 0.03, 0.385, z + 0.03), tile::WOOD);
    }
    table
}

/// A sofa with two seats, 1.7 m wide and 0.8 m deep, without its feet.
pub(super) fn sofa() -> Solid {
    Solid::default()
        .cushion(v(-0.85, 0.08, -0.4), v(-0.67, 0.6, 0.4), 0.06, tile::FABRIC)
        .cushion(v(0.67, 0.08, -0.4), v(0.85, 0.6, 0.4), 0.06, tile::FABRIC)
        .cushion(v(-0.67, 0.08, -0.4), v(0.67, 0.82, -0.16), 0.08, tile::FABRIC)
        .cushion(v(-0.665, 0.26, -0.16), v(0.0, 0.44, 0.38), 0.06, tile::FABRIC)
        .cushion(v(0.0, 0.26, -0.16), v(0.665, 0.44, 0.38), 0.06, tile::FABRIC)
        .boxed(v(-0.67, 0.1, -0.3), v(0.67, 0.27, 0.34), tile::FABRIC)
}

/// The sofa's four feet.
pub(super) fn sofa_feet() -> Solid {
    [(-0.76, -0.32), (0.76, -0.32), (0.76, 0.32), (-0.76, 0.32)].into_iter().fold(Solid::default(), |feet, (x, z)| {
        feet.turned(v(x, 0.0, z), &[(0.0, 0.0), (0.02, 0.0), (0.028, 0.1)], 12, tile::PLAIN)
    })
}

/// A low open shelf, 1.2 m wide, 0.8 m high and 0.35 m deep, its back towards -z.
pub fn shelf() -> Solid {
    let plank = |shelf: Solid, low, high| shelf.boxed(low, high, tile::WOOD);
    let mut shelf = plank(Solid::default(), v(-0.6, 0.0, -0.175), v(0.6, 0.8, -0.165));
    for x in [-0.6, -0.0125, 0.575] {
        shelf = plank(shelf, v(x, 0.0, -0.165), v(x + 0.025, 0.8, 0.175));
    }
    for y in [0.03, 0.39, 0.775] {
        for (from, to) in [(-0.575, -0.0125), (0.0125, 0.575)] {
            shelf = plank(shelf, v(from, y, -0.165), v(to, y + 0.025, 0.17));
        }
    }
    shelf
}

/// A storage box; `size` is in metres.
pub(super) fn container(size: DVec3) -> Solid {
    let half = v(size.x / 2.0, 0.0, size.z / 2.0);
    Solid::default().cushion(-half, half.with_y(size.y), 0.012, tile::PLAIN)
}

/// A rug of 1.9 m by 1.3 m; the texture covers it once.
pub(super) fn rug() -> Solid {
    let (x, y, z) = (0.95, 0.012, 0.65);
    let size = DVec2::new(2.0 * x, 2.0 * z);
    let edge = DVec2::new(2.0 * x, 2.0 * x);
    Solid::default()
        .rectangle(v(-x, y, z), v(2.0 * x, 0.0, 0.0), v(0.0, 0.0, -2.0 * z), size)
        .rectangle(v(-x, 0.0, z), v(2.0 * x, 0.0, 0.0), v(0.0, y, 0.0), edge)
        .rectangle(v(x, 0.0, -z), v(-2.0 * x, 0.0, 0.0), v(0.0, y, 0.0), edge)
        .rectangle(v(x, 0.0, z), v(0.0, 0.0, -2.0 * z), v(0.0, y, 0.0), edge)
        .rectangle(v(-x, 0.0, -z), v(0.0, 0.0, 2.0 * z), v(0.0, y, 0.0), edge)
}

/// The foot and the pole of a floor lamp.
pub(super) fn lamp_stand() -> Solid {
    let profile = [(0.0, 0.0), (0.15, 0.0), (0.15, 0.02), (0.03, 0.035), (0.012, 0.06), (0.012, 1.5), (0.0, 1.5)];
    Solid::default().turned(DVec3::ZERO, &profile, 24, tile::PLAIN)
}

/// The shade of the floor lamp, open at both ends.
pub(super) fn lamp_shade() -> Solid {
    Solid::default().turned(DVec3::ZERO, &[(0.19, 1.36), (0.13, 1.64)], 24, tile::PLAIN)
}

/// A bowl 0.28 m across.
pub(super) fn bowl() -> Solid {
    let outside = [(0.0, 0.0), (0.05, 0.0), (0.055, 0.012), (0.1, 0.035), (0.13, 0.07), (0.14, 0.105)];
    let inside = [(0.14, 0.105), (0.132, 0.105), (0.122, 0.072), (0.095, 0.042), (0.05, 0.02), (0.0, 0.016)];
    Solid::default().turned(DVec3::ZERO, &outside, 24, tile::PLAIN).turned(DVec3::ZERO, &inside, 24, tile::PLAIN)
}

/// Four bars around an opening of `size` in the plane z = 0, whose lower left corner is the origin. Bars are `bar` wide
/// and reach from z = `back` to z = `front`.
pub(super) fn frame(size: DVec2, bar: f64, back: f64, front: f64) -> Solid {
    let (w, h) = (size.x, size.y);
    let bars = [
        (v(-bar, -bar, back), v(w + bar, 0.0, front)),
        (v(-bar, h, back), v(w + bar, h + bar, front)),
        (v(-bar, 0.0, back), v(0.0, h, front)),
        (v(w, 0.0, back), v(w + bar, h, front)),
    ];
    bars.into_iter().fold(Solid::default(), |frame, (low, high)| frame.boxed(low, high, tile::WOOD))
}

/// A rectangle of `size` in the plane z = 0 that faces +z, its lower left corner at the origin.
pub(super) fn pane(size: DVec2) -> Solid {
    Solid::default().rectangle(DVec3::ZERO, v(size.x, 0.0, 0.0), v(0.0, size.y, 0.0), size)
}
