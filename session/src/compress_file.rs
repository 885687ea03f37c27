//! Compresses a label volume into a `.pumice` file, and verifies that nothing was lost.

use std::path::{Path, PathBuf};

use pumice_core::{
    CompressOptions, CompressedVolume, CompressionLevel, Job, TypeTable, Verification, compress_to_file,
    read_input,
};
use pumice_formats::OpenOptions;
use serde::Serialize;

use crate::error::{Result, SessionError, io};
use crate::label_files::{TableFit, annotate, read_table};
use crate::measure::Stopwatch;

/// Input, output and options of [`compress_file`].
#[derive(Clone, Debug)]
pub struct CompressRequest {
    /// Label volume.
    pub input: PathBuf,
    /// The `.pumice` file.
    pub output: PathBuf,
    /// How to read the input.
    pub reading: OpenOptions,
    /// How much time to spend on a smaller file.
    pub level: CompressionLevel,
    /// Threads; `None` takes all cores.
    pub threads: Option<usize>,
    /// Bytes of memory to work with; what does not fit goes to temporary files.
    pub memory_limit_bytes: Option<u64>,
    /// CSV table with the columns id,type: the type of each label.
    pub types: Option<PathBuf>,
    /// Table of labels in any format of `pumice_formats::label_tables`: names, types, colours and numbers.
    pub table: Option<PathBuf>,
}

/// Sizes and times of a compression.
#[derive(Clone, Debug, Serialize)]
pub struct CompressOutcome {
    /// Wall seconds, reading and writing included.
    pub seconds: f64,
    /// CPU seconds of the process in that time.
    pub cpu_seconds: f64,
    /// Voxels along x, y, z.
    pub dims: [u32; 3],
    /// Number of labels, without the background.
    pub labels: u64,
    /// Number of boxes.
    pub boxes: u64,
    /// Size of the raw volume at four bytes per voxel.
    pub bytes_raw: u64,
    /// Bytes of the file.
    pub bytes_disk: u64,
    /// Bytes of the compressed form in memory, without the hierarchy that rays need, which is built when it is rendered.
    pub bytes_volume: u64,
    /// Warnings of the reader about the input, one line each.
    pub warnings: Vec<String>,
    /// How the table of labels fits the volume; `None` without a table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<TableFit>,
}

/// Compresses a file into a `.pumice` file.
///
/// # Errors
/// One line that says what is wrong with the input, the output or the limits; the output name is then unchanged, and no new file
/// stands there.
pub fn compress_file(request: &CompressRequest, job: &Job) -> Result<CompressOutcome> {
    let clock = Stopwatch::start();
    let outputs = &request.reading.outputs;
    outputs.declare(&request.output)?;
    request.types.iter().chain(&request.table).try_for_each(|table| outputs.check_input(table))?;
    let types = request.types.as_deref().map(read_types).transpose()?;
    let table = request.table.as_deref().map(read_table).transpose()?;
    let mut source = pumice_formats::open(&request.input, &request.reading)?;
    let options = CompressOptions {
        threads: request.threads.unwrap_or(0),
        memory_limit_bytes: request.memory_limit_bytes,
        types,
        ..CompressOptions::default()
    };
    let (mut fit, mut failure) = (None, None);
    let mut table = table;
    let mut describe = |volume: &mut CompressedVolume| {
        let Some((table, notes)) = table.take() else { return Ok(()) };
        match annotate(volume, &table, notes) {
            Ok(of_table) => {
                fit = Some(of_table);
                Ok(())
            }
            Err(error) => {
                // The error itself is returned below.
                failure = Some(error);
                Err(pumice_core::Error::Cancelled)
            }
        }
    };
    let written =
        compress_to_file(source.as_mut(), &request.output, request.level, &options, &mut describe, job);
    if let Some(error) = failure {
        return Err(error);
    }
    let written = written.map_err(|e| match e {
        pumice_core::Error::Limit { what, limit, got } if Some(limit) == request.memory_limit_bytes => {
            let (input, what) = (request.input.display(), what.replacen(" of memory", "", 1));
            SessionError::Caller(format!(
                "{input}: --memory-limit {limit} is too small: {got} {what} are needed"
            ))
        }
        other => other.into(),
    })?;
    Ok(CompressOutcome {
        seconds: clock.seconds(),
        cpu_seconds: clock.cpu_seconds(),
        dims: written.dims,
        labels: written.labels,
        boxes: written.boxes,
        bytes_raw: written.dims.iter().fold(4, |bytes: u64, &d| bytes.saturating_mul(d.into())),
        bytes_disk: written.bytes_disk,
        bytes_volume: written.bytes_volume,
        warnings: request.reading.warnings.list(),
        table: fit,
    })
}

/// Compares every voxel and id of a `.pumice` file with a label volume.
///
/// # Errors
/// When either file cannot be read to its end.
pub fn verify_file(pumice: &Path, input: &Path, reading: &OpenOptions, job: &Job) -> Result<Verification> {
    let volume = CompressedVolume::open(pumice, job)?;
    let mut source = pumice_formats::open(input, reading)?;
    Ok(pumice_core::verify(&volume, source.as_mut(), job)?)
}

/// Largest table of types that is read: 10⁷ labels with names of some 90 bytes.
const TYPES_LIMIT_BYTES: u64 = 1 << 30;

/// The table of types in a CSV file id,type.
///
/// # Errors
/// One line that says what is wrong with the file, and where.
pub fn read_types(path: &Path) -> Result<TypeTable> {
    let fault = |what: String| SessionError::Caller(format!("{}: {what}", path.display()));
    let bytes = read_input(path, TYPES_LIMIT_BYTES).map_err(io(path))?;
    let text =
        String::from_utf8(bytes).map_err(|e| fault(format!("expected text in UTF-8: {}", e.utf8_error())))?;
    TypeTable::parse_csv(&text).map_err(|e| fault(e.to_string()))
}
