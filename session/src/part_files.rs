//! Compresses some chunks of a volume or of a time series into a part, and joins parts to the file of all chunks.

use std::path::PathBuf;

use pumice_core::{
    ChunkGrid, ChunkSet, CompressOptions, CompressionLevel, Job, Outputs, TypeTable, WrittenVolume,
    merge_into_part, merge_parts, read_part,
};
use pumice_formats::{OpenOptions, TimeSteps};
use serde::Serialize;

use crate::compress_file::{CompressOutcome, LabelsGiven};
use crate::error::Result;
use crate::measure::Stopwatch;
use crate::part_input::{PartGroup, PartInput, PartWriter};

/// Input, output and options of [`compress_part_file`].
#[derive(Clone, Debug)]
pub struct PartRequest {
    /// Label volume; several files, or a name with `{t}` in place of a number, are the frames of a time series.
    pub inputs: Vec<PathBuf>,
    /// Which time steps of the input are frames; `None` where the input is one volume, or all of a series of files.
    pub time_steps: Option<TimeSteps>,
    /// The part.
    pub output: PathBuf,
    /// Numbers of its chunks.
    pub chunks: ChunkSet,
    /// How to read the input.
    pub reading: OpenOptions,
    /// Threads; `None` takes all cores.
    pub threads: Option<usize>,
    /// Bytes of memory to work with; what does not fit goes to temporary files.
    pub memory_limit_bytes: Option<u64>,
}

/// What a part holds, and the time that it took.
#[derive(Clone, Debug, Serialize)]
pub struct PartOutcome {
    /// Wall seconds, reading and writing included.
    pub seconds: f64,
    /// CPU seconds of the process in that time.
    pub cpu_seconds: f64,
    /// Voxels of the whole volume along x, y, z.
    pub dims: [u32; 3],
    /// Number of frames of a time series; `None` where the part is of one volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_steps: Option<u32>,
    /// Numbers of the part's chunks: `0,4-7`.
    pub chunks: ChunkSet,
    /// Number of chunks of the whole volume.
    pub of: u64,
    /// Number of the part's labels, without the background.
    pub labels: u64,
    /// Number of the part's boxes.
    pub boxes: u64,
    /// Bytes of the part.
    pub bytes_disk: u64,
    /// Warnings of the reader about the input, one line each.
    pub warnings: Vec<String>,
}

/// Compresses some chunks of a volume, or of a time series at all frames, into a part.
///
/// # Errors
/// One line that says what is wrong with the input, the chunks, the output or the limits; the output name is then unchanged.
pub fn compress_part_file(request: &PartRequest, job: &Job) -> Result<PartOutcome> {
    let clock = Stopwatch::start();
    request.reading.outputs.declare(&request.output)?;
    let input = PartInput::new(&request.inputs, request.time_steps, &request.reading)?;
    let (source, info) = (input.source()?, input.info()?);
    let limits = (request.threads, request.memory_limit_bytes);
    let group = PartGroup { parts: vec![(request.chunks.clone(), &*request.output)], kept: None };
    let mut written = PartWriter::new(&input, (&source, &info), limits).write(group, job)?;
    let written = written.remove(0);
    Ok(PartOutcome::of(&written, request.chunks.clone(), &clock, request.reading.warnings.list()))
}

impl PartOutcome {
    fn of(written: &WrittenVolume, chunks: ChunkSet, clock: &Stopwatch, warnings: Vec<String>) -> Self {
        Self {
            seconds: clock.seconds(),
            cpu_seconds: clock.cpu_seconds(),
            dims: written.dims,
            time_steps: (written.frames > 1).then_some(written.frames),
            chunks,
            of: ChunkGrid::new(written.dims).chunks(),
            labels: written.labels,
            boxes: written.boxes,
            bytes_disk: written.bytes_disk,
            warnings,
        }
    }
}

/// Parts, output and options of [`merge_files`].
#[derive(Clone, Debug)]
pub struct MergeRequest {
    /// The parts, in any order.
    pub parts: Vec<PathBuf>,
    /// The `.pumice` file.
    pub output: PathBuf,
    /// How much time to spend on a smaller file.
    pub level: CompressionLevel,
    /// Threads; `None` takes all cores.
    pub threads: Option<usize>,
    /// Bytes of memory to work with.
    pub memory_limit_bytes: Option<u64>,
    /// CSV table with the columns id,type: the type of each label.
    pub types: Option<PathBuf>,
    /// Table of labels in any format of `pumice_formats::label_tables`.
    pub table: Option<PathBuf>,
}

/// Joins the parts of a volume or of a time series to the file that compressing it at once gives.
///
/// # Errors
/// One line that names the part which is damaged or does not belong to the others, or the chunks that are missing; the output name is then
/// unchanged.
pub fn merge_files(request: &MergeRequest, outputs: &Outputs, job: &Job) -> Result<CompressOutcome> {
    let clock = Stopwatch::start();
    outputs.declare(&request.output)?;
    request.parts.iter().try_for_each(|part| outputs.check_input(part))?;
    let labels = LabelsGiven::read(request.types.as_deref(), request.table.as_deref(), outputs)?;
    merge_with(request, labels, &clock, job)
}

/// Joins parts of a volume or of a time series, not all of them, to one part: that of all their chunks. The request's level, types and table have
/// no effect.
///
/// # Errors
/// As [`merge_files`]; but chunks may be missing.
pub fn merge_part_files(request: &MergeRequest, outputs: &Outputs, job: &Job) -> Result<PartOutcome> {
    let clock = Stopwatch::start();
    outputs.declare(&request.output)?;
    request.parts.iter().try_for_each(|part| outputs.check_input(part))?;
    let options = request.options(None);
    let written = merge_into_part(&request.parts, &request.output, &options, job)?;
    let chunks = read_part(&request.output, job)?.chunks;
    Ok(PartOutcome::of(&written, chunks, &clock, Vec::new()))
}

impl MergeRequest {
    fn options(&self, types: Option<TypeTable>) -> CompressOptions {
        CompressOptions {
            threads: self.threads.unwrap_or(0),
            memory_limit_bytes: self.memory_limit_bytes,
            types,
            ..CompressOptions::default()
        }
    }
}

/// Joins parts with labels that were read, whatever files the request names.
pub(crate) fn merge_with(
    request: &MergeRequest,
    labels: LabelsGiven,
    clock: &Stopwatch,
    job: &Job,
) -> Result<CompressOutcome> {
    let options = request.options(labels.types.clone());
    let (written, fit) = labels.describing(|describe| {
        Ok(merge_parts(&request.parts, &request.output, request.level, &options, describe, job)?)
    })?;
    Ok(CompressOutcome::of(&written, clock, Vec::new(), fit))
}
