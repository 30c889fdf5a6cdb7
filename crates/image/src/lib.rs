//! Pictures that know what they hold.
//!
//! In: PNG, JPEG, HDR, BMP and EXR files from strangers, or pixels made by the other crates. Out: typed pictures
//! ([`Picture`] of [`LinearRgb`], [`SrgbRgb`], [`Normal`], scalars, ids, mask bits), textures prepared for lookups
//! ([`Texture`]), and files that hold the same bytes on every machine (no dates, no host names).
//!
//! Between: size limits are checked on the header, before memory is taken; colours are decoded once, by [`transfer`].

pub mod error;
pub mod exr_header;
pub mod exr_io;
pub mod limits;
pub mod map_io;
pub mod picture;
pub mod png_header;
pub mod png_io;
pub mod store;
pub mod texture;
pub mod texture_io;
pub mod transfer;

pub use error::ImageError;
pub use picture::{LinearRgb, Mask, Normal, Picture, SrgbRgb};
pub use texture::{Texels, Texture, Wrap};
