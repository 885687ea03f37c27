//! The worker thread of a live picture.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use pumice_core::reserve::reserved;
use pumice_core::{Job, NoMemory};
use pumice_picture::denoise::{Enlarged, denoised_unless_cancelled, upsampled};
use pumice_picture::film::variance_known;
use pumice_picture::{CoarsePixels, Guides, Image, film_memory};
use pumice_scene::{Film, Passes};
use pumice_transport::scene_plan::sums_of;
use pumice_transport::{CoarseFrame, LoadedScene, Progress, Rebuilt, RenderError, Renderer};

use super::{Frame, LabelFilm, LiveState, MOST_NOTICES, Question, Shared, label_film};
use crate::backend::FallbackRenderer;
use crate::measure::Stopwatch;
use crate::progressive::Stop;
use crate::render_file::bytes_of_film;

/// Duration of the first slice of samples. Later slices grow with the age of the picture, so that little time goes into publishing.
const FIRST_SLICE: Duration = Duration::from_millis(40);
/// Longest slice, which is also the longest that a pick waits.
const LONGEST_SLICE: Duration = Duration::from_millis(500);
/// How long frames wait for programs that a driver may have kept.
const PATIENCE: Duration = Duration::from_millis(150);
/// Interval at which the worker polls the device's compiler once the processor's picture has all its samples.
const POLL_INTERVAL: Duration = Duration::from_millis(40);
/// About the number of pixels of the coarsest frame, which takes some 0.02 CPU seconds of diffuse paths.
const COARSEST_PIXELS: u64 = 16 * 1024;

/// The state of the worker thread.
pub(super) struct Worker {
    shared: Arc<Shared>,
    renderer: FallbackRenderer,
    /// The renderer on the processor that draws while `renderer` compiles.
    stand_in: Option<FallbackRenderer>,
    stop: Stop,
    denoise: bool,
    /// Guides of the denoiser on the processor, for this revision and the current frame size.
    guides: Option<Guides>,
    /// The renderer's device has denoised a frame of this revision and the current frame size.
    denoised_on_device: bool,
    /// How long the last frame took to be denoised.
    denoising: Duration,
    /// The revision that the renderer shows on its whole film, with samples in every pixel or about to.
    whole: Option<u64>,
    /// Whether the scene that was set last has the whole film.
    is_whole_set: bool,
}

/// A revision as it is drawn.
struct View<'a> {
    revision: u64,
    /// The scene with the coarse films, the coarsest first, for renderers that make no coarse frames of the whole film.
    coarse: Vec<LoadedScene>,
    whole: LoadedScene,
    clock: Stopwatch,
    job: &'a Job,
}

/// Where a renderer begins with a revision.
enum Beginning {
    /// With the coarse frames. The scene of the first may be set already.
    Coarse { is_set: bool },
    /// With the whole film, after another has shown so many samples of it.
    Whole { shown_spp: u32 },
}

/// A frame to publish.
struct Made {
    image: Image,
    alpha: Option<Vec<f32>>,
    /// Whether it was denoised.
    filtered: bool,
}

/// How far a picture has come when a frame of it is published.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Only some pixels of the film have samples.
    Coarse,
    /// Samples follow.
    Refining,
    /// It is done.
    Converged,
}

/// Why the worker stops drawing a revision.
enum Turn {
    /// There is a newer revision, or the worker is to stop.
    Changed,
    /// The picture of this revision is done.
    Done,
    /// The renderer for which another stands in is prepared. The frames so far have so many samples.
    Prepared(u32),
}

impl Worker {
    pub(super) fn new(shared: Arc<Shared>, renderer: FallbackRenderer, stop: Stop, denoise: bool) -> Self {
        let (stand_in, guides, denoised_on_device) = (None, None, false);
        Self {
            shared,
            renderer,
            stand_in,
            stop,
            denoise,
            guides,
            denoised_on_device,
            denoising: Duration::ZERO,
            whole: None,
            is_whole_set: false,
        }
    }

    /// Draws until it is stopped. A panic ends the worker and is reported in the status.
    pub(super) fn run(mut self) {
        let shared = Arc::clone(&self.shared);
        let ended = catch_unwind(AssertUnwindSafe(|| self.follow()));
        let mut board = shared.board();
        board.state = match ended {
            Ok(None) => LiveState::Stopped,
            Ok(Some(error)) => {
                board.error = Some(error);
                LiveState::Failed
            }
            Err(panic) => {
                board.error = Some(format!("internal error: {}", panic_text(panic.as_ref())));
                LiveState::Failed
            }
        };
        board.questions.clear();
    }

