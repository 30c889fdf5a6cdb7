//! The command `mateval` for the console script.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the command with these words, of which the first is the program's name, and returns its exit code.
#[pyfunction]
pub fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| mateval_cli::main(words))
}
