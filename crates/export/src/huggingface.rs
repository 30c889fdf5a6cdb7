//! A dataset folder for the Hugging Face Hub: a card, a Parquet file with a row a view, in the split `test`, and the
//! description of the benchmark.
//!
//! Columns of the Parquet file: `scene`, `view`, `picture` (a PNG file's bytes and its name, as `datasets` stores
//! pictures), `intrinsics`, `world_from_camera` (row-major) and `licence`. A scene is a row group, so that no more than
//! one scene's pictures are in memory. Pictures are compressed already, so pages are not.

use std::fmt::Write as _;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use mateval_dataset::{Camera, Progress, Report, SceneId};
use mateval_files::FileError;
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;
use serde_json::{Value, json};

use crate::dataset::{
    ExportError, Exported, SoundDataset, inert, licence_text, make_folder_of, picture, write_file, write_licences,
};

/// The Parquet file; its name states the split, and that it is the only one.
const VIEWS: &str = "data/test-00000-of-00001.parquet";

/// Writes the card, the Parquet file, `eval.yaml` and the licences to `out`.
pub fn export(sound: &SoundDataset, out: &Path, progress: Progress<'_>) -> Result<Exported, ExportError> {
    let scenes = &sound.dataset.scenes;
    let mut exported = Exported { scenes: scenes.len(), views: Some(0), without_picture: 0 };
    let path = out.join(VIEWS);
    make_folder_of(&path)?;
    let groups = scenes.iter().enumerate().map(|(at, scene)| {
        progress(Report::part(&format!("scene {}", scene.id), at, scenes.len()));
        let licence = licence_text(&sound.dataset, &scene.id);
        let row = |view| {
            let picture = picture(&sound.dataset, scene, view).map(|file| sound.dataset.root.join(file));
            let read = |file| std::fs::read(&file).map_err(FileError::io("read", &file));
            Ok(Row {
                scene: scene.id.to_string(),
                view: view.id.to_string(),
                picture: picture.map(read).transpose()?,
                camera: view.camera,
                licence: licence.clone(),
            })
        };
        let rows = scene.views.iter().map(row).collect::<Result<Vec<Row>, ExportError>>()?;
        exported.views = exported.views.map(|sum| sum + rows.len());
        exported.without_picture += rows.iter().filter(|row| row.picture.is_none()).count();
        Ok(rows)
    });
    write_parquet(&path, json!({"info": {"features": features()}}).to_string(), groups)?;
    write_file(&out.join("README.md"), card(sound, &exported).as_bytes())?;
    write_file(&out.join("eval.yaml"), benchmark(sound).as_bytes())?;
    write_licences(&sound.dataset, out)?;
    Ok(exported)
}

/// `eval.yaml`, which makes the folder a benchmark on the Hub (<https://huggingface.co/docs/hub/eval-results>): results in
/// models' folders then name its task, which is a single number.
fn benchmark(sound: &SoundDataset) -> String {
    format!(
        "name: {}\ndescription: {}\nevaluation_framework: mateval\ntasks:\n  - id: albedo_novel_psnr\n    config: default\n    \
         split: test\n",
        Value::from(sound.dataset.file.name.as_str()),
        Value::from(
            "Materials of the objects of a room, from one photo and the room's geometry. The number is the PSNR of the \
             albedo in novel views, in dB."
        )
    )
}

/// The columns' types in the words of `datasets`.
fn features() -> Value {
    let value = |dtype: &str| json!({"dtype": dtype, "_type": "Value"});
    let (int, double, text) = (value("int32"), value("float64"), value("string"));
    json!({
        "scene": text,
        "view": text,
        "picture": {"_type": "Image"},
        "intrinsics": {"width": int, "height": int, "fx": double, "fy": double, "cx": double, "cy": double},
        "world_from_camera": {"feature": {"feature": double, "_type": "List"}, "_type": "List"},
        "licence": text,
    })
}

