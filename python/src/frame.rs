//! A frame of a live picture: its properties, and its pixels through the buffer protocol, without a copy.
#![allow(unsafe_code, reason = "the buffer protocol is a C struct of pointers; see `array`")]

use std::ffi::c_int;
use std::sync::Arc;

use pyo3::ffi;
use pyo3::prelude::*;

use crate::array::{Array, Data};

/// The picture at one moment. As a buffer: (height, width, 4) floats, scene-linear RGBA, row 0 at the bottom.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct Frame {
    frame: Arc<pumice_session::Frame>,
    pixels: Py<Array>,
}

impl Frame {
    pub(crate) fn new(py: Python<'_>, frame: Arc<pumice_session::Frame>) -> PyResult<Self> {
        let shape = [frame.height as usize, frame.width as usize, 4];
        let pixels = Py::new(py, Array::new(Data::Frame(Arc::clone(&frame)), &shape))?;
        Ok(Self { frame, pixels })
    }
}

#[pymethods]
impl Frame {
    // SAFETY (of the function): Python calls it with a valid pointer to a `Py_buffer` that it wants filled.
    unsafe fn __getbuffer__(slf: Bound<'_, Self>, view: *mut ffi::Py_buffer, flags: c_int) -> PyResult<()> {
        let pixels = slf.get().pixels.bind(slf.py()).clone();
        // SAFETY: the same pointer, for the same purpose; the buffer's owner is the array, which owns the pixels.
        unsafe { Array::fill(pixels, view, flags) }
    }

    /// Pixels across.
    #[getter]
    fn width(&self) -> u32 {
        self.frame.width
    }

    /// Pixels down.
    #[getter]
    fn height(&self) -> u32 {
        self.frame.height
    }

    /// Number of the frame, counted from 1.
    #[getter]
    fn serial(&self) -> u64 {
        self.frame.serial
    }

    /// Revision of the scene that it shows.
    #[getter]
    fn revision(&self) -> u64 {
        self.frame.revision
    }

    /// Samples in every pixel.
    #[getter]
    fn spp(&self) -> u32 {
        self.frame.spp
    }

    /// Estimated relative error; infinite until there is an estimate.
    #[getter]
    fn error_estimate(&self) -> f64 {
        self.frame.error_estimate
    }

    /// Wall seconds since the worker began this revision.
    #[getter]
    fn seconds(&self) -> f64 {
        self.frame.seconds
    }

    /// CPU seconds of the process since then, all threads.
    #[getter]
    fn cpu_seconds(&self) -> f64 {
        self.frame.cpu_seconds
    }

    /// Whether only some of the film's pixels have a sample, as in the first frames after an edit: it has fewer pixels than the film, or is
    /// enlarged from one that has.
    #[getter]
    fn coarse(&self) -> bool {
        self.frame.coarse
    }

    /// Whether it was denoised: its pixels are then not means of samples.
    #[getter]
    fn filtered(&self) -> bool {
        self.frame.filtered
    }

    /// Whether it is the last frame of its revision.
    #[getter]
    fn converged(&self) -> bool {
        self.frame.converged
    }
}
