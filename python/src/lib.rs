//! `pumice._native`: the bindings of Pumice for Python. They have no logic: each function converts Python's values, calls
//! `pumice-session` with the interpreter released, and converts the result. The typed interface for users is the package `pumice/`.
#![deny(unsafe_code)]

mod agreement;
mod array;
mod bridge;
mod calls;
mod errors;
mod forked;
mod frame;
mod job;
mod label_table;
mod labels;
mod live;
mod mesh;
mod neuroglancer;
mod page_memory;
mod parts;
mod picture;
mod reference_picture;
mod renderer;
mod scene;
mod series;
mod surface;
mod volume;
mod waiting;

/// The compiled part of the package `pumice`.
#[pyo3::pymodule]
mod _native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::agreement::agreement;
    #[pymodule_export]
    use crate::array::Array;
    #[pymodule_export]
    use crate::bridge::{export, verify};
    #[pymodule_export]
    use crate::calls::end_calls;
    #[pymodule_export]
    use crate::errors::shown;
    #[pymodule_export]
    use crate::frame::Frame;
    #[pymodule_export]
    use crate::job::Job;
    #[pymodule_export]
    use crate::label_table::{AnnotationTable, query_labels, read_label_table};
    #[pymodule_export]
    use crate::labels::LabelGroups;
    #[pymodule_export]
    use crate::live::Session;
    #[pymodule_export]
    use crate::mesh::Mesh;
    #[pymodule_export]
    use crate::neuroglancer::{open_state, state_layers};
    #[pymodule_export]
    use crate::page_memory::PageMemory;
    #[pymodule_export]
    use crate::parts::{chunk_count, chunk_regions, compress_file, compress_part, merge, merge_into_part};
    #[pymodule_export]
    use crate::picture::{Picture, cryptomatte_hash, devices, panic_on_purpose, read_picture, render};
    #[pymodule_export]
    use crate::reference_picture::ReferencePicture;
    #[pymodule_export]
    use crate::renderer::Renderer;
    #[pymodule_export]
    use crate::scene::{Scene, figure, turntable};
    #[pymodule_export]
    use crate::series::compress_series;
    #[pymodule_export]
    use crate::surface::{count_faces, surface};
    #[pymodule_export]
    use crate::volume::{Volume, compress, distinct_colors, is_on_server, open, probe, volume_info};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
