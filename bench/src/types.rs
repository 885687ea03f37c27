//! Measures switching types of labels on, one after another: reading and merging a type's boxes and nodes into those that are there (paper
//! §3.2.2), beside opening all of these types anew and opening the whole file; and what a renderer then builds.
//!
//! Both ways must draw the same picture, bit for bit. Times are CPU milliseconds of the process, medians of rounds in which the ways follow
//! each other; the file is in the system's cache.

use std::num::NonZeroU32;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use pumice_core::{CompressedVolume, CompressionLevel, Job};
use pumice_formats::OpenOptions;
use pumice_scene::Scene;
use pumice_session::error::Result;
use pumice_session::figure::{FigureOptions, FrameOn, compose};
use pumice_session::{LoadedScene, Residence, Stopwatch, make_renderer, open_volume};
use pumice_transport::Renderer;
use serde::Serialize;

use crate::console::{BenchResult, Console, Outcome};
use crate::files::{file_name, of_backend, scratch};
use crate::table::{Row, TableFlags};

/// The levels whose files open differently.
const LEVELS: [(&str, CompressionLevel); 2] =
    [("fast", CompressionLevel::Fast), ("default", CompressionLevel::Default)];

/// Time of switching types of labels on, one after another, beside opening the file anew
///
/// The types are those of the volume's table; without any, labels are dealt to --types types in turn. Exit code 1 if a picture differs by a
/// bit from that of the file opened anew.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
    /// Number of types of a volume whose table has none
    #[arg(long, value_name = "N", default_value = "23")]
    types: NonZeroU32,
    /// Of so many types switched on the table has a row
    #[arg(long, value_name = "N,N", value_delimiter = ',', default_value = "1,2,4,8,16,23")]
    rows: Vec<u32>,
    /// Rounds of each measurement
    #[arg(long, value_name = "N", default_value = "5")]
    rounds: NonZeroU32,
    /// Backend that draws: auto, cpu, vulkan-rt, vulkan-query or vulkan-compute
    #[arg(long, value_name = "NAME", default_value = "cpu")]
    backend: String,
}

/// A type that was switched on after others.
#[derive(Clone, Debug, Serialize)]
pub struct Switched {
    /// The volume's file name.
    pub volume: String,
    /// Level of the file.
    pub level: &'static str,
    /// Types that are on now, and all of them.
    pub types: [u32; 2],
    /// Labels of the type.
    pub labels: u64,
    /// Boxes of the type, and of all types that are on.
    pub boxes: [u64; 2],
    /// Bytes of the volume that holds all types that are on.
    pub bytes: u64,
    /// Share of the type's bytes of nodes that the others had already.
    pub shared: f64,
    /// Milliseconds of reading the type.
    pub read_ms: f64,
    /// Milliseconds of merging it.
    pub merge_ms: f64,
    /// Milliseconds of opening all types that are on, at once.
    pub anew_ms: f64,
    /// Milliseconds of opening the whole file.
    pub whole_ms: f64,
    /// Milliseconds of what the renderer builds for the next picture and of the picture's first sample.
    pub draw_ms: f64,
    /// Whether both ways draw the same bits.
    pub is_same: bool,
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    let mut rows = Vec::new();
    for volume in &flags.table.volumes {
        rows.extend(measure(volume, flags, job)?);
    }
    flags.table.show(&of_backend("types", &flags.backend), &rows, console)?;
    Ok(Outcome::of(rows.iter().all(|row| row.is_same)))
}

fn measure(input: &Path, flags: &Flags, job: &Job) -> Result<Vec<Switched>> {
    let whole = open_volume(input, &OpenOptions::default(), Residence::Copied, job)?;
    let (types, count) = types_of(&whole, flags.types.get());
    let folder = scratch()?;
    let mut rows = Vec::new();
    for (name, level) in LEVELS {
        let path = folder.path().join(format!("{name}.pumice"));
        whole.save(&path, level, job)?;
        let mut rounds = Vec::new();
        for _ in 0..flags.rounds.get() {
            rounds.push(round(&path, &types, count, flags, job)?);
        }
        let wanted = |on: &u32| (1..=count).contains(on);
        for &on in flags.rows.iter().filter(|on| wanted(on)) {
            let of: Vec<&Switched> =
                rounds.iter().filter_map(|steps: &Vec<Switched>| steps.get(on as usize - 1)).collect();
            let Some(&first) = of.first() else { continue };
            let median = |figure: fn(&Switched) -> f64| {
                let mut figures: Vec<f64> = of.iter().map(|one| figure(one)).collect();
                figures.sort_by(f64::total_cmp);
                figures[figures.len() / 2]
            };
            rows.push(Switched {
                volume: file_name(input),
                level: name,
                read_ms: median(|s| s.read_ms),
                merge_ms: median(|s| s.merge_ms),
                anew_ms: median(|s| s.anew_ms),
                whole_ms: median(|s| s.whole_ms),
                draw_ms: median(|s| s.draw_ms),
                is_same: of.iter().all(|s| s.is_same),
                ..first.clone()
            });
        }
    }
    Ok(rows)
}

