//! Pictures and textures whose types state their contents, and the files that hold them.
//!
//! In: PNG, JPEG, WebP, HDR, BMP, EXR and NumPy files, which are untrusted input, or pixels from the other crates. Out:
//! typed pictures ([`Picture`] of [`LinearRgb`], [`SrgbRgb`], [`Normal`], scalars, ids, mask bits), textures for
//! lookups ([`Texture`]), and files with the same bytes on every machine (no dates, no host names).
//!
//! In between, [`limits`] are checked on a file's header before memory is taken, [`transfer`] converts colours between
//! sRGB and linear, and [`store`] puts files in place whole.

mod color_profile;
pub mod exr_io;
pub mod limits;
pub mod npy_io;
pub mod photo;
pub mod picture;
pub mod png_io;
pub mod store;
pub mod texture;
pub mod texture_io;
pub mod transfer;

pub use limits::ImageError;
pub use picture::{LUMINANCE, LinearRgb, Mask, Normal, Picture, SrgbRgb};
pub use texture::{TexelGrid, Texels, Texture, Wrap};

// OLD PATHS, removed after the merge.
#[doc(hidden)]
pub mod map_io {
    pub use crate::texture_io::{exr_color, exr_scalar, png_color, png_scalar};
}
#[doc(hidden)]
pub mod texel_grid {
    pub use crate::texture::{TexelGrid, Wrap};
}
#[doc(hidden)]
pub mod exr_header {
    pub use crate::exr_io::{EXR_SIGNATURE, ExrChannel, ExrHeader, ExrHeaderError, ExrNumber};
}
#[doc(hidden)]
pub mod png_header {
    pub use crate::png_io::{PNG_SIGNATURE, PngColor, PngHeader, PngHeaderError};
}
#[doc(hidden)]
pub mod jpeg_io {
    pub use crate::png_io::{MAX_JPEG_SIDE, jpeg_bytes};
}
#[doc(hidden)]
pub mod npy_header {
    pub use crate::npy_io::{MAX_HEADER_BYTES, MAX_PREFIX_BYTES, NPY_SIGNATURE, NpyHeaderError, checked_data};
}
#[doc(hidden)]
pub mod file_kind {
    pub use crate::limits::{hint, is_lfs_pointer, mistaken_for, without_mark};
}
#[doc(hidden)]
pub mod error {
    pub use crate::limits::ImageError;
}
#[doc(hidden)]
pub mod temporary {
    pub use crate::store::{abandoned_beside, all_beside, beside, is_abandoned, is_temporary};
}
#[doc(hidden)]
pub mod owner {
    pub use crate::store::Owner;
}
