//! A live picture that follows its scene: a worker thread refines it, and clients take the newest frame.
//!
//! ```text
//!   client:   edit ──► scene, revision + 1 ──► wakes the worker          latest ◄── newest frame (immutable, shared)
//!   worker:   take the scene → coarse frames, finer each time → all samples, a frame now and then → converged: sleep
//! ```
//! While a device compiles what the scene needs, the processor draws the same; then the device draws it from the first sample on, and is
//! shown when it has come as far.
//!
//! An edit cancels the samples under way, so that the first coarse frame of the new scene comes within the time of a few rows.
//! Coarse frames have fewer pixels than the film. The processor takes them from the film: first samples of some of its pixels, which are not drawn
//! again. Elsewhere they have films of their own, and are never mixed into it. Only [`Live::pick`] and [`Live::stop`] wait, and only
//! until the worker ends its current slice. A panic in the worker ends the worker and is reported by [`Live::status`]; it does not
//! reach the client.

mod label_film;
mod worker;

use std::collections::BTreeMap;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use pumice_core::{CompressedVolume, Job};
use pumice_scene::{Scene, SceneEdit};
use pumice_transport::{LoadedEdit, LoadedScene, Pick, RenderError, Renderer};

use crate::backend::{FallbackRenderer, make_renderer};
use crate::error::{Result, SessionError};
use crate::progressive::Stop;
use crate::render_file::PageFigures;
use crate::threads::with_threads;

pub use label_film::LabelFilm;
pub use worker::panic_text;
pub(crate) use worker::{coarse_divisors, rebuilt_by_name, rows_from_bottom};

/// Options of a live picture.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveOptions {
    /// Name of the backend, as for `--backend`.
    pub backend: String,
    /// Limits at which the picture of a revision is done.
    pub stop: Stop,
    /// Whether frames that are not converged are [denoised](pumice_picture::denoise).
    pub denoise: bool,
}

impl Default for LiveOptions {
    fn default() -> Self {
        Self { backend: "auto".into(), stop: Stop::default(), denoise: false }
    }
}

/// The picture at one moment. Rows run from the **bottom** to the top, as OpenGL textures have them.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Scene-linear Rec. 709 radiance and alpha, four floats per pixel; the radiance is premultiplied. Alpha is 1 unless the film is
    /// transparent.
    pub rgba: Vec<f32>,
    /// Number of the frame, counted from 1.
    pub serial: u64,
    /// Revision of the scene that it shows.
    pub revision: u64,
    /// Samples in every pixel.
    pub spp: u32,
    /// Estimated relative error; infinite until there is an estimate.
    pub error_estimate: f64,
    /// Wall seconds since the worker began this revision.
    pub seconds: f64,
    /// CPU seconds of the process in that time.
    pub cpu_seconds: f64,
    /// Whether only some of the film's pixels have a sample. The frame has fewer pixels than the film, or is
    /// [enlarged](pumice_picture::denoise::upsampled) from one that has.
    pub coarse: bool,
    /// Whether the frame was denoised: its pixels are then not means of samples.
    pub filtered: bool,
    /// Whether this is the last frame of its revision: a limit of [`LiveOptions::stop`] is reached.
    pub converged: bool,
}

/// State of the worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LiveState {
    /// It adds samples, or is about to.
    Rendering,
    /// The picture is done; an edit wakes it.
    Converged,
    /// It ended with an error or a panic; [`Status::error`] has the text.
    Failed,
    /// It was stopped.
    Stopped,
}

impl LiveState {
    /// The name of the state in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rendering => "rendering",
            Self::Converged => "converged",
            Self::Failed => "failed",
            Self::Stopped => "stopped",
        }
    }
}

/// Status of a live picture.
#[derive(Clone, Debug)]
pub struct Status {
    /// State of the worker.
    pub state: LiveState,
    /// Why the worker failed, or why the last revision could not be shown; the previous one is then still shown.
    pub error: Option<String>,
    /// Revision of the scene; the first is 1.
    pub revision: u64,
    /// Name of the backend in use.
    pub backend: &'static str,
    /// Name of the device in use.
    pub device: String,
    /// Name of the backend whose programs are being compiled; until they are, the processor draws.
    pub compiling: Option<&'static str>,
    /// Device failures after which rendering continued, one line each, the latest last; at most [`MOST_NOTICES`].
    pub notices: Vec<String>,
    /// Counters: `edits.KIND` received, `rebuilt.KIND` built by the renderer, `frames` published.
    pub counters: BTreeMap<String, u64>,
    /// What is in memory of volumes that are drawn from disk, and was, since they were opened; `None` where all is in memory.
    pub pages: Option<PageFigures>,
}

