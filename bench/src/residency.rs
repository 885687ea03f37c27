//! Measures pictures of volumes that are drawn from disk: seconds and error against bytes in memory, and that every picture has the bits of the
//! one with everything in memory.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use pumice_core::{CompressOptions, CompressedVolume, CompressionLevel, Job, Residency, compress_to_file};
use pumice_formats::OpenOptions;
use pumice_scene::Scene;
use pumice_session::error::{Result, SessionError};
use pumice_session::figure::{FigureOptions, compose};
use pumice_session::plot::{Axes, Curve, log_log_svg};
use pumice_session::render_file::render_scene;
use pumice_session::{
    CurvePoint, LoadedScene, PageFigures, Rendered, Residence, Stop, Stopwatch, open_volume,
};
use pumice_transport::RenderError;
use serde::Serialize;

use crate::console::{BenchResult, Console, Outcome};
use crate::files::{file_name, of_backend, scratch, write_results};
use crate::mirrored::Mirrored;
use crate::table::{Row, TableFlags};

/// Seconds of a picture against the bytes of its volume that are in memory
///
/// Draws each volume with everything in memory, and then from disk within a limit: all of it, a half, a quarter, an eighth, for each size
/// of a page. With --out, plots the estimated error over CPU seconds too, a curve for each limit. Exit code 1 if a picture differs by a bit.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
    /// Draw a volume of so many mirrored copies along x, y and z instead, each with labels of its own
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=64))]
    copies: Vec<u32>,
    /// Keep that volume in this file, or take it from there if it exists
    #[arg(long, value_name = "FILE.pumice", requires = "copies")]
    kept: Option<PathBuf>,
    /// Voxels along the side of a page
    #[arg(long, value_name = "N,N", value_delimiter = ',', default_value = "64,128,256")]
    pages: Vec<u32>,
    /// What of everything may be in memory: 2 is a half
    #[arg(long, value_name = "N,N", value_delimiter = ',', default_value = "1,2,4,8", value_parser = clap::value_parser!(u64).range(1..))]
    parts: Vec<u64>,
    /// Samples a pixel
    #[arg(long, value_name = "N", default_value = "16", value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
    /// Backend that draws, as in `pumice render`; pages are then on its device
    #[arg(long, value_name = "NAME", default_value = "cpu")]
    backend: String,
    /// Width of the picture
    #[arg(long, value_name = "N", default_value = "960", value_parser = clap::value_parser!(u32).range(16..=4096))]
    width: u32,
}

/// A picture of a volume.
#[derive(Clone, Debug, Serialize)]
pub struct Drawn {
    /// The volume's file name.
    pub volume: String,
    /// Voxels along its axes.
    pub dims: [u32; 3],
    /// Voxels along the side of a page; `None` with everything in memory.
    pub page_voxels: Option<u32>,
    /// What of everything may be in memory: 4 is a quarter.
    pub part: Option<u64>,
    /// What was in memory, or why nothing was drawn.
    pub pages: std::result::Result<Option<PageFigures>, String>,
    /// Bytes of the volume and its bricks with everything in memory.
    pub bytes_whole: u64,
    /// Wall and CPU seconds of opening, with making pages.
    pub opening_seconds: [f64; 2],
    /// Wall and CPU seconds of all samples.
    pub seconds: [f64; 2],
    /// The same as a share of the seconds with everything in memory.
    pub ratios: [f64; 2],
    /// Whether the picture has the bits of the one with everything in memory.
    pub is_same: bool,
    /// Estimated error against run time.
    pub curve: Vec<CurvePoint>,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let mut rows = Vec::new();
    for volume in &flags.table.volumes {
        rows.extend(measure(volume, flags, job)?);
    }
    let name = of_backend("residency", &flags.backend);
    flags.table.show(&name, &rows, console)?;
    if let Some(folder) = &flags.table.out {
        let of_volumes = rows.chunk_by(|a, b| a.volume == b.volume);
        let plots: Result<Vec<(String, String)>> = of_volumes.map(|rows| plot(&name, rows)).collect();
        write_results(folder, plots?)?;
    }
    Ok(Outcome::of(rows.iter().all(|row| row.is_same || row.pages.is_err())))
}

