//! A long-running job: a cancel flag that the work polls, and the progress that it reports.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use crate::{Error, Result};

/// Cancel flag and progress, shared by reference between the thread that works and the thread that watches.
///
/// The work calls [`Job::check`] at least every few milliseconds, and [`Job::advance`] as it proceeds. The watcher may read
/// [`Job::progress`] at any time.
#[derive(Debug, Default)]
pub struct Job {
    cancelled: AtomicBool,
    done: AtomicU64,
    total: AtomicU64,
}

impl Job {
    /// A job that is not cancelled and has no progress.
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks the work to stop at its next [`Job::check`].
    pub fn cancel(&self) {
        self.cancelled.store(true, Relaxed);
    }

    /// Whether [`Job::cancel`] was called.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Relaxed)
    }

    /// # Errors
    /// [`Error::Cancelled`] once [`Job::cancel`] was called.
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Starts a stage of `total` steps; the stage defines its unit (voxels, boxes, samples).
    pub fn begin(&self, total: u64) {
        self.done.store(0, Relaxed);
        self.total.store(total, Relaxed);
    }

    /// Adds finished steps to the progress.
    pub fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Relaxed);
    }

    /// (done, total) of the current stage; total is 0 before the first stage.
    pub fn progress(&self) -> (u64, u64) {
        (self.done.load(Relaxed), self.total.load(Relaxed))
    }
}
