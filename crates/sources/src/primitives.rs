//! Shapes that files state by a formula: Mitsuba's as triangles in object space, whose normals point to the front and
//! whose v grows upwards (one minus Mitsuba's), and the disc of a sun in a latitude-longitude map.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, Vec2, Vec3};
use mateval_dataset::TriangleMesh;

/// Segments of a full circle.
pub(crate) const SEGMENTS: u32 = 64;

#[derive(Default)]
struct Builder {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
}

impl Builder {
    /// Adds a vertex and returns its index. `uv` follows Mitsuba's convention.
    fn vertex(&mut self, position: DVec3, normal: DVec3, uv: DVec2) -> u32 {
        self.positions.push(position.as_vec3());
        self.normals.push(normal.as_vec3());
        self.uvs.push(DVec2::new(uv.x, 1.0 - uv.y).as_vec2());
        self.positions.len() as u32 - 1
    }

    /// Adds two triangles between four vertices, given counter-clockwise.
    fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    fn finish(self) -> TriangleMesh {
        TriangleMesh {
            positions: self.positions,
            normals: Some(self.normals),
            uvs: Some(self.uvs),
            triangles: self.triangles,
        }
    }
}

/// The square [-1, 1]^2 at z = 0, facing +z. Mitsuba's uv (0, 0) is at (-1, -1).
pub(crate) fn rectangle() -> TriangleMesh {
    let mut build = Builder::default();
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let ids = corners
        .map(|(x, y)| build.vertex(DVec3::new(x, y, 0.0), DVec3::Z, DVec2::new((x + 1.0) / 2.0, (y + 1.0) / 2.0)));
    build.quad(ids);
    build.finish()
}

/// The cube [-1, 1]^3, whose faces each cover the whole uv square, turned as in Mitsuba 3.9.1.
pub(crate) fn cube() -> TriangleMesh {
    /// The directions in which Mitsuba's u and v grow on the faces +x, -x, +y, -y, +z and -z.
    const GROWING: [[DVec3; 2]; 6] = [
        [DVec3::Y, DVec3::NEG_Z],
        [DVec3::Y, DVec3::Z],
        [DVec3::NEG_X, DVec3::NEG_Z],
        [DVec3::Z, DVec3::X],
        [DVec3::Y, DVec3::X],
        [DVec3::NEG_Y, DVec3::X],
    ];
    let mut build = Builder::default();
    let normals = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    for (normal, growing) in normals.zip(GROWING) {
        let right = if normal.x == 0.0 { DVec3::X } else { DVec3::Z };
        let up = normal.cross(right);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let ids = corners.map(|(x, y)| {
            let position = normal + right * x + up * y;
            let [u, v] = growing.map(|direction| (1.0 + position.dot(direction)) / 2.0);
            build.vertex(position, normal, DVec2::new(u, v))
        });
        build.quad(ids);
    }
    build.finish()
}

/// The disk of radius 1 at z = 0, facing +z, as a fan with the area of the disk; uv = (radius, angle / 2 pi).
pub(crate) fn disk() -> TriangleMesh {
    let mut build = Builder::default();
    let step = 2.0 * PI / f64::from(SEGMENTS);
    // A polygon inscribed in the unit circle is smaller by sin(step) / step.
    let radius = (step / libm::sin(step)).sqrt();
    for segment in 0..SEGMENTS {
        let turn = |part: f64| (f64::from(segment) + part) / f64::from(SEGMENTS);
        let rim = |part: f64| on_circle(turn(part)) * radius;
        let middle = build.vertex(DVec3::ZERO, DVec3::Z, DVec2::new(0.0, turn(0.5)));
        let a = build.vertex(rim(0.0), DVec3::Z, DVec2::new(1.0, turn(0.0)));
        let b = build.vertex(rim(1.0), DVec3::Z, DVec2::new(1.0, turn(1.0)));
        build.triangles.push([middle, a, b]);
    }
    build.finish()
}

