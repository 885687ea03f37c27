//! Failures of the command: each ends it with one line on standard error and exit code 2.

use std::fmt::{self, Display};
use std::io::Write;

/// Why the command stops. Its text is one line.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Bad usage, bad input, a limit, a cancel: exit code 2.
    Bad(String),
    /// The reader of standard output closed it (`pumice info … | head`). There is nowhere left to print to; exit code 0.
    StdoutClosed,
}

impl Failure {
    /// A failure with the text `what` on one line: the line breaks of nested messages become `; `.
    pub(crate) fn new(what: impl Display) -> Self {
        let text = what.to_string();
        Self::Bad(
            text.split(['\n', '\r']).map(str::trim).filter(|l| !l.is_empty()).collect::<Vec<_>>().join("; "),
        )
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bad(text) => f.write_str(text),
            Self::StdoutClosed => f.write_str("standard output was closed"),
        }
    }
}

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::new(error)
    }
}

/// Prints a line to standard output.
pub(crate) fn say(line: impl Display) -> Result<(), Failure> {
    writeln!(std::io::stdout(), "{line}").map_err(|e| match e.kind() {
        std::io::ErrorKind::BrokenPipe => Failure::StdoutClosed,
        _ => Failure::new(format_args!("standard output: {e}")),
    })
}
