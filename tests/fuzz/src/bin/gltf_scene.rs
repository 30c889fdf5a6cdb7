#![no_main]
//! Reads a glTF scene without other files.

use libfuzzer_sys::fuzz_target;
use mateval_sources::gltf::{Limits, read};

fuzz_target!(|bytes: &[u8]| {
    // Limits instances and textures, because a run must be short.
    let (primitives, triangles, vertices, texels) = (1 << 10, 1 << 20, 1 << 20, 1 << 20);
    let limits = Limits { primitives, triangles, vertices, texels, ..Limits::default() };
    mateval_fuzz::with_file("scene.gltf", bytes, |path| drop(read(path, None, &limits)));
});
