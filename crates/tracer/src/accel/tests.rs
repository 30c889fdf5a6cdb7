//! Tests of the hierarchy: against testing every triangle, and for leaks in closed meshes.

use proptest::prelude::*;

use super::*;

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
        let expected = accel.closest_by_testing_all(&ray);
        prop_assert_eq!(accel.closest(&ray), expected);
        prop_assert_eq!(accel.occluded(&ray), expected.is_some());
        // The same with `accept`: the lowest of equally near triangles among those accepted.
        let odd = |hit: &Hit| hit.triangle.0 % 2 == 1;
        let refused = accel.closest_where(&ray, odd);
        prop_assert_eq!(accel.occluded_where(&ray, odd), refused.is_some());
        prop_assert!(refused.is_none_or(|hit| expected.is_some_and(|nearest| nearest.distance <= hit.distance)));
        // The answers do not depend on the instructions.
        let portable = accel.with_instructions(InstructionSet::Portable).unwrap();
        prop_assert_eq!(portable.closest(&ray), expected);
        prop_assert_eq!(portable.occluded(&ray), expected.is_some());
        prop_assert_eq!(portable.closest_where(&ray, odd), refused);
        // The rounding of the fast test has no bound that boxes could be padded by, but it is the same for all
        // instructions.
        let portable = portable.with_test(TriangleTest::Fast);
        let found = (portable.closest(&ray), portable.occluded(&ray));
        if let Some(avx2) = portable.with_instructions(InstructionSet::Avx2) {
            prop_assert_eq!((avx2.closest(&ray), avx2.occluded(&ray)), found);
        }
    }

}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// Rays traversed together find the same hits as each alone, for any number of rays, with unusable rays among them.
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
        for instructions in [InstructionSet::Avx2, InstructionSet::Portable] {
            let Some(accel) = Accel::build(&[&mesh]).unwrap().with_instructions(instructions) else { continue };
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
    // The twin: the fast test leaks as often as its documentation states.
    let fast = Accel::build(&[&mesh]).unwrap().with_test(TriangleTest::Fast);
    let mut slipped = 0;
    for origin in [Vec3::ZERO, Vec3::new(0.3, -0.2, 0.7), Vec3::new(0.0, 0.9, 0.0), Vec3::new(1e-7, 0.5, -1e-7)] {
        for triangle in &mesh.triangles {
            let [a, b, _] = triangle.map(|vertex| mesh.positions[vertex as usize]);
            for part in [0.0, 0.5, 0.123, 0.999_99] {
                let ray = Ray::endless(origin, (a + (b - a) * part - origin).normalize());
                assert!(accel.closest(&ray).is_some(), "{ray:?}");
                slipped += u32::from(!fast.occluded(&ray));
                shot += 1;
            }
        }
    }
    assert!(shot > 100_000, "{shot}");
    assert!((50..300).contains(&(slipped * 1000 / shot)), "{slipped} of {shot}");
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

#[test]
fn bad_meshes_are_refused() {
    let sound = ball(4);
    let dangling = TriangleMesh { triangles: vec![[0, 1, 99]], ..sound.clone() };
    let infinite = TriangleMesh { positions: vec![Vec3::INFINITY; 14], ..sound.clone() };
    let mut nan = sound.clone();
    nan.positions[3].y = f32::NAN;
    for mesh in [&dangling, &infinite, &nan] {
        let error = Accel::build(&[&sound, mesh]).unwrap_err();
        assert!(error.to_string().starts_with("invalid scene: surface 1: "), "{error}");
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
    assert_eq!(accel.closest(&ray), accel.closest_by_testing_all(&ray));
    assert_eq!(accel.closest(&ray).unwrap().triangle, TriangleIndex(0));
}

#[test]
fn memory_is_what_the_documentation_says() {
    let mesh = ball(60);
    let accel = Accel::build(&[&mesh]).unwrap();
    assert!(accel.memory_bytes() <= 100 * accel.triangle_count(), "{}", accel.memory_bytes());
}
