//! Progress on stderr: bars on a terminal, a line a step elsewhere.

use std::io::IsTerminal as _;
use std::sync::Mutex;

use indicatif::{ProgressBar, ProgressStyle};

use crate::outcome::say;

/// Shows how far a command is.
pub struct Bars {
    bar: ProgressBar,
    shown: Mutex<Shown>,
}

#[derive(Default)]
struct Shown {
    step: String,
    tenths: usize,
}

impl Bars {
    /// Nothing is shown until the first step.
    pub fn new() -> Self {
        let bar = if std::io::stderr().is_terminal() { ProgressBar::new(1) } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("{elapsed_precise} {msg:24} {wide_bar} {pos}/{len}") {
            bar.set_style(style);
        }
        Self { bar, shown: Mutex::new(Shown::default()) }
    }

    /// `done` of `all` of the step are done.
    pub fn step(&self, step: &str, done: usize, all: usize) {
        self.bar.set_length(all as u64);
        self.bar.set_position(done as u64);
        self.bar.set_message(step.to_owned());
        if !std::io::stderr().is_terminal() {
            self.say_step(step, done, all);
        }
    }

    /// A line for every new step and every tenth of it.
    fn say_step(&self, step: &str, done: usize, all: usize) {
        // A panic elsewhere while the lock was held leaves nothing here half-changed.
        let mut shown = self.shown.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let tenths = 10 * done / all.max(1);
        if shown.step != step || tenths > shown.tenths {
            *shown = Shown { step: step.to_owned(), tenths };
            say(&format!("{step}: {done}/{all}"));
        }
    }
}

impl Drop for Bars {
    /// Takes the bar away, before an error is said too.
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
