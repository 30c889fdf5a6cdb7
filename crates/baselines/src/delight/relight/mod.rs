//! A room lit anew: the de-lit photo under its fitted lights, each of which may be dimmed.
//!
//! In: the public geometry of a scene, its photo, and the pictures and lights that [`super::write`] has written. Out:
//! the room under all lights, and under each of the strongest alone. Light that reaches a place by way of other
//! surfaces is traced with the colours of their parts; nothing is read from the photo but the glow of lamps, what is
//! seen through windows, and pixels without a known surface, such as glass.

mod delit_pictures;
mod files;
mod page;
mod relit_photo;

pub use files::{Dimmed, RelightOptions, write};
