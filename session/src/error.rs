//! What can go wrong in a session: each crate's own one-line message, unchanged.

use std::path::PathBuf;

/// A failure of opening, compressing or rendering.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// From the compressed form or its file.
    #[error(transparent)]
    Core(#[from] pumice_core::Error),
    /// From a reader or writer of label volumes.
    #[error(transparent)]
    Format(#[from] pumice_formats::FormatError),
    /// From a scene.
    #[error("{}: {source}", path.display())]
    Scene {
        /// The scene file, or the picture that carries the scene.
        path: PathBuf,
        /// What is wrong with it.
        source: pumice_scene::SceneError,
    },
    /// From a renderer.
    #[error(transparent)]
    Render(#[from] pumice_transport::RenderError),
    /// From a picture file.
    #[error(transparent)]
    Picture(#[from] pumice_picture::PictureError),
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The caller asked for something that cannot be.
    #[error("{0}")]
    Caller(String),
}

/// Result of a session.
pub type Result<T> = std::result::Result<T, SessionError>;

/// Adds the path to an I/O error.
pub fn io(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> SessionError {
    let path = path.into();
    move |source| SessionError::Io { path, source }
}
