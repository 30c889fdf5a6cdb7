//! Unwraps meshes into uv atlases without overlaps.
//!
//! In: a shape, and its copies in a scene, each with a wanted size. Out: each copy with its atlas. Between: an
//! [`AtlasCache`] knows the layouts of earlier builds; where it does not, `packing` cuts the shape into charts and packs
//! them. A layout is apart from the shape's place in a scene, and is carried to the copies.
//!
//! Cutting and packing take most of a build's time, and the same chairs stand in many rooms. A file of the cache that is
//! truncated, edited or of another shape is reported and not used.

mod packing;

use std::path::Path;
use std::sync::Mutex;

use mateval_dataset::TriangleMesh;
use mateval_files::cache::{Cache, Key};
use mateval_files::untrusted::sha256_of_bytes;

pub use packing::{AtlasError, SizeWish, Unwrapped};
use packing::{AtlasLayout, packed};

/// A mesh that is to be unwrapped.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    pub mesh: &'a TriangleMesh,
    pub size: SizeWish,
}

pub fn unwrap(mesh: &TriangleMesh, size: SizeWish) -> Result<Unwrapped, AtlasError> {
    unwrap_copies(mesh, &[Wanted { mesh, size }], None).remove(0)
}

/// Unwraps copies of a shape: meshes with its triangles and the same lengths, which may stand anywhere. A layout is
/// made only where the cache does not hold it.
pub fn unwrap_copies(
    shape: &TriangleMesh,
    copies: &[Wanted<'_>],
    cache: Option<&AtlasCache>,
) -> Vec<Result<Unwrapped, AtlasError>> {
    let cache = cache.map(|cache| (cache, shape_key(shape)));
    let unwrap_copy = |copy: &Wanted<'_>| {
        let known = cache.as_ref().and_then(|(cache, key)| cache.read(key, copy.size, shape));
        let layout = known.unwrap_or_else(|| {
            let made = packed(shape, copy.size);
            if let Some((cache, key)) = &cache {
                cache.keep(key, copy.size, &made);
            }
            made
        })?;
        Ok(layout.unwrapped(copy.mesh))
    };
    copies.iter().map(unwrap_copy).collect()
}

/// What makes layouts. A cache never holds what another version made.
const MAKERS: [&str; 2] = ["uvunwrap 0.2.0", include_str!("packing.rs")];
/// Size of the largest file that is read, in bytes.
const MAX_FILE_BYTES: u64 = 1 << 30;
/// The largest size of a cache, in bytes.
const MOST_BYTES: u64 = 4 << 30;
/// Length of a SHA-256 in hexadecimal digits.
const HASH_DIGITS: usize = 64;

/// A layout, or why there is none.
type Made = Result<AtlasLayout, AtlasError>;

/// The key of a mesh's shape: of its vertices and triangles.
pub fn shape_key(mesh: &TriangleMesh) -> Key {
    let positions = mesh.positions.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes);
    let triangles = mesh.triangles.iter().flatten().flat_map(|vertex| vertex.to_le_bytes());
    let count = (mesh.positions.len() as u64).to_le_bytes();
    Key::of(&count.into_iter().chain(positions).chain(triangles).collect::<Vec<u8>>())
}

/// A folder of layouts. Several processes may use it at once.
#[derive(Debug)]
pub struct AtlasCache {
    cache: Cache,
    makers_sha256: String,
    /// Faults of the cache. They end no build.
    remarks: Mutex<Vec<String>>,
}

impl AtlasCache {
    /// The cache in this folder, which is created once a layout is kept.
    pub fn new(folder: &Path) -> Self {
        let makers_sha256 = sha256_of_bytes(MAKERS.concat().as_bytes());
        Self { cache: Cache::new(folder), makers_sha256, remarks: Mutex::default() }
    }

    /// Removes what was not used for longest until the cache is small enough, and returns every fault since the last
    /// call.
    pub fn finish(&self) -> Vec<String> {
        let folder = self.cache.folder();
        if folder.is_dir()
            && let Err(error) = self.cache.keep_below(MOST_BYTES)
        {
            self.remark(folder, format!("old atlases cannot be removed: {error}"));
        }
        std::mem::take(&mut self.remarks.lock().expect("nothing panics while it is held"))
    }

