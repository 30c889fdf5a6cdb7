//! The levels of each kind of perturbation. Level 0 changes nothing.

use mateval_scene::perturbation::PerturbationKind;

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

/// The highest level of a kind.
pub fn most_level(kind: PerturbationKind) -> u32 {
    amounts(kind).len() as u32
}
