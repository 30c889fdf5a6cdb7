//! Unwraps meshes into uv atlases without overlaps.
//!
//! In: a shape, and its copies in a scene, each with a wanted size. Out: each copy with its atlas. Between: [`cache`] knows
//! the layouts of earlier builds, `packing` cuts the shape into charts and packs them, `layout` carries a layout to the
//! copies.

pub mod cache;
mod layout;
mod packing;

use mateval_scene::TriangleMesh;

use cache::{AtlasCache, ShapeKey};
pub use layout::Unwrapped;
use packing::packed;
pub use packing::{AtlasError, CHOSEN_SIZES, GUTTER, SizeWish};

/// A mesh that is to be unwrapped.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// The mesh.
    pub mesh: &'a TriangleMesh,
    /// The size of its atlas.
    pub size: SizeWish,
}

/// Unwraps a mesh.
pub fn unwrap(mesh: &TriangleMesh, size: SizeWish) -> Result<Unwrapped, AtlasError> {
    unwrap_copies(mesh, &[Wanted { mesh, size }], None).remove(0)
}

/// Unwraps copies of a shape: meshes with its triangles and the same lengths, which may stand anywhere. A layout is made
/// only where the cache does not hold it.
pub fn unwrap_copies(
    shape: &TriangleMesh,
    copies: &[Wanted<'_>],
    cache: Option<&AtlasCache>,
) -> Vec<Result<Unwrapped, AtlasError>> {
    let cache = cache.map(|cache| (cache, ShapeKey::of(shape)));
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

#[cfg(test)]
mod tests;
