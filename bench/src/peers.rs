//! Compares Pumice with other programs that store label volumes: bytes, CPU seconds, time to read one voxel, and whether the stored form
//! can be ray traced.
//!
//! ```text
//! volume ─► labels.npy ─► a Python process per program: compress, decompress, compare, read single voxels ─► report.json
//!       └─► the same array, Pumice in this process: compress, save and open at each level, decode, `label_at`
//! ```
//! `--levels` adds programs at other settings (module `levels`).
//!
//! Each program receives the voxels as an array in memory and returns them as one.

pub(crate) mod command;
mod levels;
mod tables;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pumice_core::{
    ArraySource, CompressOptions, CompressedVolume, CompressionLevel, Job, LabelBuffer, LabelType,
    VolumeInfo, compress,
};
use pumice_formats::OpenOptions;
use pumice_session::error::{Result, SessionError, io};
use pumice_session::file_info::tracing_bytes;
use pumice_session::measure::Stopwatch;
use pumice_session::npy::write_npy;
use pumice_session::script::run_script;
use pumice_session::{Residence, open_volume};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::files::{file_name, scratch};
use crate::timing::{Took, clocked};
use crate::voxels::{decoded, each_slab};
use levels::SETTINGS;

pub use levels::Level;
pub use tables::write_peers;

/// The Python script that measures one program.
const SCRIPT: &str = include_str!("peers/peers.py");

/// Programs that are measured through their own Python packages: name, usual setting, and whether the stored form can be ray traced as it is.
pub const PEERS: [(&str, &str, &str); 9] = [
    ("crackle", "defaults", "no: a z layer is decoded for a voxel of it"),
    ("crackle + zstd", "zstd 19", "no: all is decoded"),
    ("compresso", "defaults", "no: a z layer is decoded for a voxel of it"),
    ("compresso + gzip", "gzip 9", "no: all is decoded"),
    ("compressed_segmentation", "blocks of 8³", "voxel by voxel: nothing tells a ray what it may skip"),
    ("compressed_segmentation + zstd", "zstd 3", "no: all is decoded"),
    ("zstd", "zstd 3", "no: all is decoded"),
    ("NIfTI + gzip", "gzip 6", "no: all is decoded"),
    ("zarr", "zstd 3", "no: chunks are decoded"),
];

/// The levels of Pumice's files.
const LEVELS: [(CompressionLevel, &str); 3] = [
    (CompressionLevel::Fast, "fast"),
    (CompressionLevel::Default, "default"),
    (CompressionLevel::Small, "small"),
];

/// Number of voxels that are read one by one (of slow programs only as many as two seconds allow).
const VOXELS: u32 = 20_000;

/// Options of [`measure_peers`].
#[derive(Clone, Debug)]
pub struct PeersOptions {
    /// Label volume or `.pumice` file.
    pub volume: PathBuf,
    /// Python interpreter that has the programs' packages.
    pub python: PathBuf,
    /// Names from [`PEERS`] that are not measured.
    pub without: Vec<String>,
    /// Whether programs are measured at other settings too.
    pub levels: bool,
}

/// Measurements of one program.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Peer {
    /// Name of the program; for Pumice with the level of the file, or `in memory`.
    pub name: String,
    /// Version of the program's package.
    pub version: String,
    /// Bytes of the stored volume: of its file, or in memory for `Pumice, in memory`.
    pub bytes: u64,
    /// Time from the array to those bytes.
    pub compress: Took,
    /// Time from those bytes to an array.
    pub decompress: Took,
    /// Time from those bytes to what rays can be traced through or all voxels read from: for Pumice's files the form in memory, else as
    /// `decompress`.
    pub opening: Took,
    /// CPU seconds for reading one voxel of the stored volume; NaN if not measured.
    pub voxel_cpu_seconds: f64,
    /// What the program does to read one voxel.
    pub one_voxel: String,
    /// Whether rays can be traced through the stored volume as it is.
    pub traversable: String,
}

