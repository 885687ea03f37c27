//! A renderer that is kept from one picture to the next, such as the frames of an animation, and that shows each picture while it grows.
//!
//! ```text
//! scene ─► set_scene: keeps what it has in common with the last ─► coarse frames ─► samples until a limit ─► picture with its passes
//!                                                                       ├── frames: immutable, numbered ──┤
//!                                                                       └── now and then all passes ──────┘
//! ```
//! A picture is bit for bit the one that [`render_scene`](crate::render_file::render_scene) makes of the same scene with the same number of
//! samples, whatever was drawn before it and whether it was shown: a scene's data do not depend on those of other scenes, and coarse frames
//! are renders of a smaller film, which are never mixed into it. Unlike a [live picture](crate::live), it has passes and ends.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use pumice_core::Job;
use pumice_picture::Image;
use pumice_scene::{Film, World};
use pumice_transport::{LoadedScene, RenderError, Renderer};

use crate::backend::{FallbackRenderer, make_renderer};
use crate::denoise::Filter;
use crate::error::{Result, SessionError};
use crate::live::{Frame, coarse_divisors, rebuilt_by_name, rows_from_bottom};
use crate::measure::Stopwatch;
use crate::progressive::{CurvePoint, Stop};
use crate::render_file::{PageFigures, Rendered, check_memory, report, sampled, sky_hash_text};

/// Coarse frames take a third of the time of a sample. A picture of so many samples has all of them, at the cost of a hundredth…
const SAMPLES_FOR_ALL_COARSE: u32 = 32;
/// … and a picture of fewer those that come within this time: a sample of a large film takes seconds on a processor.
const COARSE_SECONDS: f64 = 0.4;
/// Time between two frames.
const PAUSE_SECONDS: f64 = 1.0;
/// A frame is due only when this many times the time that the last one took has passed, so that frames take at most a twentieth of it.
const PAUSES_OF_A_FRAME: f64 = 20.0;
/// Time between two pictures with passes: they show what is where, which samples hardly change.
const PAUSE_OF_PASSES_SECONDS: f64 = 5.0;
/// As for frames: a hundredth of the time, since whoever shows passes takes as long again.
const PAUSES_OF_PASSES: f64 = 100.0;

/// What a render does for those who watch it, and with the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watching {
    /// Whether it publishes frames while it renders.
    pub growing: bool,
    /// Whether it makes pictures with all passes while it renders, the first one after the first samples.
    pub passes: bool,
    /// Whether a cancelled render returns its picture so far, if it has any sample, and not [`RenderError::Cancelled`].
    pub unfinished: bool,
    /// The filter that the picture that it returns goes through; frames and pictures before it go through none.
    pub denoise: Option<Filter>,
}

/// The renderer; see the module.
#[derive(Debug)]
pub struct PersistentRenderer {
    renderer: Mutex<FallbackRenderer>,
    sky: Mutex<Option<HashedSky>>,
    board: Mutex<Board>,
}

/// The world that the renderer has, and the hash of its sky's picture. A renderer reads that picture when the world changes, and so does the hash:
/// a sky of 100 MB is not read for each picture of an animation.
#[derive(Debug)]
struct HashedSky {
    world: World,
    hash: Option<String>,
}

#[derive(Debug, Default)]
struct Board {
    frame: Option<Arc<Frame>>,
    /// The newest picture with passes that nobody has taken.
    so_far: Option<Rendered>,
    serial: u64,
    picture: u64,
}

/// The frames of one picture, and its pictures with passes: when the next is due.
struct Pace {
    clock: Stopwatch,
    due: f64,
    passes_due: f64,
    /// Why there are no more of these pictures.
    passes_fault: Option<RenderError>,
}

impl PersistentRenderer {
    /// A renderer with a backend as for `--backend`. The device is opened with the first scene.
    ///
    /// # Errors
    /// When there is no such backend.
    pub fn new(backend: &str) -> Result<Self> {
        Ok(Self::of(make_renderer(backend)?))
    }

    fn of(renderer: FallbackRenderer) -> Self {
        Self { renderer: Mutex::new(renderer), sky: Mutex::default(), board: Mutex::default() }
    }

