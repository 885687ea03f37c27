//! What can go wrong with a file of somebody else, sorted by who must act. Every text is one line.

use std::path::{Path, PathBuf};

/// A failure of opening, reading or writing a label volume in a foreign format.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// The operating system refused: missing file, no permission, full disk.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A header names another file that cannot be opened.
    #[error("{}: the voxels should be in {}: {source}", header.display(), data.display())]
    Detached {
        /// The header.
        header: PathBuf,
        /// The file with the voxels.
        data: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// No reader knows this content.
    #[error("{}: {what}", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
        /// What it seems to be, and what can be read.
        what: String,
    },
    /// The file breaks the rules of its format.
    #[error("{}: {what}{}", path.display(), Place(*at))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong: expected and got.
        what: String,
        /// Byte offset in the file, where one is known.
        at: Option<u64>,
    },
    /// The file holds fewer voxels than its header says.
    #[error(
        "{}: expected {expected} bytes of voxels, the data end after {got}{}", path.display(), Place(*at)
    )]
    Short {
        /// The file.
        path: PathBuf,
        /// Bytes of voxels that the header promises.
        expected: u64,
        /// Bytes of voxels that are there.
        got: u64,
        /// Byte offset in the file where it ends.
        at: Option<u64>,
    },
    /// The file is valid, but this program does not read that part of the format.
    #[error("{}: {what}; {way_out}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What is not read.
        what: String,
        /// How to get around it.
        way_out: String,
    },
    /// The file holds several volumes and the caller did not say which one.
    #[error("{}: {what}; choose one with {option} ({choices})", path.display())]
    Choose {
        /// The file.
        path: PathBuf,
        /// What there are several of.
        what: String,
        /// The option that chooses.
        option: &'static str,
        /// What can be chosen.
        choices: String,
    },
    /// An option of the caller does not fit this file.
    #[error("{}: {what}", path.display())]
    Option {
        /// The file.
        path: PathBuf,
        /// What does not fit, and what would.
        what: String,
    },
    /// A voxel is not a label: negative, not whole, too large to be exact.
    #[error(
        "{}: voxel ({}, {}, {}) is {value}, {reason}", path.display(), voxel[0], voxel[1], voxel[2]
    )]
    Label {
        /// The file.
        path: PathBuf,
        /// The voxel's x, y, z.
        voxel: [u64; 3],
        /// Its value as text.
        value: String,
        /// Why that is no label.
        reason: &'static str,
    },
    /// A size is beyond what this program handles.
    #[error("{}: {what} is {got}, the limit is {limit}", path.display())]
    Limit {
        /// The file.
        path: PathBuf,
        /// The quantity.
        what: String,
        /// What the file says.
        got: String,
        /// The limit.
        limit: u64,
    },
}

/// Writes " (byte N)" where N is known.
struct Place(Option<u64>);

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.map_or(Ok(()), |at| write!(f, " (byte {at} of the file)"))
    }
}

impl FormatError {
    /// [`FormatError::Io`] for `path`, to be used in `map_err`.
    pub(crate) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    /// [`FormatError::Damaged`] without a byte offset.
    pub(crate) fn damaged(path: &Path, what: impl Into<String>) -> Self {
        Self::Damaged { path: path.to_owned(), what: what.into(), at: None }
    }

    /// [`FormatError::Unsupported`].
    pub(crate) fn unsupported(path: &Path, what: impl Into<String>, way_out: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_owned(), what: what.into(), way_out: way_out.into() }
    }

    /// [`FormatError::Option`].
    pub(crate) fn option(path: &Path, what: impl Into<String>) -> Self {
        Self::Option { path: path.to_owned(), what: what.into() }
    }
}

impl From<FormatError> for pumice_core::Error {
    fn from(error: FormatError) -> Self {
        Self::Source(Box::new(error))
    }
}

/// Result of this crate.
pub(crate) type Result<T> = std::result::Result<T, FormatError>;
