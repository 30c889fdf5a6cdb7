//! How the surface of a part is laid out flat, in metres: as the unfolded sides of a box.

use glam::DVec3;
use serde::Serialize;

/// The world's vertical axis.
const UP: DVec3 = DVec3::Y;

/// The cosine between a face's normal and the vertical from which on the face is a floor and not a wall.
const LEAST_FLOOR_COSINE: f64 = 0.9;

/// Cosine of the angle up to which triangles have the same direction as a candidate for the main normal: 15 degrees.
const SAME_DIRECTION: f64 = 0.966;

/// How many of the largest triangles are candidates for the main normal.
const CANDIDATES: usize = 64;

/// The side of the box that a triangle is laid out with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Chart {
    /// The side with the main normal.
    Front,
    Back,
    Right,
    Left,
    Top,
    Bottom,
}

/// The frame of a part: `u` to the right, `v` upwards, `w` along the main normal.
///
/// The sides of its box are unfolded around the front, so that a pattern continues across the box's edges. Places on
/// the front depend on the directions of the axes alone, so that patterns continue across parts that share a plane and
/// these directions, as walls do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartFrame {
    axes: [DVec3; 3],
    least: DVec3,
    most: DVec3,
    origin: DVec3,
}

/// A triangle's corners in world space, in metres.
pub type Triangle = [DVec3; 3];

impl PartFrame {
    /// The frame of these triangles, whose front faces `viewer`. `origin` is where both coordinates of a front are 0.
    /// None where no triangle has an area.
    pub fn new(triangles: &[Triangle], viewer: DVec3, origin: DVec3) -> Option<Self> {
        let normal = main_normal(triangles)?;
        let corners = || triangles.iter().flatten().map(|corner| *corner - origin);
        let count = 3.0 * triangles.len() as f64;
        let centre = corners().fold(DVec3::ZERO, |sum, corner| sum + corner) / count + origin;
        let w = if normal.dot(viewer - centre) < 0.0 { -normal } else { normal };
        let v = if w.dot(UP).abs() < LEAST_FLOOR_COSINE {
            (UP - w * w.dot(UP)).normalize_or_zero()
        } else {
            side_of_smallest_rectangle(w, &corners().collect::<Vec<_>>())
        };
        let axes = [v.cross(w), v, w];
        let place = |corner: DVec3| DVec3::from(axes.map(|axis| axis.dot(corner)));
        let least = corners().map(place).fold(DVec3::INFINITY, DVec3::min);
        let most = corners().map(place).fold(DVec3::NEG_INFINITY, DVec3::max);
        Some(Self { axes, least, most, origin })
    }

    /// The side of the box whose normal is nearest.
    pub fn chart(&self, normal: DVec3) -> Chart {
        let [u, v, w] = self.axes.map(|axis| axis.dot(normal));
        // A slight preference for earlier ones decides between equals.
        if w.abs() + 1e-6 >= u.abs() && w.abs() + 1e-6 >= v.abs() {
            if w >= 0.0 { Chart::Front } else { Chart::Back }
        } else if u.abs() + 1e-6 >= v.abs() {
            if u >= 0.0 { Chart::Right } else { Chart::Left }
        } else if v >= 0.0 {
            Chart::Top
        } else {
            Chart::Bottom
        }
    }

    /// Width and height of the box's front, in metres.
    pub fn front_size(&self) -> [f64; 2] {
        [self.most.x - self.least.x, self.most.y - self.least.y]
    }

    /// Where a place lies on the unfolded box, in metres.
    pub fn place(&self, chart: Chart, position: DVec3) -> [f64; 2] {
        let [u, v, w] = self.axes.map(|axis| axis.dot(position - self.origin));
        let (least, most) = (self.least, self.most);
        let behind = most.z - w;
        match chart {
            Chart::Front => [u, v],
            Chart::Back => [most.x + (most.z - least.z) + (most.x - u), v],
            Chart::Right => [most.x + behind, v],
            Chart::Left => [least.x - behind, v],
            Chart::Top => [u, most.y + behind],
            Chart::Bottom => [u, least.y - behind],
        }
    }
}

/// The unit direction that most of the area has or is opposite to.
fn main_normal(triangles: &[Triangle]) -> Option<DVec3> {
    let double_areas: Vec<DVec3> = triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a)).collect();
    let mut largest: Vec<usize> = (0..triangles.len()).collect();
    largest.sort_by(|a, b| double_areas[*b].length_squared().total_cmp(&double_areas[*a].length_squared()));
    largest.truncate(CANDIDATES);
    let members = |normal: DVec3| {
        let along = double_areas.iter().map(move |area| (*area, area.dot(normal)));
        along.filter(|(area, along)| along.abs() >= SAME_DIRECTION * area.length())
    };
    let mut best: Option<(f64, DVec3)> = None;
    for normal in largest.into_iter().filter_map(|at| double_areas[at].try_normalize()) {
        let area: f64 = members(normal).map(|(_, along)| along.abs()).sum();
        if best.is_none_or(|(most, _)| area > most * (1.0 + 1e-9)) {
            best = Some((area, normal));
        }
    }
    let (_, normal) = best?;
    let sum = members(normal).fold(DVec3::ZERO, |sum, (area, along)| sum + area * along.signum());
    sum.try_normalize()
}

