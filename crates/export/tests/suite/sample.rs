//! The sample, exported.

use std::path::{Path, PathBuf};

use mateval_export::{ExportError, ExportOptions, Exported, Format, export};
use mateval_testkit::kept_folder::copy_folder;
use mateval_testkit::sample_dataset;

/// The folder of the sample; tests must not write to it.
pub fn root() -> &'static Path {
    &sample_dataset::dataset().root
}

/// A copy of the sample that a test may change.
pub fn copy() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_folder(root(), folder.path());
    folder
}

pub fn options(dataset: &Path, format: Format, out: PathBuf) -> ExportOptions {
    ExportOptions { dataset: dataset.to_owned(), format, out, publication: Default::default() }
}

/// Exports a dataset to `out` in a new folder.
pub fn exported(dataset: &Path, format: Format) -> (tempfile::TempDir, Result<Exported, ExportError>) {
    let folder = tempfile::tempdir().unwrap();
    let found = export(&options(dataset, format, folder.path().join("out")), &|_| ());
    (folder, found)
}

/// All formats.
pub const FORMATS: [Format; 5] =
    [Format::Tar, Format::Croissant, Format::Huggingface, Format::Nerfstudio, Format::Colmap];
