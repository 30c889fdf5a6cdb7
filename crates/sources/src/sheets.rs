//! Flat sheets: the triangles of a mesh that lie in one plane and face one way, and which of them overlap.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use mateval_scene::reference::Surface;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

use crate::source_scene::InstanceOrigin;

/// Triangles that overlap by no more than this, in metres, only touch.
const TOUCHING_M: f64 = 1e-4;
/// Triangles with a smaller area, in m^2, are ignored.
const SMALLEST_AREA: f64 = 1e-8;
/// The most pairs of triangles that are compared. A real house has less than a hundredth as many.
pub(crate) const MOST_PAIRS: usize = 50_000_000;

/// A triangle in world space.
pub(crate) struct Face {
    /// Index of its surface.
    pub(crate) surface: usize,
    /// Index in the surface's mesh.
    pub(crate) triangle: usize,
    part: usize,
    pub(crate) corners: [DVec3; 3],
    pub(crate) normal: DVec3,
    pub(crate) area: f64,
}

impl Face {
    /// The distance of a point from the face's plane; positive on the side that it faces.
    pub(crate) fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }

    fn bounds(&self, margin: f64) -> AABB<[f64; 3]> {
        let [a, b, c] = self.corners;
        let (low, high) = (a.min(b).min(c) - margin, a.max(b).max(c) + margin);
        AABB::from_corners(low.to_array(), high.to_array())
    }

    /// Whether the smaller of two triangles lies within `distance` of the plane of the larger and overlaps it.
    pub(crate) fn lies_in(&self, other: &Self, distance: f64) -> bool {
        let (large, small) = if self.area >= other.area { (self, other) } else { (other, self) };
        small.corners.iter().all(|&corner| large.height(corner).abs() <= distance) && overlap(large, small)
    }
}

/// The faces of all surfaces that `chosen` accepts.
pub(crate) fn faces(
    surfaces: &[Surface],
    origins: &[InstanceOrigin],
    chosen: impl Fn(&InstanceOrigin) -> bool,
) -> Vec<Face> {
    let chosen = surfaces.iter().zip(origins).enumerate().filter(|(_, (_, origin))| chosen(origin));
    let faces = chosen.flat_map(|(number, (surface, origin))| {
        (0..surface.mesh.triangles.len()).map(move |triangle| {
            let corners = surface.mesh.corners(triangle).map(|corner| corner.as_dvec3());
            let across = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let part = origin.part_of_triangle.as_ref().map_or(0, |parts| parts[triangle]);
            let (normal, area) = (across.normalize_or_zero(), across.length() / 2.0);
            Face { surface: number, triangle, part, corners, normal, area }
        })
    });
    faces.filter(|face| face.area >= SMALLEST_AREA).collect()
}

/// For each face of `all` and each face of `among` that lies within `distance` of it, calls `found` with both indices.
/// Returns false where there are more than [`MOST_PAIRS`] to compare.
pub(crate) fn for_each_near(all: &[Face], among: &[Face], distance: f64, mut found: impl FnMut(usize, usize)) -> bool {
    let boxed = |(number, face): (usize, &Face)| {
        let bounds = face.bounds(0.0);
        GeomWithData::new(Rectangle::from_corners(bounds.lower(), bounds.upper()), number)
    };
    let tree = RTree::bulk_load(among.iter().enumerate().map(boxed).collect());
    let mut compared = 0;
    for (number, face) in all.iter().enumerate() {
        for near in tree.locate_in_envelope_intersecting(&face.bounds(distance)) {
            compared += 1;
            if compared > MOST_PAIRS {
                return false;
            }
            if face.lies_in(&among[near.data], distance) {
                found(number, near.data);
            }
        }
    }
    true
}

/// Whether two triangles in one plane overlap by more than [`TOUCHING_M`], by the separating axis theorem: no line along an
/// edge of either separates them.
fn overlap(one: &Face, other: &Face) -> bool {
    let separates = |edge: DVec3| {
        let axis = edge.cross(one.normal).normalize_or_zero();
        let reach = |face: &Face| {
            let along = face.corners.map(|corner| axis.dot(corner - one.corners[0]));
            along.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
        };
        let (a, b) = (reach(one), reach(other));
        a.1.min(b.1) - a.0.max(b.0) <= TOUCHING_M
    };
    ![one, other].iter().any(|face| (0..3).any(|k| separates(face.corners[(k + 1) % 3] - face.corners[k])))
}

/// Numbers the faces, given the sheet of each: faces of a sheet with different numbers become different sheets.
type Split = fn(&[Face], &[usize]) -> Vec<usize>;

