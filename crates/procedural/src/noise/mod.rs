//! The noises of MaterialX' standard library, which are those of Open Shading Language, with their derivatives.

pub mod cell;
mod hash;
pub mod perlin;
pub mod worley;
