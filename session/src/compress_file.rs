//! Compresses a label volume into a `.pumice` file, and verifies that nothing was lost.

use std::path::{Path, PathBuf};

use pumice_core::{
    CompressOptions, CompressedVolume, CompressionLevel, Job, Outputs, TypeTable, Verification,
    WrittenVolume, compress_to_file, read_input,
};
use pumice_formats::OpenOptions;
use serde::Serialize;

use crate::error::{Result, SessionError, io};
use crate::label_files::{TableFit, annotate, read_table};
use crate::measure::Stopwatch;
use crate::resumable::check_no_leftovers;

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
    check_no_leftovers(&request.output)?;
    let labels = LabelsGiven::read(request.types.as_deref(), request.table.as_deref(), outputs)?;
    let mut source = pumice_formats::open(&request.input, &request.reading)?;
    let options = CompressOptions {
        threads: request.threads.unwrap_or(0),
        memory_limit_bytes: request.memory_limit_bytes,
        types: labels.types.clone(),
        ..CompressOptions::default()
    };
    let (written, fit) = labels.describing(|describe| {
        compress_to_file(source.as_mut(), &request.output, request.level, &options, describe, job)
            .map_err(|e| limit_error(e, &request.input, request.memory_limit_bytes))
    })?;
    Ok(CompressOutcome::of(&written, &clock, request.reading.warnings.list(), fit))
}

/// An error of compressing `input`, which says of a memory limit that it is an option.
pub(crate) fn limit_error(error: pumice_core::Error, input: &Path, given: Option<u64>) -> SessionError {
    match error {
        pumice_core::Error::Limit { what, limit, got } if Some(limit) == given => {
            let (input, what) = (input.display(), what.replacen(" of memory", "", 1));
            SessionError::Caller(format!(
                "{input}: --memory-limit {limit} is too small: {got} {what} are needed"
            ))
        }
        other => other.into(),
    }
}

impl CompressOutcome {
    /// What was written since `clock` was started.
    pub(crate) fn of(
        written: &WrittenVolume,
        clock: &Stopwatch,
        warnings: Vec<String>,
        table: Option<TableFit>,
    ) -> Self {
        Self {
            seconds: clock.seconds(),
            cpu_seconds: clock.cpu_seconds(),
            dims: written.dims,
            labels: written.labels,
            boxes: written.boxes,
            bytes_raw: written.dims.iter().fold(4, |bytes: u64, &d| bytes.saturating_mul(d.into())),
            bytes_disk: written.bytes_disk,
            bytes_volume: written.bytes_volume,
            warnings,
            table,
        }
    }
}

/// Gives names, types and numbers to the labels of a volume without boxes.
pub(crate) type Describe<'d> = &'d mut (dyn FnMut(&mut CompressedVolume) -> pumice_core::Result<()> + Send);

/// What a caller says of the labels, read before the work.
pub(crate) struct LabelsGiven {
    pub(crate) types: Option<TypeTable>,
    table: Option<(pumice_core::AnnotationTable, Vec<String>)>,
}

impl LabelsGiven {
    /// Reads the files that are given; neither may be an output.
    pub(crate) fn read(types: Option<&Path>, table: Option<&Path>, outputs: &Outputs) -> Result<Self> {
        types.iter().chain(&table).try_for_each(|table| outputs.check_input(table))?;
        Ok(Self { types: types.map(read_types).transpose()?, table: table.map(read_table).transpose()? })
    }

    /// Calls `write` with the function that describes labels; returns how the table fits, too.
    pub(crate) fn describing<T>(
        self,
        write: impl FnOnce(Describe<'_>) -> Result<T>,
    ) -> Result<(T, Option<TableFit>)> {
        let (mut fit, mut failure, mut table) = (None, None, self.table);
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
        let written = write(&mut describe);
        match failure {
            Some(error) => Err(error),
            None => Ok((written?, fit)),
        }
    }
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
