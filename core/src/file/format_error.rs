//! Reasons to refuse a `.pumice` file, before its path is attached.

use crate::Error;

/// What is wrong with a file, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FormatError {
    /// Name of the section, or `HEAD`.
    pub(crate) section: [u8; 4],
    /// Byte offset in the file: of the section or, for the header and the table, of the field.
    pub(crate) at: u64,
    /// What was expected and what was found.
    pub(crate) what: String,
}

impl FormatError {
    /// A fault in a field of the header or of the section table.
    pub(super) fn in_header(at: u64, what: String) -> Self {
        Self { section: *b"HEAD", at, what }
    }
}

/// Reason for which reading stops.
#[derive(Debug)]
pub(super) enum Stop {
    /// The file is damaged.
    Fault(FormatError),
    /// The file has a version that this program does not read.
    Version(u32),
    /// The file has so many frames, of which none was chosen.
    Frames(u32),
    /// The operating system refuses.
    Io(std::io::Error),
    /// The core itself stops, because the job is cancelled or a limit is exceeded.
    Core(Error),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Self::Core(error)
    }
}

impl From<FormatError> for Stop {
    fn from(fault: FormatError) -> Self {
        Self::Fault(fault)
    }
}
