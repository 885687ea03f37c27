//! `pumice bench denoise --viewport`: how soon a live picture looks like the converged one after the camera moved.
//!
//! ```text
//! scene, camera moved ─► many samples ─► reference ──────────────────────────────────────────────┐
//! live picture of the scene ─► camera moved ─► its frames, kept with their time ─► whole film ───┴─► FLIP of each
//! ```
//! A coarse frame is enlarged as a viewport shows it, each pixel a square. Frames are judged when the live picture has ended, so that judging
//! takes no time from it. Times are CPU seconds of the process since the worker began with the moved camera; on a machine that does nothing
//! else a picture takes that many seconds over the number of cores.

use std::sync::Arc;
use std::time::{Duration, Instant};

use pumice_core::{CompressedVolume, Job};
use pumice_picture::Image;
use pumice_picture::metrics::display::display_from_linear;
use pumice_picture::metrics::flip::{flip_map, mean_flip};
use pumice_scene::{Scene, SceneEdit};
use pumice_session::error::{Result, SessionError};
use pumice_session::live::{Frame, Live, LiveOptions, LiveState};
use pumice_session::open_meshes;
use pumice_transport::LoadedScene;

use super::DrawnBy;
use crate::table::Row;

/// FLIP at which a picture counts as close to the converged one.
pub(super) const BAR: f64 = 0.06;
/// Seconds after a camera move in which the viewport should reach [`BAR`] on two cores.
pub(super) const SECONDS: f64 = 3.0;
pub(super) const CORES: f64 = 2.0;
/// CPU seconds for which a live picture is watched.
pub(super) const WATCHED_CPU_SECONDS: f64 = 4.0 * SECONDS * CORES;
/// Shift of the camera's view, in widths of the picture.
const MOVE: f64 = 0.05;
/// How long the thread that watches sleeps between two looks: a hundredth of what the fastest frames take.
const LOOK: Duration = Duration::from_millis(1);
/// Without a frame for so long the live picture counts as dead.
const PATIENCE: Duration = Duration::from_secs(600);

/// A frame of the live picture and how far it is from the reference.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub(super) struct Shown {
    /// CPU seconds since the worker began with the moved camera.
    pub cpu_seconds: f64,
    /// Wall seconds in the same time.
    pub seconds: f64,
    /// Samples in every pixel.
    pub spp: u32,
    /// Whether only some of the film's pixels had a sample.
    pub is_coarse: bool,
    /// The film's width over that of the frame, rounded; 1 also for a coarse frame that was enlarged.
    pub divisor: u32,
    /// FLIP against the reference.
    pub flip: f64,
}

/// Result of one scene, with the denoiser or without.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub(super) struct Viewport {
    /// Name of the scene.
    pub scene: &'static str,
    /// Whether frames were denoised.
    pub denoised: bool,
    /// The first frame of the whole film.
    pub whole: Shown,
    /// The last frame that was shown within [`SECONDS`] on two cores.
    pub in_time: Option<Shown>,
    /// The first frame whose FLIP is at most [`BAR`], among those that were watched.
    pub close: Option<Shown>,
    /// All frames that were watched.
    pub frames: Vec<Shown>,
}

/// The scene after the camera move.
pub(super) fn moved(scene: &Scene) -> Scene {
    let mut moved = scene.clone();
    moved.camera.shift[0] += MOVE;
    moved
}

/// Watches a live picture of `scene` whose camera moves, without and with the denoiser, and judges its frames against `reference`, the
/// converged picture of [`moved`].
///
/// # Errors
/// Errors of rendering; a live picture that ends; the job's cancellation.
pub(super) fn watched(
    name: &'static str,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    reference: &Image,
    drawn_by: &mut DrawnBy,
    job: &Job,
) -> Result<Vec<Viewport>> {
    let expected = display_from_linear(reference);
    let mut results = Vec::new();
    for denoised in [false, true] {
        let frames = frames(scene, volume, denoised, drawn_by, job)?;
        let judge = |frame: &Frame| -> Result<Shown> {
            job.check()?;
            let image = enlarged(frame, [reference.width, reference.height]);
            Ok(Shown {
                cpu_seconds: frame.cpu_seconds,
                seconds: frame.seconds,
                spp: frame.spp,
                is_coarse: frame.coarse,
                divisor: (reference.width as f64 / f64::from(frame.width)).round() as u32,
                flip: mean_flip(&flip_map(&display_from_linear(&image), &expected)),
            })
        };
        let frames = frames.iter().map(|frame| judge(frame)).collect::<Result<Vec<Shown>>>()?;
        let whole = frames.iter().find(|f| !f.is_coarse).ok_or_else(|| died("no frame of the whole film"))?;
        results.push(Viewport {
            scene: name,
            denoised,
            whole: *whole,
            in_time: frames.iter().rev().find(|f| f.cpu_seconds <= SECONDS * CORES).copied(),
            close: frames.iter().find(|f| f.flip <= BAR).copied(),
            frames,
        });
    }
    Ok(results)
}

fn died(what: &str) -> SessionError {
    SessionError::Caller(format!("the live picture: {what}"))
}

