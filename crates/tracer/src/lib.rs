//! Path tracer for reference scenes.
//!
//! Input: a [`mateval_dataset::reference::ReferenceScene`] (surfaces, materials, textures, lights) and one or more
//! [`mateval_dataset::Camera`]s.
//!
//! Output: pictures of linear radiance ([`render()`]), the same per view and per group of lights ([`render_views`]),
//! with predicted materials in place of the scene's own ([`render_repainted`]), and first hits ([`World::first_hit`],
//! [`aov`]) for depth, normals, ids and material pictures.
//!
//! Steps between:
//!
//! 1. [`World`] checks the scene, builds the bounding volume hierarchy ([`Accel`]) and prepares lights and materials.
//! 2. [`Sampler`] derives every random number from seed, pixel and sample index.
//! 3. A camera [`Ray`] finds a [`Hit`], which becomes a [`SurfaceHit`].
//! 4. The material at that place becomes a BSDF ([`bsdf`]); [`emitter`] samples a light; the BSDF samples the next ray.
//! 5. [`render`](mod@render) averages the samples of each tile in a fixed order.
//! 6. [`noise_filter`] takes the noise out of pictures that people, SSIM or LPIPS see, and out of the pivots of errors.
//!
//! Every machine computes the same bits: trigonometric functions come from the `libm` crate, or are sums and products
//! in `sampling`.

pub mod accel;
pub mod aov;
pub mod bsdf;
pub mod emitter;
pub mod error;
pub mod noise_filter;
mod path;
pub mod ray;
pub mod render;
pub mod repaint;
mod sampling;
pub mod shared_centre;
pub mod split;
pub mod world;

pub use accel::Accel;
pub use emitter::StageLight;
pub use error::{ElementFault, ExceededLimit, LightFault, MaterialFault, RequestFault, SurfaceFault, TracerError};
pub use path::{LightSampling, RenderSettings};
pub use ray::{Hit, Ray, SurfaceHit, TriangleIndex};
pub use render::{Render, RenderStats, render};
pub use repaint::{Repaint, Scattering, SurfaceMaps, render_repainted};
pub use sampling::Sampler;
pub use shared_centre::{LightBasis, LightMix, Lighting, ViewLight, ViewsRender, render_views};
pub use split::{AssumedSurfaces, PhotoCache, SplitLight, split_light};
pub use world::World;
