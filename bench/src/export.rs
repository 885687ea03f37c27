//! Measures exports: bytes, seconds and memory of each format, beside other writers of USD that get the same arrays, and what Blender takes to
//! read the files.
//!
//! ```text
//! cubes, or a volume ─► .pumice ─► this program again, for each form and format: find the surface, write ──► rows
//!                                                  └─► .usdc ─► its arrays as files ─┬─► usd-core in a Python ──► rows
//!                                                                                    └─► the crate openusd ────► rows
//!                                                  └─► .usdc, .glb ─► Blender: import, the first sample ────────► rows
//! ```
//! Each measurement is a process of its own, so that its peak of memory is its own. A file of another writer is read back and compared.

mod blender;
pub(crate) mod command;
mod one;
mod peers;
mod tables;

use std::path::{Path, PathBuf};

use pumice_core::{CompressOptions, CompressionLevel, Job, compress};
use pumice_formats::OpenOptions;
use pumice_session::error::{Result, SessionError, io};
use pumice_session::{CompressRequest, Form, compress_file};
use serde::Serialize;

use crate::extremes::generated::{Generated, Rule};
use crate::files::{file_name, scratch};
use crate::timing::Took;
use blender::Blender;
use one::Program;
use peers::Peers;

pub use blender::Imported;
pub use tables::write_export;

/// Formats that are measured, by the endings of their files. A `.gltf` has the bytes of a `.glb` in two files.
pub const FORMATS: [&str; 7] = ["usda", "usdc", "usdz", "glb", "ply", "obj", "stl"];

/// Options of [`measure_export`].
#[derive(Clone, Debug)]
pub struct ExportBenchOptions {
    /// Label volumes or `.pumice` files, whose visible surfaces are exported besides.
    pub volumes: Vec<PathBuf>,
    /// Numbers of boxes of generated volumes.
    pub boxes: Vec<u32>,
    /// Rounds of each measurement of a writer: the least times and the largest peak count.
    pub rounds: u32,
    /// Python interpreter that has usd-core; `None` leaves it and the crate out.
    pub python: Option<PathBuf>,
    /// The program of `bench/openusd`.
    pub openusd: Option<PathBuf>,
    /// Blender, or a Python that has it as a module.
    pub blender: Option<PathBuf>,
    /// Seconds after which an import is given up.
    pub most_seconds: u32,
}

/// A file and what writing it took.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WrittenRow {
    /// The volume's name.
    pub volume: String,
    /// Name of the form.
    pub form: String,
    /// Ending of the file.
    pub format: String,
    /// Who wrote it, with its version.
    pub writer: String,
    /// Faces of the surface.
    pub faces: u64,
    /// Boxes of the instancer.
    pub boxes: u64,
    /// Bytes of the file, and of one beside it.
    pub bytes: u64,
    /// Opening the volume and finding what is seen of it; `None` for those who get arrays.
    pub prepare: Option<Took>,
    /// From there to a synced file.
    pub write: Took,
    /// Largest resident set of the process; `None` where the system does not report it.
    pub peak_rss_bytes: Option<u64>,
}

/// Measurements of all volumes.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ExportFigures {
    /// Files, ours first within each form.
    pub written: Vec<WrittenRow>,
    /// Imports of files of [`ExportFigures::written`].
    pub imported: Vec<Imported>,
    /// What was not measured, and why.
    pub left_out: Vec<String>,
}

/// A volume that is exported, in these forms.
struct Subject {
    name: String,
    file: PathBuf,
    /// Boxes that it must have; `None` where that is not known.
    boxes: Option<u64>,
    forms: Vec<Form>,
}

