//! The secret of redressed rooms: a key, a private folder of tileable materials, and numbers drawn with the key.
//!
//! Both lie outside of everything that may be published: of the dataset, and of the folder that the recipe's paths are
//! relative to.

use std::path::{Path, PathBuf};

use hmac::{Hmac, KeyInit, Mac};
use mateval_dataset::SceneId;
use mateval_dataset::material::MaterialClass;
use mateval_files::untrusted::{hex, read_at_most};
use mateval_sources::front3d::class_named;
use sha2::Sha256;

/// The fewest bytes of a key.
const LEAST_KEY: usize = 32;
const MOST_KEY: u64 = 1 << 20;

/// Why a scene cannot be redressed with a key and a folder.
#[derive(Debug, thiserror::Error)]
pub enum SecretFault {
    #[error("redress: '{}' cannot be read: {source}; correct its path", path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error(
        "redress: the key '{}' has {found} bytes; expected {LEAST_KEY} or more random ones, as \
         `head -c 32 /dev/urandom > FILE` makes them",
        path.display()
    )]
    ShortKey { path: PathBuf, found: usize },
    #[error(
        "redress: '{}' lies in '{}', which may be published; keep keys and materials elsewhere",
        path.display(), folder.display()
    )]
    Public { path: PathBuf, folder: PathBuf },
    #[error(
        "redress: '{}' holds no material; expected a folder for each, named after its class and with a picture whose name \
         ends with `_Color`, as in `Wood049/Wood049_Color.png`",
        path.display()
    )]
    NoMaterials { path: PathBuf },
}

/// A tileable material of the private folder.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TileFiles {
    name: String,
    pub(super) class: MaterialClass,
    /// Whether its name says that it belongs on floors.
    pub(super) is_for_floors: bool,
    pub(super) color: PathBuf,
    pub(super) roughness: Option<PathBuf>,
    pub(super) metalness: Option<PathBuf>,
}

/// A key and the materials that are drawn with it.
#[derive(Clone)]
pub(crate) struct RedressKey {
    mac: Hmac<Sha256>,
    /// Sorted by name; empty where no folder is given.
    pub(super) tiles: Vec<TileFiles>,
}

impl RedressKey {
    /// Reads the key and lists the folder of materials. Neither may lie in one of the `public` folders.
    pub(crate) fn open(key: &Path, materials: Option<&Path>, public: &[&Path]) -> Result<Self, SecretFault> {
        for path in std::iter::once(key).chain(materials) {
            check_private(path, public)?;
        }
        let unreadable = |path: &Path| {
            let path = path.to_owned();
            |source| SecretFault::Unreadable { path, source }
        };
        let bytes = read_at_most(key, MOST_KEY).map_err(unreadable(key))?;
        if bytes.len() < LEAST_KEY {
            return Err(SecretFault::ShortKey { path: key.to_owned(), found: bytes.len() });
        }
        let tiles = materials.map(|folder| list_tiles(folder).map_err(unreadable(folder))).transpose()?;
        if let (Some(folder), Some([])) = (materials, tiles.as_deref()) {
            return Err(SecretFault::NoMaterials { path: folder.to_owned() });
        }
        let mac = Hmac::new_from_slice(&bytes).expect("a key of HMAC may have any length");
        Ok(Self { mac, tiles: tiles.unwrap_or_default() })
    }

    /// Changes with the key and with the names and sizes of the materials' pictures, and reveals neither.
    pub(crate) fn fingerprint(&self) -> String {
        let mut mac = self.mac.clone();
        mac.update(b"mateval fingerprint");
        for tile in &self.tiles {
            for path in [Some(&tile.color), tile.roughness.as_ref(), tile.metalness.as_ref()].into_iter().flatten() {
                let size = std::fs::metadata(path).map_or(0, |data| data.len());
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                mac.update(format!("\0{}/{name} {size}", tile.name).as_bytes());
            }
        }
        hex(&mac.finalize().into_bytes())
    }

    /// The numbers of a part of a scene.
    pub(super) fn draw(&self, scene: &SceneId, part: &str) -> Draw {
        let mut mac = self.mac.clone();
        mac.update(format!("mateval redress\0{scene}\0{part}\0").as_bytes());
        Draw { mac, count: 0 }
    }
}

/// A sequence of numbers that nobody can predict without the key.
pub(super) struct Draw {
    mac: Hmac<Sha256>,
    count: u32,
}

impl Draw {
    /// From 0 up to 1.
    fn unit(&mut self) -> f64 {
        let mut mac = self.mac.clone();
        mac.update(&self.count.to_le_bytes());
        self.count += 1;
        let bytes = mac.finalize().into_bytes();
        let bits = u64::from_le_bytes(bytes[..8].try_into().expect("a SHA-256 has 32 bytes"));
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(super) fn between(&mut self, [least, most]: [f64; 2]) -> f64 {
        least + (most - least) * self.unit()
    }

    /// One of a list that is not empty.
    pub(super) fn one<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[(self.unit() * all.len() as f64) as usize]
    }
}