/// The type of each label, and how many types there are.
fn types_of(volume: &CompressedVolume, types: u32) -> (Vec<Option<u32>>, u32) {
    let labels = volume.labels();
    let named = labels.type_names().len() as u32;
    let of = |label: u32| if named == 0 { Some(label % types) } else { labels.type_of(label).map(u32::from) };
    ((0..labels.len() as u32).map(of).collect(), if named == 0 { types } else { named })
}

/// Switches all types on, one after another.
fn round(path: &Path, types: &[Option<u32>], count: u32, flags: &Flags, job: &Job) -> Result<Vec<Switched>> {
    let timed = |work: &mut dyn FnMut() -> Result<CompressedVolume>| -> Result<(CompressedVolume, f64)> {
        let clock = Stopwatch::start();
        let made = work()?;
        Ok((made, 1e3 * clock.cpu_seconds()))
    };
    let open = |wanted: &dyn Fn(u32) -> bool| -> Result<(CompressedVolume, f64)> {
        let chosen: Vec<bool> = types.iter().map(|of| of.is_some_and(wanted)).collect();
        timed(&mut || Ok(CompressedVolume::open_labels(path, |_| chosen.clone(), job)?))
    };
    let (_, whole_ms) = timed(&mut || Ok(CompressedVolume::open(path, job)?))?;
    let mut renderer = make_renderer(&flags.backend)?;
    let mut held = Arc::new(open(&|_| false)?.0);
    let mut steps = Vec::new();
    for kind in 0..count {
        job.check()?;
        let (part, read_ms) = open(&|of| of == kind)?;
        let (joined, merge_ms) = timed(&mut || Ok(held.with_more_labels(&part)?))?;
        let (anew, anew_ms) = open(&|of| of <= kind)?;
        let nodes = [&*held, &part, &joined].map(|v| v.nodes().len());
        held = Arc::new(joined);
        let on = kind + 1;
        let (mut draw_ms, mut is_same) = (0.0, true);
        if flags.rows.contains(&on) {
            let clock = Stopwatch::start();
            draw(&mut renderer, &held, job)?;
            draw_ms = 1e3 * clock.cpu_seconds();
            let mut other = make_renderer(&flags.backend)?;
            draw(&mut other, &Arc::new(anew), job)?;
            is_same = renderer.color()?.pixels == other.color()?.pixels;
        }
        steps.push(Switched {
            volume: String::new(),
            level: "",
            types: [on, count],
            labels: types.iter().filter(|of| **of == Some(kind)).count() as u64,
            boxes: [part.boxes().len() as u64, held.boxes().len() as u64],
            bytes: held.resident_parts().into_iter().map(|(_, bytes)| bytes).sum(),
            shared: (nodes[0] + nodes[1] - nodes[2]) as f64 / nodes[1].max(1) as f64,
            read_ms,
            merge_ms,
            anew_ms,
            whole_ms,
            draw_ms,
            is_same,
        });
    }
    Ok(steps)
}

/// Draws one sample of the labels that the volume holds; the camera is the same whichever these are.
fn draw(renderer: &mut dyn Renderer, volume: &Arc<CompressedVolume>, job: &Job) -> Result<()> {
    let options = FigureOptions { size: [320, 180], frame: FrameOn::Volume, ..FigureOptions::default() };
    let scene: Scene = compose(volume, "volume".into(), &options);
    renderer.set_scene(&LoadedScene::new(scene, vec![Arc::clone(volume)], vec![])?)?;
    Ok(renderer.advance(Duration::ZERO, 1, job).map(|_| ())?)
}

impl Row for Switched {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let ms = |value: f64| format!("{value:.1}");
        vec![
            ("volume", self.volume.clone()),
            ("file", self.level.into()),
            ("types on", format!("{} of {}", self.types[0], self.types[1])),
            ("labels of the last", self.labels.to_string()),
            ("its boxes", self.boxes[0].to_string()),
            ("boxes", self.boxes[1].to_string()),
            ("bytes", self.bytes.to_string()),
            ("nodes it shares", format!("{:.1} %", 100.0 * self.shared)),
            ("reading it, CPU ms", ms(self.read_ms)),
            ("merging it", ms(self.merge_ms)),
            ("opening these anew", ms(self.anew_ms)),
            ("opening the whole file", ms(self.whole_ms)),
            ("first sample, with what is built", ms(self.draw_ms)),
            ("same bits", if self.is_same { "yes" } else { "no" }.into()),
        ]
    }
}
