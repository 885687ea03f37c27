//! Measures compression of volumes larger than a limit on memory: seconds, peak memory and bytes against voxels.
//!
//! A volume is copied along its axes, each copy mirrored, so that filling and shapes stay the same while the number of voxels grows. The voxels
//! are made while they are read and never stored. Each measurement is a process of its own, because a peak of memory is that of a process.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Args;
use pumice_core::{
    CompressOptions, CompressedVolume, CompressionLevel, Job, WrittenVolume, compress_to_file,
};
use pumice_formats::OpenOptions;
use pumice_session::error::{Result, SessionError};
use pumice_session::measure::peak_rss_bytes;
use pumice_session::values::{bytes, numbers};
use pumice_session::{Residence, Stopwatch, open_volume};
use serde::{Deserialize, Serialize};

use crate::console::{BenchResult, Console, Outcome};
use crate::files::{file_name, scratch};
use crate::itself::Itself;
use crate::mirrored::Mirrored;
use crate::table::{Row, TableFlags};
use crate::timing::Took;

/// Largest side of a volume that is made.
const MOST_SIDE: u32 = 1 << 17;

/// What a process may take beside its limit: itself, and the blocks that its source holds.
const BESIDE_THE_LIMIT: u64 = 64 << 20;

/// Seconds, memory and bytes of compressing volumes larger than a limit on memory
///
/// Compresses mirrored copies of each volume, which are made while they are read. Exit code 1 if a process takes more memory than its limit and 64
/// MiB.
#[derive(Debug, Args)]
pub(crate) struct Flags {
    #[command(flatten)]
    table: TableFlags,
    /// Copies along x, y and z, each with labels of its own; repeat it for further sizes. 1,1,1, 2,2,2 and 4,4,4 where no other size is given
    #[arg(long, value_name = "X,Y,Z", value_parser = copies)]
    copies: Vec<[u32; 3]>,
    /// Voxels along x, y and z, cut out of as many copies as that takes, all with the same labels; repeat it for further sizes
    #[arg(long, value_name = "X,Y,Z", value_parser = size)]
    size: Vec<[u32; 3]>,
    /// Limit on memory
    #[arg(long, value_name = "BYTES", default_value = "1GiB", value_parser = bytes)]
    memory_limit: u64,
    /// What the bench starts itself with: compresses once and prints the figures
    #[arg(long, hide = true, value_name = "OUT")]
    one: Option<PathBuf>,
}

/// What is made of a volume.
#[derive(Clone, Copy, Debug)]
enum Made {
    Copies([u32; 3]),
    Cut([u32; 3]),
}

impl Made {
    fn of(self, volume: &CompressedVolume) -> Mirrored<'_> {
        match self {
            Self::Copies(copies) => Mirrored::copies(volume, copies),
            Self::Cut(size) => Mirrored::cut(volume, size),
        }
    }

    fn flag(self) -> [String; 2] {
        let (name, numbers) = match self {
            Self::Copies(copies) => ("--copies", copies),
            Self::Cut(size) => ("--size", size),
        };
        [name.into(), numbers.map(|n| n.to_string()).join(",")]
    }
}

impl Flags {
    fn made(&self) -> Vec<Made> {
        let made: Vec<Made> = self
            .copies
            .iter()
            .map(|&n| Made::Copies(n))
            .chain(self.size.iter().map(|&n| Made::Cut(n)))
            .collect();
        if made.is_empty() { [1, 2, 4].map(|n| Made::Copies([n; 3])).into() } else { made }
    }
}

fn copies(text: &str) -> std::result::Result<[u32; 3], String> {
    numbers(text, ',')
        .filter(|copies: &[u32; 3]| copies.iter().all(|n| (1..=64).contains(n)))
        .ok_or_else(|| "expected three whole numbers from 1 to 64, e.g. 4,4,4".into())
}

