//! What a bench prints while it runs, and how it ends.

use std::fmt::Display;
use std::io::{self, Write};

use pumice_session::SessionError;

/// Why a bench stopped before its end.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// What was measured could not be, or its results could not be written.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// What it prints has no reader, or could not be written.
    #[error("standard output: {0}")]
    Output(io::Error),
}

/// Result of a bench.
pub type BenchResult<T> = Result<T, BenchError>;

/// Answer of a bench that came to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All that it asks holds; a bench that asks nothing.
    Holds,
    /// A bar was missed, or two ways drew different pictures.
    Missed,
}

impl Outcome {
    /// [`Outcome::Holds`] where it does.
    pub(crate) fn of(holds: bool) -> Self {
        if holds { Self::Holds } else { Self::Missed }
    }
}

/// Lines to whoever watches.
pub(crate) struct Console<'a> {
    out: &'a mut dyn Write,
}

impl<'a> Console<'a> {
    pub(crate) fn new(out: &'a mut dyn Write) -> Self {
        Self { out }
    }

    /// Prints a line.
    pub(crate) fn line(&mut self, line: impl Display) -> BenchResult<()> {
        writeln!(self.out, "{line}").map_err(BenchError::Output)
    }

    /// Measures, and prints what begins with `named` in front. Once a line cannot be printed no more are tried, and the error comes
    /// when the measuring ends.
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
