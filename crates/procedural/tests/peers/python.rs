//! Runs the Python scripts beside this file.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

/// Runs a script with the interpreter that this environment variable names, and returns what it prints.
fn run(variable: &str, script: &str, args: &[&OsStr]) -> Vec<u8> {
    let python = std::env::var_os(variable)
        .unwrap_or_else(|| panic!("{variable} names no Python: run tools/test_materialx.sh, which installs it"));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers").join(script);
    let output = Command::new(python).arg(&script).args(args).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {}\n{stderr}", script.display(), output.status);
    output.stdout
}

/// Runs a script that uses MaterialX.
pub fn with_materialx(script: &str, args: &[&OsStr]) -> Vec<u8> {
    run("MATEVAL_MATERIALX_PYTHON", script, args)
}

/// Runs a script that uses Blender.
pub fn with_blender(script: &str, job: &Path) {
    run("MATEVAL_PEERS_BLENDER", script, &[job.as_os_str()]);
}
