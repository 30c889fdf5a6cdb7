//! Graphs evaluated by the OSL that MaterialX generates, in Blender's Cycles, by the Python scripts beside this file.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

use mateval_procedural::Graph;
use mateval_procedural::mtlx::to_text;
use serde_json::{Value, json};

/// The number of places at which graphs are evaluated.
pub const PLACES: usize = 4096;

/// The values of an input: at place k, `((k * step + start) % modulus) * scale + offset`. All are dyadic numbers, so
/// that single precision holds them exactly.
#[derive(Clone, Debug)]
pub struct Input {
    /// The name of a float parameter of the graph, or `place_u`, `place_v`.
    pub name: String,
    pub step: usize,
    pub start: usize,
    pub modulus: usize,
    pub scale: f64,
    pub offset: f64,
}

impl Input {
    /// The value at a place.
    pub fn at(&self, place: usize) -> f64 {
        ((place * self.step + self.start) % self.modulus) as f64 * self.scale + self.offset
    }

    fn json(&self) -> Value {
        json!({
            "name": self.name, "step": self.step, "start": self.start, "modulus": self.modulus,
            "scale": self.scale, "offset": self.offset,
        })
    }
}

/// The base colours of graphs of distinct names at all places.
pub fn evaluate(cases: &[(Graph, Vec<Input>)]) -> Vec<Vec<[f32; 3]>> {
    let folder = tempfile::tempdir().unwrap();
    for (graph, _) in cases {
        std::fs::write(folder.path().join(format!("{}.mtlx", graph.name)), to_text(graph)).unwrap();
    }
    with_materialx("generate_osl.py", &[folder.path().as_os_str()]);
    let out = folder.path().join("colors");
    let job = folder.path().join("job.json");
    std::fs::write(&job, job_text(cases, folder.path(), &out)).unwrap();
    with_blender("evaluate_osl.py", &job);
    let bytes = std::fs::read(&out).unwrap();
    assert_eq!(bytes.len(), cases.len() * PLACES * 12);
    let float = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().unwrap());
    let color = |bytes: &[u8]| [float(&bytes[..4]), float(&bytes[4..8]), float(&bytes[8..])];
    bytes.chunks(PLACES * 12).map(|case| case.chunks(12).map(color).collect()).collect()
}

fn job_text(cases: &[(Graph, Vec<Input>)], folder: &Path, out: &Path) -> String {
    let case = |(graph, inputs): &(Graph, Vec<Input>)| {
        let shader = folder.join(format!("{}.osl", graph.name));
        json!({ "shader": shader, "inputs": inputs.iter().map(Input::json).collect::<Vec<_>>() })
    };
    json!({ "cases": cases.iter().map(case).collect::<Vec<_>>(), "out": out }).to_string()
}

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
