//! Compresses some chunks of a volume into a part, and joins parts to the volume's file.

use std::path::PathBuf;

use pumice_core::{
    ChunkGrid, ChunkSet, CompressOptions, CompressionLevel, Job, Outputs, VolumeInfo, VoxelRegion,
    compress_part, merge_parts,
};
use pumice_formats::{OpenOptions, Warnings};
use serde::Serialize;

use crate::compress_file::{CompressOutcome, LabelsGiven, limit_error};
use crate::error::{Result, SessionError};
use crate::measure::Stopwatch;
use crate::source_fingerprint::source_of;

/// Input, output and options of [`compress_part_file`].
#[derive(Clone, Debug)]
pub struct PartRequest {
    /// Label volume.
    pub input: PathBuf,
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

/// The description of a volume, without the warnings of its reader.
pub(crate) fn info_of(input: &std::path::Path, reading: &OpenOptions) -> Result<VolumeInfo> {
    let silent = OpenOptions { warnings: Warnings::default(), ..reading.clone() };
    Ok(pumice_formats::probe(input, &silent)?.info)
}

/// Compresses some chunks of a volume into a part.
///
/// # Errors
/// One line that says what is wrong with the input, the chunks, the output or the limits; the output name is then unchanged.
pub fn compress_part_file(request: &PartRequest, job: &Job) -> Result<PartOutcome> {
    let clock = Stopwatch::start();
    request.reading.outputs.declare(&request.output)?;
    let info = info_of(&request.input, &request.reading)?;
    let written = write_part(request, &info, job)?;
    Ok(PartOutcome {
        seconds: clock.seconds(),
        cpu_seconds: clock.cpu_seconds(),
        dims: written.dims,
        chunks: request.chunks.clone(),
        of: ChunkGrid::new(written.dims).chunks(),
        labels: written.labels,
        boxes: written.boxes,
        bytes_disk: written.bytes_disk,
        warnings: request.reading.warnings.list(),
    })
}

/// Writes a part of the volume that `info` describes.
pub(crate) fn write_part(
    request: &PartRequest,
    info: &VolumeInfo,
    job: &Job,
) -> Result<pumice_core::WrittenVolume> {
    let grid = ChunkGrid::new(info.dims);
    let of_input = |e: pumice_core::Error| SessionError::Caller(format!("{}: {e}", request.input.display()));
    request.chunks.check(&grid).map_err(of_input)?;
    let regions: Vec<VoxelRegion> = request.chunks.iter().filter_map(|number| grid.region(number)).collect();
    let from = source_of(&request.input, &request.reading)?;
    let mut source = pumice_formats::open_regions(&request.input, &request.reading, &regions)?;
    let options = CompressOptions {
        threads: request.threads.unwrap_or(0),
        memory_limit_bytes: request.memory_limit_bytes,
        ..CompressOptions::default()
    };
    compress_part(source.as_mut(), &request.chunks, &from, &request.output, &options, job)
        .map_err(|e| limit_error(e, &request.input, request.memory_limit_bytes))
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

/// Joins the parts of a volume to the file that compressing it at once gives.
///
/// # Errors
/// One line that names the part which is damaged or does not belong to the others, or the chunks that are missing; the output name is then
/// unchanged.
pub fn merge_files(request: &MergeRequest, outputs: &Outputs, job: &Job) -> Result<CompressOutcome> {
    let clock = Stopwatch::start();
    outputs.declare(&request.output)?;
    request.parts.iter().try_for_each(|part| outputs.check_input(part))?;
    let labels = LabelsGiven::read(request.types.as_deref(), request.table.as_deref(), outputs)?;
    let options = CompressOptions {
        threads: request.threads.unwrap_or(0),
        memory_limit_bytes: request.memory_limit_bytes,
        types: labels.types.clone(),
        ..CompressOptions::default()
    };
    let (written, fit) = labels.describing(|describe| {
        Ok(merge_parts(&request.parts, &request.output, request.level, &options, describe, job)?)
    })?;
    Ok(CompressOutcome::of(&written, &clock, Vec::new(), fit))
}
