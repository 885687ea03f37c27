//! Measures error against time on each backend: relMSE of pictures of 1, 4, 16 … samples per pixel against a reference of many more, with
//! the time of each picture and its own estimate of its error. The reference is always rendered by the CPU backend: all backends must
//! converge to the same picture, and one that does not shows up here.

use std::path::Path;
use std::sync::Arc;

use clap::Args;
use pumice_core::Job;
use pumice_formats::OpenOptions;
use pumice_picture::metrics::compare;
use pumice_session::error::{Result, SessionError};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::render_file::{Rendered, render_scene};
use pumice_session::selection::select_labels;
use pumice_session::{Residence, Stop, open_volume};
use pumice_transport::LoadedScene;
use serde::Serialize;

use crate::backends::usable_unless;
use crate::console::{BenchResult, Console, Outcome};
use crate::files::file_name;
use crate::table::{Row, TableFlags};

/// Samples per pixel of the pictures; the reference has [`REFERENCE_FACTOR`] times the largest number used.
const SPP: [u32; 6] = [1, 4, 16, 32, 64, 128];
/// At 64 times the samples, the reference's own error adds 1 or 2 % to the measured relMSE.
const REFERENCE_FACTOR: u32 = 64;
/// Number of labels in the figure.
const LABELS: usize = 32;
/// Width and height of the figure in pixels.
const SIZE: [u32; 2] = [160, 90];
/// The reference has its own seed, so that its noise is independent of the pictures' noise.
const REFERENCE_SEED: u64 = 1;
const PICTURE_SEED: u64 = 2;

/// relMSE over seconds on each backend, against a reference of 64 times as many samples
///
/// Renders a figure of 32 labels, 160 × 90 pixels, with increasing numbers of samples.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
    /// Backends to measure; default: all that work on this machine
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    backends: Vec<String>,
    /// Largest number of samples per pixel
    #[arg(long, value_name = "N", default_value = "128", value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let backends = usable_unless(&flags.backends);
    let mut rows = Vec::new();
    for volume in &flags.table.volumes {
        rows.extend(measure_errors(volume, &backends, flags.spp, job)?);
    }
    flags.table.show("errors", &rows, console)?;
    Ok(Outcome::Holds)
}

/// Measurements of one picture.
#[derive(Clone, Debug, Serialize)]
pub struct PictureError {
    /// The volume's file name.
    pub volume: String,
    /// Name of the backend.
    pub backend: String,
    /// Samples per pixel.
    pub spp: u32,
    /// Wall seconds of rendering.
    pub seconds: f64,
    /// CPU seconds of rendering.
    pub cpu_seconds: f64,
    /// relMSE against the reference.
    pub rel_mse: f64,
    /// FLIP against the reference.
    pub flip: f64,
    /// The picture's estimate of its own relative error; `None` if it has too few samples for one.
    pub error_estimate: Option<f64>,
}

/// Measures a figure of the volume on each backend, with at most `most_spp` samples per pixel.
///
/// # Errors
/// Errors of opening and rendering; the job's cancellation.
pub fn measure_errors(
    path: &Path,
    backends: &[String],
    most_spp: u32,
    job: &Job,
) -> Result<Vec<PictureError>> {
    let volume = open_volume(path, &OpenOptions::default(), Residence::Mapped, job)?;
    let labels = Some(select_labels(&volume, LABELS));
    let options = FigureOptions { size: SIZE, labels, ..FigureOptions::default() };
    let mut scene = compose(&volume, path.to_owned(), &options);
    let mut render = |backend: &str, spp: u32, seed: u64| -> Result<Rendered> {
        scene.settings.seed = seed;
        let stop = Stop { spp: Some(spp), ..Stop::default() };
        let loaded = LoadedScene::new(scene.clone(), vec![Arc::clone(&volume)], vec![])?;
        render_scene(&loaded, backend, &stop, job, &mut |_| {})
    };
    let counts: Vec<u32> = SPP.into_iter().filter(|&spp| spp <= most_spp.max(SPP[0])).collect();
    let last = counts.last().copied().unwrap_or(SPP[0]);
    let reference = render("cpu", last * REFERENCE_FACTOR, REFERENCE_SEED)?.picture.color;
    let mut rows = Vec::new();
    for backend in backends {
        for &spp in &counts {
            let Rendered { picture, figures, .. } = render(backend, spp, PICTURE_SEED)?;
            let found = compare(&picture.color, &reference, None, &|| job.is_cancelled())
                .map_err(|e| SessionError::Caller(e.to_string()))?;
            rows.push(PictureError {
                volume: file_name(path),
                backend: backend.clone(),
                spp,
                seconds: figures.seconds,
                cpu_seconds: figures.cpu_seconds,
                rel_mse: found.rel_mse,
                flip: found.flip,
                error_estimate: figures.error_estimate,
            });
        }
    }
    Ok(rows)
}

impl Row for PictureError {
    fn cells(&self) -> Vec<(&'static str, String)> {
        vec![
            ("volume", self.volume.clone()),
            ("backend", self.backend.clone()),
            ("samples", self.spp.to_string()),
            ("s", format!("{:.2}", self.seconds)),
            ("CPU s", format!("{:.2}", self.cpu_seconds)),
            ("relMSE", format!("{:.3e}", self.rel_mse)),
            ("relMSE × CPU s", format!("{:.3e}", self.rel_mse * self.cpu_seconds)),
            ("estimated error", self.error_estimate.map_or("–".into(), |e| format!("{e:.4}"))),
            ("√relMSE", format!("{:.4}", self.rel_mse.sqrt())),
            ("FLIP", format!("{:.4}", self.flip)),
        ]
    }
}
