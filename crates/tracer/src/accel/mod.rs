//! Ray queries against all triangles of all surfaces, by a bounding volume hierarchy.
//!
//! Answers are the same as when every triangle is tested: boxes are padded, and ties go to the triangle of lowest
//! index, so the shape of the tree never shows. Answers are also the same with every instruction set. Memory: about 90
//! bytes a triangle, at most 450 (where no two triangles are near each other).

mod kernel;
mod traverse;
mod wide;

use glam::Vec3;
use mateval_dataset::TriangleMesh;
use mateval_dataset::mesh::bounds;
use mateval_dataset::reference::SurfaceIndex;

use crate::error::{ElementFault, ExceededLimit, RequestFault, SurfaceFault, TracerError};
use crate::ray::{Hit, Ray, TriangleIndex};
use kernel::{Portable, WIDTH};
pub(crate) use kernel::{move_to_huge_pages, on_huge_pages, prefetch, prefetch_line};
use traverse::Candidate;
use wide::Wide;

/// The processor instructions used for ray queries. Answers do not depend on them.
#[derive(Clone, Copy, Debug)]
enum Instructions {
    /// AVX2, FMA and the bit instructions of the same generation: processors since about 2015.
    #[cfg(target_arch = "x86_64")]
    Avx2(kernel::Avx2),
    Portable,
}

impl Instructions {
    /// The fastest that this processor has.
    fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = kernel::Avx2::detect() {
            return Self::Avx2(avx2);
        }
        Self::Portable
    }
}

/// A bounding volume hierarchy. It holds a copy of the corners, so that worlds with the same triangles can share it.
#[derive(Debug)]
pub struct Accel {
    /// `None` if there are no triangles.
    wide: Option<Wide>,
    bounds: [Vec3; 2],
    /// The largest absolute coordinate.
    pub(crate) size: f32,
    /// For each surface the number of triangles before it, then the total.
    starts: Vec<u32>,
    instructions: Instructions,
}

/// The largest coordinate accepted, in metres: f32 cannot distinguish one metre from the next there.
const LARGEST_COORDINATE: f32 = 1e7;
/// The children of a node are numbered with 31 bits.
const MOST_TRIANGLES: usize = 1 << 31;

impl Accel {
    /// Builds the hierarchy over the meshes of all surfaces, in the order of the surfaces.
    ///
    /// Fails if a triangle names a vertex that does not exist, if a coordinate is not finite or beyond 1e7 m, or if
    /// there are more than 2^31 triangles.
    pub fn build(meshes: &[&TriangleMesh]) -> Result<Self, TracerError> {
        let (corners, starts) = flatten(meshes)?;
        let [low, high] = bounds(corners.iter().flatten().copied()).unwrap_or_default();
        let wide = (!corners.is_empty()).then(|| Wide::build(&corners, &starts));
        Ok(Self {
            wide,
            bounds: [low, high],
            size: low.abs().max(high.abs()).max_element(),
            starts,
            instructions: Instructions::detect(),
        })
    }

    /// The same hierarchy, queried with instructions that every processor has; for tests.
    pub fn portable(self) -> Self {
        Self { instructions: Instructions::Portable, ..self }
    }