/// Most notices that are kept, so that a device that keeps failing does not fill the memory with them.
pub const MOST_NOTICES: usize = 32;

/// A pick request: a pixel of the film, and the channel for the answer.
struct Question {
    x: u32,
    y: u32,
    answer: Sender<std::result::Result<Option<Pick>, RenderError>>,
}

/// State that client and worker share.
struct Shared {
    board: Mutex<Board>,
    /// Notified when there is work for the worker.
    work: Condvar,
}

struct Board {
    scene: LoadedScene,
    revision: u64,
    /// Cancels the samples under way.
    job: Arc<Job>,
    questions: Vec<Question>,
    /// The newest label film.
    labels: Option<Arc<LabelFilm>>,
    /// The first revision since which label films have not changed.
    labels_since: u64,
    /// Whether the worker is to make a label film.
    labels_wanted: bool,
    frame: Option<Arc<Frame>>,
    state: LiveState,
    error: Option<String>,
    stopping: bool,
    panicking: bool,
    backend: &'static str,
    device: String,
    compiling: Option<&'static str>,
    notices: Vec<String>,
    counters: BTreeMap<String, u64>,
}

impl Shared {
    fn board(&self) -> MutexGuard<'_, Board> {
        // Every statement under the lock leaves the board consistent, so a poisoned lock is safe to use.
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A live picture; dropping it stops the worker.
pub struct Live {
    shared: Arc<Shared>,
    worker: Mutex<Option<JoinHandle<()>>>,
    /// The process that has the worker.
    process: u32,
}

impl std::fmt::Debug for Live {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Live").field("backend", &self.shared.board().backend).finish_non_exhaustive()
    }
}

impl Live {
    /// Starts to draw `scene`. Returns at once.
    ///
    /// # Errors
    /// When there is no such backend, or the thread cannot be started.
    pub fn start(scene: LoadedScene, options: LiveOptions) -> Result<Self> {
        Self::draw(scene, make_renderer(&options.backend)?, options.stop, options.denoise)
    }

    fn draw(scene: LoadedScene, renderer: FallbackRenderer, stop: Stop, denoise: bool) -> Result<Self> {
        let names = SceneEdit::NAMES.into_iter().chain(LoadedEdit::NAMES_OF_ADDING);
        let shared = Arc::new(Shared {
            board: Mutex::new(Board {
                scene,
                revision: 1,
                job: Arc::new(Job::new()),
                questions: Vec::new(),
                labels: None,
                labels_since: 1,
                labels_wanted: false,
                frame: None,
                state: LiveState::Rendering,
                error: None,
                stopping: false,
                panicking: false,
                backend: renderer.name(),
                device: renderer.device().to_owned(),
                compiling: None,
                notices: Vec::new(),
                counters: names.map(|name| (format!("edits.{name}"), 0)).collect(),
            }),
            work: Condvar::new(),
        });
        let worker = worker::Worker::new(Arc::clone(&shared), renderer, stop, denoise);
        let told = Arc::clone(&shared);
        let run = move || {
            if let Err(error) = with_threads(|| worker.run()) {
                let mut board = told.board();
                (board.state, board.error) = (LiveState::Failed, Some(error.to_string()));
                board.questions.clear();
            }
        };
        let spawned = std::thread::Builder::new().name("pumice-live".into()).spawn(run);
        let worker = spawned
            .map_err(|e| SessionError::Caller(format!("the thread of the live picture cannot start: {e}")))?;
        Ok(Self { shared, worker: Mutex::new(Some(worker)), process: std::process::id() })
    }

