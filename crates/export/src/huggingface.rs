//! A dataset folder for the Hugging Face Hub: a card and a Parquet file with a row a view, in the split `test`.

use std::fmt::Write as _;
use std::path::Path;

use mateval_scene::{Progress, Report};
use serde_json::{Value, json};

use crate::error::ExportError;
use crate::exported::Exported;
use crate::sound_dataset::SoundDataset;
use crate::views_parquet::{self, Row};
use crate::write_file::{make_folder_of, write_file};
use crate::{licences, shown_view};

/// The Parquet file; its name states the split, and that it is the only one.
const VIEWS: &str = "data/test-00000-of-00001.parquet";

/// Writes the card, the Parquet file and the licences to `out`.
pub fn export(sound: &SoundDataset, out: &Path, progress: Progress<'_>) -> Result<Exported, ExportError> {
    let scenes = &sound.dataset.scenes;
    let mut exported = Exported { scenes: scenes.len(), views: Some(0), without_picture: 0 };
    let path = out.join(VIEWS);
    make_folder_of(&path)?;
    let groups = scenes.iter().enumerate().map(|(at, scene)| {
        progress(Report::part(&format!("scene {}", scene.id), at, scenes.len()));
        let licence = licences::text(&sound.dataset, &scene.id);
        let row = |view| {
            let picture = shown_view::picture(&sound.dataset, scene, view).map(|file| sound.dataset.root.join(file));
            let read = |file| std::fs::read(&file).map_err(ExportError::io("read", &file));
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
    views_parquet::write(&path, json!({"info": {"features": features()}}).to_string(), groups)?;
    write_file(&out.join("README.md"), card(sound, &exported).as_bytes())?;
    licences::write_all(&sound.dataset, out)?;
    Ok(exported)
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

/// The dataset card. Values of the front matter that are texts are written as JSON strings, which YAML reads as they are.
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
        let _ = writeln!(text, "{} views have no `picture`, because theirs is withheld.\n", exported.without_picture);
    }
    text.push_str(COLUMNS);
    text
}

/// Markdown and HTML of a name are shown, not obeyed.
fn inert(text: &str) -> String {
    let plain: String = text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
    plain.replace('&', "&amp;").replace('<', "&lt;").replace(['`', '[', ']', '*', '_'], " ")
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
