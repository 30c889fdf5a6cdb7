//! Progress on stderr: a bar on a terminal, otherwise a line now and then.

use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use mateval_scene::Progress;

use crate::outcome::say;

/// Runs `work` and shows its progress; the bar is gone when this returns, so that a message does not share its line.
pub fn with_progress<T>(work: impl FnOnce(Progress<'_>) -> T) -> T {
    let bars = Bars::new();
    let result = work(&|step, done, total| bars.step(step, done, total));
    bars.bar.finish_and_clear();
    result
}

/// The least time between two lines of progress.
const PAUSE: Duration = Duration::from_secs(10);

struct Bars {
    bar: ProgressBar,
    shown: Mutex<Shown>,
}

/// The last line that was printed where stderr is no terminal.
struct Shown {
    at: Instant,
    message: String,
}

impl Bars {
    fn new() -> Self {
        let bar = if std::io::stderr().is_terminal() { ProgressBar::new(1) } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("{elapsed_precise} {msg:24} {wide_bar} {pos}/{len}") {
            bar.set_style(style);
        }
        Self { bar, shown: Mutex::new(Shown { at: Instant::now(), message: String::new() }) }
    }

    fn step(&self, step: &str, done: usize, total: usize) {
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        self.bar.set_message(step.to_owned());
        if !std::io::stderr().is_terminal() {
            self.print_step(step, done, total);
        }
    }

    fn print_step(&self, step: &str, done: usize, total: usize) {
        // The lock guards plain assignments, so a thread that panicked while it held the lock left them whole.
        let mut shown = self.shown.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        // What has one part and has not begun it may be a message, which must not be lost.
        let is_message = (done, total) == (0, 1) && shown.message != step;
        if is_message || shown.at.elapsed() >= PAUSE {
            *shown = Shown { at: Instant::now(), message: step.to_owned() };
            say(&format!("{step}: {done}/{total}"));
        }
    }
}