/// The dataset card. Values of the front matter that are texts are written as JSON strings, which YAML reads as they
/// are.
fn card(sound: &SoundDataset, exported: &Exported) -> String {
    let file = &sound.dataset.file;
    let quoted = |text: &str| Value::from(text).to_string();
    let views = exported.views.unwrap_or(0);
    let size = ["n<1K", "1K<n<10K", "10K<n<100K"][[1_000, 10_000].iter().filter(|most| views >= **most).count()];
    let mut text = format!(
        "---\npretty_name: {}\nlicense: other\nlicense_name: {}\nsize_categories:\n- {size}\ntags:\n- inverse-rendering\n\
         - materials\n- indoor\nconfigs:\n- config_name: default\n  data_files:\n  - split: test\n    path: {}\n---\n\n",
        quoted(&file.name),
        quoted("by-scene"),
        quoted(VIEWS),
    );
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        "# {}\n\nVersion {}: {} scenes, {views} views, a row each. The identity of the dataset is the SHA-256 of its \
         manifest, `{}`.\n\n",
        inert(&file.name),
        inert(&file.version),
        exported.scenes,
        file.manifest_sha256
    );
    if exported.without_picture > 0 {
        let _ = writeln!(
            text,
            "{} views have no `picture`, because theirs is withheld or was not rendered.\n",
            exported.without_picture
        );
    }
    text.push_str(COLUMNS);
    text.push_str("\n## Licences\n\n");
    for licence in file.shared_licences() {
        let scenes: Vec<&str> = licence.scenes.iter().map(SceneId::as_str).collect();
        let first = licence.text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
        let _ = writeln!(text, "- {} ({}): {}", inert(&licence.file), scenes.join(", "), inert(first.trim()));
    }
    if let Some(unstated) = sound.dataset.unstated_licences() {
        let _ = writeln!(text, "- {unstated}");
    }
    text
}