fn size(text: &str) -> std::result::Result<[u32; 3], String> {
    numbers(text, ',')
        .filter(|size: &[u32; 3]| size.iter().all(|n| (1..=MOST_SIDE).contains(n)))
        .ok_or_else(|| format!("expected three whole numbers from 1 to {MOST_SIDE}, e.g. 661,11044,15448"))
}

/// What a process prints.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Report {
    dims: [u32; 3],
    solid_voxels: u64,
    labels: u64,
    boxes: u64,
    bytes_disk: u64,
    bytes_volume: u64,
    took: Took,
    /// Of `took`, making the voxels.
    making_cpu_seconds: f64,
    peak_rss_bytes: Option<u64>,
}

/// The compression of a volume of one size.
#[derive(Clone, Debug, Serialize)]
struct Compressed {
    volume: String,
    limit_bytes: u64,
    report: Report,
}

impl Compressed {
    fn voxels(&self) -> f64 {
        self.report.dims.iter().map(|&d| f64::from(d)).product()
    }

    fn keeps_the_limit(&self) -> bool {
        self.report.peak_rss_bytes.is_none_or(|peak| peak <= self.limit_bytes + BESIDE_THE_LIMIT)
    }
}

pub(crate) fn run(flags: &Flags, job: &Job, console: &mut Console<'_>) -> BenchResult<Outcome> {
    if let (Some(out), [input], [made]) = (&flags.one, &flags.table.volumes[..], &flags.made()[..]) {
        let report = measured(input, *made, flags.memory_limit, out, job)?;
        let line = serde_json::to_string(&report).map_err(|e| SessionError::Caller(e.to_string()))?;
        console.line(line)?;
        return Ok(Outcome::Holds);
    }
    let itself = Itself::of("large")?;
    let folder = scratch()?;
    let mut rows = Vec::new();
    for volume in &flags.table.volumes {
        // Opened once: the processes that are measured read the file, whatever the volume is.
        let file = folder.path().join("volume.pumice");
        compressed_copy(volume, &file, job)?;
        for made in flags.made() {
            job.check().map_err(SessionError::from)?;
            let out = folder.path().join("copies.pumice");
            let [name, numbers] = made.flag().map(OsString::from);
            let limit = flags.memory_limit.to_string();
            let words = ["--memory-limit".into(), limit.into(), name, numbers, "--one".into(), out.into()];
            let report = itself.report([OsString::from(&file)].into_iter().chain(words))?;
            rows.push(Compressed { volume: file_name(volume), limit_bytes: flags.memory_limit, report });
        }
    }
    flags.table.show("large", &rows, console)?;
    Ok(Outcome::of(rows.iter().all(Compressed::keeps_the_limit)))
}

fn compressed_copy(input: &Path, file: &Path, job: &Job) -> Result<()> {
    let volume = open_volume(input, &OpenOptions::default(), Residence::Copied, job)?;
    let mut source = Mirrored::cut(&volume, volume.info().dims);
    write(&mut source, file, &CompressOptions::default(), job).map(|_| ())
}

fn write(
    source: &mut Mirrored<'_>,
    file: &Path,
    options: &CompressOptions,
    job: &Job,
) -> Result<WrittenVolume> {
    let mut describe = |_: &mut CompressedVolume| Ok(());
    Ok(compress_to_file(source, file, CompressionLevel::Fast, options, &mut describe, job)?)
}

/// Compresses what is made of a `.pumice` file.
fn measured(input: &Path, made: Made, limit_bytes: u64, out: &Path, job: &Job) -> Result<Report> {
    let volume = open_volume(input, &OpenOptions::default(), Residence::Copied, job)?;
    let mut source = made.of(&volume);
    let options = CompressOptions { memory_limit_bytes: Some(limit_bytes), ..CompressOptions::default() };
    let clock = Stopwatch::start();
    let written = write(&mut source, out, &options, job)?;
    let took = Took::since(&clock);
    Ok(Report {
        dims: written.dims,
        solid_voxels: source.solid_voxels(),
        labels: written.labels,
        boxes: written.boxes,
        bytes_disk: written.bytes_disk,
        bytes_volume: written.bytes_volume,
        took,
        making_cpu_seconds: source.cpu_seconds(),
        peak_rss_bytes: peak_rss_bytes(),
    })
}

