#![no_main]
//! Reads a texture of any format that a source scene may have: PNG, JPEG, WebP, BMP, Radiance HDR;
//! from a file OpenEXR and NumPy too.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use mateval_image::Wrap;
use mateval_image::texture_io::{Encoding, read_texture, texture_of_bytes};

fuzz_target!(|bytes: &[u8]| {
    let _ = texture_of_bytes(Path::new("a"), bytes.to_vec(), Encoding::Srgb, Wrap::Repeat);
    mateval_fuzz::with_file("a", bytes, |path| drop(read_texture(path, Encoding::Linear, Wrap::Clamp)));
});
