//! Whether a mesh's uv are injective, as Mitsuba requires of a textured light: it finds places on the light by their uv.

use glam::DVec2;
use mateval_scene::TriangleMesh;

/// How far triangles may overlap by rounding, in uv.
const SLACK: f64 = 1e-6;

/// Whether every place of the mesh has its own uv within 0..1: triangles lie in the unit square, have area there, and do not
/// overlap. Triangles without area in the world do not count.
pub(super) fn is_unfolded(mesh: &TriangleMesh) -> bool {
    let Some(uvs) = &mesh.uvs else { return false };
    let has_area = |triangle: &usize| {
        let [a, b, c] = mesh.corners(*triangle).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).length_squared() > 0.0
    };
    let uv_of = |triangle: usize| mesh.triangles[triangle].map(|vertex| uvs[vertex as usize].as_dvec2());
    let mut charts: Vec<[DVec2; 3]> = (0..mesh.triangles.len()).filter(has_area).map(uv_of).collect();
    if !charts.iter().all(is_sound) {
        return false;
    }
    charts.sort_by(|a, b| low(a).x.total_cmp(&low(b).x));
    let overlaps = |(index, chart): (usize, &[DVec2; 3])| {
        let end = high(chart).x;
        charts[index + 1..].iter().take_while(|next| low(next).x < end).any(|next| overlap(chart, next))
    };
    !charts.iter().enumerate().any(overlaps)
}

/// Whether the triangle lies in the unit square and has area.
fn is_sound(chart: &[DVec2; 3]) -> bool {
    let inside = low(chart).min_element() >= -SLACK && high(chart).max_element() <= 1.0 + SLACK;
    let [a, b, c] = *chart;
    inside && (b - a).perp_dot(c - a) != 0.0
}

fn low([a, b, c]: &[DVec2; 3]) -> DVec2 {
    a.min(*b).min(*c)
}

fn high([a, b, c]: &[DVec2; 3]) -> DVec2 {
    a.max(*b).max(*c)
}

/// Whether the triangles overlap: no line along one of their six edges separates them.
fn overlap(one: &[DVec2; 3], other: &[DVec2; 3]) -> bool {
    let apart = |edge: DVec2| {
        let along = |triangle: &[DVec2; 3]| triangle.map(|corner| corner.dot(edge.perp()));
        let (a, b) = (along(one), along(other));
        let (low, high) = (|v: [f64; 3]| v[0].min(v[1]).min(v[2]), |v: [f64; 3]| v[0].max(v[1]).max(v[2]));
        high(a) <= low(b) + SLACK * edge.length() || high(b) <= low(a) + SLACK * edge.length()
    };
    let edges = |[a, b, c]: &[DVec2; 3]| [*b - *a, *c - *b, *a - *c];
    !edges(one).into_iter().chain(edges(other)).any(apart)
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};

    use super::*;

    /// Two triangles that form a square. `uv` maps a corner's position in the square to its uv.
    fn square(uv: impl Fn(Vec2) -> Vec2) -> TriangleMesh {
        let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        TriangleMesh {
            positions: corners.map(|corner| corner.extend(0.0)).into(),
            normals: None,
            uvs: Some(corners.map(uv).into()),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    #[test]
    fn a_square_unfolds_unless_it_overlaps_or_leaves() {
        assert!(is_unfolded(&square(|uv| uv)));
        assert!(is_unfolded(&square(|uv| Vec2::new(0.3 * uv.x + 0.1 * uv.y, 1.0 - 0.7 * uv.y))));
        assert!(!is_unfolded(&square(|uv| 1.1 * uv)));
        assert!(!is_unfolded(&square(|uv| uv - 0.5)));
        assert!(!is_unfolded(&square(|uv| Vec2::splat(uv.x))));
        // Folded along the diagonal.
        assert!(!is_unfolded(&square(|uv| if uv == Vec2::Y { Vec2::X } else { uv })));
        assert!(!is_unfolded(&TriangleMesh { uvs: None, ..square(|uv| uv) }));
    }

    /// A grid of many triangles is unfolded. So it is with a triangle without area, but not with one on top of another.
    #[test]
    fn one_overlap_among_many_is_found() {
        let n = 20_u32;
        let corner = |k: u32| Vec2::new((k % (n + 1)) as f32 / n as f32, (k / (n + 1)) as f32 / n as f32);
        let uvs: Vec<Vec2> = (0..(n + 1) * (n + 1)).map(corner).collect();
        let cells = (0..n * n).map(|k| k % n + (n + 1) * (k / n));
        let mut grid = TriangleMesh {
            positions: uvs.iter().map(|uv| Vec3::new(uv.x, 0.0, uv.y)).collect(),
            normals: None,
            uvs: Some(uvs),
            triangles: cells.flat_map(|k| [[k, k + 1, k + n + 2], [k, k + n + 2, k + n + 1]]).collect(),
        };
        assert!(is_unfolded(&grid));
        grid.triangles.push([7, 7, 200]);
        assert!(is_unfolded(&grid));
        grid.triangles.push([150, 152, 172]);
        assert!(!is_unfolded(&grid));
    }
}
