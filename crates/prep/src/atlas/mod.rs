//! Unwraps meshes into uv atlases without overlaps, by xatlas.
//!
//! In: a shape, and its copies in a scene, each with a wanted size. Out: each copy with its atlas. Between: [`cache`] knows
//! the layouts of earlier builds, `charts` cuts the shape and packs its charts at the scale that `scale_search` finds,
//! `layout` carries a layout to the copies.

pub mod cache;
mod charts;
mod error;
mod layout;
mod scale_search;
mod size;

use mateval_scene::TriangleMesh;

use cache::{AtlasCache, ShapeKey};
use charts::with_charts;
pub use error::{AtlasError, Refusal};
pub use layout::Unwrapped;
pub use size::{CHOSEN_SIZES, GUTTER, SizeWish};

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

/// Unwraps copies of a shape: meshes with its triangles and the same lengths, which may stand anywhere. Charts are cut at
/// most once, and not at all where the cache holds every layout that is needed.
pub fn unwrap_copies(
    shape: &TriangleMesh,
    copies: &[Wanted<'_>],
    cache: Option<&AtlasCache>,
) -> Vec<Result<Unwrapped, AtlasError>> {
    let cache = cache.map(|cache| (cache, ShapeKey::of(shape)));
    let known = |copy: &Wanted<'_>| {
        let (cache, key) = cache.as_ref()?;
        let layout = cache.read(key, copy.size, shape)?;
        Some(layout.map(|layout| layout.unwrapped(copy.mesh)))
    };
    let mut all: Vec<Option<Result<Unwrapped, AtlasError>>> = copies.iter().map(known).collect();
    if all.iter().any(Option::is_none) {
        let made = with_charts(shape, |charts| {
            for (copy, unwrapped) in copies.iter().zip(&mut all).filter(|(_, unwrapped)| unwrapped.is_none()) {
                let layout = charts.packed(copy.size);
                if let Some((cache, key)) = &cache {
                    cache.keep(key, copy.size, &layout);
                }
                *unwrapped = Some(layout.map(|layout| layout.unwrapped(copy.mesh)));
            }
        });
        if let Err(error) = made {
            all = vec![Some(Err(error)); copies.len()];
        }
    }
    all.into_iter().map(|unwrapped| unwrapped.expect("all were found or made")).collect()
}

#[cfg(test)]
mod tests;
