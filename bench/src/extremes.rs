//! Compresses generated worst-case volumes. Each must decompress to the same voxels, stay within a stated bound of bytes, and take time
//! that grows about linearly with the number of voxels.

pub(crate) mod command;
pub(crate) mod generated;
mod tables;

use std::path::Path;
use std::sync::Arc;

use pumice_core::{
    BlockSource, CompressOptions, CompressedVolume, CompressionLevel, Job, Verification, compress, verify,
};
use pumice_session::error::{Result, SessionError, io};
use pumice_session::file_info::acceleration_bytes;
use pumice_session::measure::peak_rss_bytes;
use serde::Serialize;

use crate::files::scratch;
use crate::timing::clocked;
use generated::{Generated, Rule};

pub use tables::write_extremes;

/// A generated volume, and its bound on bytes in memory (hierarchy and label table included), which follows from the layout:
/// `bytes_a_voxel` × voxels + `bytes_besides`.
#[derive(Clone, Copy, Debug)]
struct Extreme {
    name: &'static str,
    what: &'static str,
    rule: Rule,
    dims: [u32; 3],
    /// Bytes for each voxel of the volume, background included.
    bytes_a_voxel: f64,
    /// Bytes that do not depend on the number of voxels.
    bytes_besides: f64,
}

/// [`Extreme::bytes_besides`] of all cases: a node, tables of leaves, names.
const BESIDES: f64 = 200_000.0;

/// [`Extreme::bytes_a_voxel`] where each voxel is a label of its own, in bytes: id 8, voxel count 8, type 2, run 8, box 8, contacts with
/// three neighbours of up to 5 each, hierarchy 14.
const BYTES_A_LABEL: f64 = 63.0;

/// [`Extreme::bytes_a_voxel`] where each voxel has one of N labels at random: in each block of 16³ voxels, every label has a box of 8 bytes,
/// 14 bytes of hierarchy, a node of 24 bytes and, for each of its voxels, a reference of at most 8 bytes.
const fn noise(labels: u32) -> f64 {
    (8.0 + 14.0 + 24.0) * labels as f64 / 4096.0 + 8.0
}

const EXTREMES: [Extreme; 6] = [
    Extreme {
        name: "runs",
        what: "1 × 1 × 10⁶ voxels, runs of 7 of four labels and background",
        rule: Rule::Runs,
        dims: [1, 1, 1_000_000],
        // Every 16 voxels have a box of 4 cells for each of four labels: 8 bytes and 14 of the hierarchy each. Nodes repeat.
        bytes_a_voxel: 4.0 * 22.0 / 16.0,
        bytes_besides: BESIDES,
    },
    Extreme {
        name: "full",
        what: "2³² voxels of one label",
        rule: Rule::Full,
        dims: [2048, 2048, 1024],
        bytes_a_voxel: 22.0 / 4096.0,
        bytes_besides: BESIDES,
    },
    Extreme {
        name: "labels",
        what: "10⁷ labels of one voxel each",
        rule: Rule::OfItsOwn,
        dims: [250, 200, 200],
        bytes_a_voxel: BYTES_A_LABEL,
        bytes_besides: BESIDES,
    },
    Extreme {
        name: "checkerboard",
        what: "a checkerboard of two labels, 512³ voxels",
        rule: Rule::Checkerboard,
        dims: [512, 512, 512],
        bytes_a_voxel: 2.0 * 22.0 / 4096.0,
        bytes_besides: BESIDES,
    },
    Extreme {
        name: "noise-2",
        what: "one label or none by chance, 512³ voxels",
        rule: Rule::Noise(2),
        dims: [512, 512, 512],
        // All 64 cells of a box have different fields: the node takes 8 + 8 · 64 + 16 bytes.
        bytes_a_voxel: (22.0 + 536.0) / 4096.0,
        bytes_besides: BESIDES,
    },
    Extreme {
        name: "noise-256",
        what: "255 labels or none by chance, 256³ voxels",
        rule: Rule::Noise(256),
        dims: [256, 256, 256],
        bytes_a_voxel: noise(256),
        bytes_besides: BESIDES,
    },
];

/// Names of the cases, in the order in which they are measured.
pub const EXTREME_NAMES: [&str; 6] = ["runs", "full", "labels", "checkerboard", "noise-2", "noise-256"];

/// Largest exponent with which the CPU time of a case may grow with its voxels, from an eighth of them to all. Linear work has 1, and the
/// machine and its caches add less than half.
const MOST_EXPONENT: f64 = 1.4;

/// If the smaller volume takes fewer CPU seconds than this, the clock's resolution dominates and no exponent is computed.
const LEAST_SECONDS: f64 = 0.2;

