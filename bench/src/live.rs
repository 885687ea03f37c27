//! Measures how soon a live picture shows an edit, and how long the caller of the edit waits. In wall milliseconds, because that is what a
//! person at the screen waits for.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Args;
use pumice_core::{CompressedVolume, Job};
use pumice_formats::OpenOptions;
use pumice_scene::{LabelGroup, LabelGroups, Material, Scene, SceneEdit, SceneError, Show};
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
/// Number of labels that are isolated.
const FEW: usize = 100;

/// Time until a live 1920 × 1080 picture shows an edit, and time that the edit takes its caller
///
/// Moves the camera and edits a colour, 20 times each, in a scene of 32 labels and in one of all labels, each with a colour of its own; in
/// the second it also changes the group's roughness, hides one label and isolates a hundred. Reports medians in wall milliseconds.
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
    /// What is edited.
    pub edit: &'static str,
    /// From the call of the edit to its return.
    pub call_ms: Milliseconds,
    /// From the call to the first frame that shows the edit.
    pub first_frame_ms: Milliseconds,
    /// From the call to the first frame at full size with one sample per pixel.
    pub whole_frame_ms: Milliseconds,
}

/// Measures all kinds of edits in both scenes of a volume.
///
/// # Errors
/// Errors of opening and rendering; a volume without labels; the job's cancellation.
pub fn measure_live(path: &Path, job: &Job) -> Result<Vec<EditLatency>> {
    let volume = open_volume(path, &OpenOptions::default(), Residence::Copied, job)?;
    let ids = volume.labels().ids();
    if ids.is_empty() {
        return Err(SessionError::Caller(format!(
            "{}: expected a volume with labels, got one without",
            path.display()
        )));
    }
    let mut all = Vec::new();
    for labels in [Labels::Some, Labels::All] {
        let scene = scene_of(&volume, path, labels)?;
        let camera = scene.camera;
        let scene = LoadedScene::new(scene, vec![Arc::clone(&volume)], vec![])?;
        let live = Live::start(scene, LiveOptions::default())?;
        let mut serial = wait(&live, 0, job, |f| !f.coarse)?.serial;
        let material = |roughness: f32| Material { roughness, ..Material::default() };
        let shade = |i: usize| i as f32 / ROUNDS as f32;
        let move_camera = |i: usize| {
            let mut camera = camera;
            camera.shift[0] += 1e-3 * i as f64;
            Ok(SceneEdit::Camera { camera })
        };
        let color_one = |i: usize| match labels {
            Labels::Some => Ok(SceneEdit::LabelMaterials {
                id: 1,
                materials: [(ids[0], Some(Material { base_color: [shade(i), 0.5, 0.5], ..material(0.5) }))]
                    .into(),
            }),
            Labels::All => Ok(SceneEdit::Groups { id: 1, groups: groups(ids, shade(i))? }),
        };
        let roughen =
            |i: usize| Ok(SceneEdit::GroupMaterial { id: 1, group: 0, material: material(shade(i)) });
        // Every second edit brings back all labels.
        let show = |flags: Vec<bool>| {
            Ok(SceneEdit::Show {
                id: 1,
                show: Show::from_flags(ids.iter().copied(), flags.iter().copied()).map_err(caller)?,
            })
        };
        let hide_one =
            |i: usize| show((0..ids.len()).map(|label| i.is_multiple_of(2) || label != i).collect());
        let isolate = |i: usize| {
            show(
                (0..ids.len())
                    .map(|label| i.is_multiple_of(2) || label.is_multiple_of((ids.len() / FEW).max(1)))
                    .collect(),
            )
        };
        type Make<'a> = &'a dyn Fn(usize) -> Result<SceneEdit>;
        let mut edits: Vec<(&str, Make<'_>)> =
            vec![("camera", &move_camera), ("colour of one label", &color_one)];
        if labels == Labels::All {
            edits.push(("roughness of a group", &roughen));
            edits.push(("one label hidden, or all shown", &hide_one));
            edits.push(("100 labels isolated, or all shown", &isolate));
        }
        for (edit, make) in edits {
            let (mut calls, mut firsts, mut wholes) = (Vec::new(), Vec::new(), Vec::new());
            for i in 0..ROUNDS {
                let begin = Instant::now();
                let revision = live.edit(vec![make(i)?])?;
                calls.push(begin.elapsed());
                let first = wait(&live, serial, job, |f| f.revision == revision)?;
                firsts.push(begin.elapsed());
                let whole = wait(&live, first.serial - 1, job, |f| f.revision == revision && !f.coarse)?;
                serial = whole.serial;
                wholes.push(begin.elapsed());
            }
            all.push(EditLatency {
                volume: file_name(path),
                labels: labels.spoken(),
                edit,
                call_ms: Milliseconds::of(calls),
                first_frame_ms: Milliseconds::of(firsts),
                whole_frame_ms: Milliseconds::of(wholes),
            });
        }
    }
    Ok(all)
}

fn caller(error: SceneError) -> SessionError {
    SessionError::Caller(error.to_string())
}

/// The labels that a scene shows.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Labels {
    Some,
    All,
}

impl Labels {
    fn spoken(self) -> &'static str {
        match self {
            Self::Some => "32",
            Self::All => "all, each with its own colour",
        }
    }
}

/// One group of all labels, each of which has another colour.
fn groups(ids: &[u64], shade: f32) -> Result<LabelGroups> {
    let color = |i: usize| {
        [(i % 251) as f32 / 250.0, (i / 251 % 251) as f32 / 250.0, if i == 0 { shade } else { 0.5 }]
    };
    let colors = (0..ids.len()).map(color).collect();
    let group = LabelGroup::new(Material::default(), ids.to_vec(), colors).map_err(caller)?;
    LabelGroups::new(vec![group]).map_err(caller)
}

/// A figure of the longest labels, or of all labels in one group.
fn scene_of(volume: &CompressedVolume, path: &Path, labels: Labels) -> Result<Scene> {
    let chosen = (labels == Labels::Some).then(|| select_labels(volume, SOME));
    let options = FigureOptions { size: SIZE, labels: chosen, ..FigureOptions::default() };
    let mut scene = compose(volume, path.to_owned(), &options);
    if labels == Labels::All {
        let style = &mut scene.instances[0].style;
        (style.auto_color, style.groups) = (false, groups(volume.labels().ids(), 0.5)?);
        style.materials.clear();
    }
    Ok(scene)
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
