//! A Mitsuba 3 process that renders on request (`tests/peers/path_speed_mitsuba.py`).

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A process that has loaded a scene.
pub struct Mitsuba {
    process: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Mitsuba {
    /// Loads the folder `scene` for `variant` and renders once, so that everything is compiled.
    pub fn start(python: &OsStr, variant: &str, scene: &Path, size: u32, max_depth: u32, samples: u32) -> Self {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/peers/path_speed_mitsuba.py");
        let mut process = Command::new(python)
            .args([script.as_os_str(), OsStr::new(variant), scene.as_os_str()])
            .args([size.to_string(), max_depth.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (requests, answers) = (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        let mut mitsuba = Self { process, requests, answers };
        mitsuba.render(samples);
        mitsuba
    }

    /// Renders with `samples` per pixel and returns the CPU seconds it took.
    pub fn render(&mut self, samples: u32) -> f64 {
        writeln!(self.requests, "{samples}").unwrap();
        let mut answer = String::new();
        self.answers.read_line(&mut answer).unwrap();
        answer.trim().parse().unwrap()
    }
}

impl Drop for Mitsuba {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}
