//! How a command ends, and the two ways to print.

use std::io::Write as _;

use anyhow::Context as _;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Done and good.
    Good,
    /// Done, and the answer is no.
    No,
}

/// A result, to stdout. A reader that has gone away is no error; a full disk behind it is.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error).context("cannot write to stdout"),
        _ => Ok(()),
    }
}

/// An error and its causes in one text; our errors tell their cause themselves, and it is not told twice.
pub fn told(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |text, cause| match text.is_empty() {
        true => cause,
        false if text.ends_with(&cause) => text,
        false => format!("{text}: {cause}"),
    })
}

/// A word about the work, to stderr.
pub fn say(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// The findings that ask for attention, to stderr; notes are only counted.
pub fn say_findings(title: &str, findings: &[mateval_scene::Finding]) {
    let notes = findings.iter().filter(|finding| finding.severity == mateval_scene::Severity::Note).count();
    for finding in findings.iter().filter(|finding| finding.severity != mateval_scene::Severity::Note) {
        say(&format!("{title}: {finding}"));
    }
    if notes > 0 {
        say(&format!("{title}: {notes} notes more"));
    }
}
