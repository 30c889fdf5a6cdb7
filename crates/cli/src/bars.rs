//! Progress on stderr: one bar with the time that is left on a terminal, otherwise a line now and then.

use std::fmt::Write;
use std::io::IsTerminal as _;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use mateval_scene::{Progress, Report};

use crate::outcome::say;

/// Runs `work` and shows its progress; the bar is gone when this returns, so that a message does not share its line.
pub fn with_progress<T>(work: impl FnOnce(Progress<'_>) -> T) -> T {
    let bars = Bars::new();
    let result = work(&|report| bars.show(report));
    bars.bar.finish_and_clear();
    result
}

/// The least time between two lines of progress.
const PAUSE: Duration = Duration::from_secs(10);

struct Bars {
    bar: ProgressBar,
    state: Mutex<State>,
}

struct State {
    /// The number of parts of the whole; 1 as long as none was reported.
    parts: usize,
    /// What the last part is called.
    part: String,
    /// When the last line was printed where stderr is no terminal.
    printed: Instant,
}

impl Bars {
    fn new() -> Self {
        let bar = if std::io::stderr().is_terminal() { ProgressBar::new(1) } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("{elapsed_precise} {msg:32!} {wide_bar} {pos}/{len}{left}") {
            bar.set_style(style.with_key("left", write_time_left));
        }
        Self { bar, state: Mutex::new(State { parts: 1, part: String::new(), printed: Instant::now() }) }
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
        self.bar.set_message(name.to_owned());
        // With several parts the bar counts these: a step of one part says nothing about the time of the others.
        if matches!(report, Report::Part { .. }) || state.parts == 1 {
            self.bar.set_length(total as u64);
            self.bar.set_position(done as u64);
        }
        if self.bar.is_hidden() && state.printed.elapsed() >= PAUSE {
            state.printed = Instant::now();
            // Many a step names its scene itself.
            let scene = state.part.strip_prefix("scene ").unwrap_or(&state.part);
            let part = if name.contains(scene) { String::new() } else { format!("{}, ", state.part) };
            say(&format!("{part}{name}: {done}/{total}"));
        }
    }
}

/// Nothing before the first part is done: until then there is nothing to reckon from.
fn write_time_left(state: &ProgressState, text: &mut dyn Write) {
    if state.pos() > 0 {
        // Only a full line could fail, and the bar is then cut in any case.
        let _ = write!(text, ", {:#} left", HumanDuration(state.eta()));
    }
}
