#![no_main]
//! Reads what the script hands back that bakes a `.blend` file: its result, a GLB and the light from outside. In the
//! input they follow each other, with two lengths of four bytes in front.

use libfuzzer_sys::fuzz_target;
use mateval_sources::blend::Baked;
use mateval_sources::gltf::{Limits, read};

fuzz_target!(|bytes: &[u8]| {
    let Some((lengths, rest)) = bytes.split_at_checked(8) else { return };
    let length = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|byte| lengths[at + byte])) as usize;
    let (result, rest) = rest.split_at(length(0).min(rest.len()));
    let (glb, world) = rest.split_at(length(4).min(rest.len()));
    let limits =
        Limits { primitives: 1 << 10, triangles: 1 << 18, vertices: 1 << 18, texels: 1 << 20, ..Limits::default() };
    mateval_fuzz::with_file("result.json", result, |path| {
        let Ok(baked) = Baked::read(path) else { return };
        let out = path.with_file_name("");
        let path = out.join("scene.glb");
        std::fs::write(&path, glb).expect("there is room for a small file");
        std::fs::write(out.join("world.exr"), world).expect("there is room for a small file");
        let Ok(mut scene) = read(&path, None, &limits) else { return };
        if baked.complete(&mut scene, &out).is_ok() {
            assert_eq!(scene.scene.surfaces.len(), scene.origins.len());
            assert!(scene.scene.surfaces.iter().all(|surface| surface.material.0 < scene.scene.materials.len()));
        }
    });
});
