//! The extension module `mateval._core` of the Python package.
//!
//! In: a dataset's folder, NumPy arrays. Out: NumPy arrays, a submission, reports, and Python exceptions with the text
//! that the command would print. The libraries do all the work. This crate converts values (`arrays`) and makes long
//! work stop for Ctrl-C and survive `fork` (`long_work`).
//!
//! What needs no Rust is written in Python, in `python/mateval`.

mod arrays;
mod baselines;
mod dataset;
mod instance;
mod long_work;
mod reports;
mod submission;
mod view;

use std::ffi::OsString;

use pyo3::prelude::*;

/// The extension module.
#[pyo3::pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::arrays::{png, srgb_bytes};
    #[pymodule_export]
    use crate::baselines::{Delit, Maps, delight, lift, procedural, rebuilt_maps};
    #[pymodule_export]
    use crate::dataset::{Dataset, Scene, render};
    #[pymodule_export]
    use crate::instance::{Instance, Mesh, Part};
    #[pymodule_export]
    use crate::main;
    #[pymodule_export]
    use crate::reports::{lint, lpips, psnr, rank, read_result, score, ssim, tables};
    #[pymodule_export]
    use crate::submission::Submission;
    #[pymodule_export]
    use crate::view::{Camera, Truth, View, rebuilt_camera};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}

/// Runs the command with these words, of which the first is the program's name, and returns its exit code.
#[pyfunction]
pub fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| mateval_cli::main(words))
}
