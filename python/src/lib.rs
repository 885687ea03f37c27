//! `pumice._native`: what Python sees of Pumice. No logic is here: each function takes Python's values apart, calls `pumice-session`
//! without the interpreter, and puts the result together; the typed face is `pumice/` beside it.
#![deny(unsafe_code)]

mod array;
mod calls;
mod errors;
mod frame;
mod job;
mod live;
mod mesh;
mod picture;
mod scene;
mod volume;
mod waiting;

/// The module.
#[pyo3::pymodule]
mod _native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::array::Array;
    #[pymodule_export]
    use crate::calls::end_calls;
    #[pymodule_export]
    use crate::frame::Frame;
    #[pymodule_export]
    use crate::job::Job;
    #[pymodule_export]
    use crate::live::Session;
    #[pymodule_export]
    use crate::mesh::Mesh;
    #[pymodule_export]
    use crate::picture::{Picture, cryptomatte_hash, devices, panic_on_purpose, render};
    #[pymodule_export]
    use crate::scene::{figure, scene_checked, scene_load, scene_save};
    #[pymodule_export]
    use crate::volume::{Volume, compress, open, probe, volume_info};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
