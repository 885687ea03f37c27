//! Long work without the interpreter: it runs in a thread of its own, while the one that called waits, lets other threads of Python
//! run, and looks every [`LOOK_UP`] whether Ctrl-C was pressed.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use pumice_core::Job;
use pyo3::{PyErr, PyResult, Python};

use crate::errors::{IntoException, internal};

const LOOK_UP: Duration = Duration::from_millis(100);

/// Runs `work` with the interpreter released; `job` is cancelled where a signal raises.
///
/// # Errors
/// What `work` fails with; the exception that a signal raised; `InternalError` where `work` panics.
pub(crate) fn released<T: Send, E: IntoException + Send>(
    py: Python<'_>,
    job: &Job,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    let (send, done) = channel();
    // Only one thread ever locks it: `detach` wants what it borrows to be shareable.
    let done = Mutex::new(done);
    std::thread::scope(|scope| {
        let worker = std::thread::Builder::new().name("pumice-work".into()).spawn_scoped(scope, move || {
            // Whoever waits has not gone: it is in this scope.
            let _ = send.send(catch_unwind(AssertUnwindSafe(work)));
        });
        if let Err(e) = worker {
            return Err(crate::errors::InputError::new_err(format!("no thread for the work: {e}")));
        }
        let mut interrupted: Option<PyErr> = None;
        loop {
            let answer =
                py.detach(|| done.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK_UP));
            match answer {
                Ok(_) if interrupted.is_some() => break,
                Ok(Ok(result)) => return result.map_err(IntoException::into_exception),
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
        Err(interrupted
            .unwrap_or_else(|| crate::errors::InternalError::new_err("the work ended without a result")))
    })
}
