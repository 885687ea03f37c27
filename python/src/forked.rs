//! Objects with a thread or a device of their own, which a forked process does not get: there each use of them is an error.

use pyo3::PyResult;

use crate::errors::input;

/// Something that belongs to the process that made it.
pub(crate) struct OfProcess<T> {
    /// `None` only while it is dropped.
    inner: Option<T>,
    process: u32,
}

impl<T> OfProcess<T> {
    pub(crate) fn new(inner: T) -> Self {
        Self { inner: Some(inner), process: std::process::id() }
    }

    /// The object; `what` it is goes into the error.
    ///
    /// # Errors
    /// `InputError` in a process that was forked from that of the object.
    pub(crate) fn get(&self, what: &str) -> PyResult<&T> {
        match &self.inner {
            Some(inner) if std::process::id() == self.process => Ok(inner),
            _ => Err(input(&format_args!(
                "this {what} belongs to the process from which this one was forked: make a new one here"
            ))),
        }
    }
}

impl<T> Drop for OfProcess<T> {
    fn drop(&mut self) {
        if std::process::id() != self.process {
            // Dropping it would wait for threads that are not here.
            std::mem::forget(self.inner.take());
        }
    }
}
