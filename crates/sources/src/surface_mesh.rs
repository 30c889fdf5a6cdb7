//! From a shape's own space to the world: positions, normals, front sides, and what is wrong with the result.

use glam::{DMat3, DMat4, DVec3, Vec3};
use mateval_scene::TriangleMesh;

/// Beyond this many metres a position is a fault, not a place.
const FARTHEST: f32 = 1e9;

/// What was mended in a mesh, as counts.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Triangles left out: a corner was not finite or absurdly far away.
    pub not_finite: usize,
    /// Triangles of no area; they stay.
    pub degenerate: usize,
    /// Normals made anew: they were zero or not finite.
    pub normals: usize,
    /// Texture coordinates set to 0: they were not finite.
    pub uvs: usize,
}

/// The mesh in world space. The front stays the front under a mirror: the winding turns with the determinant's sign,
/// and normals go by the inverse transpose.
pub fn to_world(mut mesh: TriangleMesh, world_from_object: DMat4, flip: bool) -> (TriangleMesh, Repairs) {
    let mut repairs = Repairs::default();
    let linear = DMat3::from_mat4(world_from_object);
    let mirrored = linear.determinant() < 0.0;
    if world_from_object != DMat4::IDENTITY {
        for position in &mut mesh.positions {
            *position = world_from_object.transform_point3(position.as_dvec3()).as_vec3();
        }
        // The adjugate is the inverse transpose times the determinant, and exists for flat transforms too.
        let normal_matrix = cofactors(linear) * if mirrored { -1.0 } else { 1.0 };
        for normal in mesh.normals.iter_mut().flatten() {
            *normal = (normal_matrix * normal.as_dvec3()).as_vec3();
        }
    }
    repairs.not_finite = drop_far_triangles(&mut mesh);
    if mirrored != flip {
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    if flip {
        mesh.normals.iter_mut().flatten().for_each(|normal| *normal = -*normal);
    }
    repairs.normals = mend_normals(&mut mesh);
    repairs.uvs = mend_uvs(&mut mesh);
    repairs.degenerate = (0..mesh.triangles.len()).filter(|&index| is_degenerate(mesh.corners(index))).count();
    (mesh, repairs)
}

fn cofactors(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

fn is_degenerate(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (b - a).cross(c - a).length() <= 1e-12 * longest
}

/// Whether a triangle covers anything worth keeping; false for what is not finite.
pub fn has_area(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    longest < 1e12 && (b - a).cross(c - a).length() > 1e-9 * longest
}

/// Leaves out triangles with impossible corners, and those corners; how many.
fn drop_far_triangles(mesh: &mut TriangleMesh) -> usize {
    let sound: Vec<bool> = mesh.positions.iter().map(|p| p.is_finite() && p.abs().max_element() <= FARTHEST).collect();
    if sound.iter().all(|s| *s) {
        return 0;
    }
    let before = mesh.triangles.len();
    mesh.triangles.retain(|triangle| triangle.iter().all(|&v| sound[v as usize]));
    let mut next = 0;
    let new_index: Vec<u32> = sound.iter().map(|&s| (next, next += u32::from(s)).0).collect();
    mesh.triangles.iter_mut().flatten().for_each(|vertex| *vertex = new_index[*vertex as usize]);
    let keep = |index: &mut usize| (sound[*index], *index += 1).0;
    let mut index = 0;
    mesh.positions.retain(|_| keep(&mut index));
    if let Some(normals) = &mut mesh.normals {
        let mut index = 0;
        normals.retain(|_| keep(&mut index));
    }
    if let Some(uvs) = &mut mesh.uvs {
        let mut index = 0;
        uvs.retain(|_| keep(&mut index));
    }
    before - mesh.triangles.len()
}

/// Makes normals of unit length; one that cannot be is taken from the faces around it. How many were.
fn mend_normals(mesh: &mut TriangleMesh) -> usize {
    let Some(normals) = &mesh.normals else { return 0 };
    let unit: Vec<Option<Vec3>> = normals.iter().map(|n| n.as_dvec3().try_normalize().map(|n| n.as_vec3())).collect();
    let faulty = unit.iter().filter(|n| n.is_none()).count();
    let smooth = if faulty > 0 { smooth_normals(mesh) } else { Vec::new() };
    mesh.normals = Some(unit.into_iter().enumerate().map(|(i, n)| n.unwrap_or_else(|| smooth[i])).collect());
    faulty
}

fn mend_uvs(mesh: &mut TriangleMesh) -> usize {
    let faulty = mesh.uvs.iter_mut().flatten().filter(|uv| !uv.is_finite());
    faulty.map(|uv| *uv = glam::Vec2::ZERO).count()
}

/// Normals of a smooth surface: those of the faces around a vertex, weighted by their angle there (Thürmer and Wüthrich,
/// "Computing vertex normals from polygonal facets", JGT 1998), as Mitsuba makes them for an OBJ without normals.
pub fn smooth_normals(mesh: &TriangleMesh) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let corners = mesh.corners(index).map(|p| p.as_dvec3());
        let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        for (k, &vertex) in triangle.iter().enumerate() {
            let to = |other: usize| (corners[(k + other) % 3] - corners[k]).normalize_or_zero();
            let angle = libm::acos(to(1).dot(to(2)).clamp(-1.0, 1.0));
            sums[vertex as usize] += face * angle;
        }
    }
    sums.into_iter().map(|sum| sum.try_normalize().unwrap_or(DVec3::Z).as_vec3()).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::bitterli::primitives::{cube, rectangle};

    fn front(mesh: &TriangleMesh) -> Vec3 {
        let [a, b, c] = mesh.corners(0);
        (b - a).cross(c - a).normalize()
    }

    /// Mitsuba 3.9.1: a rectangle scaled by (-1, 1, 1) keeps its shading normal, and so its glowing side, at +z.
    #[test]
    fn mirrors_keep_the_front() {
        for scale in [DVec3::new(-1.0, 1.0, 1.0), DVec3::new(2.0, -0.5, 1.0), DVec3::ONE] {
            let (mesh, repairs) = to_world(rectangle(), DMat4::from_scale(scale), false);
            assert_eq!(repairs, Repairs::default());
            assert!((front(&mesh) - Vec3::Z).length() < 1e-6);
            assert!(mesh.normals.unwrap().iter().all(|n| (*n - Vec3::Z).length() < 1e-6));
        }
        // Twin: upside down, it looks down.
        let (mesh, _) = to_world(rectangle(), DMat4::from_rotation_x(std::f64::consts::PI), false);
        assert!((front(&mesh) + Vec3::Z).length() < 1e-6);
        let (mesh, _) = to_world(rectangle(), DMat4::IDENTITY, true);
        assert!((front(&mesh) + Vec3::Z).length() < 1e-6);
    }

    #[test]
    fn normals_go_by_the_inverse_transpose() {
        let tilted = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_4);
        let (mesh, _) = to_world(rectangle(), DMat4::from_scale(DVec3::new(1.0, 1.0, 5.0)) * tilted, false);
        assert!(mesh.normals.as_ref().unwrap()[0].dot(front(&mesh)) > 0.999_99);
    }

    #[test]
    fn faults_are_mended_and_counted() {
        let mut mesh = cube();
        mesh.positions[0].x = f32::NAN;
        mesh.positions[5] = mesh.positions[4];
        mesh.normals.as_mut().unwrap()[8] = Vec3::ZERO;
        mesh.uvs.as_mut().unwrap()[9] = Vec2::new(f32::INFINITY, 0.0);
        let (mesh, repairs) = to_world(mesh, DMat4::IDENTITY, false);
        assert_eq!(repairs, Repairs { not_finite: 2, degenerate: 1, normals: 1, uvs: 1 });
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (10, 23));
        assert!(mesh.positions.iter().all(|p| p.is_finite()));
        assert!(mesh.normals.unwrap().iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn smooth_normals_of_a_flat_mesh_are_flat() {
        assert!(smooth_normals(&rectangle()).iter().all(|n| (*n - Vec3::Z).length() < 1e-6));
    }
}
