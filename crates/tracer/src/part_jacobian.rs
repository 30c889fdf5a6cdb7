//! How a picture changes with the base colours of surfaces: one derivative for each block of pixels, surface and
//! channel.
//!
//! In: a world with its own materials, a camera, the size of blocks. Out: a [`PartJacobian`], from one render whose
//! paths keep their history. The derivatives are exact for the light that the paths gather: nothing that a path decides
//! depends on base colours, so that a render of the same seed is a smooth function of them. Their expectation is the
//! derivative of the light of the scene (Nimier-David et al., "Radiative Backpropagation", SIGGRAPH 2020; Vicini et
//! al., "Path Replay Backpropagation", SIGGRAPH 2021).

use mateval_image::{LinearRgb, Picture};
use mateval_scene::Camera;
use mateval_scene::reference::SurfaceIndex;

use crate::derivative_pass::{self, ENTRY_BYTES, MOST_BYTES};
use crate::error::{ExceededLimit, RequestFault, TracerError};
use crate::settings::RenderSettings;
use crate::world::World;

/// The derivatives of blocks of pixels by the base colours of surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct PartJacobian {
    /// The picture of the same paths, in linear radiance; [`crate::render()`] makes the same up to rounding.
    pub picture: Picture<LinearRgb>,
    blocks: [usize; 2],
    surfaces: usize,
    /// Block by block, row by row; for each block one entry per surface.
    values: Vec<[f32; 3]>,
}

impl PartJacobian {
    /// Columns and rows of blocks. Those at the right and lower edge may be smaller than the others.
    pub fn blocks(&self) -> [usize; 2] {
        self.blocks
    }

    /// The number of surfaces, which is the world's.
    pub fn surfaces(&self) -> usize {
        self.surfaces
    }

    /// The derivative of the mean linear radiance of the block in column `block[0]`, row `block[1]`, by the linear base
    /// colour of `surface`, per channel. Each channel depends on the same channel of base colours alone.
    ///
    /// Where the base colour varies over the surface, the derivative is that of adding the same number everywhere. A
    /// surface without a base colour (a conductor, a dielectric) has the derivative 0.
    ///
    /// # Panics
    ///
    /// If the block or the surface does not exist.
    pub fn at(&self, block: [usize; 2], surface: SurfaceIndex) -> [f32; 3] {
        let ([columns, rows], [x, y]) = (self.blocks, block);
        assert!(x < columns && y < rows && surface.0 < self.surfaces, "no block {block:?} or surface {surface:?}");
        self.values[(y * columns + x) * self.surfaces + surface.0]
    }
}

/// The derivatives of what `camera` sees, in blocks of `block` x `block` pixels, by the base colour of each surface of
/// `world`: the reflectance of diffuse surfaces, the `diffuse_reflectance` of plastic, the `base_color` of principled
/// materials. `progress` is called from any thread with the number of finished batches of tiles and their total.
///
/// The bytes are the same for any number of threads in the current rayon pool. A channel of a base colour below 1e-12
/// counts as 1e-12. Fails if a setting is out of range, if `block` is 0, if the world has stage lights, or if the
/// derivatives would take more than 1 GiB.
pub fn part_jacobian(
    world: &World,
    camera: &Camera,
    block: usize,
    settings: &RenderSettings,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<PartJacobian, TracerError> {
    // Check everything before memory is taken.
    derivative_pass::check(world, settings)?;
    if block == 0 {
        return Err(RequestFault::BlockSize(block).into());
    }
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let [columns, rows] = [width, height].map(|size| size.div_ceil(block));
    let surfaces = world.scene().surfaces.len();
    let entries = (columns as u64).saturating_mul(rows as u64).saturating_mul(surfaces as u64);
    let bytes = entries.saturating_mul(ENTRY_BYTES);
    if bytes > MOST_BYTES {
        return Err(
            ExceededLimit::JacobianBytes { blocks: [columns, rows], surfaces, bytes, allowed: MOST_BYTES }.into()
        );
    }
    // Sum the derivatives of all samples.
    let mut sums = vec![[0.0_f64; 3]; columns * rows * surfaces];
    let block_of = |pixel: usize| pixel / width / block * columns + pixel % width / block;
    let add = |derivative: &derivative_pass::PixelDerivative| {
        let sum = &mut sums[block_of(derivative.pixel) * surfaces + derivative.surface.0];
        sum.iter_mut().zip(derivative.value.to_array()).for_each(|(sum, value)| *sum += f64::from(value));
    };
    let picture = derivative_pass::trace(world, camera, settings, add, progress);
    // Divide by the samples of each block.
    let size = |at: usize, whole: usize| block.min(whole - at * block);
    let values = sums.iter().enumerate().map(|(entry, sum)| {
        let at = entry / surfaces;
        let pixels = size(at % columns, width) * size(at / columns, height);
        let samples = pixels as f64 * f64::from(settings.samples);
        sum.map(|value| (value / samples) as f32)
    });
    let values = values.collect();
    Ok(PartJacobian { picture, blocks: [columns, rows], surfaces, values })
}
