//! The extension module `mateval._core` of the Python package.
//!
//! In: a dataset's folder, NumPy arrays. Out: NumPy arrays, a submission, reports, and Python exceptions with the text
//! that the command would print. The libraries do all the work. This crate converts values (`arrays`, `failure`) and
//! makes long work stop for Ctrl-C and survive `fork` (`long_work`, `pool`).
//!
//! What needs no Rust is written in Python, in `python/mateval`.

mod arrays;
mod camera;
mod command;
mod dataset;
mod delight;
mod failure;
mod instance;
mod lift;
mod long_work;
mod map_input;
mod metrics;
mod picture_file;
mod pool;
mod procedural;
mod reports;
mod scene;
mod scene_source;
mod submission;
mod truth;
mod view;

/// The extension module.
#[pyo3::pymodule]
mod _core {
    #[pymodule_export]
    use crate::camera::Camera;
    #[pymodule_export]
    use crate::command::main;
    #[pymodule_export]
    use crate::dataset::Dataset;
    #[pymodule_export]
    use crate::delight::{Delit, delight};
    #[pymodule_export]
    use crate::instance::{Instance, Mesh, Part};
    #[pymodule_export]
    use crate::lift::{Maps, lift};
    #[pymodule_export]
    use crate::metrics::{lpips, psnr, ssim};
    #[pymodule_export]
    use crate::procedural::procedural;
    #[pymodule_export]
    use crate::reports::{lint, score};
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::submission::Submission;
    #[pymodule_export]
    use crate::truth::Truth;
    #[pymodule_export]
    use crate::view::View;
}
