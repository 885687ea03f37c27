//! A long-running job: a cancel flag that the work polls, and the progress that it reports.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::{Error, Result};

/// Cancel flag and progress, shared by reference between the thread that works and the thread that watches.
///
/// The work calls [`Job::check`] at least every few milliseconds, and [`Job::advance`] as it proceeds. The watcher may read
/// [`Job::progress`] and [`Job::fraction`] at any time.
///
/// ```text
/// job        0 ├──── part ────┼──── part ────┼── part ──┤ 1      whose work is a job of its own: a chunk, merging
/// part         ├ stage ┼─ stage ─┤                               each with steps of its own: reading, coding
/// ```
#[derive(Debug, Default)]
pub struct Job {
    cancelled: CancelFlag,
    done: AtomicU64,
    total: AtomicU64,
    stages: Mutex<Stages>,
}

/// Whether a job is cancelled. The default belongs to no job, and is never set.
#[derive(Clone, Debug, Default)]
pub struct CancelFlag(Arc<AtomicBool>);

impl CancelFlag {
    /// Whether the job is cancelled.
    pub fn is_set(&self) -> bool {
        self.0.load(Relaxed)
    }
}

/// Where the current stage lies in the job.
#[derive(Debug)]
struct Stages {
    /// The part of the job that stages divide, in shares of the job.
    part: Range<f64>,
    /// The current stage, in shares of the part.
    stage: Range<f64>,
}

impl Default for Stages {
    fn default() -> Self {
        Self { part: 0.0..1.0, stage: 0.0..0.0 }
    }
}

impl Job {
    /// A job that is not cancelled and has no progress.
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks the work to stop at its next [`Job::check`].
    pub fn cancel(&self) {
        self.cancelled.0.store(true, Relaxed);
    }

    /// Whether [`Job::cancel`] was called.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.is_set()
    }

    /// The flag that [`Job::cancel`] sets, for whatever waits and has no job, such as the reader of a header on a silent server.
    pub fn cancel_flag(&self) -> CancelFlag {
        self.cancelled.clone()
    }

    /// # Errors
    /// [`Error::Cancelled`] once [`Job::cancel`] was called.
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Starts a stage of `total` steps; the stage defines its unit (voxels, boxes, samples). It is all that is left of the job or of its part.
    pub fn begin(&self, total: u64) {
        self.begin_share(total, 1.0);
    }

    /// Starts a stage of `total` steps that takes about `share` (0 to 1) of the time that is left of the job or of its part. After a stage that was
    /// all of it, stages begin anew.
    pub fn begin_share(&self, total: u64, share: f64) {
        let mut stages = self.stages();
        let from = if stages.stage.end < 1.0 { stages.stage.end } else { 0.0 };
        stages.stage = from..if share < 1.0 { from + (1.0 - from) * share } else { 1.0 };
        self.done.store(0, Relaxed);
        self.total.store(total, Relaxed);
    }

    /// The stages that follow are those of a part of the job, which takes this range (within 0 to 1) of its time.
    pub fn begin_part(&self, part: Range<f64>) {
        *self.stages() = Stages { part, stage: 0.0..0.0 };
        self.done.store(0, Relaxed);
        self.total.store(0, Relaxed);
    }

    fn stages(&self) -> MutexGuard<'_, Stages> {
        // Each change is one assignment.
        self.stages.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds finished steps to the progress.
    pub fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Relaxed);
    }

    /// (done, total) of the current stage; total is 0 before the first stage.
    pub fn progress(&self) -> (u64, u64) {
        (self.done.load(Relaxed), self.total.load(Relaxed))
    }

    /// Completed share of the job, 0 to 1, by the shares that its stages say; of a stage that says none, its own. `None` before the first stage.
    pub fn fraction(&self) -> Option<f64> {
        let stages = self.stages();
        let (done, total) = self.progress();
        let Stages { part, stage } = &*stages;
        if stage.is_empty() && part.start == 0.0 {
            return None;
        }
        let of_stage = (done as f64 / total.max(1) as f64).min(1.0);
        let of_part = stage.start + (stage.end - stage.start) * of_stage;
        Some(part.start + (part.end - part.start) * of_part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_and_parts_have_their_share_of_the_job() {
        let job = Job::new();
        assert_eq!(job.fraction(), None);
        job.begin_share(100, 0.25);
        job.advance(50);
        assert_eq!(job.fraction(), Some(0.125));
        job.begin(10);
        assert_eq!(job.fraction(), Some(0.25));
        job.advance(5);
        assert_eq!(job.fraction(), Some(0.625));
        // More steps than were told.
        job.advance(50);
        assert_eq!(job.fraction(), Some(1.0));
        // A stage after the last is a beginning, as in jobs whose stages say no share.
        job.begin(4);
        job.advance(1);
        assert_eq!((job.fraction(), job.progress()), (Some(0.25), (1, 4)));

        let job = Job::new();
        for i in 0..4 {
            let low = f64::from(i) / 8.0;
            job.begin_part(low..low + 0.125);
            assert_eq!(job.fraction(), (i > 0).then_some(low));
            job.begin_share(2, 0.5);
            job.advance(1);
            assert_eq!(job.fraction(), Some(low + 0.125 / 4.0));
            job.begin(0);
            assert_eq!(job.fraction(), Some(low + 0.125 / 2.0));
        }
    }
}
