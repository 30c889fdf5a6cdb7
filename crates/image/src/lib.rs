//! Pictures and textures whose types state their contents, and the files that hold them.
//!
//! In: PNG, JPEG, WebP, HDR, BMP, EXR and NumPy files, and TIFF for photos, which are untrusted input, or pixels from the
//! other crates. Out: typed pictures ([`Picture`] of [`LinearRgb`], [`SrgbRgb`], [`Normal`], scalars, ids, mask bits), textures for
//! lookups ([`Texture`]), and files with the same bytes on every machine (no dates, no host names).
//!
//! In between, [`limits`] are checked on a file's header before memory is taken, and [`transfer`] converts colours
//! between sRGB and linear.

mod color_profile;
pub mod exr_io;
pub mod limits;
pub mod npy_io;
pub mod photo;
pub mod picture;
pub mod png_io;
pub mod texture;
pub mod texture_io;
pub mod transfer;

pub use limits::ImageError;
pub use picture::{LUMINANCE, LinearRgb, Mask, Normal, Picture, SrgbRgb};
pub use texture::{TexelGrid, Texels, Texture, Wrap};