/// Measures all volumes. `watch` is called with a line of text when a measurement begins.
///
/// # Errors
/// Errors of the volumes and of the programs; a missing package, before anything is measured; a file of another writer that has other
/// arrays than it was given; [`pumice_core::Error::Cancelled`].
pub fn measure_export(
    options: &ExportBenchOptions,
    job: &Job,
    watch: &mut dyn FnMut(&str),
) -> Result<ExportFigures> {
    let program = Program::this()?;
    let folder = scratch()?;
    let peers = Peers::new(options, folder.path(), job)?;
    let blender = options.blender.as_deref().map(|p| Blender::new(p, options.most_seconds)).transpose()?;
    let mut figures = ExportFigures { left_out: left_out(options), ..ExportFigures::default() };
    let generated = options.boxes.iter().map(|&boxes| (None, boxes));
    let given = options.volumes.iter().map(|volume| (Some(volume), 0));
    for (volume, boxes) in generated.chain(given) {
        let subject = match volume {
            None => cubes(boxes, folder.path(), job)?,
            Some(volume) => real(volume, folder.path(), job)?,
        };
        for &form in &subject.forms {
            let file = |ending: &str| folder.path().join(format!("o.{ending}"));
            for format in FORMATS.into_iter().filter(|f| is_held(form, f)) {
                watch(&format!("{}, {}, .{format}", subject.name, form.name()));
                let mut row = program.measure(&subject.file, &file(format), form, options.rounds, job)?;
                row.volume.clone_from(&subject.name);
                check_count(&subject, form, &row)?;
                figures.written.push(row);
            }
            figures.written.extend(peers.measure(&subject.name, form, &file("usdc"), job, watch)?);
            if let Some(blender) = &blender {
                for format in ["usdc", "glb"] {
                    watch(&format!("{}, {}, .{format} into Blender", subject.name, form.name()));
                    let imported = blender.measure(&file(format), folder.path(), job)?;
                    let (volume, form) = (subject.name.clone(), form.name().into());
                    figures.imported.push(Imported { volume, form, ..imported });
                }
            }
            for format in FORMATS {
                remove(&file(format))?;
            }
        }
        remove(&subject.file)?;
    }
    Ok(figures)
}

/// Whether a format holds a form: instances are of USD and glTF.
fn is_held(form: Form, format: &str) -> bool {
    form != Form::Instances || !matches!(format, "ply" | "obj" | "stl")
}

/// What the options leave out, in a line each.
fn left_out(options: &ExportBenchOptions) -> Vec<String> {
    let mut lines = Vec::new();
    if options.volumes.is_empty() {
        lines.push("the surface of a real volume: none was given".to_owned());
    }
    for (name, is_there, flag) in [
        ("usd-core", options.python.is_some(), "without it"),
        ("the crate openusd", options.openusd.is_some() && options.python.is_some(), "no --openusd"),
        ("the import into Blender", options.blender.is_some(), "no --blender"),
    ] {
        if !is_there {
            lines.push(format!("{name}: {flag}"));
        }
    }
    lines
}

/// A volume of so many cubes that touch nothing, each of 4³ voxels: a box with six faces.
fn cubes(boxes: u32, folder: &Path, job: &Job) -> Result<Subject> {
    let [x, y, z] = factors(boxes);
    let mut source = Generated::new([8 * x, 8 * y, 8 * z], Rule::Cubes);
    let volume = compress(&mut source, &CompressOptions::default(), job)?;
    let file = folder.join("cubes.pumice");
    volume.save(&file, CompressionLevel::Fast, job)?;
    let name = format!("{boxes} cubes");
    Ok(Subject { name, file, boxes: Some(boxes.into()), forms: vec![Form::Instances, Form::Boxes] })
}

/// Three numbers with this product, as near to each other as it allows.
fn factors(product: u32) -> [u32; 3] {
    let divisor = |n: u32, root: f64| {
        (1..=n).filter(|d| n.is_multiple_of(*d)).rfind(|&d| f64::from(d) <= root + 1e-9).unwrap_or(1)
    };
    let x = divisor(product, f64::from(product).cbrt());
    let y = divisor(product / x, f64::from(product / x).sqrt());
    [product / x / y, y, x]
}

fn real(volume: &Path, folder: &Path, job: &Job) -> Result<Subject> {
    let file = folder.join("real.pumice");
    let request = CompressRequest {
        inputs: vec![volume.to_owned()],
        time_steps: None,
        output: file.clone(),
        reading: OpenOptions::default(),
        level: CompressionLevel::Fast,
        threads: None,
        memory_limit_bytes: None,
        types: None,
        table: None,
    };
    compress_file(&request, job)?;
    Ok(Subject { name: file_name(volume), file, boxes: None, forms: vec![Form::Voxels] })
}

/// Checks that a generated volume has as many boxes, or faces, as its rule gives.
fn check_count(subject: &Subject, form: Form, row: &WrittenRow) -> Result<()> {
    let Some(boxes) = subject.boxes else { return Ok(()) };
    let (expected, got) = match form {
        Form::Instances => (boxes, row.boxes),
        _ => (6 * boxes, row.faces),
    };
    if expected == got {
        return Ok(());
    }
    let (name, form, format) = (&subject.name, form.name(), &row.format);
    Err(SessionError::Caller(format!(
        "{name}, {form}, .{format}: expected {expected} boxes or faces, got {got}"
    )))
}

fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(io(path)(error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubes_fill_a_block_that_is_nearly_a_cube() {
        for (product, expected) in [
            (1_000_000, [100; 3]),
            (100_000, [50, 50, 40]),
            (10_000, [25, 20, 20]),
            (7, [7, 1, 1]),
            (1, [1; 3]),
        ] {
            assert_eq!(factors(product), expected);
        }
    }
}
