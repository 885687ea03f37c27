//! Output of a bench while it runs, and its outcome.

use std::fmt::Display;
use std::io::{self, Write};

use pumice_session::SessionError;

/// Why a bench stopped before its end.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// Measuring failed, or the results could not be written.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Standard output is closed or cannot be written.
    #[error("standard output: {0}")]
    Output(io::Error),
}

/// Result of a bench.
pub type BenchResult<T> = Result<T, BenchError>;

/// Outcome of a bench that finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All checks of the bench passed, or it has none.
    Holds,
    /// A limit was exceeded, or two renderings that must be equal differ.
    Missed,
}

impl Outcome {
    /// [`Outcome::Holds`] if `holds`, else [`Outcome::Missed`].
    pub(crate) fn of(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::Missed }
    }
}

/// Prints lines to the bench's output.
pub(crate) struct Console<'a> {
    out: &'a mut dyn Write,
}

impl<'a> Console<'a> {
    pub(crate) fn new(out: &'a mut dyn Write) -> Self {
        Self { out }
    }

    pub(crate) fn line(&mut self, line: impl Display) -> BenchResult<()> {
        writeln!(self.out, "{line}").map_err(BenchError::Output)
    }

    /// Runs `measure` and prints each line of progress that it reports, prefixed with `named`. After a line that cannot be printed no
    /// further line is printed, and its error is returned when `measure` ends.
    pub(crate) fn watch<T>(
        &mut self,
        named: &str,
        measure: impl FnOnce(&mut dyn FnMut(&str)) -> Result<T, SessionError>,
    ) -> BenchResult<T> {
        let mut failed = None;
        let measured = measure(&mut |line| {
            if failed.is_none() {
                failed = self.line(format_args!("{named}{line}")).err();
            }
        })?;
        failed.map_or(Ok(measured), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Closed;

    impl Write for Closed {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::BrokenPipe.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_begins_is_printed_and_a_closed_output_is_told_at_the_end() {
        let mut text = Vec::new();
        let measured = Console::new(&mut text).watch("a: ", |watch| {
            watch("one");
            watch("two");
            Ok(3)
        });
        assert!(matches!(measured, Ok(3)));
        assert_eq!(text, b"a: one\na: two\n");
        let mut ended = false;
        let closed = Console::new(&mut Closed).watch("", |watch| {
            watch("one");
            ended = true;
            Ok(())
        });
        assert!(
            ended && matches!(closed, Err(BenchError::Output(e)) if e.kind() == io::ErrorKind::BrokenPipe)
        );
    }
}
