//! Finds furniture that passes through architecture.

use glam::Vec3;
use mateval_scene::TriangleMesh;
use mateval_tracer::{Accel, Ray, TracerError};

/// Edges are shortened by this share at both ends, so that a piece that touches a wall does not cross it.
const SPARED: f32 = 0.01;

/// For each mesh of `pieces`, whether an edge of a triangle passes through one of `walls`.
pub(super) fn crossing(pieces: &[&TriangleMesh], walls: &[&TriangleMesh]) -> Result<Vec<bool>, TracerError> {
    if walls.is_empty() {
        return Ok(vec![false; pieces.len()]);
    }
    let walls = Accel::build(walls)?;
    let passes = |from: Vec3, to: Vec3| {
        let way = to - from;
        let direction = way.try_normalize();
        direction.is_some_and(|direction| {
            let reach = way.length() * (1.0 - 2.0 * SPARED);
            walls.occluded(&Ray::new(from + way * SPARED, direction, reach))
        })
    };
    let crosses = |mesh: &&TriangleMesh| {
        (0..mesh.triangles.len()).any(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            passes(a, b) || passes(b, c) || passes(c, a)
        })
    };
    Ok(pieces.iter().map(crosses).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square_at(x: f32, side: f32) -> TriangleMesh {
        let corner = |y: f32, z: f32| Vec3::new(x, y * side, z * side);
        TriangleMesh {
            positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Default::default()
        }
    }

    #[test]
    fn a_piece_in_the_wall_crosses_it_and_one_that_touches_it_does_not() {
        let wall = square_at(0.0, 2.0);
        let tip = |x: f32| TriangleMesh {
            positions: vec![Vec3::new(x, 0.1, 0.0), Vec3::new(x + 0.5, 0.2, 0.1), Vec3::new(x + 0.5, 0.1, 0.3)],
            triangles: vec![[0, 1, 2]],
            ..Default::default()
        };
        let [through, touching, apart] = [tip(-0.25), tip(0.0), tip(0.1)];
        assert_eq!(crossing(&[&through, &touching, &apart], &[&wall]).unwrap(), [true, false, false]);
        assert_eq!(crossing(&[&through], &[]).unwrap(), [false]);
    }
}
