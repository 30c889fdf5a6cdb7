//! How a command ends, and all that is printed: results on stdout, progress and messages on stderr.

use std::io::{IsTerminal as _, Write as _};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use console::Term;
use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
pub use mateval_dataset::ids::counted;
use mateval_dataset::progress::fitted;
use mateval_dataset::{Finding, Progress, Report, Severity};

/// The name and version of this program, which datasets and results record, as in `mateval 0.1.0`.
pub const TOOL: &str = concat!("mateval ", env!("CARGO_PKG_VERSION"));

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

/// Prints lines of sentences to stdout, wrapped between words where that is a terminal; fails as [`print()`] does.
pub fn print_fitted(text: &str) -> anyhow::Result<()> {
    match columns() {
        Some(columns) => print(&fitted(text, columns)),
        None => print(text),
    }
}

/// The width of the terminal that shows stdout; absent where stdout is none.
pub fn columns() -> Option<usize> {
    Term::stdout().size_checked().map(|(_, columns)| usize::from(columns))
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

/// Prints warnings and errors to stderr, each after `title`.
pub fn say_warnings(title: &str, findings: &[Finding]) {
    for finding in findings.iter().filter(|finding| finding.severity != Severity::Note) {
        say(&format!("{title}: {finding}"));
    }
}

/// Prints warnings and errors as [`say_warnings`] does; notes are only counted, and can be read in `file`.
pub fn say_findings(title: &str, findings: &[Finding], file: &str) {
    say_warnings(title, findings);
    let notes = findings.iter().filter(|finding| finding.severity == Severity::Note).count();
    if notes > 0 {
        say(&format!("{title}: {}, in {file}", counted(notes, "note")));
    }
}

/// Runs `work` and shows its progress; the bar is gone when this returns, so that a message does not share its line.
pub fn with_progress<T>(work: impl FnOnce(Progress<'_>) -> T) -> T {
    let bars = Bars::new();
    let result = work(&|report| bars.show(report));
    bars.bar.finish_and_clear();
    result
}

/// The least and the most time between two lines of progress. Between them it is a tenth of the time elapsed, so that the
/// log of a day's work has a hundred lines or two.
const PAUSE: [Duration; 2] = [Duration::from_secs(10), Duration::from_secs(600)];

/// The time between two lines of progress after this time.
fn pause(elapsed: Duration) -> Duration {
    (elapsed / 10).clamp(PAUSE[0], PAUSE[1])
}

struct Bars {
    bar: ProgressBar,
    state: Mutex<State>,
}

struct State {
    /// The number of parts of the whole; 1 as long as none was reported.
    parts: usize,
    /// What the last part is called.
    part: String,
    /// The pace of the pieces that the bar counts, from which the remaining time is estimated.
    measure: Option<Measure>,
    begun: Instant,
    /// When the last line was printed where stderr is no terminal.
    printed: Instant,
}

/// Progress since the first report of a step.
struct Measure {
    /// The name of the step; absent if the bar counts parts, which have names of their own.
    step: Option<String>,
    /// Pieces that were finished at the first report, such as those of an earlier run.
    before: usize,
    since: Instant,
}

/// Fewest measured pieces, and the shortest time, that allow an estimate of the remaining time: single pieces differ.
const LEAST_MEASURED: usize = 10;
const LEAST_TIME: Duration = Duration::from_secs(10);
/// Columns of the text before the bar.
const LABEL: usize = 40;

impl Measure {
    /// `, 20s left`, or an empty text while too little was measured or where less than a second is left.
    fn time_left(&self, done: usize, total: usize, now: Instant) -> String {
        let (measured, time) = (done.saturating_sub(self.before), now - self.since);
        if measured < LEAST_MEASURED || time < LEAST_TIME {
            return String::new();
        }
        let seconds = time.as_secs_f64() / measured as f64 * total.saturating_sub(done) as f64;
        match seconds < 1.0 {
            true => String::new(),
            false => format!(", {:#} left", HumanDuration(Duration::from_secs_f64(seconds))),
        }
    }
}

impl Bars {
    fn new() -> Self {
        let bar = if std::io::stderr().is_terminal() { ProgressBar::new(1) } else { ProgressBar::hidden() };
        let template = format!("{{elapsed_precise}} {{msg:{LABEL}!}} {{wide_bar}} {{pos}}/{{len}}{{prefix}}");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style);
        }
        let now = Instant::now();
        let state = State { parts: 1, part: String::new(), measure: None, begun: now, printed: now };
        Self { bar, state: Mutex::new(state) }
    }

    fn show(&self, report: Report<'_>) {
        // The lock guards plain assignments, so a thread that panicked while it held the lock left them whole.
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let (name, done, total) = match report {
            Report::Message(text) => return self.bar.suspend(|| say(text)),
            Report::Part { name, done, total } => {
                state.parts = total;
                name.clone_into(&mut state.part);
                (name, done, total)
            }
            Report::Step { name, done, total } => (name, done, total),
        };
        let is_step_of_a_part = matches!(report, Report::Step { .. }) && state.parts > 1;
        self.bar.set_message(label(name, is_step_of_a_part.then_some([done, total])));
        // With several parts the bar counts these: a step of one part says nothing about the time of the others.
        if !is_step_of_a_part {
            self.bar.set_length(total as u64);
            self.bar.set_position(done as u64);
            let step = matches!(report, Report::Step { .. }).then(|| name.to_owned());
            let (now, measure) = (Instant::now(), state.measure.take().filter(|measure| measure.step == step));
            let measure = measure.unwrap_or(Measure { step, before: done, since: now });
            self.bar.set_prefix(measure.time_left(done, total, now));
            state.measure = Some(measure);
        }
        if self.bar.is_hidden() && state.printed.elapsed() >= pause(state.begun.elapsed()) {
            state.printed = Instant::now();
            // Many a step names its scene itself.
            let scene = state.part.strip_prefix("scene ").unwrap_or(&state.part);
            let part = if name.contains(scene) { String::new() } else { format!("{}, ", state.part) };
            say(&format!("{part}{name}: {done}/{total}"));
        }
    }
}

