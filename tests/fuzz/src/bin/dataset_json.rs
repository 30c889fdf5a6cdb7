#![no_main]
//! `scene.json`, `dataset.json`, `targets.json`, `reference.json` and `lights.json`.

use libfuzzer_sys::fuzz_target;
use mateval_dataset::dataset::{DatasetFile, SceneFile, TargetsFile};
use mateval_dataset::json;
use mateval_dataset::reference::{LightsFile, ReferenceFile};

fuzz_target!(|bytes: &[u8]| {
    mateval_fuzz::with_file("scene.json", bytes, |path| {
        if let Ok(scene) = json::read::<SceneFile>(path) {
            // A value that is written and read again must be the same.
            mateval_fuzz::with_file("again.json", json::to_text(&scene).as_bytes(), |again| {
                assert_eq!(json::read::<SceneFile>(again).expect("we wrote it"), scene);
            });
        }
        let _ = json::read::<DatasetFile>(path);
        let _ = json::read::<TargetsFile>(path);
        let _ = json::read::<ReferenceFile>(path);
        let _ = json::read::<LightsFile>(path);
    });
});
