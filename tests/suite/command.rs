//! Runs the command as a user would.

use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output};

/// How a run ended and what it printed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Run {
    /// The exit code; none if a signal ended the process.
    pub code: Option<i32>,
    /// All of stdout.
    pub stdout: String,
    /// All of stderr.
    pub stderr: String,
}

/// `mateval`, without arguments.
pub fn mateval() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mateval"));
    command.stdin(std::process::Stdio::null());
    command
}

/// Runs the command and captures its output.
pub fn run(command: &mut Command) -> Run {
    Run::of(command.output().unwrap())
}

/// Runs `mateval` with these arguments.
pub fn run_words<W: AsRef<OsStr>>(words: impl IntoIterator<Item = W>) -> Run {
    run(mateval().args(words))
}

impl Run {
    /// The run of a process that has ended.
    pub fn of(Output { status, stdout, stderr }: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Self { code: status.code(), stdout: text(stdout), stderr: text(stderr) }
    }

    /// Panics with the complete output if the exit code differs.
    #[track_caller]
    pub fn ends_with(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "stdout:\n{}\nstderr:\n{}", self.stdout, self.stderr);
        self
    }

    /// Panics if stderr does not contain the text.
    #[track_caller]
    pub fn says(self, text: &str) -> Self {
        assert!(self.stderr.contains(text), "expected '{text}' in stderr:\n{}", self.stderr);
        self
    }

    /// Panics if stdout does not contain the text.
    #[track_caller]
    pub fn prints(self, text: &str) -> Self {
        assert!(self.stdout.contains(text), "expected '{text}' in stdout:\n{}", self.stdout);
        self
    }

    /// The line of stderr that starts with `error:`, with everything after it; empty if there is none.
    pub fn error(&self) -> &str {
        self.stderr.find("error:").map_or("", |at| &self.stderr[at..])
    }
}

/// `mateval prep build RECIPE --out DATASET`.
pub fn build(recipe: &Path, dataset: &Path) -> Command {
    let mut command = mateval();
    command.args(["prep", "build"]).arg(recipe).arg("--out").arg(dataset);
    command
}

/// `mateval prep render DATASET --samples SAMPLES`, with references that only have to exist.
pub fn render(dataset: &Path, samples: u32) -> Command {
    render_for_scores(dataset, samples, 2)
}

/// The same with enough samples in the references for scores under light.
pub fn render_for_scores(dataset: &Path, samples: u32, references: u32) -> Command {
    let mut command = mateval();
    let [samples, references] = [samples, references].map(|number| number.to_string());
    command.args(["prep", "render", "--samples", &samples, "--scorer-samples", &references]).arg(dataset);
    command
}

/// The photos alone, for what computes no score under light.
pub fn render_photos(dataset: &Path, samples: u32) -> Command {
    let mut command = render(dataset, samples);
    command.args(["--only", "photo"]);
    command
}

/// `mateval prep verify DATASET --format json`.
pub fn verify(dataset: &Path) -> Command {
    let mut command = mateval();
    command.args(["prep", "verify", "--format", "json"]).arg(dataset);
    command
}

/// `mateval prep stats DATASET`.
pub fn stats(dataset: &Path) -> Command {
    let mut command = mateval();
    command.args(["prep", "stats"]).arg(dataset);
    command
}

/// `mateval baseline NAME --dataset DATASET --out SUBMISSION`.
pub fn baseline(name: &str, dataset: &Path, submission: &Path) -> Command {
    let mut command = mateval();
    command.args(["baseline", name, "--dataset"]).arg(dataset).arg("--out").arg(submission);
    command
}

/// `mateval eval score SUBMISSION --dataset DATASET --out RESULT` under both protocols.
pub fn score(submission: &Path, dataset: &Path, result: &Path) -> Command {
    score_under(&["mateval-3", "paper"], submission, dataset, result)
}

/// The same under these protocols.
pub fn score_under(protocols: &[&str], submission: &Path, dataset: &Path, result: &Path) -> Command {
    let mut command = mateval();
    command.args(["eval", "score"]);
    for protocol in protocols {
        command.arg("--protocol").arg(protocol);
    }
    command.arg(submission).arg("--dataset").arg(dataset).arg("--out").arg(result);
    command
}