/// The text before the bar. Where the bar counts parts, a step's own count follows its name, which is cut to make room.
fn label(name: &str, count: Option<[usize; 2]>) -> String {
    let count = count.map_or_else(String::new, |[done, total]| format!(" {done}/{total}"));
    let room = LABEL.saturating_sub(count.len());
    match name.chars().count() <= room {
        true => format!("{name}{count}"),
        false => format!("{}…{count}", name.chars().take(room.saturating_sub(1)).collect::<String>()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute of work has 6 lines, and a day some 200.
    #[test]
    fn lines_of_progress_become_rarer() {
        let lines = |seconds: u64| {
            let (mut now, mut count) = (Duration::ZERO, 0);
            while now <= Duration::from_secs(seconds) {
                now += pause(now);
                count += 1;
            }
            count - 1
        };
        assert_eq!(lines(60), 6);
        assert!((30..60).contains(&lines(4000)) && (150..250).contains(&lines(86_400)), "{}", lines(86_400));
    }

    #[test]
    fn one_takes_the_singular() {
        assert_eq!([0, 1, 2].map(|count| counted(count, "note")), ["0 notes", "1 note", "2 notes"]);
    }

    #[test]
    fn the_time_left_comes_from_ten_measured_pieces() {
        let since = Instant::now();
        let measure = Measure { step: None, before: 100, since };
        let after = |seconds| since + Duration::from_secs(seconds);
        assert_eq!(measure.time_left(109, 200, after(9)), "", "pieces of an earlier run took no time of this one");
        assert_eq!(measure.time_left(110, 200, after(20)), ", 3m left");
        assert_eq!(measure.time_left(190, 200, after(9)), "", "too early");
        assert_eq!(measure.time_left(199, 200, after(199)), ", 2s left");
        assert_eq!(measure.time_left(199, 200, after(60)), "", "never 0s left");
        assert_eq!(measure.time_left(200, 200, after(200)), "");
    }

    #[test]
    fn a_label_keeps_the_count_and_cuts_the_name() {
        assert_eq!(label("hashes", None), "hashes");
        assert_eq!(label("scene room: relit", Some([3, 12])), "scene room: relit 3/12");
        let long = label("scene sample-living-4: reference of turned views", Some([100, 900]));
        assert_eq!(long, "scene sample-living-4: referenc… 100/900");
        assert_eq!(long.chars().count(), LABEL);
    }
}