/// The frames of the live picture after the camera move.
fn frames(
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    denoise: bool,
    drawn_by: &mut DrawnBy,
    job: &Job,
) -> Result<Vec<Arc<Frame>>> {
    let loaded = LoadedScene::new(scene.clone(), vec![Arc::clone(volume)], open_meshes(scene)?)?;
    let backend = drawn_by.backend.clone();
    let live = Live::start(loaded, LiveOptions { backend, denoise, ..LiveOptions::default() })?;
    let next = |after: u64| -> Result<Arc<Frame>> {
        let begin = Instant::now();
        loop {
            if let Some(frame) = live.latest(after) {
                return Ok(frame);
            }
            job.check()?;
            let status = live.status();
            if status.state == LiveState::Failed || begin.elapsed() > PATIENCE {
                return Err(status.error.map_or_else(|| died("no frame came"), SessionError::Caller));
            }
            std::thread::sleep(LOOK);
        }
    };
    let mut serial = 0;
    loop {
        let frame = next(serial)?;
        serial = frame.serial;
        if !frame.coarse {
            break;
        }
    }
    let revision = live.edit(vec![SceneEdit::Camera { camera: moved(scene).camera }])?;
    let mut frames = Vec::new();
    loop {
        let frame = next(serial)?;
        serial = frame.serial;
        if frame.revision == revision {
            let is_last = frame.cpu_seconds > WATCHED_CPU_SECONDS && !frame.coarse;
            frames.push(frame);
            if is_last {
                let status = live.status();
                drawn_by.remember(&status.device, status.notices);
                live.stop();
                return Ok(frames);
            }
        }
    }
}

/// A frame at the size of the film, its rows from the top, each pixel as a square.
fn enlarged(frame: &Frame, [width, height]: [usize; 2]) -> Image {
    let (across, down) = (frame.width as usize, frame.height as usize);
    let pixel = |x: usize, y: usize| {
        let row = down - 1 - y * down / height;
        let at = 4 * (row * across + x * across / width);
        [frame.rgba[at], frame.rgba[at + 1], frame.rgba[at + 2]]
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| pixel(x, y))).collect();
    Image::new(width, height, pixels)
}

impl Shown {
    /// Its samples, and where they are.
    pub(super) fn samples(&self) -> String {
        match *self {
            Self { spp, is_coarse: false, .. } => spp.to_string(),
            Self { spp, divisor: 0 | 1, .. } => format!("{spp} in some pixels, enlarged"),
            Self { spp, divisor, .. } => format!("{spp} of 1/{divisor} of the film's width"),
        }
    }
}

impl Row for Viewport {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let of = |shown: Option<Shown>, text: &dyn Fn(&Shown) -> String| {
            shown.as_ref().map_or_else(|| "–".to_owned(), text)
        };
        let cpu = |s: &Shown| format!("{:.2}", s.cpu_seconds);
        let flip = |s: &Shown| format!("{:.3}", s.flip);
        vec![
            ("scene", self.scene.into()),
            ("denoised", if self.denoised { "yes" } else { "no" }.into()),
            ("whole film, CPU s", cpu(&self.whole)),
            ("its FLIP", flip(&self.whole)),
            ("samples in 6 CPU s", of(self.in_time, &Shown::samples)),
            ("FLIP then", of(self.in_time, &flip)),
            ("FLIP 0.06, CPU s", of(self.close, &cpu)),
            ("with samples", of(self.close, &Shown::samples)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coarse_frame_is_enlarged_and_turned_upright() {
        let frame = Frame {
            width: 2,
            height: 1,
            rgba: [0.0, 1.0].iter().flat_map(|&v| [v, 10.0 + v, 20.0 + v, 1.0]).collect(),
            serial: 1,
            revision: 1,
            spp: 1,
            error_estimate: f64::INFINITY,
            seconds: 0.0,
            cpu_seconds: 0.0,
            coarse: true,
            filtered: false,
            converged: false,
        };
        let (a, b) = ([0.0, 10.0, 20.0], [1.0, 11.0, 21.0]);
        assert_eq!(enlarged(&frame, [3, 2]).pixels, [a, a, b, a, a, b]);
        // The lowest row of a frame comes first, that of an image last.
        let turned = Frame { width: 1, height: 2, ..frame };
        assert_eq!(enlarged(&turned, [1, 2]).pixels, [b, a]);
    }

    #[test]
    fn a_scene_that_is_never_close_says_so() {
        let shown = Shown { cpu_seconds: 1.25, seconds: 1.0, spp: 3, is_coarse: true, divisor: 2, flip: 0.1 };
        let row = Viewport {
            scene: "a",
            denoised: true,
            whole: shown,
            in_time: Some(shown),
            close: None,
            frames: vec![shown],
        };
        let cells: Vec<String> = row.cells().into_iter().map(|c| c.1).collect();
        assert_eq!(cells, ["a", "yes", "1.25", "0.100", "3 of 1/2 of the film's width", "0.100", "–", "–"]);
        assert_eq!(row.cells()[4].0, format!("samples in {} CPU s", SECONDS * CORES));
        assert_eq!(row.cells()[6].0, format!("FLIP {BAR}, CPU s"));
    }
}
