//! Source of the BSDFs along a path: the scene's own materials, or others in their place.

use glam::{Vec2, Vec3};

use crate::accel::Hit;
use crate::bsdf::Bsdf;
use crate::surface_hit::SurfaceHit;
use crate::world::World;

/// Supplies BSDFs for `K` material variants. Variants differ in base colour alone, so that one path serves all of them.
pub(crate) trait MaterialSource<'w, const K: usize>: Copy {
    /// Prefetches the memory that [`Self::prefetch_texels`] reads for `hit`.
    fn prefetch(self, hit: &Hit);

    /// Prefetches the texels at `place` and returns the uv to pass to [`Self::bsdf`].
    fn prefetch_texels(self, hit: &Hit, place: &SurfaceHit) -> Vec2;

    /// The BSDF at `place`, seen from `wo`, after `scatterings` earlier scatterings of the path.
    fn bsdf(self, place: &SurfaceHit, uv: Vec2, wo: Vec3, scatterings: u32) -> Bsdf<'w, K>;

    /// Whether a lamp that is hidden from the camera reflects light as well as emitting it. Blender's lamps do not.
    const LAMPS_REFLECT: bool = false;

    /// The radiance that leaves `place` towards `wo`, where it is known without tracing further. Never called
    /// for the first surface of a path.
    fn known_radiance(self, _place: &SurfaceHit, _wo: Vec3) -> Option<Vec3> {
        None
    }
}

/// The scene's own materials, the same for all variants.
#[derive(Clone, Copy)]
pub(crate) struct OwnMaterials<'w>(pub(crate) &'w World);

impl<'w, const K: usize> MaterialSource<'w, K> for OwnMaterials<'w> {
    fn prefetch(self, _: &Hit) {}

    /// Returns zero: a `SurfaceHit` holds the uv of the surface itself.
    fn prefetch_texels(self, _: &Hit, place: &SurfaceHit) -> Vec2 {
        self.0.prefetch_texels(place);
        Vec2::ZERO
    }

    fn bsdf(self, place: &SurfaceHit, _: Vec2, wo: Vec3, _: u32) -> Bsdf<'w, K> {
        self.0.bsdf_of_colors(place, wo)
    }
}