    /// What an earlier build made of this shape for this wish. `mesh` has the shape.
    fn read(&self, shape: &Key, wish: SizeWish, mesh: &TriangleMesh) -> Option<Made> {
        let key = self.key(shape, wish);
        let path = self.cache.path(&key);
        let bytes = match self.cache.read(&key, MAX_FILE_BYTES) {
            Ok(bytes) => bytes?,
            Err(error) => {
                self.remark(&path, format!("atlas not used: {error}"));
                return None;
            }
        };
        let is_own = |layout: &AtlasLayout| wish.allows(layout.size) && layout.belongs_to(mesh);
        let found = parse(&bytes).filter(|made| made.as_ref().map_or(true, is_own));
        if found.is_none() {
            self.remark(&path, "atlas not used: the file is damaged; it is made again".to_owned());
        }
        found
    }

    /// Keeps what was made of this shape for this wish.
    fn keep(&self, shape: &Key, wish: SizeWish, made: &Made) {
        let key = self.key(shape, wish);
        let content = postcard::to_allocvec(made).expect("atlases are plain numbers");
        let mut bytes = sha256_of_bytes(&content).into_bytes();
        bytes.extend(content);
        if let Err(error) = self.cache.keep(&key, &bytes) {
            self.remark(&self.cache.path(&key), format!("atlas cannot be kept: {error}"));
        }
    }

    fn key(&self, shape: &Key, wish: SizeWish) -> Key {
        Key::of(format!("{}\n{shape}\n{}", self.makers_sha256, wish.key()).as_bytes())
    }

    fn remark(&self, path: &Path, what: String) {
        let line = format!("'{}': {what}", path.display());
        self.remarks.lock().expect("nothing panics while it is held").push(line);
    }
}

