//! The demonstration: it turns a real volume into a figure and reports what each step cost.
//!
//! It reads the volume, compresses it, checks every voxel against the file, chooses thirty-two labels, path traces them, and writes
//! `picture.png`, `picture.exr`, `report.md` and `error.svg`.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use pumice_core::{CompressOptions, CompressionLevel, Job, Outputs, Verification, write_text};
use pumice_formats::OpenOptions;
use pumice_picture::{Passes, PicturePaths};
use pumice_session::LoadedScene;
use pumice_session::error::{Result, SessionError, io};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::measure::{Stopwatch, peak_rss_bytes};
use pumice_session::plot::{Series, error_against_time_svg};
use pumice_session::progressive::{CurvePoint, Stop, thin_curve};
use pumice_session::render_file::{PictureFormat, RenderFigures, render_scene};
use pumice_session::selection::select_labels;

/// Number of labels in the figure, at most.
const FIGURE_LABELS: usize = 32;

/// Input, output and limits of the demonstration.
#[derive(Clone, Debug)]
pub(crate) struct DemoOptions {
    /// File of the label volume.
    pub(crate) volume: PathBuf,
    /// Folder for the results, created if absent.
    pub(crate) out: PathBuf,
    /// Limits at which rendering stops.
    pub(crate) stop: Stop,
    /// Pixels across and down.
    pub(crate) size: [u32; 2],
}

/// The step that runs. The job holds the progress of the first two; `Render` carries its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DemoStage {
    /// Reading and compressing.
    Compress,
    /// Comparing every voxel with the file.
    Verify,
    /// Path tracing.
    Render(CurvePoint),
    /// Writing the results.
    Write,
}

/// Sizes, figures and report of a finished demonstration.
#[derive(Clone, Debug)]
pub(crate) struct DemoOutcome {
    /// Bytes of the volume at four bytes a voxel.
    pub(crate) bytes_raw: u64,
    /// Bytes of the compressed form in memory, without the acceleration structure.
    pub(crate) bytes_resident: u64,
    /// Samples, error, time and device of the picture.
    pub(crate) figures: RenderFigures,
    /// Path of `report.md`.
    pub(crate) report: PathBuf,
}

