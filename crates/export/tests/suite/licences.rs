//! The licence of a scene is in every export.

use mateval_export::Format;
use mateval_testkit::packed::files;
use mateval_testkit::sample_dataset;

use super::sample::{FORMATS, exported, root};

#[test]
fn every_export_holds_the_licences() {
    let licence = &sample_dataset::dataset().file.licences[0];
    assert_eq!((licence.scene.as_str(), licence.file.as_str()), ("room", "LICENSE.txt"));
    for format in FORMATS {
        let (folder, _) = exported(root(), format);
        let out = folder.path().join("out");
        let (place, other) = match format {
            Format::Nerfstudio | Format::Colmap => ("room/LICENCE.txt", "living/LICENCE.txt"),
            _ => ("licences/room.txt", "licences/living.txt"),
        };
        let text = std::fs::read_to_string(out.join(place)).unwrap();
        assert_eq!(text, format!("LICENSE.txt:\n\n{}\n", licence.text.trim_end()));
        assert!(!out.join(other).exists());
        // Beside the file, descriptions of views state it too.
        let start = licence.text.lines().next().unwrap().as_bytes();
        let stating = match format {
            Format::Croissant => vec!["croissant.json", "views.jsonl"],
            Format::Huggingface => vec!["data/test-00000-of-00001.parquet"],
            _ => Vec::new(),
        };
        let all = files(&out);
        for name in stating {
            let (_, bytes) = all.iter().find(|(file, _)| file == name).unwrap();
            assert!(bytes.windows(start.len()).any(|window| window == start), "{name}");
        }
    }
}
