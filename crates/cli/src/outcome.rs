//! How a command ends, and the functions that print.

use std::io::Write as _;

use anyhow::Context as _;
use console::Term;
use mateval_report::tables::wrapped;
use mateval_scene::{Finding, Severity};

/// How a command that did its work ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Exit code 0: the answer is good, or the command asks no question.
    Good,
    /// Exit code 1: the answer is no.
    No,
}

/// Prints a result to stdout. Fails if it cannot be written, for example to a full disk, but not if the reader has
/// closed the pipe.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    written(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
}

/// Prints a help text or the version to stdout, in colours on a terminal; fails as [`print()`] does.
pub fn print_help(help: &clap::Error) -> anyhow::Result<()> {
    written(help.print().and_then(|()| std::io::stdout().flush()))
}

fn written(result: std::io::Result<()>) -> anyhow::Result<()> {
    match result {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error).context("cannot write to stdout"),
        _ => Ok(()),
    }
}

/// An error and its causes on one line. Our own errors end with their cause, which is then not repeated.
pub fn error_text(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |text, cause| match text.is_empty() {
        true => cause,
        false if text.ends_with(&cause) => text,
        false => format!("{text}: {cause}"),
    })
}

/// Prints a line about the work to stderr, wrapped between words where that is a terminal.
pub fn say(text: &str) {
    let text = match Term::stderr().size_checked() {
        Some((_, columns)) => fitted(text, usize::from(columns)),
        None => text.to_owned(),
    };
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// The text with each line wrapped that is wider than the terminal.
fn fitted(text: &str, columns: usize) -> String {
    let lines: Vec<String> = text.split('\n').flat_map(|line| wrapped(line.split(' '), "", "  ", columns)).collect();
    lines.join("\n")
}

/// A count with its noun: `1 scene`, `2 scenes`.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Prints warnings and errors to stderr, each after `title`; notes are only counted, and can be read in `file`.
pub fn say_findings(title: &str, findings: &[Finding], file: &str) {
    let notes = findings.iter().filter(|finding| finding.severity == Severity::Note).count();
    for finding in findings.iter().filter(|finding| finding.severity != Severity::Note) {
        say(&format!("{title}: {finding}"));
    }
    if notes > 0 {
        say(&format!("{title}: {}, in {file}", counted(notes, "note")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_fit_are_left_alone_and_others_wrapped() {
        let text = "1/6  sample      2 s\nerror: 'a b' does not exist";
        assert_eq!(fitted(text, 80), text);
        assert_eq!(fitted(text, 20), "1/6  sample      2 s\nerror: 'a b' does\n  not exist");
    }

    #[test]
    fn one_takes_the_singular() {
        assert_eq!([0, 1, 2].map(|count| counted(count, "note")), ["0 notes", "1 note", "2 notes"]);
    }
}
