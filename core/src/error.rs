//! Errors of the core, sorted by who must act.

use std::path::PathBuf;

use crate::{NoMemory, TargetError};

pub use crate::one_line::{excerpt, one_line};

/// A failure of compressing, storing or reading a volume.
///
/// The text of each variant is one line that says what, where, what was expected and what to do. Programs print it unchanged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused (missing file, no permission, full disk).
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A `.pumice` file is damaged, truncated, or not one at all.
    #[error("{}: {what} at byte {at} of section {section}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Four-letter name of the section, or `HEAD`.
        section: String,
        /// Byte offset within the file.
        at: u64,
        /// What is wrong: expected and got.
        what: String,
    },
    /// A `.pumice` file of a version that this program does not read.
    #[error(
        "{}: file version at byte 8: expected 6, got {got}; {}", path.display(), way_out(*got)
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Version number in the file.
        got: u32,
    },
    /// A `.pumice` file of a time series was opened as one volume.
    #[error(
        "{}: the file has {frames} time steps, and each is a separate volume; choose one with --time-step (0 to {})", path.display(), frames - 1
    )]
    Frames {
        /// The file.
        path: PathBuf,
        /// Number of frames.
        frames: u32,
    },
    /// A block source could not deliver its labels; the text is the source's own one-line message.
    #[error("{0}")]
    Source(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The caller's request is not valid.
    #[error("{0}")]
    Caller(String),
    /// A limit of the format or of the caller's budget would be exceeded.
    #[error("{what}: {got} is more than the limit of {limit}")]
    Limit {
        /// The quantity, with its unit.
        what: String,
        /// The limit.
        limit: u64,
        /// What the input needs.
        got: u64,
    },
    /// Memory is short.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// The job was cancelled; no partial result remains.
    #[error("cancelled")]
    Cancelled,
}

impl From<TargetError> for Error {
    fn from(error: TargetError) -> Self {
        match error {
            TargetError::Io { path, source } => Self::Io { path, source },
            TargetError::Refused { .. } => Self::Caller(error.to_string()),
        }
    }
}

/// What a user can do with a file of another version.
fn way_out(version: u32) -> &'static str {
    if version < 6 {
        "an older pumice wrote it: compress the source volume again"
    } else {
        "a newer pumice wrote it: open it with that one, or compress the source volume again"
    }
}

/// Result of the core.
pub type Result<T> = std::result::Result<T, Error>;
