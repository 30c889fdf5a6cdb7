//! The Parquet file and the description of the views, read back.

use mateval_export::Format;
use mateval_scene::manifest::sha256_of_file;
use mateval_testkit::sample_dataset;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::{ListAccessor as _, RowAccessor as _};
use serde_json::Value;

use super::sample::{exported, root};

#[test]
fn rows_of_the_parquet_file_are_the_views() {
    let (folder, found) = exported(root(), Format::Huggingface);
    assert_eq!((found.unwrap().views, sample_dataset::dataset().scenes.len()), (Some(10), 2));
    let path = folder.path().join("out/data/test-00000-of-00001.parquet");
    let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    assert_eq!(reader.num_row_groups(), 2);
    let mut rows = reader.get_row_iter(None).unwrap();
    for scene in &sample_dataset::dataset().scenes {
        for view in &scene.views {
            let row = rows.next().unwrap().unwrap();
            let ids = [row.get_string(0).unwrap().as_str(), row.get_string(1).unwrap()];
            assert_eq!(ids, [scene.id.as_str(), view.id.as_str()]);
            let renderer = sample_dataset::dataset().file.photo_renderer.as_ref().unwrap();
            let picture = sample_dataset::dataset().folder(&scene.id).render(renderer, &view.id).join("rgb.png");
            let bytes = row.get_group(2).unwrap().get_bytes(0).unwrap();
            assert!(bytes.data() == std::fs::read(picture).unwrap());
            let lens = row.get_group(3).unwrap();
            assert_eq!(lens.get_int(0).unwrap() as u32, view.camera.intrinsics.width);
            assert_eq!(lens.get_double(5).unwrap(), view.camera.intrinsics.cy);
            let matrix = row.get_list(4).unwrap();
            let number = |at: usize, column: usize| matrix.get_list(at).unwrap().get_double(column).unwrap();
            let found: [[f64; 4]; 4] = std::array::from_fn(|at| std::array::from_fn(|column| number(at, column)));
            assert_eq!((matrix.len(), found), (4, view.camera.world_from_camera));
        }
    }
    assert!(rows.next().is_none());
}

#[test]
fn the_description_lists_the_tars_with_their_hashes() {
    let (folder, _) = exported(root(), Format::Croissant);
    let out = folder.path().join("out");
    let text = std::fs::read_to_string(out.join("croissant.json")).unwrap();
    let description: Value = serde_json::from_str(&text).unwrap();
    let objects = description["distribution"].as_array().unwrap().iter().filter(|object| object["sha256"].is_string());
    let objects: Vec<&Value> = objects.collect();
    assert_eq!(objects.len(), 4);
    for object in objects {
        let name = object["contentUrl"].as_str().unwrap();
        assert_eq!(sha256_of_file(&out.join(name)).unwrap(), object["sha256"].as_str().unwrap());
    }
    assert_eq!(std::fs::read_to_string(out.join("views.jsonl")).unwrap().lines().count(), 10);
}
