#![no_main]
//! Reads meshes from binary glTF: triangles must refer to existing vertices.

use libfuzzer_sys::fuzz_target;
use mateval_dataset::glb;

fuzz_target!(|bytes: &[u8]| {
    mateval_fuzz::with_file("a.glb", bytes, |path| {
        for node in glb::read(path).into_iter().flatten() {
            let vertices = node.mesh.positions.len();
            assert!(node.mesh.triangles.iter().flatten().all(|vertex| (*vertex as usize) < vertices));
        }
    });
});
