//! Why a baseline could not be made: the error of this crate.

use std::path::PathBuf;

use mateval_files::FileError;
use mateval_image::limits::Malformed;
use mateval_procedural::ProceduralError;

use crate::import::error::ImportError;

/// Why a baseline could not be made.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    #[error(transparent)]
    Files(#[from] FileError),
    /// The output exists and is never replaced.
    #[error("'{}' already exists; choose another --out", .0.display())]
    InTheWay(PathBuf),
    /// The output would lie in the dataset's folder.
    #[error("'{}' lies in the dataset, which must hold nothing else; choose another --out", .0.display())]
    InDataset(PathBuf),
    /// `--force` would remove a folder that is no submission.
    #[error("'{}' exists and holds no submission.json, so it is not replaced; choose another --out", .0.display())]
    NotASubmission(PathBuf),
    /// `--force` would remove a folder that is no report.
    #[error("'{}' exists and holds no report.json, so it is not replaced; remove it, or choose another --out", .0.display())]
    NotAReport(PathBuf),
    /// A folder of graphs holds none, or too many.
    #[error("'{}' holds {found} .mtlx files; expected 1 to {most}", folder.display())]
    GraphCount {
        folder: PathBuf,
        /// The number of its `.mtlx` files.
        found: usize,
        /// The largest number.
        most: usize,
    },
    /// Two graphs have one name.
    #[error("'{}' has the graph '{name}', which is built in or in another file of its folder; give it another name", path.display())]
    SameGraph { path: PathBuf, name: String },
    /// How much randomness is kept is no share.
    #[error("the detail is {0}; expected 0 to 1")]
    Detail(f64),
    /// Graphs that cannot be used.
    #[error("{}", lines(.0))]
    BadGraphs(Vec<ProceduralError>),
    /// Graphs could not be fitted.
    #[error(transparent)]
    Procedural(#[from] ProceduralError),
    /// A scene has no input view.
    #[error("'{}' has no view 'input'; run `mateval prep verify`", .0.display())]
    NoInputView(PathBuf),
    /// The input picture is missing.
    #[error("'{}' does not exist: the scene has not been rendered; run `mateval prep render`", .0.display())]
    NoPhoto(PathBuf),
    /// The ground truth of a scene is withheld.
    #[error(
        "'{}' does not exist: this copy of the dataset holds no ground truth, from which the estimate 'gt' (the default) is \
         taken; give --estimate input, delight, or a folder of your method's pictures",
        .0.display()
    )]
    TruthWithheld(PathBuf),
    /// A folder without any de-lit photo of the dataset.
    #[error("'{}' holds no folder <scene>/ for any scene of the dataset; expected the output of `mateval baseline delight`", .0.display())]
    NothingDelit(PathBuf),
    /// No scene has a light of this name.
    #[error("'{}': no scene has a light named {}; expected names of its lights.json: {}", folder.display(), unknown.join(" or "), known.join(", "))]
    NoLight {
        /// The output of `mateval baseline delight`.
        folder: PathBuf,
        /// The names that were given.
        unknown: Vec<String>,
        /// The names of all lights, sorted.
        known: Vec<String>,
    },
    /// No built-in adapter and no file has this name.
    #[error("'{name}' is neither a built-in adapter nor a file; expected one of {known}, or a TOML file")]
    NoAdapter {
        /// The name that was given.
        name: String,
        /// The built-in adapters, separated by commas.
        known: String,
    },
    /// An adapter cannot be used.
    #[error("adapter '{}': {source}", path.display())]
    BadAdapter { path: PathBuf, source: AdapterError },
    /// None of the files that an adapter lists exists.
    #[error("no estimate: expected {}; fix the adapter's `files`, or run the method", list(paths))]
    NoEstimate {
        /// The files that were searched for.
        paths: Vec<PathBuf>,
    },
    /// No source of the scenes with pictures states what they show, so there is no truth to compare them with.
    #[error(
        "cannot compare {}: no scene that has such a picture has a source that states it; expected source.states_{} = true in the dataset; use another dataset, or compare base_color",
        maps.join(" and "), maps.join(" or source.states_")
    )]
    UnstatedTruth {
        /// The words of the maps, `roughness` or `metallic`.
        maps: Vec<&'static str>,
    },
    /// An estimate without any picture.
    #[error("the estimate of scene '{0}' holds no picture")]
    EmptyEstimate(String),
    /// A pixel is infinite or NaN after decoding.
    #[error("'{}': pixel {pixel:?} is not finite after decoding; fix the adapter's `encoding` or `range`, or the picture", path.display())]
    NotFinite { path: PathBuf, pixel: (usize, usize) },
    /// A value is far above what a material can have.
    #[error("'{}' holds {value} after decoding; expected linear values up to {largest}; if the numbers run from 0 to 255, write range = [0, 255] below the map in the adapter", path.display())]
    TooLarge {
        path: PathBuf,
        /// The first such value, linear.
        value: f32,
        /// The largest value that is accepted.
        largest: f32,
    },
    /// Many values are above what a material can have.
    #[error("'{}' holds values up to {value} after decoding, and {:.0} % of its pixels are above {bright}; expected linear values from 0 to 1; write range = [0, MAX] below the map in the adapter, where MAX is the stored number that stands for 1, or scale = \"free\" if nobody knows it", path.display(), 100.0 * share)]
    ManyTooLarge {
        path: PathBuf,
        /// The largest value, linear.
        value: f32,
        /// The value above which the pixels are counted.
        bright: f32,
        /// The share of such pixels.
        share: f64,
    },
    /// Numbers of bytes, saved as 16-bit integers.
    #[error("'{}' holds 16-bit integers that reach only {largest} of 65535; expected 65535 for 1; save them as 8-bit integers, or write range = [0.0, {high}] (255 of 65535) below the map in the adapter", path.display())]
    BytesInWords {
        path: PathBuf,
        /// The largest number.
        largest: u8,
        /// The share of 65535 that stands for 1.
        high: f32,
    },
    /// Many values are far below 0.
    #[error("'{}' holds {value}, and {:.0} % of its pixels are below 0, in the adapter's `range`; expected 0 to 1; if the numbers run from -1 to 1, write range = [-1.0, 1.0] below the map in the adapter", path.display(), 100.0 * share)]
    TooSmall {
        path: PathBuf,
        value: f32,
        /// The share of such pixels.
        share: f64,
    },
    /// An estimate has other proportions than the input view.
    #[error("the estimate of scene '{scene}' has {}x{} pixels, the input view {}x{}; expected the same proportions, within 5 %; {}", size.0, size.1, view.0, view.1, proportions_advice(*adapted))]
    Proportions {
        scene: String,
        /// Width and height of the estimate.
        size: (usize, usize),
        /// Width and height of the view.
        view: (usize, usize),
        /// Whether an adapter describes the pictures.
        adapted: bool,
    },
    /// TEXGen paints base colour, and the estimate has none.
    #[error("the estimate of scene '{0}' has no base_color; give an estimate with base_color")]
    NoColor(String),
    /// The pictures of one estimate differ in size.
    #[error("the estimate of scene '{scene}' in '{}' has pictures of {}x{} and of {}x{} pixels; expected one size", folder.display(), sizes[0].0, sizes[0].1, sizes[1].0, sizes[1].1)]
    Sizes {
        folder: PathBuf,
        scene: String,
        /// Width and height of two of them.
        sizes: [(usize, usize); 2],
    },
    /// A folder without a texture for any object.
    #[error("'{}' holds no <id>.png for any object of this dataset, such as living-00012.png; expected TEXGen's results for the objects of `baseline texgen-export`", .0.display())]
    NoTextures(PathBuf),
    /// A folder without labels for any instance.
    #[error("'{}' holds no <id>_0_{parts:02}.npy for any instance, such as living-00012_0_{parts:02}.npy, nor one with fewer parts; expected PartField's results for the meshes of `baseline partfield-export`", folder.display())]
    NoLabels {
        /// The folder that was searched.
        folder: PathBuf,
        /// The number of parts that was asked for.
        parts: u8,
    },
    /// Labels that cannot be used for their instance.
    #[error("'{}': {source}; export the instances again and run PartField on them", path.display())]
    BadLabels { path: PathBuf, source: LabelsError },
    /// A folder without a file for any scene.
    #[error("'{}' holds no file for any scene of the dataset; expected <scene>/<instance>.glb, <scene>.glb (or .gltf, .obj) or <scene>.json", .0.display())]
    NothingToImport(PathBuf),
    /// A file cannot be imported.
    #[error("'{}': {source}", path.display())]
    BadImport { path: PathBuf, source: ImportError },
    /// A scene's files describe none of its instances.
    #[error("'{}': the files for scene '{scene}' hold no triangles and name no part or instance; expected meshes, or the ids of scene.json", folder.display())]
    NothingNamed {
        /// The folder of imported files.
        folder: PathBuf,
        scene: String,
    },
    /// A scene's meshes lie too far from all its instances.
    #[error("'{}': no mesh for scene '{scene}' lies within {max_distance_m} m of any instance, the nearest {nearest_m:.3} m away; expected meshes in the dataset's world space (metres, +Y up), as in geometry/instances.glb, or moved from it by a scale, a turn and a shift; tried equal triangles, and the boxes of both meshes in 48 orders of axes: {}", folder.display(), best(*best_residual_m))]
    NothingNear {
        /// The folder of imported files.
        folder: PathBuf,
        scene: String,
        /// Smallest distance between a mesh and an instance, in metres.
        nearest_m: f64,
        /// Largest distance that counts, in metres.
        max_distance_m: f64,
        /// Smallest distance that a similarity leaves, in metres; none where no box has the right proportions.
        best_residual_m: Option<f64>,
    },
    /// The geometry cannot be traced.
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    /// The dataset could not be read, or the submission could not be written.
    #[error(transparent)]
    Dataset(#[from] mateval_dataset::SceneError),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

fn proportions_advice(adapted: bool) -> &'static str {
    if adapted {
        "if the method stretches the view to its own size, write placement = \"stretched\" at the top of the adapter, or \
         placement = \"centre_crop\" if it cuts off what lies outside its own proportions"
    } else {
        "if the method stretches the view to its own size, scale it back to the view's proportions; if it cuts off a part of \
         the view, save its pictures and lift them with an adapter that states placement = \"centre_crop\": mateval \
         baseline nn --estimate FOLDER --adapter FILE.toml"
    }
}

