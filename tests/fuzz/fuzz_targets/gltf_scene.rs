#![no_main]
//! Reads a glTF scene without other files.

use libfuzzer_sys::fuzz_target;
use mateval_sources::gltf::{Limits, read};

fuzz_target!(|bytes: &[u8]| {
    // Limits instances and textures, because a run must be short.
    let limits = Limits { primitives: 1 << 10, triangles: 1 << 20, vertices: 1 << 20, texels: 1 << 20, ..Limits::default() };
    mateval_fuzz::with_file("scene.gltf", bytes, |path| drop(read(path, &limits)));
});
