#![no_main]
//! Reads a PNG as a map of a submission; the first byte selects the map.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use mateval_dataset::TriangleMesh;
use mateval_dataset::submission::Map;
use mateval_submission::map_file::decode;
use mateval_submission::files::SubmittedFile;

fuzz_target!(|bytes: &[u8]| {
    let Some((which, bytes)) = bytes.split_first() else { return };
    let map = Map::ALL[usize::from(*which) % Map::ALL.len()];
    let file = SubmittedFile::from_bytes(Path::new(""), Path::new("a.png"), bytes.to_vec());
    let atlas = TriangleMesh::default();
    if let Ok(file) = decode(file, map, || Ok(&atlas)).unwrap() {
        let side = file.texture.width();
        assert!((64..=4096).contains(&side) && side == file.texture.height());
        assert!(file.texture.texel(side - 1, side - 1).iter().all(|value| value.is_finite()));
    }
});
