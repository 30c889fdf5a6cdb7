//! Separates sheets that coincide: in houses those of architecture, and of furniture that lies in architecture; in
//! other scenes, which do not say what is architecture, all sheets that lie in each other.
//!
//! Houses place a feature wall, a door's pocket or a second ceiling exactly in the plane of the wall or ceiling behind
//! it, and mats, lamps and feet in that of the floor. A ray meets either of two such sheets, and each shadows the
//! other. The result depends on the renderer (Blender loses up to half of the light that leaves them), so it cannot
//! serve as ground truth.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use mateval_dataset::TriangleMesh;
use mateval_dataset::reference::Surface;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

use crate::log::Log;
use crate::source_scene::InstanceOrigin;
use crate::surface_mesh::{connected_parts, find};

/// Sheets of architecture no further apart coincide: a few steps of a 32-bit coordinate at 20 m.
const COINCIDENT_M: f64 = 1e-5;
/// Furniture no further from architecture is meant to touch it: models stand on their origin to within a millimetre or
/// so.
const TOUCHES_M: f64 = 1e-3;
/// The distance by which a sheet is moved: a hundred steps of a coordinate, a fiftieth of a pixel.
const LAYER_M: f64 = 1e-4;
/// No sheet is moved further than this many times [`LAYER_M`].
const MOST_LAYERS: usize = 8;
/// Faces whose normals have a smaller cosine cross each other. The sides of a thin mat, for one, do not lie in the
/// floor.
const PARALLEL: f64 = 0.99;
/// A piece whose middle is nearer to a plane, in metres, lies in it and stands on neither side.
const LIES_M: f64 = 0.01;

/// By surface and triangle, how far the triangle moves.
type Shifts = BTreeMap<usize, BTreeMap<usize, DVec3>>;

/// Moves every sheet of architecture that coincides with a larger one slightly to the side that it faces, and every
/// sheet of furniture that touches architecture slightly in front of it.
///
/// Of two sheets of architecture, the smaller is moved, since a decoration is smaller than its wall; of two of equal
/// area, the later. Without architecture, all sheets are compared in this way.
///
/// A sheet that moves leaves its neighbours, so the parts of a surface that has none yet are found before.
pub(crate) fn separate(surfaces: &mut [Surface], origins: &mut [InstanceOrigin], log: &mut Log) {
    let has_architecture = origins.iter().any(|origin| origin.role.is_architecture());
    let is_fixed = |origin: &InstanceOrigin| !has_architecture || origin.role.is_architecture();
    let fixed = faces(surfaces, origins, is_fixed);
    let mut shifts = Shifts::new();
    let place = if has_architecture { "/mesh" } else { "" };
    let all_compared = match layered(&fixed, place, log, &mut shifts) {
        None => false,
        Some(layer_of_face) => {
            let furniture = faces(surfaces, origins, |origin| !is_fixed(origin));
            raise(surfaces, &fixed, &layer_of_face, furniture, log, &mut shifts)
        }
    };
    if !all_compared {
        let message = format!("more than {MOST_PAIRS} pairs of triangles are near each other");
        log.warn("coincident_sheets", place, message, "did not move all sheets that coincide with others");
    }
    for (surface, shift_of) in shifts {
        let mesh = &mut surfaces[surface].mesh;
        origins[surface].part_of_triangle.get_or_insert_with(|| connected_parts(mesh));
        shift(mesh, &shift_of);
    }
}

/// Moves the sheets of architecture. Returns the layer of each face; absent if there are too many pairs.
fn layered(faces: &[Face], place: &str, log: &mut Log, shifts: &mut Shifts) -> Option<Vec<usize>> {
    let (pairs, is_whole) = near_pairs(faces, COINCIDENT_M);
    if !is_whole {
        return None;
    }
    let sheets = Sheets::new(faces, &pairs);
    let (layers, unfit) = layers_within_reach(&sheets);
    for (face, &sheet) in faces.iter().zip(&sheets.of_face) {
        if layers[sheet] > 0 {
            let by = sheets.all[sheet].normal * (layers[sheet] as f64 * LAYER_M);
            shifts.entry(face.surface).or_default().insert(face.triangle, by);
        }
    }
    let moved = || (0..layers.len()).filter(|&sheet| layers[sheet] > 0);
    if moved().next().is_some() {
        let area: f64 = moved().map(|sheet| sheets.all[sheet].area).sum();
        let message = format!("{} sheets with a total area of {area:.2} m2 coincide with larger ones", moved().count());
        let action = "moved each by 0.1 mm, or more in a stack, to the side it faces";
        log.note("coincident_sheets", place, message, action);
    }
    report_unfit(unfit, place, log);
    Some(sheets.of_face.iter().map(|&sheet| layers[sheet]).collect())
}

