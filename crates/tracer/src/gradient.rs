//! The gradient of a loss of a picture by the texels of base colours.
//!
//! In: a world with its own materials, a camera, and the derivative of the loss by each pixel. Out: a
//! [`TexelGradient`], the derivative of the loss by each texel of the surfaces' base colours, from one render whose
//! paths keep their history (Nimier-David et al., "Radiative Backpropagation", SIGGRAPH 2020; Vicini et al., "Path
//! Replay Backpropagation", SIGGRAPH 2021).
//!
//! The picture enters a loss such as the squared error twice, in its derivative by the pixel and in the pixel's own
//! derivative. The gradient has the right expectation if both come from different seeds: render with one, and pass the
//! residual to [`gradient`] with another.

use mateval_image::{LinearRgb, Picture, TexelGrid};
use mateval_scene::Camera;
use mateval_scene::reference::{Surface, SurfaceIndex};

use crate::derivative_pass::{self, ENTRY_BYTES, MOST_BYTES, PixelDerivative};
use crate::error::{ExceededLimit, RequestFault, TracerError};
use crate::settings::RenderSettings;
use crate::world::World;

/// The gradient by texels.
#[derive(Clone, Debug, PartialEq)]
pub struct TexelGradient {
    /// The picture of the same paths, in linear radiance; [`crate::render()`] makes the same up to rounding.
    pub picture: Picture<LinearRgb>,
    /// For each surface with a grid, the derivative of the loss by the linear base colour of each texel, row by row
    /// from the top left as in a texture.
    pub texels: Vec<Option<Picture<LinearRgb>>>,
}

/// The gradient of a loss by the texels of the base colours of `world`. `residual` is the derivative of the loss by the
/// linear radiance of each pixel of `camera`. `grids` holds one entry per surface; a surface without a grid has no
/// gradient. `progress` is called from any thread with the number of finished batches of tiles and their total.
///
/// The gradient is that by a texture with this grid that is looked up at the uv of the surface's mesh, bilinearly. Base
/// colours are those of [`crate::part_jacobian()`]; the world's own may come from textures of any size, or constants.
///
/// The bytes are the same for any number of threads in the current rayon pool. Fails if a setting is out of range, if
/// `residual` has another size than the view or holds a number that is not finite, if there is not one grid entry per
/// surface, if a grid is empty or its surface has no uv, if the world has stage lights, or if the derivatives would
/// take more than 1 GiB.
pub fn gradient(
    world: &World,
    camera: &Camera,
    residual: &Picture<LinearRgb>,
    grids: &[Option<TexelGrid>],
    settings: &RenderSettings,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<TexelGradient, TracerError> {
    derivative_pass::check(world, settings)?;
    check_residual(camera, residual)?;
    check_grids(&world.scene().surfaces, grids)?;
    // Spread the derivatives over the texels.
    let empty = |grid: &TexelGrid| vec![[0.0_f64; 3]; grid.width * grid.height];
    let mut sums: Vec<_> = grids.iter().map(|grid| grid.as_ref().map(|grid| (*grid, empty(grid)))).collect();
    let samples = f64::from(settings.samples);
    let add = |derivative: &PixelDerivative| {
        let Some((grid, sums)) = &mut sums[derivative.surface.0] else { return };
        let residual = residual.pixels()[derivative.pixel].0;
        let by_color = derivative.value.to_array();
        let loss: [f64; 3] = std::array::from_fn(|c| f64::from(residual[c]) * f64::from(by_color[c]) / samples);
        for (texel, weight) in grid.taps(derivative.uv.to_array()) {
            sums[texel].iter_mut().zip(loss).for_each(|(sum, loss)| *sum += f64::from(weight) * loss);
        }
    };
    let picture = derivative_pass::trace(world, camera, settings, add, progress);
    // Round the sums.
    let texels = sums.into_iter().map(|surface| {
        let (grid, sums) = surface?;
        Some(Picture::from_fn(grid.width, grid.height, |x, y| LinearRgb(sums[y * grid.width + x].map(|v| v as f32))))
    });
    Ok(TexelGradient { picture, texels: texels.collect() })
}

fn check_residual(camera: &Camera, residual: &Picture<LinearRgb>) -> Result<(), RequestFault> {
    let expected = [camera.intrinsics.width as usize, camera.intrinsics.height as usize];
    let found = [residual.width(), residual.height()];
    if found != expected {
        return Err(RequestFault::PictureSize { found, expected });
    }
    let is_finite = |pixel: &LinearRgb| pixel.0.iter().all(|value| value.is_finite());
    match residual.pixels().iter().position(|pixel| !is_finite(pixel)) {
        Some(at) => Err(RequestFault::Residual { pixel: [at % expected[0], at / expected[0]] }),
        None => Ok(()),
    }
}

fn check_grids(surfaces: &[Surface], grids: &[Option<TexelGrid>]) -> Result<(), TracerError> {
    if grids.len() != surfaces.len() {
        return Err(RequestFault::GridCount { found: grids.len(), expected: surfaces.len() }.into());
    }
    let mut bytes = 0_u64;
    for (index, (surface, grid)) in surfaces.iter().zip(grids).enumerate() {
        let Some(grid) = grid else { continue };
        let (index, name) = (SurfaceIndex(index), || surface.name.clone());
        if grid.width == 0 || grid.height == 0 {
            return Err(RequestFault::EmptyGrid { surface: index, name: name() }.into());
        }
        if surface.mesh.uvs.is_none() {
            return Err(RequestFault::MissingUv { surface: index, name: name() }.into());
        }
        let texels = (grid.width as u64).saturating_mul(grid.height as u64);
        bytes = bytes.saturating_add(texels.saturating_mul(ENTRY_BYTES));
    }
    if bytes > MOST_BYTES {
        return Err(ExceededLimit::TexelBytes { bytes, allowed: MOST_BYTES }.into());
    }
    Ok(())
}
