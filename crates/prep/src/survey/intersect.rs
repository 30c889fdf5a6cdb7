//! Measures how far pieces of furniture stand in each other, by their meshes and not by their bounding boxes.
//!
//! The depth of a pair is the shortest way that one piece must be moved for the two to be apart, over eight horizontal
//! directions, up and down. Points on each surface are moved along the direction, and the stretches of their ways that the
//! other piece encloses (`solid`) are where the pieces intersect. The share is the part of the smaller piece's volume that
//! lies in the other. A chair pushed under a table shares no place with it; a back that the tabletop's edge cuts into is
//! apart after a few centimetres; a chair that stands in a wardrobe, hollow or not, only after a step.

use glam::Vec3;
use mateval_scene::TriangleMesh;
use mateval_tracer::TracerError;
use rayon::prelude::*;

use super::solid::Solid;

/// The largest depth that is measured, in metres.
pub const MOST_DEPTH_M: f64 = 0.5;

/// The least depth of a pair that is listed, in metres. Shelves side by side and lamps on tables sink in a little less.
pub const LEAST_DEPTH_M: f64 = 0.005;

/// How far two pieces must be movable without touching to be apart, in metres. Points on surfaces are about as dense.
const FREE_M: f32 = 0.03;

/// The directions in which pieces are moved apart.
const DIRECTIONS: [Vec3; 10] = [
    Vec3::X,
    Vec3::NEG_X,
    Vec3::Z,
    Vec3::NEG_Z,
    Vec3::new(HALF, 0.0, HALF),
    Vec3::new(-HALF, 0.0, HALF),
    Vec3::new(HALF, 0.0, -HALF),
    Vec3::new(-HALF, 0.0, -HALF),
    Vec3::Y,
    Vec3::NEG_Y,
];
const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Two meshes that intersect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshIntersection {
    /// Their indices, the lower one first.
    pub pair: [usize; 2],
    /// The shortest way that separates them, in metres, at most [`MOST_DEPTH_M`].
    pub depth_m: f64,
    /// The part of the smaller one's volume that lies in the other, 0 to 1; of its surface, where it encloses nothing.
    pub volume_share: f64,
}

/// The pairs of meshes that intersect by at least [`LEAST_DEPTH_M`], sorted.
pub fn intersections(meshes: &[&TriangleMesh]) -> Result<Vec<MeshIntersection>, TracerError> {
    let solids: Vec<Solid<'_>> = meshes.par_iter().map(|mesh| Solid::new(mesh)).collect::<Result<_, TracerError>>()?;
    let pairs: Vec<[usize; 2]> = (0..solids.len()).flat_map(|a| (a + 1..solids.len()).map(move |b| [a, b])).collect();
    let measured = |&pair: &[usize; 2]| {
        let [a, b] = pair.map(|at| &solids[at]);
        let depth_m = rounded(depth(a, b)?);
        (depth_m >= LEAST_DEPTH_M).then(|| MeshIntersection { pair, depth_m, volume_share: rounded(share(a, b)) })
    };
    Ok(pairs.par_iter().filter_map(measured).collect())
}

/// To a tenth of a millimetre or of a thousandth: more is noise.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// The shortest way that separates the pieces, in metres; none where they do not intersect.
fn depth(a: &Solid<'_>, b: &Solid<'_>) -> Option<f64> {
    if !boxes_overlap(a, b) || !(lies_partly_in(a, b) || lies_partly_in(b, a)) {
        return None;
    }
    let ways = DIRECTIONS.par_iter().map(|direction| way_out(a, b, *direction)).collect::<Vec<f32>>();
    ways.into_iter().reduce(f32::min).map(f64::from)
}

fn boxes_overlap(a: &Solid<'_>, b: &Solid<'_>) -> bool {
    let ([low_a, high_a], [low_b, high_b]) = (a.bounds(), b.bounds());
    low_a.cmplt(high_b).all() && low_b.cmplt(high_a).all()
}

fn lies_partly_in(one: &Solid<'_>, other: &Solid<'_>) -> bool {
    one.on_surface().iter().any(|place| other.encloses(*place))
}

/// How far `a` must be moved in a direction so that it does not touch `b`, and could be moved on a little.
fn way_out(a: &Solid<'_>, b: &Solid<'_>, direction: Vec3) -> f32 {
    let reach = MOST_DEPTH_M as f32;
    let of_a = a.on_surface().iter().flat_map(|place| b.enclosed_along(*place, direction, reach));
    // To move the one is to move the other the opposite way.
    let of_b = b.on_surface().iter().flat_map(|place| a.enclosed_along(*place, -direction, reach));
    let mut stretches: Vec<[f32; 2]> = of_a.chain(of_b).collect();
    stretches.sort_by(|one, other| one[0].total_cmp(&other[0]));
    let mut way = 0.0_f32;
    for [begin, end] in stretches {
        // The first gap counts only if the pieces touch at all without being moved.
        let free = if way == 0.0 { 0.0 } else { FREE_M };
        if begin > way + free {
            break;
        }
        way = way.max(end);
    }
    way
}

