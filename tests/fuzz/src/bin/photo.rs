#![no_main]
//! Reads a photo: orientation, colour profile and gamma of PNG, JPEG, WebP and TIFF.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use mateval_image::photo::PhotoFile;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(photo) = PhotoFile::of_bytes(Path::new("a"), bytes.to_vec()) {
        let small = photo.resized(8, 6);
        assert!(small.pixels().iter().flat_map(|rgb| rgb.0).all(|value| value.is_finite()));
    }
});
