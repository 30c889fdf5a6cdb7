//! The bridge to TEXGen (Yu and others, "TEXGen: a Generative Diffusion Model for Mesh Textures", SIGGRAPH Asia 2024),
//! which completes the UV texture of one object at a time.
//!
//! [`export`] writes each instance as TEXGen's loader reads objects; [`import`] makes a submission of its textures. An
//! object's folder is `<first two characters of its id>/<id>`. In pictures v points up from the lower edge, as in the
//! dataset's atlases: TEXGen flips them when it reads and again when it writes.

mod export;
mod import;

pub use export::export;
pub use import::import;

/// Width and height of TEXGen's textures, in texels.
pub const TEXELS: usize = 1024;

/// The object's folder, relative to the root.
fn object_folder(id: &str) -> String {
    format!("{}/{id}", &id[..2])
}
