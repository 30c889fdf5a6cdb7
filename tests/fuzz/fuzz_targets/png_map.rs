#![no_main]
//! A PNG as a map of a submission; the first byte says which map.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use mateval_submission::map_file::read_bytes;
use mateval_scene::submission::Map;

fuzz_target!(|bytes: &[u8]| {
    let Some((which, bytes)) = bytes.split_first() else { return };
    let map = Map::ALL[usize::from(*which) % Map::ALL.len()];
    if let Ok(file) = read_bytes(Path::new("a.png"), bytes.to_vec(), map) {
        let side = file.texture.width();
        assert!((64..=4096).contains(&side) && side == file.texture.height());
        assert!(file.texture.texel(side - 1, side - 1).iter().all(|value| value.is_finite()));
    }
});