/// The side of a cylinder, open at both ends, facing outwards.
pub(crate) fn cylinder(start: DVec3, end: DVec3, radius: f64) -> TriangleMesh {
    let mut build = Builder::default();
    let axis = (end - start).normalize_or_zero();
    let (x, y) = axis.any_orthonormal_pair();
    for segment in 0..SEGMENTS {
        let corner = |build: &mut Builder, part: u32, far: bool| {
            let turn = f64::from(segment + part) / f64::from(SEGMENTS);
            let circle = on_circle(turn);
            let normal = x * circle.x + y * circle.y;
            let foot = if far { end } else { start };
            build.vertex(foot + normal * radius, normal, DVec2::new(turn, f64::from(u8::from(far))))
        };
        let ids = [(0, false), (1, false), (1, true), (0, true)].map(|(part, far)| corner(&mut build, part, far));
        build.quad(ids);
    }
    build.finish()
}

/// A sphere that faces outwards, with poles at +-z; uv = (phi / 2 pi, theta / pi).
pub(crate) fn sphere(center: DVec3, radius: f64) -> TriangleMesh {
    let mut build = Builder::default();
    let (columns, rows) = (SEGMENTS, SEGMENTS / 2);
    for row in 0..=rows {
        let v = f64::from(row) / f64::from(rows);
        let (sin, cos) = libm::sincos(PI * v);
        for column in 0..=columns {
            let u = f64::from(column) / f64::from(columns);
            let normal = (on_circle(u) * sin).with_z(cos);
            build.vertex(center + normal * radius, normal, DVec2::new(u, v));
        }
    }
    let at = |row: u32, column: u32| row * (columns + 1) + column;
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            if row > 0 {
                build.triangles.push([a, d, b]);
            }
            if row + 1 < rows {
                build.triangles.push([a, c, d]);
            }
        }
    }
    build.finish()
}

/// The point of the unit circle in the plane z = 0 at `turn` full turns from +x.
fn on_circle(turn: f64) -> DVec3 {
    let (sin, cos) = libm::sincos(2.0 * PI * turn);
    DVec3::new(cos, sin, 0.0)
}

/// Rows of a map; it has twice as many columns, so a texel is 0.35 degrees high.
pub(crate) const ROWS: usize = 512;

/// The texels that a disc covers.
pub(crate) struct MapDisc {
    /// Indices of texels, row by row, each with the fraction of it that the disc covers.
    pub(crate) shares: Vec<(usize, f64)>,
    /// The solid angle of the covered fractions, in steradians; above 0.
    pub(crate) solid_angle: f64,
}

impl MapDisc {
    /// The disc around a unit vector in the map's frame. One smaller than a texel is enlarged to a texel. None where no
    /// texel's sample lies in it.
    pub(crate) fn new(center: DVec3, diameter_deg: f64) -> Option<Self> {
        // The fraction of a texel that the disc covers, by 16 x 16 samples.
        const PARTS: usize = 16;
        let radius = (diameter_deg / 2.0).to_radians().max(PI / ROWS as f64 / 2.0);
        let least_cos = libm::cos(radius);
        let columns = 2 * ROWS;
        let covered = |index: usize| {
            let inside = |part: usize| {
                let (right, down) = ((part % PARTS) as f64 + 0.5, (part / PARTS) as f64 + 0.5);
                let at = texel_direction(index % columns, index / columns, right / PARTS as f64, down / PARTS as f64);
                at.dot(center) >= least_cos
            };
            (0..PARTS * PARTS).filter(|&part| inside(part)).count() as f64 / (PARTS * PARTS) as f64
        };
        // Only texels near the disc are sampled; a texel reaches at most 0.36 degrees from its centre.
        let near = libm::cos((radius + 0.01).min(PI));
        let close = |index: usize| texel_direction(index % columns, index / columns, 0.5, 0.5).dot(center) >= near;
        let shares: Vec<(usize, f64)> = (0..columns * ROWS).filter(|&i| close(i)).map(|i| (i, covered(i))).collect();
        let solid_angle: f64 = shares.iter().map(|(index, share)| share * texel_solid_angle(index / columns)).sum();
        (solid_angle > 0.0).then_some(Self { shares, solid_angle })
    }
}

