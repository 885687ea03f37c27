//! Arrays of numbers that Python reads through the buffer protocol, without a copy.
//!
//! ```text
//! numpy.asarray(array) ──► Py_buffer { address, shape, strides, owner } ──► Array (frozen) ──► Data (never changes)
//! ```
//! This file and `frame.rs` have the only unsafe code of the bindings. It is sound because an `Array` is frozen, owns the data that it
//! points to, which nobody can change, and Python keeps the owner alive for as long as a buffer of it exists.
#![allow(unsafe_code, reason = "the buffer protocol is a C struct of pointers")]

use std::ffi::{CStr, c_int, c_void};
use std::sync::Arc;

use bytemuck::{Pod, cast_slice};
use pumice_session::{Frame, LabelFilm};
use pyo3::exceptions::PyBufferError;
use pyo3::ffi;
use pyo3::prelude::*;

/// The data of an array.
pub(crate) enum Data {
    Bool(Vec<bool>),
    U8(Vec<u8>),
    F32(Vec<f32>),
    F64(Vec<f64>),
    I32(Vec<i32>),
    U32(Vec<u32>),
    U64(Vec<u64>),
    /// The pixels of a frame.
    Frame(Arc<Frame>),
    /// The pixels of a label film.
    Labels(Arc<LabelFilm>),
    /// The depth of a label film.
    Depth(Arc<LabelFilm>),
}

impl Data {
    fn bytes(&self) -> &[u8] {
        fn of<T: Pod>(values: &[T]) -> &[u8] {
            cast_slice(values)
        }
        match self {
            // A bool is a byte, 0 or 1, in Rust as in the buffer protocol.
            Self::Bool(v) => cast_slice(v),
            Self::U8(v) => v,
            Self::F32(v) => of(v),
            Self::F64(v) => of(v),
            Self::I32(v) => of(v),
            Self::U32(v) => of(v),
            Self::U64(v) => of(v),
            Self::Frame(frame) => of(&frame.rgba),
            Self::Labels(film) => of(&film.pixels),
            Self::Depth(film) => of(&film.depth),
        }
    }

    /// Bytes of one number, and its format letter in Python's `struct` module.
    fn item(&self) -> (usize, &'static CStr) {
        match self {
            Self::Bool(_) => (1, c"?"),
            Self::U8(_) => (1, c"B"),
            Self::F32(_) | Self::Frame(_) | Self::Depth(_) => (4, c"f"),
            Self::F64(_) => (8, c"d"),
            Self::I32(_) => (4, c"i"),
            Self::U32(_) | Self::Labels(_) => (4, c"I"),
            Self::U64(_) => (8, c"Q"),
        }
    }
}

/// A read-only array of numbers in C order. `numpy.asarray` shows it without a copy.
#[pyclass(frozen, module = "pumice._native")]
pub(crate) struct Array {
    data: Data,
    shape: Vec<ffi::Py_ssize_t>,
    strides: Vec<ffi::Py_ssize_t>,
}

impl Array {
    /// An array of `data` in C order; the product of `shape` must be its length.
    pub(crate) fn new(data: Data, shape: &[usize]) -> Self {
        let (item, _) = data.item();
        assert_eq!(shape.iter().product::<usize>() * item, data.bytes().len(), "shape {shape:?}");
        // C order: the last axis varies fastest.
        let mut strides = vec![0; shape.len()];
        let mut step = item;
        for (stride, size) in strides.iter_mut().zip(shape).rev() {
            *stride = step as ffi::Py_ssize_t;
            step *= size;
        }
        Self { data, shape: shape.iter().map(|&s| s as ffi::Py_ssize_t).collect(), strides }
    }
}

#[pymethods]
impl Array {
    // SAFETY (of the function): Python calls it with a valid pointer to a `Py_buffer` that it wants filled.
    unsafe fn __getbuffer__(slf: Bound<'_, Self>, view: *mut ffi::Py_buffer, flags: c_int) -> PyResult<()> {
        // SAFETY: the same pointer, for the same purpose.
        unsafe { Self::fill(slf, view, flags) }
    }
}

impl Array {
    /// Fills a buffer view of the array for Python.
    ///
    /// # Safety
    /// `view` is null or points to a `Py_buffer` that may be written.
    pub(crate) unsafe fn fill(slf: Bound<'_, Self>, view: *mut ffi::Py_buffer, flags: c_int) -> PyResult<()> {
        if view.is_null() {
            return Err(PyBufferError::new_err("no buffer to fill"));
        }
        // SAFETY: not null, and Python's to be filled. A refused request leaves no owner behind.
        unsafe { (*view).obj = std::ptr::null_mut() };
        if flags & ffi::PyBUF_WRITABLE == ffi::PyBUF_WRITABLE {
            return Err(PyBufferError::new_err("this array cannot be changed: copy it first"));
        }
        let array = slf.get();
        // With one axis both orders are the same.
        if flags & ffi::PyBUF_F_CONTIGUOUS == ffi::PyBUF_F_CONTIGUOUS && array.shape.len() > 1 {
            return Err(PyBufferError::new_err("this array is in C order, not in Fortran order"));
        }
        let bytes = array.data.bytes();
        let (item, format) = array.data.item();
        // SAFETY: `view` is not null and Python's to be filled. All that it is pointed to belongs to the frozen `Array`, which the
        // reference in `obj` keeps alive and in place until the buffer is released; `readonly` and the refusal above keep others
        // from writing. shape and strides are as long as `ndim` says.
        unsafe {
            (*view).buf = bytes.as_ptr().cast_mut().cast::<c_void>();
            (*view).len = bytes.len() as ffi::Py_ssize_t;
            (*view).readonly = 1;
            (*view).itemsize = item as ffi::Py_ssize_t;
            (*view).format = if flags & ffi::PyBUF_FORMAT == ffi::PyBUF_FORMAT {
                format.as_ptr().cast_mut()
            } else {
                std::ptr::null_mut()
            };
            (*view).ndim = array.shape.len() as c_int;
            (*view).shape = if flags & ffi::PyBUF_ND == ffi::PyBUF_ND {
                array.shape.as_ptr().cast_mut()
            } else {
                std::ptr::null_mut()
            };
            (*view).strides = if flags & ffi::PyBUF_STRIDES == ffi::PyBUF_STRIDES {
                array.strides.as_ptr().cast_mut()
            } else {
                std::ptr::null_mut()
            };
            (*view).suboffsets = std::ptr::null_mut();
            (*view).internal = std::ptr::null_mut();
            (*view).obj = slf.into_ptr();
        }
        Ok(())
    }
}