/// Measurements of all programs on one volume.
#[derive(Clone, Debug, Serialize)]
pub struct PeersTable {
    /// The volume's file name without its folder.
    pub volume: String,
    /// Voxels along x, y and z.
    pub dims: [u32; 3],
    /// Bytes of the volume at 4 bytes per voxel.
    pub bytes_raw: u64,
    /// All programs, Pumice first.
    pub programs: Vec<Peer>,
    /// Names of programs that the caller left out.
    pub left_out: Vec<String>,
    /// Each level of Pumice's files and each program at each setting; empty if they were not asked for.
    pub levels: Vec<Level>,
}

#[derive(Deserialize)]
struct Missing {
    missing: Vec<String>,
}

#[derive(Deserialize)]
struct Report {
    version: String,
    bytes: u64,
    compress: Took,
    decompress: Took,
    lossless: bool,
    voxel_cpu_seconds: f64,
    one_voxel: String,
}

/// Measures a volume with Pumice and all programs that are not left out. `watch` is called with a line of text when a program begins.
///
/// # Errors
/// Errors of the volume and its file; an unknown name; a missing package, which is reported before anything is measured; a program that
/// returns other voxels; [`pumice_core::Error::Cancelled`].
pub fn measure_peers(options: &PeersOptions, job: &Job, watch: &mut dyn FnMut(&str)) -> Result<PeersTable> {
    if let Some(unknown) = options.without.iter().find(|n| PEERS.iter().all(|p| p.0 != n.as_str())) {
        let names = PEERS.map(|p| p.0).join(", ");
        return Err(SessionError::Caller(format!(
            "--without: expected names among {names}, got {unknown:?}"
        )));
    }
    let asked: Vec<(&str, &str, &str)> =
        PEERS.into_iter().filter(|p| options.without.iter().all(|n| n != p.0)).collect();
    let python = Python::new(&options.python, job)?;
    if !asked.is_empty() {
        let names: Vec<&str> = asked.iter().map(|p| p.0).collect();
        let found: Missing = python.ask("the programs' packages", json!({ "check": names }))?;
        if let Some(line) = found.missing.first() {
            let more = match found.missing.len() {
                1 => String::new(),
                n => format!(" (and {} more)", n - 1),
            };
            let python = options.python.display();
            return Err(SessionError::Caller(format!("{python}: {line}{more}, or name it with --without")));
        }
    }

    let volume = open_volume(&options.volume, &OpenOptions::default(), Residence::Copied, job)?;
    let dims = volume.info().dims;
    if volume.info().voxels() == 0 {
        let path = options.volume.display();
        return Err(SessionError::Caller(format!(
            "{path}: expected a volume with voxels, got one of {dims:?} voxels"
        )));
    }
    let labels = decoded(&volume, job)?;
    drop(volume);
    let voxels = spread(dims);
    let mut programs = pumice(&options.volume, dims, &labels, &voxels, job, watch)?;

    if !asked.is_empty() {
        let (kind, bytes): (_, &[u8]) = match &labels {
            LabelBuffer::U64(v) => ("<u8", bytemuck::cast_slice(v)),
            LabelBuffer::U32(v) => ("<u4", bytemuck::cast_slice(v)),
            // `decoded` returns no other kinds.
            _ => ("|u1", &[]),
        };
        write_npy(&python.path("labels.npy"), kind, &[2, 1, 0].map(|a| dims[a] as usize), bytes)?;
    }
    drop(labels);
    let measured = |name: &str, traversable: &str, setting: Value, voxels: &[[u32; 3]]| -> Result<Peer> {
        let report: Report = python.ask(
            name,
            json!({
                "peer": name,
                "setting": setting,
                "labels": python.path("labels.npy"),
                "voxels": voxels,
                "scratch": python.path("scratch"),
            }),
        )?;
        if !report.lossless {
            let (path, version) = (options.volume.display(), &report.version);
            return Err(SessionError::Caller(format!(
                "{path}: {name} {version} returned other voxels than it was given"
            )));
        }
        Ok(Peer {
            name: name.into(),
            version: report.version,
            bytes: report.bytes,
            compress: report.compress,
            decompress: report.decompress,
            opening: report.decompress,
            voxel_cpu_seconds: report.voxel_cpu_seconds,
            one_voxel: report.one_voxel,
            traversable: traversable.into(),
        })
    };
    for &(name, _, traversable) in &asked {
        watch(name);
        programs.push(measured(name, traversable, json!({}), &voxels)?);
    }
    let mut table = PeersTable {
        volume: file_name(&options.volume),
        dims,
        bytes_raw: dims.iter().map(|&d| u64::from(d)).product::<u64>().saturating_mul(4),
        programs,
        left_out: options.without.clone(),
        levels: Vec::new(),
    };
    if options.levels {
        for (level, setting) in LEVELS {
            let name = format!("Pumice, {setting}");
            let peer = table.programs.iter().find(|p| p.name == name);
            debug_assert!(peer.is_some(), "{level:?} is measured");
            table.levels.extend(peer.map(|peer| Level::of(&table, "Pumice", setting, peer)));
        }
        for (name, usual, traversable) in asked {
            let peer = table.programs.iter().find(|p| p.name == name);
            table.levels.extend(peer.map(|peer| Level::of(&table, name, usual, peer)));
            for (_, setting, keywords) in SETTINGS.into_iter().filter(|s| s.0 == name) {
                watch(&format!("{name}, {setting}"));
                let keywords = serde_json::from_str(keywords)
                    .map_err(|e| SessionError::Caller(format!("{name}, {setting}: {e}")))?;
                let peer = measured(name, traversable, keywords, &[])?;
                table.levels.push(Level::of(&table, name, setting, &peer));
            }
        }
    }
    Ok(table)
}