/// Name and content of the plot of a volume's rows.
fn plot(name: &str, rows: &[Drawn]) -> Result<(String, String)> {
    let named = |row: &Drawn| {
        let megabytes = row.most_bytes()? as f64 / 1e6;
        Some(match row.page_voxels {
            None => format!("all in memory, {megabytes:.0} MB"),
            Some(side) => format!("pages of {side}³, {megabytes:.0} MB"),
        })
    };
    let names: Vec<Option<String>> = rows.iter().map(named).collect();
    let point =
        |p: &CurvePoint| Some((p.cpu_seconds.max(1e-3), 100.0 * p.error_estimate.filter(|&e| e > 0.0)?));
    let curves: Vec<Curve<'_>> = std::iter::zip(&names, rows)
        .filter_map(|(name, row)| {
            Some(Curve { name: name.as_deref()?, points: row.curve.iter().filter_map(point).collect() })
        })
        .collect();
    let axes = Axes {
        x: "CPU seconds",
        y: "estimated relative error, %",
        y_digits: 2,
        slope: Some((-0.5, "1/√time")),
    };
    let volume = rows.first().map_or("", |row| &row.volume);
    let title = format!("Estimated error of {volume}, by bytes of the volume in memory");
    let svg = log_log_svg(&title, &axes, &curves).map_err(SessionError::Caller)?;
    let stem = Path::new(volume).file_stem().unwrap_or_default().to_string_lossy();
    Ok((format!("{name}_{stem}_error.svg"), svg))
}

fn measure(input: &Path, flags: &Flags, job: &Job) -> Result<Vec<Drawn>> {
    let folder = scratch()?;
    let file = flags.kept.clone().unwrap_or_else(|| folder.path().join("volume.pumice"));
    if !file.exists() {
        make(input, &flags.copies, &file, job)?;
    }
    let stop = Stop { spp: Some(flags.spp), ..Stop::default() };
    let draw = |residence: Residence| -> Result<(Scene, Rendered, [u32; 3], [f64; 2])> {
        let clock = Stopwatch::start();
        let volume = open_volume(&file, &OpenOptions::default(), residence, job)?;
        let size = [flags.width, (flags.width * 9).div_ceil(16)];
        let options = FigureOptions { size, ..FigureOptions::default() };
        let scene = compose(&volume, "volume".into(), &options);
        let opened = [clock.seconds(), clock.cpu_seconds()];
        let dims = volume.info().dims;
        let loaded = LoadedScene::new(scene.clone(), vec![volume], vec![])?;
        let rendered = render_scene(&loaded, &flags.backend, &stop, job, &mut |_| {})?;
        let [wall, cpu] = rendered.figures.prepare_seconds;
        Ok((scene, rendered, dims, [opened[0] + wall, opened[1] + cpu]))
    };
    let (scene, whole, dims, opening_seconds) = draw(Residence::Copied)?;
    let of = |rendered: &Rendered| [rendered.figures.seconds, rendered.figures.cpu_seconds];
    // On a device the volume is a part of what the renderer holds.
    let bytes = |part: &&str| whole.figures.bytes.get(*part).copied().unwrap_or(0);
    let bytes_whole = match whole.figures.backend.as_str() {
        "cpu" => whole.figures.volume_bytes.values().sum::<u64>() + bytes(&"bricks"),
        _ => ["bricks", "boxes", "nodes", "leaves", "labels"].iter().map(bytes).sum(),
    };
    let row = Drawn {
        volume: file_name(input),
        dims,
        page_voxels: None,
        part: None,
        pages: Ok(None),
        bytes_whole,
        opening_seconds,
        seconds: of(&whole),
        ratios: [1.0; 2],
        is_same: true,
        curve: whole.figures.curve.clone(),
    };
    let mut rows = vec![row.clone()];
    for &page_voxels in &flags.pages {
        for &part in &flags.parts {
            let memory = Arc::new(Residency::new(row.bytes_whole / part));
            let row = Drawn { page_voxels: Some(page_voxels), part: Some(part), ..row.clone() };
            rows.push(match draw(Residence::Paged { memory, page_voxels }) {
                Err(SessionError::Render(error @ (RenderError::Scene(_) | RenderError::Device(_)))) => {
                    Drawn { pages: Err(error.to_string()), is_same: false, curve: Vec::new(), ..row }
                }
                drawn => {
                    let (same_scene, rendered, _, opening_seconds) = drawn?;
                    let seconds = of(&rendered);
                    let is_same = same_scene == scene && rendered.picture.color == whole.picture.color;
                    let ratios = [0, 1].map(|i| seconds[i] / row.seconds[i]);
                    let (pages, curve) = (Ok(rendered.figures.pages), rendered.figures.curve);
                    Drawn { pages, opening_seconds, seconds, ratios, is_same, curve, ..row }
                }
            });
        }
    }
    Ok(rows)
}