    /// Draws each new revision until it is stopped, or until its last device fails for good; then returns the text of that failure.
    fn follow(&mut self) -> Option<String> {
        let mut drawn = 0;
        loop {
            let (scene, revision, job) = {
                let mut board = self.shared.board();
                while board.revision == drawn
                    && !board.stopping
                    && !board.panicking
                    && board.questions.is_empty()
                    && !board.labels_wanted
                {
                    board = self.shared.work.wait(board).unwrap_or_else(PoisonError::into_inner);
                }
                if board.stopping {
                    return None;
                }
                if board.revision == drawn {
                    let job = Arc::clone(&board.job);
                    drop(board);
                    self.look_up();
                    match self.label_film(&job) {
                        Err(RenderError::Device(error)) => return Some(error),
                        _ => continue,
                    }
                }
                board.job = Arc::new(Job::new());
                (board.scene.clone(), board.revision, Arc::clone(&board.job))
            };
            drawn = revision;
            let outcome = self.draw(&scene, revision, &job);
            self.tell();
            let mut board = self.shared.board();
            match outcome {
                Ok(Turn::Changed | Turn::Prepared(_)) | Err(RenderError::Cancelled) => {}
                Ok(Turn::Done) if board.revision == revision => board.state = LiveState::Converged,
                Ok(Turn::Done) => {}
                Err(RenderError::Device(error)) => return Some(error),
                Err(error) => {
                    board.error = Some(error.to_string());
                    if board.revision == revision {
                        board.state = LiveState::Converged;
                    }
                }
            }
        }
    }

    /// Draws one revision: coarse frames first, then the samples of the film.
    fn draw(
        &mut self,
        scene: &LoadedScene,
        revision: u64,
        job: &Job,
    ) -> std::result::Result<Turn, RenderError> {
        let clock = Stopwatch::start();
        self.whole = None;
        // Frames carry no passes, so none are accumulated.
        let film = Film { passes: Passes::NONE, ..scene.scene().film };
        // A film without memory is told now, not after all coarse frames.
        let whole = scene.with_film(film)?;
        let held = bytes_of_film(&self.renderer);
        film_memory::check_shown(&film, sums_of(whole.scene()), held)?;
        let coarse = coarse_divisors(&film).map(|divisor| {
            let [width, height] = [film.width, film.height].map(|n| n.div_ceil(divisor));
            scene.with_film(Film { width, height, ..film })
        });
        let coarse = coarse.collect::<std::result::Result<Vec<_>, RenderError>>()?;
        let view = View { revision, coarse, whole, clock, job };

        let former = self.stand_in.take();
        self.begin(&view)?;
        let patience = if former.is_some() { Duration::ZERO } else { PATIENCE };
        if !self.is_prepared(patience, job)?
            && let Some(stand_in) = former.or_else(|| self.standing_in(scene))
        {
            self.stand_in = Some(stand_in);
            self.tell();
            match self.refine(&view, Beginning::Coarse { is_set: false }) {
                Ok(Turn::Prepared(shown_spp)) => {
                    self.leave_stand_in();
                    return self.refine(&view, Beginning::Whole { shown_spp });
                }
                Err(RenderError::Scene(_) | RenderError::Memory(_)) => {
                    // Such as too little memory for both: the renderer draws as soon as it can.
                    self.leave_stand_in();
                    self.begin(&view)?;
                }
                Err(RenderError::Device(error)) => {
                    self.leave_stand_in();
                    return Err(RenderError::Device(error));
                }
                other => return other,
            }
        }
        self.refine(&view, Beginning::Coarse { is_set: true })
    }