/// The layer of each sheet, at most [`MOST_LAYERS`], and how many sheets still coincide with another of the last layer.
fn layers_within_reach(sheets: &Sheets) -> (Vec<usize>, usize) {
    let layers = sheets.layers(MOST_LAYERS + 1);
    let unfit = layers.iter().filter(|layer| **layer > MOST_LAYERS).count();
    (layers.into_iter().map(|layer| layer.min(MOST_LAYERS)).collect(), unfit)
}

fn report_unfit(unfit: usize, place: &str, log: &mut Log) {
    if unfit > 0 {
        let message = format!("{unfit} sheets lie in stacks of more than {} coincident sheets", MOST_LAYERS + 1);
        let action = format!("moved them to layer {MOST_LAYERS}, where they still coincide with another sheet");
        log.warn("coincident_sheets", place, message, action);
    }
}

/// Moves the sheets of furniture. Returns false where there are too many pairs.
fn raise(
    surfaces: &[Surface],
    architecture: &[Face],
    layer_of_face: &[usize],
    furniture: Vec<Face>,
    log: &mut Log,
    shifts: &mut Shifts,
) -> bool {
    let Some(wanted) = wanted_shifts(surfaces, architecture, layer_of_face, &furniture) else { return false };
    if wanted.is_empty() {
        return true;
    }
    // Whole sheets move, one above the other where they overlap each other too.
    let touching = furniture.into_iter().enumerate().filter(|(number, _)| wanted.contains_key(number));
    let touching: Vec<Face> = touching.map(|(_, face)| face).collect();
    let (pairs, is_whole) = near_pairs(&touching, TOUCHES_M);
    let sheets = Sheets::new(&touching, &pairs);
    let mut shift_of_sheet = vec![DVec3::ZERO; sheets.all.len()];
    for (shift, &sheet) in wanted.values().zip(&sheets.of_face) {
        shift_of_sheet[sheet] = longer(*shift, shift_of_sheet[sheet]);
    }
    let (layers, unfit) = layers_within_reach(&sheets);
    for (shift, layer) in shift_of_sheet.iter_mut().zip(layers) {
        *shift += shift.normalize_or_zero() * (layer as f64 * LAYER_M);
    }
    for (face, &sheet) in touching.iter().zip(&sheets.of_face) {
        shifts.entry(face.surface).or_default().insert(face.triangle, shift_of_sheet[sheet]);
    }
    let area: f64 = sheets.all.iter().map(|sheet| sheet.area).sum();
    let message = format!("{} sheets of furniture, {area:.2} m2 in all, lie in architecture", sheets.all.len());
    log.note(
        "furniture_in_architecture",
        "/furniture",
        message,
        "moved each 0.1 mm in front of it, or more in a stack",
    );
    report_unfit(unfit, "/furniture", log);
    is_whole
}

/// The shift that takes each face of furniture in front of all architecture that it touches, by its index; absent if
/// there are too many pairs.
fn wanted_shifts(
    surfaces: &[Surface],
    architecture: &[Face],
    layer_of_face: &[usize],
    furniture: &[Face],
) -> Option<BTreeMap<usize, DVec3>> {
    let mut middles: BTreeMap<usize, DVec3> = BTreeMap::new();
    let mut wanted: BTreeMap<usize, DVec3> = BTreeMap::new();
    let is_whole = for_each_near(furniture, architecture, TOUCHES_M, |number, wall| {
        let (face, layer, wall) = (&furniture[number], layer_of_face[wall], &architecture[wall]);
        let middle = *middles.entry(face.surface).or_insert_with(|| middle(&surfaces[face.surface].mesh));
        let side = if wall.height(middle) < -LIES_M { -1.0 } else { 1.0 };
        // The wall's own layer is on the side that it faces.
        let layer = if side > 0.0 { layer + 1 } else { 1 };
        let lowest = face.corners.iter().map(|corner| side * wall.height(*corner)).fold(f64::INFINITY, f64::min);
        let by = layer as f64 * LAYER_M - lowest;
        let is_parallel = face.normal.dot(wall.normal).abs() > PARALLEL;
        if is_parallel && lowest >= -TOUCHES_M && by > 0.0 {
            let before = wanted.entry(number).or_insert(DVec3::ZERO);
            *before = longer(side * by * wall.normal, *before);
        }
    });
    is_whole.then_some(wanted)
}

