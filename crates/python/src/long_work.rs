//! Runs long work so that Ctrl-C ends the call and Python hears of its progress, and turns errors into exceptions.
//!
//! Python's signal handlers run in its main thread, and only when that thread asks for them. The work therefore runs in
//! the pool, which owns its inputs, while the calling thread waits and asks several times a second. After an interrupt
//! the call returns at once. The work itself ends at its next report of progress, by unwinding; until then it takes
//! processor time, but nobody sees its result, and later calls have other threads.
//!
//! There is one pool for each process. `fork` copies the memory of a pool but none of its threads, so a child that used
//! its parent's pool would wait for ever. PyTorch's data loaders fork. Each process therefore gets its own pool when it
//! first needs one, and the global pool of rayon is never used.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use mateval_dataset::{Progress, Report};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// How long signals may wait.
const BETWEEN_SIGNALS: Duration = Duration::from_millis(50);

/// The payload with which unwanted work unwinds.
struct Unwanted;

/// What Python hears of long work: what `mateval.progress.listener` makes of the argument `progress` of a call.
pub struct Listener<'py>(Option<Bound<'py, PyAny>>);

impl<'py> Listener<'py> {
    /// For work of less than a second.
    pub fn none() -> Self {
        Self(None)
    }

    /// Fails where `progress` is neither None, a bool nor callable.
    pub fn of(py: Python<'py>, progress: Option<Bound<'py, PyAny>>) -> PyResult<Self> {
        let listener = py.import("mateval.progress")?.getattr("listener")?.call1((progress,))?;
        Ok(Self((!listener.is_none()).then_some(listener)))
    }

    /// Passes on what was reported since the last call.
    fn hear(&self, reported: &Mutex<Reported>) -> PyResult<()> {
        let reported = std::mem::take(&mut *reported.lock().unwrap_or_else(PoisonError::into_inner));
        let Some(listener) = &self.0 else { return Ok(()) };
        for message in reported.messages {
            listener.call_method1("message", (message,))?;
        }
        for (name, done, total) in [reported.part, reported.step].into_iter().flatten() {
            listener.call1((name, done, total))?;
        }
        Ok(())
    }
}

/// Ends what a listener shows, as a bar, however the call ends.
struct Closed<'a, 'py>(&'a Listener<'py>);

impl Drop for Closed<'_, '_> {
    fn drop(&mut self) {
        // Nothing can be done about a bar that cannot be removed.
        let _ = self.0.0.as_ref().map(|listener| listener.call_method0("close"));
    }
}

/// The last reports of long work, each with what is done and how much there is of it.
#[derive(Default)]
struct Reported {
    part: Option<(String, usize, usize)>,
    step: Option<(String, usize, usize)>,
    messages: Vec<String>,
}

impl Reported {
    fn add(&mut self, report: Report<'_>) {
        match report {
            // Steps belong to the part that began last.
            Report::Part { name, done, total } => (self.part, self.step) = (Some((name.to_owned(), done, total)), None),
            Report::Step { name, done, total } => self.step = Some((name.to_owned(), done, total)),
            Report::Message(text) => self.messages.push(text.to_owned()),
        }
    }
}

/// Runs `work` in this process's pool, detached from Python, and returns its result. Fails with the exception of a
/// signal's handler, as `KeyboardInterrupt`, or of the listener. Panics where the work does.
pub fn run_long<T: Send + 'static>(
    py: Python<'_>,
    listener: &Listener<'_>,
    work: impl FnOnce(Progress<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    let unwanted = Arc::new(AtomicBool::new(false));
    let is_unwanted = Arc::clone(&unwanted);
    let reported = Arc::new(Mutex::new(Reported::default()));
    let reports = Arc::clone(&reported);
    let (sender, mut receiver) = channel();
    pool(py)?.spawn(move || {
        let progress = |report: Report<'_>| {
            if is_unwanted.load(Ordering::Relaxed) {
                resume_unwind(Box::new(Unwanted));
            }
            reports.lock().unwrap_or_else(PoisonError::into_inner).add(report);
        };
        // After a panic nothing of the work is used again: it owns its inputs.
        let result = catch_unwind(AssertUnwindSafe(|| work(&progress)));
        // After an interrupt nobody receives it.
        let _ = sender.send(result);
    });
    let _closed = Closed(listener);
    loop {
        let received;
        (receiver, received) = py.detach(move || {
            let received = receiver.recv_timeout(BETWEEN_SIGNALS);
            (receiver, received)
        });
        match received {
            Ok(Ok(result)) => {
                listener.hear(&reported)?;
                return Ok(result);
            }
            Ok(Err(panic)) => resume_unwind(panic),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(interrupt) = py.check_signals().and_then(|()| listener.hear(&reported)) {
                    unwanted.store(true, Ordering::Relaxed);
                    abandon_pool(py);
                    return Err(interrupt);
                }
            }
            Err(RecvTimeoutError::Disconnected) => unreachable!("the work always sends a result"),
        }
    }
}

