//! Why a `.pumice` file is not read, before its path is known.

use crate::Error;

/// What is wrong with a file, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    /// Name of the section, or `HEAD`.
    pub(crate) section: [u8; 4],
    /// Byte within the file where the section lies or, in header and table, of the field.
    pub(crate) at: u64,
    /// Expected and got.
    pub(crate) what: String,
}

impl Fault {
    /// A fault of a field of the header or the section table.
    pub(super) fn in_header(at: u64, what: String) -> Self {
        Self { section: *b"HEAD", at, what }
    }
}

/// Why reading stops.
#[derive(Debug)]
pub(super) enum Stop {
    /// The file is damaged.
    Fault(Fault),
    /// The file has a version that this program does not read.
    Version(u32),
    /// The operating system refuses.
    Io(std::io::Error),
    /// The core itself stops: the job is cancelled, or a limit is exceeded.
    Core(Error),
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Self::Core(error)
    }
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}