/// The longer of two vectors; of equal ones the second.
fn longer(one: DVec3, other: DVec3) -> DVec3 {
    if one.length() > other.length() { one } else { other }
}

/// The mean of a mesh's corners.
fn middle(mesh: &TriangleMesh) -> DVec3 {
    let corners = (0..mesh.triangles.len()).flat_map(|triangle| mesh.corners(triangle));
    let (sum, count) = corners.fold((DVec3::ZERO, 0.0), |(sum, count), corner| (sum + corner.as_dvec3(), count + 1.0));
    sum / f64::max(count, 1.0)
}

/// Moves triangles of a mesh, which get vertices of their own.
fn shift(mesh: &mut TriangleMesh, shift_of: &BTreeMap<usize, DVec3>) {
    let mut copies = BTreeMap::new();
    for (&triangle, &shift) in shift_of {
        for corner in 0..3 {
            let vertex = mesh.triangles[triangle][corner];
            let key = (vertex, shift.to_array().map(f64::to_bits));
            mesh.triangles[triangle][corner] = *copies.entry(key).or_insert_with(|| {
                let copy = mesh.copy_vertex(vertex);
                let position = &mut mesh.positions[copy as usize];
                *position = (position.as_dvec3() + shift).as_vec3();
                copy
            });
        }
    }
    *mesh = mesh.picked(|_| true);
}

/// Triangles that overlap by no more than this, in metres, only touch.
const TOUCHING_M: f64 = 1e-4;
/// Triangles with a smaller area, in m^2, are ignored.
const SMALLEST_AREA: f64 = 1e-8;
/// The most pairs of triangles that are compared. A real house has less than a hundredth as many.
const MOST_PAIRS: usize = 50_000_000;

struct Face {
    surface: usize,
    /// Index in the surface's mesh.
    triangle: usize,
    part: usize,
    corners: [DVec3; 3],
    normal: DVec3,
    area: f64,
}

impl Face {
    /// The distance of a point from the face's plane; positive on the side that it faces.
    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }

    fn bounds(&self, margin: f64) -> AABB<[f64; 3]> {
        let [a, b, c] = self.corners;
        let (low, high) = (a.min(b).min(c) - margin, a.max(b).max(c) + margin);
        AABB::from_corners(low.to_array(), high.to_array())
    }

    /// Whether the smaller of two triangles lies within `distance` of the plane of the larger and overlaps it.
    fn lies_in(&self, other: &Self, distance: f64) -> bool {
        let (large, small) = if self.area >= other.area { (self, other) } else { (other, self) };
        small.corners.iter().all(|&corner| large.height(corner).abs() <= distance) && overlap(large, small)
    }
}

