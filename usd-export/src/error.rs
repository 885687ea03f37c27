//! What can go wrong while a volume is written for other programs.

/// Why an export failed.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// What is written to failed (a full disk, a pipe without a reader). Whoever knows its name adds it.
    #[error("{0}")]
    Write(#[from] std::io::Error),
    /// The volume could not be read, a limit is exceeded, or the job was cancelled.
    #[error(transparent)]
    Volume(#[from] pumice_core::Error),
}

/// The result of an export.
pub type Result<T, E = ExportError> = std::result::Result<T, E>;
