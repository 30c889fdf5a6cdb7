//! Meshes: [`Solid`], which the scenes' geometry is built of, and the furniture that both scenes use, in metres, +y up,
//! fronts towards +z, with the origin on the floor below the object.

use std::fmt::Write as _;

use glam::{DVec2, DVec3};

/// A mesh under construction. Faces share no vertices.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
    /// Vertex indices of each face, three or four, counter-clockwise seen from outside.
    pub faces: Vec<Vec<usize>>,
}

/// Position, normal and texture coordinates of a corner of a face.
type Corner = (DVec3, DVec3, DVec2);

impl Solid {
    /// The number of triangles once quads are split.
    #[cfg(test)]
    pub fn triangle_count(&self) -> usize {
        self.faces.iter().map(|face| face.len() - 2).sum()
    }

    fn face(&mut self, corners: &[Corner]) {
        let first = self.positions.len();
        for (position, normal, uv) in corners {
            self.positions.push(*position);
            self.normals.push(*normal);
            self.uvs.push(*uv);
        }
        self.faces.push((first..first + corners.len()).collect());
    }

    /// Adds a rectangle that spans `right` and `up` from `corner` and faces their cross product. One unit of uv is
    /// `tile` metres.
    pub fn rectangle(mut self, corner: DVec3, right: DVec3, up: DVec3, tile: DVec2) -> Self {
        let normal = right.cross(up).normalize();
        let size = DVec2::new(right.length(), up.length()) / tile;
        let at = |u: f64, v: f64| (corner + right * u + up * v, normal, size * DVec2::new(u, v));
        self.face(&[at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]);
        self
    }

    /// Adds a box between two corners. The texture's u runs along the longest edge of each side.
    pub fn boxed(mut self, low: DVec3, high: DVec3, tile: f64) -> Self {
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        for (normal, right, up) in sides() {
            let (right, up) = longest_first(normal, right, up, half);
            let corner = middle + normal * half - right * half - up * half;
            self = self.rectangle(corner, right * half * 2.0, up * half * 2.0, DVec2::splat(tile));
        }
        self
    }