    /// The nearest hit at a distance above 0.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.find::<false>(ray, |_| true).map(|found| self.hit(&found))
    }

    /// The nearest hit that `accept` returns true for. `accept` may also be called for other hits, in any order, and
    /// must always return the same value for the same hit.
    #[inline]
    pub fn closest_where(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        self.find::<false>(ray, |found| accept(&self.hit(found))).map(|found| self.hit(&found))
    }

    /// Whether there is any hit.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.find::<true>(ray, |_| true).is_some()
    }

    /// Whether there is any hit that `accept` returns true for; see [`Self::closest_where`].
    #[inline]
    pub(crate) fn occluded_where(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        self.find::<true>(ray, |found| accept(&self.hit(found))).is_some()
    }

    /// [`Self::closest`] for many rays at once, which is faster than one by one: `hits[k]` belongs to `rays[k]`.
    pub fn closest_many(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        self.closest_of_candidates(rays, |_, _| true, hits);
    }

    /// [`Self::closest_where`] for many rays at once. `accept` also gets the index of the ray.
    pub(crate) fn closest_many_where(
        &self,
        rays: &[Ray],
        accept: impl Fn(usize, &Hit) -> bool,
        hits: &mut Vec<Option<Hit>>,
    ) {
        self.closest_of_candidates(rays, |which, found| accept(which, &self.hit(found)), hits);
    }

    /// [`Self::occluded`] for many rays at once.
    pub fn occluded_many(&self, rays: &[Ray], occluded: &mut Vec<bool>) {
        self.any_of_candidates(rays, |_, _| true, occluded);
    }

    /// [`Self::occluded_where`] for many rays at once. `accept` also gets the index of the ray.
    pub(crate) fn occluded_many_where(
        &self,
        rays: &[Ray],
        accept: impl Fn(usize, &Hit) -> bool,
        occluded: &mut Vec<bool>,
    ) {
        self.any_of_candidates(rays, |which, found| accept(which, &self.hit(found)), occluded);
    }

    /// The lower and upper corner of the box around all triangles; zeros if there are none.
    pub fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }

    pub fn triangle_count(&self) -> usize {
        self.starts[self.starts.len() - 1] as usize
    }

    /// The memory that the hierarchy takes, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.wide.as_ref().map_or(0, Wide::memory_bytes) + self.starts.len() * size_of::<u32>()
    }

    /// Fails unless the hierarchy was built from exactly these triangles.
    pub(crate) fn check_triangles(&self, meshes: &[&TriangleMesh]) -> Result<(), TracerError> {
        let (corners, starts) = flatten(meshes)?;
        let blocks = || self.wide.iter().flat_map(|wide| &wide.blocks);
        let mut held = blocks().flat_map(|block| (0..WIDTH).map(move |lane| (block, lane)));
        let same = starts == self.starts
            && held.all(|(block, lane)| {
                let triangle = block.triangles[lane];
                triangle == u32::MAX || block.corners_of(lane) == corners[triangle as usize]
            });
        let (hierarchy, scene) = (self.triangle_count(), corners.len());
        if same { Ok(()) } else { Err(RequestFault::OtherTriangles { hierarchy, scene }.into()) }
    }

    /// Traverses the hierarchy with the chosen instructions.
    #[inline]
    fn find<const ANY: bool>(&self, ray: &Ray, accept: impl Fn(&Candidate) -> bool) -> Option<Candidate> {
        let wide = self.wide.as_ref().filter(|_| ray.is_usable())?;
        match self.instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(avx2) => avx2.run(
                #[inline(always)]
                |avx2| traverse::traverse::<_, ANY>(avx2, wide, self.size, ray, accept),
            ),
            Instructions::Portable => traverse::traverse::<_, ANY>(Portable, wide, self.size, ray, accept),
        }
    }

    fn closest_of_candidates(
        &self,
        rays: &[Ray],
        accept: impl Fn(usize, &Candidate) -> bool,
        hits: &mut Vec<Option<Hit>>,
    ) {
        hits.clear();
        hits.resize(rays.len(), None);
        self.find_many::<false>(rays, accept, |which, found| hits[which] = found.map(|found| self.hit(&found)));
    }

    fn any_of_candidates(&self, rays: &[Ray], accept: impl Fn(usize, &Candidate) -> bool, occluded: &mut Vec<bool>) {
        occluded.clear();
        occluded.resize(rays.len(), false);
        self.find_many::<true>(rays, accept, |which, found| occluded[which] = found.is_some());
    }

    /// [`Self::find`] for many rays; `found` is called for every usable ray.
    fn find_many<const ANY: bool>(
        &self,
        rays: &[Ray],
        accept: impl Fn(usize, &Candidate) -> bool,
        found: impl FnMut(usize, Option<Candidate>),
    ) {
        use traverse::traverse_many;
        let Some(wide) = &self.wide else { return };
        match self.instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(avx2) => avx2.run(
                #[inline(always)]
                |avx2| traverse_many::<_, ANY>(avx2, wide, self.size, rays, accept, found),
            ),
            Instructions::Portable => traverse_many::<_, ANY>(Portable, wide, self.size, rays, accept, found),
        }
    }

    #[inline]
    fn hit(&self, found: &Candidate) -> Hit {
        let [u, v, w] = found.weights;
        Hit {
            surface: SurfaceIndex(found.surface as usize),
            triangle: TriangleIndex((found.triangle - self.starts[found.surface as usize]) as usize),
            barycentrics: Vec3::new(u, v, w) / ((u + v) + w),
            distance: found.distance,
            global: found.triangle,
        }
    }
}

