//! What can be inferred about light from one photo.
//!
//! In: a room's geometry, its cameras, the light of a view split by lights, and the photo. Out: where lights may stand
//! ([`light_stage`]) or what may glow ([`candidates`]), and how bright each one is, under one colour for all surfaces
//! ([`light_fit`]) or together with the colours of all parts ([`joint_fit`]).

pub mod candidates;
pub mod joint_fit;
pub mod light_fit;
pub mod light_stage;
mod ridge_fit;

pub use light_fit::LightError;
