//! Light inferred from one photo: where it may come from, and how bright each source is.
//!
//! In: a room's geometry, its cameras, the light of a view split by lights, and the photo. Out: where lights may stand
//! ([`light_stage`]) or what may glow ([`candidates`]), and how bright each one is, under one colour for all surfaces
//! ([`light_fit`]) or together with the colours of all parts ([`joint_fit`]). [`photo_pixels`] chooses the pixels of a
//! real room's photo that a render can be compared with.

pub mod candidates;
pub mod joint_fit;
pub mod light_fit;
pub mod light_stage;
pub mod photo_pixels;
mod ridge_fit;

pub use light_fit::LightError;
