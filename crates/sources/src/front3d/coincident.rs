//! Separates sheets of architecture that coincide.
//!
//! Houses place a feature wall, a door's pocket or a second ceiling exactly in the plane of the wall or ceiling behind it.
//! A ray meets either of two such sheets, and each shadows the other. The result depends on the renderer (Blender loses
//! up to half of the light that leaves them), so it cannot serve as ground truth.

use std::collections::BTreeMap;

use glam::DVec3;
use mateval_scene::TriangleMesh;
use mateval_scene::reference::Surface;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

use super::furnished_house::PlacedSurface;
use crate::log::Log;

/// Sheets no further apart coincide: a few steps of a 32-bit coordinate at 20 m.
const COINCIDENT_M: f64 = 1e-5;
/// The distance by which a sheet is moved: a hundred steps of a coordinate, a fiftieth of a pixel.
const LAYER_M: f64 = 1e-4;
/// Triangles that overlap by no more than this only touch.
const TOUCHING_M: f64 = 1e-4;
/// Triangles with a smaller area, in m^2, are ignored.
const SMALLEST_AREA: f64 = 1e-8;
/// No sheet is moved further than this many times [`LAYER_M`].
const MOST_LAYERS: usize = 8;
/// The most pairs of triangles that are compared. A real house has less than a hundredth as many.
const MOST_PAIRS: usize = 50_000_000;

/// Moves every sheet of architecture that coincides with a larger one slightly to the side that it faces.
///
/// A sheet is the set of triangles of one source mesh that lie in one plane and face one way. Of two that overlap, the
/// smaller is moved, since a decoration is smaller than its wall; of two of equal area, the later.
pub(super) fn separate(surfaces: &mut [Surface], placed: &[PlacedSurface], log: &mut Log) {
    // Which sheets overlap.
    let faces = faces(surfaces, placed);
    let Some(pairs) = overlapping_pairs(&faces) else {
        let message = format!("more than {MOST_PAIRS} pairs of triangles of the architecture are near each other");
        return log.warn("coincident_sheets", "/mesh", message, "did not move sheets that coincide with others");
    };
    let sheets = Sheets::new(&faces, &pairs);
    let layers = sheets.layers();
    let moved: Vec<usize> = (0..layers.len()).filter(|&sheet| layers[sheet] > 0).collect();
    if moved.is_empty() {
        return;
    }
    // How far each triangle moves.
    let mut shifts: BTreeMap<usize, BTreeMap<usize, DVec3>> = BTreeMap::new();
    for (face, &sheet) in faces.iter().zip(&sheets.of_face) {
        if layers[sheet] > 0 {
            let shift = sheets.all[sheet].normal * (layers[sheet] as f64 * LAYER_M);
            shifts.entry(face.surface).or_default().insert(face.triangle, shift);
        }
    }
    for (surface, shift_of) in shifts {
        shift(&mut surfaces[surface].mesh, &shift_of);
    }
    let area: f64 = moved.iter().map(|&sheet| sheets.all[sheet].area).sum();
    let message = format!("{} sheets with a total area of {area:.2} m2 coincide with larger ones", moved.len());
    log.note("coincident_sheets", "/mesh", message, "moved each by 0.1 mm, or more in a stack, to the side it faces");
}

/// A triangle of architecture, in world space.
struct Face {
    surface: usize,
    triangle: usize,
    part: usize,
    corners: [DVec3; 3],
    normal: DVec3,
    area: f64,
}

impl Face {
    fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0]).abs()
    }

    fn bounds(&self, margin: f64) -> AABB<[f64; 3]> {
        let [a, b, c] = self.corners;
        let (low, high) = (a.min(b).min(c) - margin, a.max(b).max(c) + margin);
        AABB::from_corners(low.to_array(), high.to_array())
    }

    /// Whether the two triangles lie in one plane and overlap.
    fn coincides_with(&self, other: &Self) -> bool {
        let (large, small) = if self.area >= other.area { (self, other) } else { (other, self) };
        small.corners.iter().all(|&corner| large.distance(corner) <= COINCIDENT_M) && overlap(large, small)
    }
}

fn faces(surfaces: &[Surface], placed: &[PlacedSurface]) -> Vec<Face> {
    let of_architecture =
        surfaces.iter().zip(placed).enumerate().filter(|(_, (_, placed))| placed.origin.role.is_architecture());
    let faces = of_architecture.flat_map(|(number, (surface, placed))| {
        (0..surface.mesh.triangles.len()).map(move |triangle| {
            let corners = surface.mesh.corners(triangle).map(|corner| corner.as_dvec3());
            let across = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let part = placed.origin.part_of_triangle.as_ref().map_or(0, |parts| parts[triangle]);
            let (normal, area) = (across.normalize_or_zero(), across.length() / 2.0);
            Face { surface: number, triangle, part, corners, normal, area }
        })
    });
    faces.filter(|face| face.area >= SMALLEST_AREA).collect()
}