    /// Applies all edits or, on an error, none. Returns the new revision, whose frames follow; an empty list changes nothing.
    ///
    /// # Errors
    /// When the edited scene would not be valid; the scene is then unchanged. When the picture was stopped.
    pub fn edit<E: Into<LoadedEdit>>(&self, edits: Vec<E>) -> Result<u64> {
        let edits: Vec<LoadedEdit> = edits.into_iter().map(Into::into).collect();
        let mut board = self.shared.board();
        if let LiveState::Stopped = board.state {
            return Err(SessionError::Caller("edit: the live picture has stopped".into()));
        }
        if edits.is_empty() {
            return Ok(board.revision);
        }
        let names: Vec<&'static str> = edits.iter().map(LoadedEdit::name).collect();
        // The edited scene is validated here, so that the caller gets the error at once and not the worker later.
        let scene = board.scene.edited(edits).map_err(|e| SessionError::Caller(e.to_string()))?;
        let labels_change = names.iter().any(|name| !label_film::KEEPING_EDITS.contains(name));
        for name in names {
            *board.counters.entry(format!("edits.{name}")).or_default() += 1;
        }
        board.scene = scene;
        board.revision += 1;
        if labels_change {
            board.labels_since = board.revision;
        }
        if matches!(board.state, LiveState::Converged) {
            board.state = LiveState::Rendering;
        }
        board.job.cancel();
        self.shared.work.notify_all();
        Ok(board.revision)
    }

    /// The newest frame if its serial is above `after`, otherwise `None`. Never waits for the worker.
    pub fn latest(&self, after: u64) -> Option<Arc<Frame>> {
        self.shared.board().frame.as_ref().filter(|f| f.serial > after).cloned()
    }

    /// The scene as it is now.
    pub fn scene(&self) -> Scene {
        self.shared.board().scene.scene().clone()
    }

    /// The volume of the instance with this id.
    pub fn volume(&self, id: u32) -> Option<Arc<CompressedVolume>> {
        self.shared.board().scene.volume(id).map(Arc::clone)
    }

    /// What lies under the centre of a pixel of the film, counted from the upper left, in the newest revision that is drawn.
    /// Waits until the worker ends its current slice.
    ///
    /// # Errors
    /// When the worker has ended.
    pub fn pick(&self, x: u32, y: u32) -> Result<Option<Pick>> {
        let (send, answer) = channel();
        {
            let mut board = self.shared.board();
            if let LiveState::Failed | LiveState::Stopped = board.state {
                return Err(SessionError::Caller(format!(
                    "pick: the live picture has {}",
                    board.state.name()
                )));
            }
            board.questions.push(Question { x, y, answer: send });
            self.shared.work.notify_all();
        }
        match answer.recv() {
            Ok(pick) => Ok(pick?),
            Err(_) => Err(SessionError::Caller("pick: the live picture has ended".into())),
        }
    }

    /// The label film of the newest revision. `None` while the worker makes it, which this call asks for, or if that revision cannot be
    /// shown. Never waits.
    pub fn label_film(&self) -> Option<Arc<LabelFilm>> {
        let mut board = self.shared.board();
        let current = board.labels.as_ref().filter(|film| film.revision >= board.labels_since).cloned();
        if current.is_none() && !board.labels_wanted {
            board.labels_wanted = true;
            self.shared.work.notify_all();
        }
        current
    }

    /// The current status.
    pub fn status(&self) -> Status {
        let board = self.shared.board();
        Status {
            state: board.state,
            error: board.error.clone(),
            revision: board.revision,
            backend: board.backend,
            device: board.device.clone(),
            compiling: board.compiling,
            notices: board.notices.clone(),
            counters: board.counters.clone(),
            pages: PageFigures::of(board.scene.volumes()),
        }
    }

    /// Stops the worker and waits until it ends its current slice. The newest frame stays available. A second call does nothing, nor does
    /// one in a process that was forked from that of the worker.
    pub fn stop(&self) {
        if std::process::id() != self.process {
            return;
        }
        {
            let mut board = self.shared.board();
            board.stopping = true;
            board.job.cancel();
            self.shared.work.notify_all();
        }
        let worker = self.worker.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(worker) = worker {
            // The worker catches its own panics and reports them in the status.
            let _ = worker.join();
        }
    }

    /// Makes the worker panic, for tests that clients survive it.
    #[doc(hidden)]
    pub fn panic_on_purpose(&self) {
        let mut board = self.shared.board();
        board.panicking = true;
        board.job.cancel();
        self.shared.work.notify_all();
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.stop();
    }
}

#[cfg(test)]
mod tests;
