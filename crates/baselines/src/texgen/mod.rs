//! The bridge to TEXGen (Yu and others, "TEXGen: a Generative Diffusion Model for Mesh Textures", SIGGRAPH Asia 2024),
//! which paints what is missing of one object's UV texture at a time.
//!
//! [`export`] writes each instance as TEXGen's loader reads objects, [`import`] takes its textures back. An object's
//! folder is `<first two characters of its id>/<id>`. Pictures
//! are as ours, v upwards from the lower edge: TEXGen turns them when it reads and again when it writes.

mod export;
mod import;

pub use export::export;
pub use import::import;

/// Texels a side that TEXGen works at.
pub const TEXELS: usize = 1024;

/// The object's folder below the root.
fn object_folder(id: &str) -> String {
    format!("{}/{id}", &id[..2])
}