impl Row for Compressed {
    fn cells(&self) -> Vec<(&'static str, String)> {
        let Report { dims, took, .. } = &self.report;
        let voxels = self.voxels();
        let raw = 4.0 * voxels;
        let mib = |bytes: u64| format!("{:.0}", bytes as f64 / f64::from(1 << 20));
        // A terabyte of labels of 4 bytes.
        let own = took.cpu_seconds - self.report.making_cpu_seconds;
        let hours = 1e12 / raw * own / 3600.0;
        vec![
            ("volume", format!("{}, {}", self.volume, dims.map(|d| d.to_string()).join(" × "))),
            ("voxels, 10⁹", format!("{:.3}", voxels / 1e9)),
            ("solid", format!("{:.2} %", 100.0 * self.report.solid_voxels as f64 / voxels)),
            ("labels", self.report.labels.to_string()),
            ("boxes", self.report.boxes.to_string()),
            ("limit, MiB", mib(self.limit_bytes)),
            ("peak, MiB", self.report.peak_rss_bytes.map_or("–".into(), mib)),
            ("s", format!("{:.1}", took.seconds)),
            ("CPU s", format!("{:.1}", took.cpu_seconds)),
            ("of it making voxels, CPU s", format!("{:.1}", self.report.making_cpu_seconds)),
            ("other CPU ns a voxel", format!("{:.2}", 1e9 * own / voxels)),
            ("file, bytes", self.report.bytes_disk.to_string()),
            ("file", format!("{:.3} % of 4 bytes a voxel", 100.0 * self.report.bytes_disk as f64 / raw)),
            ("in memory", format!("{:.3} %", 100.0 * self.report.bytes_volume as f64 / raw)),
            ("CPU hours a terabyte of 4-byte labels", format!("{hours:.2}")),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_three_numbers() {
        assert_eq!(size("661,11044,15448"), Ok([661, 11044, 15448]));
        for wrong in ["", "0,1,1", "1,1,131073", "1,2"] {
            assert!(size(wrong).unwrap_err().starts_with("expected three whole numbers"), "{wrong}");
        }
        assert_eq!(copies("1,2,64"), Ok([1, 2, 64]));
        for wrong in ["", "1,2", "0,1,1", "65,1,1", "1,1,1,1", "a,b,c", "1.5,1,1"] {
            assert!(copies(wrong).unwrap_err().starts_with("expected three whole numbers"), "{wrong}");
        }
    }

    #[test]
    fn a_limit_that_is_exceeded_is_seen() {
        let took = Took { seconds: 2.0, cpu_seconds: 4.0 };
        let report = Report {
            dims: [1000; 3],
            solid_voxels: 150_000_000,
            labels: 7,
            boxes: 9,
            bytes_disk: 1000,
            bytes_volume: 2000,
            took,
            making_cpu_seconds: 1.0,
            peak_rss_bytes: Some((1 << 30) + BESIDE_THE_LIMIT),
        };
        let mut row = Compressed { volume: "v".into(), limit_bytes: 1 << 30, report };
        assert!(row.keeps_the_limit());
        let cells = row.cells();
        let cell = |name: &str| cells.iter().find(|(n, _)| *n == name).unwrap().1.clone();
        assert_eq!((cell("solid"), cell("other CPU ns a voxel")), ("15.00 %".into(), "3.00".into()));
        // 250 times as many voxels, in 3 s each.
        assert_eq!(cell("CPU hours a terabyte of 4-byte labels"), "0.21");
        row.report.peak_rss_bytes = Some((1 << 30) + BESIDE_THE_LIMIT + 1);
        assert!(!row.keeps_the_limit());
        row.report.peak_rss_bytes = None;
        assert!(row.keeps_the_limit(), "where the system does not say");
    }
}
