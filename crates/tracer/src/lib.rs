//! Traces light through a scene.
//!
//! In: a [`mateval_scene::reference::ReferenceScene`] (surfaces, materials, textures, lights) and a
//! [`mateval_scene::Camera`]. Out: pictures of linear radiance ([`render()`]), of several views
//! and apart by lights ([`render_views`]), and first hits ([`World::first_hit`],
//! [`aov`]) for depth, normals, ids and material pictures.
//!
//! Between: [`World`] checks the scene and builds [`Accel`] over its triangles; a [`Ray`]'s [`Hit`] becomes a
//! [`SurfaceHit`]; the surface's material there becomes a [`Bsdf`]; [`emitter`] samples what shines on it; [`sampler`]
//! gives every number from seed, pixel and sample index; [`film`] averages tiles in a fixed order. Trigonometry is the
//! `libm` crate's, or sums and products of `warp`'s own, so every machine computes the same bits.

pub mod accel;
pub mod aov;
pub mod bsdf;
pub mod emitter;
pub mod error;
pub mod film;
mod frame;
pub mod light_basis;
mod material_source;
mod path;
pub mod ray;
pub mod render;
pub mod repaint;
pub mod sampler;
pub mod settings;
pub mod shared_centre;
pub mod surface_hit;
mod triangle_record;
mod warp;
pub mod world;

pub use accel::{Accel, Hit, InstructionSet, TriangleIndex, TriangleTest};
pub use bsdf::{Bsdf, BsdfSample};
pub use emitter::StageLight;
pub use error::{ExceededLimit, LightFault, MaterialFault, RequestFault, SceneFault, SurfaceFault, TracerError};
pub use light_basis::{LightBasis, LightGroups};
pub use ray::Ray;
pub use render::{Render, RenderStats, render};
pub use repaint::{Coat, Repaint, render_repainted};
pub use sampler::Sampler;
pub use settings::{LightSampling, RenderSettings};
pub use shared_centre::{HalfLight, LightMix, Lighting, ViewLight, ViewsRender, render_views};
pub use surface_hit::SurfaceHit;
pub use world::World;
