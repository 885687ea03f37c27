//! Measures each backend on one volume: rays per second, seconds per frame at each level of detail (the paper's table 4), and bytes on the
//! device.
//!
//! Rays: rendering black labels costs primary rays only. Rendering grey labels without light costs one diffuse ray more for each hit, so
//! the difference of the two times is the time of the diffuse rays. Frames: one sample per pixel under the figure's own light, at 1 and 32
//! bounces. Each time is the least of several frames after one warm-up frame. CPU seconds are the figure to trust where a processor
//! emulates a graphics processor while it does other work.

use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use pumice_core::{CompressedVolume, Job};
use pumice_formats::OpenOptions;
use pumice_scene::{Environment, LabelMaterials, Lod, Material, Scene};
use pumice_session::error::Result;
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::selection::select_labels;
use pumice_session::values::size;
use pumice_session::{Residence, devices, make_renderer, open_volume};
use pumice_transport::{LoadedScene, Renderer};
use serde::Serialize;

use crate::console::{BenchResult, Console, Outcome};
use crate::files::file_name;
use crate::table::{Row, TableFlags};
use crate::timing::{Took, clocked};

/// Number of frames, of which the fastest counts. With so few samples the renderer does not estimate its error yet, which would take time.
const FRAMES: u32 = 2;
/// Levels of detail of the frames, with their names in the table.
const LEVELS: [(&str, Lod); 3] =
    [("finest", Lod::Voxels), ("by distance", Lod::Distance { pixels: 1.0 }), ("coarsest", Lod::Boxes)];
/// Numbers of bounces of the frames.
const BOUNCES: [u32; 2] = [1, 32];

/// Rays and frames on each backend, and bytes on the device
///
/// Draws a figure of some labels: primary rays, diffuse rays, and frames of one sample at each level of detail and 1 and 32 bounces.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
    /// Backends to measure; default: all that work on this machine
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    backends: Vec<String>,
    /// Picture size in pixels
    #[arg(long, value_name = "WxH", default_value = "1920x1080", value_parser = size)]
    size: [u32; 2],
    /// Labels in the figure, the longest ones; 0 for all
    #[arg(long, value_name = "N", default_value_t = 96)]
    labels: usize,
    /// Say on standard error which frames are drawn, and how long the first took: where a device hangs, the last line says in what
    #[arg(long)]
    watch: bool,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let mut rows = Vec::new();
    for volume in &flags.table.volumes {
        for backend in usable_unless(&flags.backends) {
            let mut said = |line: &str| {
                if flags.watch {
                    _ = writeln!(std::io::stderr(), "{}, {backend}: {line}", file_name(volume));
                }
            };
            rows.push(measure_backend(volume, &backend, flags.size, flags.labels, job, &mut said)?);
        }
    }
    for row in &rows {
        for notice in &row.notices {
            console.line(format_args!("{}: {notice}", row.backend))?;
        }
    }
    flags.table.show("backends", &rows, console)?;
    Ok(Outcome::Holds)
}

/// The given backends; if none are given, those that work on this machine, best first.
pub(crate) fn usable_unless(named: &[String]) -> Vec<String> {
    if !named.is_empty() {
        return named.to_vec();
    }
    let mut usable: Vec<String> = Vec::new();
    for device in devices().into_iter().filter(|d| d.usable) {
        if usable.iter().all(|u| u != device.backend) {
            usable.push(device.backend.to_owned());
        }
    }
    usable
}