    /// Adds samples until the picture is done or something changes. Where another has shown samples, frames are published when there are as
    /// many, or when as much time has passed again.
    fn refine(&mut self, view: &View<'_>, beginning: Beginning) -> std::result::Result<Turn, RenderError> {
        let (clock, job) = (&view.clock, view.job);
        let (mut is_set, shown_spp, begun) = match beginning {
            Beginning::Coarse { is_set } => (is_set, 0, 0.0),
            Beginning::Whole { shown_spp } => (false, shown_spp, clock.seconds()),
        };
        if let Beginning::Coarse { .. } = beginning {
            if self.drawing().has_coarse_frames() {
                // A device that failed meanwhile may have been shown a coarse film.
                if !(is_set && self.is_whole_set) {
                    self.show(view, None)?;
                }
                is_set = true;
                self.draw_coarse_frames(view)?;
            } else {
                for place in 0..view.coarse.len() {
                    if !std::mem::take(&mut is_set) {
                        self.show(view, Some(place))?;
                    }
                    let progress = self.drawing().advance(Duration::ZERO, 1, job)?;
                    // If a device failure restarted the picture meanwhile, there is nothing to show yet.
                    self.publish(view, progress, Stage::Coarse)?;
                }
            }
        }
        if !is_set {
            self.show(view, None)?;
        }
        self.whole = Some(view.revision);
        self.shared.board().error = None;
        let mut last_published = Instant::now();
        let (mut published_spp, mut spp) = (0, 0);
        loop {
            let age = Duration::from_secs_f64(clock.seconds() / 4.0);
            let slice = age.clamp(FIRST_SLICE, LONGEST_SLICE);
            let limit = self.stop.most_samples(spp);
            let progress = self.drawing().advance(slice, limit, job)?;
            spp = progress.spp;
            let stands_in = self.stand_in.is_some();
            let enough = self.stop.is_met(&progress, clock.seconds() - begun);
            // The last frame is the renderer's own.
            let done = enough && !stands_in;
            let is_behind = progress.spp < shown_spp && clock.seconds() < 2.0 * begun;
            // Denoising a large film takes as long as a slice: samples get twice that time at least.
            let is_due = published_spp == 0
                || (progress.spp > published_spp
                    && last_published.elapsed() >= slice.max(2 * self.denoising));
            if done || (is_due && !is_behind) {
                let stage = if done { Stage::Converged } else { Stage::Refining };
                let begun_anew = !self.publish(view, progress, stage)?;
                if begun_anew {
                    published_spp = 0;
                    continue;
                }
                (last_published, published_spp) = (Instant::now(), progress.spp);
            }
            self.look_up();
            self.label_film(job)?;
            if done {
                return Ok(Turn::Done);
            }
            if job.is_cancelled() {
                return Ok(Turn::Changed);
            }
            if stands_in && self.is_prepared(if enough { POLL_INTERVAL } else { Duration::ZERO }, job)? {
                return Ok(Turn::Prepared(published_spp));
            }
        }
    }

    /// What draws.
    fn drawing(&mut self) -> &mut FallbackRenderer {
        self.stand_in.as_mut().unwrap_or(&mut self.renderer)
    }

