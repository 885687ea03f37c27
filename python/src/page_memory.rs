//! The memory that volumes share which are drawn from disk.

use std::sync::Arc;

use pumice_core::Residency;
use pyo3::prelude::*;

use crate::errors::input;

/// At most so many bytes of volumes that are drawn from disk.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct PageMemory(pub(crate) Arc<Residency>);

#[pymethods]
impl PageMemory {
    /// An empty memory with this limit.
    #[new]
    fn new(limit_bytes: u64) -> Self {
        Self(Arc::new(Residency::new(limit_bytes)))
    }

    /// What is in memory and was, as JSON text.
    fn figures(&self) -> PyResult<String> {
        serde_json::to_string(&pumice_session::PageFigures::of_memory(&self.0)).map_err(|e| input(&e))
    }
}
