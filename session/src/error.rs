//! Errors of a session. Errors of other crates keep their own one-line text.

use std::path::PathBuf;

/// A failure of opening, compressing or rendering.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// An error of the compressed form or its file.
    #[error(transparent)]
    Core(#[from] pumice_core::Error),
    /// An error of a reader or writer of label volumes.
    #[error(transparent)]
    Format(pumice_formats::FormatError),
    /// An error in a scene.
    #[error("{}: {source}", path.display())]
    Scene {
        /// The scene file, or the picture that carries the scene.
        path: PathBuf,
        /// The error in the scene.
        source: pumice_scene::SceneError,
    },
    /// An error of a renderer.
    #[error(transparent)]
    Render(#[from] pumice_transport::RenderError),
    /// An error of a picture file.
    #[error(transparent)]
    Picture(#[from] pumice_picture::PictureError),
    /// An error of writing for other programs.
    #[error(transparent)]
    Export(#[from] pumice_export::ExportError),
    /// The operating system reports an error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The caller's request cannot be carried out; the text says why.
    #[error("{0}")]
    Caller(String),
}

impl From<pumice_core::TargetError> for SessionError {
    fn from(error: pumice_core::TargetError) -> Self {
        Self::Core(error.into())
    }
}

impl From<pumice_formats::FormatError> for SessionError {
    fn from(error: pumice_formats::FormatError) -> Self {
        match error {
            pumice_formats::FormatError::Cancelled => Self::Core(pumice_core::Error::Cancelled),
            other => Self::Format(other),
        }
    }
}

/// Result of a session.
pub type Result<T> = std::result::Result<T, SessionError>;

/// Adds the path to an I/O error.
pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> SessionError {
    let path = path.into();
    move |source| SessionError::Io { path, source }
}