const COLUMNS: &str = "\
```python
from datasets import load_dataset
views = load_dataset(\"FOLDER_OR_NAME\", split=\"test\")
```

| Column | Content |
|---|---|
| `scene`, `view` | ids; the view `input` is the photo that methods may see |
| `picture` | the picture, 8-bit sRGB, with the scene's exposure |
| `intrinsics` | width, height, fx, fy, cx, cy in pixels, counted from the upper left corner; the first pixel's centre is (0.5, 0.5) |
| `world_from_camera` | 4x4, row-major, metres; the camera looks along -Z, +Y is up |
| `licence` | the licence of the scene, which is also in `licences/` |

Scores are made from the whole dataset (geometry, masks, true materials), not from these rows.
";

/// The columns in Parquet's own words. The lists nest as the format prescribes (its `LogicalTypes.md`, "Lists").
const SCHEMA: &str = "
message views {
  required binary scene (UTF8);
  required binary view (UTF8);
  optional group picture {
    optional binary bytes;
    optional binary path (UTF8);
  }
  required group intrinsics {
    required int32 width;
    required int32 height;
    required double fx;
    required double fy;
    required double cx;
    required double cy;
  }
  required group world_from_camera (LIST) {
    repeated group list {
      required group element (LIST) {
        repeated group list {
          required double element;
        }
      }
    }
  }
  optional binary licence (UTF8);
}
";

#[derive(Clone, Debug)]
pub struct Row {
    pub scene: String,
    pub view: String,
    /// The bytes of its PNG file; absent if it is withheld.
    pub picture: Option<Vec<u8>>,
    pub camera: Camera,
    /// The licence of its scene.
    pub licence: Option<String>,
}

/// Writes the rows to `path`, a row group for each item of `groups`. `features` is the description of the columns that
/// `datasets` looks for in the file.
pub fn write_parquet(
    path: &Path,
    features: String,
    groups: impl Iterator<Item = Result<Vec<Row>, ExportError>>,
) -> Result<(), ExportError> {
    let failed = |source: ParquetError| ExportError::Parquet { path: path.to_owned(), source };
    let file = File::create(path).map_err(FileError::io("write", path))?;
    let schema = Arc::new(parse_message_type(SCHEMA).expect("the schema above is valid"));
    let properties = WriterProperties::builder()
        .set_compression(Compression::UNCOMPRESSED)
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_key_value_metadata(Some(vec![KeyValue::new("huggingface".to_owned(), features)]));
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties.build())).map_err(failed)?;
    for rows in groups {
        let rows = rows?;
        let mut group = writer.next_row_group().map_err(failed)?;
        write_group(&mut group, &rows).map_err(failed)?;
        group.close().map_err(failed)?;
    }
    writer.close().map_err(failed)?;
    Ok(())
}

/// The columns in the order of [`SCHEMA`]'s leaves.
fn write_group(group: &mut SerializedRowGroupWriter<'_, File>, rows: &[Row]) -> Result<(), ParquetError> {
    let texts = |of: fn(&Row) -> &str| rows.iter().map(|row| ByteArray::from(of(row))).collect::<Vec<_>>();
    column::<ByteArrayType>(group, &texts(|row| &row.scene), None, None)?;
    column::<ByteArrayType>(group, &texts(|row| &row.view), None, None)?;
    // Two of the levels of `picture.bytes` are optional: 0 for no picture, 2 for its value.
    let levels: Vec<i16> = rows.iter().map(|row| if row.picture.is_some() { 2 } else { 0 }).collect();
    let with_picture = || rows.iter().filter(|row| row.picture.is_some());
    let pictures: Vec<ByteArray> = rows.iter().filter_map(|row| row.picture.clone().map(ByteArray::from)).collect();
    let name = |row: &Row| ByteArray::from(format!("{}-{}.png", row.scene, row.view).into_bytes());
    column::<ByteArrayType>(group, &pictures, Some(&levels), None)?;
    column::<ByteArrayType>(group, &with_picture().map(name).collect::<Vec<_>>(), Some(&levels), None)?;
    // Widths and heights are those of pictures, far below 2³¹.
    for of in
        [(|row: &Row| row.camera.intrinsics.width as i32) as fn(&Row) -> i32, |row| row.camera.intrinsics.height as i32]
    {
        column::<Int32Type>(group, &rows.iter().map(of).collect::<Vec<_>>(), None, None)?;
    }
    let lens: [fn(&Row) -> f64; 4] = [
        |row| row.camera.intrinsics.fx,
        |row| row.camera.intrinsics.fy,
        |row| row.camera.intrinsics.cx,
        |row| row.camera.intrinsics.cy,
    ];
    for of in lens {
        column::<DoubleType>(group, &rows.iter().map(of).collect::<Vec<_>>(), None, None)?;
    }
    let matrices: Vec<f64> = rows.iter().flat_map(|row| row.camera.world_from_camera).flatten().collect();
    // A number that starts a row of the table repeats nothing, one that starts a row of the matrix the outer list.
    let repetition: Vec<i16> = (0..matrices.len())
        .map(|at| {
            if at % 16 == 0 {
                0
            } else if at % 4 == 0 {
                1
            } else {
                2
            }
        })
        .collect();
    column::<DoubleType>(group, &matrices, Some(&vec![2; matrices.len()]), Some(&repetition))?;
    let licences: Vec<ByteArray> = rows.iter().filter_map(|row| row.licence.as_deref().map(ByteArray::from)).collect();
    let levels: Vec<i16> = rows.iter().map(|row| i16::from(row.licence.is_some())).collect();
    column::<ByteArrayType>(group, &licences, Some(&levels), None)
}

fn column<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    values: &[T::T],
    definition: Option<&[i16]>,
    repetition: Option<&[i16]>,
) -> Result<(), ParquetError> {
    let mut column = group.next_column()?.expect("the columns are those of the schema");
    column.typed::<T>().write_batch(values, definition, repetition)?;
    column.close()
}