/// The direction of a point in a texel. `right` and `down` run from 0 to 1 over the texel.
pub(crate) fn texel_direction(column: usize, row: usize, right: f64, down: f64) -> DVec3 {
    let phi = 2.0 * PI * (column as f64 + right) / (2 * ROWS) as f64;
    let theta = PI * (row as f64 + down) / ROWS as f64;
    let (sin_phi, cos_phi) = libm::sincos(phi);
    let (sin_theta, cos_theta) = libm::sincos(theta);
    DVec3::new(sin_phi * sin_theta, cos_theta, -cos_phi * sin_theta)
}

/// The solid angle of a texel of this row, in steradians.
pub(crate) fn texel_solid_angle(row: usize) -> f64 {
    let edge = |row: usize| libm::cos(PI * row as f64 / ROWS as f64);
    PI / ROWS as f64 * (edge(row) - edge(row + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> [(TriangleMesh, f64, f64); 5] {
        [
            (rectangle(), 4.0, 1e-12),
            (cube(), 24.0, 1e-12),
            (disk(), PI, 1e-6),
            (cylinder(DVec3::ZERO, DVec3::Y * 2.0, 0.5), 2.0 * PI, 0.01),
            (sphere(DVec3::X, 1.0), 4.0 * PI, 0.05),
        ]
    }

    #[test]
    fn areas() {
        for (mesh, area, within) in all() {
            assert!((mesh.area() - area).abs() < within, "{} {area}", mesh.area());
        }
    }

    #[test]
    fn winding_agrees_with_normals() {
        for (mesh, ..) in all() {
            let normals = mesh.normals.as_ref().unwrap();
            for (index, triangle) in mesh.triangles.iter().enumerate() {
                let [a, b, c] = mesh.corners(index);
                let front = (b - a).cross(c - a).normalize();
                assert!(triangle.iter().all(|&v| front.dot(normals[v as usize]) > 0.9));
            }
        }
    }

    /// The texture coordinates of Mitsuba 3.9.1's `cube` at corners of each face; two corners and the winding determine
    /// those of the others.
    #[test]
    fn cube_uv() {
        let mesh = cube();
        let (normals, uvs) = (mesh.normals.unwrap(), mesh.uvs.unwrap());
        for (normal, position, uv) in [
            (Vec3::NEG_Y, [1.0, -1.0, -1.0], [0.0, 1.0]),
            (Vec3::NEG_Y, [-1.0, -1.0, 1.0], [1.0, 0.0]),
            (Vec3::NEG_Y, [1.0, -1.0, 1.0], [1.0, 1.0]),
            (Vec3::Y, [1.0, 1.0, -1.0], [0.0, 1.0]),
            (Vec3::Y, [1.0, 1.0, 1.0], [0.0, 0.0]),
            (Vec3::X, [1.0, -1.0, -1.0], [0.0, 1.0]),
            (Vec3::X, [1.0, 1.0, 1.0], [1.0, 0.0]),
            (Vec3::Z, [1.0, -1.0, 1.0], [0.0, 1.0]),
            (Vec3::Z, [-1.0, 1.0, 1.0], [1.0, 0.0]),
            (Vec3::NEG_X, [-1.0, -1.0, 1.0], [0.0, 1.0]),
            (Vec3::NEG_X, [-1.0, 1.0, -1.0], [1.0, 0.0]),
            (Vec3::NEG_Z, [1.0, 1.0, -1.0], [0.0, 1.0]),
            (Vec3::NEG_Z, [-1.0, -1.0, -1.0], [1.0, 0.0]),
        ] {
            let is_it = |at: &usize| mesh.positions[*at] == Vec3::from(position) && normals[*at] == normal;
            let at = (0..uvs.len()).find(is_it).unwrap();
            assert_eq!(uvs[at], Vec2::new(uv[0], 1.0 - uv[1]), "{normal} {position:?}");
        }
    }

    /// In Mitsuba 3.9.1 the rectangle's point (0.5, -0.5) has uv (0.75, 0.25). Here v is one minus that.
    #[test]
    fn rectangle_uv() {
        let mesh = rectangle();
        assert_eq!(mesh.uvs.unwrap()[0], Vec2::new(0.0, 1.0));
    }
}
