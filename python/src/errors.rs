//! Converts Rust errors to Python exceptions, which are classes of `pumice.errors`.

use pumice_core::Error as CoreError;
use pumice_core::error::one_line;
use pumice_export::ExportError;
use pumice_formats::FormatError;
use pumice_scene::SceneError;
use pumice_session::SessionError;
use pumice_transport::RenderError;
use pyo3::prelude::*;

pyo3::import_exception!(pumice.errors, InputError);
pyo3::import_exception!(pumice.errors, Cancelled);
pyo3::import_exception!(pumice.errors, InternalError);

/// An error that can be raised as an exception.
pub(crate) trait IntoException {
    /// The exception, with the error's one line.
    fn into_exception(self) -> PyErr;
}

impl IntoException for SessionError {
    fn into_exception(self) -> PyErr {
        match self {
            Self::Core(CoreError::Cancelled)
            | Self::Render(RenderError::Cancelled)
            | Self::Export(ExportError::Volume(CoreError::Cancelled)) => Cancelled::new_err("cancelled"),
            Self::Format(error) => input(&in_python(error)),
            other => input(&other),
        }
    }
}

/// The error of a wrong input.
pub(crate) fn input(what: &impl std::fmt::Display) -> PyErr {
    InputError::new_err(what.to_string())
}

/// A text as it is shown: on one line of bounded length, with control characters as escapes.
#[pyfunction]
#[pyo3(name = "one_line")]
pub(crate) fn shown(text: &str) -> String {
    one_line(text)
}

/// The error with options of the command replaced by the keywords of Python.
fn in_python(error: FormatError) -> FormatError {
    match error {
        FormatError::Choose { path, what, option, choices } => FormatError::Choose {
            path,
            what,
            option: match option {
                "--layer" => "layer=",
                "--time-step" => "time=",
                "--channel" => "channel=",
                "--array" => "array=",
                "--label" => "label=",
                "--dataset" => "dataset=",
                other => other,
            },
            choices,
        },
        FormatError::NotApplicable { path, option, why } => {
            let keyword = option.trim_start_matches("--").replacen("time-step", "time", 1).replacen(
                "missing-chunks",
                "missing_chunks",
                1,
            );
            FormatError::NotApplicable { path, option: keyword, why }
        }
        other => other,
    }
}

impl IntoException for CoreError {
    fn into_exception(self) -> PyErr {
        SessionError::from(self).into_exception()
    }
}

impl IntoException for RenderError {
    fn into_exception(self) -> PyErr {
        SessionError::from(self).into_exception()
    }
}

impl IntoException for SceneError {
    fn into_exception(self) -> PyErr {
        input(&self)
    }
}

impl IntoException for std::convert::Infallible {
    fn into_exception(self) -> PyErr {
        match self {}
    }
}

impl IntoException for pumice_core::MeshError {
    fn into_exception(self) -> PyErr {
        input(&format_args!("mesh: {self}"))
    }
}

impl IntoException for pumice_picture::PictureError {
    fn into_exception(self) -> PyErr {
        input(&self)
    }
}

/// The exception for a caught panic: a defect of Pumice, which the process survives.
pub(crate) fn internal(panic: &(dyn std::any::Any + Send)) -> PyErr {
    InternalError::new_err(format!("internal error: {}", pumice_session::live::panic_text(panic)))
}
