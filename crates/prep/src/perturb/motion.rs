//! The displacement of one piece of furniture, as a function of place, by the level of its kind of perturbation.
//!
//! The directions depend on seed and instance alone, so that a higher level moves a piece the same way further.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3, Vec3};
use mateval_dataset::dataset::PerturbationKind;
use mateval_dataset::mesh::bounds;
use mateval_dataset::{InstanceId, SceneId, TriangleMesh, splitmix64};
use mateval_tracer::{Accel, Ray, TracerError};

/// How far a level moves every piece of furniture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Amount {
    /// A distance in the plane of the floor, and an angle about the vertical.
    Pose { distance_m: f64, angle_deg: f64 },
    /// The share by which a piece grows or shrinks.
    Scale { share: f64 },
    /// The largest distance by which a point of the surface moves.
    Shape { most_m: f64 },
}

const POSE: [Amount; 3] = [
    Amount::Pose { distance_m: 0.01, angle_deg: 1.0 },
    Amount::Pose { distance_m: 0.05, angle_deg: 5.0 },
    Amount::Pose { distance_m: 0.1, angle_deg: 5.0 },
];
const SCALE: [Amount; 2] = [Amount::Scale { share: 0.02 }, Amount::Scale { share: 0.05 }];
const SHAPE: [Amount; 3] =
    [Amount::Shape { most_m: 0.005 }, Amount::Shape { most_m: 0.01 }, Amount::Shape { most_m: 0.03 }];

/// The amounts of the levels 1, 2 and so on.
pub(super) fn amounts(kind: PerturbationKind) -> &'static [Amount] {
    match kind {
        PerturbationKind::Pose => &POSE,
        PerturbationKind::Scale => &SCALE,
        PerturbationKind::Shape => &SHAPE,
    }
}

/// The wavelength of the noise that bends surfaces, in metres.
const WAVELENGTH_M: f64 = 0.4;

/// The displacement of one piece.
#[derive(Clone, Debug)]
pub(super) enum Motion {
    /// A rotation about the vertical through `centre`, then a step.
    Rigid { centre: DVec3, turn: DMat3, step: DVec3 },
    /// A scale about `base`, the middle of the lower side of the piece's box.
    Scale { base: DVec3, factor: f64 },
    /// Along each world axis a sine wave in a direction of its own.
    Waves { amplitude: f64, waves: [Wave; 3] },
}

/// `sin(vector . p + phase)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wave {
    vector: DVec3,
    phase: f64,
}

impl Motion {
    /// The displacement of `instance`, whose true mesh is `mesh`.
    pub(super) fn new(
        amount: Amount,
        seed: u64,
        (scene, instance): (&SceneId, &InstanceId),
        mesh: &TriangleMesh,
    ) -> Self {
        let own = splitmix64::seed_of(&format!("{seed}/{scene}/{instance}"));
        let unit = |index| (splitmix64::number(own, index) >> 11) as f64 / (1_u64 << 53) as f64;
        let sign = if unit(0) < 0.5 { -1.0 } else { 1.0 };
        let corners = mesh.triangles.iter().flatten().map(|vertex| mesh.positions[*vertex as usize]);
        let [low, high] = bounds(corners).unwrap_or_default().map(|corner| corner.as_dvec3());
        let middle = (low + high) / 2.0;
        match amount {
            Amount::Pose { distance_m, angle_deg } => {
                let way = TAU * unit(1);
                Self::Rigid {
                    centre: middle,
                    turn: turn_about_y(sign * angle_deg.to_radians()),
                    step: distance_m * DVec3::new(libm::cos(way), 0.0, libm::sin(way)),
                }
            }
            Amount::Scale { share } => {
                Self::Scale { base: DVec3::new(middle.x, low.y, middle.z), factor: 1.0 + sign * share }
            }
            Amount::Shape { most_m } => {
                let wave = |axis: u64| {
                    // Uniform over the sphere.
                    let (height, around) = (2.0 * unit(3 * axis + 1) - 1.0, TAU * unit(3 * axis + 2));
                    let flat = (1.0 - height * height).sqrt();
                    let direction = DVec3::new(flat * libm::cos(around), height, flat * libm::sin(around));
                    Wave { vector: direction * (TAU / WAVELENGTH_M), phase: TAU * unit(3 * axis + 3) }
                };
                // Three waves of this amplitude, at right angles, move no point further than `most_m`.
                Self::Waves { amplitude: most_m / 3.0_f64.sqrt(), waves: [0, 1, 2].map(wave) }
            }
        }
    }

    /// Moves every vertex and turns every normal. Vertices at one place stay together.
    pub(super) fn apply(&self, mesh: &TriangleMesh) -> TriangleMesh {
        let places = || mesh.positions.iter().map(|place| place.as_dvec3());
        let turned = |(normal, place): (&Vec3, DVec3)| {
            // Normals follow the inverse transpose of the derivative.
            let by = self.derivative(place).inverse().transpose();
            (by * normal.as_dvec3()).normalize_or_zero().as_vec3()
        };
        TriangleMesh {
            positions: places().map(|place| self.moved(place).as_vec3()).collect(),
            normals: mesh.normals.as_ref().map(|normals| normals.iter().zip(places()).map(turned).collect()),
            ..mesh.clone()
        }
    }

