//! Where a path finds the scattering at a hit: in the scene's own materials, or in others put in their place.

use glam::{Vec2, Vec3};

use crate::accel::Hit;
use crate::bsdf::Bsdf;
use crate::surface_hit::SurfaceHit;
use crate::world::World;

/// Supplies the scattering at hits for `K` variants, which differ in base colour alone: so one path serves all of them.
pub(crate) trait MaterialSource<'w, const K: usize>: Copy {
    /// Asks for the memory that [`Self::prefetch_texels`] reads for `hit`.
    fn prefetch(self, hit: &Hit);

    /// Asks for the texels at `place`, and returns the uv to pass to [`Self::bsdf`].
    fn prefetch_texels(self, hit: &Hit, place: &SurfaceHit) -> Vec2;

    /// The scattering at `place`, seen from `wo`.
    fn bsdf(self, place: &SurfaceHit, uv: Vec2, wo: Vec3) -> Bsdf<'w, K>;
}

/// The scene's own materials, the same for all variants.
#[derive(Clone, Copy)]
pub(crate) struct OwnMaterials<'w>(pub(crate) &'w World);

impl<'w, const K: usize> MaterialSource<'w, K> for OwnMaterials<'w> {
    fn prefetch(self, _: &Hit) {}

    /// The uv is not used: a `SurfaceHit` holds its own.
    fn prefetch_texels(self, _: &Hit, place: &SurfaceHit) -> Vec2 {
        self.0.prefetch_texels(place);
        Vec2::ZERO
    }

    fn bsdf(self, place: &SurfaceHit, _: Vec2, wo: Vec3) -> Bsdf<'w, K> {
        self.0.bsdf_of_colors(place, wo)
    }
}
