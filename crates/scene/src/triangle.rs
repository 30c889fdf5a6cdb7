//! The point of a triangle that is nearest to a given point.

use glam::DVec3;

/// The barycentric weights of the triangle's point nearest to `point`; they are not negative and add to one. A triangle
/// without area counts as its edges.
pub fn nearest_weights(corners: [DVec3; 3], point: DVec3) -> DVec3 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared();
    let across = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal);
    let weights = DVec3::new(across(b, c), across(c, a), across(a, b)) / area;
    if area > 0.0 && weights.min_element() >= 0.0 {
        return weights / weights.element_sum();
    }
    nearest_on_edges(corners, point).weights
}

/// The distance from `point` to the nearest point of the triangle.
pub fn distance(corners: [DVec3; 3], point: DVec3) -> f64 {
    let [a, b, c] = corners;
    let weights = nearest_weights(corners, point);
    (a * weights.x + b * weights.y + c * weights.z).distance(point)
}

/// A point on an edge of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgePoint {
    /// Its position.
    pub point: DVec3,
    /// Its barycentric weights; one of them is 0.
    pub weights: DVec3,
}

/// The point of the triangle's edges nearest to `point`: the nearest of the triangle for every point beside it
/// (Ericson, "Real-Time Collision Detection", 2005, section 5.1.5). Of equally near ones that of the earlier edge.
pub fn nearest_on_edges([a, b, c]: [DVec3; 3], point: DVec3) -> EdgePoint {
    let edges = [(a, b, DVec3::X, DVec3::Y), (b, c, DVec3::Y, DVec3::Z), (c, a, DVec3::Z, DVec3::X)];
    let on_edges = edges.map(|(from, to, first, second)| {
        let along = to - from;
        let share = ((point - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        EdgePoint { point: from + along * share, weights: first.lerp(second, share) }
    });
    let apart = |candidate: &EdgePoint| candidate.point.distance_squared(point);
    on_edges.into_iter().min_by(|x, y| apart(x).total_cmp(&apart(y))).expect("a triangle has three edges")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random_point(next: &mut u64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| {
            *next += 1;
            (crate::splitmix64::number(1, *next) >> 40) as f64 / f64::from(1 << 24) * 2.0 - 0.5
        }))
    }

    /// Against a fine net of the triangle's points.
    #[test]
    fn no_point_of_the_triangle_is_nearer() {
        let mut next = 0;
        for _ in 0..50 {
            let corners = std::array::from_fn(|_| random_point(&mut next));
            let point = random_point(&mut next);
            let at = |weights: DVec3| corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
            let weights = nearest_weights(corners, point);
            assert!(weights.min_element() >= 0.0 && (weights.element_sum() - 1.0).abs() < 1e-12);
            let found = at(weights).distance(point);
            assert_eq!(found, distance(corners, point));
            let net = (0..=60).flat_map(|i| (0..=60 - i).map(move |j| (i, j)));
            let best = net.map(|(i, j)| at(DVec3::new(f64::from(i), f64::from(j), f64::from(60 - i - j)) / 60.0));
            let best = best.map(|point_of_net| point_of_net.distance(point)).fold(f64::INFINITY, f64::min);
            assert!(found <= best + 1e-12 && found >= best - 0.05, "{found} {best}");
        }
    }

    #[test]
    fn triangles_without_area_have_a_nearest_point() {
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        let weights = nearest_weights(line, DVec3::new(1.5, 1.0, 0.0));
        assert_eq!(line[1] * weights.y + line[2] * weights.z, DVec3::X * 1.5);
        let dot = nearest_weights([DVec3::ONE; 3], DVec3::ZERO);
        assert!((dot.element_sum() - 1.0).abs() < 1e-12 && dot.is_finite());
    }
}
