//! Layouts of atlases that earlier builds have made, by the hash of everything that they depend on.
//!
//! Cutting and packing take most of a build's time, and the same chairs stand in many rooms. A file that is truncated,
//! edited or of another shape is reported and not used.

use std::path::Path;
use std::sync::Mutex;

use mateval_dataset::TriangleMesh;
use mateval_files::cache::{Cache, Key};
use mateval_files::untrusted::sha256_of_bytes;

use super::packing::{AtlasError, AtlasLayout, SizeWish};

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
    /// Faults of the cache, none of which ends a build.
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
    pub(super) fn read(&self, shape: &Key, wish: SizeWish, mesh: &TriangleMesh) -> Option<Made> {
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
    pub(super) fn keep(&self, shape: &Key, wish: SizeWish, made: &Made) {
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

    use super::super::tests::cuboid;
    use super::super::{Wanted, packed, unwrap_copies};
    use super::*;

    fn files(folder: &Path) -> Vec<PathBuf> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    #[test]
    fn a_layout_is_made_once_and_a_damaged_file_is_reported_and_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let cache = AtlasCache::new(&folder.path().join("atlases"));
        let mesh = cuboid(glam::Vec3::new(1.0, 0.5, 0.25));
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
        let mesh = cuboid(glam::Vec3::ONE);
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
        let mesh = cuboid(glam::Vec3::ONE);
        let copies = [Wanted { mesh: &mesh, size: SizeWish::Fixed(256) }];
        unwrap_copies(&mesh, &copies, Some(&cache)).remove(0).unwrap();
        assert!(cache.finish().iter().any(|remark| remark.contains("cannot be kept")));
    }
}
