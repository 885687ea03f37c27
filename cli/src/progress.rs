//! Progress bars on standard error, shown only where it is a terminal.

use std::borrow::Cow;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use pumice_session::Job;

use crate::failure::warn_at_work;

/// Steps of a bar that follows a job.
const STEPS: u64 = 1 << 20;

/// The bar that is on the terminal now.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Does `work`, which writes to the terminal, with the bar that is there, if any, out of the way.
pub(crate) fn aside<T>(work: impl FnOnce() -> T) -> T {
    let shown = SHOWN.lock().unwrap_or_else(PoisonError::into_inner).clone();
    match shown {
        Some(bar) => bar.suspend(work),
        None => work(),
    }
}

/// A bar that follows a job until it is dropped.
pub(crate) struct Bar {
    bar: ProgressBar,
    stop: Arc<AtomicBool>,
    follower: Option<JoinHandle<()>>,
}

impl Bar {
    /// Shows `what`, the progress of the job's stage and the time that is left of it on standard error, if that is a terminal, until the bar is
    /// dropped.
    pub(crate) fn follow(what: &'static str, job: &Arc<Job>) -> Self {
        Self::following(what, "stage done in", job)
    }

    /// The same of a job whose stages say their share of it: the time that is left is the job's.
    pub(crate) fn follow_whole(what: &'static str, job: &Arc<Job>) -> Self {
        Self::following(what, "done in", job)
    }

    fn following(what: &'static str, left: &str, job: &Arc<Job>) -> Self {
        let bar = Self::empty(
            what,
            &format!("{{msg:11}} {{bar:36}} {{percent:>3}} %  {{elapsed}}, {left} {{eta}}"),
        );
        bar.set_length(STEPS);
        let stop = Arc::new(AtomicBool::new(false));
        let follow = || {
            let (bar, stop, job) = (bar.clone(), stop.clone(), job.clone());
            std::thread::Builder::new().name("pumice-progress".into()).spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    let at = (job.fraction().unwrap_or_default() * STEPS as f64) as u64;
                    if at < bar.position() {
                        // What the stage before did in a second says nothing of this one.
                        bar.reset_eta();
                    }
                    bar.set_position(at);
                    std::thread::sleep(Duration::from_millis(66));
                }
            })
        };
        let follower = match bar.is_hidden() {
            true => None,
            // The work goes on without its bar.
            false => follow().map_err(|e| warn_at_work(format_args!("no progress is shown: {e}"))).ok(),
        };
        Self { bar, stop, follower }
    }

    /// A bar whose owner sets its position (in thousandths) and its text with [`Bar::set`].
    pub(crate) fn manual(what: impl Into<Cow<'static, str>>) -> Self {
        let bar = Self::empty(what, "{msg:11} {bar:36} {prefix}");
        bar.set_length(1000);
        Self { bar, stop: Arc::default(), follower: None }
    }

    fn empty(what: impl Into<Cow<'static, str>>, template: &str) -> ProgressBar {
        let target = if std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(1), target);
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("━╸─"));
        }
        bar.set_message(what);
        if !bar.is_hidden() {
            *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.clone());
        }
        bar
    }

    /// Does `work`, which writes to the terminal, with the bar out of the way.
    pub(crate) fn out_of_the_way<T>(&self, work: impl FnOnce() -> T) -> T {
        self.bar.suspend(work)
    }

    /// Sets the position and the text of a manual bar.
    pub(crate) fn set(&self, thousandths: u64, text: String) {
        self.bar.set_position(thousandths.min(1000));
        self.bar.set_prefix(text);
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(follower) = self.follower.take() {
            // A panic of the follower only ends the drawing of the bar; it does not affect the job, so it is ignored.
            let _ = follower.join();
        }
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = None;
        self.bar.finish_and_clear();
    }
}
