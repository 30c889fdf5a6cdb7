#![no_main]
//! Reads an OBJ mesh and an MTL: triangles must refer to existing vertices.

use libfuzzer_sys::fuzz_target;
use mateval_dataset::obj::{self, Materials, ObjLimits};

fuzz_target!(|bytes: &[u8]| {
    let limits = ObjLimits { triangles: 100_000, corners: 300_000 };
    if let Ok(found) = obj::read(bytes, limits, Materials::Split) {
        let vertices = found.mesh.positions.len();
        assert!(found.mesh.triangles.iter().flatten().all(|vertex| (*vertex as usize) < vertices));
    }
    let _ = obj::read_materials(bytes);
    let _ = obj::material_files(bytes);
});