/// Compresses a volume, or copies of it, into a file.
fn make(input: &Path, copies: &[u32], file: &Path, job: &Job) -> Result<()> {
    let copies = match copies {
        [] => [1; 3],
        &[x, y, z] => [x, y, z],
        other => {
            let what = format!("--copies: expected three numbers X,Y,Z, got {}", other.len());
            return Err(SessionError::Caller(what));
        }
    };
    let volume = open_volume(input, &OpenOptions::default(), Residence::Copied, job)?;
    let mut source = Mirrored::copies(&volume, copies);
    let mut describe = |_: &mut CompressedVolume| Ok(());
    let options = CompressOptions::default();
    compress_to_file(&mut source, file, CompressionLevel::Fast, &options, &mut describe, job)?;
    Ok(())
}

impl Drawn {
    /// The most bytes of the volume that were in memory at once; `None` where nothing was drawn.
    fn most_bytes(&self) -> Option<u64> {
        match (&self.pages, self.part) {
            (Ok(Some(pages)), _) => Some(pages.most_bytes),
            (_, None) => Some(self.bytes_whole),
            (_, Some(_)) => None,
        }
    }
}

impl Row for Drawn {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let dims = self.dims.map(|d| d.to_string()).join(" × ");
        let [opening, _] = self.opening_seconds;
        let ([wall, cpu], [wall_ratio, cpu_ratio]) = (self.seconds, self.ratios);
        let number = |n: Option<u64>| n.map_or("–".into(), |n| n.to_string());
        let (pages, drawn) = match &self.pages {
            Ok(pages) => (*pages, true),
            Err(_) => (None, false),
        };
        let figure = |value: String| if drawn { value } else { "–".into() };
        vec![
            ("volume", format!("{}, {dims}", self.volume)),
            ("page", self.page_voxels.map_or("none: all in memory".into(), |side| format!("{side}³"))),
            ("limit, bytes", number(self.part.map(|part| self.bytes_whole / part))),
            ("of everything", self.part.map_or("–".into(), |part| format!("1/{part}"))),
            ("most in memory, bytes", number(self.most_bytes())),
            ("all pages, bytes", number(pages.map(|p| p.bytes_of_all))),
            ("pages", number(pages.map(|p| p.pages))),
            ("loads", number(pages.map(|p| p.loads))),
            ("opening, s", figure(format!("{opening:.2}"))),
            ("samples, s", figure(format!("{wall:.2}"))),
            ("CPU s", figure(format!("{cpu:.2}"))),
            ("of all in memory", figure(format!("{wall_ratio:.2} (CPU {cpu_ratio:.2})"))),
            (
                "same bits",
                match &self.pages {
                    Err(why) => why.clone(),
                    Ok(_) => if self.is_same { "yes" } else { "no" }.into(),
                },
            ),
        ]
    }
}
