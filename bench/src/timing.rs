//! Measures the time of a piece of work: wall seconds, and CPU seconds of all threads of this process.

use std::ops::Add;

use pumice_session::error::Result;
use pumice_session::measure::Stopwatch;
use serde::{Deserialize, Serialize};

/// Time that a piece of work took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Took {
    /// Wall seconds.
    pub seconds: f64,
    /// CPU seconds of all threads.
    pub cpu_seconds: f64,
}

impl Took {
    /// Time since a stopwatch was started.
    pub fn since(clock: &Stopwatch) -> Self {
        Self { seconds: clock.seconds(), cpu_seconds: clock.cpu_seconds() }
    }

    /// The lesser wall time and the lesser CPU time of two rounds of the same work.
    pub fn least(self, other: Self) -> Self {
        Self {
            seconds: self.seconds.min(other.seconds),
            cpu_seconds: self.cpu_seconds.min(other.cpu_seconds),
        }
    }
}

impl Add for Took {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { seconds: self.seconds + other.seconds, cpu_seconds: self.cpu_seconds + other.cpu_seconds }
    }
}

/// Calls `work`; returns its result and its time.
///
/// # Errors
/// The errors of `work`.
pub fn clocked<T>(work: impl FnOnce() -> Result<T>) -> Result<(T, Took)> {
    let clock = Stopwatch::start();
    let result = work()?;
    Ok((result, Took::since(&clock)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_takes_time_and_errors_pass() {
        let (answer, took) = clocked(|| {
            std::thread::sleep(std::time::Duration::from_millis(20));
            Ok(7)
        })
        .unwrap();
        // Sleeping takes wall time. The CPU time is that of the whole process, where other tests may be busy.
        assert!(answer == 7 && took.seconds >= 0.02, "{took:?}");
        let refused = pumice_session::SessionError::Caller("no".into());
        assert_eq!(clocked::<()>(|| Err(refused)).unwrap_err().to_string(), "no");
        let one = Took { seconds: 1.0, cpu_seconds: 4.0 };
        let other = Took { seconds: 2.0, cpu_seconds: 3.0 };
        assert_eq!(one.least(other), Took { seconds: 1.0, cpu_seconds: 3.0 });
        assert_eq!(one + other, Took { seconds: 3.0, cpu_seconds: 7.0 });
    }
}
