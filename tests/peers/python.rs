//! Runs the Python scripts beside this file.

use std::path::Path;
use std::process::Command;

/// A Python that has a renderer, by the variable that names it.
#[derive(Clone, Copy)]
pub enum Python {
    Mitsuba,
    Blender,
}

/// Runs `tests/peers/<script>` with one job file; its output is shown when it fails.
pub fn run(python: Python, script: &str, job: &Path) {
    let name = match python {
        Python::Mitsuba => "MATEVAL_PEERS_PYTHON",
        Python::Blender => "MATEVAL_PEERS_BLENDER",
    };
    let python = std::env::var_os(name)
        .unwrap_or_else(|| panic!("{name} names no Python: run tools/test_peers.sh, which installs the renderers"));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers").join(script);
    let output = Command::new(&python).arg(&script).arg(job).output().unwrap();
    assert!(
        output.status.success(),
        "{} {}: {}\n{}\n{}",
        script.display(),
        job.display(),
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}
