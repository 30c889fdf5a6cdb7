//! A Parquet file with a row for each view.
//!
//! Columns: `scene`, `view`, `picture` (a PNG file's bytes and its name, as `datasets` stores pictures), `intrinsics`,
//! `world_from_camera` (row-major) and `licence`. A scene is a row group, so that no more than one scene's pictures are in
//! memory. Pictures are compressed already, so pages are not.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

use mateval_scene::Camera;

use crate::error::ExportError;

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

/// A row.
#[derive(Clone, Debug)]
pub struct Row {
    /// The scene's id.
    pub scene: String,
    /// The view's id.
    pub view: String,
    /// The bytes of its PNG file; none where it is withheld.
    pub picture: Option<Vec<u8>>,
    /// Its camera.
    pub camera: Camera,
    /// The licence of its scene.
    pub licence: Option<String>,
}

/// Writes the rows to `path`, a row group for each item of `groups`. `features` is the description of the columns that
/// `datasets` looks for in the file.
pub fn write(
    path: &Path,
    features: String,
    groups: impl Iterator<Item = Result<Vec<Row>, ExportError>>,
) -> Result<(), ExportError> {
    let failed = |source: ParquetError| ExportError::Parquet { path: path.to_owned(), source };
    let file = File::create(path).map_err(ExportError::io("write", path))?;
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