/// Options of [`measure_extremes`].
#[derive(Clone, Debug, Default)]
pub struct ExtremesOptions {
    /// Names from [`EXTREME_NAMES`]; all cases if empty.
    pub cases: Vec<String>,
    /// Whether volumes have only a 64th of the voxels.
    pub reduced: bool,
    /// Limit of the bytes of records in memory while compressing; more go to disk ([`CompressOptions::memory_limit_bytes`]).
    pub memory_limit_bytes: Option<u64>,
}

/// Measurements of one volume.
#[derive(Clone, Debug, Serialize)]
pub struct ExtremeFigures {
    /// Voxels along x, y and z.
    pub dims: [u32; 3],
    /// Number of labels without background.
    pub labels: u64,
    /// Number of boxes.
    pub boxes: u64,
    /// Bytes in memory, with the hierarchy over the boxes.
    pub bytes_resident: u64,
    /// Upper bound of `bytes_resident` by the layout.
    pub bytes_bound: u64,
    /// Bytes of the file at the levels fast and default.
    pub bytes_disk: [u64; 2],
    /// CPU seconds of compressing, without the generator's own.
    pub compress_cpu_seconds: f64,
    /// CPU seconds of saving at both levels and opening both files.
    pub file_cpu_seconds: f64,
    /// CPU seconds of building the hierarchy.
    pub hierarchy_cpu_seconds: f64,
    /// CPU seconds of comparing every voxel with the generator's, without the generator's own.
    pub verify_cpu_seconds: f64,
    /// Peak memory of the process during all steps; `None` if the system does not report it.
    pub peak_rss_bytes: Option<u64>,
    /// CPU seconds of the generator alone.
    pub generator_cpu_seconds: f64,
}

impl ExtremeFigures {
    fn voxels(&self) -> f64 {
        self.dims.iter().map(|&d| f64::from(d)).product()
    }

    /// CPU seconds of all steps, without the generator's.
    fn cpu_seconds(&self) -> f64 {
        self.compress_cpu_seconds
            + self.file_cpu_seconds
            + self.hierarchy_cpu_seconds
            + self.verify_cpu_seconds
    }
}

/// Results of a case, measured on an eighth of its volume and on all of it.
#[derive(Clone, Debug, Serialize)]
pub struct ExtremeCase {
    /// Name from [`EXTREME_NAMES`].
    pub name: &'static str,
    /// Description of the volume.
    pub what: &'static str,
    /// Measurements of the smaller and of the whole volume.
    pub figures: [ExtremeFigures; 2],
    /// Exponent with which the CPU time grew with the voxels; `None` if the smaller volume took too little time.
    pub exponent: Option<f64>,
}

impl ExtremeCase {
    /// Whether bytes stay within their bound and time within its exponent. (A voxel that differs is an error of the measuring instead.)
    pub fn holds(&self) -> bool {
        self.figures.iter().all(|f| f.bytes_resident <= f.bytes_bound)
            && self.exponent.is_none_or(|e| e <= MOST_EXPONENT)
    }
}

