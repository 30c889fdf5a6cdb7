//! What can be inferred about light from one photo.
//!
//! In: a room's geometry, its cameras, the light basis of a view and the photo. Out: where lights may stand
//! ([`light_stage`]) and how bright each one is ([`light_fit`]), under the rules in [`rules`].

mod error;
pub mod light_fit;
pub mod light_stage;
mod rectangle;
pub mod rules;
mod walls;

pub use error::LightError;
