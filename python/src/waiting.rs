//! Runs work with the interpreter released, so that other Python threads can run meanwhile.
//!
//! [`released`] is for work that may take long: it runs in a thread of its own, while the calling thread waits and checks for Ctrl-C every
//! [`LOOK_UP`]. [`detached`] is for work of milliseconds, which grow with the volume: it runs in the calling thread and cannot be
//! interrupted. Both turn a panic into `InternalError`.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pumice_core::Job;
use pumice_session::{SessionError, with_threads};
use pyo3::{PyErr, PyResult, Python};

use crate::calls::Call;
use crate::errors::{InternalError, IntoException, input, internal};

const LOOK_UP: Duration = Duration::from_millis(100);

/// Runs `work` with the interpreter released; `job` is cancelled if a signal raises an exception.
///
/// # Errors
/// The error of `work`; the exception that a signal raised; `InternalError` if `work` panics.
pub(crate) fn released<T: Send, E: IntoException + Send>(
    py: Python<'_>,
    job: &Arc<Job>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    let _call = Call::begin(job)?;
    let (send, done) = channel();
    // Only one thread ever locks it; it is a mutex because `detach` requires borrowed data to be `Sync`.
    let done = Mutex::new(done);
    std::thread::scope(|scope| {
        let worker = std::thread::Builder::new().name("pumice-work".into()).spawn_scoped(scope, move || {
            // The receiver is alive: it is in this scope.
            let _ = send.send(catch_unwind(AssertUnwindSafe(|| with_threads(work))));
        });
        if let Err(e) = worker {
            return Err(input(&format_args!("no thread for the work: {e}")));
        }
        let mut interrupted: Option<PyErr> = None;
        loop {
            let answer =
                py.detach(|| done.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK_UP));
            match answer {
                Ok(_) if interrupted.is_some() => break,
                Ok(Ok(result)) => return given(result),
                Ok(Err(panic)) => return Err(internal(panic.as_ref())),
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => {
                    if interrupted.is_none()
                        && let Err(raised) = py.check_signals()
                    {
                        job.cancel();
                        interrupted = Some(raised);
                    }
                }
            }
        }
        Err(interrupted.unwrap_or_else(|| InternalError::new_err("the work ended without a result")))
    })
}

/// Runs `work` with the interpreter released, in the calling thread.
///
/// # Errors
/// The error of `work`; `InternalError` if it panics.
pub(crate) fn detached<T: Send, E: IntoException + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    let _call = Call::begin(&Arc::default())?;
    match py.detach(|| catch_unwind(AssertUnwindSafe(|| with_threads(work)))) {
        Ok(result) => given(result),
        Err(panic) => Err(internal(panic.as_ref())),
    }
}

/// The result of work, or the exception that says why there is none.
fn given<T, E: IntoException>(result: Result<Result<T, E>, SessionError>) -> PyResult<T> {
    result.map_err(IntoException::into_exception)?.map_err(IntoException::into_exception)
}
