//! Runs the Python scripts beside this file.

use std::path::Path;
use std::process::Command;

/// Runs `tests/peers/<script>` with one job file; prints its output if it fails.
pub fn run(script: &str, job: &Path) {
    let python = std::env::var_os("MATEVAL_PEERS_PYTHON")
        .expect("MATEVAL_PEERS_PYTHON names no Python with mitsuba: run tools/test_peers.sh, which installs it");
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
