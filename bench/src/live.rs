//! Measures how soon a live picture shows an edit, and how long the caller of the edit waits. In wall milliseconds, because that is what a
//! person at the screen waits for.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Args;
use pumice_core::{CompressedVolume, Job};
use pumice_formats::OpenOptions;
use pumice_scene::{Material, Scene, SceneEdit};
use pumice_session::error::{Result, SessionError};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::live::{Frame, Live, LiveOptions, LiveState};
use pumice_session::selection::select_labels;
use pumice_session::{Residence, open_volume};
use pumice_transport::LoadedScene;
use serde::Serialize;

use crate::console::{BenchResult, Console, Outcome};
use crate::files::file_name;
use crate::table::{Row, TableFlags};

/// Width and height of the picture in pixels.
const SIZE: [u32; 2] = [1920, 1080];
/// Number of edits of each kind.
const ROUNDS: usize = 20;
/// Number of labels in the scene that does not show all.
const SOME: usize = 32;

/// Time until a live 1920 × 1080 picture shows an edit, and time that the edit takes its caller
///
/// Moves the camera and edits a colour, 20 times each, in a scene of 32 labels and in one of all labels, each with its own material.
/// Reports medians in wall milliseconds.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let mut rows = Vec::new();
    for volume in &flags.table.volumes {
        rows.extend(measure_live(volume, job)?);
    }
    flags.table.show("live", &rows, console)?;
    Ok(Outcome::Holds)
}

/// Median and largest of some durations, in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Milliseconds {
    /// The median.
    pub median: f64,
    /// The longest duration.
    pub largest: f64,
}

impl Milliseconds {
    fn of(mut durations: Vec<Duration>) -> Self {
        durations.sort_unstable();
        let at = |i: usize| durations.get(i).map_or(f64::NAN, |d| 1e3 * d.as_secs_f64());
        Self { median: at(durations.len() / 2), largest: at(durations.len().saturating_sub(1)) }
    }
}

/// Latencies of one kind of edit in one scene.
#[derive(Clone, Debug, Serialize)]
pub struct EditLatency {
    /// The volume's file name.
    pub volume: String,
    /// The labels that the scene shows.
    pub labels: &'static str,
    /// What is edited: `camera` or `colour`.
    pub edit: &'static str,
    /// From the call of the edit to its return.
    pub call_ms: Milliseconds,
    /// From the call to the first frame that shows the edit.
    pub first_frame_ms: Milliseconds,
    /// From the call to the first frame at full size with one sample per pixel.
    pub whole_frame_ms: Milliseconds,
}

/// Measures both kinds of edits in both scenes of a volume.
///
/// # Errors
/// Errors of opening and rendering; a volume without labels; the job's cancellation.
pub fn measure_live(path: &Path, job: &Job) -> Result<Vec<EditLatency>> {
    let volume = open_volume(path, &OpenOptions::default(), Residence::Copied, job)?;
    let Some(&id) = volume.labels().ids().first() else {
        return Err(SessionError::Caller(format!(
            "{}: expected a volume with labels, got one without",
            path.display()
        )));
    };
    let mut all = Vec::new();
    for (labels, own_materials) in [("32", false), ("all, each with its own material", true)] {
        let scene = scene_of(&volume, path, own_materials);
        let camera = scene.camera;
        let scene = LoadedScene::new(scene, vec![Arc::clone(&volume)], vec![])?;
        let live = Live::start(scene, LiveOptions::default())?;
        let mut serial = wait(&live, 0, job, |f| !f.coarse)?.serial;
        let move_camera = |i: usize| {
            let mut camera = camera;
            camera.shift[0] += 1e-3 * i as f64;
            SceneEdit::Camera { camera }
        };
        let edit_colour = |i: usize| {
            let material =
                Material { base_color: [i as f32 / ROUNDS as f32, 0.5, 0.5], ..Material::default() };
            SceneEdit::LabelMaterials { id: 1, materials: [(id, Some(material))].into() }
        };
        let edits: [(&str, &dyn Fn(usize) -> SceneEdit); 2] =
            [("camera", &move_camera), ("colour", &edit_colour)];
        for (edit, make) in edits {
            let (mut calls, mut firsts, mut wholes) = (Vec::new(), Vec::new(), Vec::new());
            for i in 0..ROUNDS {
                let begin = Instant::now();
                let revision = live.edit(vec![make(i)])?;
                calls.push(begin.elapsed());
                let first = wait(&live, serial, job, |f| f.revision == revision)?;
                firsts.push(begin.elapsed());
                let whole = wait(&live, first.serial - 1, job, |f| f.revision == revision && !f.coarse)?;
                serial = whole.serial;
                wholes.push(begin.elapsed());
            }
            all.push(EditLatency {
                volume: file_name(path),
                labels,
                edit,
                call_ms: Milliseconds::of(calls),
                first_frame_ms: Milliseconds::of(firsts),
                whole_frame_ms: Milliseconds::of(wholes),
            });
        }
    }
    Ok(all)
}

/// A figure of the longest labels, or (`own_materials`) of all labels, each with its own material.
fn scene_of(volume: &CompressedVolume, path: &Path, own_materials: bool) -> Scene {
    let labels = (!own_materials).then(|| select_labels(volume, SOME));
    let options = FigureOptions { size: SIZE, labels, view_deg: FigureOptions::DEFAULT_VIEW_DEG };
    let mut scene = compose(volume, path.to_owned(), &options);
    if own_materials {
        let of = |id: &u64| (*id, Material { base_color: [0.25, 0.5, 0.75], ..Material::default() });
        scene.instances[0].style.materials = volume.labels().ids().iter().map(of).collect();
    }
    scene
}

/// Waits for a frame with a serial number above `after` for which `wanted` holds.
fn wait(live: &Live, after: u64, job: &Job, wanted: impl Fn(&Frame) -> bool) -> Result<Arc<Frame>> {
    loop {
        match live.latest(after) {
            Some(frame) if wanted(&frame) => return Ok(frame),
            _ => {
                job.check()?;
                let status = live.status();
                if status.state == LiveState::Failed {
                    return Err(SessionError::Caller(
                        status.error.unwrap_or_else(|| "the live picture ended".into()),
                    ));
                }
                std::thread::sleep(Duration::from_micros(200));
            }
        }
    }
}

impl Row for EditLatency {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let median = |ms: Milliseconds| format!("{:.3}", ms.median);
        vec![
            ("volume", self.volume.clone()),
            ("labels shown", self.labels.into()),
            ("edit", self.edit.into()),
            ("call, ms", median(self.call_ms)),
            ("first frame, ms", median(self.first_frame_ms)),
            ("whole frame of 1 sample, ms", median(self.whole_frame_ms)),
        ]
    }
}