/// Several calls may wait on one thread, each below the other on its stack.
const STACK_BYTES: usize = 32 << 20;

struct OwnedPool {
    process: u32,
    pool: Arc<ThreadPool>,
}

static POOL: Mutex<Option<OwnedPool>> = Mutex::new(None);

/// This process's pool. Only threads that are attached to Python take the lock, and so is the thread that calls `fork`:
/// in the child the lock is free.
pub fn pool(_attached: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    let mut owned = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some(owned) = owned.as_ref().filter(|owned| owned.process == process) {
        return Ok(Arc::clone(&owned.pool));
    }
    let pool = Arc::new(ThreadPoolBuilder::new().stack_size(STACK_BYTES).build().map_err(failed)?);
    let parents = owned.replace(OwnedPool { process, pool: Arc::clone(&pool) });
    // Dropping the parent's pool would wake threads that do not exist here.
    std::mem::forget(parents);
    Ok(pool)
}

/// Lets the threads of this process end with their work; the next call gets new ones. Work that nobody wants any more
/// would keep them from later calls.
pub fn abandon_pool(_attached: Python<'_>) {
    let mut owned = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    owned.take_if(|owned| owned.process == std::process::id());
}

/// What a notebook shows of an object: HTML of a function of `mateval.display`.
pub fn shown_in_notebook<'py, T>(object: &Bound<'py, T>, function: &str) -> PyResult<Bound<'py, PyAny>> {
    object.py().import("mateval.display")?.getattr(function)?.call1((object.as_any(),))
}

/// An exception of the package `mateval.errors`: `mateval.Error` with the text that the command prints after `error: `,
/// in which options are arguments.
pub fn failed(error: impl Into<anyhow::Error>) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    exception(&CLASS, "Error", with_arguments(&mateval_cli::error_text(&error.into())))
}

/// `--force` as `force=True` and `--atlas-size` as `atlas_size`, but for commands in backticks.
fn with_arguments(text: &str) -> String {
    let prose = |part: &str| {
        let mut pieces = part.split("--");
        let mut changed = pieces.next().unwrap_or_default().to_owned();
        for piece in pieces {
            let is_option = piece.starts_with(|c: char| c.is_ascii_lowercase());
            let end = piece.find(|c: char| !c.is_ascii_lowercase() && c != '-').unwrap_or(piece.len());
            match &piece[..end] {
                _ if !is_option => changed.extend(["--", piece]),
                "force" => changed.extend(["force=True", &piece[end..]]),
                name => changed.extend([&*name.replace('-', "_"), &piece[end..]]),
            }
        }
        changed
    };
    let parts = text.split('`').enumerate();
    parts.map(|(at, part)| if at % 2 == 0 { prose(part) } else { part.to_owned() }).collect::<Vec<_>>().join("`")
}

/// `mateval.UnknownId`.
pub fn unknown_id(message: String) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    exception(&CLASS, "UnknownId", message)
}

/// `mateval.WrongShape`. Not for files, whose shapes the caller did not choose.
pub fn wrong_shape(message: String) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    exception(&CLASS, "WrongShape", message)
}

/// `mateval.Withheld`.
pub fn withheld(message: String) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    exception(&CLASS, "Withheld", message)
}

fn exception(class: &'static PyOnceLock<Py<PyType>>, name: &str, message: String) -> PyErr {
    Python::attach(|py| match class.import(py, "mateval.errors", name) {
        Ok(class) => PyErr::from_type(class.clone(), message),
        // The extension module was copied out of its package.
        Err(_) => PyRuntimeError::new_err(message),
    })
}
