//! Errors of foreign files, sorted by who must act. Every text is one line.

use std::path::{Path, PathBuf};

use pumice_core::{NoMemory, TargetError};

/// A failure of opening, reading or writing a label volume in a foreign format.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The operating system refused: missing file, no permission, full disk.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A header names another file that cannot be opened.
    #[error("{}: the voxels should be in {}: {source}", header.display(), data.display())]
    Detached {
        /// The header.
        header: PathBuf,
        /// The file with the voxels.
        data: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// No reader recognises the content.
    #[error("{}: {what}", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
        /// What the file seems to be, and which formats can be read.
        what: String,
    },
    /// The file violates its format.
    #[error("{}: {what}{}", path.display(), AtByte(*at))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong: expected and got.
        what: String,
        /// Byte offset in the file, where one is known.
        at: Option<u64>,
    },
    /// A cell or a line of a table is wrong.
    #[error("{}: line {line}, column {column}: {what}", path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Line in the file, from 1.
        line: u64,
        /// Field of the line, from 1; in JSON the character.
        column: u64,
        /// What is wrong: expected and got.
        what: String,
    },
    /// The file holds fewer voxels than its header declares.
    #[error(
        "{}: expected {expected} bytes of voxels, the data end after {got}{}", path.display(), AtByte(*at)
    )]
    Short {
        /// The file.
        path: PathBuf,
        /// Bytes of voxels that the header declares.
        expected: u64,
        /// Bytes of voxels that the file has.
        got: u64,
        /// Byte offset at which the file ends.
        at: Option<u64>,
    },
    /// The file is valid, but uses a part of its format that this program does not support.
    #[error("{}: {what}; {way_out}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The unsupported part.
        what: String,
        /// What the user can do instead.
        way_out: String,
    },
    /// The file holds several volumes, and the caller chose none.
    #[error("{}: {what}; choose one with {option} ({choices})", path.display())]
    Choose {
        /// The file.
        path: PathBuf,
        /// What the file has several of.
        what: String,
        /// The option that makes the choice.
        option: &'static str,
        /// The possible choices.
        choices: String,
    },
    /// An option of the caller has no meaning for the file.
    #[error("{}: {option} cannot be chosen: {why}", path.display())]
    NotApplicable {
        /// The file.
        path: PathBuf,
        /// The option of the command, such as `--axes`, with its value where that helps.
        option: String,
        /// Why the file leaves nothing to choose, and which files do.
        why: String,
    },
    /// An option of the caller does not fit the file.
    #[error("{}: {what}", path.display())]
    Option {
        /// The file.
        path: PathBuf,
        /// What does not fit, and what would fit.
        what: String,
    },
    /// A voxel is not a label: it is negative, not whole, or too large to be exact.
    #[error(
        "{}: voxel ({}, {}, {}) is {value}, {reason}", path.display(), voxel[0], voxel[1], voxel[2]
    )]
    Label {
        /// The file.
        path: PathBuf,
        /// x, y and z of the voxel.
        voxel: [u64; 3],
        /// Value of the voxel as text.
        value: String,
        /// Why the value is not a label.
        reason: &'static str,
    },
    /// A size exceeds what this program handles.
    #[error("{}: {what} is {got}, the limit is {limit}", path.display())]
    Limit {
        /// The file.
        path: PathBuf,
        /// The quantity.
        what: String,
        /// The size in the file.
        got: String,
        /// The limit.
        limit: u64,
    },
    /// Memory is short.
    #[error(transparent)]
    Memory(NoMemory),
    /// The caller gave up while a server was waited for ([`crate::OpenOptions::cancelled`]).
    #[error("cancelled")]
    Cancelled,
}

/// Formats as " (byte N of the file)" if N is known, else as nothing.
struct AtByte(Option<u64>);

impl std::fmt::Display for AtByte {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.map_or(Ok(()), |at| write!(f, " (byte {at} of the file)"))
    }
}

impl FormatError {
    /// Makes a function for `map_err` that wraps an error of the system in [`FormatError::Io`] for `path`.
    pub(crate) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    /// Makes a function for `map_err` that says which file needs the memory.
    pub(crate) fn memory(path: &Path) -> impl Fn(NoMemory) -> Self + '_ {
        move |error| Self::Memory(error.of_file(path))
    }

    /// Makes a [`FormatError::Damaged`] without a byte offset.
    pub(crate) fn damaged(path: &Path, what: impl Into<String>) -> Self {
        Self::Damaged { path: path.to_owned(), what: what.into(), at: None }
    }

    /// Makes a [`FormatError::Unsupported`].
    pub(crate) fn unsupported(path: &Path, what: impl Into<String>, way_out: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_owned(), what: what.into(), way_out: way_out.into() }
    }

    /// Makes a [`FormatError::Option`].
    pub(crate) fn option(path: &Path, what: impl Into<String>) -> Self {
        Self::Option { path: path.to_owned(), what: what.into() }
    }
}

impl From<TargetError> for FormatError {
    fn from(error: TargetError) -> Self {
        match error {
            TargetError::Io { path, source } => Self::Io { path, source },
            TargetError::Refused { path, what } => Self::Option { path, what },
        }
    }
}

impl From<FormatError> for pumice_core::Error {
    fn from(error: FormatError) -> Self {
        match error {
            FormatError::Cancelled => Self::Cancelled,
            other => Self::Source(Box::new(other)),
        }
    }
}

/// Result of this crate.
pub(crate) type Result<T> = std::result::Result<T, FormatError>;
