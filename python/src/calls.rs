//! Registers calls in progress that need the interpreter again before they return, so that the end of the interpreter waits for them.
//!
//! ```text
//! call:  begin ──► registered ──► works without the interpreter ──► has it again ──► dropped
//! end:   no new calls ─► cancels the jobs of those under way ─► waits, without the interpreter, until none is left
//! ```
//! CPython (up to 3.13) ends a thread that asks for the interpreter during its shutdown by `pthread_exit`, which unwinds the Rust frames
//! on its stack: the process aborts. So `pumice` registers [`end_calls`] with `atexit`, which runs while all threads may still ask.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pumice_core::Job;
use pyo3::prelude::*;

use crate::errors::{Cancelled, InputError, InternalError};

/// How long the end of the interpreter waits for calls: work notices a cancelled job within a fraction of a second, but a function of the
/// user that it calls may wait for ever.
const LONGEST: Duration = Duration::from_secs(10);

struct Calls {
    /// The process that the calls are in.
    process: u32,
    ended: bool,
    jobs: Vec<Arc<Job>>,
}

static CALLS: Mutex<Calls> = Mutex::new(Calls { process: 0, ended: false, jobs: Vec::new() });
static RETURNED: Condvar = Condvar::new();

fn calls() -> MutexGuard<'static, Calls> {
    let mut calls = CALLS.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if calls.process != process {
        // A forked process has none of the calls that its parent is in, and its own end.
        *calls = Calls { process, ended: false, jobs: Vec::new() };
    }
    calls
}

/// A call in progress. Drop it with the interpreter held.
pub(crate) struct Call(Arc<Job>);

impl Call {
    /// # Errors
    /// `Cancelled` once the interpreter is ending.
    pub(crate) fn begin(job: &Arc<Job>) -> PyResult<Self> {
        let mut calls = calls();
        if calls.ended {
            return Err(Cancelled::new_err("cancelled: the interpreter is ending"));
        }
        calls.jobs.push(Arc::clone(job));
        Ok(Self(Arc::clone(job)))
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        let mut calls = calls();
        if let Some(place) = calls.jobs.iter().position(|job| Arc::ptr_eq(job, &self.0)) {
            calls.jobs.swap_remove(place);
        }
        RETURNED.notify_all();
    }
}

/// Cancels every call in progress and waits for them to return. No new call can begin afterwards.
#[pyfunction]
#[pyo3(name = "_end_calls")]
pub(crate) fn end_calls(py: Python<'_>) {
    // Finalizers that call Pumice later get an exception, whose class could not be imported any more then.
    let _ = [py.get_type::<Cancelled>(), py.get_type::<InputError>(), py.get_type::<InternalError>()];
    py.detach(|| {
        let mut calls = calls();
        calls.ended = true;
        calls.jobs.iter().for_each(|job| job.cancel());
        let end = Instant::now() + LONGEST;
        while !calls.jobs.is_empty() {
            let Some(left) = end.checked_duration_since(Instant::now()) else { return };
            calls = RETURNED.wait_timeout(calls, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        // A driver's compiler works on after its renderer is gone, and must not be there when the driver ends.
        let _ = pumice_session::finish_compiling(end.saturating_duration_since(Instant::now()));
    });
}
