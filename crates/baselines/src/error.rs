//! The one error of this crate.

use std::path::PathBuf;

/// Why a baseline could not be made.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// The file system refused.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was tried, as in "read" or "write".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The output exists and is never replaced.
    #[error("'{}' is already there; choose another --out", .0.display())]
    InTheWay(PathBuf),
    /// The output would be a part of the dataset.
    #[error("'{}' lies in the dataset, which must hold nothing else; choose another --out", .0.display())]
    InDataset(PathBuf),
    /// `--force` would remove something that is no submission.
    #[error("'{}' is there and holds no submission.json: it is not replaced; choose another --out", .0.display())]
    NotASubmission(PathBuf),
    /// A scene without the view that estimates are of.
    #[error("'{}' has no view 'input'; run `mateval prep verify`", .0.display())]
    NoInputView(PathBuf),
    /// The input picture is missing.
    #[error("'{}' is not there: the scene has not been rendered; run `mateval prep render`", .0.display())]
    NoPhoto(PathBuf),
    /// No adapter of that name, and no file.
    #[error("no adapter '{name}', and no file of that path; expected one of {known}, or a TOML file")]
    NoAdapter {
        /// What was asked for.
        name: String,
        /// Those that come with the tool.
        known: String,
    },
    /// An adapter that cannot be used.
    #[error("adapter '{}': {what}", path.display())]
    BadAdapter {
        /// Its file or name.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// None of an adapter's files is there.
    #[error("no estimate: expected {}; fix the adapter's `files`, or run the method", list(paths))]
    NoEstimate {
        /// Where it was looked for.
        paths: Vec<PathBuf>,
    },
    /// An adapter that gives nothing.
    #[error("the estimate of scene '{0}' holds no picture")]
    EmptyEstimate(String),
    /// A number that is infinite or none once it is decoded.
    #[error("'{}': pixel {pixel:?} is not finite once it is decoded; fix the adapter's `encoding` or `range`, or the picture", path.display())]
    NotFinite {
        /// The picture.
        path: PathBuf,
        /// Column and row.
        pixel: (usize, usize),
    },
    /// A picture of other proportions than the view.
    #[error("the estimate of scene '{scene}' has {}x{} pixels, the input view {}x{}; expected the same proportions", size.0, size.1, view.0, view.1)]
    Proportions {
        /// The scene's id.
        scene: String,
        /// Columns and rows.
        size: (usize, usize),
        /// Those of the view.
        view: (usize, usize),
    },
    /// A bridge that paints colours was given none.
    #[error("the estimate of scene '{0}' has no base_color; TEXGen paints nothing else: give an estimate that has it")]
    NoColor(String),
    /// Pictures of one estimate differ in size.
    #[error("the estimate of scene '{scene}' in '{}' has pictures of {}x{} and of {}x{} pixels; expected one size", folder.display(), sizes[0].0, sizes[0].1, sizes[1].0, sizes[1].1)]
    Sizes {
        /// The folder.
        folder: PathBuf,
        /// The scene's id.
        scene: String,
        /// Columns and rows of two.
        sizes: [(usize, usize); 2],
    },
    /// No texture of an object is there.
    #[error("'{}' holds no <id>.png of an object of this dataset, as living-00012.png; expected what TEXGen made of `baseline texgen-export`", .0.display())]
    NoTextures(PathBuf),
    /// No labels of any instance.
    #[error("'{}' holds no <id>_0_{parts:02}.npy or one of fewer parts, as living-00012_0_{parts:02}.npy; expected what PartField made of `baseline partfield-export`", folder.display())]
    NoLabels {
        /// Where they were looked for.
        folder: PathBuf,
        /// How many parts were asked for.
        parts: u8,
    },
    /// Labels that do not fit.
    #[error("'{}': {what}; export the instances anew and run PartField on them", path.display())]
    BadLabels {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// A folder without anything to import.
    #[error("'{}' holds nothing for any scene of the dataset; expected <scene>/<instance>.glb, <scene>.glb (or .gltf, .obj) or <scene>.json", .0.display())]
    NothingToImport(PathBuf),
    /// A file that cannot be imported.
    #[error("'{}': {what}", path.display())]
    BadImport {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// Files that say nothing.
    #[error("'{}': the files for scene '{scene}' hold no triangles and name no part or instance; expected meshes, or the ids of scene.json", folder.display())]
    NothingNamed {
        /// The folder of imports.
        folder: PathBuf,
        /// The scene's id.
        scene: String,
    },
    /// Files that lie elsewhere than the scene.
    #[error("'{}': nothing for scene '{scene}' lies within {max_distance_m} m of any instance, the nearest {nearest_m:.3} m away; expected meshes in the dataset's world space (metres, +Y up), as in geometry/instances.glb", folder.display())]
    NothingNear {
        /// The folder of imports.
        folder: PathBuf,
        /// The scene's id.
        scene: String,
        /// How near the files come.
        nearest_m: f64,
        /// How near they should.
        max_distance_m: f64,
    },
    /// The geometry cannot be traced.
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    /// The dataset could not be read, or the submission not written.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// A picture could not be written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

fn list(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| format!("'{}'", path.display())).collect::<Vec<_>>().join(" or ")
}