fn best(residual_m: Option<f64>) -> String {
    match residual_m {
        Some(residual_m) => format!("the best leaves {residual_m:.4} m (root mean square)"),
        None => "no box has the right proportions".to_owned(),
    }
}

fn lines(faults: &[ProceduralError]) -> String {
    faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

fn list(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| format!("'{}'", path.display())).collect::<Vec<_>>().join(" or ")
}

/// Why an adapter cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AdapterError {
    /// The file is not TOML, or its keys are wrong.
    #[error(transparent)]
    Toml(#[from] toml::de::Error),
    #[error("it names no file; expected base_color, roughness or metallic")]
    NoMap,
    #[error("base_color has a `channel`; only roughness and metallic may have one")]
    ColorChannel,
    #[error("`files` is empty; expected at least one path")]
    NoFiles,
    /// A range that is empty, reversed or not finite.
    #[error("range {0:?}; expected a smaller number, then a larger one")]
    Range([f32; 2]),
}

/// Why labels cannot be used for their instance.
#[derive(Debug, thiserror::Error)]
pub enum LabelsError {
    /// The file cannot be read or is too large.
    #[error(transparent)]
    Unreadable(#[from] std::io::Error),
    #[error(transparent)]
    Array(#[from] Malformed),
    /// The number of labels differs from the number of triangles.
    #[error("{labels} labels; '{instance}' has {triangles} triangles")]
    Count { labels: usize, instance: String, triangles: usize },
}