    /// Waits for the renderer to be prepared, at most so long; whether it is.
    fn is_prepared(&mut self, most: Duration, job: &Job) -> std::result::Result<bool, RenderError> {
        let start = Instant::now();
        loop {
            if self.renderer.prepare()? {
                return Ok(true);
            }
            if start.elapsed() >= most {
                return Ok(false);
            }
            if job.is_cancelled() {
                return Err(RenderError::Cancelled);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// What may draw while the renderer prepares. Nothing where volumes are drawn from disk: the memory that they share is for one renderer.
    fn standing_in(&self, scene: &LoadedScene) -> Option<FallbackRenderer> {
        let paged = scene.volumes().iter().any(|volume| volume.pages().is_some());
        if paged { None } else { self.renderer.stand_in() }
    }

    fn leave_stand_in(&mut self) {
        self.stand_in = None;
        self.whole = None;
    }

    /// Sets the scene that the first frame is made of.
    fn begin(&mut self, view: &View<'_>) -> std::result::Result<(), RenderError> {
        let is_coarse = !self.drawing().has_coarse_frames() && !view.coarse.is_empty();
        self.show(view, is_coarse.then_some(0))
    }

    /// Sets the scene with the coarse film at this place, or with the whole film.
    fn show(&mut self, view: &View<'_>, coarse: Option<usize>) -> std::result::Result<(), RenderError> {
        self.guides = None;
        self.denoised_on_device = false;
        self.is_whole_set = coarse.is_none();
        self.drawing().set_scene(coarse.map_or(&view.whole, |place| &view.coarse[place]))
    }

    /// Publishes the coarse frames that the renderer makes of the whole film, and the last of them enlarged if it was denoised. Their samples stay
    /// in the film.
    fn draw_coarse_frames(&mut self, view: &View<'_>) -> std::result::Result<(), RenderError> {
        let progress = Progress { spp: 1, mean_spp: 1.0, error_estimate: f64::INFINITY, all_rest: false };
        let mut last = None;
        for scene in &view.coarse {
            let Film { width, height, .. } = scene.scene().film;
            let denoise = self.denoise;
            let Some(CoarseFrame { color, alpha, guides }) =
                self.drawing().coarse_frame([width, height], denoise, view.job)?
            else {
                return Ok(());
            };
            let image = guides.as_ref().map(|guides| smooth(&color, None, guides, view.job)).transpose()?;
            let made = Made { filtered: image.is_some(), image: image.unwrap_or(color), alpha };
            self.put(view, progress, &made, Stage::Coarse)?;
            last = guides.map(|guides| (guides, made));
        }
        let Some((coarse, Made { image, alpha, filtered })) = last else { return Ok(()) };
        self.find_guides(view.job)?;
        let Some(fine) = &self.guides else { return Ok(()) };
        let Film { width, height, .. } = view.whole.scene().film;
        let pixels = CoarsePixels::new([width, height], [image.width as u32, image.height as u32]);
        if let Some(Enlarged { color, alpha }) =
            upsampled(&image, alpha.as_deref(), &pixels, [&coarse, fine])?
        {
            self.put(view, progress, &Made { image: color, alpha, filtered }, Stage::Coarse)?;
        }
        Ok(())
    }

    /// The picture to show, and whether it is denoised, on the renderer's device if that can.
    ///
    /// # Errors
    /// [`RenderError::Restarted`] if a device failure restarted the film.
    fn image(&mut self, denoise: bool, job: &Job) -> std::result::Result<(Image, bool), RenderError> {
        if !denoise {
            return Ok((self.drawing().color()?, false));
        }
        let start = Instant::now();
        if let Some(smooth) = self.drawing().denoised()? {
            // The first one also finds the first surfaces, and may compile.
            if self.denoised_on_device {
                self.denoising = start.elapsed();
            }
            self.denoised_on_device = true;
            return Ok((smooth, true));
        }
        let image = self.drawing().color()?;
        self.filtered(image, job)
    }

    /// The picture that the processor denoised and `true`; the picture as it is and `false` if a device failure restarted the film meanwhile.
    fn filtered(&mut self, image: Image, job: &Job) -> std::result::Result<(Image, bool), RenderError> {
        self.find_guides(job)?;
        let variance = match self.drawing().variance() {
            Err(RenderError::Restarted) => return Ok((image, false)),
            variance => variance?,
        };
        Ok(match &self.guides {
            Some(guides) if guides.fit(&image) => {
                let start = Instant::now();
                let smooth = smooth(&image, variance.as_ref(), guides, job)?;
                self.denoising = start.elapsed();
                (smooth, true)
            }
            _ => (image, false),
        })
    }

    /// Asks for the guides of the film, unless they are there. None remain if a device failure restarted the film.
    fn find_guides(&mut self, job: &Job) -> std::result::Result<(), RenderError> {
        if self.guides.is_none() {
            self.guides = match self.drawing().guides(job) {
                Err(RenderError::Restarted) => None,
                guides => guides?,
            };
        }
        Ok(())
    }

    /// Answers the pick requests that came in, and updates the counters.
    fn look_up(&mut self) {
        let (questions, panicking) = {
            let mut board = self.shared.board();
            for (name, count) in rebuilt_by_name(self.renderer.rebuilt()) {
                board.counters.insert(format!("rebuilt.{name}"), count);
            }
            (std::mem::take(&mut board.questions), board.panicking)
        };
        #[expect(clippy::panic, reason = "asked for by a test, and caught by `run`")]
        if panicking {
            panic!("a panic on purpose");
        }
        for Question { x, y, answer } in questions {
            // Sending fails if the client has stopped waiting.
            let _ = answer.send(self.drawing().pick(x, y));
        }
        self.tell();
    }

    /// Makes the label film of the revision that the renderer shows, if a client wants it. An edit cancels it, and then it is made of
    /// the next revision.
    fn label_film(&mut self, job: &Job) -> std::result::Result<(), RenderError> {
        if !self.shared.board().labels_wanted {
            return Ok(());
        }
        let made = match self.whole {
            Some(revision) => self.drawing().seen_surfaces(job).map(|seen| Some((revision, seen))),
            None => Ok(None),
        };
        if let Err(RenderError::Cancelled) = made {
            return Err(RenderError::Cancelled);
        }
        let (ids, film) = {
            let mut board = self.shared.board();
            board.labels_wanted = false;
            let scene = board.scene.scene();
            (label_film::ids(scene), scene.film)
        };
        let Some((revision, seen)) = made? else { return Ok(()) };
        // Clients look at the board at every redraw, so the film is made without it.
        let film = LabelFilm::new(revision, [film.width, film.height], &ids, &seen);
        let mut board = self.shared.board();
        // Until here an edit may have come of which the worker does not know yet: only if labels stay are instances and film the same.
        if board.labels_since <= revision {
            board.labels = Some(Arc::new(film));
        } else {
            board.labels_wanted = true;
        }
        Ok(())
    }

    /// Updates backend, device and notices in the status.
    fn tell(&mut self) {
        let mut notices = self.renderer.notices();
        notices.extend(self.stand_in.iter_mut().flat_map(Renderer::notices));
        let compiling = self.stand_in.is_some().then(|| self.renderer.name());
        let shared = Arc::clone(&self.shared);
        let drawing = self.drawing();
        let mut board = shared.board();
        (board.backend, board.compiling) = (drawing.name(), compiling);
        if board.device != drawing.device() {
            board.device = drawing.device().to_owned();
        }
        board.notices.extend(notices);
        let surplus = board.notices.len().saturating_sub(MOST_NOTICES);
        board.notices.drain(..surplus);
    }

    /// Publishes the picture so far as the newest frame; returns `false` if a device failure restarted it and there is nothing to show.
    fn publish(
        &mut self,
        view: &View<'_>,
        progress: Progress,
        stage: Stage,
    ) -> std::result::Result<bool, RenderError> {
        let (image, filtered) = match self.image(self.denoise && stage != Stage::Converged, view.job) {
            Err(RenderError::Restarted) => return Ok(false),
            made => made?,
        };
        let alpha = match self.drawing().alpha() {
            Err(RenderError::Restarted) => return Ok(false),
            alpha => alpha?,
        };
        self.put(view, progress, &Made { image, alpha, filtered }, stage)?;
        Ok(true)
    }

    /// Makes a picture the newest frame.
    fn put(
        &self,
        view: &View<'_>,
        progress: Progress,
        made: &Made,
        stage: Stage,
    ) -> std::result::Result<(), RenderError> {
        let Made { image, alpha, filtered } = made;
        let rgba = rows_from_bottom(image, alpha.as_deref())?;
        let mut board = self.shared.board();
        let serial = board.frame.as_ref().map_or(0, |f| f.serial) + 1;
        *board.counters.entry("frames".into()).or_default() += 1;
        board.frame = Some(Arc::new(Frame {
            width: image.width as u32,
            height: image.height as u32,
            rgba,
            serial,
            revision: view.revision,
            spp: progress.spp,
            error_estimate: progress.error_estimate,
            seconds: view.clock.seconds(),
            cpu_seconds: view.clock.cpu_seconds(),
            coarse: stage == Stage::Coarse,
            filtered: *filtered,
            converged: stage == Stage::Converged,
        }));
        Ok(())
    }
}

/// The picture, denoised on the processor.
///
/// # Errors
/// [`RenderError::Cancelled`] soon after `job` is cancelled; [`RenderError::Memory`].
fn smooth(
    image: &Image,
    variance: Option<&Image>,
    guides: &Guides,
    job: &Job,
) -> std::result::Result<Image, RenderError> {
    denoised_unless_cancelled(image, variance.map(variance_known), guides, job)?.ok_or(RenderError::Cancelled)
}

/// Counts of what was built, by name.
pub(crate) fn rebuilt_by_name(rebuilt: Rebuilt) -> [(&'static str, u64); 6] {
    [
        ("camera", rebuilt.camera),
        ("film", rebuilt.film),
        ("lights", rebuilt.lights),
        ("materials", rebuilt.materials),
        ("acceleration", rebuilt.acceleration),
        ("top_level", rebuilt.top_level),
    ]
}

/// Colours and alpha (1 if `None`) as four floats per pixel, the lowest row first.
///
/// # Errors
/// When there is no memory for them.
pub(crate) fn rows_from_bottom(
    image: &Image,
    alpha: Option<&[f32]>,
) -> std::result::Result<Vec<f32>, NoMemory> {
    let mut rgba = reserved(4 * image.pixels.len(), "film: a frame to show")?;
    let width = image.width.max(1);
    let places = (0..image.pixels.len() / width).rev().flat_map(|y| y * width..(y + 1) * width);
    let pixel = |place: usize| {
        let [r, g, b] = image.pixels[place];
        [r, g, b, alpha.map_or(1.0, |alpha| alpha[place])]
    };
    rgba.extend(places.flat_map(pixel));
    Ok(rgba)
}

/// Divisors of the film's sides for the coarse frames: each is half of the previous one, starting with about
/// [`COARSEST_PIXELS`] pixels and ending with the divisor 2.
pub(crate) fn coarse_divisors(film: &Film) -> impl Iterator<Item = u32> {
    let pixels = u64::from(film.width) * u64::from(film.height);
    let halvings = (pixels / COARSEST_PIXELS).max(1).ilog2().div_ceil(2);
    (1..=halvings).rev().map(|h| 1 << h)
}

/// The message of a panic.
pub fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a panic without a text".into())
}