/// The part of the smaller piece that lies in the other.
fn share(a: &Solid<'_>, b: &Solid<'_>) -> f64 {
    let (small, large) = if b.volume_m3() < a.volume_m3() { (b, a) } else { (a, b) };
    let points = match small.enclosed_points() {
        [] => small.on_surface(),
        points => points,
    };
    let inside = points.iter().filter(|place| large.encloses(**place)).count();
    inside as f64 / points.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::super::shapes::{ball, block, chair, moved, table, wardrobe_of_boards};
    use super::*;

    /// Depth and share of the two; none where they do not intersect.
    fn of(a: &TriangleMesh, b: &TriangleMesh) -> Option<[f64; 2]> {
        let found = intersections(&[a, b]).unwrap();
        assert!(found.len() <= 1 && found.iter().all(|found| found.pair == [0, 1]));
        // The order does not matter.
        let swapped = intersections(&[b, a]).unwrap();
        assert_eq!(found.first().map(|found| found.depth_m), swapped.first().map(|found| found.depth_m));
        found.first().map(|found| [found.depth_m, found.volume_share])
    }

    #[track_caller]
    fn assert_near(found: Option<[f64; 2]>, [depth, share]: [f64; 2], within: [f64; 2]) {
        let [found_depth, found_share] = found.expect("they intersect");
        assert!((found_depth - depth).abs() <= within[0], "depth {found_depth}, expected {depth}");
        assert!((found_share - share).abs() <= within[1], "share {found_share}, expected {share}");
    }

    #[test]
    fn blocks_that_overlap_touch_and_are_apart() {
        let at = |x: f32, y: f32, z: f32| {
            of(&block(Vec3::ZERO, Vec3::ONE), &block(Vec3::new(x, y, z), Vec3::new(1.0, 1.0, 1.5)))
        };
        assert_near(at(0.9, 0.3, 0.0), [0.1, 0.1 * 0.7], [1e-3, 0.03]);
        assert_near(at(0.7, 0.0, 0.1), [0.3, 0.3], [1e-3, 0.03]);
        // Deeper than what is measured.
        assert_near(at(0.1, 0.1, 0.1), [0.5, 0.9 * 0.9], [1e-6, 0.05]);
        // By a corner: 20 cm along x or y, less than the way along the diagonal.
        assert_near(at(0.8, 0.8, 0.0), [0.2, 0.04], [1e-3, 0.03]);
        assert_eq!(at(0.998, 0.3, 0.2), None);
        assert_eq!(at(1.0, 0.3, 0.2), None);
        assert_eq!(at(1.5, 0.0, 0.0), None);
    }

    /// Only their boxes overlap; with the back 4 cm inside the top's edge, they are 4 cm from being apart.
    #[test]
    fn chairs_at_tables() {
        let pushed = |z: f32| of(&moved(chair(), Vec3::new(0.1, 0.0, z)), &table());
        assert_eq!(pushed(0.27), None);
        let [depth, share] = pushed(0.22).unwrap();
        assert!((depth - 0.04).abs() < 0.005 && share < 0.02, "{depth} {share}");
        // In the middle of the top: to lower it by 18 cm is the shortest way.
        let [depth, share] = pushed(-0.1).unwrap();
        assert!((depth - 0.18).abs() < 0.005 && share < 0.05, "{depth} {share}");
    }

    #[test]
    fn a_chair_in_a_wardrobe_hollow_or_not() {
        let chair = moved(chair(), Vec3::new(0.0, 0.03, 0.3));
        for wardrobe in [wardrobe_of_boards(), block(Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, 2.0, 0.6))] {
            let [depth, _] = of(&chair, &wardrobe).unwrap();
            assert!((depth - 0.22).abs() < 0.01, "{depth}");
        }
        assert_eq!(of(&moved(chair, Vec3::Z * 0.23), &wardrobe_of_boards()), None);
    }

    /// The bounding boxes of two crossed poles overlap; the poles do not.
    #[test]
    fn overlapping_boxes_are_not_enough() {
        let pole = |size: Vec3, height: f32| {
            let mut mesh = block(Vec3::Y * height, size);
            for p in &mut mesh.positions {
                *p = glam::Quat::from_rotation_x(0.5) * *p;
            }
            mesh
        };
        let (thin, long) = (Vec3::new(0.05, 0.05, 2.0), Vec3::new(2.0, 0.05, 0.05));
        assert_eq!(of(&pole(thin, 0.0), &pole(long, 0.2)), None);
        assert!(of(&pole(thin, 0.0), &pole(long, 0.0)).unwrap()[0] > 0.04);
    }

    /// The share of two balls of radius 1 whose middles are 1 apart: 5/16 (Weisstein, "Sphere-Sphere Intersection").
    #[test]
    fn fine_meshes_intersect() {
        let pair = |apart: f32| of(&ball(Vec3::ZERO, 0.3), &ball(Vec3::X * apart, 0.3));
        assert_near(pair(0.3), [0.3, 5.0 / 16.0], [0.005, 0.03]);
        assert!(pair(0.58).unwrap()[0] < 0.025);
        assert_eq!(pair(0.7), None);
    }

    /// A cup in an open bowl is not inside the bowl's mesh.
    #[test]
    fn an_open_mesh_encloses_nothing() {
        let mut bowl = ball(Vec3::ZERO, 0.3);
        bowl.triangles.retain(|triangle| triangle.iter().all(|vertex| bowl.positions[*vertex as usize].y < 0.1));
        assert_eq!(of(&bowl, &ball(Vec3::ZERO, 0.05)), None);
        // The twin: the same cup in a closed ball does intersect it.
        assert_near(of(&ball(Vec3::ZERO, 0.3), &ball(Vec3::ZERO, 0.05)), [0.35, 1.0], [0.01, 1e-6]);
    }
}