/// The faces of all surfaces that `chosen` accepts.
fn faces(surfaces: &[Surface], origins: &[InstanceOrigin], chosen: impl Fn(&InstanceOrigin) -> bool) -> Vec<Face> {
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
fn for_each_near(all: &[Face], among: &[Face], distance: f64, mut found: impl FnMut(usize, usize)) -> bool {
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

/// The pairs of faces that lie within `distance` of each other, and whether these are all.
fn near_pairs(faces: &[Face], distance: f64) -> (Vec<[usize; 2]>, bool) {
    let mut pairs = Vec::new();
    let is_whole = for_each_near(faces, faces, distance, |one, other| {
        if one < other {
            pairs.push([one, other]);
        }
    });
    (pairs, is_whole)
}

/// Whether two triangles in one plane overlap by more than [`TOUCHING_M`], by the separating axis theorem: no line
/// along an edge of either separates them.
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

/// The triangles of one part of a mesh that lie in one plane and face one way, without overlaps.
struct Sheet {
    normal: DVec3,
    area: f64,
    overlaps: Vec<usize>,
}

/// All sheets, and the sheet of each face.
struct Sheets {
    all: Vec<Sheet>,
    of_face: Vec<usize>,
}

impl Sheets {
    /// The sheets of these faces, of which the `pairs` lie in each other.
    ///
    /// The segments of a moulding may overlap each other, and small meshes share a part. Where faces of one sheet
    /// overlap, each of its connected pieces is a sheet, and where that is not enough, each of the piece's triangles.
    fn new(faces: &[Face], pairs: &[[usize; 2]]) -> Self {
        let mut of_face = numbered(faces.iter().map(plane_key));
        for is_last in [false, true] {
            let folded: BTreeSet<usize> =
                pairs.iter().filter(|[a, b]| of_face[*a] == of_face[*b]).map(|[a, _]| of_face[*a]).collect();
            if folded.is_empty() {
                break;
            }
            let piece = if is_last { (0..faces.len()).collect() } else { connected_pieces(faces, &of_face) };
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

    /// A layer for each sheet, at most `most`. From the largest sheet to the smallest, each takes the lowest layer that
    /// no sheet it overlaps has taken.
    fn layers(&self, most: usize) -> Vec<usize> {
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
            let (a, b) = (find(&mut pieces, first), find(&mut pieces, number));
            pieces[a.max(b)] = a.min(b);
        }
    }
    (0..faces.len()).map(|face| find(&mut pieces, face)).collect()
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use mateval_dataset::Role;
    use mateval_dataset::reference::MaterialIndex;

    use super::*;

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
        separated_in_roles(meshes.into_iter().map(|mesh| (mesh, role.clone())).collect())
    }

    fn separated_in_roles(meshes: Vec<(TriangleMesh, Role)>) -> (Vec<TriangleMesh>, Vec<String>) {
        let (meshes, roles): (Vec<TriangleMesh>, Vec<Role>) = meshes.into_iter().unzip();
        let mut origins: Vec<InstanceOrigin> = meshes
            .iter()
            .zip(roles)
            .map(|(mesh, role)| {
                let part_of_triangle = Some(vec![0; mesh.triangles.len()]);
                InstanceOrigin { role, part_of_triangle, ..InstanceOrigin::default() }
            })
            .collect();
        let surface = |mesh| Surface { name: String::new(), mesh, material: MaterialIndex(0) };
        let mut surfaces: Vec<Surface> = meshes.into_iter().map(surface).collect();
        let mut log = Log::new("house.json".to_owned(), 10);
        separate(&mut surfaces, &mut origins, &mut log);
        let codes = log.into_findings().into_iter().map(|finding| finding.code).collect();
        (surfaces.into_iter().map(|surface| surface.mesh).collect(), codes)
    }

    fn heights(mesh: &TriangleMesh) -> (f32, f32) {
        mesh.positions.iter().fold((f32::MAX, f32::MIN), |(low, high), p| (low.min(p.z), high.max(p.z)))
    }

    /// A corner of two squares stands on a floor. Its lower square moves and stays in one part with the other.
    #[test]
    fn a_moved_sheet_stays_in_its_part() {
        let mut corner = square(1.0, 1.0, true);
        corner.positions.extend([Vec3::new(1.0, 0.0, 1.0), Vec3::new(2.0, 0.0, 1.0)]);
        corner.triangles.extend([[0, 1, 5], [0, 5, 4]]);
        corner.uvs = None;
        let surface = |mesh| Surface { name: String::new(), mesh, material: MaterialIndex(0) };
        let mut surfaces = [surface(corner), surface(square(0.0, 3.0, true))];
        let mut origins = vec![InstanceOrigin::default(); 2];
        separate(&mut surfaces, &mut origins, &mut Log::new("a.gltf".to_owned(), 10));
        assert_eq!(origins[0].part_of_triangle, Some(vec![0; 4]));
        assert_eq!(connected_parts(&surfaces[0].mesh), [0, 0, 1, 1]);
        assert_eq!(origins[1].part_of_triangle, None);
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

    /// Nine sheets find a layer each; the others share the last one, which is reported.
    #[test]
    fn sheets_beyond_the_last_layer_are_reported() {
        for (count, expected) in [(9, vec!["coincident_sheets"]), (12, vec!["coincident_sheets"; 2])] {
            let (meshes, codes) = separated(vec![square(0.0, 2.0, true); count], &architecture());
            let mut found: Vec<i32> = meshes.iter().map(|mesh| (heights(mesh).0 * 1e4).round() as i32).collect();
            found.sort_unstable();
            let layers: Vec<i32> = (0..count as i32).map(|at| at.min(8)).collect();
            assert_eq!((found, codes), (layers, expected.into_iter().map(str::to_owned).collect()));
        }
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
        // Furniture in furniture stays in a house; a scene without architecture separates all sheets.
        let inside = [square(0.0, 3.0, true), square(1.0, 1.0, true)];
        let far = (square(9.0, 3.0, true), architecture());
        let furniture = inside.clone().map(|mesh| (mesh, Role::Furniture {}));
        let (meshes, codes) = separated_in_roles([vec![far], furniture.into()].concat());
        assert_eq!((&meshes[1..], codes), (&inside[..], vec![]));
        let (meshes, codes) = separated(inside.into(), &Role::Furniture {});
        assert_eq!((heights(&meshes[1]), codes), ((1e-4, 1e-4), vec!["coincident_sheets".to_owned()]));
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

    /// Segments of one mesh that overlap in part: one moves, the other stays, and neighbours that only touch stay too.
    #[test]
    fn overlaps_within_a_mesh_are_separated() {
        let mut rail = square(0.0, 2.0, true);
        rail.append(&square(1.5, 1.0, true));
        rail.append(&square(4.0, 1.0, true));
        let (meshes, codes) = separated(vec![rail], &architecture());
        let height = |triangles: [usize; 2]| triangles.map(|triangle| meshes[0].corners(triangle).map(|c| c.z));
        assert_eq!(height([0, 1]), [[0.0; 3]; 2]);
        assert_eq!(height([2, 3]), [[1e-4; 3]; 2]);
        assert_eq!(height([4, 5]), [[0.0; 3]; 2]);
        assert_eq!(codes, ["coincident_sheets"]);
        // Twice the same triangles, with the same corners.
        let mut twice = square(0.0, 2.0, true);
        twice.triangles.extend(twice.triangles.clone());
        let (meshes, _) = separated(vec![twice], &architecture());
        let mut heights: Vec<f32> = (0..4).map(|triangle| meshes[0].corners(triangle)[0].z).collect();
        heights.sort_by(f32::total_cmp);
        assert_eq!(heights, [0.0, 0.0, 1e-4, 1e-4]);
    }

    fn at_height(mut mesh: TriangleMesh, z: f32) -> TriangleMesh {
        mesh.positions.iter_mut().for_each(|position| position.z += z);
        mesh
    }

    /// A flat piece in a floor, a little below or just above it, whichever way it faces, comes to lie on it; a piece on
    /// top of another lies on both.
    #[test]
    fn furniture_lies_on_the_floor() {
        let floor = || (square(0.0, 5.0, true), architecture());
        for (z, faces_front) in [(0.0, true), (0.0, false), (-9e-4, true), (5e-5, true)] {
            let mat = (at_height(square(1.0, 1.0, faces_front), z), Role::Furniture {});
            let (meshes, codes) = separated_in_roles(vec![floor(), mat]);
            assert_eq!(heights(&meshes[0]), (0.0, 0.0));
            let (low, high) = heights(&meshes[1]);
            assert!((low - 1e-4).abs() < 1e-8 && high == low, "{z}: {low} {high}");
            assert_eq!(codes, ["furniture_in_architecture"]);
        }
        let mats = [1.0, 2.0].map(|side| (square(1.0, side, true), Role::Furniture {}));
        let (meshes, _) = separated_in_roles([vec![floor()], mats.into()].concat());
        assert_eq!([1, 2].map(|mesh| (heights(&meshes[mesh]).0 * 1e4).round()), [2.0, 1.0]);
    }

    /// A lamp below a ceiling that faces up: its plate is moved down, to the side of the lamp.
    #[test]
    fn furniture_stays_on_its_side() {
        let mut lamp = square(1.0, 1.0, true);
        lamp.append(&at_height(square(1.0, 1.0, false), -0.3));
        let (meshes, _) =
            separated_in_roles(vec![(square(0.0, 5.0, true), architecture()), (lamp, Role::LightFixture {})]);
        assert_eq!(meshes[1].corners(0).map(|corner| corner.z), [-1e-4; 3]);
        assert_eq!(meshes[1].corners(2).map(|corner| corner.z), [-0.3; 3]);
    }

    /// What stands higher, lies deeper, beside or across the floor stays.
    #[test]
    fn other_furniture_stays() {
        let upright = |mut mesh: TriangleMesh| {
            mesh.positions.iter_mut().for_each(|p| *p = Vec3::new(p.x, 1.0, p.y * 5e-4));
            mesh
        };
        let pieces = [
            at_height(square(1.0, 1.0, true), 2e-4),
            at_height(square(1.0, 1.0, true), -2e-3),
            square(7.0, 1.0, true),
            upright(square(1.0, 1.0, true)),
        ];
        let floor = (square(0.0, 5.0, true), architecture());
        let meshes = [vec![floor], pieces.map(|piece| (piece, Role::Furniture {})).into()].concat();
        let before: Vec<TriangleMesh> = meshes.iter().map(|(mesh, _)| mesh.clone()).collect();
        assert_eq!(separated_in_roles(meshes), (before, vec![]));
    }
}
