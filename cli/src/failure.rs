//! What the command says: lines on standard output, and failures and warnings, each one line on standard error.
//!
//! Names of files and labels may have line breaks and other control characters in them, and may be long. Here characters become escapes
//! and lines are shortened (`pumice_core::error::one_line`), so that a line stays one line, and no name steers or fills the terminal.

use std::fmt::{self, Display};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

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
///
/// # Errors
/// Where standard error is closed or full. What was to be said is lost then, so the exit code must tell that something was.
pub(crate) fn warn(what: impl Display) -> Result<(), Failure> {
    let line = one_line(&what.to_string());
    aside(|| writeln!(std::io::stderr(), "pumice: {line}"))
        .map_err(|e| Failure::new(format_args!("standard error: {e}")))
}

/// Whether a warning was lost that came while other work went on.
static LOST: AtomicBool = AtomicBool::new(false);

/// Prints a warning to standard error from within work that goes on; [`check_warnings`] fails later where it could not be written.
pub(crate) fn warn_at_work(what: impl Display) {
    if warn(what).is_err() {
        LOST.store(true, Ordering::Relaxed);
    }
}

/// Fails where a warning of [`warn_at_work`] is lost.
pub(crate) fn check_warnings() -> Result<(), Failure> {
    match LOST.load(Ordering::Relaxed) {
        true => Err(Failure::new("standard error cannot be written, and a warning is lost")),
        false => Ok(()),
    }
}

/// Prints a text as it is to standard output, which may have several lines.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    writeln!(std::io::stdout(), "{text}").map_err(|e| match e.kind() {
        std::io::ErrorKind::BrokenPipe => Failure::StdoutClosed,
        _ => Failure::new(format_args!("standard output: {e}")),
    })
}
