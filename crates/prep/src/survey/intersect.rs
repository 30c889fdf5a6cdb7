//! Furniture that stands in other furniture: our own test, on the meshes and not on their boxes.
//!
//! Two pieces intersect where an edge of one goes through a face of the other and reaches further than a tolerance to both
//! sides of it: so a lamp that sinks a millimetre into its table, or two shelves side by side, do not.

use glam::Vec3;
use mateval_scene::TriangleMesh;
use mateval_tracer::{Accel, Ray, TracerError};
use rayon::prelude::*;

/// How far an edge must reach to both sides of a face, in metres.
pub const TOLERANCE_M: f32 = 0.02;

/// A piece made ready.
struct Piece<'a> {
    mesh: &'a TriangleMesh,
    accel: Accel,
}

/// The pairs of meshes that intersect, by their places in the list, the lower one first; sorted.
pub fn intersecting_pairs(meshes: &[&TriangleMesh]) -> Result<Vec<[usize; 2]>, TracerError> {
    let pieces: Vec<Piece<'_>> = meshes
        .par_iter()
        .map(|mesh| Ok(Piece { mesh, accel: Accel::build(&[mesh])? }))
        .collect::<Result<_, TracerError>>()?;
    let pairs: Vec<[usize; 2]> = (0..pieces.len()).flat_map(|a| (a + 1..meshes.len()).map(move |b| [a, b])).collect();
    let intersect = |[a, b]: &[usize; 2]| {
        let (a, b) = (&pieces[*a], &pieces[*b]);
        boxes_overlap(a, b) && (goes_through(a, b) || goes_through(b, a))
    };
    Ok(pairs.into_par_iter().filter(intersect).collect())
}

fn boxes_overlap(a: &Piece<'_>, b: &Piece<'_>) -> bool {
    let ([low_a, high_a], [low_b, high_b]) = (a.accel.bounds(), b.accel.bounds());
    (low_a + TOLERANCE_M).cmplt(high_b).all() && (low_b + TOLERANCE_M).cmplt(high_a).all()
}

/// Whether an edge of `one` goes through a face of `other`.
fn goes_through(one: &Piece<'_>, other: &Piece<'_>) -> bool {
    let [low, high] = other.accel.bounds();
    let near = |from: Vec3, to: Vec3| from.min(to).cmple(high).all() && from.max(to).cmpge(low).all();
    (0..one.mesh.triangles.len()).any(|triangle| {
        let [a, b, c] = one.mesh.corners(triangle);
        // Both ways: the first face met may be one that is only touched.
        [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)]
            .into_iter()
            .any(|(from, to)| near(from, to) && edge_goes_through(from, to, other))
    })
}

fn edge_goes_through(from: Vec3, to: Vec3, other: &Piece<'_>) -> bool {
    let Some(direction) = (to - from).try_normalize() else { return false };
    let Some(hit) = other.accel.closest(&Ray::new(from, direction, (to - from).length())) else { return false };
    let [a, b, c] = other.mesh.corners(hit.triangle.0);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    (from - a).dot(normal).abs().min((to - a).dot(normal).abs()) > TOLERANCE_M
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
    fn boxes_into_each_other_beside_and_touching() {
        assert!(intersect(Vec3::new(0.5, 0.5, 0.5)));
        assert!(intersect(Vec3::new(0.9, 0.3, -0.2)));
        // Touching, sunk by a centimetre, apart.
        assert!(!intersect(Vec3::new(1.0, 0.3, 0.2)));
        assert!(!intersect(Vec3::new(0.99, 0.3, 0.2)));
        assert!(!intersect(Vec3::new(1.5, 0.0, 0.0)));
    }

    /// Boxes around two crossed poles overlap; the poles do not.
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
}
