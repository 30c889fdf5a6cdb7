//! The threads that work for Python: one pool for each process.
//!
//! `fork` copies the memory of a pool but none of its threads, so a child that used its parent's pool would wait for ever.
//! PyTorch's data loaders fork. Each process therefore gets its own pool when it first needs one, and the global pool of
//! rayon is never used.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::failure::failed;

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
