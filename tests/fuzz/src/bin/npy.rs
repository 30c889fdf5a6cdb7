#![no_main]
//! Reads NumPy's files: labels of parts, and a texture or estimate.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use mateval_image::Wrap;
use mateval_image::npy_io::whole_numbers;
use mateval_image::texture_io::{Encoding, texture_and_alpha_of_bytes};

fuzz_target!(|bytes: &[u8]| {
    let _ = whole_numbers(bytes);
    let read = texture_and_alpha_of_bytes(Path::new("a.npy"), bytes.to_vec(), Encoding::Linear, Wrap::Clamp);
    if let Ok((texture, _)) = read {
        assert!(texture.width() > 0 && texture.height() > 0);
    }
});
