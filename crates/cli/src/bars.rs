//! Progress on stderr: a bar on a terminal, otherwise one line per step and per tenth of a step.

use std::io::IsTerminal as _;
use std::sync::Mutex;

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

struct Bars {
    bar: ProgressBar,
    shown: Mutex<Shown>,
}

/// The last line that was printed where stderr is no terminal.
#[derive(Default)]
struct Shown {
    step: String,
    tenths: usize,
}

impl Bars {
    fn new() -> Self {
        let bar = if std::io::stderr().is_terminal() { ProgressBar::new(1) } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("{elapsed_precise} {msg:24} {wide_bar} {pos}/{len}") {
            bar.set_style(style);
        }
        Self { bar, shown: Mutex::new(Shown::default()) }
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
        let tenths = 10 * done / total.max(1);
        if shown.step != step || tenths > shown.tenths {
            *shown = Shown { step: step.to_owned(), tenths };
            say(&format!("{step}: {done}/{total}"));
        }
    }
}
