//! What the command says: lines on standard output, and failures and warnings, each one line on standard error.
//!
//! Names of files and labels may have line breaks and other control characters in them. Here they become escapes, so that a line stays one
//! line, and no name steers the terminal.

use std::fmt::{self, Display};
use std::io::Write;

use pumice_core::error::one_line;

use crate::progress::aside;

/// Why the command stops. Its text is one line.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Bad usage, bad input, a limit, a cancel: exit code 2.
    Bad(String),
    /// The reader of standard output closed it (`pumice info … | head`). There is nowhere left to print to; exit code 0.
    StdoutClosed,
}

impl Failure {
    /// A failure with the text `what` on one line.
    pub(crate) fn new(what: impl Display) -> Self {
        Self::Bad(one_line(&what.to_string()))
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
    print(&one_line(&line.to_string()))
}

/// Prints a warning to standard error.
pub(crate) fn warn(what: impl Display) {
    let line = one_line(&what.to_string());
    aside(|| eprintln!("pumice: {line}"));
}

/// Prints a text as it is to standard output, which may have several lines.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    writeln!(std::io::stdout(), "{text}").map_err(|e| match e.kind() {
        std::io::ErrorKind::BrokenPipe => Failure::StdoutClosed,
        _ => Failure::new(format_args!("standard output: {e}")),
    })
}