    fn moved(&self, place: DVec3) -> DVec3 {
        match self {
            Self::Rigid { centre, turn, step } => *centre + *turn * (place - *centre) + *step,
            Self::Scale { base, factor } => *base + (place - *base) * *factor,
            Self::Waves { amplitude, waves } => {
                place + *amplitude * DVec3::from(waves.map(|wave| libm::sin(wave.phase_at(place))))
            }
        }
    }

    /// The derivative of [`Self::moved`]. It is invertible: no wave is steeper than 0.28.
    fn derivative(&self, place: DVec3) -> DMat3 {
        match self {
            Self::Rigid { turn, .. } => *turn,
            Self::Scale { factor, .. } => DMat3::from_diagonal(DVec3::splat(*factor)),
            Self::Waves { amplitude, waves } => {
                // Row i is the gradient of the displacement along axis i.
                let rows = waves.map(|wave| *amplitude * libm::cos(wave.phase_at(place)) * wave.vector);
                DMat3::IDENTITY + DMat3::from_cols(rows[0], rows[1], rows[2]).transpose()
            }
        }
    }
}

impl Wave {
    fn phase_at(self, place: DVec3) -> f64 {
        self.vector.dot(place) + self.phase
    }
}

/// A rotation about +Y. Sine and cosine are libm's, which are the same on every machine.
fn turn_about_y(angle: f64) -> DMat3 {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos))
}

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

    fn triangle() -> TriangleMesh {
        TriangleMesh {
            positions: vec![Vec3::new(1.0, 0.0, 2.0), Vec3::new(1.5, 0.0, 2.0), Vec3::new(1.0, 0.9, 2.3)],
            normals: Some(vec![Vec3::Y; 3]),
            uvs: None,
            triangles: vec![[0, 1, 2]],
        }
    }

    fn motion(amount: Amount, seed: u64, instance: &str) -> Motion {
        let ids = (&SceneId::new("s").unwrap(), &InstanceId::new(instance).unwrap());
        Motion::new(amount, seed, ids, &triangle())
    }

    /// The way in which each vertex moves.
    fn ways(motion: &Motion) -> Vec<DVec3> {
        let mesh = triangle();
        let moved = motion.apply(&mesh);
        moved.positions.iter().zip(&mesh.positions).map(|(to, from)| (*to - *from).as_dvec3()).collect()
    }

    /// No vertex moves further than the level states, and higher levels move each further, by the same seed.
    #[test]
    fn levels_are_distances_that_grow() {
        for &kind in PerturbationKind::ALL {
            assert_eq!(amounts(kind).len() as u32, kind.most_level());
            let mut last = 0.0;
            for amount in amounts(kind) {
                let moved: f64 = ways(&motion(*amount, 7, "chair")).iter().map(|way| way.length()).sum();
                assert!(moved > last, "{kind}: {moved} after {last}");
                last = moved;
                let most = match amount {
                    Amount::Pose { distance_m, angle_deg } => distance_m + 0.5 * angle_deg.to_radians(),
                    Amount::Scale { share } => 1.1 * share,
                    Amount::Shape { most_m } => *most_m,
                };
                assert!(ways(&motion(*amount, 7, "chair")).iter().all(|way| way.length() <= most + 1e-6), "{kind}");
            }
        }
    }

    #[test]
    fn a_pose_stays_on_the_floor_and_keeps_the_shape() {
        let amount = amounts(PerturbationKind::Pose)[2];
        let moved = motion(amount, 1, "chair").apply(&triangle());
        let sides = |mesh: &TriangleMesh| {
            [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (mesh.positions[a] - mesh.positions[b]).length())
        };
        for (a, b) in sides(&moved).into_iter().zip(sides(&triangle())) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        assert!(ways(&motion(amount, 1, "chair")).iter().all(|way| way.y == 0.0));
        assert_eq!(moved.normals, triangle().normals);
    }

    #[test]
    fn seed_and_instance_choose_the_way() {
        let amount = amounts(PerturbationKind::Pose)[1];
        let first = ways(&motion(amount, 1, "chair"));
        assert_eq!(first, ways(&motion(amount, 1, "chair")));
        assert_ne!(first, ways(&motion(amount, 2, "chair")));
        assert_ne!(first, ways(&motion(amount, 1, "chair-2")));
    }

    /// The normal of a bent plane is that of the plane through points nearby.
    #[test]
    fn normals_follow_the_bent_surface() {
        let motion = motion(Amount::Shape { most_m: 0.03 }, 3, "chair");
        let centre = DVec3::new(1.1, 0.2, 2.1);
        let [a, b] =
            [DVec3::X, DVec3::Z].map(|axis| motion.moved(centre + 1e-4 * axis) - motion.moved(centre - 1e-4 * axis));
        let expected = b.cross(a).normalize();
        let mesh =
            TriangleMesh { positions: vec![centre.as_vec3()], normals: Some(vec![Vec3::Y]), ..Default::default() };
        let found = motion.apply(&mesh).normals.unwrap()[0].as_dvec3();
        assert!((found - expected).length() < 1e-4, "{found} {expected}");
        assert!((expected - DVec3::Y).length() > 0.01);
    }

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
