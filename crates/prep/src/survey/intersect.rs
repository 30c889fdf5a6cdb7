//! Finds furniture that stands in other furniture, by the meshes and not by their bounding boxes.
//!
//! Two pieces intersect where an edge of one passes through a face of the other and extends further than a tolerance on
//! both sides of it, or where a vertex of one lies inside the other, further than the tolerance from its surface (the edges
//! of fine meshes are short). A lamp that sinks a millimetre into its table therefore does not intersect it, and neither do
//! two shelves side by side.

use std::cell::Cell;

use glam::Vec3;
use mateval_scene::TriangleMesh;
use mateval_tracer::{Accel, Ray, TracerError};
use rayon::prelude::*;

/// How far a piece must reach into another to intersect it, in metres.
pub const TOLERANCE_M: f32 = 0.02;

/// A piece with its acceleration structure.
struct Piece<'a> {
    mesh: &'a TriangleMesh,
    accel: Accel,
}

/// The pairs of meshes that intersect: their indices in `meshes`, the lower one first; sorted.
pub fn intersecting_pairs(meshes: &[&TriangleMesh]) -> Result<Vec<[usize; 2]>, TracerError> {
    let pieces: Vec<Piece<'_>> = meshes
        .par_iter()
        .map(|mesh| Ok(Piece { mesh, accel: Accel::build(&[mesh])? }))
        .collect::<Result<_, TracerError>>()?;
    let with_later = |a: usize| {
        let (one, pieces) = (&pieces[a], &pieces);
        (a + 1..pieces.len()).filter(move |b| intersect(one, &pieces[*b])).map(move |b| [a, b])
    };
    Ok((0..pieces.len()).into_par_iter().flat_map_iter(with_later).collect())
}

fn intersect(a: &Piece<'_>, b: &Piece<'_>) -> bool {
    boxes_overlap(a, b) && (reaches_into(a, b) || reaches_into(b, a))
}

fn boxes_overlap(a: &Piece<'_>, b: &Piece<'_>) -> bool {
    let ([low_a, high_a], [low_b, high_b]) = (a.accel.bounds(), b.accel.bounds());
    (low_a + TOLERANCE_M).cmplt(high_b).all() && (low_b + TOLERANCE_M).cmplt(high_a).all()
}

/// Whether an edge of `one` passes through a face of `other`, or a vertex of `one` lies inside `other`.
fn reaches_into(one: &Piece<'_>, other: &Piece<'_>) -> bool {
    let [low, high] = other.accel.bounds();
    let near = |from: Vec3, to: Vec3| from.min(to).cmple(high).all() && from.max(to).cmpge(low).all();
    let through = (0..one.mesh.triangles.len()).any(|triangle| {
        let [a, b, c] = one.mesh.corners(triangle);
        // Each edge is traced both ways, since the first face hit may be one that the edge only touches.
        [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)]
            .into_iter()
            .any(|(from, to)| near(from, to) && edge_goes_through(from, to, other))
    });
    through || one.mesh.positions.iter().any(|corner| near(*corner, *corner) && lies_within(*corner, other))
}

fn edge_goes_through(from: Vec3, to: Vec3, other: &Piece<'_>) -> bool {
    let Some(direction) = (to - from).try_normalize() else { return false };
    let Some(hit) = other.accel.closest(&Ray::new(from, direction, (to - from).length())) else { return false };
    let [a, b, c] = other.mesh.corners(hit.triangle.0);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    (from - a).dot(normal).abs().min((to - a).dot(normal).abs()) > TOLERANCE_M
}