/// The corners of all triangles, surface by surface, and the number of triangles before each surface.
fn flatten(meshes: &[&TriangleMesh]) -> Result<(Vec<[Vec3; 3]>, Vec<u32>), TracerError> {
    let total: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    if total > MOST_TRIANGLES {
        return Err(ExceededLimit::Triangles { found: total, limit: MOST_TRIANGLES }.into());
    }
    let mut corners = Vec::with_capacity(total);
    let mut starts = vec![0];
    for (surface, mesh) in meshes.iter().enumerate() {
        let fault = |fault| ElementFault::Surface { surface: SurfaceIndex(surface), name: None, fault };
        check_positions(mesh).map_err(fault)?;
        corners.extend((0..mesh.triangles.len()).map(|index| mesh.corners(index)));
        starts.push(corners.len() as u32);
    }
    Ok((corners, starts))
}

/// Tests each coordinate by itself, because a maximum would ignore NaN.
fn is_within_reach(position: Vec3) -> bool {
    position.to_array().iter().all(|v| v.abs() <= LARGEST_COORDINATE)
}

fn check_positions(mesh: &TriangleMesh) -> Result<(), SurfaceFault> {
    if let Some(vertex) = mesh.positions.iter().position(|p| !is_within_reach(*p)) {
        return Err(SurfaceFault::Position { vertex, position: mesh.positions[vertex], limit: LARGEST_COORDINATE });
    }
    let count = mesh.positions.len();
    match mesh.triangles.iter().position(|t| t.iter().any(|&vertex| vertex as usize >= count)) {
        Some(triangle) => Err(SurfaceFault::MissingVertex { triangle, vertices: mesh.triangles[triangle], count }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::kernel::{BoxRay, Kernel as _, TriangleRay};
    use super::*;

    /// The same as [`Accel::closest`], found by testing every triangle.
    fn by_testing_all(accel: &Accel, ray: &Ray) -> Option<Hit> {
        let wide = accel.wide.as_ref().filter(|_| ray.is_usable())?;
        let triangle_ray = TriangleRay::new(ray, &BoxRay::new(ray, accel.size));
        let candidates = wide.blocks.iter().flat_map(|block| {
            let found = Portable.triangles(block, &triangle_ray, ray.max_distance());
            let hit = (0..WIDTH).filter(move |lane| found.hit & (1 << lane) != 0);
            hit.map(|lane| Candidate::new(block, &found, lane)).collect::<Vec<_>>()
        });
        let nearest = candidates.reduce(|best, found| if found.comes_before(&best) { found } else { best });
        nearest.map(|found| accel.hit(&found))
    }

    /// Mostly coordinates from a coarse grid, so that edges, corners and planes often coincide.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![4 => (-4_i32..=4).prop_map(|k| k as f32 * 0.5), 1 => -2.0_f32..2.0, 1 => Just(-0.0_f32)]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from_array)
    }

    fn mesh() -> impl Strategy<Value = TriangleMesh> {
        // Indices drawn at random share vertices and edges, and sometimes repeat a vertex within a triangle.
        prop::collection::vec(point(), 3..40).prop_flat_map(|positions| {
            let count = positions.len() as u32;
            prop::collection::vec([0..count, 0..count, 0..count], 1..80).prop_map(move |triangles| TriangleMesh {
                positions: positions.clone(),
                triangles,
                ..Default::default()
            })
        })
    }

    /// Directions along axes, towards grid points (through vertices and edges), with negative zeros, or arbitrary.
    fn direction() -> impl Strategy<Value = Vec3> {
        prop_oneof![
            Just(Vec3::X),
            Just(Vec3::new(-0.0, -1.0, -0.0)),
            Just(Vec3::new(0.0, -0.0, 1.0)),
            Just(Vec3::new(1.0, 1e-7, -1e-30)),
            point(),
            [-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0].prop_map(Vec3::from_array),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]

        #[test]
        fn the_answer_is_that_of_testing_every_triangle(
            a in mesh(),
            b in mesh(),
            scale in prop_oneof![Just(1e-3_f32), Just(1.0), Just(1e3)],
            away in prop_oneof![Just(0.0_f32), Just(100.0)],
            origin in point(),
            direction in direction(),
            reach in prop_oneof![Just(f32::INFINITY), 0.0_f32..3.0],
        ) {
            let place = |mut mesh: TriangleMesh| {
                mesh.positions.iter_mut().for_each(|p| *p = (*p + Vec3::splat(away)) * scale);
                mesh
            };
            let (a, b) = (place(a), place(b));
            let accel = Accel::build(&[&a, &b]).unwrap();
            let direction = direction.normalize_or_zero();
            let ray = Ray::new((origin + Vec3::splat(away)) * scale, direction, reach * scale);
            let expected = by_testing_all(&accel, &ray);
            prop_assert_eq!(accel.closest(&ray), expected);
            prop_assert_eq!(accel.occluded(&ray), expected.is_some());
            // The same with `accept`: the lowest of equally near triangles among those accepted.
            let odd = |hit: &Hit| hit.triangle.0 % 2 == 1;
            let refused = accel.closest_where(&ray, odd);
            prop_assert_eq!(accel.occluded_where(&ray, odd), refused.is_some());
            prop_assert!(refused.is_none_or(|hit| expected.is_some_and(|nearest| nearest.distance <= hit.distance)));
            // The answers do not depend on the instructions.
            let portable = accel.portable();
            prop_assert_eq!(portable.closest(&ray), expected);
            prop_assert_eq!(portable.occluded(&ray), expected.is_some());
            prop_assert_eq!(portable.closest_where(&ray, odd), refused);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

        /// Rays traversed together find the same hits as each alone, for any number of rays, with unusable rays among
        /// them.
        #[test]
        fn many_rays_find_what_each_finds_alone(
            mesh in mesh(),
            rays in prop::collection::vec((point(), direction(), prop_oneof![Just(f32::INFINITY), 0.0_f32..3.0]), 0..40),
        ) {
            let rays: Vec<Ray> =
                rays.into_iter().map(|(origin, d, reach)| Ray::new(origin, d.normalize_or_zero(), reach)).collect();
            let odd = |hit: &Hit| hit.triangle.0 % 2 == 1;
            // Every third ray accepts odd triangles only.
            let taken = |which: usize, hit: &Hit| !which.is_multiple_of(3) || odd(hit);
            for accel in [Accel::build(&[&mesh]).unwrap(), Accel::build(&[&mesh]).unwrap().portable()] {
                let (mut hits, mut occluded) = (Vec::new(), Vec::new());
                accel.closest_many(&rays, &mut hits);
                accel.occluded_many(&rays, &mut occluded);
                prop_assert_eq!(&hits, &rays.iter().map(|ray| accel.closest(ray)).collect::<Vec<_>>());
                prop_assert_eq!(&occluded, &rays.iter().map(|ray| accel.occluded(ray)).collect::<Vec<_>>());
                accel.closest_many_where(&rays, taken, &mut hits);
                accel.occluded_many_where(&rays, taken, &mut occluded);
                for (which, ray) in rays.iter().enumerate() {
                    prop_assert_eq!(hits[which], accel.closest_where(ray, |hit| taken(which, hit)));
                    prop_assert_eq!(occluded[which], hits[which].is_some());
                }
            }
        }
    }

    /// A closed sphere of 2 n^2 triangles with shared vertices.
    fn ball(n: u32) -> TriangleMesh {
        let mut mesh = TriangleMesh { positions: vec![Vec3::Y, Vec3::NEG_Y], ..Default::default() };
        for ring in 1..n {
            for sector in 0..n {
                let (sin_t, cos_t) = libm::sincosf(std::f32::consts::PI * ring as f32 / n as f32);
                let (sin_p, cos_p) = libm::sincosf(std::f32::consts::TAU * sector as f32 / n as f32);
                mesh.positions.push(Vec3::new(sin_t * cos_p, cos_t, sin_t * sin_p));
            }
        }
        let at = |ring: u32, sector: u32| 2 + (ring - 1) * n + sector % n;
        for s in 0..n {
            mesh.triangles.extend([[0, at(1, s + 1), at(1, s)], [1, at(n - 1, s), at(n - 1, s + 1)]]);
            for r in 1..n - 1 {
                mesh.triangles.push([at(r, s), at(r, s + 1), at(r + 1, s)]);
                mesh.triangles.push([at(r + 1, s), at(r, s + 1), at(r + 1, s + 1)]);
            }
        }
        mesh
    }

    /// Rays from inside a closed mesh to its vertices and to points on its edges all hit, from several origins.
    #[test]
    fn a_closed_mesh_leaks_nowhere() {
        let mesh = ball(60);
        let accel = Accel::build(&[&mesh]).unwrap();
        let mut shot = 0;
        for origin in [Vec3::ZERO, Vec3::new(0.3, -0.2, 0.7), Vec3::new(0.0, 0.9, 0.0), Vec3::new(1e-7, 0.5, -1e-7)] {
            for triangle in &mesh.triangles {
                let [a, b, _] = triangle.map(|vertex| mesh.positions[vertex as usize]);
                for part in [0.0, 0.5, 0.123, 0.999_99] {
                    let ray = Ray::endless(origin, (a + (b - a) * part - origin).normalize());
                    assert!(accel.closest(&ray).is_some(), "{ray:?}");
                    shot += 1;
                }
            }
        }
        assert!(shot > 100_000, "{shot}");
    }

    #[test]
    fn nothing_is_hit_where_there_is_nothing() {
        let empty = Accel::build(&[]).unwrap();
        assert_eq!(empty.closest(&Ray::endless(Vec3::ZERO, Vec3::X)), None);
        let mesh = ball(4);
        let accel = Accel::build(&[&mesh]).unwrap();
        for direction in [Vec3::ZERO, Vec3::NAN, Vec3::splat(f32::INFINITY)] {
            assert_eq!(accel.closest(&Ray::endless(Vec3::ZERO, direction)), None);
        }
        assert_eq!(accel.closest(&Ray::endless(Vec3::NAN, Vec3::X)), None);
    }

    #[test]
    fn equal_triangles_are_distinguished_by_their_order() {
        let mesh = ball(8);
        let accel = Accel::build(&[&mesh, &mesh, &mesh]).unwrap();
        for k in 0..100 {
            let [x, y, z, _] = sobol_burley::sample_4d(k, 0, 0).map(|u| u - 0.5);
            let hit = accel.closest(&Ray::endless(Vec3::ZERO, Vec3::new(x, y, z).normalize())).unwrap();
            assert_eq!(hit.surface, SurfaceIndex(0));
        }
    }

    /// Triangles that shrink towards one corner make a deep tree, so that the stack (short in tests) overflows into its
    /// vector.
    #[test]
    fn deep_trees_are_walked() {
        let mut mesh = TriangleMesh::default();
        for k in 0..120 {
            let size = libm::powf(0.8, k as f32);
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([Vec3::new(size, 0.0, 0.0), Vec3::new(0.0, size, 0.0), Vec3::new(0.0, 0.0, size)]);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        let accel = Accel::build(&[&mesh]).unwrap();
        let ray = Ray::endless(Vec3::ONE, -Vec3::ONE.normalize());
        assert_eq!(accel.closest(&ray), by_testing_all(&accel, &ray));
        assert_eq!(accel.closest(&ray).unwrap().triangle, TriangleIndex(0));
    }

    #[test]
    fn memory_is_what_the_documentation_says() {
        let mesh = ball(60);
        let accel = Accel::build(&[&mesh]).unwrap();
        assert!(accel.memory_bytes() <= 100 * accel.triangle_count(), "{}", accel.memory_bytes());
    }
}
