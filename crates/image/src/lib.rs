//! Pictures and textures whose types state their contents, and the files that hold them.
//!
//! In: PNG, JPEG, WebP, HDR, BMP, EXR and NumPy files, which are untrusted input, or pixels from the other crates. Out:
//! typed pictures ([`Picture`] of [`LinearRgb`], [`SrgbRgb`], [`Normal`], scalars, ids, mask bits), textures for
//! lookups ([`Texture`]), and files with the same bytes on every machine (no dates, no host names).
//!
//! In between, [`limits`] are checked on a file's header before memory is taken, and [`transfer`] converts colours
//! between sRGB and linear.

mod color_profile;
mod encoding;
pub mod error;
pub mod exr_header;
pub mod exr_io;
pub mod file_kind;
pub mod jpeg_io;
pub mod limits;
pub mod map_io;
pub mod npy_header;
mod npy_io;
pub mod owner;
pub mod photo;
pub mod picture;
pub mod png_header;
pub mod png_io;
pub mod store;
pub mod temporary;
pub mod texel_grid;
pub mod texture;
pub mod texture_io;
pub mod transfer;

pub use error::ImageError;
pub use picture::{LUMINANCE, LinearRgb, Mask, Normal, Picture, SrgbRgb};
pub use texel_grid::{TexelGrid, Wrap};
pub use texture::{Texels, Texture};