    /// Renders a scene until `stop` is met, and calls `watch` after each slice. A second call waits for the first.
    ///
    /// # Errors
    /// Any error of the renderer, and [`RenderError::Cancelled`] soon after `job` is cancelled; [`SessionError::Caller`] once a call has
    /// panicked.
    pub fn render(
        &self,
        scene: &LoadedScene,
        stop: &Stop,
        job: &Job,
        watching: Watching,
        watch: &mut dyn FnMut(&CurvePoint),
    ) -> Result<Rendered> {
        let mut renderer = self.renderer.lock().map_err(|_| {
            SessionError::Caller("renderer: an earlier picture ended with a panic; make a new one".into())
        })?;
        self.board().picture += 1;
        let rendered = self.drawn(&mut renderer, scene, stop, job, watching, watch);
        // Whoever wants the last frame has the picture instead.
        let mut board = self.board();
        (board.frame, board.so_far) = (None, None);
        rendered
    }

    /// The newest frame of the picture that is rendered now, if its serial is above `after`. Never waits for the renderer.
    pub fn latest(&self, after: u64) -> Option<Arc<Frame>> {
        self.board().frame.as_ref().filter(|f| f.serial > after).cloned()
    }

    /// The newest picture so far with all passes, of what is rendered now, if it was not taken before; the render must be watched with
    /// [`Watching::passes`]. Never waits for the renderer.
    pub fn take_so_far(&self) -> Option<Rendered> {
        self.board().so_far.take()
    }