/// The direction at right angles to `w`, in whole degrees from the world's depth axis, along which the rectangle around
/// the corners is smallest.
fn side_of_smallest_rectangle(w: DVec3, corners: &[DVec3]) -> DVec3 {
    let depth = (DVec3::NEG_Z - w * w.dot(DVec3::NEG_Z)).normalize_or_zero();
    let side = depth.cross(w);
    let mut best = (f64::INFINITY, depth);
    for degrees in 0..90 {
        let (sin, cos) = libm::sincos(f64::from(degrees).to_radians());
        let v = depth * cos + side * sin;
        let area = extent(v, corners) * extent(v.cross(w), corners);
        if area < best.0 * (1.0 - 1e-6) {
            best = (area, v);
        }
    }
    best.1
}

fn extent(axis: DVec3, corners: &[DVec3]) -> f64 {
    let places = corners.iter().map(|corner| axis.dot(*corner));
    let (least, most) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    (most - least).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both triangles of the parallelogram at `corner` along two edges.
    fn quad(corner: [f64; 3], first: [f64; 3], second: [f64; 3]) -> [Triangle; 2] {
        let [corner, first, second] = [corner, first, second].map(DVec3::from);
        let [b, c, d] = [corner + first, corner + first + second, corner + second];
        [[corner, b, c], [corner, c, d]]
    }

    /// A cupboard of 1 m x 2 m x 0.4 m whose front looks along +Z.
    fn cupboard() -> Vec<Triangle> {
        [
            quad([0.0, 0.0, 0.4], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]),
            quad([0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0]),
            quad([1.0, 0.0, 0.4], [0.0, 0.0, -0.4], [0.0, 2.0, 0.0]),
            quad([0.0, 0.0, 0.0], [0.0, 0.0, 0.4], [0.0, 2.0, 0.0]),
            quad([0.0, 2.0, 0.4], [1.0, 0.0, 0.0], [0.0, 0.0, -0.4]),
        ]
        .concat()
    }

    #[test]
    fn a_box_unfolds_without_gaps() {
        let frame = PartFrame::new(&cupboard(), DVec3::new(0.5, 1.0, 5.0), DVec3::ZERO).unwrap();
        for (normal, chart) in [
            (DVec3::Z, Chart::Front),
            (DVec3::NEG_Z, Chart::Back),
            (DVec3::X, Chart::Right),
            (DVec3::NEG_X, Chart::Left),
            (DVec3::Y, Chart::Top),
            (DVec3::NEG_Y, Chart::Bottom),
        ] {
            assert_eq!(frame.chart(normal), chart);
        }
        let near = |a: [f64; 2], b: [f64; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        let shared = [
            (Chart::Front, Chart::Right, DVec3::new(1.0, 0.7, 0.4)),
            (Chart::Front, Chart::Left, DVec3::new(0.0, 0.7, 0.4)),
            (Chart::Front, Chart::Top, DVec3::new(0.3, 2.0, 0.4)),
            (Chart::Front, Chart::Bottom, DVec3::new(0.3, 0.0, 0.4)),
            (Chart::Right, Chart::Back, DVec3::new(1.0, 1.2, 0.0)),
        ];
        for (a, b, place) in shared {
            assert!(near(frame.place(a, place), frame.place(b, place)), "{a:?} {b:?}");
        }
        // Lengths are kept, and the twin is another place.
        assert!(near(frame.place(Chart::Front, DVec3::new(0.25, 0.5, 0.4)), [0.25, 0.5]));
        assert!(!near(frame.place(Chart::Front, DVec3::new(0.25, 0.6, 0.4)), [0.25, 0.5]));
    }

    /// A floor that lies askew has axes along its sides.
    #[test]
    fn a_floor_lies_along_its_sides() {
        let (sin, cos) = 20_f64.to_radians().sin_cos();
        let floor = quad([1.0, 0.0, 2.0], [4.0 * cos, 0.0, 4.0 * sin], [-3.0 * sin, 0.0, 3.0 * cos]);
        let frame = PartFrame::new(&floor, DVec3::Y, DVec3::ZERO).unwrap();
        let [width, height] = [0, 1].map(|axis| frame.most[axis] - frame.least[axis]);
        assert!((width * height - 12.0).abs() < 0.01, "{width} {height}");
        assert!(frame.axes[2].abs_diff_eq(DVec3::Y, 1e-9), "the front faces the viewer");
        assert_eq!(frame.chart(DVec3::NEG_Y), Chart::Back);
    }

    #[test]
    fn nothing_flat_has_no_frame() {
        assert_eq!(PartFrame::new(&[], DVec3::ZERO, DVec3::ZERO), None);
        assert_eq!(PartFrame::new(&[[DVec3::ONE; 3]; 4], DVec3::ZERO, DVec3::ZERO), None);
    }

    /// Two walls in one plane continue each other.
    #[test]
    fn parts_in_one_plane_share_places() {
        let wall = |x: f64| quad([x, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.5, 0.0]);
        let frame = |x: f64| PartFrame::new(&wall(x), DVec3::new(0.0, 1.0, 4.0), DVec3::new(1.0, 0.0, 1.0)).unwrap();
        let place = DVec3::new(2.0, 1.0, 0.0);
        assert_eq!(frame(0.0).place(Chart::Front, place), frame(2.0).place(Chart::Front, place));
    }
}