    /// Adds a box whose edges are rounded by `radius`.
    pub fn cushion(mut self, low: DVec3, high: DVec3, radius: f64, tile: f64) -> Self {
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        for (normal, right, up) in sides() {
            // Grid lines across the side, denser where the edges are round.
            let lines = |axis: DVec3| {
                let (h, bend) = ((axis * half).length(), 0.4 * radius);
                [-h, -h + bend, -h + radius, h - radius, h - bend, h]
            };
            let (across, along) = (lines(right), lines(up));
            // A grid point is pushed out from the box that remains when `radius` is taken off every side.
            let at = |i: usize, j: usize| {
                let flat = normal * half + right * across[i] + up * along[j];
                let core = flat.clamp(-half + radius, half - radius);
                let out = (flat - core).normalize();
                (middle + core + out * radius, out, DVec2::new(across[i], along[j]) / tile)
            };
            for i in 0..5 {
                for j in 0..5 {
                    self.face(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
        self
    }

    /// Adds the surface of revolution of a profile of (radius, height), given from bottom to top, about the vertical
    /// axis through `foot`. It faces outwards.
    pub fn turned(mut self, foot: DVec3, profile: &[(f64, f64)], segments: usize, tile: f64) -> Self {
        let turn = |step: usize| {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * (step % segments) as f64 / segments as f64);
            DVec3::new(sin, 0.0, cos)
        };
        let widest = profile.iter().fold(0.0_f64, |widest, (radius, _)| widest.max(*radius));
        let mut length = 0.0;
        for pair in profile.windows(2) {
            // The normal in the plane of the profile, and the length of the profile up to here, which becomes v.
            let [(r0, y0), (r1, y1)] = [pair[0], pair[1]];
            let slope = DVec2::new(y1 - y0, r0 - r1).normalize();
            let next = length + DVec2::new(r1 - r0, y1 - y0).length();
            let at = |step: usize, radius: f64, height: f64, v: f64| {
                let out = turn(step);
                let around = std::f64::consts::TAU * widest * step as f64 / segments as f64;
                let normal = (out * slope.x).with_y(slope.y);
                (foot + (out * radius).with_y(height), normal, DVec2::new(around, v) / tile)
            };
            // One face a segment: a quad, or a triangle where the profile meets the axis.
            for step in 0..segments {
                let (a, b) = (at(step, r0, y0, length), at(step + 1, r0, y0, length));
                let (c, d) = (at(step + 1, r1, y1, next), at(step, r1, y1, next));
                match (r0 > 0.0, r1 > 0.0) {
                    (true, true) => self.face(&[a, b, c, d]),
                    (true, false) => self.face(&[a, b, d]),
                    _ => self.face(&[a, c, d]),
                }
            }
            length = next;
        }
        self
    }

    /// The solid as Wavefront OBJ text with four decimals. Every corner of a face has uv and normal.
    pub fn to_obj(&self) -> String {
        let mut text = String::from("# made by MatEval, CC0 1.0\n");
        // Writing to a String cannot fail. Adding 0 turns a rounded -0 into 0.
        let round = |v: f64| (v * 1e4).round() / 1e4 + 0.0;
        for p in &self.positions {
            let _ = writeln!(text, "v {:.4} {:.4} {:.4}", round(p.x), round(p.y), round(p.z));
        }
        for uv in &self.uvs {
            let _ = writeln!(text, "vt {:.4} {:.4}", round(uv.x), round(uv.y));
        }
        for n in &self.normals {
            let _ = writeln!(text, "vn {:.4} {:.4} {:.4}", round(n.x), round(n.y), round(n.z));
        }
        for face in &self.faces {
            text.push('f');
            for corner in face {
                let _ = write!(text, " {0}/{0}/{0}", corner + 1);
            }
            text.push('\n');
        }
        text
    }
}

/// Normal, right and up of the six sides of a box; the cross product of right and up is the normal.
pub fn sides() -> [(DVec3, DVec3, DVec3); 6] {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    [(x, -z, y), (-x, z, y), (y, x, -z), (-y, x, z), (z, x, y), (-z, -x, y)]
}

/// Right and up of a side, turned by 90 degrees where up is the longer edge.
fn longest_first(normal: DVec3, right: DVec3, up: DVec3, half: DVec3) -> (DVec3, DVec3) {
    if (up * half).length() > (right * half).length() { (up, normal.cross(up)) } else { (right, up) }
}

/// Metres that a texture spans.
pub(crate) mod tile {
    /// Planks of the floor.
    pub(crate) const PLANKS: f64 = 1.2;
    /// Wood of furniture.
    pub(crate) const WOOD: f64 = 0.8;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether every face is counter-clockwise seen from the side of its normals.
    fn faces_agree_with_normals(solid: &Solid) -> bool {
        solid.faces.iter().all(|face| {
            let p: Vec<_> = face.iter().map(|&i| solid.positions[i]).collect();
            let front = (p[1] - p[0]).cross(p[2] - p[0]);
            face.iter().all(|&i| front.dot(solid.normals[i]) > 0.0)
        })
    }

    #[test]
    fn all_builders_face_outwards() {
        let (low, high) = (DVec3::new(0.0, 0.0, 0.0), DVec3::new(1.0, 0.5, 0.3));
        for (solid, triangles) in [
            (Solid::default().boxed(low, high, 0.5), 12),
            (Solid::default().cushion(low, high, 0.1, 0.5), 300),
            (Solid::default().turned(low, &[(0.0, 0.0), (0.2, 0.0), (0.1, 0.5), (0.0, 0.5)], 12, 0.5), 48),
        ] {
            assert!(faces_agree_with_normals(&solid));
            assert_eq!(solid.triangle_count(), triangles);
        }
    }

    #[test]
    fn a_box_has_texture_coordinates_in_tiles() {
        let solid = Solid::default().boxed(DVec3::ZERO, DVec3::new(2.0, 1.0, 0.5), 0.5);
        let widest = solid.uvs.iter().fold(DVec2::ZERO, |most, uv| most.max(*uv));
        assert_eq!(widest, DVec2::new(4.0, 2.0));
    }
}