/// Measures the selected cases. `watch` is called with a line of text when a volume begins.
///
/// # Errors
/// An unknown name; a voxel that differs after decompression; a memory limit that is too small; no space for the files;
/// [`pumice_core::Error::Cancelled`].
pub fn measure_extremes(
    options: &ExtremesOptions,
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<Vec<ExtremeCase>> {
    if let Some(unknown) = options.cases.iter().find(|n| !EXTREME_NAMES.contains(&n.as_str())) {
        let names = EXTREME_NAMES.join(", ");
        return Err(SessionError::Caller(format!("--case: expected names among {names}, got {unknown:?}")));
    }
    let folder = scratch()?;
    let mut cases = Vec::new();
    for extreme in EXTREMES {
        if !options.cases.is_empty() && options.cases.iter().all(|n| n != extreme.name) {
            continue;
        }
        let whole = if options.reduced { divided(extreme.dims, 64) } else { extreme.dims };
        let mut one = |dims: [u32; 3]| {
            watch(&format!("{}, {} × {} × {}", extreme.name, dims[0], dims[1], dims[2]));
            measure(&extreme, dims, options.memory_limit_bytes, folder.path(), job)
        };
        let figures = [one(divided(whole, 8))?, one(whole)?];
        let [small, large] = &figures;
        let exponent = (small.cpu_seconds() >= LEAST_SECONDS).then(|| {
            (large.cpu_seconds() / small.cpu_seconds()).ln() / (large.voxels() / small.voxels()).ln()
        });
        cases.push(ExtremeCase { name: extreme.name, what: extreme.what, figures, exponent });
    }
    Ok(cases)
}

/// Size of a volume with 1/`part` of the voxels: halves the longest axis until it has so few.
fn divided(mut dims: [u32; 3], part: u32) -> [u32; 3] {
    for _ in 0..part.ilog2() {
        let longest = (0..3).max_by_key(|&a| dims[a]).unwrap_or(0);
        dims[longest] = dims[longest].div_ceil(2);
    }
    dims
}

fn measure(
    extreme: &Extreme,
    dims: [u32; 3],
    memory_limit_bytes: Option<u64>,
    folder: &Path,
    job: &Job,
) -> Result<ExtremeFigures> {
    forget_peak();
    let source = || Generated::new(dims, extreme.rule);
    let mut generator = source();
    let ((), generating) = clocked(|| {
        while let Some(block) = generator.next_block()? {
            job.check()?;
            std::hint::black_box(&block);
        }
        Ok(())
    })?;
    let options = CompressOptions { memory_limit_bytes, ..CompressOptions::default() };
    let (volume, compressing) = clocked(|| {
        compress(&mut source(), &options, job).map_err(|e| match e {
            limit @ pumice_core::Error::Limit { .. } => {
                SessionError::Caller(format!("{}: {limit}", extreme.name))
            }
            other => other.into(),
        })
    })?;
    let file = folder.join("extreme.pumice");
    let (bytes_disk, files) = clocked(|| {
        let mut bytes = [0; 2];
        for (level, bytes) in [CompressionLevel::Fast, CompressionLevel::Default].into_iter().zip(&mut bytes)
        {
            volume.save(&file, level, job)?;
            *bytes = std::fs::metadata(&file).map_err(io(&file))?.len();
            let back = CompressedVolume::open(&file, job)?;
            if back.content_hash() != volume.content_hash() {
                return Err(SessionError::Caller(format!(
                    "{}: the file saved at level {level:?} has another content hash than the volume",
                    extreme.name
                )));
            }
        }
        Ok(bytes)
    })?;
    let volume = Arc::new(volume);
    let held: u64 = volume.resident_parts().iter().map(|p| p.1).sum();
    let (hierarchy_bytes, building) = clocked(|| acceleration_bytes(&volume))?;
    let (verified, verifying) = clocked(|| Ok(verify(&volume, &mut source(), job)?))?;
    if !matches!(verified, Verification::Same { .. }) {
        return Err(SessionError::Caller(format!("{}: {verified}", extreme.name)));
    }
    let voxels = volume.info().voxels() as f64;
    Ok(ExtremeFigures {
        dims,
        labels: volume.labels().len() as u64,
        boxes: volume.boxes().len() as u64,
        bytes_resident: held + hierarchy_bytes,
        bytes_bound: (extreme.bytes_a_voxel * voxels + extreme.bytes_besides) as u64,
        bytes_disk,
        compress_cpu_seconds: (compressing.cpu_seconds - generating.cpu_seconds).max(0.0),
        file_cpu_seconds: files.cpu_seconds,
        hierarchy_cpu_seconds: building.cpu_seconds,
        verify_cpu_seconds: (verifying.cpu_seconds - generating.cpu_seconds).max(0.0),
        peak_rss_bytes: peak_rss_bytes(),
        generator_cpu_seconds: generating.cpu_seconds,
    })
}

/// Resets the peak memory of this process where the system can (Linux: proc_pid_clear_refs(5)).
fn forget_peak() {
    // If it cannot, the peak includes earlier cases, so it is never too small.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_cases_and_parts_are_parts() {
        assert_eq!(EXTREMES.map(|e| e.name), EXTREME_NAMES);
        assert_eq!(divided([2048, 2048, 1024], 8), [1024, 1024, 512]);
        assert_eq!(divided([1, 1, 1_000_000], 64), [1, 1, 15_625]);
        assert_eq!(divided([250, 200, 200], 8), [125, 100, 100]);
    }

    #[test]
    fn a_bound_that_is_exceeded_and_time_that_grows_too_fast_are_seen() {
        let options = ExtremesOptions { cases: vec!["runs".into()], reduced: true, ..Default::default() };
        let mut case = measure_extremes(&options, &Job::new(), &mut |_| ()).unwrap().remove(0);
        assert!(case.holds(), "{case:?}");
        case.exponent = Some(2.0);
        assert!(!case.holds());
        case.exponent = None;
        case.figures[1].bytes_bound = case.figures[1].bytes_resident - 1;
        assert!(!case.holds());
    }
}
