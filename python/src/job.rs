//! Progress and cancellation of one long call.

use std::sync::Arc;

use pyo3::prelude::*;

/// Progress and cancellation of one long call, for use from other threads.
#[pyclass(frozen, module = "pumice._native")]
#[derive(Default)]
pub(crate) struct Job(pub(crate) Arc<pumice_core::Job>);

#[pymethods]
impl Job {
    /// A job for one call.
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Cancels the call, which soon raises `Cancelled`.
    fn cancel(&self) {
        self.0.cancel();
    }

    /// Whether `cancel` was called.
    #[getter]
    fn cancelled(&self) -> bool {
        self.0.is_cancelled()
    }

    /// Completed share of the call, 0 to 1, or of its current stage where a call has stages whose times it cannot tell; `None` while it is not known.
    #[getter]
    fn fraction(&self) -> Option<f64> {
        self.0.fraction()
    }
}

/// The given job, or a new one if none was given.
pub(crate) fn job_of(given: Option<&Bound<'_, Job>>) -> Arc<pumice_core::Job> {
    given.map_or_else(Default::default, |job| Arc::clone(&job.get().0))
}
