//! A de-lit photo: base colour from one photo of known geometry, by physics alone.
//!
//! In: the public geometry of a scene and its photo. Out: base colour, the light that falls on each pixel and the
//! radiance of each possible light. A few paths a pixel split the photo's light by lights ([`mateval_tracer::split`]);
//! a robust fit separates radiances from the colours of parts ([`mateval_light::joint_fit`]), with what the photo shows
//! of a lamp or of the sky as its radiance; the light, smooth once colours are taken out of it, is filtered; what
//! remains of the photo is base colour. Parts that are better explained with another roughness than the usual one get
//! it. All this changes what is assumed of surfaces that the photo does not show, so that the whole is repeated three
//! or four times. Where noise or reflections hide the base colour, it is drawn towards that of the part. Flat parts
//! that show what the photo shows elsewhere are mirrors.

mod certainty;
mod delit_photo;
mod files;
mod lights_file;
mod mirrors;
mod options;
mod page;
mod part_room;
mod part_surfaces;
#[cfg(test)]
mod planted_tests;
mod possible_light;
pub mod relight;
mod roughness;
mod round_light;
mod rounds;
mod surfaces;

pub use delit_photo::DelitPhoto;
pub use files::write;
pub use options::{CandidateLights, DelightOptions};
pub use possible_light::{FittedLight, LightSource, PossibleLight};
pub use rounds::delight;