/// The triangles of one part of a mesh that lie in one plane and face one way, without overlaps.
pub(crate) struct Sheet {
    pub(crate) normal: DVec3,
    pub(crate) area: f64,
    overlaps: Vec<usize>,
}

/// All sheets, and the sheet of each face.
pub(crate) struct Sheets {
    pub(crate) all: Vec<Sheet>,
    pub(crate) of_face: Vec<usize>,
}

impl Sheets {
    /// The sheets of these faces, of which the `pairs` lie in each other.
    ///
    /// The segments of a moulding may overlap each other, and small meshes share a part. Where faces of one sheet overlap, each
    /// of its connected pieces is a sheet, and where that is not enough, each of the piece's triangles.
    pub(crate) fn new(faces: &[Face], pairs: &[[usize; 2]]) -> Self {
        let mut of_face = numbered(faces.iter().map(plane_key));
        for finer in [connected_pieces as Split, triangles_apart] {
            let folded: BTreeSet<usize> =
                pairs.iter().filter(|[a, b]| of_face[*a] == of_face[*b]).map(|[a, _]| of_face[*a]).collect();
            if folded.is_empty() {
                break;
            }
            let piece = finer(faces, &of_face);
            let keys =
                of_face.iter().zip(&piece).map(|(sheet, piece)| (*sheet, folded.contains(sheet).then_some(*piece)));
            of_face = numbered(keys);
        }
        let mut all: Vec<Sheet> = Vec::new();
        for (face, &sheet) in faces.iter().zip(&of_face) {
            if sheet == all.len() {
                all.push(Sheet { normal: face.normal, area: 0.0, overlaps: Vec::new() });
            }
            all[sheet].area += face.area;
        }
        for [one, other] in pairs {
            let (one, other) = (of_face[*one], of_face[*other]);
            if one != other {
                all[one].overlaps.push(other);
                all[other].overlaps.push(one);
            }
        }
        Self { all, of_face }
    }

    /// A layer for each sheet, at most `most`. From the largest sheet to the smallest, each takes the lowest layer that no
    /// sheet it overlaps has taken.
    pub(crate) fn layers(&self, most: usize) -> Vec<usize> {
        let mut by_area: Vec<usize> =
            (0..self.all.len()).filter(|&sheet| !self.all[sheet].overlaps.is_empty()).collect();
        by_area.sort_by(|&a, &b| self.all[b].area.total_cmp(&self.all[a].area).then(a.cmp(&b)));
        let mut layer: Vec<Option<usize>> = vec![None; self.all.len()];
        for sheet in by_area {
            let taken: Vec<usize> = self.all[sheet].overlaps.iter().filter_map(|&other| layer[other]).collect();
            layer[sheet] = (0..=most).find(|step| !taken.contains(step)).or(Some(most));
        }
        layer.into_iter().map(|layer| layer.unwrap_or(0)).collect()
    }
}

/// Surface, part and plane of a face. Rounding may split the faces of one plane into two sheets, which is harmless.
fn plane_key(face: &Face) -> (usize, usize, [i64; 3], i64) {
    let plane = (face.normal * 1e3).round().as_i64vec3();
    (face.surface, face.part, plane.to_array(), (face.normal.dot(face.corners[0]) * 1e3).round() as i64)
}

/// A number for each key, in the order in which the keys first appear.
fn numbered<K: Ord>(keys: impl Iterator<Item = K>) -> Vec<usize> {
    let mut numbers = BTreeMap::new();
    keys.map(|key| {
        let next = numbers.len();
        *numbers.entry(key).or_insert(next)
    })
    .collect()
}

/// For each face a number that the faces of its sheet have which are connected to it by common corners.
fn connected_pieces(faces: &[Face], of_face: &[usize]) -> Vec<usize> {
    let mut pieces: Vec<usize> = (0..faces.len()).collect();
    let mut first_at = BTreeMap::new();
    for (number, (face, sheet)) in faces.iter().zip(of_face).enumerate() {
        for corner in face.corners {
            let place = (*sheet, corner.to_array().map(|v| (v + 0.0).to_bits()));
            let first = *first_at.entry(place).or_insert(number);
            let (a, b) = (root(&mut pieces, first), root(&mut pieces, number));
            pieces[a.max(b)] = a.min(b);
        }
    }
    (0..faces.len()).map(|face| root(&mut pieces, face)).collect()
}

/// The first face of a piece. Shortens the path to it.
fn root(pieces: &mut [usize], mut face: usize) -> usize {
    while pieces[face] != face {
        pieces[face] = pieces[pieces[face]];
        face = pieces[face];
    }
    face
}

/// A number of its own for each face.
fn triangles_apart(faces: &[Face], _of_face: &[usize]) -> Vec<usize> {
    (0..faces.len()).collect()
}