/// Pairs of faces that coincide, the lower index first; none where there are more than [`MOST_PAIRS`] to compare.
fn overlapping_pairs(faces: &[Face]) -> Option<Vec<[usize; 2]>> {
    let boxed = |(number, face): (usize, &Face)| {
        let bounds = face.bounds(0.0);
        GeomWithData::new(Rectangle::from_corners(bounds.lower(), bounds.upper()), number)
    };
    let tree = RTree::bulk_load(faces.iter().enumerate().map(boxed).collect());
    let (mut pairs, mut compared) = (Vec::new(), 0);
    for (number, face) in faces.iter().enumerate() {
        for near in tree.locate_in_envelope_intersecting(&face.bounds(COINCIDENT_M)) {
            compared += 1;
            if compared > MOST_PAIRS {
                return None;
            }
            if number < near.data && face.coincides_with(&faces[near.data]) {
                pairs.push([number, near.data]);
            }
        }
    }
    Some(pairs)
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

/// The triangles of one source mesh that lie in one plane and face one way.
struct Sheet {
    normal: DVec3,
    area: f64,
    overlaps: Vec<usize>,
}

struct Sheets {
    all: Vec<Sheet>,
    of_face: Vec<usize>,
}

impl Sheets {
    fn new(faces: &[Face], pairs: &[[usize; 2]]) -> Self {
        let mut places = BTreeMap::new();
        let mut all: Vec<Sheet> = Vec::new();
        let of_face: Vec<usize> = faces
            .iter()
            .map(|face| {
                // Rounding may split the faces of one plane into two sheets, which is harmless.
                let plane = (face.normal * 1e3).round().as_i64vec3();
                let offset = (face.normal.dot(face.corners[0]) * 1e3).round() as i64;
                let key = (face.surface, face.part, plane.to_array(), offset);
                let sheet = *places.entry(key).or_insert_with(|| {
                    all.push(Sheet { normal: face.normal, area: 0.0, overlaps: Vec::new() });
                    all.len() - 1
                });
                all[sheet].area += face.area;
                sheet
            })
            .collect();
        for [one, other] in pairs {
            let (one, other) = (of_face[*one], of_face[*other]);
            if one != other {
                all[one].overlaps.push(other);
                all[other].overlaps.push(one);
            }
        }
        Self { all, of_face }
    }

    /// The number of steps by which each sheet is moved. From the largest sheet to the smallest, each takes the smallest
    /// number that no sheet it overlaps has taken.
    fn layers(&self) -> Vec<usize> {
        let mut by_area: Vec<usize> =
            (0..self.all.len()).filter(|&sheet| !self.all[sheet].overlaps.is_empty()).collect();
        by_area.sort_by(|&a, &b| self.all[b].area.total_cmp(&self.all[a].area).then(a.cmp(&b)));
        let mut layer: Vec<Option<usize>> = vec![None; self.all.len()];
        for sheet in by_area {
            let taken: Vec<usize> = self.all[sheet].overlaps.iter().filter_map(|&other| layer[other]).collect();
            layer[sheet] = (0..=MOST_LAYERS).find(|step| !taken.contains(step)).or(Some(MOST_LAYERS));
        }
        layer.into_iter().map(|layer| layer.unwrap_or(0)).collect()
    }
}

/// Moves triangles of a mesh, which get vertices of their own.
fn shift(mesh: &mut TriangleMesh, shift_of: &BTreeMap<usize, DVec3>) {
    let mut copies = BTreeMap::new();
    for (&triangle, &shift) in shift_of {
        for corner in 0..3 {
            let vertex = mesh.triangles[triangle][corner];
            let key = (vertex, shift.to_array().map(f64::to_bits));
            mesh.triangles[triangle][corner] = *copies.entry(key).or_insert_with(|| {
                let place = vertex as usize;
                mesh.positions.push((mesh.positions[place].as_dvec3() + shift).as_vec3());
                if let Some(normals) = &mut mesh.normals {
                    normals.push(normals[place]);
                }
                if let Some(uvs) = &mut mesh.uvs {
                    uvs.push(uvs[place]);
                }
                (mesh.positions.len() - 1) as u32
            });
        }
    }
    *mesh = mesh.picked(|_| true);
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use mateval_scene::Role;
    use mateval_scene::reference::MaterialIndex;

    use super::*;
    use crate::source_scene::InstanceOrigin;

    /// A square of `side` in the plane z = 0 from (x, 0), facing +z, or -z.
    fn square(x: f32, side: f32, faces_front: bool) -> TriangleMesh {
        let corner = |u: f32, v: f32| Vec3::new(x + side * u, side * v, 0.0);
        let triangles = if faces_front { vec![[0, 1, 2], [0, 2, 3]] } else { vec![[0, 2, 1], [0, 3, 2]] };
        TriangleMesh {
            positions: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)],
            uvs: Some([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from).into()),
            normals: None,
            triangles,
        }
    }

    fn architecture() -> Role {
        Role::Architecture { kind: "WallInner".to_owned() }
    }

    /// The meshes after [`separate`], and the codes of the findings.
    fn separated(meshes: Vec<TriangleMesh>, role: &Role) -> (Vec<TriangleMesh>, Vec<String>) {
        let placed: Vec<PlacedSurface> = meshes
            .iter()
            .map(|mesh| {
                let part_of_triangle = Some(vec![0; mesh.triangles.len()]);
                let origin = InstanceOrigin { role: role.clone(), part_of_triangle, ..InstanceOrigin::default() };
                PlacedSurface { room: 0, origin, model: None, color: [1.0; 3] }
            })
            .collect();
        let surface = |mesh| Surface { name: String::new(), mesh, material: MaterialIndex(0) };
        let mut surfaces: Vec<Surface> = meshes.into_iter().map(surface).collect();
        let mut log = Log::new("house.json".to_owned(), 10);
        separate(&mut surfaces, &placed, &mut log);
        let codes = log.into_findings().into_iter().map(|finding| finding.code).collect();
        (surfaces.into_iter().map(|surface| surface.mesh).collect(), codes)
    }

    fn heights(mesh: &TriangleMesh) -> (f32, f32) {
        mesh.positions.iter().fold((f32::MAX, f32::MIN), |(low, high), p| (low.min(p.z), high.max(p.z)))
    }

    #[test]
    fn the_smaller_sheet_is_moved() {
        let wall = square(0.0, 3.0, true);
        let (meshes, codes) = separated(vec![square(1.0, 1.0, true), wall.clone()], &architecture());
        assert_eq!(heights(&meshes[0]), (1e-4, 1e-4));
        assert_eq!(meshes[0].uvs, square(1.0, 1.0, true).uvs);
        assert_eq!(meshes[1], wall);
        assert_eq!(codes, ["coincident_sheets"]);
    }

    #[test]
    fn a_sheet_moves_to_the_side_that_it_faces() {
        let (meshes, _) = separated(vec![square(0.0, 3.0, true), square(1.0, 1.0, false)], &architecture());
        assert_eq!(heights(&meshes[1]), (-1e-4, -1e-4));
    }

    #[test]
    fn every_sheet_of_a_stack_has_its_own_layer() {
        let sizes = [2.0, 3.0, 3.0, 1.0];
        let meshes = sizes.map(|side| square(0.0, side, true)).into();
        let (meshes, _) = separated(meshes, &architecture());
        let found: Vec<i32> = meshes.iter().map(|mesh| (heights(mesh).0 * 1e4).round() as i32).collect();
        assert_eq!(found, [2, 0, 1, 3]);
    }

    /// Neighbours in one plane, sheets at a distance, crossing sheets, and furniture stay.
    #[test]
    fn nothing_else_moves() {
        let mut near = square(0.5, 1.0, true);
        near.positions.iter_mut().for_each(|position| position.z = 5e-5);
        let mut across = square(0.0, 1.0, true);
        across.positions.iter_mut().for_each(|p| *p = Vec3::new(p.x, 0.5, p.y));
        let touching = vec![square(0.0, 1.0, true), square(1.0, 1.0, true), near, across];
        assert_eq!(separated(touching.clone(), &architecture()), (touching, vec![]));
        let inside = vec![square(0.0, 3.0, true), square(1.0, 1.0, true)];
        assert_eq!(separated(inside.clone(), &Role::Furniture {}), (inside, vec![]));
    }

    /// Only the faces in the other sheet's plane are moved; the mesh's other faces and vertices stay.
    #[test]
    fn the_rest_of_a_mesh_stays() {
        let mut folded = square(0.0, 1.0, true);
        folded.positions.extend([Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0)]);
        folded.uvs = Some(vec![Vec2::ZERO; 6]);
        folded.triangles.extend([[0, 1, 5], [0, 5, 4]]);
        let (meshes, _) = separated(vec![square(-1.0, 3.0, true), folded.clone()], &architecture());
        for triangle in 0..2 {
            assert!(meshes[1].corners(triangle).iter().all(|corner| corner.z == 1e-4));
        }
        for triangle in 2..4 {
            assert_eq!(meshes[1].corners(triangle), folded.corners(triangle));
        }
    }
}