    /// How often each kind of data was built, by name. Waits for a picture that is being rendered.
    pub fn rebuilt(&self) -> [(&'static str, u64); 6] {
        rebuilt_by_name(self.renderer.lock().unwrap_or_else(PoisonError::into_inner).rebuilt())
    }

    fn board(&self) -> MutexGuard<'_, Board> {
        // Every statement under the lock leaves the board consistent, so a poisoned lock is safe to use.
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn drawn(
        &self,
        renderer: &mut FallbackRenderer,
        scene: &LoadedScene,
        stop: &Stop,
        job: &Job,
        watching: Watching,
        watch: &mut dyn FnMut(&CurvePoint),
    ) -> Result<Rendered> {
        check_memory(renderer, scene)?;
        let pages_before = PageFigures::of(scene.volumes());

        // Something to see at once.
        let clock = Stopwatch::start();
        if watching.growing {
            self.show_coarse(renderer, scene, stop, job)?;
        }

        // Build what the scene needs and the last one had not.
        renderer.set_scene(scene)?;
        let sky_hash = self.sky_hash(scene)?;
        let prepare_seconds = [clock.seconds(), clock.cpu_seconds()];

        // Add samples, with a frame now and then.
        let mut pace = Pace { clock: Stopwatch::start(), due: 0.0, passes_due: 0.0, passes_fault: None };
        let sampling = sampled(renderer, stop, job, &mut |renderer, point| {
            watch(point);
            if watching.growing && pace.clock.seconds() >= pace.due {
                let start = pace.clock.seconds();
                self.publish(renderer, point, false)?;
                let took = pace.clock.seconds() - start;
                pace.due = start + PAUSE_SECONDS.max(took * PAUSES_OF_A_FRAME);
            }
            if watching.passes && pace.passes_fault.is_none() && pace.clock.seconds() >= pace.passes_due {
                let start = pace.clock.seconds();
                match self.publish_passes(renderer, point) {
                    // The picture itself may have room, since one that was taken is held beside it.
                    Err(lack @ RenderError::Memory(_)) => pace.passes_fault = Some(lack),
                    made => made?,
                }
                let took = pace.clock.seconds() - start;
                pace.passes_due = start + PAUSE_OF_PASSES_SECONDS.max(took * PAUSES_OF_PASSES);
            }
            Ok(())
        });

        // A cancelled picture has what there is.
        let (curve, picture) = match sampling {
            Err(SessionError::Render(RenderError::Cancelled)) if watching.unfinished => {
                // Asks for progress and adds no sample.
                let progress = renderer.advance(Duration::ZERO, 0, &Job::new())?;
                if progress.mean_spp == 0.0 {
                    // A picture takes time: a device compiles for it.
                    return Err(RenderError::Cancelled.into());
                }
                let picture = match renderer.picture() {
                    // The device failed and took the samples with it.
                    Err(RenderError::Restarted) => return Err(RenderError::Cancelled.into()),
                    picture => picture?,
                };
                (vec![CurvePoint::of(&progress, &pace.clock)], picture)
            }
            sampling => sampling?,
        };
        let mut rendered = report(renderer, scene, pages_before, prepare_seconds, curve, picture, sky_hash);
        if let Some(fault) = pace.passes_fault {
            rendered.figures.notices.push(format!("passes were not shown while the picture grew: {fault}"));
        }
        if let Some(filter) = watching.denoise {
            rendered.denoise_with(renderer, filter)?;
        }
        Ok(rendered)
    }

    /// The hash of a scene's sky, which the renderer has just been set to.
    fn sky_hash(&self, scene: &LoadedScene) -> Result<Option<String>> {
        // A panic leaves the last sky, whole.
        let mut known = self.sky.lock().unwrap_or_else(PoisonError::into_inner);
        let world = &scene.scene().world;
        match &*known {
            Some(sky) if sky.world == *world => Ok(sky.hash.clone()),
            _ => {
                let hash = sky_hash_text(scene.scene())?;
                *known = Some(HashedSky { world: world.clone(), hash: hash.clone() });
                Ok(hash)
            }
        }
    }

    /// Publishes frames with fewer pixels than the film, finer each time, as long as they are worth it.
    fn show_coarse(
        &self,
        renderer: &mut FallbackRenderer,
        scene: &LoadedScene,
        stop: &Stop,
        job: &Job,
    ) -> Result<()> {
        let all = stop.spp.is_none_or(|spp| spp >= SAMPLES_FOR_ALL_COARSE);
        let film = scene.scene().film;
        let clock = Stopwatch::start();
        for divisor in coarse_divisors(&film) {
            let [width, height] = [film.width, film.height].map(|n| n.div_ceil(divisor));
            renderer.set_scene(&scene.with_film(Film { width, height, ..film })?)?;
            let start = clock.seconds();
            let progress = renderer.advance(Duration::ZERO, 1, job)?;
            self.publish(renderer, &CurvePoint::of(&progress, &clock), true)?;
            // The next has four times as many pixels.
            if !all && clock.seconds() + 4.0 * (clock.seconds() - start) > COARSE_SECONDS {
                break;
            }
        }
        Ok(())
    }

    /// Publishes the picture so far as the newest frame; if a device failure has restarted it, there is nothing to show.
    fn publish(
        &self,
        renderer: &mut dyn Renderer,
        point: &CurvePoint,
        coarse: bool,
    ) -> std::result::Result<(), RenderError> {
        let read =
            |renderer: &mut dyn Renderer| -> std::result::Result<(Image, Option<Vec<f32>>), RenderError> {
                Ok((renderer.color()?, renderer.alpha()?))
            };
        let (image, alpha) = match read(renderer) {
            Err(RenderError::Restarted) => return Ok(()),
            read => read?,
        };
        let rgba = rows_from_bottom(&image, alpha.as_deref())?;
        let mut board = self.board();
        board.serial += 1;
        board.frame = Some(Arc::new(Frame {
            width: image.width as u32,
            height: image.height as u32,
            rgba,
            serial: board.serial,
            revision: board.picture,
            spp: point.spp,
            error_estimate: point.error_estimate.unwrap_or(f64::INFINITY),
            seconds: point.seconds,
            cpu_seconds: point.cpu_seconds,
            coarse,
            filtered: false,
            converged: false,
        }));
        Ok(())
    }

    /// Keeps the picture so far, with its passes, for whoever takes it; if a device failure has restarted it, there is nothing to show.
    fn publish_passes(
        &self,
        renderer: &mut dyn Renderer,
        point: &CurvePoint,
    ) -> std::result::Result<(), RenderError> {
        // The former one goes first, so that two of them never take memory here.
        self.board().so_far = None;
        let picture = match renderer.picture() {
            Err(RenderError::Restarted) => return Ok(()),
            picture => picture?,
        };
        self.board().so_far = Some(Rendered::so_far(picture, renderer.name(), point));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::fakes::{At, full, preparing, scene, ways};

    fn drawn(fails: &[(&'static str, At)]) -> Result<Rendered> {
        let renderer = PersistentRenderer::of(ways(fails, full).0);
        let stop = Stop { spp: Some(4), ..Stop::default() };
        let watching = Watching { growing: true, passes: true, unfinished: true, denoise: None };
        renderer.render(&scene([4, 2]), &stop, &Job::new(), watching, &mut |_| ())
    }

    /// A device compiles for a picture as well, so none is made of no samples.
    #[test]
    fn what_is_cancelled_while_a_device_compiles_ends_without_a_picture() {
        let (renderer, log) = preparing(&[("vulkan-rt", At::Never)], &Arc::default(), At::Never);
        let renderer = PersistentRenderer::of(renderer);
        let (job, stop) = (Job::new(), Stop { spp: Some(4), ..Stop::default() });
        job.cancel();
        let watching = Watching { unfinished: true, ..Watching::default() };
        let drawn = renderer.render(&scene([4, 2]), &stop, &job, watching, &mut |_| ());
        assert!(matches!(drawn, Err(SessionError::Render(RenderError::Cancelled))));
        let log = log.lock().unwrap();
        assert!(log.iter().any(|call| call == "vulkan-rt SetScene"), "{log:?}");
        assert!(!log.iter().any(|call| call == "vulkan-rt Picture"), "{log:?}");
    }

    #[test]
    fn a_device_that_fails_is_followed_by_the_next_and_told() {
        for at in [At::Open, At::SetScene, At::PreparePicture, At::Advance, At::Color, At::Picture] {
            let made = drawn(&[("vulkan-rt", at), ("cpu", At::Never)]).unwrap();
            // The picture comes from one renderer: four samples, all after the failure.
            assert_eq!(
                (made.picture.color.pixels[0], made.figures.backend.as_str()),
                ([4.0; 3], "cpu"),
                "{at:?}"
            );
            let told = "vulkan-rt on X: out of GPU memory; going on with cpu".to_string();
            assert!(made.figures.notices.contains(&told), "{at:?}: {:?}", made.figures.notices);
        }
    }

    #[test]
    fn the_last_devices_failure_is_the_callers_error() {
        for at in [At::Open, At::SetScene, At::PreparePicture, At::Advance, At::Color, At::Picture] {
            let error = drawn(&[("vulkan-rt", at)]).unwrap_err();
            assert_eq!(error.to_string(), "vulkan-rt on X: out of GPU memory", "{at:?}");
        }
    }

    #[test]
    fn a_sky_is_hashed_once_until_the_world_changes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        std::fs::write(&path, "a sky").unwrap();
        let (renderer, of_sky) = (PersistentRenderer::of(ways(&[("cpu", At::Never)], full).0), |strength| {
            let mut scene = scene([4, 2]).scene().clone();
            scene.world.environment =
                pumice_scene::Environment::Image { path: path.clone(), rotation_rad: 0.0, strength };
            scene
        });
        let drawn = |scene: pumice_scene::Scene| {
            let of = self::scene([4, 2]);
            let loaded = LoadedScene::new(scene, of.volumes().to_vec(), of.meshes().to_vec()).unwrap();
            let stop = Stop { spp: Some(1), ..Stop::default() };
            let rendered = renderer.render(&loaded, &stop, &Job::new(), Watching::default(), &mut |_| ());
            rendered.map(|r| r.picture.provenance.unwrap().sky_hash)
        };
        let first = drawn(of_sky(1.0)).unwrap();
        assert!(first.is_some());
        // Without the file there is nothing to hash: the second picture has the hash of the first, a third under another world has none.
        std::fs::remove_file(&path).unwrap();
        let mut seen_from_elsewhere = of_sky(1.0);
        seen_from_elsewhere.camera.shift = [0.25, 0.0];
        assert_eq!(drawn(seen_from_elsewhere).unwrap(), first);
        assert!(drawn(of_sky(2.0)).unwrap_err().to_string().contains("sky.exr"));
    }
}
