//! Errors of Rust as exceptions of Python, which are classes of `pumice.errors`.

use pumice_core::Error as CoreError;
use pumice_render::RenderError;
use pumice_scene::SceneError;
use pumice_session::SessionError;
use pyo3::PyErr;

pyo3::import_exception!(pumice.errors, InputError);
pyo3::import_exception!(pumice.errors, Cancelled);
pyo3::import_exception!(pumice.errors, InternalError);

/// What can be raised as an exception.
pub(crate) trait IntoException {
    /// The exception, with the error's one line.
    fn into_exception(self) -> PyErr;
}

impl IntoException for SessionError {
    fn into_exception(self) -> PyErr {
        match self {
            Self::Core(CoreError::Cancelled) | Self::Render(RenderError::Cancelled) => {
                Cancelled::new_err("cancelled")
            }
            other => InputError::new_err(other.to_string()),
        }
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
        InputError::new_err(self.to_string())
    }
}

impl IntoException for pumice_render::PictureError {
    fn into_exception(self) -> PyErr {
        InputError::new_err(self.to_string())
    }
}

/// A caught panic: a defect of Pumice, which the process survives.
pub(crate) fn internal(panic: &(dyn std::any::Any + Send)) -> PyErr {
    InternalError::new_err(format!("internal error: {}", pumice_session::live::panic_text(panic)))
}