fn check_private(path: &Path, public: &[&Path]) -> Result<(), SecretFault> {
    // A path that does not exist is reported where it is read.
    let Ok(resolved) = path.canonicalize() else { return Ok(()) };
    let holds = |folder: &&&Path| folder.canonicalize().is_ok_and(|folder| resolved.starts_with(folder));
    let found = public.iter().find(holds);
    found.map_or(Ok(()), |folder| {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        Err(SecretFault::Public { path: path.to_owned(), folder: folder.to_owned() })
    })
}

fn list_tiles(folder: &Path) -> std::io::Result<Vec<TileFiles>> {
    let mut tiles = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            tiles.extend(tile_files(&path)?);
        }
    }
    tiles.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(tiles)
}

/// The material of a folder; none for folders without a picture of colours or with a name of no class.
fn tile_files(folder: &Path) -> std::io::Result<Option<TileFiles>> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut files = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    files.sort();
    let with_ending = |ending: &str| {
        let has = |path: &&PathBuf| path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with(ending));
        files.iter().find(has).cloned()
    };
    let word = name.to_lowercase();
    let is_any = |words: &[&str]| words.iter().any(|part| word.contains(part));
    let class = match () {
        () if is_any(&["paintedwood", "paintedmetal"]) => Some(MaterialClass::Lacquer),
        () if is_any(&["plank", "parquet"]) => Some(MaterialClass::Wood),
        () if is_any(&["travertine", "terrazzo", "onyx"]) => Some(MaterialClass::Stone),
        () => class_named(&word),
    };
    let (Some(color), Some(class)) = (with_ending("_Color"), class) else { return Ok(None) };
    let is_for_floors = is_any(&["floor", "plank", "parquet", "tile", "carpet"]);
    let (roughness, metalness) = (with_ending("_Roughness"), with_ending("_Metalness"));
    Ok(Some(TileFiles { name, class, is_for_floors, color, roughness, metalness }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with a key and, beside it, a public folder.
    fn folders() -> (tempfile::TempDir, PathBuf, PathBuf) {
        let root = tempfile::tempdir().unwrap();
        let (key, public) = (root.path().join("key"), root.path().join("public"));
        std::fs::create_dir(&public).unwrap();
        std::fs::write(&key, [7; 32]).unwrap();
        (root, key, public)
    }

    #[test]
    fn keys_are_long_and_private() {
        let (_root, key, public) = folders();
        let refused = |path: &Path| RedressKey::open(path, None, &[&public]).err().map(|fault| fault.to_string());
        assert_eq!(refused(&key), None);
        std::fs::copy(&key, public.join("key")).unwrap();
        assert!(refused(&public.join("key")).unwrap().contains("which may be published"));
        assert!(refused(&key.with_extension("none")).unwrap().contains("cannot be read"));
        for length in [0, 31] {
            std::fs::write(&key, vec![1; length]).unwrap();
            assert!(refused(&key).unwrap().contains(&format!("has {length} bytes; expected 32 or more")));
        }
    }

    #[test]
    fn draws_follow_from_key_scene_and_part() {
        let (_root, key, public) = folders();
        let scene = |name: &str| SceneId::new(name).unwrap();
        let numbers = |secret: &RedressKey, id: &str, part: &str| {
            let mut draw = secret.draw(&scene(id), part);
            [(); 100].map(|()| draw.unit())
        };
        let secret = RedressKey::open(&key, None, &[&public]).unwrap();
        let first = numbers(&secret, "a", "p");
        assert_eq!(first, numbers(&secret.clone(), "a", "p"));
        assert!(first.iter().all(|number| (0.0..1.0).contains(number)));
        let mean = first.iter().sum::<f64>() / 100.0;
        assert!((mean - 0.5).abs() < 0.1, "{mean}");
        std::fs::write(&key, [8; 32]).unwrap();
        let other = RedressKey::open(&key, None, &[]).unwrap();
        for numbers in [numbers(&secret, "b", "p"), numbers(&secret, "a", "q"), numbers(&other, "a", "p")] {
            assert_ne!(first, numbers);
        }
        assert_ne!(secret.fingerprint(), other.fingerprint());
    }

    #[test]
    fn materials_have_the_class_of_their_name() {
        let (root, key, _) = folders();
        let folder = root.path().join("materials");
        std::fs::create_dir(&folder).unwrap();
        let open = || RedressKey::open(&key, Some(&folder), &[]);
        assert!(open().err().unwrap().to_string().contains("holds no material"));
        for (name, file) in [
            ("WoodFloor043", "WoodFloor043_1K_Color.jpg"),
            ("Fabric006", "Fabric006_Color.png"),
            ("Wood001", "Wood001_Displacement.png"),
            ("Grass004", "Grass004_Color.png"),
        ] {
            std::fs::create_dir(folder.join(name)).unwrap();
            std::fs::write(folder.join(name).join(file), "").unwrap();
        }
        std::fs::write(folder.join("Fabric006/Fabric006_Roughness.png"), "").unwrap();
        let tiles = open().unwrap().tiles;
        let found: Vec<_> =
            tiles.iter().map(|t| (t.name.as_str(), t.class, t.is_for_floors, t.roughness.is_some())).collect();
        let expected =
            [("Fabric006", MaterialClass::Cloth, false, true), ("WoodFloor043", MaterialClass::Wood, true, false)];
        assert_eq!(found, expected);
    }
}
