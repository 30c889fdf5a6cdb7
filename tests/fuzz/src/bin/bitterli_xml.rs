#![no_main]
//! Reads a Mitsuba scene without other files.

use libfuzzer_sys::fuzz_target;
use mateval_sources::bitterli::{Limits, read};

fuzz_target!(|bytes: &[u8]| {
    // Limits computed skies and spheres, because a run must be short.
    let limits = Limits { triangles: 1 << 20, vertices: 1 << 20, texels: 1 << 20, ..Limits::default() };
    mateval_fuzz::with_file("scene.xml", bytes, |path| drop(read(path, None, &limits)));
});