/// Whether a place is enclosed and further than the tolerance from the surface: rays both ways along three axes, which are
/// oblique so that they follow no edge, each hit an odd number of faces. An open mesh encloses nothing.
fn lies_within(place: Vec3, other: &Piece<'_>) -> bool {
    const AXES: [Vec3; 3] = [Vec3::new(0.93, 0.29, 0.21), Vec3::new(-0.27, 0.91, 0.31), Vec3::new(0.19, -0.33, 0.92)];
    AXES.into_iter().flat_map(|axis| [axis, -axis]).all(|direction| {
        let (count, nearest) = (Cell::new(0_u32), Cell::new(f32::INFINITY));
        let ray = Ray::endless(place, direction.normalize());
        // Every hit is rejected, so that the ray visits all of them.
        other.accel.closest_where(&ray, |hit| {
            count.set(count.get() + 1);
            nearest.set(nearest.get().min(hit.distance));
            false
        });
        count.get() % 2 == 1 && nearest.get() > TOLERANCE_M
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(middle: Vec3, size: f32) -> TriangleMesh {
        let corner = |k: u32| middle + (Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32) - 0.5) * size;
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        TriangleMesh {
            positions: (0..8).map(corner).collect(),
            triangles: faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).collect(),
            ..Default::default()
        }
    }

    fn intersect(offset: Vec3) -> bool {
        let (a, b) = (cube(Vec3::ZERO, 1.0), cube(offset, 1.0));
        let pairs = intersecting_pairs(&[&a, &b]).unwrap();
        assert!(pairs.is_empty() || pairs == [[0, 1]]);
        !pairs.is_empty()
    }

    #[test]
    fn cubes_that_overlap_touch_and_are_apart() {
        assert!(intersect(Vec3::new(0.5, 0.5, 0.5)));
        assert!(intersect(Vec3::new(0.9, 0.3, -0.2)));
        // Touching, overlapping by a centimetre, apart.
        assert!(!intersect(Vec3::new(1.0, 0.3, 0.2)));
        assert!(!intersect(Vec3::new(0.99, 0.3, 0.2)));
        assert!(!intersect(Vec3::new(1.5, 0.0, 0.0)));
    }

    /// The bounding boxes of two crossed poles overlap; the poles do not.
    #[test]
    fn overlapping_boxes_are_not_enough() {
        let pole = |turned: bool, height: f32| {
            let mut mesh = cube(Vec3::ZERO, 1.0);
            for p in &mut mesh.positions {
                *p *= Vec3::new(0.05, 0.05, 2.0);
                if turned {
                    *p = Vec3::new(p.z, p.y, -p.x);
                }
                p.y += height;
                *p = glam::Quat::from_rotation_x(0.5) * *p;
            }
            mesh
        };
        let (a, b, c) = (pole(false, 0.0), pole(true, 0.2), pole(true, 0.0));
        assert_eq!(intersecting_pairs(&[&a, &b]).unwrap(), Vec::<[usize; 2]>::new());
        assert_eq!(intersecting_pairs(&[&a, &c]).unwrap(), [[0, 1]]);
    }

    /// A sphere of triangles whose edges are about two centimetres long.
    fn ball(middle: Vec3, radius: f32) -> TriangleMesh {
        const SIDES: u32 = 96;
        let mut mesh = TriangleMesh::default();
        for ring in 0..=SIDES / 2 {
            for side in 0..SIDES {
                let (up, around) = (f64::from(ring) / f64::from(SIDES / 2), f64::from(side) / f64::from(SIDES));
                let ((sin, cos), (s, c)) =
                    (libm::sincos(up * std::f64::consts::PI), libm::sincos(around * std::f64::consts::TAU));
                let out = glam::DVec3::new(sin * c, cos, sin * s).as_vec3();
                mesh.positions.push(middle + out * radius);
                if ring > 0 {
                    let [here, next] = [side, (side + 1) % SIDES].map(|side| ring * SIDES + side);
                    mesh.triangles.extend([[here, next, here - SIDES], [next, next - SIDES, here - SIDES]]);
                }
            }
        }
        mesh
    }

    /// None of their edges is long enough to show the intersection.
    #[test]
    fn fine_meshes_intersect_by_their_vertices() {
        let pairs = |apart: f32| intersecting_pairs(&[&ball(Vec3::ZERO, 0.3), &ball(Vec3::X * apart, 0.3)]).unwrap();
        assert_eq!(pairs(0.3), [[0, 1]]);
        assert_eq!(pairs(0.5), [[0, 1]]);
        // Overlapping by a centimetre, and apart.
        assert!(pairs(0.59).is_empty());
        assert!(pairs(0.7).is_empty());
    }

    /// A cup in an open bowl is not inside the bowl's mesh.
    #[test]
    fn an_open_mesh_encloses_nothing() {
        let mut bowl = ball(Vec3::ZERO, 0.3);
        bowl.triangles.retain(|triangle| triangle.iter().all(|vertex| bowl.positions[*vertex as usize].y < 0.1));
        assert!(intersecting_pairs(&[&bowl, &ball(Vec3::ZERO, 0.05)]).unwrap().is_empty());
        // The twin: the same cup in a closed ball does intersect it.
        assert_eq!(intersecting_pairs(&[&ball(Vec3::ZERO, 0.3), &ball(Vec3::ZERO, 0.05)]).unwrap(), [[0, 1]]);
    }
}
