//! Compresses a label volume into a `.pumice` file, and verifies that nothing was lost.

use std::path::{Path, PathBuf};

use pumice_core::{
    CompressOptions, CompressedVolume, CompressionLevel, Job, Outputs, Series, SeriesSource, TypeTable,
    Verification, WrittenVolume, compress_series_to_file, compress_to_file, frames_in_file, read_input,
};
use pumice_formats::{OpenOptions, TimeSteps, is_pattern, open_series};
use serde::Serialize;

use crate::error::{Result, SessionError, io};
use crate::label_files::{Describe, TableFit, describing, read_table};
use crate::measure::Stopwatch;
use crate::resumable::check_no_leftovers;
use crate::rewrite_file::rewrite_file;

/// Input, output and options of [`compress_file`].
#[derive(Clone, Debug)]
pub struct CompressRequest {
    /// Label volume; several files, or a name with `{t}` in place of a number, are the frames of a time series.
    pub inputs: Vec<PathBuf>,
    /// Which time steps of the input become frames of one file; `None` where the input is one volume, or all of a series of files.
    pub time_steps: Option<TimeSteps>,
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
    /// Number of frames of a time series; `None` where the file has one volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_steps: Option<u32>,
    /// Number of labels, without the background.
    pub labels: u64,
    /// Number of boxes, of all frames.
    pub boxes: u64,
    /// Size of the raw volume, with all frames, at four bytes per voxel.
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

/// Compresses a file into a `.pumice` file. A `.pumice` file is written anew, at this level and with what the table says of its labels.
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
    if let Some(rewritten) = rewrite_file(request, &labels, job)? {
        return Ok(rewritten);
    }
    let series = open_series(&request.inputs, request.time_steps, &request.reading)?;
    let options = CompressOptions {
        threads: request.threads.unwrap_or(0),
        memory_limit_bytes: request.memory_limit_bytes,
        types: labels.types.clone(),
        ..CompressOptions::default()
    };
    let (to, level, limit) = (&request.output, request.level, request.memory_limit_bytes);
    let (written, fit) = labels.describing(|describe| match (series, &request.inputs[..]) {
        (Some(mut series), [input, ..]) => {
            compress_series_to_file(&mut series, to, level, &options, describe, job)
                .map_err(|e| limit_error(e, input, limit))
        }
        (None, [input, ..]) => {
            let mut source = pumice_formats::open(input, &request.reading)?;
            compress_to_file(source.as_mut(), to, level, &options, describe, job)
                .map_err(|e| limit_error(e, input, limit))
        }
        (_, []) => Err(SessionError::Caller("expected a label volume, got none".into())),
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
            time_steps: (written.frames > 1).then_some(written.frames),
            labels: written.labels,
            boxes: written.boxes,
            bytes_raw: written
                .dims
                .iter()
                .fold(4 * u64::from(written.frames), |bytes, &d| bytes.saturating_mul(d.into())),
            bytes_disk: written.bytes_disk,
            bytes_volume: written.bytes_volume,
            warnings,
            table,
        }
    }
}

/// What a caller says of the labels, read before the work.
#[derive(Debug)]
pub struct LabelsGiven {
    pub(crate) types: Option<TypeTable>,
    table: Option<(pumice_core::AnnotationTable, Vec<String>)>,
}

impl LabelsGiven {
    /// Types, or a table.
    pub fn new(types: Option<TypeTable>, table: Option<pumice_core::AnnotationTable>) -> Self {
        Self { types, table: table.map(|table| (table, Vec::new())) }
    }

    /// Reads the files that are given; neither may be an output.
    pub(crate) fn read(types: Option<&Path>, table: Option<&Path>, outputs: &Outputs) -> Result<Self> {
        types.iter().chain(&table).try_for_each(|table| outputs.check_input(table))?;
        Ok(Self { types: types.map(read_types).transpose()?, table: table.map(read_table).transpose()? })
    }

    /// Calls `write` with the function that describes labels; returns how the table fits, too.
    pub(crate) fn describing<T>(
        &self,
        write: impl FnOnce(Describe<'_>) -> Result<T>,
    ) -> Result<(T, Option<TableFit>)> {
        describing(self.table.as_ref().map(|(table, notes)| (table, notes.clone())), write)
    }
}

/// What [`verify_file`] found.
#[derive(Clone, Debug)]
pub struct Verified {
    /// The last frame of a time series that was compared; `None` where the file has one volume.
    pub time_step: Option<u32>,
    /// Whether all voxels are the same, or the first difference.
    pub found: Verification,
}

impl std::fmt::Display for Verified {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.time_step {
            Some(step) => write!(f, "time step {step}: {}", self.found),
            None => self.found.fmt(f),
        }
    }
}

/// Compares every voxel and id of a `.pumice` file with a label volume. Of a time series it compares the time step that `reading` chooses, or
/// all of them with the time steps of `inputs`, or with `time_steps` of these.
///
/// # Errors
/// When a file cannot be read to its end; where the numbers of time steps differ.
pub fn verify_file(
    pumice: &Path,
    inputs: &[PathBuf],
    time_steps: Option<TimeSteps>,
    reading: &OpenOptions,
    job: &Job,
) -> Result<Verified> {
    let Some(input) = inputs.first() else {
        return Err(SessionError::Caller("expected a label volume, got none".into()));
    };
    let frames = frames_in_file(pumice)?;
    let is_one = inputs.len() == 1 && !is_pattern(input) && time_steps.is_none();
    if frames == 1 && is_one {
        let volume = CompressedVolume::open(pumice, job)?;
        let mut source = pumice_formats::open(input, reading)?;
        return Ok(Verified { time_step: None, found: pumice_core::verify(&volume, source.as_mut(), job)? });
    }
    // A file of one time step is compared as it is.
    let all = OpenOptions { time: None, ..reading.clone() };
    let has_several =
        is_one && pumice_formats::probe(input, &all)?.choices.iter().any(|c| c.keyword == "time");
    if let Some(step) = reading.time.filter(|_| is_one) {
        let series = Series::open(pumice, job)?;
        let mut source = pumice_formats::open(input, if has_several { reading } else { &all })?;
        let found = pumice_core::verify(&series.frame(step, job)?, source.as_mut(), job)?;
        return Ok(Verified { time_step: Some(step), found });
    }
    let sources = open_series(inputs, time_steps.or(has_several.then_some(TimeSteps::All)), reading)?;
    let given = sources.as_ref().map_or(1, |sources| sources.frames());
    let Some(sources) = sources.filter(|_| given == frames) else {
        return Err(SessionError::Caller(format!(
            "{}: the file has {}, got {given}: {}",
            pumice.display(),
            if frames == 1 { "1 time step".into() } else { format!("{frames} time steps") },
            inputs.iter().map(|input| input.display().to_string()).collect::<Vec<_>>().join(", ")
        )));
    };
    let opened = if frames == 1 { None } else { Some(Series::open(pumice, job)?) };
    let mut voxels = 0;
    for step in 0..frames {
        let mut source = sources.open(step)?;
        let found = match &opened {
            Some(series) => pumice_core::verify(&series.frame(step, job)?, source.as_mut(), job)?,
            None => pumice_core::verify(&CompressedVolume::open(pumice, job)?, source.as_mut(), job)?,
        };
        match found {
            Verification::Same { voxels: more } => voxels += more,
            found => return Ok(Verified { time_step: opened.is_some().then_some(step), found }),
        }
    }
    Ok(Verified { time_step: None, found: Verification::Same { voxels } })
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