/// Runs the demonstration and calls `watch` as each step begins, and for each progress point while rendering.
///
/// # Errors
/// Any error of its steps; [`SessionError::Caller`] if the compressed volume differs from the file.
pub(crate) fn run(options: &DemoOptions, job: &Job, watch: &mut dyn FnMut(DemoStage)) -> Result<DemoOutcome> {
    std::fs::create_dir_all(&options.out).map_err(io(&options.out))?;

    // Outputs of an earlier run may be replaced, but not what is read.
    let outputs = Outputs::default();
    ["volume.pumice", "picture.png", "picture.exr", "error.svg", "report.md"]
        .iter()
        .try_for_each(|name| outputs.declare(&options.out.join(name)))?;
    let reading = OpenOptions { outputs, ..OpenOptions::default() };

    // Compress.
    watch(DemoStage::Compress);
    let clock = Stopwatch::start();
    let mut source = pumice_formats::open(&options.volume, &reading)?;
    let mut volume = pumice_core::compress(source.as_mut(), &CompressOptions::default(), job)?;
    let compress_seconds = [clock.seconds(), clock.cpu_seconds()];

    // Check every voxel against the file.
    watch(DemoStage::Verify);
    let clock = Stopwatch::start();
    let mut again = pumice_formats::open(&options.volume, &reading)?;
    match pumice_core::verify(&volume, again.as_mut(), job)? {
        Verification::Same { .. } => {}
        difference => {
            return Err(SessionError::Caller(format!("{}: {difference}", options.volume.display())));
        }
    }
    volume.forget_grid();
    let verify_seconds = [clock.seconds(), clock.cpu_seconds()];

    // Store it, so that the size on disk is a measurement.
    let stored = options.out.join("volume.pumice");
    volume.save(&stored, CompressionLevel::Default, job)?;
    let bytes_disk = std::fs::metadata(&stored).map_err(io(&stored))?.len();

    // Choose labels, frame and light them.
    let labels = select_labels(&volume, FIGURE_LABELS);
    let scene = compose(
        &volume,
        stored.canonicalize().unwrap_or(stored.clone()),
        &FigureOptions { size: options.size, labels: Some(labels), ..FigureOptions::default() },
    );

    // Path trace.
    let volume = Arc::new(volume);
    let scene = LoadedScene::new(scene, vec![Arc::clone(&volume)], vec![])?;
    let rendered = render_scene(&scene, "auto", &options.stop, job, &mut |point| {
        watch(DemoStage::Render(*point));
    })?;

    // Write the results.
    watch(DemoStage::Write);
    for name in ["picture.png", "picture.exr"] {
        let path = options.out.join(name);
        PictureFormat::of(&path)?.write(&path, &rendered.picture, &Passes::ALL, PicturePaths::Relative)?;
    }
    let svg = error_against_time_svg(
        "Error against run time",
        &[Series { name: &rendered.figures.backend, points: &rendered.figures.curve }],
    )
    .map_err(SessionError::Caller)?;
    if let Some(svg) = &svg {
        let svg_path = options.out.join("error.svg");
        write_text(&svg_path, svg)?;
    }

    let info = volume.info();
    let bytes_raw = info.voxels() * 4;
    let parts = volume.resident_parts();
    let bytes_resident: u64 = parts.iter().map(|p| p.1).sum();
    let figures = rendered.figures;
    let percent = |bytes: u64| 100.0 * bytes as f64 / bytes_raw as f64;
    let mut text = String::new();
    // Writing into a String cannot fail, so the result is ignored.
    let mut line = |l: String| {
        let _ = writeln!(text, "{l}");
    };
    let [x, y, z] = info.dims;
    line(format!("# Pumice: {} labels, {x}×{y}×{z} voxels\n", volume.labels().len()));
    line("![The picture](picture.png)\n".into());
    line(format!(
        "{} labels of the volume, path traced on the compressed form by the backend {} on {}: {} samples a pixel, {}.\n",
        FIGURE_LABELS.min(volume.labels().len()),
        figures.backend,
        figures.device,
        figures.spp,
        figures
            .error_estimate
            .map_or("error not known".into(), |e| format!("estimated relative error {:.2} %", 100.0 * e)),
    ));
    line("## Size\n\n| what | bytes | % of raw |\n|---|---:|---:|".into());
    line(format!("| raw, 4 bytes a voxel | {bytes_raw} | 100 |"));
    for part in &parts {
        line(format!("| in memory: {} | {} | {:.3} |", part.0, part.1, percent(part.1)));
    }
    line(format!(
        "| **in memory, whole form** | **{bytes_resident}** | **{:.3}** |",
        percent(bytes_resident)
    ));
    for (what, part) in [("bricks", "bricks"), ("acceleration structure", "acceleration")] {
        let bytes = figures.bytes.get(part).copied().unwrap_or(0);
        line(format!("| {what} of the labels shown | {bytes} | {:.3} |", percent(bytes)));
    }
    line(format!("| on disk (`volume.pumice`) | {bytes_disk} | {:.3} |", percent(bytes_disk)));
    line("\nEvery voxel and every id was compared with the file: no difference.\n".into());
    line("## Time\n\n| step | seconds | CPU seconds |\n|---|---:|---:|".into());
    for (name, [wall, cpu]) in [
        ("read and compress", compress_seconds),
        ("verify", verify_seconds),
        ("build the acceleration structure", figures.prepare_seconds),
        ("path trace", [figures.seconds, figures.cpu_seconds]),
    ] {
        line(format!("| {name} | {wall:.2} | {cpu:.2} |"));
    }
    if let Some(peak) = peak_rss_bytes() {
        line(format!("\nPeak memory of the process: {:.0} MB.\n", peak as f64 / 1e6));
    }
    line("## Error against run time\n\n| seconds | CPU seconds | samples a pixel | estimated relative error |\n|---:|---:|---:|---:|".into());
    for p in thin_curve(&figures.curve, 14) {
        let error = p.error_estimate.map_or("not yet known".into(), |e| format!("{:.2} %", 100.0 * e));
        line(format!("| {:.2} | {:.2} | {} | {error} |", p.seconds, p.cpu_seconds, p.spp));
    }
    line(match svg {
        Some(_) => "\n![Error against run time](error.svg)\n".into(),
        None => "\nThe time was too short for an estimate of the error.\n".into(),
    });
    let report = options.out.join("report.md");
    write_text(&report, &text)?;
    Ok(DemoOutcome { bytes_raw, bytes_resident, figures, report })
}