/// The Python interpreter, and a temporary folder for requests and reports.
struct Python<'a> {
    interpreter: &'a Path,
    folder: tempfile::TempDir,
    job: &'a Job,
}

impl<'a> Python<'a> {
    fn new(interpreter: &'a Path, job: &'a Job) -> Result<Self> {
        let folder = scratch()?;
        let python = Self { interpreter, folder, job };
        std::fs::write(python.path("peers.py"), SCRIPT).map_err(io(python.path("peers.py")))?;
        Ok(python)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the script on a request and returns its report; `what` names the program in error texts.
    fn ask<T: serde::de::DeserializeOwned>(&self, what: &str, mut request: serde_json::Value) -> Result<T> {
        let [asked, report, said] = ["job.json", "report.json", "said.txt"].map(|name| self.path(name));
        request["report"] = json!(report);
        std::fs::write(&asked, request.to_string()).map_err(io(&asked))?;
        run_script(what, self.interpreter, &self.path("peers.py"), &asked, &said, self.job)?;
        let text = std::fs::read(&report).map_err(io(&report))?;
        serde_json::from_slice(&text).map_err(|e| {
            SessionError::Caller(format!("the report of {what} is not the JSON that was expected: {e}"))
        })
    }
}

/// Voxels spread evenly over a volume and not aligned with blocks: the additive recurrence of the plastic number (M. Roberts, "The
/// Unreasonable Effectiveness of Quasirandom Sequences", 2018).
fn spread(dims: [u32; 3]) -> Vec<[u32; 3]> {
    const PLASTIC: f64 = 1.220_744_084_605_76;
    let at = |i: u32, a: usize| {
        let share = (0.5 + f64::from(i) / PLASTIC.powi(a as i32 + 1)).fract();
        ((share * f64::from(dims[a])) as u32).min(dims[a] - 1)
    };
    (0..VOXELS).map(|i| [0, 1, 2].map(|a| at(i, a))).collect()
}

/// Measures Pumice: its files at all levels, and the form in memory.
fn pumice(
    path: &Path,
    dims: [u32; 3],
    labels: &LabelBuffer,
    voxels: &[[u32; 3]],
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<Vec<Peer>> {
    let label_type = if matches!(labels, LabelBuffer::U64(_)) { LabelType::U64 } else { LabelType::U32 };
    let mut source = ArraySource::new(VolumeInfo::new(dims, label_type), labels.clone())?;
    watch("Pumice");
    let (volume, compressing) = clocked(|| Ok(compress(&mut source, &CompressOptions::default(), job)?))?;
    drop(source);
    let folder = scratch()?;
    let file = folder.path().join("volume.pumice");

    let mut programs = Vec::new();
    for (level, name) in LEVELS {
        watch(&format!("Pumice, {name}"));
        let ((), saving) = clocked(|| Ok(volume.save(&file, level, job)?))?;
        let mut same = true;
        let mut at = 0;
        // Slabs are compared while the clock stands still, as the other programs' arrays are.
        let mut decoding = Took::default();
        let (back, opening) = clocked(|| Ok(CompressedVolume::open(&file, job)?))?;
        let mut clock = Stopwatch::start();
        each_slab(&back, job, |ids| {
            decoding = decoding + Took::since(&clock);
            same &= match labels {
                LabelBuffer::U64(v) => v[at..at + ids.len()] == ids,
                LabelBuffer::U32(v) => {
                    v[at..at + ids.len()].iter().zip(&ids).all(|(&a, &b)| u64::from(a) == b)
                }
                _ => false,
            };
            at += ids.len();
            clock = Stopwatch::start();
        })?;
        if !same {
            let path = path.display();
            return Err(SessionError::Caller(format!(
                "{path}: Pumice at level {name} returned other voxels than it was given"
            )));
        }
        programs.push(Peer {
            name: format!("Pumice, {name}"),
            version: env!("CARGO_PKG_VERSION").into(),
            bytes: std::fs::metadata(&file).map_err(io(&file))?.len(),
            compress: compressing + saving,
            decompress: opening + decoding,
            opening,
            voxel_cpu_seconds: f64::NAN,
            one_voxel: "opened once, then as in memory".into(),
            traversable: "once it is opened".into(),
        });
    }

    watch("Pumice, in memory");
    let bytes = volume.resident_parts().iter().map(|p| p.1).sum();
    // The index for single voxels does not belong to the traced form. It is built before the clock starts, as the others' readers are.
    volume.grid()?;
    let (wrong, reading) = clocked(|| {
        let ids = volume.labels().ids();
        let id = |&v: &[u32; 3]| volume.label_at(v).map(|label| label.map_or(0, |l| ids[l as usize]));
        let place = |v: &[u32; 3]| {
            (v[0] as usize) + dims[0] as usize * (v[1] as usize + dims[1] as usize * v[2] as usize)
        };
        let expected = |v: &[u32; 3]| match labels {
            LabelBuffer::U64(labels) => labels[place(v)],
            LabelBuffer::U32(labels) => u64::from(labels[place(v)]),
            _ => u64::MAX,
        };
        voxels.iter().try_fold(0, |wrong, voxel| Ok(wrong + usize::from(id(voxel)? != expected(voxel))))
    })?;
    if wrong > 0 {
        let path = path.display();
        return Err(SessionError::Caller(format!(
            "{path}: Pumice read {wrong} of {} voxels wrong",
            voxels.len()
        )));
    }
    let (ids, decoding) = clocked(|| {
        let mut count = 0;
        each_slab(&volume, job, |ids| count += ids.len())?;
        Ok(count)
    })?;
    debug_assert_eq!(ids, labels.len());
    let volume = Arc::new(volume);
    programs.push(Peer {
        name: "Pumice, in memory".into(),
        version: env!("CARGO_PKG_VERSION").into(),
        bytes,
        compress: compressing,
        decompress: decoding,
        opening: Took::default(),
        voxel_cpu_seconds: reading.cpu_seconds / voxels.len() as f64,
        one_voxel: format!("from its box, by an index of {} bytes more", volume.grid()?.bytes()),
        traversable: format!("yes, with bricks of {} bytes more", tracing_bytes(&volume)?),
    });
    Ok(programs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_are_spread_over_all_of_the_volume() {
        let dims = [7, 1, 300];
        let voxels = spread(dims);
        for (a, &dim) in dims.iter().enumerate() {
            let mut met: Vec<u32> = voxels.iter().map(|v| v[a]).collect();
            met.sort_unstable();
            met.dedup();
            assert_eq!(met, (0..dim).collect::<Vec<_>>());
        }
    }
}