/// The content of a file, if it is whole.
fn parse(bytes: &[u8]) -> Option<Made> {
    let (hash, content) = bytes.split_at_checked(HASH_DIGITS)?;
    if sha256_of_bytes(content).as_bytes() != hash {
        return None;
    }
    postcard::from_bytes(content).ok()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use glam::{Quat, Vec2, Vec3};
    use proptest::prelude::*;

    use super::packing::GUTTER;
    use super::*;

    /// A box of the given size with 12 triangles and shared vertices.
    fn cuboid(size: Vec3) -> TriangleMesh {
        let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) * size;
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        TriangleMesh {
            positions: (0..8).map(corner).collect(),
            normals: None,
            uvs: None,
            triangles: quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
        }
    }

    fn texels_of(unwrapped: &Unwrapped, triangle: usize) -> [Vec2; 3] {
        let uvs = unwrapped.mesh.uvs.as_ref().unwrap();
        unwrapped.mesh.triangles[triangle].map(|v| uvs[v as usize] * unwrapped.size as f32)
    }

    #[test]
    fn triangles_keep_their_order_and_place() {
        let mesh = cuboid(Vec3::new(1.0, 0.5, 0.25));
        let unwrapped = unwrap(&mesh, SizeWish::Fixed(256)).unwrap();
        for triangle in 0..12 {
            assert_eq!(unwrapped.mesh.corners(triangle), mesh.corners(triangle));
        }
        assert!(
            unwrapped.mesh.uvs.as_ref().unwrap().iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0)
        );
        assert_eq!(unwrapped.unmapped, 0);
    }

    #[test]
    fn a_chosen_size_is_fine_enough_and_no_finer_than_a_step() {
        let mesh = cuboid(Vec3::new(2.0, 1.0, 1.0));
        for texel_m in [0.05, 0.01, 0.002] {
            let unwrapped = unwrap(&mesh, SizeWish::Texel(texel_m)).unwrap();
            assert!(unwrapped.texel_m <= texel_m * 1.02, "{} for {texel_m}", unwrapped.texel_m);
            assert!(unwrapped.size == 256 || unwrapped.texel_m >= texel_m / 2.5, "{} for {texel_m}", unwrapped.texel_m);
        }
    }

    #[test]
    fn charts_keep_their_distance() {
        let unwrapped = unwrap(&cuboid(Vec3::ONE), SizeWish::Fixed(128)).unwrap();
        let charts = charts_by_uv(&unwrapped);
        let mut least = f32::INFINITY;
        for a in 0..12 {
            for b in 0..a {
                if charts[a] != charts[b] {
                    least = least.min(gap(texels_of(&unwrapped, a), texels_of(&unwrapped, b)));
                }
            }
        }
        assert!(least >= GUTTER as f32 - 0.01 && least.is_finite(), "{least} texels");
    }

    /// Triangles that share a split vertex share a chart.
    fn charts_by_uv(unwrapped: &Unwrapped) -> Vec<usize> {
        let mut chart: Vec<usize> = (0..12).collect();
        for _ in 0..12 {
            for a in 0..12 {
                for b in 0..12 {
                    if unwrapped.mesh.triangles[a].iter().any(|v| unwrapped.mesh.triangles[b].contains(v)) {
                        chart[a] = chart[a].min(chart[b]);
                    }
                }
            }
        }
        chart
    }

    /// The least distance between the edges of two triangles, by sampling.
    fn gap(a: [Vec2; 3], b: [Vec2; 3]) -> f32 {
        let points =
            |t: [Vec2; 3]| (0..3).flat_map(move |k| (0..=50).map(move |i| t[k].lerp(t[(k + 1) % 3], i as f32 / 50.0)));
        points(a).flat_map(|p| points(b).map(move |q| (p - q).length())).fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn degenerate_faces_are_counted_and_placed() {
        let mut mesh = cuboid(Vec3::ONE);
        mesh.triangles.push([0, 0, 1]);
        let unwrapped = unwrap(&mesh, SizeWish::Fixed(128)).unwrap();
        assert_eq!(unwrapped.unmapped, 1);
        let [a, b, c] = texels_of(&unwrapped, 12);
        assert!(a == b && b == c && unwrapped.coverage < 1.0);
        assert!(texels_of(&unwrapped, 12).iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 128.0));
    }

    #[test]
    fn meshes_without_area_are_refused() {
        let flat = TriangleMesh { positions: vec![Vec3::ZERO; 3], triangles: vec![[0, 1, 2]], ..Default::default() };
        assert_eq!(unwrap(&flat, SizeWish::Fixed(64)).unwrap_err(), AtlasError::NoArea);
        assert_eq!(unwrap(&TriangleMesh::default(), SizeWish::Fixed(64)).unwrap_err(), AtlasError::NoArea);
    }

    #[test]
    fn the_result_is_deterministic() {
        let unwrap_once = || unwrap(&cuboid(Vec3::new(1.0, 2.0, 3.0)), SizeWish::Texel(0.01)).unwrap();
        assert_eq!(unwrap_once().mesh, unwrap_once().mesh);
    }

    /// Charts are cut and packed for the shape, so that all copies have the same uv, and each stands in its own place.
    #[test]
    fn copies_share_their_layout() {
        let shape = cells(30, 0.4, 0.2);
        let moved = |angle: f32| {
            let positions = shape.positions.iter().map(|p| Quat::from_rotation_y(angle) * *p + Vec3::X).collect();
            TriangleMesh { positions, ..shape.clone() }
        };
        let copies = [moved(0.3), moved(1.2)];
        let [fixed, fine, coarse] = [SizeWish::Fixed(256), SizeWish::Texel(0.004), SizeWish::Texel(0.1)];
        let wanted =
            [(0, fixed), (1, fixed), (0, fine), (1, coarse)].map(|(at, size)| Wanted { mesh: &copies[at], size });
        let made: Vec<Unwrapped> = unwrap_copies(&shape, &wanted, None).into_iter().map(Result::unwrap).collect();
        assert_eq!(made[0].mesh.uvs, made[1].mesh.uvs);
        assert_eq!(
            (made[3].size, &made[3].mesh.uvs),
            (made[0].size, &made[0].mesh.uvs),
            "the size decides, and not the wish"
        );
        for (unwrapped, Wanted { mesh, .. }) in made.iter().zip(wanted) {
            assert!((0..mesh.triangles.len()).all(|at| unwrapped.mesh.corners(at) == mesh.corners(at)));
        }
        assert!(made[2].size > made[3].size, "each has the size that it asks for");
    }

    /// A sheet of cells, each separate from its neighbours and turned in another direction, so that each is a chart.
    fn cells(count: u32, length: f32, width: f32) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for at in 0..count {
            let (first, turn) = (4 * at, Quat::from_rotation_y(0.7 * at as f32));
            let corner = |x: f32, z: f32| turn * Vec3::new(x, 0.0, z) + Vec3::Y * (at as f32 * 0.1);
            mesh.positions.extend([corner(0.0, 0.0), corner(0.0, width), corner(length, width), corner(length, 0.0)]);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
        mesh
    }

    /// A band around the Y axis, open at both rims.
    fn hoop(corners: u32, height: f32) -> TriangleMesh {
        let angle = |at: u32| at as f32 / corners as f32 * std::f32::consts::TAU;
        let at = |at: u32, y: f32| Vec3::new(angle(at).cos(), y, angle(at).sin());
        TriangleMesh {
            positions: (0..corners).flat_map(|k| [at(k, 0.0), at(k, height)]).collect(),
            triangles: (0..corners)
                .map(|k| [2 * k, 2 * k + 1, 2 * ((k + 1) % corners), 2 * ((k + 1) % corners) + 1])
                .flat_map(|[a, b, c, d]| [[a, b, c], [c, b, d]])
                .collect(),
            ..Default::default()
        }
    }

    /// Triangles that intersect each other, some of them repeated, some with only one distinct corner.
    fn soup(corners: &[[f32; 3]], count: u32, size: Vec3) -> TriangleMesh {
        let corner = |at: u32| at.wrapping_mul(2_654_435_761).rotate_left(9) % corners.len() as u32;
        TriangleMesh {
            positions: corners.iter().map(|corner| Vec3::from_array(*corner) * size).collect(),
            triangles: (0..count).map(|at| [3 * at, 3 * at + 1, 3 * at + 2].map(corner)).collect(),
            ..Default::default()
        }
    }

    /// The wish of a camera close to a wall.
    #[test]
    fn a_wish_beyond_the_largest_atlas_gets_the_largest() {
        let wall = || cuboid(Vec3::new(4.0, 2.6, 0.1));
        let extreme = [wall(), cells(40, 1.0, 1.0), cells(200, 2.0, 0.01), hoop(64, 0.01)].map(|mesh| (mesh, 1e-12));
        for (mesh, texel_m) in extreme.into_iter().chain([(wall(), 1e-5)]) {
            let unwrapped = unwrap(&mesh, SizeWish::Texel(texel_m)).unwrap();
            assert_eq!(unwrapped.size, 4096);
            assert!(unwrapped.texel_m > texel_m);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        /// Every wish for every shape has a result in which each triangle has its place, or one of the expected errors.
        #[test]
        fn every_wish_has_an_answer(
            kind in 0..4,
            soup in prop::collection::vec([-1.0_f32..1.0, -1.0..1.0, -1.0..1.0], 3..60),
            count in 1_u32..120,
            sides in [-3.0_f32..2.0, -3.0_f32..2.0, -3.0_f32..2.0],
            wish in -13.0_f64..2.0,
            fixed in prop::option::of(64_u32..=2048),
        ) {
            let [x, y, z] = sides.map(|side| 10.0_f32.powf(side));
            let mesh = match kind {
                0 => cuboid(Vec3::new(x, y, z)),
                1 => cells(count, x, y),
                2 => hoop(count.max(3), y),
                _ => self::soup(&soup, count, Vec3::new(x, y, z)),
            };
            let wish = fixed.map_or(SizeWish::Texel(10.0_f64.powf(wish)), SizeWish::Fixed);
            match unwrap(&mesh, wish) {
                Ok(unwrapped) => {
                    let size = unwrapped.size;
                    prop_assert!(SizeWish::Fixed(size) == wish || (256..=4096).contains(&size));
                    let uvs = unwrapped.mesh.uvs.unwrap();
                    prop_assert!(uvs.iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0));
                    prop_assert!(unwrapped.coverage <= 1.0);
                }
                Err(AtlasError::DoesNotFit { .. } | AtlasError::NoArea) => {}
                Err(error) => prop_assert!(false, "{error}"),
            }
        }
    }

    /// A curved patch with a triangle of edges of 3.6, 4.7 and 8.3 cm and an area of 2.5e-10 m2 at one of its corners.
    #[test]
    fn a_nearly_degenerate_triangle_takes_no_texels() {
        const SIDE: u32 = 16;
        let mut mesh = TriangleMesh::default();
        for (row, column) in (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column))) {
            let [x, z] = [column, row].map(|at| 0.3 * (at as f32 / (SIDE - 1) as f32 - 0.5));
            mesh.positions.push(Vec3::new(x, 0.2 * (1.0 - 8.0 * (x * x + z * z)), z));
        }
        for (row, column) in (0..SIDE - 1).flat_map(|row| (0..SIDE - 1).map(move |column| (row, column))) {
            let corner = row * SIDE + column;
            mesh.triangles.push([corner, corner + SIDE, corner + 1]);
            mesh.triangles.push([corner + 1, corner + SIDE, corner + SIDE + 1]);
        }
        let sound = packed(&mesh, SizeWish::Fixed(256)).unwrap();
        let (first, place) = (mesh.positions.len() as u32, mesh.positions[0]);
        let along = Vec3::new(-0.6, 0.0, -0.8);
        mesh.positions.extend([place + 0.083 * along, place + 0.036 * along + Vec3::new(0.0, 6e-9, 0.0)]);
        mesh.triangles.push([0, first, first + 1]);
        let layout = packed(&mesh, SizeWish::Fixed(256)).unwrap();
        assert_eq!(layout.triangles.len(), mesh.triangles.len());
        let texels = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|vertex| layout.uvs[vertex as usize]);
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs() / 2.0 * 65536.0
        };
        assert!(texels(layout.triangles.last().unwrap()) < 2.0);
        let area = mesh.area();
        assert!((layout.texel_m(area) / sound.texel_m(area) - 1.0).abs() < 0.1);
        // Every triangle names its own vertices.
        for (placed, own) in layout.triangles.iter().zip(&mesh.triangles) {
            assert_eq!(placed.map(|vertex| layout.source_vertices[vertex as usize]), *own);
        }
    }

    fn files(folder: &Path) -> Vec<PathBuf> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    #[test]
    fn a_layout_is_made_once_and_a_damaged_file_is_reported_and_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let cache = AtlasCache::new(&folder.path().join("atlases"));
        let mesh = cuboid(Vec3::new(1.0, 0.5, 0.25));
        let unwrap = || {
            let copies = [Wanted { mesh: &mesh, size: SizeWish::Fixed(512) }];
            unwrap_copies(&mesh, &copies, Some(&cache)).remove(0).unwrap().mesh
        };
        let first = unwrap();
        let kept = files(cache.cache.folder());
        assert_eq!(kept.len(), 1);
        assert_eq!(unwrap(), first);
        assert_eq!(cache.finish(), Vec::<String>::new());

        for path in kept {
            let whole = std::fs::read(&path).unwrap();
            for damaged in [&whole[..whole.len() - 1], &whole[1..], b"", &[0; 200]] {
                std::fs::write(&path, damaged).unwrap();
                assert_eq!(unwrap(), first);
                let remarks = cache.finish();
                assert!(remarks.len() == 1 && remarks[0].contains("damaged"), "{remarks:?}");
                assert_eq!(std::fs::read(&path).unwrap(), whole);
            }
        }
    }

    /// An edited file whose hash was edited too.
    #[test]
    fn a_layout_of_another_shape_is_not_used() {
        let folder = tempfile::tempdir().unwrap();
        let cache = AtlasCache::new(folder.path());
        let mesh = cuboid(Vec3::ONE);
        let fewer = TriangleMesh { triangles: mesh.triangles[1..].to_vec(), ..mesh.clone() };
        let [small, large] = [256, 512].map(SizeWish::Fixed);
        let made = packed(&fewer, small);
        let key = shape_key(&mesh);
        cache.keep(&key, small, &made);
        assert_eq!(cache.read(&key, small, &fewer), Some(made));
        assert_eq!(cache.read(&key, small, &mesh), None);
        assert_eq!(cache.read(&key, large, &fewer), None, "the size is part of the name");
        assert_eq!(cache.finish().len(), 1);

        // A size that would take all memory.
        let made = cache.read(&key, small, &fewer).unwrap().map(|layout| AtlasLayout { size: 1 << 30, ..layout });
        cache.keep(&key, small, &made);
        assert_eq!(cache.read(&key, small, &fewer), None);
        assert_eq!(cache.finish().len(), 1);
    }

    #[test]
    fn a_cache_that_cannot_be_written_is_reported() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let cache = AtlasCache::new(file.path());
        let mesh = cuboid(Vec3::ONE);
        let copies = [Wanted { mesh: &mesh, size: SizeWish::Fixed(256) }];
        unwrap_copies(&mesh, &copies, Some(&cache)).remove(0).unwrap();
        assert!(cache.finish().iter().any(|remark| remark.contains("cannot be kept")));
    }
}
