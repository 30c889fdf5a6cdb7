#![no_main]
//! Reads a texture of any format that a source scene may have: PNG, JPEG, BMP, Radiance HDR.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use mateval_image::Wrap;
use mateval_image::texture_io::{Encoding, texture_of_bytes};

fuzz_target!(|bytes: &[u8]| {
    let _ = texture_of_bytes(Path::new("a"), bytes.to_vec(), Encoding::Srgb, Wrap::Repeat);
});