/// Measurements of one backend.
#[derive(Clone, Debug, Serialize)]
pub struct BackendSpeed {
    /// The volume's file name.
    pub volume: String,
    /// Name of the backend.
    pub backend: String,
    /// Device that the backend ran on.
    pub device: String,
    /// Faults of the device that the renderer recovered from.
    pub notices: Vec<String>,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// Primary rays: millions per wall second, and per CPU second.
    pub primary: [f64; 2],
    /// Diffuse rays: millions per wall second, and per CPU second.
    pub diffuse: [f64; 2],
    /// Frames at each level of detail, finest first, at 1 and at 32 bounces.
    pub frames: [[Took; 2]; 3],
    /// Bytes on the device by part.
    pub bytes: Vec<(&'static str, u64)>,
}

/// Measures one backend on a figure of the `labels` longest labels of a volume, or of all labels if that is 0.
///
/// `said` gets a line before and after the frames of each kind, so that it is known in which a device hangs. The first frame's time
/// includes compiling, unless the driver kept the result of an earlier run.
///
/// # Errors
/// Errors of opening and rendering; the job's cancellation.
pub fn measure_backend(
    path: &Path,
    backend: &str,
    size: [u32; 2],
    labels: usize,
    job: &Job,
    said: &mut dyn FnMut(&str),
) -> Result<BackendSpeed> {
    let volume = open_volume(path, &OpenOptions::default(), Residence::Copied, job)?;
    let labels = (labels > 0).then(|| select_labels(&volume, labels));
    let options = FigureOptions { size, labels, ..FigureOptions::default() };
    let scene = compose(&volume, path.to_owned(), &options);
    let mut renderer = make_renderer(backend)?;

    let pixels = f64::from(size[0]) * f64::from(size[1]);
    let mut timed = |renderer: &mut dyn Renderer, what: &str, scene: &Scene| -> Result<Took> {
        said(what);
        let [first, best] = frame(renderer, scene, &volume, job)?;
        said(&format!("{what}: {:.3} s the first frame, then {:.4} s", first.seconds, best.seconds));
        Ok(best)
    };
    let primary = timed(&mut renderer, "primary rays", &dark(&scene, 0.0))?;
    let both = timed(&mut renderer, "and diffuse rays", &dark(&scene, 0.8))?;
    let hits = renderer.picture()?.label.iter().flatten().filter(|&&l| l != 0).count() as f64;
    let device = renderer.device().to_owned();

    let mut frames = [[Took::default(); 2]; 3];
    for (frames, (level, lod)) in frames.iter_mut().zip(LEVELS) {
        for (took, bounces) in frames.iter_mut().zip(BOUNCES) {
            let mut lit = scene.clone();
            lit.settings.lod = lod;
            lit.settings.bounces = bounces;
            *took = timed(&mut renderer, &format!("{level}, {bounces} bounces"), &lit)?;
        }
    }
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![])?)?;
    let millions = |rays: f64, seconds: f64| rays / seconds / 1e6;
    Ok(BackendSpeed {
        volume: file_name(path),
        backend: backend.to_owned(),
        device,
        notices: renderer.notices(),
        size,
        primary: [millions(pixels, primary.seconds), millions(pixels, primary.cpu_seconds)],
        diffuse: [
            millions(hits, both.seconds - primary.seconds),
            millions(hits, both.cpu_seconds - primary.cpu_seconds),
        ],
        frames,
        bytes: renderer.bytes(),
    })
}

/// The scene without light and bounces, with one albedo for all labels: paths end at black labels and send a diffuse ray from grey ones.
fn dark(scene: &Scene, albedo: f32) -> Scene {
    let mut dark = scene.clone();
    let material = Material {
        base_color: [albedo; 3],
        specular: 0.0,
        metallic: 0.0,
        roughness: 1.0,
        ..Material::default()
    };
    for instance in &mut dark.instances {
        instance.style.auto_color = false;
        instance.style.materials = LabelMaterials::default();
        instance.style.material = material;
    }
    dark.suns.clear();
    dark.world.environment = Environment::Constant { radiance: [0.0; 3] };
    dark.settings.bounces = 0;
    dark
}

/// Times of one sample per pixel: of the first frame, and the least of several later ones.
fn frame(
    renderer: &mut dyn Renderer,
    scene: &Scene,
    volume: &Arc<CompressedVolume>,
    job: &Job,
) -> Result<[Took; 2]> {
    renderer.set_scene(&LoadedScene::new(scene.clone(), vec![Arc::clone(volume)], vec![])?)?;
    let mut first = Took::default();
    let mut best = Took { seconds: f64::INFINITY, cpu_seconds: f64::INFINITY };
    for number in 0..=FRAMES {
        let ((), took) = clocked(|| {
            // Its colours belong to a frame: a device sends them when they are asked for.
            renderer.advance(Duration::ZERO, number + 1, job)?;
            renderer.color()?;
            Ok(())
        })?;
        if number == 0 {
            first = took;
        } else {
            best = best.least(took);
        }
    }
    Ok([first, best])
}

impl Row for BackendSpeed {
    fn cells(&self) -> Vec<(&'static str, String)> {
        // A difference of two times that is not positive is noise.
        let rate = |r: f64| if r > 0.0 { format!("{r:.3}") } else { "–".into() };
        let frame = |[one, many]: [Took; 2]| {
            format!(
                "{:.4} / {:.4} ({:.4} / {:.4})",
                one.seconds, many.seconds, one.cpu_seconds, many.cpu_seconds
            )
        };
        let bytes = |name: &str| {
            self.bytes.iter().find(|(part, _)| *part == name).map_or("–".into(), |(_, b)| b.to_string())
        };
        let [finest, by_distance, coarsest] = self.frames.map(frame);
        vec![
            ("volume", self.volume.clone()),
            ("backend", self.backend.clone()),
            ("device", self.device.clone()),
            ("primary, M rays/s", rate(self.primary[0])),
            ("primary, M rays per CPU s", rate(self.primary[1])),
            ("diffuse, M rays/s", rate(self.diffuse[0])),
            ("diffuse, M rays per CPU s", rate(self.diffuse[1])),
            ("frame", format!("{}x{}", self.size[0], self.size[1])),
            ("finest, s (CPU s) a frame at 1 / 32 bounces", finest),
            ("by distance", by_distance),
            ("coarsest", coarsest),
            ("hierarchy, bytes", bytes("acceleration")),
            ("boxes", bytes("boxes")),
            ("nodes", bytes("nodes")),
            ("leaves", bytes("leaves")),
            ("labels of boxes", bytes("labels")),
        ]
    }
}
